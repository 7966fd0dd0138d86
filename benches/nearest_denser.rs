//! Ways to find the nearest denser voxel of the same component within 13 voxels, one thread, over all voxels
//! of a scene: the step of `density-peaks` that is a ball query per voxel if one does not think.
//!
//! `CHAINAGE_BENCH_FILE=scan.laz cargo bench --bench nearest_denser`; without it a synthetic street.
//! Throughput is in voxels. All ways must find the same distances, which is checked first; the way taken
//! lives in `cluster::density_peaks`, the others only here. Heights above ground are taken from the lowest
//! voxel of the column: densities are a little different from those of a run, searches are not.
//!
//! - `column order`: columns by their distance in the plane; in a column from the nearest voxel outwards to
//!   the first denser one; ends when the next column is further than what was found.
//! - `column maxima` (taken): the same, and columns whose densest voxel is not denser are passed over unseen.
//! - `stencil`: all 9,000 steps within the ball by their length, a look-up in a hash map for each, to the
//!   first denser one.
//! - `growing ball`: a kd-tree over the voxels, balls of 1.5, 3, 6 and 13 voxels until one holds a denser
//!   voxel.
//! - `ball`: one ball of 13 voxels.
#![expect(clippy::print_stdout, reason = "a bench prints what it found beside its times")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "indices of voxels and squared distances of at most 169"
)]

use std::hint::black_box;
use std::ops::Range;

use chainage::ground::{IsolatedNoise, NoiseConfig, VoxelColumn, VoxelColumnConfig};
use chainage::model::TileCloud;
use chainage::spatial::{CellMap, DisjointSets, VoxelIndex};
use common::{AnyError, classify, objects};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rustc_hash::FxHashMap;

mod common;

const VOXEL_UNITS: u32 = 300;
const REACH: i64 = 13;
const D_T: f64 = 5.0;
/// No denser voxel within reach.
const NONE: i64 = REACH * REACH;

struct Voxels {
    columns: Vec<[i32; 2]>,
    first: Vec<usize>,
    k: Vec<i32>,
    column_of: Vec<usize>,
    /// Place in the order of densities: smaller is denser.
    rank: Vec<u32>,
    component: Vec<u32>,
    places: CellMap<u32>,
}

impl Voxels {
    fn new(cloud: &TileCloud) -> Result<Self, AnyError> {
        let index = VoxelIndex::build("bench", cloud, VOXEL_UNITS)?;
        let columns: Vec<[i32; 2]> = index.columns().iter().map(|c| c.map(|i| i as i32)).collect();
        let k: Vec<i32> = index.heights().iter().map(|&k| k as i32).collect();
        let mut first: Vec<usize> = (0..columns.len()).map(|c| index.column_voxels(c).start).collect();
        first.push(k.len());
        let mut places = CellMap::default();
        let mut column_of = vec![0; k.len()];
        for (column, &cell) in columns.iter().enumerate() {
            *places.entry(cell) = column as u32 + 1;
            column_of[first[column]..first[column + 1]].fill(column);
        }
        let mut voxels =
            Self { columns, first, rank: vec![0; k.len()], k, column_of, component: Vec::new(), places };
        voxels.rank(index.counts());
        voxels.component = voxels.components();
        Ok(voxels)
    }

    fn column(&self, cell: [i32; 2]) -> Range<usize> {
        match self.places.get(cell) as usize {
            0 => 0..0,
            place => self.first[place - 1]..self.first[place],
        }
    }

