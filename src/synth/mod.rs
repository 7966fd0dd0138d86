//! A labelled synthetic drive of any length: a street, a vehicle that drives along it, and a scanner. Every
//! pulse of the scanner is traced.
//!
//! `street` is built cell by cell: `preset` chooses the kind of street at every place, `axis`, `section` and
//! `ground` shape it, and `traffic` moves along it. `things` stand on it, with their true measures in
//! `truth`. `scene` finds the closest hit of a ray. In `scan`, `drive`, `scanner` and `aim` turn time into
//! pulses, and pulses become echoes. `sink` writes them.
//!
//! Every cell and every slice of time is a pure function of settings and seed, so the bytes do not depend on
//! the number of threads. Memory does not depend on the length, except for 56 bytes per arc of the axis and
//! about 300 bytes per moving thing that was seen. The rest of the crate does not use this module.
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use chainage::synth::{Preset, Settings, generate};
//!
//! // 20 m of a suburb, by a slow scanner.
//! let mut settings = Settings { length_m: Some(20.0), ..Settings::new(Preset::Suburb) };
//! settings.scanner.pulse_rate_hz = 20_000.0;
//! settings.scanner.profiles_hz = 50.0;
//! let folder = tempfile::tempdir()?;
//! let summary = generate(&settings, folder.path(), &mut |_| ControlFlow::Continue(()))?;
//! assert!(summary.points > 10_000 && summary.objects > 1);
//! assert!(folder.path().join("suburb_0001.laz").exists() && folder.path().join("reference.csv").exists());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "geometry of metres and counts below 2^24: chosen here, not read from anywhere"
)]

mod error;
mod random;
mod scan;
mod scene;
mod settings;
mod shipped;
mod sink;
mod street;
mod things;

use std::collections::BTreeMap;
use std::io;
use std::ops::{ControlFlow, Range};
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use crate::error::Error;
use crate::output::OutputError;

use scan::Slice;
use scan::drive::Drive;
use scan::roadway::Roadway;
use scene::{Moving, Placed, Window};
use sink::Sink;
use street::axis::{Axis, CELL};
use street::preset::Plan;
use street::{IDS, Library};

pub use error::SynthError;
pub use scan::scanner::{Scanner, Sensor, Spinning};
pub use settings::{Settings, Summary};
pub use street::preset::Preset;

/// Number of slices per round. A drive of any length takes the memory of two rounds.
const ROUND: u64 = 24;

/// Distance of the outermost lane from the axis plus half the length of a car, metres.
const LANES: f64 = 15.0;

/// Length of the longest thing along the street (a facade), metres.
const LONGEST: f64 = 75.0;

/// Receives the points and metres so far, and says whether to continue.
pub type Progress<'a> = dyn FnMut(Summary) -> ControlFlow<()> + Send + 'a;

/// Simulates a drive and writes `PRESET_0001.laz` ..., `reference.csv`, `trajectory.csv` and `scene.json`
/// into `folder`. `progress` receives the points and metres so far, and says whether to continue.
///
/// # Errors
/// [`ConfigError`](crate::config::ConfigError) for settings out of range;
/// [`OutputError`] if the folder is not empty or cannot be written. [`SynthError`] if `progress` stops the
/// drive or the disk is full: files that were complete stay.
pub fn generate(settings: &Settings, folder: &Path, progress: &mut Progress<'_>) -> Result<Summary, Error> {
    settings.check()?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| Error::bug(format!("no worker threads: {error}")))?;
    sink::prepare(folder)?;
    let result = pool.install(|| Run::new(settings).drive(Sink::create(folder, settings)?, progress));
    result.map_err(|error| {
        let is_full = |error: &OutputError| {
            matches!(error, OutputError::Write { source, .. } if source.kind() == io::ErrorKind::StorageFull)
        };
        match error {
            Stopped::Output(source) if is_full(&source) => {
                SynthError::Full { folder: folder.to_owned(), source }.into()
            }
            Stopped::Output(error) => error.into(),
            Stopped::OnRequest { length_m, files } => {
                SynthError::Interrupted { folder: folder.to_owned(), length_m, files }.into()
            }
        }
    })
}

/// Why a drive ends early.
enum Stopped {
    Output(OutputError),
    OnRequest { length_m: f64, files: u32 },
}

