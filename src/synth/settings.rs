//! The settings of a drive, their limits, and a summary of the output.

use serde::Serialize;

use crate::config::ConfigError;

use super::scan::scanner::{Scanner, Spinning};
use super::street::axis::STEM;
use super::street::preset::Preset;

/// Shortest drive with a loop, metres.
const LEAST_LOOP: f64 = 2.0 * STEM + 500.0;

/// Everything that determines the output.
#[derive(Debug, Clone, Serialize)]
pub struct Settings {
    /// Kind of street.
    pub preset: Preset,
    /// Metres to drive; `None` to drive until there are enough points.
    pub length_m: Option<f64>,
    /// Points after which the drive ends; `None` to drive the whole length.
    pub points: Option<u64>,
    /// Rotations of a spinning head after which the drive ends; `None` to drive on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweeps: Option<u64>,
    /// Same seed, same bytes.
    pub seed: u64,
    /// The scanner.
    pub scanner: Scanner,
    /// Lowest and highest speed, km/h.
    pub speed_kmh: (f64, f64),
    /// Seconds of driving per file; `None` writes one file.
    pub files_every_s: Option<f64>,
    /// Whether the files are LAZ instead of LAS.
    pub compressed: bool,
    /// Worker threads; 0 for one per processor. Does not change the result.
    #[serde(skip)]
    pub threads: usize,
}

/// Smallest number of pulses of a beam in a rotation.
const LEAST_COLUMNS: f64 = 36.0;

/// Refuses impossible figures of a spinning head.
fn check_spinning(scanner: &Scanner, spinning: &Spinning) -> Result<(), ConfigError> {
    if scanner.heads != 1 {
        return Err(ConfigError::value("heads", scanner.heads, "1, because a spinning scanner has one head"));
    }
    // Points store the number of their beam in a byte.
    let beams: u64 = spinning.beams.iter().map(|(_, _, count)| u64::from(*count)).sum();
    ConfigError::outside([("beams", beams as f64, 1.0..=256.0, "")])?;
    let angles = spinning.beams.iter().flat_map(|(low, high, _)| [*low, *high]);
    ConfigError::outside(angles.map(|angle| ("beams", angle, -90.0..=90.0, "degrees")))?;
    // Else there would be no number of rotations to choose.
    let slowest = LEAST_COLUMNS * beams as f64;
    ConfigError::outside([
        ("height", spinning.height_m, 0.5..=10.0, "m"),
        ("pulse-rate", scanner.pulse_rate_hz, slowest.max(1e3)..=2e6, "Hz"),
    ])
}

impl Settings {
    /// The defaults of a preset: 1 km, and 1.5 km of a loop; seed 1; one LAZ file.
    #[must_use]
    pub fn new(preset: Preset) -> Self {
        Self {
            preset,
            length_m: Some(if preset == Preset::Loop { 1_500.0 } else { 1_000.0 }),
            points: None,
            sweeps: None,
            seed: 1,
            scanner: Scanner::default(),
            speed_kmh: (30.0, 60.0),
            files_every_s: None,
            compressed: true,
            threads: 0,
        }
    }

    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let Self { scanner, speed_kmh: (slow, fast), .. } = self;
        let spins = scanner.spinning.is_some();
        if let Some(sweeps) = self.sweeps.filter(|_| !spins) {
            let expected = "left out, because profile heads do not spin";
            return Err(ConfigError::value("sweeps", sweeps, expected));
        }
        if !spins && scanner.drift_m != 0.0 {
            let expected = "left out, because only the sweeps of spinning heads are registered one by one";
            return Err(ConfigError::value("drift", scanner.drift_m, expected));
        }
        if self.length_m.is_none() && self.points.is_none() && self.sweeps.is_none() {
            return Err(ConfigError::value("length", "none", "given, or points or sweeps"));
        }
        if let Some(spinning) = &scanner.spinning {
            check_spinning(scanner, spinning)?;
        }
        // A tighter loop would fold the gardens inside it: 500 m of loop are a radius of 68 m.
        let least = if self.preset == Preset::Loop { LEAST_LOOP } else { 1.0 };
        ConfigError::outside([
            ("heads", f64::from(scanner.heads), 1.0..=2.0, ""),
            ("pulse-rate", scanner.pulse_rate_hz, 1e3..=2e6, "Hz"),
            (
                "profiles",
                scanner.profiles_hz,
                1.0..=(scanner.pulse_rate_hz / scanner.beams() as f64 / LEAST_COLUMNS).floor(),
                "per second",
            ),
            ("range", scanner.range_m, 10.0..=300.0, "m"),
            ("noise", scanner.noise_m, 0.0..=1.0, "m"),
            ("divergence", scanner.divergence_mrad, 0.0..=100.0, "mrad"),
            ("strays", scanner.strays, 0.0..=1.0, ""),
            ("drift", scanner.drift_m, 0.0..=1.0, "m"),
            ("speed", *slow, 1.0..=150.0, "km/h"),
            ("speed", *fast, *slow..=150.0, "km/h"),
            ("threads", self.threads as f64, 0.0..=1024.0, ""),
            ("files-every", self.files_every_s.unwrap_or(1.0), 0.1..=1e6, "s"),
            ("length", self.length_m.unwrap_or(least), least..=2e6, "m"),
            ("sweeps", self.sweeps.unwrap_or(1) as f64, 1.0..=1e9, ""),
            ("points", self.points.unwrap_or(1) as f64, 1.0..=1e12, ""),
        ])
    }

    /// Metres after which the drive ends at the latest. The length of a loop follows from the requested
    /// number of points.
    pub(crate) fn length(&self) -> f64 {
        let enough = |points: u64| {
            // About this many points are measured per pulse in a suburb.
            let rate = self.scanner.pulse_rate_hz * f64::from(self.scanner.heads) * 0.62;
            (points as f64 / rate * (self.speed_kmh.0 + self.speed_kmh.1) / 7.2).max(LEAST_LOOP)
        };
        let closed = self.preset == Preset::Loop;
        let far = if closed { self.points.map_or(LEAST_LOOP, enough) } else { f64::INFINITY };
        self.length_m.unwrap_or(far)
    }

    /// Pulses of every head after which the drive ends at the latest.
    pub(crate) fn pulses(&self) -> u64 {
        self.sweeps.map_or(u64::MAX, |sweeps| sweeps * self.scanner.pulses())
    }
}

/// Summary of the output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Points in all files.
    pub points: u64,
    /// Point files.
    pub files: u32,
    /// Objects with at least one point.
    pub objects: u64,
    /// Metres driven.
    pub length_m: f64,
}
