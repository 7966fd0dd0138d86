//! Figures of an object as a whole, from which the model of objects names it.
//!
//! The earlier steps name voxels. An object can be complete and still have the wrong name: a car with a roof
//! whose voxels look like a hedge. Its size, its profile and how densely it is filled say what it is. The
//! figures are integer sums over its voxels. So the figures of all tiles add up, and the name does not depend
//! on tiles.
#![expect(clippy::cast_possible_truncation, reason = "features are single numbers")]

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::stage_leftovers::Whole;
use crate::cluster::street::settings::{CLASSES, EDGE_M};
use crate::cluster::street::window::Window;
use crate::model::Lattice;
use crate::spatial::Cell;

/// Upper limits of the bands of height above ground, in metres. The last band has none.
const BANDS_M: [f64; BANDS - 1] = [0.5, 1.0, 1.5, 2.0, 3.0, 5.0];
const BANDS: usize = 7;

/// Names of the features.
pub(crate) const NAMES: [&str; 28] = [
    "share of none",
    "share of tree",
    "share of pole",
    "share of vehicle",
    "share of building",
    "share of fence or hedge",
    "share of small",
    "share of wire",
    "class of the steps before",
    "voxels",
    "points per voxel",
    "voxels per column",
    "occupied voxels around a voxel",
    "length, m",
    "width, m",
    "width per length",
    "columns per area of length and width",
    "lowest, m",
    "highest, m",
    "mean height, m",
    "deviation of the height, m",
    "share below 0.5 m",
    "share from 0.5 to 1 m",
    "share from 1 to 1.5 m",
    "share from 1.5 to 2 m",
    "share from 2 to 3 m",
    "share from 3 to 5 m",
    "share above 5 m",
];

/// Sums over the voxels of an object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Figures {
    voxels: u64,
    points: u64,
    columns: u64,
    /// Occupied voxels among the 27 in and around each voxel, whatever object they belong to.
    occupied: u64,
    shares: [u64; CLASSES],
    /// Sums of i and j over the voxels, and of i i, i j and j j.
    place: [i64; 2],
    products: [i128; 3],
    /// Lowest and highest height above ground, in lattice units.
    low: i32,
    high: i32,
    /// Sums of the heights and of their squares.
    height: i64,
    squares: i128,
    bands: [u64; BANDS],
}

impl Default for Figures {
    fn default() -> Self {
        Self {
            voxels: 0,
            points: 0,
            columns: 0,
            occupied: 0,
            shares: [0; CLASSES],
            place: [0; 2],
            products: [0; 3],
            low: i32::MAX,
            high: i32::MIN,
            height: 0,
            squares: 0,
            bands: [0; BANDS],
        }
    }
}

impl Figures {
    /// Number of voxels.
    pub(crate) fn voxels(&self) -> u64 {
        self.voxels
    }

    /// Number of points in the voxels.
    pub(crate) fn points(&self) -> u64 {
        self.points
    }

    /// Height of its highest voxel above ground, in metres.
    pub(crate) fn highest_m(&self, lattice: Lattice) -> f64 {
        metres(f64::from(self.high), lattice)
    }

    /// Adds the voxels of another part of the object.
    pub(crate) fn merge(&mut self, other: &Self) {
        fn add<T: Copy + std::ops::AddAssign, const N: usize>(sums: &mut [T; N], others: &[T; N]) {
            sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += *other);
        }
        self.voxels += other.voxels;
        self.points += other.points;
        self.columns += other.columns;
        self.occupied += other.occupied;
        add(&mut self.shares, &other.shares);
        add(&mut self.place, &other.place);
        add(&mut self.products, &other.products);
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
        self.height += other.height;
        self.squares += other.squares;
        add(&mut self.bands, &other.bands);
    }

    /// The features of the object, in the order of [`NAMES`]. `class` is the class that the earlier steps
    /// gave it.
    pub(crate) fn features(&self, class: u8, lattice: Lattice) -> [f32; NAMES.len()] {
        let count = self.voxels as f64;
        let mean = |sum: u64| sum as f64 / count;
        let metres = |units: f64| metres(units, lattice);
        // The products are exact, so that only the difference is rounded.
        let voxels = i128::from(self.voxels);
        let moment = |product: i128, one: usize, other: usize| {
            let places = i128::from(self.place[one]) * i128::from(self.place[other]);
            (voxels * product - places) as f64 / (count * count)
        };
        let [xx, xy, yy] = self.products;
        let [xx, xy, yy] = [moment(xx, 0, 0), moment(xy, 0, 1), moment(yy, 1, 1)];
        let middle = 0.5 * (xx + yy);
        let spread = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        // The length of a bar with this variance. A single voxel is one edge long.
        let side = |variance: f64| EDGE_M * (12.0 * variance.max(0.0) + 1.0).sqrt();
        let [length, width] = [side(middle + spread), side(middle - spread)];
        let height = i128::from(self.height);
        let variance = (voxels * self.squares - height * height) as f64 / (count * count);
        let mut features = [0.0; NAMES.len()];
        let (shares, others) = features.split_at_mut(CLASSES);
        for (share, sum) in shares.iter_mut().zip(self.shares) {
            *share = (mean(sum) / 255.0) as f32;
        }
        let (measures, bands) = others.split_at_mut(13);
        let values = [
            f64::from(class),
            count,
            mean(self.points),
            count / self.columns as f64,
            mean(self.occupied),
            length,
            width,
            width / length,
            self.columns as f64 * EDGE_M * EDGE_M / (length * width),
            metres(f64::from(self.low)),
            self.highest_m(lattice),
            metres(self.height as f64 / count),
            metres(variance.max(0.0).sqrt()),
        ];
        measures.iter_mut().zip(values).for_each(|(measure, value)| *measure = value as f32);
        bands.iter_mut().zip(self.bands).for_each(|(band, sum)| *band = mean(sum) as f32);
        features
    }
}

