//! The measures of the points of an object, collected tile by tile: sketches of bounded size that merge
//! exactly.

use serde::{Deserialize, Serialize};

use super::classes::{POLE, TREE, VEHICLE};
use super::profile::Slice;
use super::sketch::{Extremes, Frame, Heights, Sketch, Sums, by_object};
use crate::model::{Kind, Lattice, ObjectPart, TileCloud};

/// Edge of a cell of the plan in metres (chosen: the outline lies within 0.1 m of every point).
const PLAN_EDGE_M: f64 = 0.1;
/// Largest number of cells of a plan. A crown of 14 m in diameter has this many.
const PLAN_CELLS: usize = 1 << 14;
/// Edge of a voxel of a stem in metres. On a stem of 0.3 m, the mean of the points of a voxel lies 0.3 mm
/// inside the surface.
const STEM_EDGE_M: f64 = 0.02;
/// Largest number of voxels of a stem.
const STEM_VOXELS: usize = 1 << 13;
/// Height over the lowest point of a tree up to which its stem is searched, in metres.
const STEM_HEIGHT_M: f64 = 4.0;
/// Largest depth of the lowest point of a stem below the ground model, in metres (chosen: the model may be
/// wrong by this much behind a hedge; reflections were seen 5 m below).
const DEEPEST_FOOT_M: f64 = 1.0;
/// Edge of a slice of the profile in metres (chosen: a third of the shortest gap that counts).
const SLICE_EDGE_M: f64 = 0.1;
/// Largest number of slices. An object of 100 m has this many.
const SLICES: usize = 1 << 10;
/// Edge of a voxel of a crown in metres (chosen: above the distance between profiles of a vehicle scanner).
const CROWN_EDGE_M: f64 = 0.2;
/// Largest number of voxels of a crown.
const CROWN_VOXELS: usize = 1 << 14;
/// Number of points of an object that are sketched at once. Bounds the memory of large objects.
const POINTS_AT_ONCE: usize = 1 << 16;

/// The frames of the sketches of an object. They follow from its extent, which is known before its points are
/// read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frames {
    /// Cells of the plan. All have the same z.
    pub(crate) plan: Frame,
    /// Voxels of stem or pole.
    pub(crate) stem: Frame,
    /// Voxels of the crown.
    pub(crate) crown: Frame,
    /// Slices of the profile. All have the same x and y.
    pub(crate) profile: Frame,
    /// Highest lattice z of a stem. `None` if the object has none.
    stem_to: Option<i64>,
    has_crown: bool,
    has_body: bool,
}

impl Frames {
    /// The frames of a whole object. `ground` is the lattice z of the ground below its centre, if it is
    /// known.
    pub(crate) fn new(whole: &ObjectPart, kind: Kind, ground: Option<i64>, lattice: Lattice) -> Self {
        let ObjectPart { lo, hi, .. } = *whole;
        let frame = |edge_m: f64| Frame::new(lattice.units(edge_m).max(1), lo, hi);
        let stem_to = match kind.class {
            TREE => {
                let foot = ground.map_or(lo[2], |z| lo[2].max(z - lattice.units(DEEPEST_FOOT_M)));
                Some(foot.saturating_add(lattice.units(STEM_HEIGHT_M)))
            }
            POLE => Some(i64::MAX),
            _ => None,
        };
        Self {
            plan: frame(PLAN_EDGE_M),
            stem: frame(STEM_EDGE_M),
            crown: frame(CROWN_EDGE_M),
            profile: frame(SLICE_EDGE_M),
            stem_to,
            has_crown: kind.class == TREE,
            has_body: kind.class == VEHICLE,
        }
    }
}

/// The sketches of the points of an object, or of a part of it, in addition to its [`ObjectPart`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Measures {
    /// Occupied cells of the plane, with the lowest and highest point of each.
    pub(crate) plan: Sketch<Heights>,
    /// The points of a pole, or of the lower part of a tree. Empty for other classes.
    pub(crate) stem: Sketch<Sums>,
    /// Occupied voxels of a tree. Empty for other classes.
    pub(crate) crown: Sketch<()>,
    /// Points by height.
    pub(crate) profile: Sketch<Slice>,
    /// The points of a vehicle in the cells of the plan. Empty for other classes.
    pub(crate) body: Sketch<Extremes>,
}

