//! Isolated noise: small groups of voxels that touch no other voxel. Shape, intensity and time do not matter.
//!
//! Source: Li, Li, Li, Yang, Liu, "A density-based clustering method for urban scene mobile laser scanning
//! data segmentation" (2017), section 3.1: small connected components are noise. Ours, because the paper does
//! not say it: voxels are connected if they touch at a face, edge or corner; the threshold counts points; low
//! noise (LAS class 7) and high noise (LAS class 18) are distinguished.
//!
//! The decision is exact and needs only a limited neighbourhood. Let n be `min_component_points`. A component
//! of fewer than n points has at most n - 1 voxels. So the component and the empty voxels around it lie at
//! most n - 1 voxels from any of its points. A larger component has at least n voxels, and so n points,
//! within n - 1 voxels of any of its points. Its full size does not matter.
//!
//! Ours, too: far from the scanner, the points of trees and facades are as far apart as noise. So a component
//! is kept if the 27 cubes of 1.5 m around it contain 12 to 150 points, and if their occupied voxels have at
//! most 4 points on average. With fewer points in the cubes, a component stays noise. With more or denser
//! points, real things do not form small components: the edge of a crown near the scanner also has few
//! points, but they are dense. The study is `benches/results/noise.md`.
//!
//! Cost: O(points) for the voxels (shared with a ground filter of the same edge), then O(voxels).
//! Memory per voxel: 8 bytes beside the voxels themselves, and 50 to 100 per cube. The bench is
//! `benches/kernels.rs`.
//!
//! Known failures: mixed pixels close to a surface are connected to it and stay; a bird of ten returns stays.

use std::f64::consts::SQRT_2;
use std::ops::RangeInclusive;

use rustc_hash::FxHashMap;
use serde::Deserialize;

use super::lowest::{NONE, lowest_within};
use crate::config::ConfigError;
use crate::model::AlgorithmError;
use crate::model::{Lattice, PointClass, Reach};
use crate::spatial::{Linker, TileView, VoxelIndex};

const NAME: &str = "noise";

/// Horizontal radius in metres. The height of noise is measured above the lowest voxel within it that is not
/// noise. The same as the default radius of `voxel-column`.
const NEIGHBOURHOOD_M: f64 = 1.5;

/// Edge of the cubes in which points are counted, in metres (chosen by `benches/results/noise.md`).
const CUBE_M: f64 = 1.5;
/// Number of points in the 27 cubes around a small component that can be kept (chosen by the same study).
const FEW: RangeInclusive<u64> = 12..=150;
/// Largest mean number of points per occupied voxel in these 27 cubes (chosen by the same study).
const MOST_PER_VOXEL: u64 = 4;

/// Settings of the section `[noise]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseConfig {
    /// Whether isolated noise is detected. Default true (Li et al. 2017, section 3.1).
    pub enabled: bool,
    /// Edge of a voxel in metres, 0.05 to 2. Default 0.5 (chosen by `benches/results/noise.md`; the paper has
    /// 0.3, twice the spacing of points on its far objects, section 4.1).
    pub voxel: f64,
    /// Connected voxels with fewer points than this, in the whole drive, are noise; 1 to 100. Default 5
    /// (chosen by the same study; the paper gives no number). The context that tiles need grows with it.
    pub min_component_points: u32,
    /// Whether small components are kept in sparse places, because the points of trees and facades are as far
    /// apart as noise there. Default true (chosen by the same study; the paper does not have it).
    pub keep_sparse: bool,
    /// Noise that is more than this many metres above the lowest other voxel nearby is high noise, 0 to
    /// 1,000. Default 2.0 (chosen: the height of people and cars).
    pub high: f64,
}

impl Default for NoiseConfig {
    fn default() -> Self {
        Self { enabled: true, voxel: 0.5, min_component_points: 5, keep_sparse: true, high: 2.0 }
    }
}

impl NoiseConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let points = self.min_component_points;
        ConfigError::outside([("noise.voxel", self.voxel, 0.05..=2.0, "metres")])?;
        ConfigError::outside([("noise.min_component_points", points, 1..=100, "points")])?;
        ConfigError::outside([("noise.high", self.high, 0.0..=1_000.0, "metres")])
    }
}

/// Finds isolated noise in the points of a tile.
#[derive(Debug, Clone)]
pub struct IsolatedNoise {
    config: NoiseConfig,
}

impl IsolatedNoise {
    /// The filter with these settings.
    ///
    /// # Errors
    /// Those of [`NoiseConfig::validate`].
    pub fn new(config: &NoiseConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }

