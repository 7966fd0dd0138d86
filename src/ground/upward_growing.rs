//! `upward-growing`: a voxel is ground if nothing high grows upward from it within its block.
//!
//! Source: Guan, Cao, Yu, Li, Liu, Chen, Li, "Street-scene tree segmentation from mobile laser scanning data"
//! (2016), section 3.1, with the values of its section 4. The plane is divided into blocks of `block`, and a
//! block into voxels of `voxel`. A voxel grows upward to the occupied ones among the nine voxels of the layer
//! above it (3 x 3, in its block). These grow in the same way. The highest voxel that is reached is the top.
//! The voxel is ground if its top is less than `height` above the low of the block.
//!
//! Ours, because the paper does not say it: the low of a block is a quantile of the lowest voxels of its
//! columns. If it were their minimum, one return below the road would remove the whole block from the ground
//! (recall fell from 0.99 to 0.34 on a street with 0.02 % of stray returns). Voxels and blocks lie at
//! multiples of their edges in the coordinates of the drive. So no point depends on where a file or a tile
//! begins.
//!
//! A path upward passes through every layer up to its top. So a top lies `height` or more above the low if
//! and only if the first layer at that height is reached. Higher layers are not examined. One bit per column
//! says which voxels of the layer above were reached.
//!
//! Cost: O(points + columns log columns). Memory: five bytes per voxel beside the voxels themselves. The
//! bench is `benches/kernels.rs`.
//!
//! Known failures. These become ground: objects lower than `height` (kerbs, low shrubs); the lower rim of
//! crowns and roofs in a block without ground; where the ground is dense, the lowest `height` of an object
//! with a gap above it. These do not: steps of more than `height` within a block (a slope of 10 % rises as
//! much in 3 m, but only layers that touch count).

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "numbers of voxels fit u32 (see VoxelIndex), places in a block are below 128, layers below 100 m / 2 cm"
)]

use std::cmp::Reverse;
use std::f64::consts::SQRT_2;

use serde::Deserialize;

use super::filter::{GroundEntry, GroundFilter};
use super::visible;
use crate::config::{self, ConfigError};
use crate::model::{AlgorithmError, Lattice, PointClass, Reach};
use crate::spatial::{TileView, VoxelIndex};

pub(super) const NAME: &str = "upward-growing";

/// Largest number of voxels along the edge of a block: a row of columns is a word of bits.
const MOST_VOXELS: usize = 128;

pub(super) const ENTRY: GroundEntry = GroundEntry {
    name: NAME,
    summary: "small voxels from which little rises within their block",
    reference: "Guan et al. 2016, section 3.1, doi:10.5194/isprs-archives-XLI-B3-221-2016",
    build: |table| Ok(Box::new(UpwardGrowing::new(&config::section(NAME, table)?)?)),
};

/// Settings of the section `[upward-growing]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UpwardGrowingConfig {
    /// Edge of a voxel in metres, 0.02 to 2. Default 0.05 (Guan et al. 2016, section 4: w_v).
    pub voxel: f64,
    /// Edge of a block in metres, 1 to 128 voxels; rounded to whole voxels. Default 3.0 (Guan et al. 2016,
    /// section 4: w_b).
    pub block: f64,
    /// A voxel is ground when its top is less than this above the low of its block, in metres, 0.02 to 100.
    /// Default 0.3 (Guan et al. 2016, section 4: H_thresh).
    pub height: f64,
    /// The low of a block is this quantile of the lowest voxels of its columns, 0 to 0.5; 0 is the minimum.
    /// Default 0.05 (chosen: the paper does not define the low).
    pub low_quantile: f64,
}

impl Default for UpwardGrowingConfig {
    fn default() -> Self {
        Self { voxel: 0.05, block: 3.0, height: 0.3, low_quantile: 0.05 }
    }
}

impl UpwardGrowingConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::outside([("upward-growing.voxel", self.voxel, 0.02..=2.0, "metres")])?;
        if !(self.voxel..=self.voxel * MOST_VOXELS as f64).contains(&self.block) {
            let expected = format!("1 to {MOST_VOXELS} voxels");
            return Err(ConfigError::value("upward-growing.block", self.block, expected));
        }
        ConfigError::outside([
            ("upward-growing.height", self.height, 0.02..=100.0, "metres"),
            ("upward-growing.low_quantile", self.low_quantile, 0.0..=0.5, ""),
        ])
    }
}

/// The filter, see the module.
#[derive(Debug, Clone)]
pub struct UpwardGrowing {
    config: UpwardGrowingConfig,
}

impl UpwardGrowing {
    /// The filter with these settings.
    ///
    /// # Errors
    /// Those of [`UpwardGrowingConfig::validate`].
    pub fn new(config: &UpwardGrowingConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }

    /// Voxels along the edge of a block.
    fn block_voxels(&self, lattice: Lattice) -> i64 {
        let edge = lattice.units(self.config.voxel);
        ((lattice.units(self.config.block) + edge / 2) / edge).clamp(1, MOST_VOXELS as i64)
    }

