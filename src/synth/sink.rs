//! Writes slices in order: the point files, the table of objects, the trajectory, the description of the
//! scene.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, IVec3};

use crate::output::points::descriptor::ExtraType;
use crate::output::points::new_file::{ExtraDimension, NewFile, NewFileSchema};
use crate::output::{OutputError, save};
use crate::whole_file::{self, WholeFile};

use super::scan::drive::Pose;
use super::scan::roadway::{Above, Roadway};
use super::scan::{Record, START_TIME, Slice};
use super::scene::Window;
use super::settings::{Settings, Summary};
use super::street::axis::LEAD;
use super::street::traffic::whose;
use super::things::object::{Object, Place};

/// World coordinates of the street's origin: UTM zone 32 north, in the south of Germany.
const WORLD: DVec3 = DVec3::new(651_000.0, 5_400_000.0, 430.0);
/// Class codes by name, from 0, as in the labelled scenes.
const CLASSES: [&str; 9] =
    ["none", "ground", "tree", "pole", "car", "building", "fence_hedge_lowveg", "person_furniture", "wire"];

/// Classes of objects that stand or move on the roadway and have no clearance: vehicles and persons.
const ON_ROADWAY: [u8; 2] = [4, 7];

/// The points of an object: their number, and the box around them in steps of 1 mm from the street's origin.
#[derive(Debug)]
struct Tally {
    /// `None` for ground and strays.
    object: Option<Arc<Object>>,
    points: u64,
    low: IVec3,
    high: IVec3,
    above: Above,
}

/// The output folder while it is filled.
#[derive(Debug)]
pub(crate) struct Sink<'a> {
    folder: &'a Path,
    settings: &'a Settings,
    file: Option<(u16, NewFile)>,
    /// One row per object with at least one point, in the order of their numbers.
    reference: WholeFile,
    /// One row per pose.
    trajectory: WholeFile,
    /// The first pose after the points that are written. It is the last one of the trajectory, so that the
    /// position of every point lies between two.
    next_pose: Option<Pose>,
    /// Objects that may get more points, by number. Moving objects have the highest numbers and stay until
    /// the end.
    seen: BTreeMap<u32, Tally>,
    summary: Summary,
}

/// Makes sure that `folder` exists and is empty. Incomplete files of a killed process are removed.
pub(crate) fn prepare(folder: &Path) -> Result<(), OutputError> {
    let entries = fs_err::create_dir_all(folder).and_then(|()| fs_err::read_dir(folder));
    let failed = |source| OutputError::Write { path: folder.to_owned(), source };
    let mut left_behind = Vec::new();
    for entry in entries.map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if !whole_file::is_left_behind(&path) {
            return Err(OutputError::NotEmpty { path: folder.to_owned() });
        }
        left_behind.push(path);
    }
    for path in left_behind {
        fs_err::remove_file(&path).map_err(|source| OutputError::Write { path, source })?;
    }
    Ok(())
}

impl<'a> Sink<'a> {
    pub(crate) fn create(folder: &'a Path, settings: &'a Settings) -> Result<Self, OutputError> {
        let table = |name: &str, columns: &str| {
            let path = folder.join(name);
            let begun = WholeFile::create(&path).and_then(|mut to| writeln!(to, "{columns}").map(|()| to));
            begun.map_err(|source| OutputError::Write { path, source })
        };
        Ok(Self {
            folder,
            settings,
            file: None,
            reference: table(
                "reference.csv",
                "instance,class,class_name,kind,base_x,base_y,base_z,xmin,ymin,zmin,xmax,ymax,zmax,n_points,height,\
                 model_height,base_inside,crown_diameter,dbh,inclination,inclination_azimuth,speed_kmh,clearance",
            )?,
            trajectory: table("trajectory.csv", "gps_time,x,y,z,roll,pitch,heading")?,
            next_pose: None,
            seen: BTreeMap::new(),
            summary: Summary { length_m: f64::INFINITY, ..Summary::default() },
        })
    }

    /// Writes slices. After them, objects with numbers below `lowest` get no more points.
    pub(crate) fn write(&mut self, slices: Vec<Slice>, lowest: u32) -> Result<(), OutputError> {
        let folder = self.folder;
        let failed = |source| OutputError::Write { path: folder.to_owned(), source };
        for Slice { window, track, roadway, records, .. } in slices {
            for records in records.chunk_by(|a, b| a.file == b.file) {
                self.open(records[0].file)?.append(bytemuck::cast_slice(records))?;
            }
            self.summary.points += records.len() as u64;
            for records in records.chunk_by(|a, b| a.instance == b.instance) {
                self.count(&window, &roadway, records);
            }
            let mut poses = track.poses.iter().filter(|pose| track.time.contains(&pose.t));
            poses.try_for_each(|pose| self.pose(pose)).map_err(failed)?;
            self.next_pose = track.poses.iter().find(|pose| pose.t >= track.time.end).copied();
        }
        while let Some(entry) = self.seen.first_entry().filter(|entry| *entry.key() < lowest) {
            let (id, tally) = entry.remove_entry();
            self.object(id, &tally).map_err(failed)?;
        }
        Ok(())
    }

    /// Point files that have their final names.
    pub(crate) fn complete_files(&self) -> u32 {
        self.summary.files - u32::from(self.file.is_some())
    }

