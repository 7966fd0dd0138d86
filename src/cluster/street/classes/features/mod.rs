//! Features of voxels: the numbers by which the classifier distinguishes classes.
//!
//! *Scales.* Shapes of the surroundings within 0.3 m (voxels), 0.6 m (cubes of 0.3 m), 1.35 m (cubes of 0.45
//! m) and 2.2 m (cubes of 0.9 m; facades are flat there, crowns are not). Windows of the raster of 0.3 m
//! columns up to 3.6 m. The features of a voxel use nothing beyond [`REACH_EDGES`] in the plane. No feature
//! counts points, because their number depends on the scanner and on its distance. A voxel or a cube is
//! either occupied or not.
//!
//! *Exact.* Every sum is an integer, every mean is rounded down on the global lattice, and the rest is a
//! fixed sequence of IEEE operations. So a feature depends only on the voxels and heights within reach.
//!
//! *Cost.* Features of a column are computed once for its voxels, and those of a cube once for the voxels in
//! it. Only a ball of 0.3 m remains to be computed per voxel. It is found by lower bounds that move up the
//! surrounding columns.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32 (VoxelIndex)")]

mod block;
mod cells;
pub(crate) mod context;
mod raster;
mod shape;

use self::block::{Block, COLUMN, blocks};
use self::cells::Cells;
use self::shape::{Shape, balls};
use crate::cluster::street::voxels::stored::Voxels;

/// Distance within which other voxels change a feature, in edges of a voxel: the corner of a window of 21
/// columns of 0.3 m, and a disc of 12 such columns, whichever is further. Including the outermost columns in
/// full, it is at most 25 edges per axis.
pub(in crate::cluster) const REACH_EDGES: i64 = 36;

/// Names of the features, in their order.
pub(crate) const NAMES: [&str; 80] = [
    "H", "n2", "lin2", "pla2", "sca2", "nz2", "vz2", "off2", "n4", "lin4", "pla4", "sca4", "nz4", "vz4",
    "off4", "nc", "linc", "plac", "scac", "nzc", "vzc", "offc", "rbelow", "rabove", "cmax", "cmin", "ccnt",
    "prof0_1", "prof1_1", "prof2_1", "prof3_1", "prof4_1", "prof5_1", "prof6_1", "prof7_1", "prof0_5",
    "prof1_5", "prof2_5", "prof3_5", "prof4_5", "prof5_5", "prof6_5", "prof7_5", "occ_1", "occ_2", "occ_5",
    "occ_10", "hmax_2", "hmax_5", "hmax_10", "isolv", "lev3", "p2lin5", "p2min5", "p2maj5", "p2off5",
    "p2lin12", "p2min12", "p2maj12", "p2off12", "p2tlin", "p2tmin", "p2tmaj", "p2toff", "tall4", "lev1",
    "dens_5", "slice_1", "slice_2", "slice_5", "slice_10", "conc_5", "conc_10", "nw", "linw", "plaw", "scaw",
    "nzw", "vzw", "offw",
];

/// Squared radii of the balls, in edges of the voxel or cube. The radius is about 2.5 edges on all scales,
/// except 3.5 on the scale of 0.45 m.
const BALL: i64 = 6;
const BALL_COARSE: i64 = 12;

/// Edges of the cubes in voxels: 0.3, 0.45 and 0.9 m.
const MIDDLE: i32 = 2;
const COARSE: i32 = 3;
const WIDE: i32 = 6;

/// Largest number of empty voxels that a vertical run may step over, plus one.
const RUN_STEP: i32 = 3;

/// Voxels per call of the sink.
const ROWS: usize = 4_096;

/// Takes the numbers of some voxels, and their features: `NAMES.len()` values per voxel.
pub(crate) type Sink<'a> = &'a mut dyn FnMut(&[u32], &[f32]);