    /// The voxels that are ground.
    fn ground_voxels(&self, index: &VoxelIndex, visible: &[u32], lattice: Lattice) -> Vec<bool> {
        let edge = i64::from(index.grid().edge);
        let span = self.block_voxels(lattice);
        let base = index.grid().base;
        let block_of = |axis: usize, at: u32| (base[axis] + i64::from(at)).div_euclid(span);
        let place_of = |axis: usize, at: u32| (base[axis] + i64::from(at)).rem_euclid(span) as usize;
        let layers = ((lattice.units(self.config.height) + edge - 1) / edge) as u32;
        let mut ground = vec![false; index.len()];
        let (mut columns, mut block) = (Vec::new(), Block::default());
        let mut first = 0;
        // Columns are sorted by (i, j): the rows of a strip of blocks follow each other.
        for strip in index.columns().chunk_by(|one, other| block_of(0, one[0]) == block_of(0, other[0])) {
            columns.clear();
            for (number, &[i, j]) in (first..).zip(strip) {
                if let Some(low) = index.column_voxels(number).find(|&voxel| visible[voxel] > 0) {
                    let place = [place_of(0, i), place_of(1, j)];
                    columns.push(Column { block: block_of(1, j), place, number, low: index.heights()[low] });
                }
            }
            first += strip.len();
            columns.sort_by_key(|column| column.block);
            for columns in columns.chunk_by(|one, other| one.block == other.block) {
                let limit = block.low(columns, self.config.low_quantile).saturating_add(layers);
                block.gather(index, visible, columns, limit);
                block.grow(limit, &mut ground);
            }
        }
        ground
    }
}

/// A column with points that are not noise.
struct Column {
    /// Block along j; all columns of a strip have the same along i.
    block: i64,
    /// Row and bit in the block.
    place: [usize; 2],
    number: usize,
    /// Its lowest k.
    low: u32,
}

/// A voxel that may be ground.
struct Voxel {
    k: u32,
    row: u8,
    bit: u8,
    number: u32,
}

/// One layer of a block: a bit per column.
type Layer = [u128; MOST_VOXELS];

/// Buffers of the block at hand.
struct Block {
    lows: Vec<u32>,
    voxels: Vec<Voxel>,
    /// Columns of the layer above from which the limit is reached. `here` has those of the current layer.
    above: Box<Layer>,
    here: Box<Layer>,
}

impl Default for Block {
    fn default() -> Self {
        let layer = || Box::new([0; MOST_VOXELS]);
        Self { lows: Vec::new(), voxels: Vec::new(), above: layer(), here: layer() }
    }
}

impl Block {
    /// The low of the block: a quantile of the lows of its columns. There is at least one column.
    fn low(&mut self, columns: &[Column], quantile: f64) -> u32 {
        self.lows.clear();
        self.lows.extend(columns.iter().map(|column| column.low));
        let rank = (quantile * self.lows.len() as f64) as usize;
        *self.lows.select_nth_unstable(rank).1
    }

    /// Collects the voxels up to the layer `limit`, from the highest down.
    fn gather(&mut self, index: &VoxelIndex, visible: &[u32], columns: &[Column], limit: u32) {
        self.voxels.clear();
        for column in columns {
            let [row, bit] = column.place.map(|place| place as u8);
            let heights = index.column_voxels(column.number).map(|voxel| (voxel, index.heights()[voxel]));
            let low = heights.take_while(|&(_, k)| k <= limit).filter(|&(voxel, _)| visible[voxel] > 0);
            self.voxels.extend(low.map(|(voxel, k)| Voxel { k, row, bit, number: voxel as u32 }));
        }
        self.voxels.sort_unstable_by_key(|voxel| Reverse(voxel.k));
    }

    /// Marks as ground the voxels from which the layer `limit` is not reached.
    fn grow(&mut self, limit: u32, ground: &mut [bool]) {
        self.above.fill(0);
        let mut layer_above = None;
        for layer in self.voxels.chunk_by(|one, other| one.k == other.k) {
            let k = layer[0].k;
            if layer_above != Some(k + 1) {
                self.above.fill(0);
            }
            layer_above = Some(k);
            self.here.fill(0);
            for voxel in layer {
                let row = usize::from(voxel.row);
                if k == limit || reaches(&self.above, row, voxel.bit) {
                    self.here[row] |= 1 << voxel.bit;
                } else {
                    ground[voxel.number as usize] = true;
                }
            }
            std::mem::swap(&mut self.above, &mut self.here);
        }
    }
}

/// Whether one of the nine columns around a bit is set.
fn reaches(above: &Layer, row: usize, bit: u8) -> bool {
    let rows = &above[row.saturating_sub(1)..(row + 2).min(MOST_VOXELS)];
    let bits = rows.iter().fold(0, |all, row| all | row);
    (bits | bits << 1 | bits >> 1) >> bit & 1 == 1
}

