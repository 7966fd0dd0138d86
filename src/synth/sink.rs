//! Where slices go, in order: the point files, the table of objects, the trajectory, the description of the scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::output::descriptor::ExtraType;
use crate::output::new_file::{ExtraDimension, NewFile, NewFileSchema};
use crate::output::{OutputError, save};

use super::axis::LEAD;
use super::scan::{RECORD_BYTES, Slice};
use super::street::Object;
use super::truth::{Reference, Trajectory, WORLD};
use super::{Settings, Summary};

/// The slices of one round, and the cells that were made for them.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub(super) slices: Vec<Slice>,
    /// Cell, number of its first object, its objects.
    pub(super) cells: Vec<(usize, u32, Vec<Object>)>,
    /// No later slice sees a cell before this one.
    pub(super) lowest: usize,
}

/// The output folder while it is filled.
#[derive(Debug)]
pub(super) struct Sink {
    folder: PathBuf,
    prefix: &'static str,
    compressed: bool,
    file: Option<(u16, NewFile)>,
    files: u32,
    points: u64,
    reference: Reference,
    trajectory: Trajectory,
    /// Cells whose objects may get more points.
    waiting: BTreeMap<usize, (u32, Vec<Object>)>,
    length_m: f64,
}

/// Makes sure `folder` is there and empty; with `force`, what an earlier run of this command left there is removed.
pub(super) fn prepare(folder: &Path, force: bool) -> Result<(), OutputError> {
    let failed = |source| OutputError::Write { path: folder.to_owned(), source };
    fs_err::create_dir_all(folder).map_err(failed)?;
    for entry in fs_err::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if !force {
            return Err(OutputError::NotEmpty { path: folder.to_owned() });
        }
        if is_ours(&entry.file_name().to_string_lossy()) {
            fs_err::remove_file(entry.path()).map_err(failed)?;
        }
    }
    Ok(())
}

/// Whether this command writes files of that name.
fn is_ours(name: &str) -> bool {
    let name = name.strip_suffix(".part").unwrap_or(name);
    if matches!(name, "reference.csv" | "trajectory.csv" | "scene.json") {
        return true;
    }
    let stem = name.strip_suffix(".laz").or_else(|| name.strip_suffix(".las"));
    let parts = stem.and_then(|stem| stem.rsplit_once('_'));
    parts.is_some_and(|(preset, number)| {
        super::Preset::ALL.iter().any(|known| known.name() == preset) && number.parse::<u16>().is_ok()
    })
}

impl Sink {
    pub(super) fn create(folder: &Path, settings: &Settings) -> Result<Self, OutputError> {
        Ok(Self {
            folder: folder.to_owned(),
            prefix: settings.preset.name(),
            compressed: settings.compressed,
            file: None,
            files: 0,
            points: 0,
            reference: Reference::create(folder)?,
            trajectory: Trajectory::create(folder)?,
            waiting: BTreeMap::new(),
            length_m: f64::INFINITY,
        })
    }

    /// Writes a round.
    pub(super) fn write(&mut self, batch: Batch) -> Result<(), OutputError> {
        for (cell, first, objects) in batch.cells {
            self.waiting.insert(cell, (first, objects));
        }
        for slice in &batch.slices {
            self.records(&slice.records)?;
            self.reference.add(&slice.tallies);
            self.trajectory.add(&slice.poses)?;
        }
        self.retire(batch.lowest)
    }

    /// Appends records to the file whose number they carry as point source.
    fn records(&mut self, mut records: &[u8]) -> Result<(), OutputError> {
        self.points += (records.len() / RECORD_BYTES) as u64;
        while let Some(first) = records.first_chunk::<RECORD_BYTES>() {
            let number = u16::from_le_bytes([first[20], first[21]]);
            let (all, _) = records.as_chunks::<RECORD_BYTES>();
            let same = all.partition_point(|record| u16::from_le_bytes([record[20], record[21]]) <= number);
            let (here, rest) = records.split_at(same * RECORD_BYTES);
            self.open(number)?.append(here)?;
            records = rest;
        }
        Ok(())
    }

    fn open(&mut self, number: u16) -> Result<&mut NewFile, OutputError> {
        let (current, file) = match self.file.take() {
            Some((current, file)) if current == number => (current, file),
            before => {
                if let Some((_, file)) = before {
                    file.finish()?;
                }
                let suffix = if self.compressed { "laz" } else { "las" };
                let path = self.folder.join(format!("{}_{number:04}.{suffix}", self.prefix));
                self.files += 1;
                (number, NewFile::create(&path, &schema(number), self.compressed)?)
            }
        };
        Ok(&mut self.file.insert((current, file)).1)
    }

    /// Writes the rows of the objects of all cells before `lowest`.
    fn retire(&mut self, lowest: usize) -> Result<(), OutputError> {
        while let Some(entry) = self.waiting.first_entry().filter(|entry| *entry.key() < lowest) {
            let (first, objects) = entry.remove();
            self.reference.retire(first, &objects, LEAD..LEAD + self.length_m)?;
        }
        Ok(())
    }

    /// Completes all files. `length_m` is what was driven, `scene` the description.
    pub(super) fn finish(mut self, length_m: f64, scene: serde_json::Value) -> Result<Summary, OutputError> {
        self.length_m = length_m;
        self.retire(usize::MAX)?;
        if let Some((_, file)) = self.file.take() {
            file.finish()?;
        }
        let summary =
            Summary { points: self.points, files: self.files, objects: self.reference.rows, length_m };
        self.reference.finish()?;
        self.trajectory.finish()?;
        let path = self.folder.join("scene.json");
        let mut scene = scene;
        scene["points"] = summary.points.into();
        scene["files"] = summary.files.into();
        scene["objects"] = summary.objects.into();
        scene["driven_m"] = ((length_m * 1_000.0).round() / 1_000.0).into();
        save(&path, |to| writeln!(to, "{scene:#}"))?;
        Ok(summary)
    }
}

fn schema(number: u16) -> NewFileSchema {
    let extra = |name, kind, description| ExtraDimension { name, kind, description };
    NewFileSchema {
        point_format: 6,
        extra: vec![
            extra("gt_instance", ExtraType::U32, "object number, 0 none"),
            extra("gt_class", ExtraType::U8, "0 noise 1 ground 2 tree 3 pole"),
        ],
        scale: [0.001; 3],
        offset: WORLD,
        wkt: include_str!("epsg25832.wkt").trim_ascii_end(),
        system: "simulated MLS",
        created: (2026, 166), // 15 June, the day of the drive: not the clock, so that bytes repeat
        source_id: number,
    }
}