    /// Largest distance in the plane from a point to other points that decide whether it is noise: sqrt(2)
    /// times n voxels (see above) or two cubes, which is the distance along each axis. The engine uses the
    /// decision only for points with this much context.
    #[must_use]
    pub fn reach(&self, lattice: Lattice) -> Reach {
        if !self.config.enabled {
            return Reach::Exact { metres: 0.0 };
        }
        let voxel_m = lattice.metres(lattice.units(self.config.voxel));
        let component = f64::from(self.config.min_component_points);
        let cubes = if self.config.keep_sparse { f64::from(2 * self.voxels_of_cube()) } else { 0.0 };
        Reach::Exact { metres: component.max(cubes) * voxel_m * SQRT_2 }
    }

    /// Edge of a cube in voxels.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a voxel has 0.05 to 2 m")]
    fn voxels_of_cube(&self) -> u32 {
        (CUBE_M / self.config.voxel).round().max(1.0) as u32
    }

    /// Largest distance from a noise point to other points whose classes decide whether it is high or low.
    /// This reach and that of the ground filter both start from decided classes. So the larger of the two is
    /// added to [`Self::reach`].
    #[must_use]
    pub fn height_reach(&self, lattice: Lattice) -> Reach {
        if !self.config.enabled {
            return Reach::Exact { metres: 0.0 };
        }
        let voxel_m = lattice.metres(lattice.units(self.config.voxel));
        Reach::Exact { metres: NEIGHBOURHOOD_M + voxel_m * SQRT_2 }
    }

    /// Sets the noise among the points of `view` to [`PointClass::LowNoise`] or [`PointClass::HighNoise`].
    /// `classes` has one entry per point; other entries stay. Components consist of the given points only. At
    /// the edge of the context they are cut, so decisions there may be wrong and must not be used.
    ///
    /// # Errors
    /// When the points cannot be indexed, see [`AlgorithmError`].
    pub fn mark(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        if !self.config.enabled {
            return Ok(());
        }
        let lattice = view.cloud().lattice;
        let index = view.voxels(NAME, voxel_edge(lattice, self.config.voxel))?;
        let mut is_noise = small_components(index, self.config.min_component_points);
        if self.config.keep_sparse && is_noise.contains(&true) {
            let around = around(index, self.voxels_of_cube());
            for column in 0..index.columns().len() {
                for voxel in index.column_voxels(column) {
                    is_noise[voxel] = is_noise[voxel] && !around(column, voxel).is_sparse();
                }
            }
        }
        if !is_noise.contains(&true) {
            return Ok(());
        }
        let verdicts = self.heights(index, &is_noise, lattice);
        for (points, voxel) in index.streaks() {
            if let Some(class) = verdicts[voxel] {
                classes[points].fill(class);
            }
        }
        Ok(())
    }

    /// The class of every noise voxel: high or low. `None` for other voxels.
    fn heights(&self, index: &VoxelIndex, is_noise: &[bool], lattice: Lattice) -> Vec<Option<PointClass>> {
        let lows: Vec<u32> = (0..index.columns().len())
            .map(|column| index.column_voxels(column).find(|&voxel| !is_noise[voxel]))
            .map(|voxel| voxel.map_or(NONE, |voxel| index.heights()[voxel]))
            .collect();
        let lowest = lowest_within(index, lattice.units(NEIGHBOURHOOD_M), &lows);
        let (edge, high) = (i64::from(index.grid().edge), lattice.units(self.config.high));
        let mut verdicts = vec![None; index.len()];
        for (column, &low) in lowest.iter().enumerate() {
            for voxel in index.column_voxels(column).filter(|&voxel| is_noise[voxel]) {
                let above = (i64::from(index.heights()[voxel]) - i64::from(low)) * edge;
                let is_high = low != NONE && above > high;
                verdicts[voxel] = Some(if is_high { PointClass::HighNoise } else { PointClass::LowNoise });
            }
        }
        verdicts
    }
}

/// An edge in metres as lattice units; positive, because the settings are at least 2 cm.
pub(super) fn voxel_edge(lattice: Lattice, metres: f64) -> u32 {
    u32::try_from(lattice.units(metres)).unwrap_or(u32::MAX)
}

