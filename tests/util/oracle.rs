//! Brute-force references: the methods taken literally over all pairs of points, in O(n^2) or worse. They
//! share no code with the library and are deliberately slow. Points are lattice coordinates, lengths are
//! lattice units.

use std::collections::BTreeSet;

/// Points of isolated noise: 0 for none, 2 for low and 3 for high noise. With `keep_sparse`, cubes have
/// 1.5 m, and `voxel` must divide that.
pub(crate) fn noise(
    points: &[[i64; 3]],
    [voxel, high]: [i64; 2],
    min_points: usize,
    keep_sparse: bool,
) -> Vec<u8> {
    let voxels: Vec<[i64; 3]> = points.iter().map(|p| p.map(|value| value.div_euclid(voxel))).collect();
    let components =
        components(points.len(), |a, b| (0..3).all(|axis| (voxels[a][axis] - voxels[b][axis]).abs() <= 1));
    let size = |point: usize| components.iter().filter(|&&other| other == components[point]).count();
    let cube = |point: usize| points[point].map(|value| value.div_euclid(1_500));
    let is_sparse = |point: usize| {
        let near = |other: &usize| (0..3).all(|axis| (cube(point)[axis] - cube(*other)[axis]).abs() <= 1);
        let around: Vec<usize> = (0..points.len()).filter(near).collect();
        let occupied: BTreeSet<[i64; 3]> = around.iter().map(|&other| voxels[other]).collect();
        keep_sparse && (12..=150).contains(&around.len()) && around.len() <= 4 * occupied.len()
    };
    let is_noise: Vec<bool> =
        (0..points.len()).map(|point| size(point) < min_points && !is_sparse(point)).collect();
    let verdict = |point: usize| {
        if !is_noise[point] {
            return 0;
        }
        let lowest = (0..points.len())
            .filter(|&other| !is_noise[other] && beside(voxels[point], voxels[other], voxel) <= 1_500 * 1_500)
            .map(|other| voxels[other][2])
            .min();
        match lowest {
            Some(lowest) if (voxels[point][2] - lowest) * voxel > high => 3,
            _ => 2,
        }
    };
    (0..points.len()).map(verdict).collect()
}

/// Whether each point is ground by `voxel-column`, with its lengths and `lowest_points`. Points with `hidden`
/// set are ignored.
pub(crate) fn voxel_column(
    points: &[[i64; 3]],
    hidden: &[bool],
    [voxel, run_height, step, radius]: [i64; 4],
    lowest_points: usize,
) -> Vec<bool> {
    let voxels: Vec<[i64; 3]> = points.iter().map(|p| p.map(|value| value.div_euclid(voxel))).collect();
    let occupied = |wanted: [i64; 3]| (0..points.len()).any(|p| !hidden[p] && voxels[p] == wanted);
    let lowest_of = |[i, j, _]: [i64; 3]| {
        let in_column = |p: &usize| !hidden[*p] && voxels[*p][0] == i && voxels[*p][1] == j;
        let column: Vec<i64> = (0..points.len()).filter(in_column).map(|p| voxels[p][2]).collect();
        let count = |k: i64| column.iter().filter(|&&other| other == k).count();
        let sure = column.iter().copied().filter(|&k| count(k) >= lowest_points).min();
        sure.or_else(|| column.iter().copied().min())
    };
    let is_ground = |point: usize| {
        let [i, j, k] = voxels[point];
        let Some(low) = lowest_of(voxels[point]).filter(|_| !hidden[point]) else { return false };
        let mut length = 0;
        while occupied([i, j, low + length]) {
            length += 1;
        }
        let lowest_near = (0..points.len())
            .filter(|&other| !hidden[other] && beside(voxels[point], voxels[other], voxel) <= radius * radius)
            .filter_map(|other| lowest_of(voxels[other]))
            .min();
        (low..low + length).contains(&k)
            && length * voxel < run_height
            && (low - lowest_near.unwrap_or(low)) * voxel < step
    };
    (0..points.len()).map(is_ground).collect()
}

