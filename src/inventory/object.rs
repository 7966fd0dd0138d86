//! What attributes see: one whole object.

use std::collections::BTreeSet;

use crate::inventory::measures::{
    BUILDING, Ends, Foot, Frames, Measures, Polygon, lowest_before_front, lowest_of, outline,
};
use crate::inventory::site::{Site, centre};
use crate::model::{Kind, ObjectPart};

/// A whole object: its number, the summaries of its points, and values that several attributes derive from
/// them.
#[derive(Debug)]
pub struct Object<'a> {
    /// Object id, from 1.
    pub id: u32,
    /// Summary of its points, on the lattice.
    pub part: &'a ObjectPart,
    /// Its class and confidence. Class 0 from methods that do not classify.
    pub kind: Kind,
    /// The values that all objects share.
    pub site: &'a Site<'a>,
    /// Mean of its points, rounded to the lattice, which is finer than the written decimals.
    pub centre: [i64; 3],
    /// Height of the ground in metres in the cell nearest to its centre, if one is known nearby.
    pub ground_m: Option<f64>,
    /// Sketches of its points.
    pub(super) measures: &'a Measures,
    /// The frames of the sketches.
    pub(super) frames: Frames,
    /// The heights between which it extends.
    pub(super) ends: Ends,
    /// Where it stands.
    pub(super) foot: Foot,
    /// Its outline; `None` without points.
    pub(super) outline: Option<Polygon>,
}

impl<'a> Object<'a> {
    /// The object `id` of a class, with the summaries of all its points.
    #[must_use]
    pub fn new(
        id: u32,
        part: &'a ObjectPart,
        measures: &'a Measures,
        kind: Kind,
        site: &'a Site<'a>,
    ) -> Self {
        let centre = centre(part);
        let ground_m = site.terrain.height_m([centre[0], centre[1]]);
        let frames = Frames::new(part, kind, site.ground_below(part), site.lattice);
        let ends = ends(part, measures, kind, &frames, site);
        let foot = Foot::new(part, ends, kind, measures, &frames, site);
        let outline = outline(&measures.plan, &frames.plan, site.lattice, |_| true);
        Self { id, part, kind, site, centre, ground_m, measures, frames, ends, foot, outline }
    }

    /// The corners of its box on the lattice, without detached points below it.
    #[must_use]
    pub fn corners(&self) -> [[i64; 3]; 2] {
        let [x, y, _] = self.part.lo;
        [[x, y, self.ends.bottom.max(self.part.lo[2])], self.part.hi]
    }

    /// Height of a lattice z above the ground below its centre, in metres.
    #[must_use]
    pub fn above_ground_m(&self, z: i64) -> Option<f64> {
        self.ground_m.map(|ground_m| self.site.lattice.metres(z) - ground_m)
    }

    /// Where it stands in the plane, in lattice units.
    pub(super) fn place_units(&self) -> [f64; 2] {
        self.foot.place.map(|metres| metres * f64::from(self.site.lattice.units_per_m()))
    }

    /// Where it stands, in the units of the input. Its z is the height of the ground. Where no ground is
    /// known within 10 m, it is that of the lowest point that is not detached.
    #[must_use]
    pub fn base(&self) -> [f64; 3] {
        let [x, y] = self.foot.place;
        let z = self.foot.ground_m.unwrap_or_else(|| self.site.lattice.metres(self.ends.bottom));
        let metres = [x, y, z];
        [0, 1, 2].map(|axis| metres[axis] / self.site.units_m[axis])
    }

    /// The vertices of its outline in the units of the input, counter-clockwise and not closed.
    #[must_use]
    pub fn ring(&self) -> Vec<[f64; 2]> {
        let vertices = self.outline.iter().flat_map(|outline| &outline.vertices);
        vertices.map(|place| [0, 1].map(|axis| self.site.input_units(axis, place[axis]))).collect()
    }
}

/// The heights between which an object extends; 0 and 0 without points.
fn ends(part: &ObjectPart, measures: &Measures, kind: Kind, frames: &Frames, site: &Site<'_>) -> Ends {
    let ground = site.ground_below(part);
    let found = Ends::new(&measures.profile, kind.class, ground, site.lattice);
    let found = found.unwrap_or(Ends { bottom: 0, top: 0 });
    // Most objects do not reach below the ground.
    let reaches_below = ground.is_some_and(|ground| found.is_far_below(ground, site.lattice));
    // Ground below a building can be reflections behind panes, as large as rooms.
    let before_front =
        if kind.class == BUILDING { lowest_before_front(measures, frames, site) } else { None };
    let below = || if reaches_below { lowest_ground(measures, frames, site) } else { None };
    let lowest = before_front.or_else(below);
    match lowest {
        Some(lowest) => found.above_ground(&measures.profile, lowest, site.lattice),
        None => found,
    }
}