/// Computes the features of the wanted voxels and gives them to `sink`, in batches, each voxel once. The
/// order is not defined. `heights` are the heights of all voxels above ground, in lattice units.
pub(crate) fn compute(voxels: &Voxels, heights: &[i32], wanted: &[bool], sink: Sink<'_>) {
    let fine = Scale::voxels(voxels, wanted);
    let middle = Scale::cubes(voxels, wanted, MIDDLE, BALL);
    let coarse = Scale::cubes(voxels, wanted, COARSE, BALL_COARSE);
    let wide = Scale::cubes(voxels, wanted, WIDE, BALL);
    let runs = runs(voxels);
    let Some(columns) = &middle.cells else { return };
    let in_column = wanted_columns(columns, wanted);
    let mut block = Block::new(columns, heights, voxels.lattice);
    let step_m = voxels.lattice.step_m() as f32;
    let mut finder = voxels.columns.finder();
    let mut numbers: Vec<u32> = Vec::with_capacity(ROWS);
    let mut rows: Vec<f32> = Vec::with_capacity(ROWS * NAMES.len());
    for at in blocks(columns, |column| in_column[column]) {
        block.compute(at, |column| in_column[column]);
        for (&(column, _), of_column) in block.wanted.iter().zip(&block.column) {
            let [i, j] = columns.columns.cells()[column as usize].map(|index| index * MIDDLE);
            for cell in [[i, j], [i, j + 1], [i + 1, j], [i + 1, j + 1]] {
                for voxel in finder.column(cell).filter(|&voxel| wanted[voxel]) {
                    if numbers.len() == ROWS {
                        sink(&numbers, &rows);
                        numbers.clear();
                        rows.clear();
                    }
                    numbers.push(voxel as u32);
                    rows.push(heights[voxel] as f32 * step_m);
                    for scale in [&fine, &middle, &coarse] {
                        rows.extend(scale.features(voxels, voxel, step_m));
                    }
                    rows.extend(runs[voxel].map(|length| length as f32));
                    rows.extend::<[f32; COLUMN]>(*of_column);
                    let slices = block.slices[columns.of_voxel[voxel] as usize].map(f32::from);
                    rows.extend(slices);
                    rows.extend([slices[0] / slices[2], slices[1] / slices[3]]);
                    rows.extend(wide.features(voxels, voxel, step_m));
                }
            }
        }
    }
    if !numbers.is_empty() {
        sink(&numbers, &rows);
    }
}

/// The shapes around voxels or cubes of one size.
struct Scale {
    shapes: Vec<Shape>,
    /// The cubes; `None` for voxels.
    cells: Option<Cells>,
}

impl Scale {
    fn voxels(voxels: &Voxels, wanted: &[bool]) -> Self {
        let mut shapes = vec![Shape::default(); voxels.len()];
        balls(&voxels.columns, &voxels.centre, wanted, BALL, |voxel, moments| {
            shapes[voxel] = Shape::of(moments);
        });
        Self { shapes, cells: None }
    }

    fn cubes(voxels: &Voxels, wanted: &[bool], edge: i32, radius2: i64) -> Self {
        let cells = Cells::of(voxels, edge);
        let mut inside = vec![false; cells.len()];
        for (&cube, &wanted) in cells.of_voxel.iter().zip(wanted) {
            inside[cube as usize] |= wanted;
        }
        let mut shapes = vec![Shape::default(); cells.len()];
        balls(&cells.columns, &cells.centre, &inside, radius2, |cube, moments| {
            shapes[cube] = Shape::of(moments);
        });
        Self { shapes, cells: Some(cells) }
    }

    fn features(&self, voxels: &Voxels, voxel: usize, step_m: f32) -> [f32; shape::COUNT] {
        let Some(cells) = &self.cells else { return self.shapes[voxel].features([0; 3], step_m) };
        let cube = cells.of_voxel[voxel] as usize;
        let from = [0, 1, 2].map(|axis| voxels.centre[voxel][axis] - cells.centre[cube][axis]);
        self.shapes[cube].features(from, step_m)
    }
}

/// Whether each column of cubes contains a wanted voxel.
fn wanted_columns(cells: &Cells, wanted: &[bool]) -> Vec<bool> {
    let mut cube_wanted = vec![false; cells.len()];
    for (&cube, &wanted) in cells.of_voxel.iter().zip(wanted) {
        cube_wanted[cube as usize] |= wanted;
    }
    let count = cells.columns.cells().len();
    (0..count).map(|column| cube_wanted[cells.columns.voxels(column)].contains(&true)).collect()
}

