//! Crowns of small trees: places with many tree voxels above them. A tree whose stem is hidden behind others
//! is found by its crown.
//!
//! Tree voxels are counted in cells of the plane and smoothed with a kernel that grows with the height of the
//! canopy. The peaks of this field are crowns. A peak is a tree of its own if no stem claims it, and if the
//! field falls far enough on the way to every higher peak nearby. This is the density peak of Rodriguez and
//! Laio (2014, doi:10.1126/science.1242072) in the plane, with the prominence of a peak instead of the
//! distance to the next higher one. All sums are integers, and all distances are local, so the result does
//! not depend on tiles.
#![expect(
    clippy::cast_possible_truncation,
    reason = "heights in lattice units fit i32; sums over a kernel are clamped to u32"
)]

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::cluster::columns::{Columns, Finder, Voxel, disc};
use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::shares::{BUILDING, TREE};
use crate::model::Lattice;
use crate::spatial::Cell;

/// Edge of a cell in voxels: 0.3 m.
const CELL: i32 = 2;
/// Lowest height of the tree voxels that are counted, in metres. Below are hedges and stems.
const LOW_M: f64 = 0.9;
/// Radius of the kernel in cells, by the height of the canopy in metres. Its standard deviation is about a
/// tenth of the height, which separates small trees 2.5 m apart.
const KERNELS: [(f64, i32); 3] = [(3.5, 3), (5.0, 4), (f64::INFINITY, 5)];
/// Radius within which the canopy is searched, in cells.
const CANOPY: i32 = 5;
/// Radius within which rivals of a peak are searched, in cells: 3.9 m.
const RIVAL: i32 = 13;
/// Share of its value at a peak to which the field must fall on the way to every higher peak, in percent.
const SADDLE: u64 = 60;
/// Distance within which a stem claims a peak, as a fraction of the canopy height at the peak. Crowns lean,
/// one side of a crown may be hidden, and large crowns have lobes. A street tree is about half as wide as it
/// is high.
const CLAIM: f64 = 0.3;
/// Largest distance within which a stem claims a peak, in metres.
const CLAIM_M: f64 = 4.0;
/// Smallest field of a crown: a quarter of a voxel per cell. With one voxel, sparse drives lose trees
/// (`benches/results/street.md`, "Few points").
const LEAST: u32 = ONE as u32 / 4;
/// Lowest and highest canopy of a tree that is found by its crown, in metres. The scanner sees small trees
/// from above their stems, so the trees in front hide the stems behind them. It sees below the crowns of high
/// trees. Without the upper limit, trees found increase from 576 to 605 of 805 on smalltrees_opt, and false
/// pieces from 13 to 25 on suburb_ts1.
const TOP_M: (f64, f64) = (2.0, 6.0);
/// Field below which a crown may have any height: two voxels per cell. So few points of such a crown are seen
/// that its stem is mostly not among them (`benches/results/street.md`, "Few points").
const SPARSE: u32 = 2 * ONE as u32;
/// Distance from the peak in the plane within which voxels are the core of the tree, in metres.
const CORE_M: f64 = 0.45;
/// One voxel per cell in the units of the field.
const ONE: u64 = 1024;

/// Distance within which voxels decide about the crowns of a tile, in metres.
pub(crate) const REACH_M: f64 =
    (RIVAL + KERNELS[2].1.midpoint(1) + KERNELS[2].1 + CANOPY + 2) as f64 * CELL as f64 * EDGE_M;

/// A peak.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Crown {
    /// Its cell.
    pub(crate) cell: Cell,
    /// The first tree voxel of the cell.
    pub(crate) first: Voxel,
    /// Where it stands, in lattice units.
    pub(crate) place: [i64; 2],
    /// Height above ground of the highest tree voxel around it, in lattice units.
    top: i32,
    field: u32,
    /// Higher peaks nearby, each with the lowest value of the field on the way to it.
    rivals: Vec<(Cell, u32)>,
}

/// Weights, each with the step to its cell.
type Kernel = Vec<(u64, [i32; 2])>;

/// The counts in the cells around a tile.
struct Field<'a> {
    cells: Columns,
    /// Tree and building voxels, height of the canopy in lattice units, and first tree voxel of each cell.
    trees: Vec<u32>,
    buildings: Vec<u32>,
    top: Vec<i32>,
    first: Vec<usize>,
    /// Height in lattice units up to which each kernel is used.
    kernels: Vec<(i32, Kernel)>,
    canopy: Vec<[i32; 2]>,
    around: &'a Classified,
}

