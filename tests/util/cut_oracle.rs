//! `normalized-cut` by brute force: clusters over all pairs of points, weights over all pairs of voxels,
//! dense eigenvectors, and Ncut summed again for each cut. It shares no code with the library. Coordinates of
//! points are in millimetres, all other lengths in metres. It has no tree filter, so its scenes must not have
//! facades that touch.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, SymmetricEigen};

/// Settings of a case.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settings {
    pub(crate) d_t_mm: i64,
    pub(crate) min_points: usize,
    pub(crate) voxel_mm: i64,
    pub(crate) sigma_h: f64,
    pub(crate) sigma_v: f64,
    pub(crate) d_h: f64,
    pub(crate) stop: f64,
    pub(crate) tall: f64,
    pub(crate) wide: f64,
    pub(crate) max_voxels: usize,
}

/// For each point the smallest point of its part, `None` without a part; and the number of cuts.
pub(crate) fn parts(points: &[[i64; 3]], ground: &[bool], s: &Settings) -> (Vec<Option<usize>>, usize) {
    let mut result = vec![None; points.len()];
    let mut cuts = 0;
    for members in clusters(points, ground, s.d_t_mm) {
        if members.len() < s.min_points {
            continue;
        }
        let side = |axis: usize| {
            let ends = members.iter().map(|&point| points[point][axis]);
            (ends.clone().max().unwrap() - ends.min().unwrap()) as f64 / 1_000.0
        };
        let fine = voxels(points, &members, s.voxel_mm);
        let mut part_of: BTreeMap<[i64; 3], [i64; 3]> = BTreeMap::new();
        if side(2) > s.tall && side(0).max(side(1)) > s.wide {
            let mut open: Vec<BTreeSet<[i64; 3]>> = vec![fine.keys().copied().collect()];
            while let Some(own) = open.pop() {
                let mut edge = s.voxel_mm;
                let inside: Vec<usize> = own.iter().flat_map(|key| fine[key].clone()).collect();
                while voxels(points, &inside, edge).len() > s.max_voxels {
                    edge *= 2;
                }
                let parts = parts_of(points, &voxels(points, &inside, edge), edge, s);
                cuts += parts.len() - 1;
                let last = edge == s.voxel_mm || parts.len() == 1;
                for part in parts {
                    let keys: BTreeSet<[i64; 3]> = own
                        .iter()
                        .copied()
                        .filter(|key| part.contains(&points[fine[key][0]].map(|v| v.div_euclid(edge))))
                        .collect();
                    if last {
                        let name = *keys.first().unwrap();
                        part_of.extend(keys.into_iter().map(|key| (key, name)));
                    } else {
                        open.push(keys);
                    }
                }
            }
        } else {
            part_of = fine.keys().map(|key| (*key, [0; 3])).collect();
        }
        let mut first = BTreeMap::new();
        for point in members {
            let part = part_of[&points[point].map(|value| value.div_euclid(s.voxel_mm))];
            result[point] = Some(*first.entry(part).or_insert(point));
        }
    }
    (result, cuts)
}

/// The parts of voxels of one edge, as sets of keys.
fn parts_of(
    points: &[[i64; 3]],
    found: &BTreeMap<[i64; 3], Vec<usize>>,
    edge: i64,
    s: &Settings,
) -> Vec<BTreeSet<[i64; 3]>> {
    let keys: Vec<[i64; 3]> = found.keys().copied().collect();
    let places: Vec<[f64; 3]> = found.values().map(|own| centroid(points, own)).collect();
    let factor = (2.0 * edge as f64 / 1_000.0 / s.d_h).max(1.0);
    let weights = DMatrix::from_fn(places.len(), places.len(), |a, b| {
        if a == b { 0.0 } else { weight(places[a], places[b], s, factor) }
    });
    let mut open = connected(&weights);
    let mut done = Vec::new();
    while let Some(part) = open.pop() {
        match halves(&part, &weights, &places, s) {
            Some(halves) => open.extend(halves),
            None => done.push(part.iter().map(|&voxel| keys[voxel]).collect()),
        }
    }
    done
}

/// Single-link clusters, by breadth-first search over all pairs. Members ascend.
fn clusters(points: &[[i64; 3]], ground: &[bool], d_t: i64) -> Vec<Vec<usize>> {
    let mut left: BTreeSet<usize> = (0..points.len()).filter(|&point| !ground[point]).collect();
    let mut clusters = Vec::new();
    while let Some(start) = left.pop_first() {
        let mut members = vec![start];
        let mut next = 0;
        while next < members.len() {
            let here = points[members[next]];
            let near = |point: &usize| {
                (0..3).map(|axis| (points[*point][axis] - here[axis]).pow(2)).sum::<i64>() <= d_t * d_t
            };
            let found: Vec<usize> = left.iter().copied().filter(near).collect();
            found.iter().for_each(|point| _ = left.remove(point));
            members.extend(found);
            next += 1;
        }
        members.sort_unstable();
        clusters.push(members);
    }
    clusters
}