/// Whether each voxel is in a 26-connected component of fewer than `min_points` points.
fn small_components(index: &VoxelIndex, min_points: u32) -> Vec<bool> {
    let mut linker = Linker::new(index);
    linker.link_column(1..=1, |_, _| true);
    linker.find_spans();
    for offset in [[0, 1], [1, -1], [1, 0], [1, 1]] {
        linker.link_beside(offset, &(-1..=1), |_, _| true);
    }
    let mut sets = linker.into_sets();
    let mut sizes = vec![0_u32; index.len()];
    let roots: Vec<usize> = (0_u32..).take(index.len()).map(|voxel| sets.find(voxel) as usize).collect();
    for (&root, &count) in roots.iter().zip(index.counts()) {
        sizes[root] += count;
    }
    roots.into_iter().map(|root| sizes[root] < min_points).collect()
}

/// Contents of some cubes.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Content {
    points: u64,
    /// Occupied voxels.
    voxels: u64,
}

impl Content {
    fn add(&mut self, other: Self) {
        self.points += other.points;
        self.voxels += other.voxels;
    }

    /// Whether points are so sparse that the points of an object can be as far apart as noise.
    fn is_sparse(self) -> bool {
        FEW.contains(&self.points) && self.points <= MOST_PER_VOXEL * self.voxels
    }
}