impl<'a> Field<'a> {
    fn new(around: &'a Classified, class: &[u8], lattice: Lattice) -> Self {
        let low = lattice.units(LOW_M) as i32;
        let mut of_cell: BTreeMap<Cell, (u32, u32, i32, usize)> = BTreeMap::new();
        for (voxel, [i, j, _]) in around.voxels.key.iter().enumerate() {
            let tree = class[voxel] == TREE && around.height[voxel] >= low;
            if tree || class[voxel] == BUILDING {
                let cell = [i.div_euclid(CELL), j.div_euclid(CELL)];
                let entry = of_cell.entry(cell).or_insert((0, 0, i32::MIN, usize::MAX));
                if tree {
                    entry.0 += 1;
                    entry.2 = entry.2.max(around.height[voxel]);
                    entry.3 = entry.3.min(voxel);
                } else {
                    entry.1 += 1;
                }
            }
        }
        let kernels = KERNELS.iter().map(|&(height_m, radius)| {
            let height = if height_m.is_finite() { lattice.units(height_m) as i32 } else { i32::MAX };
            (height, kernel(radius))
        });
        Self {
            cells: Columns::new(of_cell.keys().map(|&[i, j]| [i, j, 0])),
            trees: of_cell.values().map(|cell| cell.0).collect(),
            buildings: of_cell.values().map(|cell| cell.1).collect(),
            top: of_cell.values().map(|cell| cell.2).collect(),
            first: of_cell.values().map(|cell| cell.3).collect(),
            kernels: kernels.collect(),
            canopy: disc(i64::from(CANOPY * CANOPY)).into_iter().map(|step| step.1).collect(),
            around,
        }
    }

    /// Height above ground of the highest tree voxel around a cell, in lattice units.
    fn canopy(&self, finder: &mut Finder<'_>, [i, j]: Cell) -> i32 {
        let around = self.canopy.iter().filter_map(|[di, dj]| finder.number([i + di, j + dj]));
        around.map(|cell| self.top[cell]).max().unwrap_or(i32::MIN)
    }

    /// Number of the kernel at a cell.
    fn kernel(&self, finder: &mut Finder<'_>, cell: Cell) -> usize {
        let top = self.canopy(finder, cell);
        self.kernels.iter().position(|kernel| top < kernel.0).unwrap_or(self.kernels.len() - 1)
    }

    /// The smoothed number of tree voxels at a cell, in steps of 1 / [`ONE`].
    fn at(&self, finder: &mut Finder<'_>, cell @ [i, j]: Cell) -> u32 {
        let kernel = self.kernel(finder, cell);
        let steps = self.kernels[kernel].1.iter();
        let weighted = steps.map(|(weight, [di, dj])| {
            let trees = finder.number([i + di, j + dj]).map_or(0, |cell| self.trees[cell]);
            weight * u64::from(trees)
        });
        weighted.sum::<u64>().min(u64::from(u32::MAX)) as u32
    }

    /// Whether there are more tree voxels than building voxels around a cell.
    fn is_green(&self, finder: &mut Finder<'_>, [i, j]: Cell) -> bool {
        let mut trees = 0;
        let mut buildings = 0;
        for cell in self.canopy.iter().filter_map(|[di, dj]| finder.number([i + di, j + dj])) {
            trees += self.trees[cell];
            buildings += self.buildings[cell];
        }
        trees > buildings
    }
}

/// The steps of a kernel (1 - d² / r²)², whose weights sum to about [`ONE`].
fn kernel(radius: i32) -> Kernel {
    let square = i64::from(radius).pow(2);
    let steps = disc(square);
    let weight = |d: i64| (square - d).unsigned_abs().pow(2);
    let sum: u64 = steps.iter().map(|step| weight(step.0)).sum();
    steps.into_iter().map(|(d, step)| (weight(d) * ONE / sum, step)).collect()
}