impl From<OutputError> for Stopped {
    fn from(error: OutputError) -> Self {
        Self::Output(error)
    }
}

/// A drive in progress.
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
        let drive = Drive::new(plan, axis.end, settings.scanner.height(), settings.speed_kmh);
        Self { settings, plan, axis, library: things::models(plan.seed), drive, cells: BTreeMap::new() }
    }

    fn drive(mut self, mut sink: Sink<'_>, progress: &mut Progress<'_>) -> Result<Summary, Stopped> {
        let length = self.settings.length();
        let limit = self.settings.points.unwrap_or(u64::MAX);
        let end = self.settings.pulses();
        let mut next = 0;
        let mut so_far = Summary::default();
        let mut batch = Vec::new();
        let mut lowest = 0;
        while so_far.length_m < length && so_far.points < limit && next < end {
            let mut slices = self.slices(next..end, length);
            // The files of the previous round are written while this round is traced.
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
                next = slice.pulses.end;
                batch.push(slice);
            }
            // A closed street returns to its first cells.
            let first = self.cells.keys().next().filter(|_| self.axis.end.is_infinite());
            lowest = first.map_or(0, |cell| *cell as u32 * IDS);
            so_far.length_m = self.driven(next);
            if progress(so_far).is_break() {
                // Incomplete files are removed with the sink.
                return Err(Stopped::OnRequest { length_m: so_far.length_m, files: sink.complete_files() });
            }
        }
        sink.write(batch, lowest)?;
        Ok(sink.finish(so_far.length_m)?)
    }

    /// The moving things within range at time `t`, with their motion for `half` seconds before and after it.
    fn traffic(&self, t: f64, half: f64) -> Vec<Moving> {
        let (s, _) = self.drive.place(t);
        let place = (s, self.axis.line.at(s).point, self.settings.scanner.range_m + LANES);
        street::traffic::moving(&self.plan, &self.axis.line, &self.library, (t, half), place)
    }

    /// Metres driven when a pulse is fired.
    fn driven(&self, pulse: u64) -> f64 {
        self.drive.distance(self.settings.scanner.time(pulse, 0))
    }

    /// A round of slices to be traced, from the start of `pulses` on and within `length` metres. All slices
    /// see the same window.
    fn slices(&mut self, pulses: Range<u64>, length: f64) -> Vec<Slice> {
        let from = pulses.start;
        let step = self.settings.scanner.slice();
        let (s, _) = self.drive.place(self.settings.scanner.time(from, 0));
        // An object belongs to the cell of its middle, so objects that are half a cell or half a building
        // away are included.
        let ahead = self.driven(from + step * ROUND) - self.driven(from);
        let far = self.settings.scanner.range_m + ahead + (CELL + LONGEST) * 0.5;
        let near = self.axis.near(s, far);
        self.cells.retain(|cell, _| near.contains(cell));
        for cell in near {
            let build = || street::cell(self.plan, &self.axis, &self.library, cell);
            self.cells.entry(cell).or_insert_with(build);
        }
        let origin = self.axis.line.at(s).point.extend(0.0);
        let window = Window::new(origin, self.settings.scanner.spread(), self.cells.values().flatten());
        // A closed street returns to any of its places.
        let all = self.axis.end.is_finite();
        let line = if all { self.axis.line.clone() } else { self.axis.line.part(s - far, s + far) };
        let roadway = Arc::new(Roadway { plan: self.plan, drive: self.drive, line });
        let starts = (0..ROUND).map(|number| from + number * step);
        let slice = |from: u64| {
            let to = (from + step).min(pulses.end);
            let [start, end] = [from, to].map(|pulse| self.settings.scanner.time(pulse, 0));
            // The last slice may be shorter, but its traffic is the same as that of a whole slice.
            let half = (self.settings.scanner.time(from + step, 0) - start) * 0.5;
            let middle = start + half;
            let window = window.with(self.traffic(middle, half), half);
            let track = self.drive.track(&self.axis.line, start..end);
            let roadway = Arc::clone(&roadway);
            Slice { window, middle, track, roadway, pulses: from..to, records: Vec::new() }
        };
        starts.take_while(|start| *start < pulses.end && self.driven(*start) < length).map(slice).collect()
    }
}
