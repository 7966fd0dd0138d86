//! Scores of classes: whether points and matched objects get their true class.
//!
//! A point is called ground or noise if the prediction says so, otherwise by the class of its object, and
//! otherwise nothing. Points that are noise in the reference are left out, because their true class is
//! unknown. The class of a segment is the class of most of its points. An object is *right* if it is matched
//! (IoU > 0.5) with a segment of its class. F1 with the right class counts every other segment that counts as
//! false, in the class that it claims. So a tree that is called a pole lowers the F1 of both.

use std::collections::BTreeMap;

use crate::eval::classes::ClassTable;
use crate::eval::metrics::overlaps::Scene;
use crate::eval::metrics::panoptic::{Panoptic, SegmentRole};
use crate::eval::table::{Predicted, Table};

/// What the prediction calls a point or an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Called {
    /// Nothing.
    Nothing,
    /// Stray return.
    Noise,
    /// Ground.
    Ground,
    /// A class of objects.
    Class(u16),
}

impl Called {
    fn of_code(code: u16) -> Self {
        if code == 0 { Self::Nothing } else { Self::Class(code) }
    }

    /// The name, by the table of classes.
    #[must_use]
    pub fn name(self, classes: &ClassTable) -> String {
        match self {
            Self::Nothing => "nothing".to_owned(),
            Self::Noise => "noise".to_owned(),
            Self::Ground => "ground".to_owned(),
            Self::Class(code) => classes.name(code),
        }
    }
}

/// Counts per class of the reference and per name that the prediction gives.
pub type Counts = BTreeMap<(u16, Called), u64>;

/// How often a class was claimed and was right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hits {
    /// Points or objects of the class.
    pub of_class: u64,
    /// Points or objects of the class that are called so.
    pub right: u64,
    /// Other points or objects that are called so.
    pub wrong: u64,
    /// For objects: the matched objects of the class, whatever they are called.
    pub matched: u64,
}

impl Hits {
    fn add(&mut self, other: Self) {
        self.of_class += other.of_class;
        self.right += other.right;
        self.wrong += other.wrong;
        self.matched += other.matched;
    }

    /// Share of the points or objects called so that are of the class.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.right, self.right + self.wrong)
    }

    /// Share of the points or objects of the class that are called so.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.right, self.of_class)
    }

    /// 2 P R / (P + R).
    #[must_use]
    pub fn f1(&self) -> Option<f64> {
        share(2 * self.right, self.of_class + self.right + self.wrong)
    }

    /// Share of the matched objects that have the right class.
    #[must_use]
    pub fn right_of_matched(&self) -> Option<f64> {
        share(self.right, self.matched)
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// How well classes are distinguished.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// Points.
    pub points: Counts,
    /// Points of each class.
    pub of_points: Vec<(u16, Hits)>,
    /// Matched objects.
    pub objects: Counts,
    /// Objects of each class.
    pub of_objects: Vec<(u16, Hits)>,
    /// All objects.
    pub all_objects: Hits,
}

impl Named {
    /// The counts of points; `None` if the prediction gives no object a class.
    pub(super) fn of_points(table: &Table, classes: &ClassTable) -> Option<Counts> {
        let mut counts = Counts::new();
        let mut any = false;
        for (cell, points) in &table.cells {
            any |= cell.named > 0;
            if classes.is_noise(cell.class) {
                continue;
            }
            let called = match cell.predicted {
                Predicted::Ground => Called::Ground,
                Predicted::Noise => Called::Noise,
                Predicted::Other => Called::of_code(cell.named),
            };
            *counts.entry((cell.class, called)).or_default() += points;
        }
        any.then_some(counts)
    }

    pub(super) fn new(points: Counts, scene: &Scene, panoptic: &Panoptic, classes: &ClassTable) -> Self {
        let mut objects = Counts::new();
        let mut hits: BTreeMap<u16, Hits> = BTreeMap::new();
        let mut right = vec![false; scene.segments.len()];
        for (index, object) in scene.objects.iter().enumerate() {
            let of_class = hits.entry(object.class).or_default();
            of_class.of_class += 1;
            let Some(best) = panoptic.best[index].filter(|_| panoptic.matched[index]) else { continue };
            let called = Called::of_code(scene.segments[best.segment].named);
            of_class.matched += 1;
            *objects.entry((object.class, called)).or_default() += 1;
            if called == Called::Class(object.class) {
                of_class.right += 1;
                right[best.segment] = true;
            }
        }
        let mut all_objects = Hits::default();
        for ((segment, role), right) in scene.segments.iter().zip(&panoptic.segments).zip(right) {
            let counts = matches!(role, SegmentRole::Matched | SegmentRole::FalsePositive);
            if counts && !right {
                match Called::of_code(segment.named) {
                    Called::Class(code) => hits.entry(code).or_default().wrong += 1,
                    // The segment claims no class, but is still false.
                    _ => all_objects.wrong += 1,
                }
            }
        }
        hits.values().for_each(|hits| all_objects.add(*hits));
        let of_objects = hits.into_iter().collect();
        Self { of_points: point_hits(&points, classes), points, objects, of_objects, all_objects }
    }

