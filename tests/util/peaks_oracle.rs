//! `density-peaks` taken literally over the whole cloud, in O(n^2) or worse. It shares no code with the
//! library. Points are lattice coordinates in millimetres; their ids are their indices.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Matrix3;

/// Settings. Lengths are in voxels, except `voxel`, `d_th` and `reassign`, which are in millimetres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settings {
    pub(crate) voxel: i64,
    pub(crate) rho_t: f64,
    pub(crate) delta_t: f64,
    pub(crate) d_t: f64,
    pub(crate) d_neighbor: f64,
    pub(crate) d_th: i64,
    pub(crate) c_t: f64,
    pub(crate) reassign: i64,
}

/// The result of the oracle.
#[derive(Debug)]
pub(crate) struct Found {
    /// For each point the smallest id of its object.
    pub(crate) objects: Vec<Option<usize>>,
    pub(crate) centres: usize,
    pub(crate) segments: usize,
    pub(crate) reassigned: usize,
    pub(crate) dropped: usize,
    /// Smallest difference between a mean curvature and the threshold.
    pub(crate) margin: f64,
    /// Largest distance to the farthest of 20 neighbours, over all pairs, in millimetres.
    pub(crate) farthest_neighbour: f64,
}

type Voxel = [i64; 3];

fn squared(a: [i64; 3], b: [i64; 3]) -> i64 {
    (0..3).map(|axis| (a[axis] - b[axis]).pow(2)).sum()
}

/// 26-connected components: for each voxel, the smallest voxel of its component.
fn components(voxels: &BTreeSet<Voxel>) -> BTreeMap<Voxel, Voxel> {
    let mut names = BTreeMap::new();
    for &seed in voxels {
        if names.contains_key(&seed) {
            continue;
        }
        let mut open = vec![seed];
        while let Some(at) = open.pop() {
            if names.insert(at, seed).is_none() {
                open.extend(voxels.iter().filter(|v| (0..3).all(|axis| (v[axis] - at[axis]).abs() <= 1)));
            }
        }
    }
    names
}

/// Density of every voxel (equation 3).
fn densities(
    voxels: &BTreeMap<Voxel, Vec<usize>>,
    ground: &BTreeSet<Voxel>,
    s: &Settings,
) -> BTreeMap<Voxel, f64> {
    let most = voxels.values().map(Vec::len).max().unwrap_or(0) as f64;
    let density = |(&[i, j, k], points): (&Voxel, &Vec<usize>)| {
        let mut base = k;
        while voxels.contains_key(&[i, j, base - 1]) {
            base -= 1;
        }
        let mut top = k;
        while voxels.contains_key(&[i, j, top + 1]) {
            top += 1;
        }
        let length = (top - base + 1) as f64;
        let position = (k - base) as f64;
        let across = |v: &Voxel| (v[0] - i).pow(2) + (v[1] - j).pow(2);
        let near = ground.iter().filter(|v| across(v) * s.voxel.pow(2) <= 10_000 * 10_000);
        let below = near.map(|v| (across(v), v[2], v[0], v[1])).min().map(|nearest| nearest.1);
        let lowest = voxels.keys().filter(|v| v[0] == i && v[1] == j).map(|v| v[2]).min().unwrap_or(k);
        let d = (k - below.unwrap_or(lowest)) as f64;
        let rho = length - position / length + points.len() as f64 / most;
        ([i, j, k], if d >= s.d_t { rho / d.max(1.0) } else { rho })
    };
    voxels.iter().map(density).collect()
}

/// The centre of every voxel that has one, and the number of centres (sections 3.2.1 and 3.2.2).
fn clusters(density: &BTreeMap<Voxel, f64>, s: &Settings) -> (BTreeMap<Voxel, Voxel>, usize) {
    let all: BTreeSet<Voxel> = density.keys().copied().collect();
    let component = components(&all);
    let reversed = |[i, j, k]: Voxel| [k, j, i];
    let mut order: Vec<Voxel> = all.into_iter().collect();
    order.sort_by(|a, b| density[b].total_cmp(&density[a]).then(reversed(*a).cmp(&reversed(*b))));
    let mut labels = BTreeMap::new();
    let mut centres = 0;
    for (rank, voxel) in order.iter().enumerate() {
        let denser =
            order[..rank].iter().enumerate().filter(|(_, other)| component[*other] == component[voxel]);
        let near = denser
            .map(|(rank, other)| (squared(*voxel, *other), rank))
            .filter(|(distance, _)| (*distance as f64).sqrt() < s.d_neighbor)
            .min();
        let delta = near.map_or(s.d_neighbor, |(distance, _)| (distance as f64).sqrt());
        if density[voxel] > s.rho_t && delta > s.delta_t {
            centres += 1;
            labels.insert(*voxel, *voxel);
        } else if let Some(label) = near.and_then(|(_, rank)| labels.get(&order[rank]).copied()) {
            labels.insert(*voxel, label);
        }
    }
    (labels, centres)
}