/// The crowns around a tile: the peaks, and whether the tile owns each. `class` is the class of each voxel.
pub(crate) fn find(around: &Classified, class: &[u8], lattice: Lattice) -> Vec<(Crown, bool)> {
    let field = Field::new(around, class, lattice);
    let mut finder = field.cells.finder();
    let values: Vec<u32> = field.cells.cells().iter().map(|&cell| field.at(&mut finder, cell)).collect();
    let lowest = lattice.units(TOP_M.0) as i32;
    let highest = lattice.units(TOP_M.1) as i32;
    let mut peaks: Vec<usize> = Vec::new();
    for (number, &cell @ [i, j]) in field.cells.cells().iter().enumerate() {
        if field.trees[number] == 0 || values[number] < LEAST || field.top[number] < lowest {
            continue;
        }
        let radius = KERNELS[field.kernel(&mut finder, cell)].1.midpoint(1).max(3);
        let higher = disc(i64::from(radius * radius)).into_iter().any(|(_, [di, dj])| {
            finder.number([i + di, j + dj]).is_some_and(|other| {
                (values[other], std::cmp::Reverse(other)) > (values[number], std::cmp::Reverse(number))
            })
        });
        let may_stand = values[number] < SPARSE || field.canopy(&mut finder, cell) <= highest;
        if !higher && may_stand && field.is_green(&mut finder, cell) {
            peaks.push(number);
        }
    }
    let edge = lattice.units(EDGE_M);
    let crown = |&number: &usize| {
        let cell @ [i, j] = field.cells.cells()[number];
        let first = field.first[number];
        let owned = field.around.voxels.owned[first];
        let mut rivals = Vec::new();
        if owned {
            for &other in &peaks {
                let [u, v] = field.cells.cells()[other];
                let near = (u - i).pow(2) + (v - j).pow(2) <= RIVAL * RIVAL;
                if near && (values[other], other) > (values[number], number) {
                    rivals.push(([u, v], saddle(&field, &mut field.cells.finder(), cell, [u, v])));
                }
            }
        }
        let place = cell.map(|index| (2 * i64::from(index) + 1) * i64::from(CELL) * edge / 2);
        let first = field.around.voxels.key[first];
        let top = field.canopy(&mut field.cells.finder(), cell);
        (Crown { cell, first, place, top, field: values[number], rivals }, owned)
    };
    peaks.iter().map(crown).collect()
}

/// The lowest value of the field on the line between two cells.
fn saddle(field: &Field<'_>, finder: &mut Finder<'_>, [i, j]: Cell, [u, v]: Cell) -> u32 {
    let steps = (u - i).abs().max((v - j).abs());
    let between =
        |from: i32, to: i32, step: i32| from + (2 * (to - from) * step + steps).div_euclid(2 * steps);
    let cells = (1..steps).map(|step| [between(i, u, step), between(j, v, step)]);
    cells.map(|cell| field.at(finder, cell)).min().unwrap_or(u32::MAX)
}

/// The tree voxels of the tile that are in the core of a crown: number of the voxel among those around the
/// tile, and cell of the crown.
pub(crate) fn cores(
    around: &Classified,
    class: &[u8],
    crowns: &[(Crown, bool)],
    lattice: Lattice,
) -> Vec<(usize, Cell)> {
    let reach = lattice.units(CORE_M);
    let low = lattice.units(LOW_M) as i32;
    let edge = lattice.units(EDGE_M);
    let steps = disc((reach / edge + 1).pow(2));
    let mut finder = around.voxels.columns.finder();
    let mut nearest: BTreeMap<usize, (i64, Cell)> = BTreeMap::new();
    for (crown, _) in crowns {
        let [i, j] = crown.place.map(|value| value.div_euclid(edge) as i32);
        for (_, [di, dj]) in &steps {
            for voxel in finder.column([i + di, j + dj]) {
                let [x, y, _] = around.voxels.centre[voxel];
                let distance = (x - crown.place[0]).pow(2) + (y - crown.place[1]).pow(2);
                let of_tree = class[voxel] == TREE && around.height[voxel] >= low;
                if around.voxels.owned[voxel] && of_tree && distance <= reach * reach {
                    let found = (distance, crown.cell);
                    nearest.entry(voxel).and_modify(|best| *best = found.min(*best)).or_insert(found);
                }
            }
        }
    }
    nearest.into_iter().map(|(voxel, (_, cell))| (voxel, cell)).collect()
}