/// Whether each point is ground by `upward-growing`, by walking up from every voxel. `block` is in voxels,
/// the quantile is 0.05.
pub(crate) fn upward_growing(
    points: &[[i64; 3]],
    hidden: &[bool],
    [voxel, block, height]: [i64; 3],
) -> Vec<bool> {
    let voxels: Vec<[i64; 3]> = points.iter().map(|p| p.map(|value| value.div_euclid(voxel))).collect();
    let block_of = |[i, j, _]: [i64; 3]| [i.div_euclid(block), j.div_euclid(block)];
    let is_ground = |point: usize| {
        let home = block_of(voxels[point]);
        let seen = |p: &usize| !hidden[*p] && block_of(voxels[*p]) == home;
        let inside: Vec<[i64; 3]> = (0..points.len()).filter(seen).map(|p| voxels[p]).collect();
        let mut columns: Vec<[i64; 2]> = inside.iter().map(|v| [v[0], v[1]]).collect();
        columns.sort_unstable();
        columns.dedup();
        let low_of = |c: &[i64; 2]| inside.iter().filter(|v| [v[0], v[1]] == *c).map(|v| v[2]).min();
        let mut lows: Vec<i64> = columns.iter().filter_map(low_of).collect();
        lows.sort_unstable();
        let low = lows[lows.len() / 20];
        let (mut reached, mut top) = (vec![voxels[point]], voxels[point][2]);
        while !reached.is_empty() {
            let above = |v: &&[i64; 3]| {
                reached
                    .iter()
                    .any(|r| v[2] == r[2] + 1 && (v[0] - r[0]).abs() <= 1 && (v[1] - r[1]).abs() <= 1)
            };
            reached = inside.iter().filter(above).copied().collect();
            reached.sort_unstable();
            reached.dedup();
            top = reached.first().map_or(top, |v| v[2]);
        }
        (top - low) * voxel < height
    };
    (0..points.len()).map(|point| !hidden[point] && is_ground(point)).collect()
}

/// The settings of `opening`: lengths in lattice units, and counts.
pub(crate) struct Opening {
    pub(crate) voxel: i64,
    pub(crate) lowest_points: usize,
    pub(crate) depth: i64,
    pub(crate) radius: i64,
    pub(crate) slope_radius: i64,
    pub(crate) close: i64,
    pub(crate) height: i64,
    pub(crate) clear: i64,
    /// A share of the columns.
    pub(crate) sparse: f64,
    /// In columns.
    pub(crate) room: i64,
}

impl Opening {
    /// The share of columns with points among the 25 x 25 columns of the surrounding blocks.
    fn filled(&self, columns: &[[i64; 2]], at: usize) -> f64 {
        let near = |c: &&[i64; 2]| {
            let apart = |axis: usize| columns[at][axis].div_euclid(5) - c[axis].div_euclid(5);
            apart(0).abs().max(apart(1).abs()) <= 2
        };
        columns.iter().filter(near).count() as f64 / 625.0
    }

    /// 0.15 at a share of `sparse` or less, 1 at half as much again or more, and in proportion between them.
    fn slope(&self, filled: f64) -> f64 {
        if filled >= 1.5 * self.sparse {
            1.0
        } else {
            0.15 + ((filled - self.sparse) / (1.5 * self.sparse - self.sparse)).max(0.0) * (1.0 - 0.15)
        }
    }
}

