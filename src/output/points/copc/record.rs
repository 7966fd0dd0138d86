//! A point of the cloud-optimised file: its record in point format 6, 7 or 8, made from a record of any
//! format, followed by the object and its class.

use super::octree::PART_DIGITS;
use crate::input::{InputFile, RecordLayout};
use crate::model::{AxisTransform, Lattice};
use crate::output::error::OutputError;
use crate::output::points::descriptor::{ExtraType, OBJECT_CLASS, of_label};

/// Steps of the scan angle per degree: formats 0 to 5 store degrees, formats 6 to 10 steps of 0.006 degrees
/// (LAS 1.4 R15, table 16).
const STEPS_PER_DEGREE: f64 = 1.0 / 0.006;
/// Bytes of format 6. Formats 7 and 8 add colours after them.
const BASE: usize = 30;
/// Bit of the global encoding: GPS times are adjusted standard times, and not of the week.
const STANDARD_TIME: u16 = 1;
/// The largest number of steps from the offset: 2^31 less some for rounding.
const MOST_STEPS: f64 = (i32::MAX - 8) as f64;
/// Class of overlap points in formats 0 to 5 (LAS 1.4 R15, table 9). Formats 6 to 10 reserve it and have the
/// flag instead (tables 16 and 17).
const OVERLAP_CLASS: u8 = 12;
const OVERLAP: u8 = 1 << 3;
const UNCLASSIFIED: u8 = 1;

/// The format of the records of the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CopcFormat<'a> {
    /// Point format: 6, 7 with colours, 8 with near infrared as well.
    pub(crate) point_format: u8,
    /// World units per integer step, per axis.
    pub(crate) scale: [f64; 3],
    /// World coordinates of the integers 0.
    pub(crate) offset: [f64; 3],
    /// Metres per world unit of x and y.
    plan_unit_m: f64,
    /// Metres per world unit of z.
    height_unit_m: f64,
    /// Lattice units by which written coordinates can be further out than those of the lattice, per axis.
    slack: [i64; 3],
    /// Whether GPS times are adjusted standard times.
    pub(crate) standard_time: bool,
    /// Dimensions after the fields of the format: the object, and its class if the method gives one.
    pub(crate) extra: Vec<(&'a str, ExtraType, &'static str)>,
}

/// Positions of the colours of a point format: red, green and blue, and near infrared, if it has them.
fn colours(point_format: u8) -> (Option<usize>, Option<usize>) {
    match point_format {
        2 => (Some(20), None),
        3 | 5 => (Some(28), None),
        7 => (Some(30), None),
        8 | 10 => (Some(30), Some(36)),
        _ => (None, None),
    }
}

impl<'a> CopcFormat<'a> {
    /// Whether the points of these files can be one file: it has one kind of GPS times.
    ///
    /// # Errors
    /// [`OutputError::Copc`] that names a file of each kind.
    pub(crate) fn check(files: &[InputFile]) -> Result<(), OutputError> {
        let of_kind = |standard: bool| {
            files.iter().find(|file| has_time(file) && is_standard(file) == standard).map(InputFile::name)
        };
        let (Some(week), Some(standard)) = (of_kind(false), of_kind(true)) else { return Ok(()) };
        let reason = format!(
            "{week} has GPS times of the week, and {standard} adjusted standard times, and one file can only have one of \
             these"
        );
        Err(OutputError::Copc { reason })
    }

    /// The format that keeps coordinates and colours of all files: the finest scale of each axis, and the
    /// offset of the first file. If `extent`, on the lattice, is too large for these, the offset is in the
    /// middle. If it still is too large, the scale is the step of the lattice.
    ///
    /// # Errors
    /// [`OutputError::Copc`] without files, and if the extent is too large for the lattice.
    pub(crate) fn of(
        files: &[InputFile],
        (lattice, extent): (Lattice, [[i64; 3]; 2]),
        (dimension, surfaces): (&'a str, bool),
        classifies: bool,
    ) -> Result<Self, OutputError> {
        let refused = |reason: &str| OutputError::Copc { reason: reason.to_owned() };
        let first = files.first().ok_or_else(|| refused("there are no files"))?;
        let units_m = first.units_m();
        let timed = files.iter().find(|file| has_time(file)).unwrap_or(first);
        let (mut scale, mut offset) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let world = |value: i64| lattice.metres(value) / units_m[axis];
            let scales = files.iter().map(|file| file.header().scaling.scale[axis]);
            let steps = [scales.fold(f64::INFINITY, f64::min), lattice.step_m() / units_m[axis]];
            let from = first.header().scaling.offset[axis] + 0.0;
            (scale[axis], offset[axis]) = numbers(steps, from, extent.map(|end| world(end[axis])))
                .ok_or_else(|| too_large(lattice, extent, axis))?;
        }
        let formats = || files.iter().map(|file| colours(file.layout().point_format));
        let point_format =
            match (formats().any(|found| found.0.is_some()), formats().any(|found| found.1.is_some())) {
                (_, true) => 8,
                (true, false) => 7,
                (false, false) => 6,
            };
        let mut extra = vec![(dimension, ExtraType::U32, of_label(surfaces))];
        extra.extend(classifies.then_some((OBJECT_CLASS, ExtraType::U8, "class of the object, 0: none")));
        let mut format = Self {
            point_format,
            scale,
            offset,
            plan_unit_m: units_m[0],
            height_unit_m: units_m[2],
            slack: [0; 3],
            standard_time: is_standard(timed),
            extra,
        };
        format.slack = [0, 1, 2].map(|axis| format.slack(files, lattice, axis));
        Ok(format)
    }

