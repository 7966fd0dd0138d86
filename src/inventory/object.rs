//! What attributes see: one whole object, and what all objects of a drive share.

use crate::inventory::terrain::Terrain;
use crate::model::{Kind, Lattice, ObjectPart};

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
    /// Finds where a place, in metres, is along the axis. A function, so that attributes do not depend on how the
    /// axis is found.
    pub locate: &'a dyn Fn([f64; 2]) -> Station,
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

    /// A lattice point in the units of the input.
    #[must_use]
    pub fn input_point(&self, point: [i64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.input_units(axis, point[axis]))
    }
}

/// A whole object: its number, the summary of its points, and values that several attributes derive from it.
#[derive(Debug, Clone, Copy)]
pub struct Object<'a> {
    /// Object id, from 1.
    pub id: u32,
    /// Summary of its points, on the lattice.
    pub part: &'a ObjectPart,
    /// Its class and confidence. Class 0 from methods that do not classify.
    pub kind: Kind,
    /// The values that all objects share.
    pub site: &'a Site<'a>,
    /// Mean of its points on the lattice, rounded towards zero: the lattice is finer than the written decimals.
    pub centre: [i64; 3],
    /// Height of the ground in metres in the cell nearest to its centre, if one is known nearby.
    pub ground_m: Option<f64>,
}

impl<'a> Object<'a> {
    /// The object `id` with its points.
    #[must_use]
    pub fn new(id: u32, part: &'a ObjectPart, site: &'a Site<'a>) -> Self {
        // Sums are exact integers.
        #[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
        let centre = part.sum.map(|sum| (sum / i128::from(part.points.max(1))) as i64);
        let ground_m = site.terrain.height_m([centre[0], centre[1]]);
        Self { id, part, kind: Kind::default(), site, centre, ground_m }
    }

    /// The same object with a class and its confidence.
    #[must_use]
    pub fn of_kind(self, kind: Kind) -> Self {
        Self { kind, ..self }
    }

    /// Height of a lattice z above the ground in metres.
    #[must_use]
    pub fn above_ground_m(&self, z: i64) -> Option<f64> {
        self.ground_m.map(|ground_m| self.site.lattice.metres(z) - ground_m)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::inventory::attribute::Attribute;
    use crate::inventory::terrain::TerrainSums;
    use crate::model::{FileId, PointId, Value};
    use crate::spatial::{Cell, CellGrid};

    pub(crate) const METRES: [f64; 3] = [1.0; 3];
    /// International feet.
    pub(crate) const FEET: [f64; 3] = [0.304_8; 3];

    /// A box of 3.048 m by 6.096 m from (0, 0), 1 m to 4.048 m high, of which four points are known.
    pub(crate) fn box_part() -> ObjectPart {
        ObjectPart {
            points: 4,
            first_id: PointId::new(9),
            lo: [0, 0, 1_000],
            hi: [3_048, 6_096, 4_048],
            sum: [2 * 3_048, 2 * 6_096, 2 * 5_048],
            hull: vec![[0, 0], [3_048, 0], [3_048, 6_096], [0, 6_096]],
            files: vec![FileId::new(0), FileId::new(2)],
        }
    }

    /// Ground at the given heights, in lattice units, in cells of 1 m.
    pub(crate) fn terrain_at(heights: &[(Cell, i64)]) -> Terrain {
        let mut sums = TerrainSums::new(CellGrid::new(1_000), Lattice::MILLIMETRE, -10_000);
        for &(cell, height) in heights {
            sums.add(cell, 1, height);
        }
        sums.into_terrain()
    }

    /// Three files, and an axis to the east along y = 5 m.
    pub(crate) fn site(terrain: &Terrain, units_m: [f64; 3]) -> Site<'_> {
        Site {
            lattice: Lattice::MILLIMETRE,
            units_m,
            terrain,
            locate: &|place| Station { chainage_m: place[0], offset_m: place[1] - 5.0 },
            file_names: &["a.las", "b.las", "c.las"],
        }
    }

    /// The decimals that an attribute gives for [`box_part`]; `None` for a missing value.
    pub(crate) fn decimals(
        attribute: &dyn Attribute,
        ground: &[(Cell, i64)],
        units_m: [f64; 3],
    ) -> Vec<Option<f64>> {
        let terrain = terrain_at(ground);
        let site = site(&terrain, units_m);
        let part = box_part();
        let mut values = Vec::new();
        attribute.finish(&Object::new(7, &part, &site), &mut values);
        let decimal = |value: &Value<'_>| match value {
            Value::Decimal(value) => Some(*value),
            Value::Missing => None,
            other => panic!("{other:?} is not a decimal"),
        };
        values.iter().map(decimal).collect()
    }

    /// Whether numbers agree to a millionth.
    pub(crate) fn near(found: &[Option<f64>], expected: &[f64]) -> bool {
        found.len() == expected.len()
            && found.iter().zip(expected).all(|(a, b)| a.is_some_and(|a| (a - b).abs() < 1e-6))
    }

    #[test]
    fn the_ground_of_an_object_is_that_below_its_centre() {
        let terrain = terrain_at(&[([1, 3], 250), ([0, 0], 900)]);
        let site = site(&terrain, METRES);
        let part = box_part();
        let object = Object::new(7, &part, &site);
        assert_eq!(object.centre, [1_524, 3_048, 2_524]);
        assert_eq!((object.ground_m, object.above_ground_m(1_000)), (Some(0.25), Some(0.75)));
        let nothing = ObjectPart::empty();
        assert_eq!(Object::new(1, &nothing, &site).centre, [0; 3], "no points, and no division by zero");
    }
}