/// Curvature of the 20 nearest labelled points, and the distance of the last of them.
fn curvature(points: &[[i64; 3]], labelled: &[usize], at: usize) -> (f64, f64) {
    let mut near: Vec<(i64, [i64; 3])> =
        labelled.iter().map(|&p| (squared(points[p], points[at]), points[p])).collect();
    near.sort_unstable();
    near.truncate(20);
    let farthest = near.last().map_or(0.0, |last| (last.0 as f64).sqrt());
    let vectors: Vec<_> = near.iter().map(|(_, place)| place.map(|value| value as f64)).collect();
    let mean = [0, 1, 2].map(|axis| vectors.iter().map(|v| v[axis]).sum::<f64>() / vectors.len() as f64);
    let entry = |a: usize, b: usize| vectors.iter().map(|v| (v[a] - mean[a]) * (v[b] - mean[b])).sum::<f64>();
    let values = Matrix3::from_fn(entry).symmetric_eigenvalues();
    let sum = values.sum();
    (if sum > 0.0 { values.min().max(0.0) / sum } else { 0.0 }, farthest)
}

/// For each component the squared distance, place and id of the labelled point nearest to any of its points.
fn nearest_labelled(
    points: &[[i64; 3]],
    halo: &[usize],
    labelled: &[usize],
    within: i64,
    component: impl Fn(usize) -> Voxel,
) -> BTreeMap<Voxel, (i64, [i64; 3], usize)> {
    let mut nearest = BTreeMap::new();
    for &p in halo {
        for &q in labelled {
            let distance = squared(points[p], points[q]);
            if distance <= within.pow(2) {
                let found = (distance, points[q], q);
                let best = nearest.entry(component(p)).or_insert(found);
                *best = found.min(*best);
            }
        }
    }
    nearest
}

/// The whole method; `ground[p]` says whether point p is ground.
pub(crate) fn density_peaks(points: &[[i64; 3]], ground: &[bool], s: &Settings) -> Found {
    let voxel_of = |p: usize| points[p].map(|value| value.div_euclid(s.voxel));
    let mut voxels = BTreeMap::<Voxel, Vec<usize>>::new();
    let mut ground_voxels = BTreeSet::new();
    for (p, &is_ground) in ground.iter().enumerate() {
        if is_ground {
            ground_voxels.insert(voxel_of(p));
        } else {
            voxels.entry(voxel_of(p)).or_default().push(p);
        }
    }
    let (labels, centres) = clusters(&densities(&voxels, &ground_voxels, s), s);
    let cluster_of = |p: usize| labels.get(&voxel_of(p)).copied();
    let labelled: Vec<usize> = (0..points.len()).filter(|&p| !ground[p] && cluster_of(p).is_some()).collect();

    let mut cells = BTreeMap::<(Voxel, Voxel), usize>::new();
    for &p in &labelled {
        let cell = points[p].map(|value| value.div_euclid(100));
        let first = cells.entry((cell, cluster_of(p).expect("labelled"))).or_insert(p);
        if points[p] < points[*first] {
            *first = p;
        }
    }
    let representatives: Vec<usize> = cells.into_values().collect();
    let mut sums = BTreeMap::<(Voxel, Voxel), (f64, f64)>::new();
    let mut farthest_neighbour: f64 = 0.0;
    // A representative has many partners but only one curvature.
    let mut curvatures = BTreeMap::<usize, (f64, f64)>::new();
    let mut curvature_of = |p: usize| *curvatures.entry(p).or_insert_with(|| curvature(points, &labelled, p));
    for &a in &representatives {
        for &b in &representatives {
            let one = cluster_of(a).expect("labelled");
            let other = cluster_of(b).expect("labelled");
            if one < other && squared(points[a], points[b]) < s.d_th.pow(2) {
                let (of_a, far_a) = curvature_of(a);
                let (of_b, far_b) = curvature_of(b);
                let sum = sums.entry((one, other)).or_default();
                sum.0 += (of_a + of_b) / 2.0;
                sum.1 += 1.0;
                farthest_neighbour = farthest_neighbour.max(far_a).max(far_b);
            }
        }
    }
    let mut segment: BTreeMap<Voxel, Voxel> = labels.values().map(|&centre| (centre, centre)).collect();
    let mut margin = f64::INFINITY;
    for ((one, other), (sum, count)) in sums {
        let mean = sum / count;
        margin = margin.min((mean - s.c_t).abs());
        if mean < s.c_t {
            let from = segment[&other];
            let to = segment[&one];
            segment.values_mut().filter(|name| **name == from).for_each(|name| *name = to);
        }
    }

    let halo: BTreeSet<Voxel> = voxels.keys().filter(|voxel| !labels.contains_key(*voxel)).copied().collect();
    let component = components(&halo);
    let in_halo: Vec<usize> =
        (0..points.len()).filter(|&p| !ground[p] && halo.contains(&voxel_of(p))).collect();
    let nearest = nearest_labelled(points, &in_halo, &labelled, s.reassign, |p| component[&voxel_of(p)]);
    let joined = |voxel: &Voxel| {
        nearest.get(&component[voxel]).map(|(.., q)| segment[&cluster_of(*q).expect("labelled")])
    };
    let object = |p: usize| match cluster_of(p) {
        Some(cluster) => Some(segment[&cluster]),
        None => joined(&voxel_of(p)),
    };
    let mut first = BTreeMap::<Voxel, usize>::new();
    let mut objects = vec![None; points.len()];
    for p in (0..points.len()).filter(|&p| !ground[p]) {
        objects[p] = object(p).map(|name| *first.entry(name).or_insert(p));
    }
    let segments = segment.values().collect::<BTreeSet<_>>().len();
    let reassigned = halo.iter().filter(|voxel| joined(voxel).is_some()).count();
    Found {
        objects,
        centres,
        segments,
        reassigned,
        dropped: halo.len() - reassigned,
        margin,
        farthest_neighbour,
    }
}
