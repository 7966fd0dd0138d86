//! Decides whether a found object is whole, a part of a larger object that it touches, or a stray piece. The
//! fourth part of the model decides this by the figures of the object (`figures.rs`) and by the objects that
//! it touches (`contacts.rs`).
//!
//! The earlier steps leave pieces: a branch that no path reached, a balcony, the side of a car seen through a
//! hedge. Each of them would enter the inventory as an object that does not exist. A part goes to the larger
//! object, and the points of a stray piece go to none. The study is in `benches/results/street.md`, section
//! "Pieces of objects".
#![expect(clippy::cast_possible_truncation, reason = "features are single numbers")]

use std::collections::{BTreeMap, BTreeSet};

use super::figures::{self, Figures};
use crate::boosting::Model;
use crate::error::Result;
use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// Names of the classes, in their order.
pub(crate) const CLASS_NAMES: [&str; 3] = ["whole", "part", "stray"];
pub(crate) const WHOLE: u8 = 0;
pub(crate) const PART: u8 = 1;
pub(crate) const STRAY: u8 = 2;

/// Smallest share of "whole" with which an object is kept, in steps of 1/255: 0.25. With 0.2, 51 drives have
/// 29 more right objects and 77 more wrong ones; from 0.25 to 0.37, F1 over all objects is the same within
/// 0.001 (`benches/results/street.md`, "Stray pieces that are an object together").
const LEAST_WHOLE: u8 = 64;
/// Share of "whole" from which a few points are enough for an object: a half. With 0.9, twelve single sweeps
/// have 45 fewer right objects and 11 fewer wrong ones (`benches/results/street.md`, "Few points").
const LIKELY_WHOLE: u8 = 128;
/// Largest number of voxels of a piece.
pub(crate) const MOST_VOXELS: u64 = 2_000;
/// Largest number of voxels of a stray piece. A user would miss an object of some square metres, however
/// unsure it is. When this was chosen, it added 2 right objects and 13 wrong ones on 51 drives
/// (`benches/results/street.md`, "What stands at facades").
const MOST_STRAY: u64 = 600;

const TOUCHING: usize = 8;
const FEATURES: usize = figures::NAMES.len() + TOUCHING;
/// Names of the features of contacts. The larger object is the one that most voxels of the object touch,
/// among those with more voxels than it has.
const TOUCHING_NAMES: [&str; TOUCHING] = [
    "objects that it touches",
    "share that touches others",
    "share that touches the larger object",
    "share that touches a larger object of its class",
    "class of the larger object",
    "voxels of the larger object per voxel",
    "points per voxel of the larger object",
    "highest of the larger object, m",
];

/// Names of the features: first of the figures, then of the contacts.
pub(crate) const NAMES: [&str; FEATURES] = {
    let mut names = [""; FEATURES];
    let mut at = 0;
    while at < FEATURES {
        let of_figures = figures::NAMES.len();
        names[at] = if at < of_figures { figures::NAMES[at] } else { TOUCHING_NAMES[at - of_figures] };
        at += 1;
    }
    names
};

/// An object of the drive: the class that the earlier steps gave it, and its figures.
#[derive(Debug, Clone)]
pub(crate) struct Object {
    pub(crate) class: u8,
    pub(crate) figures: Figures,
}

/// What is known about an object among the others.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seen {
    pub(crate) features: [f32; FEATURES],
    /// The label of the larger object.
    pub(crate) larger: Option<u32>,
}