    /// Equation 3 of the paper.
    fn rank(&mut self, counts: &[u32]) {
        let most = f64::from(counts.iter().copied().max().unwrap_or(1));
        let mut density = Vec::with_capacity(self.k.len());
        for column in self.first.windows(2).map(|ends| ends[0]..ends[1]) {
            let lowest = self.k[column.start];
            let mut start = column.start;
            while start < column.end {
                let end =
                    (start + 1..column.end).find(|&v| self.k[v] - self.k[v - 1] != 1).unwrap_or(column.end);
                let length = (end - start) as f64;
                for (position, (&count, &k)) in counts[start..end].iter().zip(&self.k[start..end]).enumerate()
                {
                    let rho = length - position as f64 / length + f64::from(count) / most;
                    let above = f64::from(k - lowest);
                    density.push(if above >= D_T { rho / above } else { rho });
                }
                start = end;
            }
        }
        let mut order: Vec<usize> = (0..density.len()).collect();
        order.sort_by(|&a, &b| density[b].total_cmp(&density[a]).then(self.k[a].cmp(&self.k[b])));
        for (rank, voxel) in (0..).zip(order) {
            self.rank[voxel] = rank;
        }
    }

    fn components(&self) -> Vec<u32> {
        let mut sets = DisjointSets::new(self.k.len() as u32);
        for voxel in 0..self.k.len() {
            let [i, j] = self.columns[self.column_of[voxel]];
            for [di, dj] in [[0, 0], [0, 1], [1, -1], [1, 0], [1, 1]] {
                for other in self.column([i + di, j + dj]) {
                    if (self.k[other] - self.k[voxel]).abs() <= 1 {
                        sets.union(voxel as u32, other as u32);
                    }
                }
            }
        }
        (0..self.k.len() as u32).map(|voxel| sets.find(voxel)).collect()
    }

    fn fits(&self, other: usize, voxel: usize) -> bool {
        self.rank[other] < self.rank[voxel] && self.component[other] == self.component[voxel]
    }

    fn sum(&self, mut distance: impl FnMut(usize, [i32; 2], i32) -> i64) -> i64 {
        let of = |voxel: usize| distance(voxel, self.columns[self.column_of[voxel]], self.k[voxel]);
        (0..self.k.len()).map(of).sum()
    }

    /// Squared distance of the nearest denser voxel of a column, if it is below `best`.
    fn in_column(&self, range: Range<usize>, voxel: usize, k: i32, across: i64, best: i64) -> i64 {
        let middle = range.start + self.k[range.clone()].partition_point(|&height| height < k);
        let distance = |other: usize| across + i64::from(self.k[other] - k).pow(2);
        let up = (middle..range.end).take_while(|&o| distance(o) < best).find(|&o| self.fits(o, voxel));
        let best = up.map_or(best, distance);
        let mut down = (range.start..middle).rev().take_while(|&o| distance(o) < best);
        down.find(|&o| self.fits(o, voxel)).map_or(best, distance)
    }

    fn column_order(&self, steps: &[(i64, [i32; 2])], maxima: Option<&[u32]>) -> i64 {
        let mut places = self.places.cursor();
        self.sum(|voxel, [i, j], k| {
            let mut best = NONE;
            for &(across, [di, dj]) in steps.iter().take_while(|step| step.0 < NONE) {
                if across >= best {
                    break;
                }
                let place = places.get([i + di, j + dj]) as usize;
                if place == 0 || maxima.is_some_and(|maxima| maxima[place - 1] >= self.rank[voxel]) {
                    continue;
                }
                best = self.in_column(self.first[place - 1]..self.first[place], voxel, k, across, best);
            }
            best
        })
    }

    fn stencil(&self, steps: &[(i64, [i32; 3])], at: &FxHashMap<[i32; 3], u32>) -> i64 {
        self.sum(|voxel, [i, j], k| {
            let mut nearer = steps.iter().filter(|(_, [di, dj, dk])| {
                at.get(&[i + di, j + dj, k + dk]).is_some_and(|&other| self.fits(other as usize, voxel))
            });
            nearer.next().map_or(NONE, |step| step.0)
        })
    }

