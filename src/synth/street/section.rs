//! The cross-section of the street: widths, and heights over the axis without the land.

use bytemuck::{Pod, Zeroable};
use serde::Deserialize;

/// Width of a kerb's face or of another step, metres.
pub(crate) const FACE: f64 = 0.03;

/// Half of a cross-section. All widths are distances from the axis in metres; none is smaller than the
/// previous one.
#[derive(Debug, Clone, Copy, Default, Deserialize, Pod, Zeroable)]
#[repr(C)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Section {
    /// Edge of the raised median; 0 for none.
    pub(crate) median: f64,
    /// Edge of the outermost lane.
    pub(crate) lanes: f64,
    /// Kerb, beyond parked cars or the hard shoulder.
    pub(crate) kerb: f64,
    /// Edge of the planted strip.
    pub(crate) verge: f64,
    /// Edge of the pavement.
    pub(crate) walk: f64,
    /// Height of the kerbs.
    pub(crate) kerb_height: f64,
    /// Amplitude of the slopes beside the street.
    pub(crate) slopes: f64,
    /// Width of a lane.
    pub(crate) lane: f64,
}

impl Section {
    /// All fields, in order.
    pub(crate) fn widths(&self) -> &[f64; 8] {
        bytemuck::cast_ref(self)
    }

    /// The section between two others, with weight `w` from 0 to 1.
    pub(crate) fn between(&self, other: &Self, w: f64) -> Self {
        let a = self.widths();
        let b = other.widths();
        bytemuck::cast::<[f64; 8], _>(std::array::from_fn(|i| a[i] + (b[i] - a[i]) * w))
    }

    /// Middle of the outermost lane: where the vehicle drives.
    pub(crate) fn driving_line(&self) -> f64 {
        self.lanes - self.lane * 0.5
    }

    /// Offsets from the axis at which the profile bends, from right to left.
    pub(crate) fn breaks(&self) -> impl Iterator<Item = f64> {
        let m = self.median;
        let k = self.kerb;
        let w = self.walk;
        let street = [m, m + FACE, (m + k) * 0.5, k, k + FACE, self.verge.max(k + 2.0 * FACE), w, w + FACE];
        let beyond = [2.0, 5.0, 9.0, 15.0, 24.0, 36.0, 55.0].map(|d| w + d);
        let left = street.into_iter().chain(beyond);
        left.clone().rev().map(|d| -d).chain([0.0]).chain(left)
    }

    /// Height over the axis at distance `d`, without land, dips and slopes: a camber of 2.5 %, kerbs, and a
    /// pavement that falls towards the road by 2 %.
    pub(crate) fn profile(&self, d: f64) -> f64 {
        let road = -0.025 * d.min(self.kerb);
        // A median narrower than a kerb stone has no height, so that sections blend into each other.
        if d <= self.median {
            return road + self.kerb_height * (self.median / 0.5).min(1.0);
        }
        let beyond = (d - self.kerb) / FACE;
        road + self.kerb_height * beyond.clamp(0.0, 1.0) + 0.02 * (d.min(self.walk) - self.kerb).max(0.0)
    }
}