fn metres(units: f64, lattice: Lattice) -> f64 {
    units / lattice.units(1.0) as f64
}

/// The figures of each object over the voxels that the tile owns.
pub(crate) fn find(whole: &Whole, lattice: Lattice) -> BTreeMap<u32, Figures> {
    let around = &whole.grown.cored.around;
    let voxels = &around.voxels;
    let borders = BANDS_M.map(|metres| lattice.units(metres));
    let mut near = Window::new(1, 1).over(&voxels.columns);
    let mut found = BTreeMap::<u32, (Figures, Option<Cell>)>::new();
    for (voxel, &label) in whole.grown.label.iter().enumerate() {
        if label == 0 || !voxels.owned[voxel] {
            continue;
        }
        let (figures, last) = found.entry(label).or_default();
        let [i, j, k] = voxels.key[voxel];
        // Voxels come column by column.
        figures.columns += u64::from(last.replace([i, j]) != Some([i, j]));
        figures.voxels += 1;
        figures.points += u64::from(voxels.points[voxel]);
        near.visit([i, j], k, |_| figures.occupied += 1);
        for (sum, share) in figures.shares.iter_mut().zip(around.shares[voxel]) {
            *sum += u64::from(share);
        }
        let [i, j] = [i, j].map(i64::from);
        figures.place = [figures.place[0] + i, figures.place[1] + j];
        for (sum, product) in figures.products.iter_mut().zip([i * i, i * j, j * j]) {
            *sum += i128::from(product);
        }
        let height = around.height[voxel];
        figures.low = figures.low.min(height);
        figures.high = figures.high.max(height);
        figures.height += i64::from(height);
        figures.squares += i128::from(i64::from(height) * i64::from(height));
        figures.bands[borders.partition_point(|&border| border <= i64::from(height))] += 1;
    }
    found.into_iter().map(|(label, (figures, _))| (label, figures)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::shares::{TREE, VEHICLE};

    fn feature(figures: &Figures, name: &str) -> f32 {
        let place = NAMES.iter().position(|other| *other == name).unwrap();
        figures.features(VEHICLE, Lattice::MILLIMETRE)[place]
    }

    #[test]
    fn a_block_has_its_length_width_and_height() {
        // 4.5 x 1.8 x 1.5 m, in decimetres, with an object of one voxel beside it.
        let blocks = [(VEHICLE, [0, 0, 3], [45, 18, 15]), (TREE, [90, 0, 0], [1, 1, 1])];
        let found = find(&Whole::of_blocks(&blocks), Lattice::MILLIMETRE);
        let block = &found[&1];
        for (name, expected, within) in [
            ("length, m", 4.5, 0.01),
            ("width, m", 1.8, 0.01),
            ("voxels", 30.0 * 12.0 * 10.0, 0.5),
            ("voxels per column", 10.0, 0.001),
            ("columns per area of length and width", 1.0, 0.01),
            ("class of the steps before", 3.0, 0.0),
            ("highest, m", 1.7, 0.11),
            ("share from 0.5 to 1 m", 0.3, 0.11),
            ("share above 5 m", 0.0, 0.0),
        ] {
            assert!((feature(block, name) - expected).abs() <= within, "{name}: {}", feature(block, name));
        }
        // 8 of 27 at a corner, 27 inside.
        assert!((20.0..27.0).contains(&feature(block, "occupied voxels around a voxel")));
        let one = &found[&2];
        for (name, expected) in
            [("length, m", 0.15), ("width per length", 1.0), ("occupied voxels around a voxel", 1.0)]
        {
            assert!((feature(one, name) - expected).abs() < 1e-6, "{name}");
        }
    }

    #[test]
    fn figures_of_tiles_add_up_also_far_from_the_origin() {
        let parts = [[0, 0, 0], [31, 0, 0]].map(|from| (VEHICLE, from, [30, 15, 12]));
        let both = Whole::of_blocks(&parts);
        let found = find(&both, Lattice::MILLIMETRE);
        let mut sum = Figures::default();
        found.values().for_each(|part| sum.merge(part));
        assert_eq!(sum.voxels, found[&1].voxels + found[&2].voxels);
        let length = feature(&sum, "length, m");
        assert!((6.0..6.3).contains(&length), "{length}");
        // The same object 6,000 km away has the same features.
        let mut far = sum.clone();
        let by = 40_000_000_i64;
        let count = i64::try_from(sum.voxels).unwrap();
        let [si, sj] = sum.place;
        far.place = [si + by * count, sj + by * count];
        let (by, count) = (i128::from(by), i128::from(count));
        let [si, sj] = [i128::from(si), i128::from(sj)];
        far.products[0] += 2 * by * si + by * by * count;
        far.products[1] += by * (si + sj) + by * by * count;
        far.products[2] += 2 * by * sj + by * by * count;
        let bits = |figures: &Figures| figures.features(VEHICLE, Lattice::MILLIMETRE).map(f32::to_bits);
        assert_eq!(bits(&far), bits(&sum));
    }
}
