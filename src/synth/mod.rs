//! A labelled synthetic drive of any length: a street, a vehicle that drives along it, and a scanner whose every
//! pulse is traced.
//!
//! `preset` says what kind of street there is where, `street` builds it cell by cell from `axis`, `ground`, `tree`,
//! `building` and `things`; `scene` finds the closest hit; `drive` and `scan` turn time into pulses and pulses into
//! echoes; `sink` writes. Every cell and every slice of time is a pure function of settings and seed, so the bytes
//! do not depend on the number of threads, and memory does not depend on the length. The rest of the crate does not
//! know this module.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "geometry of metres and counts below 2^24: chosen here, not read from anywhere"
)]

mod axis;
mod building;
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
mod truth;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::config::ConfigError;
use crate::error::Error;

use axis::{CELL, Frame, LEAD, STEM};
use drive::Drive;
use preset::Plan;
use scan::{RECORD_BYTES, Scan};
use scene::Window;
use sink::{Batch, Sink};
use street::{Cell, Street};

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
        let scanner = &self.scanner;
        let within = |key: &str, value: f64, low: f64, high: f64, unit: &str| {
            let expected = format!("{low} to {high} {unit}").trim_end().to_owned();
            if (low..=high).contains(&value) { Ok(()) } else { Err(ConfigError::value(key, value, expected)) }
        };
        within("heads", f64::from(scanner.heads), 1.0, 2.0, "")?;
        within("pulse-rate", scanner.pulse_rate_hz, 1e3, 2e6, "Hz")?;
        within("profiles", scanner.profiles_hz, 1.0, scanner.pulse_rate_hz / 36.0, "per second")?;
        within("range", scanner.range_m, 10.0, 300.0, "m")?;
        within("noise", scanner.noise_m, 0.0, 1.0, "m")?;
        within("speed", self.speed_kmh.0, 1.0, 150.0, "km/h")?;
        within("speed", self.speed_kmh.1, self.speed_kmh.0, 150.0, "km/h")?;
        if let Some(every) = self.files_every_s {
            within("files-every", every, 0.1, 1e6, "s")?;
        }
        // A tighter loop would fold the gardens inside it: 500 m of loop are a radius of 68 m.
        let least = if self.preset == Preset::Loop { 2.0 * STEM + 500.0 } else { 1.0 };
        match self.extent {
            Extent::Length(length) => within("length", length, least, 2e6, "m"),
            Extent::Points(points) => within("points", points as f64, 1.0, 1e12, ""),
        }
    }

    /// Metres to drive: as asked for, or guessed from the number of points.
    fn length(&self) -> f64 {
        match self.extent {
            Extent::Length(length) => length,
            Extent::Points(points) => {
                // 0.65 to 0.85 of the pulses return, by preset; the loop must close whatever the guess.
                let rate = self.scanner.pulse_rate_hz * f64::from(self.scanner.heads) * 0.75;
                let speed = (self.speed_kmh.0 + self.speed_kmh.1) / 7.2;
                (points as f64 / rate * speed).max(2.0 * STEM + 500.0)
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
    scan: Scan,
    cells: BTreeMap<usize, Arc<Cell>>,
    /// The window of the last slice that was planned, by its stretch.
    window: Option<(i64, Arc<Stage>)>,
    /// Objects of cells that are new since the last round.
    fresh: Vec<(usize, u32, Vec<street::Object>)>,
}

/// A window with its axis.
struct Stage {
    window: Window,
    frames: Vec<Frame>,
    lowest: usize,
}

/// A slice to be traced.
struct Job {
    stage: Arc<Stage>,
    from: u64,
    to: u64,
}

impl<'a> Run<'a> {
    fn new(settings: &'a Settings) -> Self {
        let plan = Plan { preset: settings.preset, seed: settings.seed };
        let loop_drive = (settings.preset == Preset::Loop).then(|| settings.length());
        let street = Street::new(plan, loop_drive);
        let speed = (settings.speed_kmh.0 / 3.6, settings.speed_kmh.1 / 3.6);
        let drive = Drive::new(plan, street.axis.land, street.axis.street_length(), speed);
        let scan = Scan::new(settings.scanner.clone(), drive, settings.seed, settings.files_every_s);
        Self { settings, street, scan, cells: BTreeMap::new(), window: None, fresh: Vec::new() }
    }

    fn drive(
        mut self,
        mut sink: Sink,
        progress: &mut (dyn FnMut(Progress) + Send),
    ) -> Result<Summary, Error> {
        let profile_s = self.settings.scanner.profile_s();
        let limit = match self.settings.extent {
            Extent::Points(points) => points,
            Extent::Length(_) => u64::MAX,
        };
        let bounded = limit == u64::MAX || self.settings.preset == Preset::Loop;
        let length = self.settings.length();
        let profiles =
            if bounded { (self.scan.drive.time(length) / profile_s).ceil() as u64 } else { u64::MAX };
        let per_slice =
            (SLICE_PULSES / self.scan.scanner.pulses() / u64::from(self.scan.scanner.heads)).max(1);

        let (mut next, mut points, mut batch) = (0, 0u64, Batch::default());
        while next < profiles && points < limit {
            let mut jobs = Vec::with_capacity(ROUND);
            while jobs.len() < ROUND && next < profiles {
                let to = (next + per_slice).min(profiles);
                jobs.push(Job { stage: self.stage(next), from: next, to });
                next = to;
            }
            let scan = &self.scan;
            let trace = |job: &Job| scan.trace(&job.stage.window, &job.stage.frames, job.from, job.to);
            // The files of the last round are written while this one is traced.
            let (written, mut slices) =
                rayon::join(|| sink.write(batch), || jobs.par_iter().map(trace).collect::<Vec<_>>());
            written?;
            for (index, slice) in slices.iter().enumerate() {
                let whole = points + (slice.records.len() / RECORD_BYTES) as u64;
                if whole >= limit {
                    let enough = slice.ends.iter().position(|end| points + *end as u64 >= limit);
                    let to = jobs[index].from + enough.unwrap_or(slice.ends.len()) as u64 + 1;
                    let last = Job { stage: Arc::clone(&jobs[index].stage), from: jobs[index].from, to };
                    let last = trace(&last);
                    points += (last.records.len() / RECORD_BYTES) as u64;
                    slices.truncate(index);
                    slices.push(last);
                    next = to;
                    break;
                }
                points = whole;
            }
            let lowest = jobs.iter().map(|job| job.stage.lowest).min().unwrap_or(0);
            // A street that closes comes back to its first cells.
            let lowest = if self.street.axis.closes() { 0 } else { lowest };
            batch = Batch { slices, cells: std::mem::take(&mut self.fresh), lowest };
            let driven_m = self.scan.drive.distance(next as f64 * profile_s);
            let share = if bounded { next as f64 / profiles as f64 } else { points as f64 / limit as f64 };
            progress(Progress { points, driven_m, share: share.min(1.0) });
        }
        sink.write(batch)?;
        let driven = self.scan.drive.distance(next as f64 * profile_s);
        Ok(sink.finish(driven, self.description())?)
    }

    /// The scene within range at the start of profile `profile`.
    fn stage(&mut self, profile: u64) -> Arc<Stage> {
        let t = profile as f64 * self.scan.scanner.profile_s();
        let place = self.scan.drive.place(t);
        let stretch = (place.s / STRETCH).floor() as i64;
        if let Some((key, stage)) = &self.window
            && *key == stretch
        {
            return Arc::clone(stage);
        }
        let stage = Arc::new(self.build_stage(place.s));
        self.window = Some((stretch, Arc::clone(&stage)));
        stage
    }

    fn build_stage(&mut self, s: f64) -> Stage {
        // Half a stretch, half a cell, and what overhangs: objects belong to the cell of their middle.
        let reach = self.settings.scanner.range_m + STRETCH + CELL * 0.5 + 20.0;
        let here = (s / CELL).max(0.0) as usize;
        let start = self.street.axis.frame(here).at(s);
        let cells = match self.street.axis.street_length() {
            Some(length) => 0..(length / CELL).ceil() as usize,
            None => here.saturating_sub((reach / CELL) as usize + 1)..here + (reach / CELL) as usize + 2,
        };
        let near: Vec<usize> = cells
            .filter(|cell| {
                let middle = self.street.axis.frame(*cell).at((*cell as f64 + 0.5) * CELL);
                (middle.x - start.x).hypot(middle.y - start.y) < reach
            })
            .collect();
        self.cells.retain(|cell, _| near.contains(cell));
        let cells: Vec<Arc<Cell>> = near.iter().map(|cell| self.cell(*cell)).collect();
        Stage {
            window: Street::window(&cells),
            frames: cells.iter().map(|cell| cell.frame.clone()).collect(),
            lowest: near.first().copied().unwrap_or(0),
        }
    }

    fn cell(&mut self, index: usize) -> Arc<Cell> {
        if let Some(cell) = self.cells.get(&index) {
            return Arc::clone(cell);
        }
        let cell = Arc::new(self.street.cell(index));
        self.cells.insert(index, Arc::clone(&cell));
        self.fresh.push((index, cell.first_id, cell.objects.clone()));
        cell
    }

    /// What the scene was made from.
    fn description(&self) -> serde_json::Value {
        serde_json::json!({
            "generator": "chainage synth",
            "version": env!("CARGO_PKG_VERSION"),
            "crs": "EPSG:25832",
            "lead_m": LEAD,
            "settings": self.settings,
        })
    }
}