    /// Lattice units between written coordinates and those of the lattice: none if both are whole numbers of
    /// lattice units, else half a step of each.
    fn slack(&self, files: &[InputFile], lattice: Lattice, axis: usize) -> i64 {
        let unit_m = if axis == 2 { self.height_unit_m } else { self.plan_unit_m };
        let is_whole = |axis: AxisTransform| matches!(axis, AxisTransform::Integer { .. });
        let written = AxisTransform::new(self.scale[axis], self.offset[axis], unit_m, lattice);
        let is_kept = |file: &InputFile| {
            let (factor, shift) = self.conversion(file).axes[axis];
            is_whole(file.transform().axes[axis]) && factor.fract() == 0.0 && shift.fract() == 0.0
        };
        if is_whole(written) && files.iter().all(is_kept) {
            return 0;
        }
        // One more, because the sum may be rounded down.
        lattice.units_up(self.scale[axis] * unit_m / 2.0 + lattice.step_m() / 2.0) + 1
    }

    /// Bytes of the dimensions after the fields of the format.
    pub(crate) fn extra_bytes(&self) -> u16 {
        self.extra.iter().map(|(_, kind, _)| kind.bytes()).sum()
    }

    /// Bytes of a record.
    pub(crate) fn record_len(&self) -> usize {
        let colours = match self.point_format {
            6 => 0,
            7 => 6,
            _ => 8,
        };
        BASE + colours + usize::from(self.extra_bytes())
    }

    /// The places of its records in the frame of the octree. A node is a cube in the numbers of the file
    /// (COPC 1.0, "halfsize"), so the octree takes heights as if they had the unit of x and y. Where all
    /// units are the same, this is the lattice.
    pub(crate) fn to_tree(&self, lattice: Lattice) -> ToTree {
        let axis =
            |axis: usize| AxisTransform::new(self.scale[axis], self.offset[axis], self.plan_unit_m, lattice);
        ToTree([axis(0), axis(1), axis(2)])
    }

    /// The extent of written coordinates in the frame of the octree, from the extent on the lattice.
    pub(crate) fn extent_in_tree(&self, [mut low, mut high]: [[i64; 3]; 2]) -> [[i64; 3]; 2] {
        for axis in 0..3 {
            low[axis] -= self.slack[axis];
            high[axis] += self.slack[axis];
        }
        let factor = self.plan_unit_m / self.height_unit_m;
        if (factor - 1.0).abs() > 1e-9 {
            // A height on the lattice is rounded by half a unit before it is stretched.
            let slack = (0.5 * factor + 0.5).ceil();
            #[expect(
                clippy::cast_possible_truncation,
                reason = "heights of the earth, in units of at least 1 mm"
            )]
            let stretched = |z: i64, sign: f64| (z as f64 * factor + sign * slack).round() as i64;
            low[2] = stretched(low[2], -1.0);
            high[2] = stretched(high[2], 1.0);
        }
        [low, high]
    }

    /// The conversion of the records of a file to this format.
    pub(crate) fn conversion(&self, file: &InputFile) -> Conversion<'_> {
        let from = file.header().scaling;
        let axes = [0, 1, 2].map(|axis| {
            let factor = from.scale[axis] / self.scale[axis];
            let shift = (from.offset[axis] - self.offset[axis]) / self.scale[axis];
            // Decimal scales and offsets are multiples of each other except for the last digits.
            let whole = |value: f64| if (value - value.round()).abs() < 1e-6 { value.round() } else { value };
            (whole(factor), whole(shift))
        });
        Conversion { format: self, layout: file.layout().clone(), axes }
    }
}

/// Whether the points of a file have GPS times.
fn has_time(file: &InputFile) -> bool {
    file.layout().gps_time.is_some()
}

/// Whether GPS times of a file are adjusted standard times.
fn is_standard(file: &InputFile) -> bool {
    file.header().global_encoding & STANDARD_TIME != 0
}

/// Scale and offset of an axis whose numbers reach from `low` to `high`: the first of the steps and the
/// offset `from`, if that fits. Else the offset is in the middle, a whole number of steps away from `from`.
fn numbers(steps: [f64; 2], from: f64, [low, high]: [f64; 2]) -> Option<(f64, f64)> {
    let fits = |(scale, offset): (f64, f64)| {
        [low, high].iter().all(|value| ((value - offset) / scale).abs() <= MOST_STEPS)
    };
    let in_the_middle = |step: f64| (step, from + (((low + high) / 2.0 - from) / step).round() * step);
    [(steps[0], from), in_the_middle(steps[0]), in_the_middle(steps[1])]
        .into_iter()
        .find(|found| fits(*found))
}

