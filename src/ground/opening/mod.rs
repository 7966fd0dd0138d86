//! `opening`: points close above a surface from which objects have been removed are ground.
//!
//! Ours. It uses the morphological opening of the lowest points, as in Zhang et al., "A progressive
//! morphological filter for removing nonground measurements from airborne LIDAR data" (2003), and in Pingel,
//! Clarke, McBride, "An improved simple morphological filter for the terrain classification of airborne LIDAR
//! data" (2013). It opens only once, with a small disc, because a mobile scanner sees the ground beside
//! everything that stands on a road. It also uses the points that were classified as noise. Far from the
//! scanner, ground points are so sparse that they look like isolated noise (1 % of the true ground on
//! sparsely sampled streets). If such a point is ground, it stops being noise. The steps work on the columns
//! of voxels:
//!
//! 1. *Floor.* A quantile of the lowest layers of all columns in the surrounding 5 x 5 blocks, minus `depth`.
//!    A layer must contain a certain share of the points of its column, because most columns have points
//!    below a wet road or a reflecting facade, see `column_points.rs`. Points below the floor are multipath
//!    or stray returns. Where nothing but stems was seen below it, the floor lies at their feet, see
//!    `stems.rs`.
//! 2. *Low* of a column: its `lowest_points`-th lowest point above the floor, so that single returns do not
//!    count.
//! 3. *Surface*: the opening of the lows by a disc of `radius`: the minimum over the disc, then the maximum
//!    of these. It removes cars, hedges and trunks. It follows slopes, and never lies above a low. Where
//!    nothing but stems was seen, it is the minimum over the disc only, because most columns of a disc have
//!    no low near the ground there.
//! 4. *Ceiling.* The ground does not rise faster than `slope` over `slope_radius`. The surface stays below
//!    this ceiling. Crowns and roofs without ground below them lie above it. Where few columns have points,
//!    the ceiling rises more slowly, and a clear column of the next step must be empty to a greater height,
//!    see `sparse.rs`.
//! 5. A column is clear if it is empty between `height` and `clear` above the surface. There, points between
//!    `depth` below the surface and `height` above it are ground. So kerbs and rough ground are ground.
//! 6. Where an object stands, only points less than `close` above the surface are ground, and only if ground
//!    was seen there or beside it. Clear columns enclosed by walls are the floor of a room, and not ground.
//!    See `standing.rs`.
//!
//! All numbers are whole lattice units, so no result depends on an order. `benches/results/ground.md`
//! compares it with the other filters.
//!
//! Cost: O(points + columns * radius / voxel). Memory: 60 bytes per column beside the voxels. The bench is
//! `benches/kernels.rs`.
//!
//! Known failures. These become ground: the lowest `close` of walls, trunks and hedges beside ground; the
//! floor of a room at the height of the pavement behind a shop window without a sill; the lower rim of a
//! crown at the height of the ground beside it. These do not: terraces narrower than the disc; ground that
//! rises faster than `slope`; on slopes, a strip of one `radius` along the upper rim of the scan; small yards
//! between walls; a lawn below 3 m around a thick post, where nothing else was seen; in sparse places, ground
//! that rises faster than 15 %, and ground below crowns without clear ground beside it.

mod settings;
mod sparse;

pub use settings::OpeningConfig;

use std::f64::consts::SQRT_2;

use crate::config::{self, ConfigError};
use crate::ground::blocks::Blocks;
use crate::ground::column_points::Tile;
use crate::ground::filter::{GroundEntry, GroundFilter};
use crate::ground::lowest::{NONE, lowest_within};
use crate::ground::noise::voxel_edge;
use crate::ground::standing::{FOOT_REACH, Kind, Limits, has_ground};
use crate::ground::stems;
use crate::model::{AlgorithmError, Lattice, PointClass, Reach};
use crate::spatial::{TileView, VoxelIndex};
use sparse::Sparse;

pub(in crate::ground) const NAME: &str = "opening";

/// Number of columns along the edge of a block (chosen: 1.5 m by default, which is narrower than a lane).
const BLOCK: i64 = 5;

/// Number of blocks to each side whose lows determine the floor, and whose columns say whether a place is
/// sparse (chosen: 7.5 m by default, which is larger than a patch of multipath).
const FLOOR_REACH: i64 = 2;

