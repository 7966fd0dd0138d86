//! An epsilon that was estimated over a drive, with its curve and its cost.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{Curve, Estimate};
use crate::codec;
use crate::error::Result;
use crate::model::FieldSpace;

/// Halo of the step `epsilon` in metres. Most points of a street have their 40 nearest neighbours within it
/// (chosen; the run reports the share of points that ask for more).
pub(crate) const HALO_M: f64 = 2.0;

/// What exact results at the borders of tiles cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct AskingCost {
    /// Points that asked for more than core and halo.
    pub(crate) asked: u64,
    /// Points that were read for them.
    pub(crate) read: u64,
    /// Points of core and halo.
    pub(crate) gathered: u64,
}

/// An epsilon that was estimated over a drive, with its curve and its cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriveEpsilon {
    /// Unit of the distances: `m`, or `standard deviations` if each field is divided by its standard
    /// deviation.
    pub unit: Cow<'static, str>,
    /// The estimate with its curve, fit and tangent point.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// The space in which distances are measured.
    pub space: FieldSpace,
    /// What exact results at the borders of tiles cost.
    pub cost: Cost,
}

/// What exact results at the borders of tiles cost. Points whose neighbours may lie outside core and halo ask
/// for more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Halo of a tile in metres before any point asks for more.
    pub halo_m: f64,
    /// Points that asked for more.
    pub asked_for_more: u64,
    /// Their share of all points whose neighbours were searched.
    pub share: f64,
    /// Points that were read for them, per point of core and halo.
    pub read_share: f64,
}

impl DriveEpsilon {
    /// The estimate over a drive in a space.
    pub(super) fn new(estimate: Estimate, space: FieldSpace, cost: Cost) -> Self {
        let unit = if space.is_metric() { "m" } else { "standard deviations" };
        Self { unit: unit.into(), estimate, space, cost }
    }

    /// The bytes of a global.
    pub(super) fn encode(&self) -> Result<Vec<u8>> {
        codec::encode(&(&self.estimate, &self.space, &self.cost))
    }

    /// The estimate in the global of a step.
    pub(crate) fn decode(global: &[u8]) -> Result<Self> {
        let (estimate, space, cost) = codec::decode(global)?;
        Ok(Self::new(estimate, space, cost))
    }
}

impl Cost {
    pub(super) fn of(cost: AskingCost, curve: &Curve) -> Self {
        Self {
            halo_m: HALO_M,
            asked_for_more: cost.asked,
            share: cost.asked as f64 / curve.queries.max(1) as f64,
            read_share: cost.read as f64 / cost.gathered.max(1) as f64,
        }
    }
}
