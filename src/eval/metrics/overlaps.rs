//! The objects and segments of a contingency table and their overlaps. Every metric starts from them.
//!
//! The specification of the metrics leaves three points open. They are settled here:
//! * The class of an object is the class of most of its points (ties: the smaller code). If this class is
//!   ground or noise, it is not an object.
//! * An object with fewer points than `min_points` (30) is not evaluated. Its points are *unlabelled*, like
//!   points without an object.
//! * The class of a segment is the class of the evaluated object that has most points in it (ties: the
//!   smaller id).

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::eval::classes::ClassTable;
use crate::eval::table::{Cell, Place, Predicted, Table};
use crate::model::Lattice;

/// Points that an object and a segment have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Overlap {
    /// The other side: for an object an index into [`Scene::segments`], for a segment an index into
    /// [`Scene::objects`].
    pub index: usize,
    /// Points in common, at least 1.
    pub points: u64,
}

/// A reference object that is evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Id in the reference.
    pub id: i64,
    /// Class of most of its points.
    pub class: u16,
    /// Points.
    pub points: u64,
    /// Points without a segment.
    pub unassigned: u64,
    /// Points that the prediction calls ground.
    pub predicted_ground: u64,
    /// Points that the prediction calls noise.
    pub predicted_noise: u64,
    /// Mean position in metres.
    pub centroid_m: [f64; 3],
    /// Segments that contain points of it: most points first, ties by the smaller id.
    pub overlaps: Box<[Overlap]>,
}

impl Object {
    /// S(o): the segment that contains most points of the object. Ties go to the smaller id; `None` if no
    /// segment contains any.
    #[must_use]
    pub fn main(&self) -> Option<Overlap> {
        self.overlaps.first().copied()
    }
}

/// A predicted segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Id in the prediction.
    pub id: i64,
    /// Points.
    pub points: u64,
    /// Points that belong to evaluated objects.
    pub labelled: u64,
    /// Class that the prediction gives most of its points (ties: the smaller code); 0 is none.
    pub named: u16,
    /// Mean position in metres.
    pub centroid_m: [f64; 3],
    /// Evaluated objects that have points in it: most points first, ties by the smaller id.
    pub overlaps: Box<[Overlap]>,
}

impl Segment {
    /// The object that has most points in it.
    #[must_use]
    pub fn main(&self) -> Option<Overlap> {
        self.overlaps.first().copied()
    }

    /// Whether more than half of its points belong to no evaluated object.
    #[must_use]
    pub fn mostly_unlabelled(&self) -> bool {
        2 * self.labelled < self.points
    }
}

/// Objects, segments and their overlaps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// Evaluated objects by id.
    pub objects: Vec<Object>,
    /// All segments by id.
    pub segments: Vec<Segment>,
    /// Reference objects that are too small to be evaluated, by id.
    pub small_objects: Vec<SmallObject>,
}

/// A reference object that is too small to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct SmallObject {
    /// Id in the reference.
    pub id: i64,
    /// Class code of most of its points.
    pub class: u16,
    /// Its points.
    pub points: u64,
    /// Mean position in metres.
    pub centroid_m: [f64; 3],
}

impl Scene {
    /// The scene of a table, with objects of at least `min_points` points. `lattice` converts positions to
    /// metres.
    #[must_use]
    pub fn build(table: &Table, classes: &ClassTable, lattice: Lattice, min_points: u64) -> Self {
        let mut scene =
            Self { objects: Vec::new(), segments: segments(table, lattice), small_objects: Vec::new() };
        for cells in table.cells.chunk_by(|a, b| a.0.object == b.0.object) {
            let id = cells[0].0.object;
            let class = majority(cells);
            if id <= 0 || classes.is_ground(class) || classes.is_noise(class) {
                continue;
            }
            let points = total(cells);
            let centroid_m = metres(&table.objects, id, lattice);
            if points < min_points {
                scene.small_objects.push(SmallObject { id, class, points, centroid_m });
            } else {
                scene.add_object(cells, class, centroid_m);
            }
        }
        scene.add_overlaps_to_segments();
        scene
    }

    fn add_object(&mut self, cells: &[(Cell, u64)], class: u16, centroid_m: [f64; 3]) {
        let called = |what: Predicted| cells.iter().filter(|c| c.0.predicted == what).map(|c| c.1).sum();
        let mut object = Object {
            id: cells[0].0.object,
            class,
            points: total(cells),
            unassigned: 0,
            predicted_ground: called(Predicted::Ground),
            predicted_noise: called(Predicted::Noise),
            centroid_m,
            overlaps: Box::default(),
        };
        let mut overlaps = Vec::new();
        for part in cells.chunk_by(|a, b| a.0.segment == b.0.segment) {
            let points = total(part);
            match self.segments.binary_search_by_key(&part[0].0.segment, |segment| segment.id) {
                Ok(index) => overlaps.push(Overlap { index, points }),
                Err(_) => object.unassigned += points,
            }
        }
        overlaps.sort_by_key(|overlap| Reverse(overlap.points));
        object.overlaps = overlaps.into_boxed_slice();
        self.objects.push(object);
    }