/// Height of a stem in metres: a column is a stem if it is occupied without a gap from its lowest voxel up to
/// this height (chosen: above hedges and undergrowth).
const STEM_M: f64 = 2.0;

/// Height of a wall in metres: an object in a column is a wall if the highest voxel begins at least this far
/// above the surface (chosen: above cars and hedges).
const WALL_M: f64 = 1.2;

/// Ground was seen at the foot of an object if more points lie at the surface there than this number plus
/// [`FOOT_SHARE`] times the points between `height` and `clear` (chosen: a wall alone has the lowest two).
const FOOT_POINTS: f64 = 2.0;
/// Points at the surface that belong to the object there, per point of it between `height` and `clear`
/// (chosen: a wall alone has a sixth, 6 of 40 cm).
const FOOT_SHARE: f64 = 0.3;

pub(in crate::ground) const ENTRY: GroundEntry = GroundEntry {
    name: NAME,
    summary: "points close above the opening of the lowest points",
    reference: "ours; opening of lows as in Zhang et al. 2003, doi:10.1109/TGRS.2003.810682, and Pingel et al. 2013, \
                doi:10.1016/j.isprsjprs.2012.12.002",
    build: |table| Ok(Box::new(Opening::new(&config::section(NAME, table)?)?)),
};

/// The filter, see the module.
#[derive(Debug, Clone)]
pub struct Opening {
    config: OpeningConfig,
}

impl Opening {
    /// The filter with these settings.
    ///
    /// # Errors
    /// Those of [`OpeningConfig::validate`].
    pub fn new(config: &OpeningConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }

    /// `slope_radius` in blocks.
    fn slope_blocks(&self, lattice: Lattice) -> i64 {
        lattice.units(self.config.slope_radius) / (BLOCK * lattice.units(self.config.voxel))
    }

    /// `room` in columns.
    fn room_columns(&self, lattice: Lattice) -> i64 {
        lattice.units(self.config.room) / lattice.units(self.config.voxel)
    }

    fn sparse(&self) -> Sparse {
        Sparse { share: self.config.sparse }
    }

    /// The surface of each column as a local z; [`NONE`] where it has no low.
    fn surface(&self, tile: &Tile<'_>, blocks: &Blocks, filled: &[f64]) -> Vec<u32> {
        let (lattice, sparse) = (tile.lattice, self.sparse());
        let mut lows = tile.lowest_layers();
        let depth = lattice.units(self.config.depth);
        let is_stem = stems::columns(tile.index, lattice.units(STEM_M));
        let floors = blocks.floors(&lows, &is_stem, FLOOR_REACH, self.config.low_quantile, units_of(depth));
        let mut first = Vec::new();
        for (column, low) in lows.iter_mut().enumerate().filter(|(_, low)| **low != NONE) {
            let floor = i64::from(floors[blocks.of(column)].at) - depth;
            *low = tile.low_above(column, floor, self.config.lowest_points as usize, &mut first);
        }
        let eroded_only = |column: usize| floors[blocks.of(column)].of_stems;
        let mut surface = opening(tile.index, lattice.units(self.config.radius), &lows, eroded_only);
        let edge = (BLOCK * i64::from(tile.index.grid().edge)) as f64;
        let rise = |block: usize| sparse.slope(filled[block], self.config.slope) * edge;
        let ceilings = blocks.ceilings(&surface, self.slope_blocks(lattice), rise);
        for (column, surface) in surface.iter_mut().enumerate().filter(|(_, surface)| **surface != NONE) {
            *surface = ceilings[blocks.of(column)].min(*surface);
        }
        surface
    }
}

/// The opening of `lows` by a disc, never above the lows themselves; [`NONE`] stays. In columns that are
/// `eroded_only`, only its first half: the minimum over the disc.
fn opening(
    index: &VoxelIndex,
    radius_units: i64,
    lows: &[u32],
    eroded_only: impl Fn(usize) -> bool,
) -> Vec<u32> {
    // A maximum is a minimum of complements. The complement of a value is its difference to the largest value
    // below NONE.
    let turned = |value: u32| if value == NONE { NONE } else { NONE - 1 - value };
    let mut eroded = lowest_within(index, radius_units, lows);
    for (eroded, &low) in eroded.iter_mut().zip(lows) {
        *eroded = if low == NONE { NONE } else { turned(*eroded) };
    }
    let dilated = lowest_within(index, radius_units, &eroded);
    let opened = |column: usize| if eroded_only(column) { eroded[column] } else { dilated[column] };
    lows.iter()
        .enumerate()
        .map(|(column, &low)| if low == NONE { NONE } else { turned(opened(column)).min(low) })
        .collect()
}

