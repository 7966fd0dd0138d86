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

use axis::{CELL, STEM, cell_at};
use drive::Drive;
use preset::Plan;
use scan::{Job, Scan};
use scene::{Placed, Window};
use sink::Sink;
use street::{IDS, Street};

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

/// Pulses of a slice, about: some ten milliseconds of work.
const SLICE_PULSES: u64 = 32_768;
/// Slices of a round: the memory of two rounds is what a drive of any length takes.
const ROUND: usize = 24;
/// A window serves this stretch of chainage, metres.
const STRETCH: f64 = 25.0;

/// Shortest drive that comes back, metres.
const LEAST_LOOP: f64 = 2.0 * STEM + 500.0;

/// How far to drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Extent {
    /// This many metres.
    #[serde(rename = "length_m")]
    Length(f64),
    /// Until there are this many points; the profile under way is completed.
    #[serde(rename = "points")]
    Points(u64),
}

/// Everything that decides what is written.
#[derive(Debug, Clone, Serialize)]
pub struct Settings {
    /// Kind of street.
    pub preset: Preset,
    /// How far to drive.
    pub extent: Extent,
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
    /// Replace what an earlier run left in the output folder.
    #[serde(skip)]
    pub force: bool,
}

impl Settings {
    /// The defaults of a preset: 1 km, seed 1, one LAZ file.
    #[must_use]
    pub fn new(preset: Preset) -> Self {
        Self {
            preset,
            extent: Extent::Length(if preset == Preset::Loop { 1_500.0 } else { 1_000.0 }),
            seed: 1,
            scanner: Scanner::default(),
            speed_kmh: (30.0, 60.0),
            files_every_s: None,
            compressed: true,
            threads: 0,
            force: false,
        }
    }

    fn check(&self) -> Result<(), ConfigError> {
        let Self { scanner, speed_kmh: (slow, fast), .. } = self;
        // A tighter loop would fold the gardens inside it: 500 m of loop are a radius of 68 m.
        let least = if self.preset == Preset::Loop { LEAST_LOOP } else { 1.0 };
        let extent = match self.extent {
            Extent::Length(length) => ("length", length, least..=2e6, " m"),
            Extent::Points(points) => ("points", points as f64, 1.0..=1e12, ""),
        };
        let ranges = [
            ("heads", f64::from(scanner.heads), 1.0..=2.0, ""),
            ("pulse-rate", scanner.pulse_rate_hz, 1e3..=2e6, " Hz"),
            ("profiles", scanner.profiles_hz, 1.0..=scanner.pulse_rate_hz / 36.0, " per second"),
            ("range", scanner.range_m, 10.0..=300.0, " m"),
            ("noise", scanner.noise_m, 0.0..=1.0, " m"),
            ("speed", *slow, 1.0..=150.0, " km/h"),
            ("speed", *fast, *slow..=150.0, " km/h"),
            ("files-every", self.files_every_s.unwrap_or(1.0), 0.1..=1e6, " s"),
            extent,
        ];
        match ranges.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((key, value, range, unit)) => {
                let expected = format!("{} to {}{unit}", range.start(), range.end());
                Err(ConfigError::value(key, value, expected))
            }
            None => Ok(()),
        }
    }

    /// Metres and points after which the drive ends; a loop has a length, even if only points were asked for.
    fn ends(&self) -> (Option<f64>, u64) {
        match self.extent {
            Extent::Length(length) => (Some(length), u64::MAX),
            Extent::Points(points) => {
                // 0.65 to 0.85 of the pulses return, by preset.
                let rate = self.scanner.pulse_rate_hz * f64::from(self.scanner.heads) * 0.75;
                let speed = (self.speed_kmh.0 + self.speed_kmh.1) / 7.2;
                let length = (points as f64 / rate * speed).max(LEAST_LOOP);
                ((self.preset == Preset::Loop).then_some(length), points)
            }
        }
    }
}

/// How far a run is.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Points traced so far.
    pub points: u64,
    /// Metres driven so far.
    pub driven_m: f64,
    /// Share done, 0 to 1.
    pub share: f64,
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// Drives and writes `PRESET_0001.laz` ..., `reference.csv`, `trajectory.csv` and `scene.json` into `folder`.
///
/// # Errors
/// [`Error::Config`] for settings out of range; [`Error::Output`] when the folder is not empty (without `force`) or
/// cannot be written.
pub fn generate(
    settings: &Settings,
    folder: &Path,
    progress: &mut (dyn FnMut(Progress) + Send),
) -> Result<Summary, Error> {
    settings.check()?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| Error::Bug(format!("no worker threads: {error}")))?;
    sink::prepare(folder, settings.force)?;
    pool.install(|| Run::new(settings).drive(Sink::create(folder, settings)?, progress))
}