    /// Copies the overlaps of the objects to their segments.
    fn add_overlaps_to_segments(&mut self) {
        let of_object = |(index, object): (usize, &Object)| {
            object
                .overlaps
                .iter()
                .map(move |part| (part.index, Overlap { index, points: part.points }))
                .collect::<Vec<_>>()
        };
        let mut overlaps: Vec<(usize, Overlap)> =
            self.objects.iter().enumerate().flat_map(of_object).collect();
        overlaps
            .sort_unstable_by_key(|(segment, overlap)| (*segment, Reverse(overlap.points), overlap.index));
        for of_segment in overlaps.chunk_by(|a, b| a.0 == b.0) {
            let segment = &mut self.segments[of_segment[0].0];
            segment.overlaps = of_segment.iter().map(|entry| entry.1).collect();
            segment.labelled = segment.overlaps.iter().map(|overlap| overlap.points).sum();
        }
    }

    /// Class of a segment; `None` if it contains no point of an evaluated object.
    #[must_use]
    pub fn segment_class(&self, segment: &Segment) -> Option<u16> {
        segment.main().map(|overlap| self.objects[overlap.index].class)
    }
}

fn total(cells: &[(Cell, u64)]) -> u64 {
    cells.iter().map(|cell| cell.1).sum()
}

/// The class of most points; ties go to the smaller code.
fn majority(cells: &[(Cell, u64)]) -> u16 {
    let mut counts = BTreeMap::new();
    for (cell, points) in cells {
        *counts.entry(cell.class).or_insert(0) += points;
    }
    most(counts)
}

/// The code with most points; ties go to the smaller code.
fn most(counts: BTreeMap<u16, u64>) -> u16 {
    let mut best = (0, 0);
    for (class, points) in counts {
        if points > best.1 {
            best = (class, points);
        }
    }
    best.0
}

/// All segments by id, without overlaps yet.
fn segments(table: &Table, lattice: Lattice) -> Vec<Segment> {
    let mut sizes: BTreeMap<i64, BTreeMap<u16, u64>> = BTreeMap::new();
    for (cell, points) in table.cells.iter().filter(|entry| entry.0.segment > 0) {
        *sizes.entry(cell.segment).or_default().entry(cell.named).or_default() += points;
    }
    let segment = |(id, named): (i64, BTreeMap<u16, u64>)| {
        let centroid_m = metres(&table.segments, id, lattice);
        let points = named.values().sum();
        Segment { id, points, labelled: 0, named: most(named), centroid_m, overlaps: Box::default() }
    };
    sizes.into_iter().map(segment).collect()
}

fn metres(places: &[(i64, Place)], id: i64, lattice: Lattice) -> [f64; 3] {
    let place = places.binary_search_by_key(&id, |entry| entry.0).map(|found| places[found].1);
    place.unwrap_or_default().centroid().map(|units| units * lattice.step_m())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::eval::table::Counter;

    /// The scene of `(object, segment, points)` triples, all objects of class 2 unless `class` says
    /// otherwise.
    pub(crate) fn scene_of(parts: &[(i64, i64, u64)], class: fn(i64) -> u16) -> Scene {
        Scene::build(&table_of(parts, class), &ClassTable::default(), Lattice::MILLIMETRE, 30)
    }

    /// The table of `(object, segment, points)` triples; points of object 0 are ground.
    pub(crate) fn table_of(parts: &[(i64, i64, u64)], class: fn(i64) -> u16) -> Table {
        let mut counter = Counter::default();
        for &(object, segment, points) in parts {
            let class = if object == 0 { 1 } else { class(object) };
            for _ in 0..points {
                counter.add(Cell { object, segment, class, ..Cell::default() }, [object * 1000, 0, 0]);
            }
        }
        counter.finish()
    }

    #[test]
    fn overlaps_are_sorted_by_points_and_ties_go_to_the_smaller_id() {
        let scene = scene_of(&[(1, 9, 20), (1, 4, 20), (1, 2, 10), (1, 0, 5), (2, 9, 40), (0, 9, 1)], |_| 2);
        let object = &scene.objects[0];
        let ids: Vec<i64> = object.overlaps.iter().map(|o| scene.segments[o.index].id).collect();
        assert_eq!(ids, [4, 9, 2]);
        assert_eq!((object.points, object.unassigned), (55, 5));
        let nine = &scene.segments[2];
        assert_eq!((nine.id, nine.points, nine.labelled), (9, 61, 60));
        assert_eq!(nine.main(), Some(Overlap { index: 1, points: 40 }));
        assert_eq!(scene.objects[1].centroid_m.map(f64::to_bits), [2.0, 0.0, 0.0].map(f64::to_bits));
    }

    #[test]
    fn small_objects_and_objects_of_ground_are_unlabelled() {
        let scene = scene_of(&[(1, 5, 29), (2, 5, 30), (3, 5, 90)], |object| if object == 3 { 1 } else { 2 });
        assert_eq!(scene.objects.iter().map(|object| object.id).collect::<Vec<_>>(), [2]);
        assert_eq!(
            scene.small_objects.iter().map(|small| (small.id, small.points)).collect::<Vec<_>>(),
            [(1, 29)]
        );
        assert!(scene.segments[0].mostly_unlabelled());
    }

    #[test]
    fn a_tie_of_classes_goes_to_the_smaller_code() {
        let cell = |class| Cell { object: 1, class, ..Cell::default() };
        assert_eq!(majority(&[(cell(5), 10), (cell(4), 10), (cell(7), 9)]), 4);
    }
}