/// Whether each point is ground by `opening` with the quantile 0.1 and a slope of 1, column by column.
#[expect(clippy::cast_possible_truncation, reason = "rises of a few metres")]
pub(crate) fn opening(points: &[[i64; 3]], of: &Opening) -> Vec<bool> {
    let column = |p: usize| [points[p][0].div_euclid(of.voxel), points[p][1].div_euclid(of.voxel)];
    let block = |c: [i64; 2]| c.map(|value| value.div_euclid(5));
    let mut columns: Vec<[i64; 2]> = (0..points.len()).map(column).collect();
    columns.sort_unstable();
    columns.dedup();
    let heights = |c: [i64; 2]| {
        let mut z: Vec<i64> = (0..points.len()).filter(|&p| column(p) == c).map(|p| points[p][2]).collect();
        z.sort_unstable();
        z
    };
    let heights: Vec<Vec<i64>> = columns.iter().map(|&c| heights(c)).collect();
    let near = |a: [i64; 2], b: [i64; 2], radius: i64| {
        ((a[0] - b[0]).pow(2) + (a[1] - b[1]).pow(2)) * of.voxel.pow(2) <= radius.pow(2)
    };
    let floor = |at: usize| floor(&columns, &heights, at, of);
    let low = |at: usize| {
        let floor = floor(at).0 - of.depth;
        let above: Vec<i64> = heights[at].iter().copied().filter(|&z| z >= floor).collect();
        above.get(of.lowest_points - 1).or(above.last()).copied()
    };
    let lows: Vec<Option<i64>> = (0..columns.len()).map(low).collect();
    let all = 0..columns.len();
    let within = |at: usize| {
        let beside = |other: &usize| lows[*other].is_some() && near(columns[at], columns[*other], of.radius);
        all.clone().filter(beside).collect::<Vec<_>>()
    };
    let lowest_around = |at: usize| within(at).iter().filter_map(|&other| lows[other]).min();
    let eroded: Vec<Option<i64>> = all.clone().map(lowest_around).collect();
    let highest_around = |at: usize| within(at).iter().filter_map(|&other| eroded[other]).max();
    let opened = |at: usize| {
        let surface = if floor(at).1 { eroded[at] } else { highest_around(at) };
        Some(surface?.min(lows[at]?))
    };
    let opened: Vec<Option<i64>> = all.clone().map(opened).collect();
    let edge = 5 * of.voxel;
    let surface = |at: usize| {
        let here = block(columns[at]);
        let apart = |other: usize| {
            let there = block(columns[other]);
            (here[0] - there[0]).pow(2) + (here[1] - there[1]).pow(2)
        };
        let rise = of.slope(of.filled(&columns, at)) * edge as f64;
        let ceiling = (0..columns.len())
            .filter(|&other| apart(other) <= (of.slope_radius / edge).pow(2))
            .filter_map(|other| Some(opened[other]? + (rise * ((apart(other) as f64).sqrt() + 1.0)) as i64))
            .min();
        Some(opened[at]?.min(ceiling?))
    };
    let surfaces: Vec<Option<i64>> = all.clone().map(surface).collect();
    let keeps_ground = standing(&columns, &heights, &surfaces, of);
    let ground_in = |at: usize| {
        let stands = keeps_ground[at]?;
        Some(
            surfaces[at]? - of.depth..surfaces[at]? + if stands { of.close } else { of.height.max(of.close) },
        )
    };
    let ground: Vec<_> = (0..columns.len()).map(ground_in).collect();
    let is_ground = |p: usize| {
        let at = columns.binary_search(&column(p)).ok()?;
        Some(ground[at].clone()?.contains(&points[p][2]))
    };
    (0..points.len()).map(|p| is_ground(p).unwrap_or(false)).collect()
}