    /// Points of the reference, and the points among them that get their true class.
    #[must_use]
    pub fn right_points(&self) -> Hits {
        let mut all = Hits::default();
        self.of_points.iter().for_each(|(_, hits)| all.add(*hits));
        all
    }

    /// Share of the points that get their true class.
    #[must_use]
    pub fn accuracy(&self) -> Option<f64> {
        self.right_points().recall()
    }
}

fn point_hits(points: &Counts, classes: &ClassTable) -> Vec<(u16, Hits)> {
    let mut hits: BTreeMap<u16, Hits> = BTreeMap::new();
    for (&(class, called), &count) in points {
        let right = match called {
            Called::Ground => classes.is_ground(class),
            Called::Class(code) => code == class,
            Called::Nothing | Called::Noise => false,
        };
        let of_class = hits.entry(class).or_default();
        of_class.of_class += count;
        if right {
            of_class.right += count;
        } else if let Called::Class(code) = called {
            hits.entry(code).or_default().wrong += count;
        } else if called == Called::Ground
            && let Some(ground) = classes.first_ground()
        {
            hits.entry(ground).or_default().wrong += count;
        }
    }
    hits.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::metrics::panoptic;
    use crate::eval::table::{Cell, Counter};
    use crate::model::Lattice;

    /// Points by object, class, segment, class of the segment, and what is predicted besides.
    fn named(parts: &[(i64, u16, i64, u16, Predicted, u64)]) -> Option<Named> {
        let mut counter = Counter::default();
        for &(object, class, segment, named, predicted, points) in parts {
            (0..points).for_each(|_| counter.add(Cell { object, segment, class, predicted, named }, [0; 3]));
        }
        let table = counter.finish();
        let classes = ClassTable::default();
        let scene = Scene::build(&table, &classes, Lattice::MILLIMETRE, 30);
        let judged = panoptic::judge(&scene, 30);
        Named::of_points(&table, &classes).map(|points| Named::new(points, &scene, &judged, &classes))
    }

    #[test]
    fn points_and_objects_count_in_the_class_that_they_claim() {
        use Predicted::{Ground, Noise, Other};
        let found = named(&[
            (1, 2, 1, 2, Other, 50),  // a tree called a tree
            (2, 2, 2, 3, Other, 40),  // a tree called a pole
            (3, 3, 3, 3, Other, 30),  // a pole called a pole
            (4, 4, 4, 0, Other, 30),  // a car called nothing
            (5, 5, 0, 0, Ground, 30), // a building called ground
            (0, 1, 0, 0, Ground, 100),
            (0, 1, 5, 2, Other, 35), // ground in a segment of its own called a tree: mostly unlabelled
            (0, 1, 0, 0, Noise, 5),
            (0, 0, 6, 2, Other, 70), // noise of the reference
        ])
        .unwrap();
        let hits = |list: &[(u16, Hits)], code| list.iter().find(|entry| entry.0 == code).unwrap().1;
        let trees = hits(&found.of_objects, 2);
        assert_eq!((trees.of_class, trees.matched, trees.right, trees.wrong), (2, 2, 1, 0));
        let poles = hits(&found.of_objects, 3);
        assert_eq!((poles.of_class, poles.right, poles.wrong), (1, 1, 1));
        assert_eq!(poles.f1(), Some(2.0 / 3.0));
        // The segment of the car claims no class, so it counts as false only overall.
        let all = found.all_objects;
        assert_eq!((all.of_class, all.matched, all.right, all.wrong), (5, 4, 2, 2));
        assert_eq!(all.right_of_matched(), Some(0.5));
        assert_eq!(found.objects[&(2, Called::Class(3))], 1);
        assert_eq!(found.points[&(5, Called::Ground)], 30);
        // 50 + 30 + 100 of 50 + 40 + 30 + 30 + 30 + 140 points.
        assert_eq!((found.right_points().right, found.right_points().of_class), (180, 320));
        let ground = hits(&found.of_points, 1);
        assert_eq!((ground.of_class, ground.right, ground.wrong), (140, 100, 30));
        assert_eq!(hits(&found.of_points, 2).wrong, 35);
    }

    #[test]
    fn without_classes_there_is_nothing_to_say() {
        assert_eq!(named(&[(1, 2, 1, 0, Predicted::Other, 50)]), None);
    }
}