/// Number of voxels from each voxel down to the lower end of its vertical run, and up to the upper end. A run
/// steps over up to two empty voxels.
fn runs(voxels: &Voxels) -> Vec<[i32; 2]> {
    let mut runs = Vec::with_capacity(voxels.len());
    for column in 0..voxels.columns.cells().len() {
        let k = &voxels.columns.heights()[voxels.columns.voxels(column)];
        for run in k.chunk_by(|low, high| high - low <= RUN_STEP) {
            let (Some(bottom), Some(top)) = (run.first(), run.last()) else { continue };
            runs.extend(run.iter().map(|k| [k - bottom, top - k]));
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::Lattice;

    const LATTICE: Lattice = Lattice::MILLIMETRE;

    /// Poles, walls, crowns and dust over an area of 16 m by 12 m around a corner of four blocks.
    fn scene(seed: u64) -> Vec<[i64; 3]> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut points = Vec::new();
        let place =
            |rng: &mut ChaCha8Rng| [rng.random_range(-8_000..8_000_i64), rng.random_range(-6_000..6_000)];
        for _ in 0..6 {
            let [x, y] = place(&mut rng);
            points.extend((0..5_000).step_by(90).map(|z| [x, y, z + 10]));
            let spread = rng.random_range(300..1_500_i64);
            for _ in 0..150 {
                let by = [(); 3].map(|()| rng.random_range(-spread..spread));
                points.push([x + by[0], y + by[1], 5_000 + by[2]]);
            }
        }
        let [_, y] = place(&mut rng);
        for x in (-6_000..6_000).step_by(130) {
            points.extend((200..3_500).step_by(140).map(|z| [x, y + x / 7, z]));
        }
        for _ in 0..150 {
            let [x, y] = place(&mut rng);
            points.push([x, y, rng.random_range(-500..14_000)]);
        }
        points
    }

    /// The features of the wanted voxels by key. Heights are those above z = 0.
    fn features(voxels: &Voxels, wanted: &[bool]) -> Vec<([i32; 3], Vec<u32>)> {
        let heights: Vec<i32> =
            voxels.centre.iter().map(|centre| i32::try_from(centre[2]).unwrap()).collect();
        let mut found = Vec::new();
        compute(voxels, &heights, wanted, &mut |numbers, rows| {
            assert_eq!(rows.len(), numbers.len() * NAMES.len());
            for (&number, row) in numbers.iter().zip(rows.chunks_exact(NAMES.len())) {
                assert!(row.iter().all(|value| value.is_finite()), "{row:?}");
                found.push((voxels.key[number as usize], row.iter().map(|value| value.to_bits()).collect()));
            }
        });
        found.sort_unstable();
        assert_eq!(found.len(), wanted.iter().filter(|wanted| **wanted).count(), "each voxel once");
        found
    }

    fn value(row: &[u32], name: &str) -> f32 {
        f32::from_bits(row[NAMES.iter().position(|other| *other == name).unwrap()])
    }

    #[test]
    fn features_are_the_same_whatever_lies_beyond_the_reach() {
        let edge = 150;
        let mut compared = 0;
        for seed in 0..6 {
            let points = scene(seed);
            let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
            // An origin anywhere on the lattice of blocks and cubes.
            let shift = [(); 3].map(|()| rng.random_range(-200_000..200_000_i64));
            let shift = if seed % 2 == 0 { [0; 3] } else { shift };
            let points: Vec<[i64; 3]> =
                points.iter().map(|point| [0, 1, 2].map(|axis| point[axis] + shift[axis])).collect();
            let all = Voxels::of_points(LATTICE, &points);
            let whole = features(&all, &vec![true; all.len()]);
            let one = points[rng.random_range(0..points.len())];
            let middle = [0, 1].map(|axis| one[axis]);
            let inside =
                |key: [i32; 3]| (0..2).all(|axis| (i64::from(key[axis]) * edge - middle[axis]).abs() < 1_000);
            // Whole columns within reach of a wanted one, as they are loaded.
            let wanted: Vec<[i32; 3]> = all.key.iter().copied().filter(|&key| inside(key)).collect();
            let gap = |a: i32, b: i32| (i64::from(a.abs_diff(b)) - 1).max(0);
            let near = |point: &&[i64; 3]| {
                let key = point.map(|value| i32::try_from(value.div_euclid(edge)).unwrap());
                wanted
                    .iter()
                    .any(|w| gap(w[0], key[0]).pow(2) + gap(w[1], key[1]).pow(2) <= REACH_EDGES.pow(2))
            };
            let part: Vec<[i64; 3]> = points.iter().filter(near).copied().collect();
            assert!(part.len() < points.len(), "something is left out");
            let part = Voxels::of_points(LATTICE, &part);
            let mask: Vec<bool> = part.key.iter().map(|&key| inside(key)).collect();
            let cut = features(&part, &mask);
            compared += cut.len();
            let expected: Vec<_> = whole.into_iter().filter(|row| inside(row.0)).collect();
            for (cut, expected) in cut.iter().zip(&expected) {
                for (name, (a, b)) in NAMES.iter().zip(cut.1.iter().zip(&expected.1)) {
                    assert_eq!(a, b, "{name} of {:?}, seed {seed}", cut.0);
                }
            }
            assert_eq!(cut, expected);
        }
        assert!(compared > 500, "{compared} voxels");
    }

    #[test]
    fn counts_are_those_of_brute_force() {
        let voxels = Voxels::of_points(LATTICE, &scene(7));
        let rows = features(&voxels, &vec![true; voxels.len()]);
        let cube = |key: [i32; 3], edge: i32| key.map(|index| index.div_euclid(edge));
        let distinct = |mut keys: Vec<[i32; 3]>| {
            keys.sort_unstable();
            keys.dedup();
            keys.len() as f32
        };
        for (key, row) in rows.iter().step_by(97) {
            let [i, j, k] = *key;
            let square = |other: &[i32; 3]| (0..3).map(|axis| (other[axis] - key[axis]).pow(2)).sum::<i32>();
            let ball = voxels.key.iter().filter(|other| square(other) <= 6).count();
            assert!((value(row, "n2") - ball as f32).abs() < 0.5);
            for (edge, radius2, name) in [(2, 6, "n4"), (3, 12, "nc"), (6, 6, "nw")] {
                let own = cube(*key, edge);
                let near = voxels.key.iter().map(|other| cube(*other, edge)).filter(|other| {
                    (0..3).map(|axis| (other[axis] - own[axis]).pow(2)).sum::<i32>() <= radius2
                });
                assert!((value(row, name) - distinct(near.collect())).abs() < 0.5, "{name}");
            }
            let [ci, cj, _] = cube(*key, 2);
            let window = |reach: i32| {
                voxels.key.iter().copied().filter(move |other| {
                    let [oi, oj, _] = cube(*other, 2);
                    (oi - ci).abs() <= reach && (oj - cj).abs() <= reach
                })
            };
            for reach in [1, 2, 5, 10] {
                let columns = window(reach).map(|other| [other[0].div_euclid(2), other[1].div_euclid(2), 0]);
                let found = value(row, &format!("occ_{reach}"));
                assert!((found - distinct(columns.collect())).abs() < 0.5, "occ_{reach}");
                let slice = window(reach).filter(|other| other[2].div_euclid(4) == k.div_euclid(4));
                let cells = slice.map(|other| [other[0].div_euclid(2), other[1].div_euclid(2), 0]);
                let found = value(row, &format!("slice_{reach}"));
                assert!((found - distinct(cells.collect())).abs() < 0.5, "slice_{reach}");
            }
            for reach in [1, 5] {
                let cubes = distinct(window(reach).map(|other| cube(other, 2)).collect());
                let bands: f32 = (0..8).map(|band| value(row, &format!("prof{band}_{reach}"))).sum();
                assert!((bands - cubes).abs() < 0.5, "prof_{reach}");
            }
            for reach in [2, 5, 10] {
                let top = window(reach).map(|key| voxels.centre[voxels.find(key).unwrap()][2]).max().unwrap();
                let top = LATTICE.metres(top.max(-1_000)) as f32;
                assert!((value(row, &format!("hmax_{reach}")) - top).abs() < 1e-4, "hmax_{reach}");
            }
            let levels =
                |reach: i32| distinct(window(reach).map(|other| [0, 0, other[2].div_euclid(4)]).collect());
            assert!((value(row, "lev1") - levels(0)).abs() < 0.5);
            assert!((value(row, "lev3") - levels(1)).abs() < 0.5);
            let own = voxels.key.iter().filter(|other| other[0] == i && other[1] == j);
            let runs: Vec<i32> = own.map(|other| other[2]).collect();
            let run = runs.chunk_by(|low, high| high - low <= 3).find(|run| run.contains(&k)).unwrap();
            assert!((value(row, "rbelow") - (k - run[0]) as f32).abs() < 0.5);
            assert!((value(row, "rabove") - (run[run.len() - 1] - k) as f32).abs() < 0.5);
        }
    }

    #[test]
    fn shapes_are_those_of_a_wall_and_a_pole() {
        let mut points = Vec::new();
        for z in (0..4_000).step_by(60) {
            points.extend((0..4_000).step_by(60).map(|x| [x, 75, z]));
            points.push([20_075, 75, z]);
        }
        let voxels = Voxels::of_points(LATTICE, &points);
        let rows = features(&voxels, &vec![true; voxels.len()]);
        let at = |key: [i32; 3]| &rows[rows.binary_search_by_key(&key, |row| row.0).unwrap()].1;
        for scale in ["2", "4", "c", "w"] {
            let of = |key, name: &str| value(at(key), &format!("{name}{scale}"));
            let wall = [13, 0, 13];
            assert!(of(wall, "pla") > 0.8 && of(wall, "nz") < 0.05 && of(wall, "off") < 0.01, "{scale}");
            let pole = [133, 0, 13];
            assert!(of(pole, "lin") > 0.95 && of(pole, "vz") > 0.99, "{scale}");
        }
        assert!(value(at([133, 0, 13]), "isolv") >= 6.0);
        assert!(value(at([13, 0, 13]), "isolv") < 1.0);
        assert!(value(at([13, 0, 13]), "p2lin12") > 0.9);
    }
}