/// Lattice z of the lowest ground below an object, without the lowest 1 in 20 of the terrain cells:
/// reflections may have been classified as ground there. `None` if no cell has ground within 10 m.
fn lowest_ground(measures: &Measures, frames: &Frames, site: &Site<'_>) -> Option<i64> {
    let level = measures.plan.level;
    let middle = |axis, index| frames.plan.doubled_middle(level, axis, index).div_euclid(2);
    let cells =
        measures.plan.voxels.iter().map(|([i, j, _], _)| site.terrain.cell([middle(0, *i), middle(1, *j)]));
    let cells: BTreeSet<[i64; 2]> = cells.collect();
    let heights = cells.into_iter().filter_map(|cell| site.terrain.height_m(site.terrain.middle_of(cell)));
    lowest_of(heights.map(|height_m| site.lattice.units(height_m)).collect())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::inventory::attributes::attribute::Attribute;
    use crate::inventory::site::Station;
    use crate::inventory::terrain::{Terrain, TerrainSums};
    use crate::model::{FileId, Lattice, TileCloud, Value};
    use crate::spatial::{Cell, CellGrid};

    pub(crate) const METRES: [f64; 3] = [1.0; 3];
    /// International feet.
    pub(crate) const FEET: [f64; 3] = [0.304_8; 3];
    /// A class that has attributes of its own.
    pub(crate) const NO_KIND: Kind = Kind::new(0, 0);

    /// Four corners of a box of 3.048 m by 6.096 m from (0, 0), 1 m to 4.048 m high.
    pub(crate) const BOX: [[i64; 3]; 4] =
        [[0, 0, 1_000], [3_048, 0, 4_048], [3_048, 6_096, 1_000], [0, 6_096, 4_048]];

    /// The summaries of points of an object.
    pub(crate) fn summaries(points: &[[i64; 3]], kind: Kind) -> (ObjectPart, Measures) {
        summaries_on(points, kind, |_| None)
    }

    /// The same, with the lattice z of the ground below the centre of the object.
    fn summaries_on(
        points: &[[i64; 3]],
        kind: Kind,
        ground: impl Fn(&ObjectPart) -> Option<i64>,
    ) -> (ObjectPart, Measures) {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let labels = vec![1; points.len()];
        let file = |id: crate::model::PointId| FileId::new(if id.number() < 2 { 0 } else { 2 });
        let part = ObjectPart::collect(&cloud, &labels, 1, |_| true, file).remove(0);
        let measures =
            Measures::collect(&cloud, &labels, |_| true, |_| Some((&part, kind, ground(&part)))).remove(0).1;
        (part, measures)
    }

    /// Ground at the given heights, in lattice units, in cells of 1 m.
    pub(crate) fn terrain_at(heights: &[(Cell, i64)]) -> Terrain {
        let mut sums = TerrainSums::new(CellGrid::new(1_000), Lattice::MILLIMETRE, -10_000);
        for &(cell, height) in heights {
            sums.add(cell, 1, height);
        }
        sums.into_terrain()
    }

    /// Three files, an axis to the east along y = 5 m, and data that ends at x = 0.
    pub(crate) fn site(terrain: &Terrain, units_m: [f64; 3]) -> Site<'_> {
        Site {
            lattice: Lattice::MILLIMETRE,
            units_m,
            terrain,
            locate: &|place| Station { chainage_m: place[0], offset_m: place[1] - 5.0 },
            is_driven: true,
            at_end: &|place| place[0] == 0,
            is_cut: &|id, hull| id == 8 && !hull.is_empty(),
            file_names: &["a.las", "b.las", "c.las"],
        }
    }

    /// The values of an attribute for these points.
    pub(crate) fn values_of(
        attribute: &dyn Attribute,
        points: &[[i64; 3]],
        kind: Kind,
        ground: &[(Cell, i64)],
        units_m: [f64; 3],
    ) -> Vec<Value<'static>> {
        let terrain = terrain_at(ground);
        let site = site(&terrain, units_m);
        let (part, measures) = summaries_on(points, kind, |part| site.ground_below(part));
        let mut values = Vec::new();
        attribute.finish(&Object::new(7, &part, &measures, kind, &site), &mut values);
        crate::codec::decode(&crate::codec::encode(&values).unwrap()).unwrap()
    }

    /// The decimals among values; `None` for a missing value.
    pub(crate) fn as_decimals(values: &[Value<'_>]) -> Vec<Option<f64>> {
        let decimal = |value: &Value<'_>| match value {
            Value::Decimal(value) => Some(*value),
            Value::Missing => None,
            other => panic!("{other:?} is not a decimal"),
        };
        values.iter().map(decimal).collect()
    }

    /// The decimals that an attribute gives for [`BOX`] without a class; `None` for a missing value.
    pub(crate) fn decimals(
        attribute: &dyn Attribute,
        ground: &[(Cell, i64)],
        units_m: [f64; 3],
    ) -> Vec<Option<f64>> {
        as_decimals(&values_of(attribute, &BOX, NO_KIND, ground, units_m))
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
        let (part, measures) = summaries(&BOX, NO_KIND);
        let object = Object::new(7, &part, &measures, NO_KIND, &site);
        assert_eq!(object.centre, [1_524, 3_048, 2_524]);
        assert_eq!((object.ground_m, object.above_ground_m(1_000)), (Some(0.25), Some(0.75)));
        let nothing = ObjectPart::empty();
        let none = Measures::empty(&Frames::new(&nothing, NO_KIND, None, Lattice::MILLIMETRE));
        let object = Object::new(1, &nothing, &none, NO_KIND, &site);
        assert_eq!(object.centre, [0; 3], "no points, and no division by zero");
        assert!(object.ring().is_empty());
    }

    #[test]
    fn outlines_are_in_the_units_of_the_input() {
        let terrain = terrain_at(&[]);
        let (part, measures) = summaries(&BOX, NO_KIND);
        let rings = [METRES, FEET].map(|units_m| {
            let site = site(&terrain, units_m);
            Object::new(1, &part, &measures, NO_KIND, &site).ring()
        });
        assert!(rings[0].len() > 3 && rings[0].len() == rings[1].len());
        for (metres, feet) in rings[0].concat().iter().zip(rings[1].concat()) {
            assert!((metres - feet * 0.304_8).abs() < 1e-9);
        }
    }
}