/// Lengths of the settings in lattice units.
#[derive(Clone, Copy)]
struct Heights {
    depth: i64,
    close: i64,
    height: i64,
    clear: i64,
    wall: i64,
}

impl Heights {
    fn new(config: &OpeningConfig, lattice: Lattice) -> Self {
        let [depth, close, height, clear, wall] =
            [config.depth, config.close, config.height, config.clear, WALL_M]
                .map(|metres| lattice.units(metres));
        Self { depth, close, height, clear, wall }
    }

    /// The kind of a column, from the heights of its points above the surface and of its highest voxel.
    fn kind(&self, near: &[(usize, i64)], top: i64) -> Kind {
        let within = |low, high| near.iter().filter(|&&(_, above)| low <= above && above < high).count();
        match within(self.height, self.clear) {
            0 => Kind::Clear,
            standing => Kind::Standing {
                wall: top >= self.wall,
                ground: within(-self.depth, self.close) as f64 > FOOT_POINTS + FOOT_SHARE * standing as f64,
            },
        }
    }
}

/// A length or number that is not negative.
fn units_of(value: i64) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

impl GroundFilter for Opening {
    fn name(&self) -> &'static str {
        NAME
    }

    fn microseconds_per_point(&self) -> f64 {
        1.5
    }

    /// The sum of these distances: across a column; to the far corner of a block `slope_radius` away; twice
    /// the radius of the disc; to the far corner of the blocks that determine the floor, which also say
    /// whether a place is sparse; and across a room.
    fn reach(&self, lattice: Lattice) -> Reach {
        let voxel_m = lattice.metres(lattice.units(self.config.voxel));
        let block_m = voxel_m * BLOCK as f64 * SQRT_2;
        let slope_m = block_m * self.slope_blocks(lattice) as f64 / SQRT_2 + block_m;
        let floor_m = block_m * (FLOOR_REACH + 1) as f64;
        let columns = self.room_columns(lattice) + 1 + FOOT_REACH;
        let standing_m = voxel_m * columns as f64 * SQRT_2;
        Reach::Exact { metres: voxel_m * SQRT_2 + slope_m + 2.0 * self.config.radius + floor_m + standing_m }
    }

    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        let cloud = view.cloud();
        let lattice = cloud.lattice;
        let index = view.voxels(NAME, voxel_edge(lattice, self.config.voxel))?;
        let tile = Tile::new(cloud, index);
        let blocks = Blocks::new(tile.index, BLOCK);
        let filled = blocks.filled(FLOOR_REACH);
        let surface = self.surface(&tile, &blocks, &filled);
        let heights = Heights::new(&self.config, lattice);
        let in_sparse = Heights { clear: heights.clear.max(lattice.units(sparse::CLEAR_M)), ..heights };
        let sparse = self.sparse();
        let mut near = Vec::new();
        let kinds: Vec<Kind> = surface
            .iter()
            .enumerate()
            .map(|(column, &surface)| {
                if surface == NONE {
                    return Kind::Unseen;
                }
                let is_sparse = sparse.is(filled[blocks.of(column)]);
                let heights = if is_sparse { in_sparse } else { heights };
                tile.near(column, surface, heights.clear.max(heights.close), &mut near);
                heights.kind(&near, tile.top(column) - i64::from(surface))
            })
            .collect();
        let limits = Limits {
            step: units_of(heights.height),
            close: units_of(heights.close),
            room: units_of(self.room_columns(lattice)),
        };
        let ground = has_ground(index, &surface, &kinds, limits);
        for (column, &surface) in surface.iter().enumerate().filter(|&(column, _)| ground[column]) {
            let top =
                if kinds[column] == Kind::Clear { heights.close.max(heights.height) } else { heights.close };
            tile.near(column, surface, top, &mut near);
            for &(point, _) in near.iter().filter(|&&(_, above)| -heights.depth <= above && above < top) {
                classes[point] = PointClass::Ground;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TileCloud;
    use PointClass::{Ground, LowNoise, Object};

    fn classify(points: &[[i64; 3]], class: PointClass) -> Vec<PointClass> {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut classes = vec![class; points.len()];
        let filter = Opening::new(&OpeningConfig::default()).unwrap();
        filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
        classes
    }

    /// Three points in each column of 30 x 30 columns, 9 m of a plane that rises by `rise` mm per column
    /// along x.
    fn plane(rise: i64) -> Vec<[i64; 3]> {
        let columns = (0..30).flat_map(|i| (0..30).map(move |j| (i, j)));
        columns.flat_map(|(i, j)| [40, 150, 260].map(|at| [i * 300 + at, j * 300 + at, i * rise])).collect()
    }

    /// The classes of points beside those of a plane. The whole plane must be ground.
    fn on(plane: &[[i64; 3]], points: &[[i64; 3]]) -> Vec<PointClass> {
        let classes = classify(&[plane, points].concat(), Object);
        assert!(classes[..plane.len()].iter().all(|class| *class == Ground));
        classes[plane.len()..].to_vec()
    }

    #[test]
    fn returns_below_the_road_take_nothing_from_the_ground() {
        // Single returns 0.1 to 5 m below, and ten multipath returns in one column.
        for below in [-100, -200, -400, -600, -5_000] {
            let expected = if below > -300 { Ground } else { Object };
            assert_eq!(on(&plane(0), &[[4_500, 4_500, below]]), [expected], "{below}");
        }
        assert_eq!(on(&plane(0), &[[4_500, 4_500, -2_000]; 10]), [Object; 10]);
        // A reflection below the road is as high as a stem, but there is a gap between it and the road.
        let mirrored: Vec<_> = (10..50).map(|k| [4_500, 4_500, k * -100]).collect();
        assert_eq!(on(&plane(0), &mirrored), [Object; 40]);
    }

    #[test]
    fn returns_below_most_of_the_road_take_nothing_from_the_ground() {
        // 60 points of road in each column. Below two of three columns there are 1 to 5 returns, down to 9 m.
        let columns = || (0..30_i64).flat_map(|i| (0..30).map(move |j| (i, j)));
        let road: Vec<_> = columns()
            .flat_map(|(i, j)| {
                (0..60).map(move |k| [i * 300 + k * 37 % 300, j * 300 + k * 11 % 300, k % 5 * 10])
            })
            .collect();
        let below: Vec<_> = columns()
            .filter(|(i, j)| (i + j) % 3 > 0)
            .flat_map(|(i, j)| (0..1 + (i * 7 + j) % 5).map(move |k| (i, j, k)))
            .map(|(i, j, k)| {
                [i * 300 + 150, j * 300 + 150, -500 - (i * 1_700 + j * 2_900 + k * 4_100) % 8_500]
            })
            .collect();
        let classes = on(&road, &below);
        assert!(classes.iter().all(|class| *class == Object));
    }

    #[test]
    fn crowns_are_no_ground_where_stems_are_all_that_was_seen_below() {
        // Stems of four columns, 3 m apart, through a crown whose lows are at 6 to 18 m, or through a road.
        let places = [1_350, 1_650, 4_350, 4_650, 7_350, 7_650];
        let stem = |x: i64| places.iter().flat_map(move |&y| (0..80).map(move |k| [x, y, k * 100]));
        let stems: Vec<_> = places.iter().flat_map(|&x| stem(x)).collect();
        let ground_above = |height: fn(i64, i64) -> i64| {
            let above = plane(0).into_iter().map(|[x, y, _]| [x, y, height(x / 300, y / 300)]);
            let classes = classify(&[stems.clone(), above.collect()].concat(), Object);
            classes.iter().skip(stems.len()).filter(|class| **class == Ground).count()
        };
        assert_eq!(ground_above(|i, j| 6_000 + (i * 7 + j * 11) % 31 * 400), 0);
        assert!(ground_above(|_, _| 6_000) > 2_500);
    }

    #[test]
    fn kerbs_are_ground_and_the_foot_of_a_wall_is_not() {
        let kerb = [[4_500, 4_500, 120], [4_500, 4_500, 299], [4_500, 4_500, 300]];
        assert_eq!(on(&plane(0), &kerb[..2]), [Ground; 2]);
        assert_eq!(on(&plane(0), &kerb), [Object; 3]);
        // A point 0.7 m above the ground leaves the column clear.
        assert_eq!(on(&plane(0), &[[4_500, 4_500, 120], [4_500, 4_500, 700]]), [Ground, Object]);
        assert_eq!(
            on(&plane(0), &[[4_500, 4_500, 59], [4_500, 4_500, 60], [4_500, 4_500, 699]]),
            [Ground, Object, Object]
        );
    }

    #[test]
    fn slopes_are_ground_and_what_floats_above_them_is_not() {
        // 27 degrees: 0.15 m in a column of 0.3 m. The disc finds nothing beyond the upper rim, and cuts it.
        let points = [plane(150), vec![[4_500, 4_500, 6_000]; 3]].concat();
        let (seen, classes) = (points.len() - 3, classify(&points, Object));
        assert!(
            points[..seen].iter().zip(&classes).all(|(point, class)| *class == Ground || point[0] > 7_800)
        );
        assert_eq!(classes[seen..], [Object; 3]);
        // A roof of 1.8 m x 1.8 m, 3 m above the plane, is cut away even where it hides the ground.
        let roof: Vec<_> = plane(0)
            .into_iter()
            .map(|[x, y, z]| {
                let hidden = (3_600..5_400).contains(&x) && (3_600..5_400).contains(&y);
                [x, y, if hidden { z + 3_000 } else { z }]
            })
            .collect();
        let classes = classify(&roof, Object);
        assert!(classes.iter().zip(&roof).all(|(class, point)| (*class == Ground) == (point[2] == 0)));
    }

    #[test]
    fn a_lawn_around_a_post_is_ground_where_nothing_else_was_seen() {
        // 6 m x 6 m with nine points in each column, and a post of 2 m in the middle.
        let places = || (0..60).flat_map(|i| (0..60).map(move |j| [i * 100 + 50, j * 100 + 50, 0]));
        let post = (1..=40).map(|step| [3_050, 3_050, step * 50]);
        let points: Vec<_> = places().chain(post).collect();
        let classes = classify(&points, Object);
        assert!(classes[..3_600].iter().all(|class| *class == Ground));
        assert!(classes[3_601..].iter().all(|class| *class == Object));
    }

    /// Two rings of 24 m on ground, one 0.1 m above the other, and more rings behind them on a wall or on
    /// ground.
    #[test]
    fn rings_far_from_the_scanner_are_ground_only_if_they_are_little_above_the_nearest() {
        let rings = |rings: &[[i64; 2]]| {
            let ring = |&[y, z]: &[i64; 2]| (0..160).map(move |place| [place * 150, y, z]);
            rings.iter().flat_map(ring).collect::<Vec<_>>()
        };
        let grounds = |far: &[[i64; 2]], sparse: f64| {
            let cloud = TileCloud::from_lattice_points(
                Lattice::MILLIMETRE,
                &rings(&[&[[0, 0], [4_500, 100]], far].concat()),
            );
            let filter = Opening::new(&OpeningConfig { sparse, ..OpeningConfig::default() }).unwrap();
            let mut classes = vec![Object; cloud.len()];
            filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
            classes.chunks(160).map(|ring| ring.iter().all(|class| *class == Ground)).collect::<Vec<_>>()
        };
        assert_eq!(grounds(&[[9_000, 500]], 0.2), [true; 3]);
        assert_eq!(grounds(&[[9_000, 1_800]], 0.2), [true, true, false]);
        assert_eq!(grounds(&[[9_000, 1_800]], 0.0), [true; 3]);
        // The next ring on the wall is 2 m higher. The wall stands on ground that was not seen.
        assert_eq!(grounds(&[[9_000, 500], [9_000, 2_500]], 0.2), [true, true, false, false]);
        assert_eq!(grounds(&[[9_000, 500], [9_000, 2_500]], 0.0), [true, true, true, false]);
    }

    #[test]
    fn thin_ground_is_no_noise_and_noise_that_is_not_ground_stays() {
        let points = [[0, 0, 0], [10, 0, 20], [1_000, 0, 0], [1_010, 0, 10], [1_020, 0, 2_000]];
        assert_eq!(classify(&points, LowNoise), [Ground, Ground, Ground, Ground, LowNoise]);
        assert_eq!(classify(&[], Object), []);
    }
}