/// The height at which the ground of a column begins, and whether only stems were seen there.
fn floor(columns: &[[i64; 2]], heights: &[Vec<i64>], at: usize, of: &Opening) -> (i64, bool) {
    let is_stem = |at: usize| {
        let begins = heights[at][0].div_euclid(of.voxel);
        let occupied = |k: i64| heights[at].iter().any(|z| z.div_euclid(of.voxel) == k);
        let top = (begins..).find(|&k| !occupied(k)).unwrap();
        (top - begins) * of.voxel >= 2_000
    };
    let block = |c: [i64; 2]| c.map(|value| value.div_euclid(5));
    let near = |other: usize| {
        let (b, c) = (block(columns[at]), block(columns[other]));
        (0..2).all(|axis| (b[axis] - c[axis]).abs() <= 2)
    };
    let others: Vec<usize> = (0..columns.len()).filter(|&other| near(other)).collect();
    // The lowest point of the lowest voxel that, together with the voxel above it, has more than a sixteenth
    // of the points or 8 of them.
    let first = |other: usize| {
        let column = &heights[other];
        let voxel = |z: i64| z.div_euclid(of.voxel);
        let layer =
            |z: i64| column.iter().filter(|above| [0, 1].contains(&(voxel(**above) - voxel(z)))).count();
        let holds = |z: &&i64| layer(**z) > (column.len() / 16).min(8);
        *column.iter().find(holds).unwrap_or(&column[0])
    };
    let mut firsts: Vec<i64> = others.iter().map(|&other| first(other)).collect();
    firsts.sort_unstable();
    let level = firsts[firsts.len() / 10];
    let below = |other: &usize| is_stem(*other) && first(*other) < level - of.depth;
    let stems: Vec<i64> = others.iter().copied().filter(below).map(first).collect();
    let at_level = firsts.iter().filter(|first| (*first - level).abs() <= of.depth).count();
    let only_stems = stems.len() >= 3 && 2 * stems.len() >= at_level;
    if only_stems { (stems.into_iter().min().unwrap_or(level), true) } else { (level, false) }
}

/// Whether something stands in each column; `None` if the column has no ground.
fn standing(
    columns: &[[i64; 2]],
    heights: &[Vec<i64>],
    surfaces: &[Option<i64>],
    of: &Opening,
) -> Vec<Option<bool>> {
    let apart = |a: usize, b: usize| {
        (0..2).map(|axis| (columns[a][axis] - columns[b][axis]).abs()).max().unwrap_or(0)
    };
    let count = |at: usize, low: i64, high: i64| {
        let above = heights[at].iter().filter_map(|z| Some(z - surfaces[at]?));
        above.filter(|above| (low..high).contains(above)).count()
    };
    let clear = |at: usize| {
        if of.filled(columns, at) < of.sparse { of.clear.max(6_000) } else { of.clear }
    };
    let standing = |at: usize| count(at, of.height, clear(at));
    let stands = |at: usize| standing(at) > 0;
    let is_clear = |at: usize| surfaces[at].is_some() && !stands(at);
    let is_wall = |at: usize| {
        let top = heights[at].iter().max().map(|z| z.div_euclid(of.voxel) * of.voxel);
        stands(at) && surfaces[at].zip(top).is_some_and(|(surface, top)| top - surface >= 1_200)
    };
    let differ = |a: usize, b: usize| surfaces[a].zip(surfaces[b]).map(|(a, b)| (a - b).abs());
    let patch = components(columns.len(), |a, b| {
        let is_level = differ(a, b).is_some_and(|step| step < of.height);
        apart(a, b) == 1 && is_clear(a) && is_clear(b) && is_level
    });
    let is_room = |at: usize| {
        let members: Vec<usize> = (0..columns.len()).filter(|&other| patch[other] == patch[at]).collect();
        let extent = |axis: usize| {
            let along = || members.iter().map(|&member| columns[member][axis]);
            along().max().unwrap_or(0) - along().min().unwrap_or(0)
        };
        let mut border = Vec::new();
        for &member in &members {
            border.extend(
                (0..columns.len()).filter(|&other| apart(member, other) == 1 && patch[other] != patch[at]),
            );
        }
        let mut walls: Vec<usize> = border.iter().copied().filter(|&other| is_wall(other)).collect();
        let enclosed = 4 * walls.len() > border.len();
        walls.sort_unstable();
        walls.dedup();
        let circumference = 2 * (extent(0) + 1 + extent(1) + 1);
        let enough = 10 * i64::try_from(walls.len()).unwrap() > circumference;
        extent(0).max(extent(1)) < of.room && enclosed && enough
    };
    let mut is_open = Vec::new();
    for at in 0..columns.len() {
        is_open.push(is_clear(at) && !is_room(at));
    }
    (0..columns.len())
        .map(|at| {
            let seen = count(at, -of.depth, of.close) as f64 > 2.0 + 0.3 * standing(at) as f64;
            let beside = |other: usize| {
                let is_level = differ(at, other).is_some_and(|step| step <= of.close);
                apart(at, other) <= 3 && is_level && is_open[other]
            };
            let foot = || stands(at) && (seen || (0..columns.len()).any(beside));
            if is_open[at] { Some(false) } else { foot().then_some(true) }
        })
        .collect()
}