fn too_large(lattice: Lattice, [low, high]: [[i64; 3]; 2], axis: usize) -> OutputError {
    let metres = |units: i64| lattice.metres(units).round();
    let most = 2.0 * MOST_STEPS * lattice.step_m();
    let reason = format!(
        "its points are up to {} m apart in {}, and coordinates of 32 bits in steps of {} m reach {:.0} m",
        metres(high[axis] - low[axis]),
        ["x", "y", "z"][axis],
        lattice.step_m(),
        most
    );
    OutputError::Copc { reason }
}

/// Written coordinates to the frame of the octree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ToTree([AxisTransform; 3]);

impl ToTree {
    /// The place of a record in parts of a lattice unit, rounded down.
    pub(crate) fn parts(self, record: [i32; 3]) -> [i64; 3] {
        let axis = |axis: usize| match self.0[axis] {
            AxisTransform::Integer { factor, shift } => {
                (i64::from(record[axis]) * factor + shift) << PART_DIGITS
            }
            AxisTransform::Real { factor, shift } => {
                let parts = (f64::from(record[axis]) * factor + shift) * f64::from(1 << PART_DIGITS);
                #[expect(clippy::cast_possible_truncation, reason = "below 2^50 units, see LIMIT_UNITS")]
                let parts = parts.floor() as i64;
                parts
            }
        };
        [axis(0), axis(1), axis(2)]
    }
}

/// Makes the records of one file.
#[derive(Debug)]
pub(crate) struct Conversion<'a> {
    format: &'a CopcFormat<'a>,
    layout: RecordLayout,
    /// Factor and shift of each axis.
    axes: [(f64, f64); 3],
}

impl Conversion<'_> {
    /// Appends the record of a point to `out`. `class` is its LAS class.
    ///
    /// # Errors
    /// [`OutputError::Copc`] if its coordinates do not fit the scale and offset of the file.
    pub(crate) fn append(
        &self,
        record: &[u8],
        class: u8,
        object: u32,
        object_class: u8,
        out: &mut Vec<u8>,
    ) -> Result<(), OutputError> {
        let start = out.len();
        for (axis, (factor, shift)) in self.axes.iter().enumerate() {
            let value = i32::from_le_bytes(four(record, axis * 4));
            let value = (f64::from(value) * factor + shift).round();
            if value < f64::from(i32::MIN) || value > f64::from(i32::MAX) {
                let reason = format!(
                    "a point does not fit scale {} and offset {} of {}, although the survey found that all points do",
                    self.format.scale[axis],
                    self.format.offset[axis],
                    ["x", "y", "z"][axis]
                );
                return Err(OutputError::Copc { reason });
            }
            #[expect(clippy::cast_possible_truncation, reason = "checked above")]
            out.extend((value as i32).to_le_bytes());
        }
        if self.layout.point_format >= 6 {
            out.extend(&record[12..BASE]);
            out[start + 16] = class;
        } else {
            self.modern(record, class, out);
        }
        let (colour, infrared) = colours(self.layout.point_format);
        if self.format.point_format >= 7 {
            out.extend(colour.map_or([0; 6], |at| std::array::from_fn(|byte| record[at + byte])));
        }
        if self.format.point_format == 8 {
            out.extend(infrared.map_or([0; 2], |at| [record[at], record[at + 1]]));
        }
        out.extend(object.to_le_bytes());
        if self.format.extra.len() > 1 {
            out.push(object_class);
        }
        Ok(())
    }

    /// Bytes 12 to 29 of format 6, from a record of the formats 0 to 5 (LAS 1.4 R15, tables 7 and 16).
    fn modern(&self, record: &[u8], class: u8, out: &mut Vec<u8>) {
        let returns = record[14];
        let (class, overlap) = if class == OVERLAP_CLASS { (UNCLASSIFIED, OVERLAP) } else { (class, 0) };
        out.extend(&record[12..14]);
        out.push((returns & 7) | (returns >> 3 & 7) << 4);
        // The flags synthetic, key point and withheld move down; scan direction and edge of the flight line
        // stay.
        out.push(record[15] >> 5 | overlap | (returns & 0xc0));
        let degrees = f64::from(i8::from_le_bytes([record[16]]));
        #[expect(clippy::cast_possible_truncation, reason = "at most 128 / 0.006")]
        let angle = (degrees * STEPS_PER_DEGREE).round() as i16;
        out.extend([class, record[17]]);
        out.extend(angle.to_le_bytes());
        out.extend(&record[18..20]);
        match self.layout.gps_time {
            Some(at) => out.extend(&record[at..at + 8]),
            None => out.extend([0; 8]),
        }
    }
}

fn four(record: &[u8], at: usize) -> [u8; 4] {
    [record[at], record[at + 1], record[at + 2], record[at + 3]]
}