/// A drive under way.
struct Run<'a> {
    settings: &'a Settings,
    street: Street,
    drive: Drive,
    scan: Scan<'a>,
    /// The cells within range.
    cells: BTreeMap<usize, Vec<Placed>>,
    /// The window of the last slice that was planned, by its stretch.
    window: Option<(i64, Arc<Window>)>,
}

impl<'a> Run<'a> {
    fn new(settings: &'a Settings) -> Self {
        let plan = Plan::new(settings.preset, settings.seed);
        let street = Street::new(plan, settings.ends().0.filter(|_| settings.preset == Preset::Loop));
        let drive = Drive::new(plan, street.axis.end(), settings.speed_kmh);
        let scan = Scan::new(settings);
        Self { settings, street, drive, scan, cells: BTreeMap::new(), window: None }
    }

    fn drive(
        mut self,
        mut sink: Sink<'_>,
        progress: &mut (dyn FnMut(Progress) + Send),
    ) -> Result<Summary, Error> {
        let scanner = &self.settings.scanner;
        let (length, limit) = self.settings.ends();
        let profile_s = self.scan.time(1, 0, 0);
        let profiles = length.map_or(u64::MAX, |end| (self.drive.time(end) / profile_s).ceil() as u64);
        let per_slice = (SLICE_PULSES / scanner.pulses() / u64::from(scanner.heads)).max(1);

        let (mut next, mut points, mut driven_m) = (0, 0, 0.0);
        let (mut batch, mut lowest) = (Vec::new(), 0);
        while next < profiles && points < limit {
            let mut jobs = Vec::with_capacity(ROUND);
            while jobs.len() < ROUND && next < profiles {
                let to = (next + per_slice).min(profiles);
                jobs.push(self.job(next, to));
                next = to;
            }
            let scan = &self.scan;
            // The files of the last round are written while this one is traced.
            let (written, slices) = rayon::join(
                || sink.write(std::mem::take(&mut batch), lowest),
                || jobs.par_iter().map(|job| scan.trace(job, limit)).collect::<Vec<_>>(),
            );
            written?;
            for (job, slice) in jobs.iter().zip(slices) {
                let left = limit - points;
                let last = slice.records.len() as u64 >= left;
                let slice = if last { scan.trace(job, left) } else { slice };
                (next, points) = (slice.to, points + slice.records.len() as u64);
                batch.push(slice);
                if last {
                    break;
                }
            }
            // A street that closes comes back to its first cells.
            let first = self.cells.keys().next().filter(|_| self.street.axis.end().is_infinite());
            lowest = first.map_or(0, |cell| *cell as u32 * IDS);
            driven_m = self.drive.distance(scan.time(next, 0, 0));
            let share = (next as f64 / profiles as f64).max(points as f64 / limit as f64);
            progress(Progress { points, driven_m, share: share.min(1.0) });
        }
        sink.write(batch, lowest)?;
        Ok(sink.finish(driven_m)?)
    }

    /// The profiles `from..to`, and what there is about them.
    fn job(&mut self, from: u64, to: u64) -> Job {
        let [start, end] = [from, to].map(|profile| self.scan.time(profile, 0, 0));
        let track = self.drive.track(&mut self.street.axis, start, end);
        let (s, _) = self.drive.place(start);
        let stretch = (s / STRETCH).floor() as i64;
        let window = match self.window.take() {
            Some((last, window)) if last == stretch => window,
            _ => Arc::new(self.within_range(s)),
        };
        self.window = Some((stretch, Arc::clone(&window)));
        Job { window, track, from, to }
    }

    /// The scene within range of chainage `s`.
    fn within_range(&mut self, s: f64) -> Window {
        // Half a stretch, half a cell, and what overhangs: objects belong to the cell of their middle.
        let reach = self.settings.scanner.range_m + STRETCH + CELL * 0.5 + 20.0;
        let near = self.street.axis.near(s, reach);
        self.cells.retain(|cell, _| near.contains(cell));
        for cell in near {
            self.cells.entry(cell).or_insert_with(|| self.street.cell(cell));
        }
        let place = self.street.axis.frame(cell_at(s)).at(s).point;
        Window::new(place.extend(0.0), self.cells.values().flatten())
    }
}