/// Single-link clusters: for each point, the smallest index of a point connected with it.
pub(crate) fn single_link(points: &[[i64; 3]], distance: i64) -> Vec<usize> {
    components(points.len(), |a, b| {
        let squares = (0..3).map(|axis| (points[a][axis] - points[b][axis]).pow(2));
        squares.sum::<i64>() <= distance * distance
    })
}

/// `dbscan`, variant `size`, over all pairs: 0 for noise, clusters numbered by their smallest index. `near`
/// is the squared distance of two points.
pub(crate) fn dbscan_size(
    count: usize,
    near: impl Fn(usize, usize) -> i64,
    limit: i64,
    min_points: usize,
    max_points: usize,
) -> Vec<u32> {
    let names = components(count, |a, b| near(a, b) <= limit);
    numbered(&names.into_iter().map(Some).collect::<Vec<_>>(), min_points, max_points)
}

/// `dbscan`, variant `core`, over all pairs. Border points go to the nearest core point, ties to the smaller
/// place.
pub(crate) fn dbscan_core<P: Ord>(
    count: usize,
    near: impl Fn(usize, usize) -> i64,
    place: impl Fn(usize) -> P,
    limit: i64,
    min_points: usize,
    max_points: usize,
) -> Vec<u32> {
    let is_core: Vec<bool> =
        (0..count).map(|a| (0..count).filter(|&b| near(a, b) <= limit).count() >= min_points).collect();
    let names = components(count, |a, b| is_core[a] && is_core[b] && near(a, b) <= limit);
    let name = |point: usize| {
        let cores = (0..count).filter(|&core| is_core[core] && near(point, core) <= limit);
        cores.min_by_key(|&core| (near(point, core), place(core))).map(|core| names[core])
    };
    numbered(&(0..count).map(name).collect::<Vec<_>>(), 1, max_points)
}

/// Names to numbers from 1 in order of first appearance. Names with too few or too many points become 0.
fn numbered(names: &[Option<usize>], min_points: usize, max_points: usize) -> Vec<u32> {
    let mut known: Vec<usize> = Vec::new();
    let mut label = |name: &Option<usize>| {
        let points = names.iter().filter(|other| *other == name).count();
        let Some(name) = name.filter(|_| (min_points..=max_points).contains(&points)) else { return 0 };
        if !known.contains(&name) {
            known.push(name);
        }
        u32::try_from(known.iter().position(|other| *other == name).unwrap_or(0) + 1).unwrap_or(u32::MAX)
    };
    names.iter().map(&mut label).collect()
}

/// Squared horizontal distance between the centres of two columns.
fn beside(a: [i64; 3], b: [i64; 3], voxel: i64) -> i64 {
    ((a[0] - b[0]) * voxel).pow(2) + ((a[1] - b[1]) * voxel).pow(2)
}

/// The smallest index connected with each of `count` things: indices spread until nothing changes.
fn components(count: usize, connected: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let mut names: Vec<usize> = (0..count).collect();
    loop {
        let before = names.clone();
        for a in 0..count {
            for b in 0..count {
                if names[b] < names[a] && connected(a, b) {
                    names[a] = names[b];
                }
            }
        }
        if names == before {
            return names;
        }
    }
}