    /// Counts points of one object of a window.
    fn count(&mut self, window: &Window, roadway: &Roadway, records: &[Record]) {
        let id = records[0].instance;
        let new = || Tally {
            object: window.object(whose(id)),
            points: 0,
            low: IVec3::MAX,
            high: IVec3::MIN,
            above: Above::default(),
        };
        let tally = self.seen.entry(id).or_insert_with(new);
        tally.points += records.len() as u64;
        for steps in records.iter().map(|record| IVec3::from(record.steps)) {
            (tally.low, tally.high) = (tally.low.min(steps), tally.high.max(steps));
            if tally.object.as_ref().is_some_and(|object| !ON_ROADWAY.contains(&object.class)) {
                tally.above.add(steps, roadway);
            }
        }
    }

    /// The open point file; from now on, the file of point source `number`.
    fn open(&mut self, number: u16) -> Result<&mut NewFile, OutputError> {
        let (current, file) = match self.file.take() {
            Some((current, file)) if current == number => (current, file),
            before => {
                if let Some((_, file)) = before {
                    file.finish()?;
                }
                let Settings { preset, compressed, .. } = *self.settings;
                let suffix = if compressed { "laz" } else { "las" };
                let path = self.folder.join(format!("{}_{number:04}.{suffix}", preset.name()));
                self.summary.files += 1;
                (number, NewFile::create(&path, &schema(number), compressed)?)
            }
        };
        Ok(&mut self.file.insert((current, file)).1)
    }

    /// Writes the row of a pose.
    fn pose(&mut self, pose: &Pose) -> io::Result<()> {
        let t = START_TIME + pose.t;
        let [x, y, z] = (pose.position + WORLD).to_array();
        let [roll, pitch, heading] = [pose.roll, pose.pitch, pose.heading].map(f64::to_degrees);
        writeln!(self.trajectory, "{t:.4},{x:.4},{y:.4},{z:.4},{roll:.4},{pitch:.4},{heading:.4}")
    }

    /// Writes the row of an object.
    fn object(&mut self, id: u32, tally: &Tally) -> io::Result<()> {
        let &Tally { object: Some(ref object), points, low, high, ref above } = tally else { return Ok(()) };
        let Object { class, kind, place, height, truth, .. } = **object;
        let name = CLASSES[usize::from(class)];
        let [x0, y0, z0] = (low.as_dvec3() * 0.001 + WORLD).to_array();
        let [x1, y1, z1] = (high.as_dvec3() * 0.001 + WORLD).to_array();
        let tall = z1 - z0;
        let driven = LEAD..LEAD + self.summary.length_m;
        // A value that an object does not have is empty. A moving object has no foot, and its box is the box
        // of its trace. It is never marked as inside, so that no measure is compared with it.
        let field = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.3}"));
        let (base, inside, speed) = match place {
            Place::Stands { base, s } => (Some(base + WORLD), driven.contains(&s), None),
            Place::Moves { speed_kmh } => (None, false, Some(speed_kmh)),
        };
        let inside = u8::from(inside);
        let [x, y, z] = [0, 1, 2].map(|axis| field(base.map(|base| base[axis])));
        let speed = field(speed);
        let crown = field(truth.crown_diameter);
        let dbh = field(truth.dbh);
        let clearance = field(above.clearance(class));
        let [lean, azimuth] = [0, 1].map(|k| field(truth.inclination.map(|both| both[k])));
        self.summary.objects += 1;
        writeln!(
            self.reference,
            "{id},{class},{name},{kind},{x},{y},{z},{x0:.3},{y0:.3},{z0:.3},{x1:.3},{y1:.3},{z1:.3},\
             {points},{tall:.3},{height:.3},{inside},{crown},{dbh},{lean},{azimuth},{speed},{clearance}"
        )
    }

    /// Completes all files, and writes the settings from which they were made. `length_m` is the driven
    /// length.
    pub(crate) fn finish(mut self, length_m: f64) -> Result<Summary, OutputError> {
        self.summary.length_m = length_m;
        self.write(Vec::new(), u32::MAX)?;
        let last = self.next_pose.take();
        let written = last.map_or(Ok(()), |pose| self.pose(&pose));
        written.map_err(|source| OutputError::Write { path: self.folder.to_owned(), source })?;
        if let Some((_, file)) = self.file.take() {
            file.finish()?;
        }
        let Self { folder, summary, .. } = self;
        let tables = self.reference.finish().and_then(|()| self.trajectory.finish());
        tables.map_err(|source| OutputError::Write { path: folder.to_owned(), source })?;
        let scene = serde_json::json!({
            "generator": "chainage synth",
            "version": env!("CARGO_PKG_VERSION"),
            "crs": "EPSG:25832",
            "lead_m": LEAD,
            "settings": self.settings,
            "written": summary,
        });
        save(&folder.join("scene.json"), |to| writeln!(to, "{scene:#}"))?;
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
        offset: WORLD.to_array(),
        wkt: include_str!("epsg25832.wkt").trim_ascii_end(),
        system: "simulated MLS",
        created: (2026, 166), // 15 June, the day of the drive: not the clock, so that bytes repeat
        source_id: number,
    }
}