/// Finds what is known about an object. `touched` has the objects that it touches, each with the number of
/// its voxels that touch it.
pub(crate) fn see(
    object: &Object,
    touched: Option<&BTreeMap<u32, u64>>,
    objects: &BTreeMap<u32, Object>,
    lattice: Lattice,
) -> Seen {
    let voxels = object.figures.voxels();
    let share = |count: u64| count as f64 / voxels as f64;
    let touched = || touched.into_iter().flatten().map(|(label, count)| (*label, *count));
    let larger = || {
        let of = touched().filter_map(|(label, count)| Some((label, count, objects.get(&label)?)));
        of.filter(|(.., other)| other.figures.voxels() > voxels)
    };
    let same = larger().filter(|(.., other)| other.class == object.class).map(|(_, count, _)| count).max();
    // Of two equal counts, the smaller label wins.
    let most = larger().rev().max_by_key(|&(_, count, _)| count);
    let of_most = most.map_or([0.0; 5], |(_, count, Object { class, figures })| {
        [
            share(count),
            f64::from(*class),
            share(figures.voxels()),
            figures.points() as f64 / figures.voxels() as f64,
            figures.highest_m(lattice),
        ]
    });
    let [shared, class, times, density, highest] = of_most;
    let touching = [
        touched().count() as f64,
        share(touched().map(|(_, count)| count).sum()),
        shared,
        same.map_or(0.0, share),
        class,
        times,
        density,
        highest,
    ];
    let mut features = [0.0; FEATURES];
    let (own, others) = features.split_at_mut(figures::NAMES.len());
    own.copy_from_slice(&object.figures.features(object.class, lattice));
    others.iter_mut().zip(touching).for_each(|(feature, value)| *feature = value as f32);
    Seen { features, larger: most.map(|(label, ..)| label) }
}

/// The pieces, and the objects that they become parts of.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    /// The object that a piece is a part of; `None` for stray pieces.
    of: BTreeMap<u32, Option<u32>>,
    /// Objects that the model considers more likely whole than not.
    likely: BTreeSet<u32>,
    /// Figures of the objects that stray pieces form together, by the label of their largest piece.
    united: BTreeMap<u32, Figures>,
}

impl Pieces {
    /// The pieces among the objects, according to `model`. `touched` has the small objects, each with the
    /// objects that it touches.
    pub(crate) fn find(
        model: &Model,
        objects: &BTreeMap<u32, Object>,
        touched: &BTreeMap<u32, BTreeMap<u32, u64>>,
        lattice: Lattice,
    ) -> Result<Self> {
        let mut of = BTreeMap::new();
        let mut likely = BTreeSet::new();
        for (label, touched) in touched {
            // All voxels of this object may have become parts of other objects.
            let Some(object) = objects.get(label) else { continue };
            let Seen { features, larger } = see(object, Some(touched), objects, lattice);
            let shares = model.shares::<{ CLASS_NAMES.len() }>(&features)?;
            let [whole, part, stray] = shares.first().copied().unwrap_or_default();
            let larger = larger.filter(|_| part >= stray);
            if whole < LEAST_WHOLE && (larger.is_some() || object.figures.voxels() <= MOST_STRAY) {
                of.insert(*label, larger);
            } else if whole >= LIKELY_WHOLE {
                likely.insert(*label);
            }
        }
        let mut pieces = Self { of, likely, ..Self::default() };
        pieces.unite_strays(objects, touched);
        Ok(pieces)
    }

    /// Unites stray pieces that touch each other into one object, if together they are too large to be stray.
    /// Growth cuts badly scanned objects into pieces: a tree at the end of the drive, the trail of a car.
    /// None of the pieces looks whole, but a user would miss all of them. On 51 drives this added 8 right
    /// objects and no wrong one (`benches/results/street.md`, "Stray pieces that are an object together").
    fn unite_strays(&mut self, objects: &BTreeMap<u32, Object>, touched: &BTreeMap<u32, BTreeMap<u32, u64>>) {
        let strays: Vec<u32> = self.of.keys().copied().filter(|label| self.whole(*label).is_none()).collect();
        let mut sets = DisjointSets::new(strays.len() as u32);
        for (place, label) in strays.iter().enumerate() {
            for other in touched[label].keys().filter_map(|other| strays.binary_search(other).ok()) {
                sets.union(place as u32, other as u32);
            }
        }
        let mut groups = BTreeMap::<u32, Vec<u32>>::new();
        for (place, &label) in strays.iter().enumerate() {
            groups.entry(sets.find(place as u32)).or_default().push(label);
        }
        for group in groups.into_values() {
            let mut figures = Figures::default();
            group.iter().for_each(|label| figures.merge(&objects[label].figures));
            // Of two equal counts, the smaller label wins.
            let largest = group.iter().rev().max_by_key(|label| objects[label].figures.voxels());
            if let Some(&largest) = largest.filter(|_| figures.voxels() > MOST_STRAY) {
                self.of.extend(group.iter().map(|label| (*label, Some(largest))));
                self.of.remove(&largest);
                self.united.insert(largest, figures);
            }
        }
    }

