//! The scanner: its rates, and which pulses are traced together. Not: its mount and what comes back.

use std::f64::consts::TAU;
use std::ops::Range;

use serde::{Deserialize, Serialize};

/// Pulses that are traced together at least, within an angle in radians, and the time of them in seconds at most.
const FAN_PULSES: f64 = 6.0;
const FAN_RAD: Range<f64> = 0.04..0.1;
const FAN_S: f64 = 0.001;

/// The scanner; the defaults are close to a RIEGL VMX-450 (two VQ-450 heads of 550 kHz and 200 profiles/s, 8 mm
/// accuracy, 0.3 mrad).
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Scanner {
    /// Profile heads, 1 or 2.
    pub heads: u8,
    /// Pulses per second of one head.
    pub pulse_rate_hz: f64,
    /// Profiles per second of one head.
    pub profiles_hz: f64,
    /// Farthest target, metres.
    pub range_m: f64,
    /// Standard deviation of a measured range, metres.
    pub noise_m: f64,
    /// Divergence of the beam, milliradians.
    pub divergence_mrad: f64,
    /// Share of pulses that return an isolated echo of nothing.
    pub strays: f64,
}

impl Scanner {
    /// Pulses of one profile of one head; the pulse rate is exact, the profile rate follows.
    pub(super) fn pulses(&self) -> u64 {
        (self.pulse_rate_hz / self.profiles_hz).round().max(1.0) as u64
    }

    /// Pulses that are traced together: some that follow each other, but one where they are far apart.
    pub(super) fn together(&self) -> u64 {
        (self.fan() * self.pulses() as f64 / TAU).min(FAN_S * self.pulse_rate_hz).max(1.0) as u64
    }

    /// Angle within which pulses are traced together, radians: a list of what they may meet should serve several.
    fn fan(&self) -> f64 {
        (FAN_PULSES * TAU / self.pulses() as f64).clamp(FAN_RAD.start, FAN_RAD.end)
    }

    /// How far a beam may be from the middle one of those it is traced with, metres. In half a millisecond the vehicle
    /// goes 2 cm and, at 150 km/h in a bend of 50 m, turns by 0.4 mrad.
    pub(super) fn spread(&self) -> f32 {
        (self.range_m * (self.fan() * 0.5 + 0.001) + 0.1) as f32
    }

    /// Time of a pulse, seconds since the start; the second head fires half a pulse later.
    pub(super) fn time(&self, profile: u64, pulse: u64, head: usize) -> f64 {
        let count = profile * self.pulses() + pulse;
        (count as f64 + head as f64 / f64::from(self.heads)) / self.pulse_rate_hz
    }

    /// Diameter of the beam at a range, metres.
    pub(super) fn beam(&self, range: f32) -> f32 {
        0.004 + range * self.divergence_mrad as f32 * 1e-3
    }
}
