//! A labelled synthetic drive of any length: a street, a vehicle that drives along it, and a scanner whose every
//! pulse is traced.
//!
//! `preset` says what kind of street there is where, `street` builds it cell by cell from `axis`, `ground` and
//! `things`; `scene` finds the closest hit; `drive` and `scan` turn time into pulses and pulses into
//! echoes; `sink` writes. Every cell and every slice of time is a pure function of settings and seed, so the bytes
//! do not depend on the number of threads, and memory does not depend on the length. The rest of the crate does not
//! know this module.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "geometry of metres and counts below 2^24: chosen here, not read from anywhere"
)]

mod axis;
mod drive;
mod ground;
mod material;
mod preset;
mod random;
mod scan;
mod scene;
mod shape;
mod sink;
mod street;
mod things;
mod tree;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::config::ConfigError;
use crate::error::Error;

use axis::{Axis, CELL, STEM};
use drive::Drive;
use preset::Plan;
use scan::Slice;
use scene::{Placed, Window};
use sink::Sink;
use street::{IDS, Library};

pub use preset::Preset;
pub use scan::Scanner;

/// The tables that this module brings along.
#[expect(
    clippy::expect_used,
    reason = "the text is part of the program, and every test of a drive parses it"
)]
fn shipped<T: DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).expect("the shipped tables are valid")
}

/// Slices of a round, and slices of a second, about: the memory of two rounds is what a drive of any length takes.
const ROUND: u64 = 24;
const SLICES_HZ: f64 = 40.0;

/// Length of the longest thing along the street, a facade, metres.
const LONGEST: f64 = 75.0;

/// Shortest drive that comes back, metres.
const LEAST_LOOP: f64 = 2.0 * STEM + 500.0;

/// Everything that decides what is written.
#[derive(Debug, Clone, Serialize)]
pub struct Settings {
    /// Kind of street.
    pub preset: Preset,
    /// Metres to drive; `None` to drive until there are enough points.
    pub length_m: Option<f64>,
    /// Points after which the drive ends; `None` to drive the whole length.
    pub points: Option<u64>,
    /// Same seed, same bytes.
    pub seed: u64,
    /// The scanner.
    pub scanner: Scanner,
    /// Lowest and highest speed, km/h.
    pub speed_kmh: (f64, f64),
    /// Seconds of driving per file; `None` writes one file.
    pub files_every_s: Option<f64>,
    /// LAZ, else LAS.
    pub compressed: bool,
    /// Worker threads; 0 for one per processor. Does not change the result.
    #[serde(skip)]
    pub threads: usize,
}

impl Settings {
    /// The defaults of a preset: 1 km, seed 1, one LAZ file.
    #[must_use]
    pub fn new(preset: Preset) -> Self {
        Self {
            preset,
            length_m: Some(if preset == Preset::Loop { 1_500.0 } else { 1_000.0 }),
            points: None,
            seed: 1,
            scanner: Scanner::default(),
            speed_kmh: (30.0, 60.0),
            files_every_s: None,
            compressed: true,
            threads: 0,
        }
    }

    fn check(&self) -> Result<(), ConfigError> {
        let Self { scanner, speed_kmh: (slow, fast), .. } = self;
        // A tighter loop would fold the gardens inside it: 500 m of loop are a radius of 68 m.
        let least = if self.preset == Preset::Loop { LEAST_LOOP } else { 1.0 };
        let ranges = [
            ("heads", f64::from(scanner.heads), 1.0..=2.0, ""),
            ("pulse-rate", scanner.pulse_rate_hz, 1e3..=2e6, " Hz"),
            ("profiles", scanner.profiles_hz, 1.0..=scanner.pulse_rate_hz / 36.0, " per second"),
            ("range", scanner.range_m, 10.0..=300.0, " m"),
            ("noise", scanner.noise_m, 0.0..=1.0, " m"),
            ("speed", *slow, 1.0..=150.0, " km/h"),
            ("speed", *fast, *slow..=150.0, " km/h"),
            ("files-every", self.files_every_s.unwrap_or(1.0), 0.1..=1e6, " s"),
            ("length", self.length_m.unwrap_or(least), least..=2e6, " m"),
            ("points", self.points.unwrap_or(1) as f64, 1.0..=1e12, ""),
        ];
        let wrong = ranges.into_iter().find(|(_, value, range, _)| !range.contains(value));
        wrong.map_or(Ok(()), |(key, value, range, unit)| {
            let expected = format!("{} to {}{unit}", range.start(), range.end());
            Err(ConfigError::value(key, value, expected))
        })
    }

    /// Metres after which the drive ends at the latest; a loop has a length that gives about the points asked for.
    fn length(&self) -> f64 {
        let enough = |points: u64| {
            // So many points there are per pulse in a suburb, about.
            let rate = self.scanner.pulse_rate_hz * f64::from(self.scanner.heads) * 0.62;
            (points as f64 / rate * (self.speed_kmh.0 + self.speed_kmh.1) / 7.2).max(LEAST_LOOP)
        };
        let closed = self.points.filter(|_| self.preset == Preset::Loop);
        self.length_m.unwrap_or(closed.map_or(f64::INFINITY, enough))
    }
}