/// The crowns of the drive that are trees without a stem, in an order that does not depend on tiles.
pub(crate) fn without_stem(
    crowns: &[Crown],
    stems: impl Iterator<Item = [i64; 2]>,
    lattice: Lattice,
) -> Vec<&Crown> {
    let claim = lattice.units(CLAIM_M);
    let square = |place: [i64; 2]| place.map(|value| value.div_euclid(claim));
    let mut by_square: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for (number, crown) in crowns.iter().enumerate() {
        by_square.entry(square(crown.place)).or_default().push(number);
    }
    let mut claimed = BTreeSet::new();
    for stem in stems {
        let [i, j] = square(stem);
        let squares = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| [i, j]));
        for crown in
            squares.filter_map(|square| by_square.get(&square)).flatten().map(|&number| &crowns[number])
        {
            let [dx, dy] = [0, 1].map(|axis| (crown.place[axis] - stem[axis]) as f64);
            let reach = (CLAIM * f64::from(crown.top)).min(claim as f64);
            if dx * dx + dy * dy <= reach * reach {
                claimed.insert(crown.cell);
            }
        }
    }
    let rises = |crown: &Crown| {
        let flat = |(_, saddle): &(Cell, u32)| u64::from(*saddle) * 100 > SADDLE * u64::from(crown.field);
        !crown.rivals.iter().any(flat)
    };
    let mut alone: Vec<&Crown> =
        crowns.iter().filter(|crown| !claimed.contains(&crown.cell) && rises(crown)).collect();
    alone.sort_unstable_by_key(|crown| crown.first);
    alone
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::voxels::stored::Voxels;

    #[test]
    fn a_kernel_sums_to_one_and_is_highest_in_the_middle() {
        for (_, radius) in KERNELS {
            let kernel = kernel(radius);
            let sum: u64 = kernel.iter().map(|step| step.0).sum();
            assert!((ONE * 95 / 100..=ONE).contains(&sum), "{radius}: {sum}");
            assert!(kernel[0].1 == [0, 0] && kernel.iter().all(|step| step.0 <= kernel[0].0));
        }
    }

    fn crown(x_m: f64, top_m: f64, field: u32, rivals: &[(f64, u32)]) -> Crown {
        let cell = |x_m: f64| [(x_m / 0.3).round() as i32, 0];
        let lattice = Lattice::MILLIMETRE;
        Crown {
            cell: cell(x_m),
            first: [cell(x_m)[0] * CELL, 0, 0],
            place: [lattice.units(x_m), 0],
            top: lattice.units(top_m) as i32,
            field,
            rivals: rivals.iter().map(|&(x_m, saddle)| (cell(x_m), saddle)).collect(),
        }
    }

    fn alone(crowns: &[Crown], stems_m: &[f64]) -> Vec<[i64; 2]> {
        let lattice = Lattice::MILLIMETRE;
        let stems = stems_m.iter().map(|&x_m| [lattice.units(x_m), 0]);
        without_stem(crowns, stems, lattice).into_iter().map(|crown| crown.place).collect()
    }

    #[test]
    fn a_crown_without_a_stem_is_a_tree_if_it_rises_above_its_surroundings() {
        let first = || crown(0.0, 5.0, 5_000, &[]);
        // The field falls to 40 % and to 70 % of the lower peak.
        assert_eq!(alone(&[first(), crown(3.0, 5.0, 4_000, &[(0.0, 1_600)])], &[0.2]), [[3_000, 0]]);
        assert!(alone(&[first(), crown(3.0, 5.0, 4_000, &[(0.0, 2_800)])], &[0.2]).is_empty());
    }

    #[test]
    fn a_stem_claims_every_peak_within_a_part_of_the_height() {
        let crowns = [crown(0.0, 5.0, 5_000, &[]), crown(3.0, 5.0, 4_000, &[(0.0, 100)])];
        assert_eq!(alone(&crowns, &[1.4]), [[3_000, 0]]);
        assert!(alone(&crowns, &[1.5]).is_empty());
        assert_eq!(alone(&crowns, &[]), [[0, 0], [3_000, 0]]);
    }

    /// The fields of the crowns over these points, in millimetres. All are of trees.
    fn fields(points: &[[i64; 3]]) -> Vec<u32> {
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, points);
        let height = voxels.centre.iter().map(|centre| i32::try_from(centre[2]).unwrap()).collect();
        let count = voxels.len();
        let around = Classified { voxels, height, shares: vec![[0; 8]; count] };
        let crowns = find(&around, &vec![TREE; count], Lattice::MILLIMETRE);
        crowns.into_iter().map(|(crown, _)| crown.field).collect()
    }

    #[test]
    fn a_high_crown_needs_no_stem_if_few_points_are_seen_of_it() {
        // Balls with a radius of 1.5 m around a point. Their points are `step` millimetres apart.
        let ball = |x: i64, z: i64, step: usize| {
            let axis = || (-1_500..=1_500_i64).step_by(step);
            let all = axis().flat_map(move |a| axis().flat_map(move |b| axis().map(move |c| [a, b, c])));
            let inside = all.filter(|[a, b, c]| a * a + b * b + c * c <= 2_250_000);
            inside.map(|[a, b, c]| [x + a, b, z + c]).collect::<Vec<_>>()
        };
        // With every voxel filled, below and above 6 m.
        assert!(matches!(fields(&ball(0, 4_000, 150))[..], [field] if field > 10 * SPARSE));
        assert!(fields(&ball(0, 9_000, 150)).is_empty());
        let sparse = fields(&ball(0, 9_000, 600));
        assert!(matches!(sparse[..], [field] if (LEAST..SPARSE).contains(&field)), "{sparse:?}");
        // Two of them, 7 m apart.
        assert_eq!(fields(&[ball(0, 9_000, 600), ball(7_000, 9_000, 600)].concat()).len(), 2);
    }
}