impl GroundFilter for UpwardGrowing {
    fn name(&self) -> &'static str {
        NAME
    }

    fn microseconds_per_point(&self) -> f64 {
        1.8
    }

    /// The diagonal of a block.
    fn reach(&self, lattice: Lattice) -> Reach {
        let block = self.block_voxels(lattice) * lattice.units(self.config.voxel);
        Reach::Exact { metres: lattice.metres(block) * SQRT_2 }
    }

    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        visible::classify(NAME, self.config.voxel, view, classes, |index, visible, lattice| {
            self.ground_voxels(index, visible, lattice)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TileCloud;
    use PointClass::{Ground, LowNoise, Object};

    fn classify_with(
        config: &UpwardGrowingConfig,
        points: &[[i64; 3]],
        classes: &[PointClass],
    ) -> Vec<PointClass> {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut classes = classes.to_vec();
        UpwardGrowing::new(config).unwrap().classify(&mut TileView::new(&cloud), &mut classes).unwrap();
        classes
    }

    /// Voxels (i, j, k) of one block; the low is their minimum.
    fn voxels(indices: &[[i64; 3]]) -> Vec<PointClass> {
        let points: Vec<_> = indices.iter().map(|index| index.map(|value| value * 50 + 25)).collect();
        let config = UpwardGrowingConfig { low_quantile: 0.0, ..UpwardGrowingConfig::default() };
        classify_with(&config, &points, &vec![Object; points.len()])
    }

    #[test]
    fn a_top_of_five_layers_is_ground_and_one_of_six_is_not() {
        // 5 * 0.05 m < 0.3 m <= 6 * 0.05 m. The rest of a column that is too high is not ground either.
        let tower = |top: i64| (0..=top).map(|k| [10, 10, k]).collect::<Vec<_>>();
        assert_eq!(voxels(&tower(5)), [Ground; 6]);
        assert_eq!(voxels(&tower(6)), [Object; 7]);
        // A gap ends the growth. The voxels above it are too high themselves.
        assert_eq!(
            voxels(&[[10, 10, 0], [10, 10, 1], [10, 10, 3], [10, 10, 6]]),
            [Ground, Ground, Ground, Object]
        );
    }

    #[test]
    fn growth_leans_by_a_column_in_each_layer_and_stays_in_its_block() {
        let lean =
            |i: i64, di: i64, dj: i64| (0..=6).map(|k| [i + di * k, 10 + dj * k, k]).collect::<Vec<_>>();
        for [di, dj] in [[1, 0], [1, 1], [-1, 1], [0, -1]] {
            assert_eq!(voxels(&lean(20, di, dj)), [Object; 7], "{di} {dj}");
        }
        assert_eq!(voxels(&lean(20, 2, 0))[..6], [Ground; 6], "two columns further is not a neighbour");
        // Columns 55 to 59 belong to the first block, 60 and 61 to the second, where they are the low
        // themselves.
        assert_eq!(voxels(&lean(55, 1, 0)), [Ground; 7]);
        assert_eq!(voxels(&lean(-3, 1, 0)), [Ground; 7]);
    }

    #[test]
    fn one_return_below_the_road_does_not_move_the_low() {
        // 40 columns: the quantile is the third lowest. Two returns 2 m below the road lie below the low;
        // with three, they are the low.
        let road = |strays: i64| {
            (0..40).map(|i| [i * 50, 0, if i < strays { -2_000 } else { 0 }]).collect::<Vec<_>>()
        };
        let config = UpwardGrowingConfig::default();
        assert_eq!(classify_with(&config, &road(2), &[Object; 40]), [Ground; 40]);
        assert_eq!(classify_with(&config, &road(3), &[Object; 40])[3..], [Object; 37]);
        let minimum = UpwardGrowingConfig { low_quantile: 0.0, ..config };
        assert_eq!(classify_with(&minimum, &road(1), &[Object; 40])[1..], [Object; 39]);
    }

    #[test]
    fn noise_is_invisible_and_stays_noise() {
        let points = [[0, 0, -900], [0, 0, 0], [0, 0, 1], [50, 0, 0]];
        assert_eq!(
            classify_with(&UpwardGrowingConfig::default(), &points, &[LowNoise, LowNoise, Object, Object]),
            [LowNoise, LowNoise, Ground, Ground]
        );
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = UpwardGrowingConfig::default;
        for (config, key) in [
            (UpwardGrowingConfig { voxel: 0.0, ..default() }, "upward-growing.voxel = 0"),
            (UpwardGrowingConfig { block: 6.41, ..default() }, "upward-growing.block = 6.41"),
            (UpwardGrowingConfig { block: 0.04, ..default() }, "upward-growing.block = 0.04"),
            (UpwardGrowingConfig { height: f64::NAN, ..default() }, "upward-growing.height = NaN"),
            (UpwardGrowingConfig { low_quantile: 0.51, ..default() }, "upward-growing.low_quantile = 0.51"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
        UpwardGrowingConfig { block: 6.4, ..default() }.validate().unwrap();
    }
}