    /// The figures of a whole object, including the stray pieces that are a part of it.
    pub(crate) fn figures<'a>(&'a self, label: u32, own: &'a Figures) -> &'a Figures {
        self.united.get(&label).unwrap_or(own)
    }

    /// Whether the model considers an object more likely whole than not.
    pub(crate) fn is_likely(&self, label: u32) -> bool {
        self.likely.contains(&label)
    }

    /// The whole object that a label belongs to: itself, a larger one, or none. A larger object may be a part
    /// of one that is larger still.
    pub(crate) fn whole(&self, mut label: u32) -> Option<u32> {
        while let Some(&of) = self.of.get(&label) {
            label = of?;
        }
        Some(label)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boosting::{Samples, Settings, learn};
    use crate::cluster::street::objects::stage_leftovers::Whole;
    use crate::cluster::street::objects::{contacts, figures};
    use crate::cluster::street::shares::{BUILDING, TREE};

    /// The objects of these blocks, in decimetres, and what each touches.
    fn scene(
        blocks: &[(u8, [i64; 3], [i64; 3])],
    ) -> (BTreeMap<u32, Object>, BTreeMap<u32, BTreeMap<u32, u64>>) {
        let whole = Whole::of_blocks(blocks);
        let figures = figures::find(&whole, Lattice::MILLIMETRE);
        let object = |(label, figures)| (label, Object { class: whole.class[&label], figures });
        (
            figures.into_iter().map(object).collect(),
            contacts::of_objects(&[contacts::count(&whole, MOST_VOXELS)], MOST_VOXELS),
        )
    }

    /// A small model of these samples.
    fn learned(samples: &Samples) -> Model {
        let settings = Settings { rounds: 30, features: 1.0, ..Settings::default() };
        learn(samples, &settings, &|_| Ok(())).unwrap()
    }

    fn place(name: &str) -> usize {
        NAMES.iter().position(|other| *other == name).unwrap()
    }

    fn feature(seen: &Seen, name: &str) -> f32 {
        seen.features[place(name)]
    }

    #[test]
    fn the_larger_object_is_the_one_that_most_voxels_touch() {
        // A cube with an edge of 4 voxels. Three layers lie beside a crown, and the lowest one is near the
        // top of a wall.
        let (objects, touched) = scene(&[
            (TREE, [0, 0, 30], [6, 6, 6]),
            (TREE, [6, 0, 30], [30, 30, 30]),
            (BUILDING, [0, 0, 0], [6, 1, 27]),
        ]);
        let seen = |label| see(&objects[&label], touched.get(&label), &objects, Lattice::MILLIMETRE);
        let cube = seen(1);
        assert_eq!(cube.larger, Some(2));
        assert!((feature(&cube, "objects that it touches") - 2.0).abs() < 1e-6);
        assert!((feature(&cube, "share that touches the larger object") - 0.75).abs() < 1e-6);
        assert!((feature(&cube, "share that touches a larger object of its class") - 0.75).abs() < 1e-6);
        assert!((feature(&cube, "class of the larger object") - f32::from(TREE)).abs() < 1e-6);
        assert!(feature(&cube, "voxels of the larger object per voxel") > 50.0);
        assert!((feature(&cube, "highest of the larger object, m") - 5.9).abs() < 1e-3);
        assert!((feature(&cube, "share that touches others") - 1.0).abs() < 1e-6);
        // The crown is too large for a piece.
        let crown = seen(2);
        assert_eq!(crown.larger, None);
        assert_eq!(crown.features[figures::NAMES.len()..], [0.0; TOUCHING]);
    }

    #[test]
    fn parts_go_to_the_larger_object_and_strays_to_none() {
        // An object with few voxels is a piece. It is a part if it touches something.
        let row = |voxels: f32, touches: f32| {
            let mut row = [0.0; FEATURES];
            row[place("voxels")] = voxels;
            row[figures::NAMES.len()] = touches;
            row
        };
        let mut samples = Samples::new(&NAMES, &CLASS_NAMES);
        for number in 0..600_u16 {
            let touches = f32::from(number % 2);
            samples.push(&row(f32::from(100 + number), touches), WHOLE).unwrap();
            samples.push(&row(f32::from(number % 70), 1.0), PART).unwrap();
            samples.push(&row(f32::from(number % 70), 0.0), STRAY).unwrap();
        }
        let model = learned(&samples);
        // A large crown, a twig on it with a leaf at the end, an object far away, and a tree beside the
        // crown.
        let (objects, touched) = scene(&[
            (TREE, [0, 0, 30], [30, 30, 30]),
            (TREE, [30, 0, 30], [6, 4, 4]),
            (BUILDING, [36, 0, 30], [3, 3, 3]),
            (TREE, [90, 0, 0], [3, 3, 6]),
            (TREE, [0, 30, 30], [30, 30, 30]),
        ]);
        let pieces = Pieces::find(&model, &objects, &touched, Lattice::MILLIMETRE).unwrap();
        let whole: Vec<Option<u32>> = (1..=5).map(|label| pieces.whole(label)).collect();
        assert_eq!(whole, [Some(1), Some(1), Some(1), None, Some(5)]);
    }

    #[test]
    fn a_large_object_is_not_stray() {
        let row = |touches: f32| {
            let mut row = [0.0; FEATURES];
            row[figures::NAMES.len()] = touches;
            row
        };
        let mut samples = Samples::new(&NAMES, &CLASS_NAMES);
        for _ in 0..600 {
            samples.push(&row(1.0), WHOLE).unwrap();
            samples.push(&row(0.0), STRAY).unwrap();
        }
        let model = learned(&samples);
        // Cubes with edges of 8 and 9 voxels, far from each other.
        let (objects, touched) = scene(&[(TREE, [0, 0, 0], [12, 12, 12]), (TREE, [90, 0, 0], [13, 13, 13])]);
        let voxels = |label| objects[&label].figures.voxels();
        assert!(voxels(1) <= MOST_STRAY && voxels(2) > MOST_STRAY, "{} {}", voxels(1), voxels(2));
        let pieces = Pieces::find(&model, &objects, &touched, Lattice::MILLIMETRE).unwrap();
        assert_eq!([1, 2].map(|label| pieces.whole(label)), [None, Some(2)]);
        assert!(!pieces.is_likely(2));
    }

    #[test]
    fn stray_pieces_that_touch_are_one_object_if_they_are_large_together() {
        // An object with fewer than a thousand voxels is stray.
        let mut samples = Samples::new(&NAMES, &CLASS_NAMES);
        for number in 0..600_u16 {
            let mut row = [0.0; FEATURES];
            row[place("voxels")] = f32::from(1_000 + number);
            samples.push(&row, WHOLE).unwrap();
            row[place("voxels")] = f32::from(number);
            samples.push(&row, STRAY).unwrap();
        }
        let model = learned(&samples);
        // A row of three cubes, the middle one larger, and two cubes far from it, with fewer voxels than a
        // large object.
        let (objects, touched) = scene(&[
            (TREE, [0, 0, 0], [9, 9, 9]),
            (TREE, [9, 0, 0], [10, 10, 10]),
            (BUILDING, [19, 0, 0], [9, 9, 9]),
            (TREE, [90, 0, 0], [9, 9, 9]),
            (TREE, [99, 0, 0], [9, 9, 9]),
        ]);
        let voxels = |labels: &[u32]| labels.iter().map(|label| objects[label].figures.voxels()).sum::<u64>();
        assert!(voxels(&[1, 2, 3]) > MOST_STRAY && voxels(&[4, 5]) <= MOST_STRAY);
        let pieces = Pieces::find(&model, &objects, &touched, Lattice::MILLIMETRE).unwrap();
        let whole: Vec<Option<u32>> = (1..=5).map(|label| pieces.whole(label)).collect();
        assert_eq!(whole, [Some(2), Some(2), Some(2), None, None]);
        // The object has the figures of all three.
        assert_eq!(pieces.figures(2, &objects[&2].figures).voxels(), voxels(&[1, 2, 3]));
        assert_eq!(pieces.figures(4, &objects[&4].figures).voxels(), voxels(&[4]));
    }
}
