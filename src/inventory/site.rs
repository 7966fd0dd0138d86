//! What all objects of a drive share: the frame of the input, the terrain, the axis, the names of the files.

use crate::inventory::terrain::Terrain;
use crate::model::{Lattice, ObjectPart};

/// Where a place is along the axis of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Distance along the axis in metres.
    pub chainage_m: f64,
    /// Distance from the axis in metres, positive to its left.
    pub offset_m: f64,
}

/// What all objects of a drive share: the frame of the input, the terrain, the axis, the names of the files.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// The lattice of the coordinates of objects.
    pub lattice: Lattice,
    /// Metres per unit of the input, for x, y and z.
    pub units_m: [f64; 3],
    /// Heights of the ground.
    pub terrain: &'a Terrain,
    /// Finds where a place, in metres, is along the axis. It is a function, so that attributes do not depend
    /// on how the axis is found.
    pub locate: &'a (dyn Fn([f64; 2]) -> Station + Sync),
    /// Whether the axis is a driven path. Around an axis that was estimated from the points, no roadway is
    /// known.
    pub is_driven: bool,
    /// Whether a place, in lattice units, is at the end of the data.
    pub at_end: &'a (dyn Fn([i64; 2]) -> bool + Sync),
    /// Whether the object with this id and hull, in lattice units, has points of the first or last profiles
    /// of the drive, or beside a gap, and reaches to where these profiles are.
    pub is_cut: &'a (dyn Fn(u32, &[[i64; 2]]) -> bool + Sync),
    /// Names of the input files, in their order.
    pub file_names: &'a [&'a str],
}

impl std::fmt::Debug for Site<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = out.debug_struct("Site");
        text.field("lattice", &self.lattice).field("units_m", &self.units_m);
        text.field("file_names", &self.file_names).finish_non_exhaustive()
    }
}

impl Site<'_> {
    /// A lattice coordinate of an axis (0 for x, 1 for y, 2 for z) in the units of the input.
    #[must_use]
    pub fn input_units(&self, axis: usize, coordinate: i64) -> f64 {
        self.lattice.metres(coordinate) / self.units_m[axis]
    }

    /// Lattice z of the ground below the centre of an object, if it is known nearby.
    #[must_use]
    pub fn ground_below(&self, part: &ObjectPart) -> Option<i64> {
        let [x, y, _] = centre(part);
        self.terrain.height_m([x, y]).map(|metres| self.lattice.units(metres))
    }

    /// A lattice point in the units of the input.
    #[must_use]
    pub fn input_point(&self, point: [i64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.input_units(axis, point[axis]))
    }
}

/// Mean of the points of an object, rounded to the lattice. Sums are exact integers.
#[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
pub(super) fn centre(part: &ObjectPart) -> [i64; 3] {
    let points = i128::from(part.points.max(1));
    part.sum.map(|sum| (sum + points / 2).div_euclid(points) as i64)
}
