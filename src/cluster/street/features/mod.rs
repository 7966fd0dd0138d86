//! Features of voxels: numbers from which the classifier tells classes apart.
//!
//! *Scales.* Shapes of what is within 0.3 m (voxels), 0.6 m (cubes of 0.3 m), 1.35 m (cubes of 0.45 m) and
//! 2.2 m (cubes of 0.9 m; facades are flat there, crowns are not). Windows of the raster of 0.3 m columns up to
//! 3.6 m. A voxel sees nothing that is further away than [`REACH_EDGES`] horizontally. No feature counts points:
//! their number depends on the scanner and on its distance. A voxel or a cube is occupied or not.
//!
//! *Exact.* Every sum is an integer, every mean is rounded down on the global lattice, and the rest is a fixed
//! sequence of IEEE operations. So a feature depends only on the voxels and heights within reach.
//!
//! *Cost.* Features of a column are computed once for its voxels, and those of a cube once for the voxels in
//! it. What remains per voxel is a ball of 0.3 m, found by lower bounds that move up the columns around it.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32 (VoxelIndex)")]

mod block;
mod cells;
mod eigen;
mod raster;
mod shape;

use self::block::{Block, COLUMN, blocks};
use self::cells::Cells;
use self::shape::{Shape, balls};
use super::voxels::Voxels;

/// Distance within which other voxels change a feature, in edges of a voxel: the corner of a window of 21
/// columns of 0.3 m, and a disc of 12 such columns, whichever is further. With the rest of the outermost
/// columns it is 25 edges per axis at most.
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

/// Squared radii of the balls, in edges of the voxel or cube: 2 and a half on all scales, except 3.5 on that of
/// 0.45 m.
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

/// Computes the features of the wanted voxels and gives them to `sink`, some at a time and each voxel once. The
/// order is not defined. `heights` are those of all voxels above ground, in lattice units.
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

/// Which columns of cubes contain wanted voxels.
fn wanted_columns(cells: &Cells, wanted: &[bool]) -> Vec<bool> {
    let mut cube_wanted = vec![false; cells.len()];
    for (&cube, &wanted) in cells.of_voxel.iter().zip(wanted) {
        cube_wanted[cube as usize] |= wanted;
    }
    let count = cells.columns.cells().len();
    (0..count).map(|column| cube_wanted[cells.columns.voxels(column)].contains(&true)).collect()
}

/// Number of voxels down to the end of the run in the column of each voxel, and up to its other end. A run
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