fn voxels(points: &[[i64; 3]], members: &[usize], edge: i64) -> BTreeMap<[i64; 3], Vec<usize>> {
    let mut voxels: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for &point in members {
        voxels.entry(points[point].map(|value| value.div_euclid(edge))).or_default().push(point);
    }
    voxels
}

fn centroid(points: &[[i64; 3]], own: &[usize]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        own.iter().map(|&point| points[point][axis] as f64 / 1_000.0).sum::<f64>() / own.len() as f64
    })
}

/// The weight of equation 1, with the cut-off in height that the method states.
fn weight(a: [f64; 3], b: [f64; 3], s: &Settings, factor: f64) -> f64 {
    let across = (a[0] - b[0]).hypot(a[1] - b[1]) / factor;
    let up = (a[2] - b[2]).abs() / factor;
    if across > s.d_h || up > 3.0 * s.sigma_v {
        return 0.0;
    }
    (-(across / s.sigma_h).powi(2)).exp() * (-(up / s.sigma_v).powi(2)).exp()
}

fn connected(weights: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let mut name: Vec<usize> = (0..weights.nrows()).collect();
    loop {
        let before = name.clone();
        for a in 0..name.len() {
            for b in 0..name.len() {
                if weights[(a, b)] > 0.0 {
                    name[a] = name[a].min(name[b]);
                }
            }
        }
        if before == name {
            break;
        }
    }
    let names: BTreeSet<usize> = name.iter().copied().collect();
    names.into_iter().map(|one| (0..name.len()).filter(|&voxel| name[voxel] == one).collect()).collect()
}

/// The best cut of a part (ascending voxels), or `None` if the part stays whole.
fn halves(
    part: &[usize],
    weights: &DMatrix<f64>,
    places: &[[f64; 3]],
    s: &Settings,
) -> Option<[Vec<usize>; 2]> {
    let count = part.len();
    let heights = part.iter().map(|&voxel| places[voxel][2]);
    if count < 20 || heights.clone().reduce(f64::max)? - heights.reduce(f64::min)? <= s.tall {
        return None;
    }
    let weight = |a: usize, b: usize| weights[(part[a], part[b])];
    let degree: Vec<f64> = (0..count).map(|a| (0..count).map(|b| weight(a, b)).sum()).collect();
    let scaled = DMatrix::from_fn(count, count, |a, b| {
        if weight(a, b) > 0.0 { weight(a, b) / (degree[a] * degree[b]).sqrt() } else { 0.0 }
    });
    let solved = SymmetricEigen::new(scaled);
    let mut by_value: Vec<usize> = (0..count).collect();
    by_value.sort_by(|&a, &b| solved.eigenvalues[b].total_cmp(&solved.eigenvalues[a]));
    let second = by_value[1];
    let value = |voxel: usize| {
        if degree[voxel] > 0.0 { solved.eigenvectors[(voxel, second)] / degree[voxel].sqrt() } else { 0.0 }
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
    let mut best: Option<(f64, usize)> = None;
    for quantile in 1..=20 {
        let size = if quantile <= 10 { quantile * count / 21 } else { count - (21 - quantile) * count / 21 };
        let (before, after) = order.split_at(size);
        let cut: f64 = before.iter().flat_map(|&a| after.iter().map(move |&b| weight(a, b))).sum();
        let of = |side: &[usize]| side.iter().map(|&voxel| degree[voxel]).sum::<f64>();
        if of(before) <= 0.0 || of(after) <= 0.0 {
            continue;
        }
        let ncut = cut / of(before) + cut / of(after);
        let more_even = |size: usize, than: usize| count.abs_diff(2 * size) < count.abs_diff(2 * than);
        if best.is_none_or(|best| ncut < best.0 || (ncut <= best.0 && more_even(size, best.1))) {
            best = Some((ncut, size));
        }
    }
    let (ncut, size) = best?;
    if ncut > s.stop {
        return None;
    }
    let half = |range: &[usize]| {
        let mut half: Vec<usize> = range.iter().map(|&place| part[place]).collect();
        half.sort_unstable();
        half
    };
    Some([half(&order[..size]), half(&order[size..])])
}