impl Measures {
    /// The measures of no points of an object with these frames.
    pub(crate) fn empty(frames: &Frames) -> Self {
        Self {
            plan: Sketch::empty(&frames.plan),
            stem: Sketch::empty(&frames.stem),
            crown: Sketch::empty(&frames.crown),
            profile: Sketch::empty(&frames.profile),
            body: Sketch::empty(&frames.plan),
        }
    }

    /// The measures of points, which belong to an object with these frames.
    fn of_points(frames: &Frames, points: &[[i64; 3]]) -> Self {
        let corner = frames.stem.corner;
        let cell = |point: &[i64; 3]| {
            let [i, j, _] = frames.plan.key(*point);
            ([i, j, 0], Heights { lowest: point[2], highest: point[2] })
        };
        let extremes = |point: &[i64; 3]| {
            let [i, j, _] = frames.plan.key(*point);
            ([i, j, 0], Extremes::of(*point))
        };
        let slice = |point: &[i64; 3]| {
            let [_, _, k] = frames.profile.key(*point);
            ([0, 0, k], Slice { points: 1, lowest: point[2], highest: point[2] })
        };
        let sums = |point: &[i64; 3]| {
            let sum = [0, 1, 2].map(|axis| point[axis] - corner[axis]);
            (frames.stem.key(*point), Sums { points: 1, sum })
        };
        let of_stem = |point: &&[i64; 3]| frames.stem_to.is_some_and(|top| point[2] <= top);
        let of_body: &[[i64; 3]] = if frames.has_body { points } else { &[] };
        let of_crown: &[[i64; 3]] = if frames.has_crown { points } else { &[] };
        Self {
            plan: Sketch::of(&frames.plan, points.iter().map(cell).collect(), PLAN_CELLS),
            stem: Sketch::of(&frames.stem, points.iter().filter(of_stem).map(sums).collect(), STEM_VOXELS),
            crown: Sketch::of(
                &frames.crown,
                of_crown.iter().map(|point| (frames.crown.key(*point), ())).collect(),
                CROWN_VOXELS,
            ),
            profile: Sketch::of(&frames.profile, points.iter().map(slice).collect(), SLICES),
            body: Sketch::of(&frames.plan, of_body.iter().map(extremes).collect(), PLAN_CELLS),
        }
    }

    /// The measures of each object with points in `core`. `objects` has the object of each point, 0 for none.
    /// `whole` gives the extent and the kind of an object, and the lattice z of the ground below its centre.
    /// Ascending by object.
    #[must_use]
    pub fn collect<'a>(
        cloud: &TileCloud,
        objects: &[u32],
        core: impl Fn(usize) -> bool,
        whole: impl Fn(u32) -> Option<(&'a ObjectPart, Kind, Option<i64>)>,
    ) -> Vec<(u32, Self)> {
        let members = by_object(objects, core);
        let mut all = Vec::new();
        let mut points = Vec::new();
        for group in members.chunk_by(|a, b| a.0 == b.0) {
            let Some((part, kind, ground)) = whole(group[0].0) else { continue };
            let frames = Frames::new(part, kind, ground, cloud.lattice);
            let mut measures = Self::empty(&frames);
            for some in group.chunks(POINTS_AT_ONCE) {
                points.clear();
                points.extend(some.iter().map(|&(_, point)| cloud.lattice_point(point as usize)));
                measures.merge(Self::of_points(&frames, &points));
            }
            all.push((group[0].0, measures));
        }
        all
    }

