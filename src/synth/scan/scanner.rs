//! The scanner: its rates, its beams, and which pulses are traced together. Its mount and its echoes are
//! elsewhere.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::synth::random::{gauss, sequence};

/// A group of pulses that are traced together: their preferred number, the range of the angle that they cover
/// in radians, and their longest time in seconds.
const FAN_PULSES: f64 = 6.0;
const FAN_RAD: Range<f64> = 0.04..0.1;
const FAN_S: f64 = 0.001;
/// Approximate number of slices per second.
const SLICES_HZ: f64 = 40.0;
/// Height of the trajectory's reference point over the road for profile heads, metres.
const PROFILER_HEIGHT: f64 = 2.35;

/// A ready-made scanner. `presets.toml` has its figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sensor {
    /// Two profile heads of a survey vehicle.
    Profiler,
    /// A spinning head of 16 beams from -15 to 15 degrees.
    #[serde(rename = "spinning-16")]
    Spinning16,
    /// A spinning head of 32 beams from -30.67 to 10.67 degrees.
    #[serde(rename = "spinning-32")]
    Spinning32,
    /// A spinning head of 64 beams from -24.8 to 2 degrees: it hardly sees what is above it.
    #[serde(rename = "spinning-64")]
    Spinning64,
    /// A spinning head of 64 beams from -25 to 15 degrees, most of them near the horizon.
    #[serde(rename = "spinning-64-wide")]
    Spinning64Wide,
}

impl Sensor {
    /// All scanners, in the order in which help lists them.
    pub const ALL: [Self; 5] =
        [Self::Profiler, Self::Spinning16, Self::Spinning32, Self::Spinning64, Self::Spinning64Wide];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["profiler", "spinning-16", "spinning-32", "spinning-64", "spinning-64-wide"][self as usize]
    }
}

/// The scanner; the defaults are close to a RIEGL VMX-450 (two VQ-450 heads of 550 kHz and 200 profiles/s, 8
/// mm accuracy, 0.3 mrad).
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Scanner {
    /// Profile heads, 1 or 2; spinning heads, 1.
    pub heads: u8,
    /// Pulses per second of one head, of all its beams together.
    pub pulse_rate_hz: f64,
    /// Profiles per second of one head, or rotations per second of a spinning head.
    pub profiles_hz: f64,
    /// Farthest target, metres.
    pub range_m: f64,
    /// Standard deviation of a measured range, metres.
    pub noise_m: f64,
    /// Divergence of the beam, milliradians.
    pub divergence_mrad: f64,
    /// Share of pulses that return an isolated echo without a target.
    pub strays: f64,
    /// Standard deviation of the registered position of a sweep of a spinning head from its true position,
    /// metres, on each axis. Its heading deviates so that points 15 m away move equally far. 0 for profile
    /// heads.
    #[serde(default)]
    pub drift_m: f64,
    /// The beams of a spinning head; `None` for profile heads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spinning: Option<Spinning>,
}

/// Figures that only a spinning head has. It rotates about its upright axis and returns the strongest echo of
/// a pulse.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Spinning {
    /// Elevations of the beams, degrees: lowest, highest and number of equally spaced beams, from the ground
    /// up.
    pub beams: Vec<(f64, f64, u16)>,
    /// Height of the head over the road, metres.
    pub height_m: f64,
}

/// Distance at which a wrong heading moves points as far as a wrong position does, metres.
const DRIFT_AT: f64 = 15.0;

impl Spinning {
    /// The elevation of every beam, degrees, in the order in which the beams fire.
    #[must_use]
    pub fn elevations(&self) -> Vec<f64> {
        let block = |&(low, high, count): &(f64, f64, u16)| {
            let step = (high - low) / f64::from(count.max(2) - 1);
            (0..count).map(move |number| low + step * f64::from(number))
        };
        self.beams.iter().flat_map(block).collect()
    }
}

impl Scanner {
    /// Pulses of one profile, or of one rotation, of one head. The pulse rate is exact; the profile rate is
    /// adjusted to it.
    pub(crate) fn pulses(&self) -> u64 {
        (self.pulse_rate_hz / self.profiles_hz).round().max(1.0) as u64
    }

    /// Beams of a head, which fire in turn.
    pub(crate) fn beams(&self) -> u64 {
        let count = |spinning: &Spinning| spinning.beams.iter().map(|(_, _, count)| u64::from(*count)).sum();
        self.spinning.as_ref().map_or(1, count).max(1)
    }

    /// Pulses of one beam in a profile or a rotation.
    pub(crate) fn columns(&self) -> f64 {
        self.pulses() as f64 / self.beams() as f64
    }

    /// Number of consecutive pulses of a beam that are traced together; 1 if pulses are far apart.
    pub(crate) fn together(&self) -> u64 {
        let rate = self.pulse_rate_hz / self.beams() as f64;
        (self.fan() * self.columns() / TAU).min(FAN_S * rate).max(1.0) as u64
    }

    /// Number of pulses of a slice of time. A slice has whole profiles, or whole groups of pulses that are
    /// traced together.
    pub(crate) fn slice(&self) -> u64 {
        if self.spinning.is_some() {
            let group = self.beams() * self.together();
            return (self.pulse_rate_hz / SLICES_HZ / group as f64).ceil() as u64 * group;
        }
        (self.profiles_hz / SLICES_HZ).ceil() as u64 * self.pulses()
    }

    /// Angle within which pulses are traced together, radians. One list of possible targets should serve
    /// several pulses.
    fn fan(&self) -> f64 {
        (FAN_PULSES * TAU / self.columns()).clamp(FAN_RAD.start, FAN_RAD.end)
    }

    /// Largest distance of a beam from the middle beam of its group, metres. In half a millisecond the
    /// vehicle moves 2 cm and, at 150 km/h in a bend of 50 m, turns by 0.4 mrad.
    pub(crate) fn spread(&self) -> f32 {
        (self.range_m * (self.fan() * 0.5 + 0.001) + 0.1) as f32
    }

    /// Time of pulse number `count` of a head, seconds since the start; the second head fires half a pulse
    /// later.
    pub(crate) fn time(&self, count: u64, head: usize) -> f64 {
        (count as f64 + head as f64 / f64::from(self.heads)) / self.pulse_rate_hz
    }

    /// The error with which the sweep of pulse number `count` is registered: shift in metres, and turn of its
    /// heading in radians.
    pub(crate) fn drift(&self, seed: u64, count: u64) -> (DVec3, f64) {
        if self.drift_m <= 0.0 {
            return (DVec3::ZERO, 0.0);
        }
        let mut random = sequence(seed, 30, count / self.pulses());
        let [x, y, z, turn] = [(); 4].map(|()| f64::from(gauss(&mut random)) * self.drift_m);
        (DVec3::new(x, y, z), turn / DRIFT_AT)
    }

    /// Diameter of the beam at a range, metres.
    pub(crate) fn beam(&self, range: f32) -> f32 {
        0.004 + range * self.divergence_mrad as f32 * 1e-3
    }

    /// Height of the trajectory's reference point over the road, metres. A spinning head is at this point.
    pub(crate) fn height(&self) -> f64 {
        self.spinning.as_ref().map_or(PROFILER_HEIGHT, |spinning| spinning.height_m)
    }
}