/// Contents of the 27 cubes around a voxel, by its column and its number. Cubes have an edge of `edge` voxels
/// and lie at multiples of it in the coordinates of the drive.
fn around(index: &VoxelIndex, edge: u32) -> impl Fn(usize, usize) -> Content {
    let base = index.grid().base;
    let along = move |axis: usize, at: u32| (base[axis] + i64::from(at)).div_euclid(i64::from(edge));
    let cube = move |column: usize, voxel: usize| {
        let [i, j] = index.columns()[column];
        [along(0, i), along(1, j), along(2, index.heights()[voxel])]
    };
    let mut cubes: FxHashMap<[i64; 3], Content> = FxHashMap::default();
    for column in 0..index.columns().len() {
        for voxel in index.column_voxels(column) {
            let one = Content { points: index.counts()[voxel].into(), voxels: 1 };
            cubes.entry(cube(column, voxel)).or_default().add(one);
        }
    }
    move |column, voxel| {
        let [i, j, k] = cube(column, voxel);
        let mut content = Content::default();
        for n in 0..27 {
            if let Some(one) = cubes.get(&[i + n / 9 - 1, j + n / 3 % 3 - 1, k + n % 3 - 1]) {
                content.add(*one);
            }
        }
        content
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::model::TileCloud;
    use PointClass::{HighNoise, LowNoise, Object};

    fn mark(config: &NoiseConfig, points: &[[i64; 3]]) -> Vec<PointClass> {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut classes = vec![Object; points.len()];
        IsolatedNoise::new(config).unwrap().mark(&mut TileView::new(&cloud), &mut classes).unwrap();
        classes
    }

    /// Voxels as in the paper, and ten points.
    const PAPER: NoiseConfig =
        NoiseConfig { enabled: true, voxel: 0.3, min_component_points: 10, keep_sparse: false, high: 2.0 };

    #[test]
    fn components_below_the_threshold_are_noise() {
        // Nine points in a row of voxels, far from ten in the same shape.
        let nine = (0..9).map(|step| [step * 300, 0, 0]);
        let ten = (0..10).map(|step| [step * 300, 3_000, 0]);
        let classes = mark(&PAPER, &nine.chain(ten).collect::<Vec<_>>());
        assert_eq!(classes[..9], [LowNoise; 9]);
        assert_eq!(classes[9..], [Object; 10]);
    }

    #[test]
    fn voxels_touch_at_corners_and_points_count_not_voxels() {
        let config = NoiseConfig { min_component_points: 3, ..PAPER };
        // Voxels (0, 0, 0) and (1, 1, 1): three points. One voxel further on an axis: two and one.
        assert_eq!(mark(&config, &[[0, 0, 0], [299, 299, 299], [300, 599, 300]]), [Object; 3]);
        assert_eq!(mark(&config, &[[0, 0, 0], [299, 299, 299], [300, 599, 600]]), [LowNoise; 3]);
        // (1, -1): the column offset that a walk in one direction easily misses.
        assert_eq!(mark(&config, &[[0, 599, 0], [0, 599, 0], [300, 299, 599]]), [Object; 3]);
    }

    #[test]
    fn high_noise_is_more_than_high_above_the_lowest_voxel_within_the_neighbourhood() {
        let config = NoiseConfig { min_component_points: 2, ..PAPER };
        // Two points make ground at voxel (0, 0, 0); the stray is at (i, 0, k).
        let stray = |i: i64, k: i64| mark(&config, &[[0, 0, 0], [0, 0, 0], [i * 300, 0, k * 300]])[2];
        assert_eq!(stray(5, 7), HighNoise, "2.1 m above, 1.5 m beside");
        assert_eq!(stray(5, 6), LowNoise, "1.8 m above");
        assert_eq!(stray(6, 7), LowNoise, "nothing within 1.5 m");
        assert_eq!(stray(0, -9), LowNoise, "below");
        let exactly = NoiseConfig { high: 2.1, ..config };
        let classes = mark(&exactly, &[[0, 0, 0], [0, 0, 0], [0, 0, 2_100]]);
        assert_eq!(classes[2], LowNoise, "2.1 m is not more than 2.1 m");
    }

    #[test]
    fn other_noise_is_nothing_to_stand_above() {
        let config = NoiseConfig { min_component_points: 2, ..PAPER };
        assert_eq!(mark(&config, &[[0, 0, 0], [0, 0, 9_000]]), [LowNoise; 2]);
    }

    #[test]
    fn where_few_points_lie_they_are_kept() {
        let config = NoiseConfig::default();
        // Points 0.9 m apart, in a square: a distant tree.
        let tree = |count: i64| (0..count).map(|n| [n % 4 * 900, n / 4 * 900, 0]).collect::<Vec<_>>();
        assert_eq!(mark(&config, &tree(16))[5], Object);
        assert_eq!(mark(&config, &tree(8)), [LowNoise; 8], "too few for anything");
        let printed = NoiseConfig { keep_sparse: false, ..config.clone() };
        assert_eq!(mark(&printed, &tree(16)), [LowNoise; 16]);
        // Above a road whose voxels have four points each.
        let stray: [i64; 3] = [1_500, 1_500, 1_900];
        let road = |count: i64| (0..count).map(|n| [n % 16 * 250, n / 16 * 250, 0]);
        assert_eq!(mark(&config, &road(149).chain([stray]).collect::<Vec<_>>())[149], Object);
        assert_eq!(mark(&config, &road(150).chain([stray]).collect::<Vec<_>>())[150], LowNoise);
        // Beside a wall of 14 voxels, then beside the same points squeezed to half the height: an edge of a
        // crown.
        let wall = || (0..52).map(|n| [n % 13 * 250, 0, n / 13 * 250]);
        let half = || wall().map(|[x, y, z]| [x, y, z / 2]);
        let beside: [i64; 3] = [1_500, 1_100, 0];
        assert_eq!(mark(&config, &wall().chain([beside]).collect::<Vec<_>>())[52], Object);
        assert_eq!(mark(&config, &half().chain([beside]).collect::<Vec<_>>())[52], LowNoise);
    }

    #[test]
    fn cubes_are_those_of_the_drive() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let points: Vec<[i64; 3]> =
            (0..400).map(|_| std::array::from_fn(|_| rng.random_range(-9_000..9_000))).collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let index = VoxelIndex::build(NAME, &cloud, 500).unwrap();
        let around = around(&index, 3);
        let mut column_of = vec![0; index.len()];
        for column in 0..index.columns().len() {
            index.column_voxels(column).for_each(|voxel| column_of[voxel] = column);
        }
        let mut compared = 0;
        for (streak, voxel) in index.streaks() {
            let cube = points[streak.start].map(|value| value.div_euclid(1_500));
            let near = |point: &&[i64; 3]| {
                point.iter().zip(cube).all(|(value, cube)| value.div_euclid(1_500).abs_diff(cube) <= 1)
            };
            let found = around(column_of[voxel], voxel);
            assert_eq!(found.points, points.iter().filter(near).count() as u64);
            let voxels: BTreeSet<[i64; 3]> =
                points.iter().filter(near).map(|point| point.map(|value| value.div_euclid(500))).collect();
            assert_eq!(found.voxels, voxels.len() as u64);
            compared += 1;
        }
        assert!(compared > 390, "{compared}");
    }

    #[test]
    fn disabled_it_marks_nothing_and_needs_no_context() {
        let config = NoiseConfig { enabled: false, ..NoiseConfig::default() };
        assert_eq!(mark(&config, &[[0, 0, 0]]), [Object]);
        let noise = IsolatedNoise::new(&config).unwrap();
        assert_eq!(noise.reach(Lattice::MILLIMETRE), Reach::Exact { metres: 0.0 });
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = NoiseConfig::default;
        for (config, key) in [
            (NoiseConfig { voxel: f64::NAN, ..default() }, "noise.voxel = NaN"),
            (NoiseConfig { voxel: 0.0, ..default() }, "noise.voxel = 0"),
            (NoiseConfig { min_component_points: 0, ..default() }, "noise.min_component_points = 0"),
            (NoiseConfig { high: -1.0, ..default() }, "noise.high = -1"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
    }
}
