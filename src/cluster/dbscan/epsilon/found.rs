//! An epsilon that was estimated over a drive, with what it came from and what it cost.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{Curve, Estimate};
use crate::codec;
use crate::error::Result;
use crate::model::FieldSpace;

/// Halo of this step in metres: most points of a street have their 40 nearest neighbours within it (chosen; the share
/// that asks for more is reported).
pub(crate) const HALO_M: f64 = 2.0;
/// What exactness at the borders of tiles cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct AskingCost {
    /// Points that asked for more than core and halo.
    pub(crate) asked: u64,
    /// Points that were read for them.
    pub(crate) read: u64,
    /// Points that were read in the first place.
    pub(crate) gathered: u64,
}

/// An epsilon that was estimated over a drive, and what it came from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriveEpsilon {
    /// Unit of the distances: `m`, or `standard deviations` where fields are divided by theirs.
    pub unit: Cow<'static, str>,
    /// The estimate with its curve, fit and tangent point.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// The space that distances were taken in.
    pub space: FieldSpace,
    /// What exactness at the borders of tiles cost.
    pub cost: Cost,
}

/// What exactness at the borders of tiles cost: points whose neighbours may lie beyond what a tile reads ask for more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Metres around its core that a tile reads in the first place.
    pub halo_m: f64,
    /// Points that asked for more.
    pub asked_for_more: u64,
    /// Their share of all points that were asked for their neighbours.
    pub share: f64,
    /// Points that were read for them, per point read in the first place.
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