    fn balls(&self, tree: &ImmutableKdTree<f32, 3>, radii: &[f32]) -> i64 {
        self.sum(|voxel, [i, j], k| {
            let place = [i, j, k].map(|index| index as f32);
            for radius in radii {
                let mut best = NONE;
                let query = tree.query(&place);
                query.within::<SquaredEuclidean<f32>>(radius * radius).unsorted().visit(|found| {
                    if (found.distance as i64) < best && self.fits(found.item as usize, voxel) {
                        best = found.distance as i64;
                    }
                });
                if best < NONE {
                    return best;
                }
            }
            NONE
        })
    }
}

fn steps<const D: usize>() -> Vec<(i64, [i32; D])> {
    let reach = REACH as i32;
    let mut steps: Vec<(i64, [i32; D])> = vec![(0, [0; D])];
    for axis in 0..D {
        let longer = |&(length, step): &(i64, [i32; D])| {
            (-reach..=reach).map(move |by| {
                let mut step = step;
                step[axis] = by;
                (length + i64::from(by).pow(2), step)
            })
        };
        steps = steps.iter().flat_map(longer).filter(|step| step.0 < NONE).collect();
    }
    steps.sort_unstable();
    steps
}

#[expect(clippy::expect_used, reason = "a bench without points has nothing to time")]
fn searches(criterion: &mut Criterion) {
    run(criterion).expect("the file can be read and the kernels accept its points");
}

fn run(criterion: &mut Criterion) -> Result<(), AnyError> {
    let (cloud, _) = common::scene()?;
    let (noise, ground) =
        (IsolatedNoise::new(&NoiseConfig::default())?, VoxelColumn::new(&VoxelColumnConfig::default())?);
    let classes = classify(&noise, &ground, &cloud)?;
    let voxels = Voxels::new(&objects(&cloud, &classes))?;
    let (plane, space) = (steps::<2>(), steps::<3>());
    let maxima: Vec<u32> = voxels
        .first
        .windows(2)
        .map(|ends| voxels.rank[ends[0]..ends[1]].iter().copied().min().unwrap_or(u32::MAX))
        .collect();
    let places: Vec<[i32; 3]> = (0..voxels.k.len())
        .map(|voxel| {
            let [i, j] = voxels.columns[voxels.column_of[voxel]];
            [i, j, voxels.k[voxel]]
        })
        .collect();
    let at: FxHashMap<[i32; 3], u32> = places.iter().copied().zip(0..).collect();
    let rows: Vec<[f32; 3]> = places.iter().map(|place| place.map(|index| index as f32)).collect();
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(&rows).map_err(|error| format!("{error:?}"))?;
    // The last ball is open: distances are whole, so that 168.5 is as good.
    let (growing, one) = ([1.5, 3.0, 6.0, 168.5_f32.sqrt()], [168.5_f32.sqrt()]);
    let expected = voxels.column_order(&plane, None);
    println!("{} voxels, mean squared distance {}", rows.len(), expected as f64 / rows.len() as f64);
    let others = [
        voxels.column_order(&plane, Some(&maxima)),
        voxels.stencil(&space, &at),
        voxels.balls(&tree, &growing),
        voxels.balls(&tree, &one),
    ];
    assert_eq!(others, [expected; 4], "all ways find the same distances");

    let mut group = criterion.benchmark_group("nearest denser voxel");
    group.sample_size(10);
    group.throughput(Throughput::Elements(rows.len() as u64));
    group.bench_function("column order", |bencher| {
        bencher.iter(|| black_box(&voxels).column_order(&plane, None))
    });
    group.bench_function("column maxima", |bencher| {
        bencher.iter(|| black_box(&voxels).column_order(&plane, Some(&maxima)))
    });
    group.bench_function("stencil", |bencher| bencher.iter(|| black_box(&voxels).stencil(&space, &at)));
    group
        .bench_function("growing ball", |bencher| bencher.iter(|| black_box(&voxels).balls(&tree, &growing)));
    group.bench_function("ball", |bencher| bencher.iter(|| black_box(&voxels).balls(&tree, &one)));
    group.finish();
    Ok(())
}

criterion_group!(benches, searches);
criterion_main!(benches);
