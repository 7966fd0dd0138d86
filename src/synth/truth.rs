//! What is known besides the points: the table of objects, the trajectory, and what the scene was made from.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use crate::output::OutputError;
use crate::whole_file::WholeFile;

use super::drive::Pose;
use super::scan::{POSES_HZ, START_TIME};
use super::street::Object;

/// World coordinates of the street's origin: UTM zone 32 north, in the south of Germany.
pub(super) const WORLD: [f64; 3] = [651_000.0, 5_400_000.0, 430.0];

/// Points of an object: how many, and the box around them in steps of 1 mm from the street's origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tally {
    pub(super) points: u64,
    low: [i32; 3],
    high: [i32; 3],
}

impl Default for Tally {
    fn default() -> Self {
        Self { points: 0, low: [i32::MAX; 3], high: [i32::MIN; 3] }
    }
}

impl Tally {
    /// Counts one point.
    pub(super) fn add(&mut self, point: [i32; 3]) {
        self.join(&Self { points: 1, low: point, high: point });
    }

    fn join(&mut self, other: &Self) {
        self.points += other.points;
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
    }
}

fn class_name(class: u8) -> &'static str {
    match class {
        2 => "tree",
        3 => "pole",
        4 => "car",
        5 => "building",
        6 => "fence_hedge_lowveg",
        7 => "person_furniture",
        8 => "wire",
        _ => "none",
    }
}

/// A text file that is written line by line.
#[derive(Debug)]
struct Lines(WholeFile);

impl Lines {
    fn create(path: &Path, header: &str) -> Result<Self, OutputError> {
        let failed = |source| OutputError::Write { path: path.to_owned(), source };
        let mut lines = Self(WholeFile::create(path).map_err(failed)?);
        lines.line(format_args!("{header}"))?;
        Ok(lines)
    }

    fn line(&mut self, line: std::fmt::Arguments<'_>) -> Result<(), OutputError> {
        writeln!(self.0, "{line}")
            .map_err(|source| OutputError::Write { path: self.0.path().to_owned(), source })
    }

    fn finish(self) -> Result<(), OutputError> {
        let path = self.0.path().to_owned();
        self.0.finish().map_err(|source| OutputError::Write { path, source })
    }
}

/// The table of objects: one row per object with at least one point, in the order of their numbers.
#[derive(Debug)]
pub(super) struct Reference {
    lines: Lines,
    tallies: BTreeMap<u32, Tally>,
    /// Objects that were counted and may have a row.
    pub(super) rows: u64,
}

impl Reference {
    pub(super) fn create(folder: &Path) -> Result<Self, OutputError> {
        let header = "instance,class,class_name,kind,base_x,base_y,base_z,xmin,ymin,zmin,xmax,ymax,zmax,n_points,\
                      height,model_height,base_inside";
        let lines = Lines::create(&folder.join("reference.csv"), header)?;
        Ok(Self { lines, tallies: BTreeMap::new(), rows: 0 })
    }

    /// Adds the points of a slice.
    pub(super) fn add(&mut self, tallies: &[(u32, Tally)]) {
        for (id, tally) in tallies {
            self.tallies.entry(*id).or_default().join(tally);
        }
    }

    /// Writes the rows of the objects numbered from `first` on, which get no more points; `inside` are the chainages
    /// that were driven.
    pub(super) fn retire(
        &mut self,
        first: u32,
        objects: &[Object],
        inside: std::ops::Range<f64>,
    ) -> Result<(), OutputError> {
        for (id, object) in (first..).zip(objects) {
            let Some(tally) = self.tallies.remove(&id) else { continue };
            let metres = |steps: [i32; 3], axis: usize| f64::from(steps[axis]) * 0.001 + WORLD[axis];
            let [x, y, z] = [0, 1, 2].map(|axis| object.base[axis] + WORLD[axis]);
            let [x0, y0, z0] = [0, 1, 2].map(|axis| metres(tally.low, axis));
            let [x1, y1, z1] = [0, 1, 2].map(|axis| metres(tally.high, axis));
            let (class, name) = (object.class, class_name(object.class));
            let (kind, points, tall) = (object.kind, tally.points, object.height);
            let base = u8::from(inside.contains(&object.s));
            let high = z1 - z0;
            self.lines.line(format_args!(
                "{id},{class},{name},{kind},{x:.3},{y:.3},{z:.3},{x0:.3},{y0:.3},{z0:.3},{x1:.3},{y1:.3},{z1:.3},\
                 {points},{high:.3},{tall:.3},{base}"
            ))?;
            self.rows += 1;
        }
        Ok(())
    }

    pub(super) fn finish(self) -> Result<(), OutputError> {
        self.lines.finish()
    }
}

/// The trajectory: one row per pose.
#[derive(Debug)]
pub(super) struct Trajectory(Lines);

impl Trajectory {
    pub(super) fn create(folder: &Path) -> Result<Self, OutputError> {
        let header = "gps_time,x,y,z,roll,pitch,heading";
        Ok(Self(Lines::create(&folder.join("trajectory.csv"), header)?))
    }

    pub(super) fn add(&mut self, poses: &[(u64, Pose)]) -> Result<(), OutputError> {
        for (number, pose) in poses {
            let t = START_TIME + *number as f64 / POSES_HZ;
            let [x, y, z] = [0, 1, 2].map(|axis| pose.position[axis] + WORLD[axis]);
            let [roll, pitch, heading] = [pose.roll, pose.pitch, pose.heading].map(f64::to_degrees);
            self.0.line(format_args!("{t:.4},{x:.4},{y:.4},{z:.4},{roll:.4},{pitch:.4},{heading:.4}"))?;
        }
        Ok(())
    }

    pub(super) fn finish(self) -> Result<(), OutputError> {
        self.0.finish()
    }
}