    /// Adds another part of the same object. The two parts have no point in common.
    pub fn merge(&mut self, other: Self) {
        self.plan.merge(other.plan, PLAN_CELLS);
        self.stem.merge(other.stem, STEM_VOXELS);
        self.crown.merge(other.crown, CROWN_VOXELS);
        self.profile.merge(other.profile, SLICES);
        self.body.merge(other.body, PLAN_CELLS);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use crate::model::FileId;

    proptest! {
        /// Measures of merged parts equal the measures of all points at once, however the points are divided
        /// and in whatever order the parts are merged. There are few points, so that sketches stay at level
        /// 0.
        #[test]
        fn parts_in_any_order_are_the_whole(
            points in prop::collection::vec(
                ([-900..900_i64, -900..900_i64, -5_000..5_000_i64], 0..4_usize, 0..3_u32), 1..150,
            ),
            class in 0..5_u8,
            order in Just([0_usize, 1, 2, 3]).prop_shuffle(),
            shift in prop::array::uniform3(-(1_i64 << 40)..1 << 40),
        ) {
            let places: Vec<[i64; 3]> =
                points.iter().map(|(p, ..)| [p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]]).collect();
            let objects: Vec<u32> = points.iter().map(|(_, _, object)| *object).collect();
            let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &places);
            let kind = Kind::new(class, 1);
            let wholes = ObjectPart::collect(&cloud, &objects, 2, |_| true, |_| FileId::new(0));
            let whole = |id: u32| Some((&wholes[id as usize - 1], kind, None));
            let mut merged: BTreeMap<u32, Measures> = BTreeMap::new();
            for tile in order {
                for (id, part) in Measures::collect(&cloud, &objects, |point| points[point].1 == tile, whole) {
                    let frames = Frames::new(&wholes[id as usize - 1], kind, None, Lattice::MILLIMETRE);
                    merged.entry(id).or_insert_with(|| Measures::empty(&frames)).merge(part);
                }
            }
            let direct: BTreeMap<u32, Measures> = Measures::collect(&cloud, &objects, |_| true, whole).into_iter().collect();
            prop_assert_eq!(&merged, &direct);
            for (id, measures) in direct {
                let mine: Vec<[i64; 3]> =
                    places.iter().zip(&objects).filter(|(_, of)| **of == id).map(|(place, _)| *place).collect();
                let mut cells: BTreeMap<[i64; 2], (i64, i64)> = BTreeMap::new();
                for [x, y, z] in &mine {
                    let ends = cells.entry([x.div_euclid(100), y.div_euclid(100)]).or_insert((*z, *z));
                    *ends = (ends.0.min(*z), ends.1.max(*z));
                }
                let frame = Frames::new(&wholes[id as usize - 1], kind, None, Lattice::MILLIMETRE).plan;
                let found: BTreeMap<[i64; 2], (i64, i64)> = measures.plan.voxels.iter().map(|([i, j, _], heights)| {
                    let cell = [(0, *i), (1, *j)].map(|(k, index)| frame.corner[k] / 100 + i64::from(index));
                    (cell, (heights.lowest, heights.highest))
                }).collect();
                prop_assert_eq!(found, cells);
                let lowest = mine.iter().map(|place| place[2]).min().unwrap();
                let expected = match class {
                    TREE => mine.iter().filter(|place| place[2] <= lowest + 4_000).count(),
                    POLE => mine.len(),
                    _ => 0,
                };
                let sums = measures.stem.voxels.iter().map(|(_, sums)| sums.points).sum::<u64>();
                prop_assert_eq!(sums, expected as u64);
                prop_assert_eq!(measures.crown.voxels.is_empty(), class != TREE);
                let mut slices: BTreeMap<i64, (u64, i64, i64)> = BTreeMap::new();
                for [_, _, z] in &mine {
                    let slice = slices.entry(z.div_euclid(100)).or_insert((0, *z, *z));
                    *slice = (slice.0 + 1, slice.1.min(*z), slice.2.max(*z));
                }
                let found: Vec<(u64, i64, i64)> =
                    measures.profile.voxels.iter().map(|(_, slice)| (slice.points, slice.lowest, slice.highest)).collect();
                prop_assert_eq!(found, slices.into_values().collect::<Vec<_>>());
            }
        }
    }
}