/// What was written.
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

/// Drives and writes `PRESET_0001.laz` ..., `reference.csv`, `trajectory.csv` and `scene.json` into `folder`; `progress`
/// hears of the points and metres so far.
///
/// # Errors
/// [`ConfigError`](crate::config::ConfigError) for settings out of range; [`OutputError`](crate::output::OutputError) when the folder is not empty or cannot be written.
pub fn generate(
    settings: &Settings,
    folder: &Path,
    progress: &mut (dyn FnMut(Summary) + Send),
) -> Result<Summary, Error> {
    settings.check()?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| Error::bug(format!("no worker threads: {error}")))?;
    sink::prepare(folder)?;
    pool.install(|| Run::new(settings).drive(Sink::create(folder, settings)?, progress))
}

/// A drive under way.
struct Run<'a> {
    settings: &'a Settings,
    plan: Plan,
    axis: Axis,
    library: Library,
    drive: Drive,
    /// The cells within range.
    cells: BTreeMap<usize, Vec<Placed>>,
}

impl<'a> Run<'a> {
    fn new(settings: &'a Settings) -> Self {
        let plan = Plan::new(settings.preset, settings.seed);
        let closes = Some(settings.length()).filter(|_| settings.preset == Preset::Loop);
        let axis = Axis::new(plan.seed, plan.bends, closes);
        let drive = Drive::new(plan, axis.end, settings.speed_kmh);
        Self { settings, plan, axis, library: things::models(plan.seed), drive, cells: BTreeMap::new() }
    }

    fn drive(
        mut self,
        mut sink: Sink<'_>,
        progress: &mut (dyn FnMut(Summary) + Send),
    ) -> Result<Summary, Error> {
        let (length, limit) = (self.settings.length(), self.settings.points.unwrap_or(u64::MAX));
        let (mut next, mut so_far) = (0, Summary::default());
        let (mut batch, mut lowest) = (Vec::new(), 0);
        while so_far.length_m < length && so_far.points < limit {
            let mut slices = self.slices(next, length);
            // The files of the last round are written while this one is traced.
            let (written, ()) = rayon::join(
                || sink.write(std::mem::take(&mut batch), lowest),
                || slices.par_iter_mut().for_each(|slice| slice.trace(self.settings)),
            );
            written?;
            for mut slice in slices {
                if so_far.points == limit {
                    break;
                }
                slice.records.truncate((limit - so_far.points) as usize);
                so_far.points += slice.records.len() as u64;
                next = slice.profiles.end;
                batch.push(slice);
            }
            // A street that closes comes back to its first cells.
            let first = self.cells.keys().next().filter(|_| self.axis.end.is_infinite());
            lowest = first.map_or(0, |cell| *cell as u32 * IDS);
            so_far.length_m = self.driven(next);
            progress(so_far);
        }
        sink.write(batch, lowest)?;
        Ok(sink.finish(so_far.length_m)?)
    }

    /// Metres driven when a profile begins.
    fn driven(&self, profile: u64) -> f64 {
        self.drive.distance(self.settings.scanner.time(profile, 0, 0))
    }

    /// A round of slices from profile `from` on, to be traced, within `length` metres; all of them see the same window.
    fn slices(&mut self, from: u64, length: f64) -> Vec<Slice> {
        let step = (self.settings.scanner.profiles_hz / SLICES_HZ).ceil() as u64;
        let (s, _) = self.drive.place(self.settings.scanner.time(from, 0, 0));
        // Objects belong to the cell of their middle, and what is half a cell or half a building away belongs here.
        let ahead = self.driven(from + step * ROUND) - self.driven(from);
        let near = self.axis.near(s, self.settings.scanner.range_m + ahead + (CELL + LONGEST) * 0.5);
        self.cells.retain(|cell, _| near.contains(cell));
        for cell in near {
            let build = || street::cell(self.plan, &self.axis, &self.library, cell);
            self.cells.entry(cell).or_insert_with(build);
        }
        let origin = self.axis.line.at(s).point.extend(0.0);
        let window =
            Arc::new(Window::new(origin, self.settings.scanner.spread(), self.cells.values().flatten()));
        let starts = (0..ROUND).map(|number| from + number * step);
        let slice = |from: u64| {
            let [start, end] = [from, from + step].map(|profile| self.settings.scanner.time(profile, 0, 0));
            let (window, track) = (Arc::clone(&window), self.drive.track(&self.axis.line, start..end));
            Slice { window, track, profiles: from..from + step, records: Vec::new() }
        };
        starts.take_while(|start| self.driven(*start) < length).map(slice).collect()
    }
}
