//! `p-linkage` for surfaces by brute force over the whole cloud: all pairs of points for neighbours,
//! eigenvalues of another library, trees by walking to their roots, pairs of slices by all pairs of points.
#![expect(
    clippy::cast_possible_truncation,
    reason = "the order of points is that of single precision, as in the library"
)]

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::util::contest_oracle;

/// Settings in millimetres and degrees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settings {
    pub(crate) neighbours: usize,
    pub(crate) reach_mm: i64,
    pub(crate) angle_deg: f64,
    pub(crate) border_score: f64,
    pub(crate) refit_planes: bool,
    pub(crate) contest_rounds: usize,
}

pub(super) type Vector = Vector3<f64>;

struct Facts {
    flatness: f64,
    normal: Vector,
    consistent: Vec<usize>,
}

pub(super) fn vector(point: [i64; 3]) -> Vector {
    Vector::new(point[0] as f64, point[1] as f64, point[2] as f64)
}

/// Normal, smallest eigenvalue and mean; `None` if the points are on a line.
pub(super) fn plane(points: &[Vector]) -> Option<(Vector, f64, Vector)> {
    if points.len() < 3 {
        return None;
    }
    let mean = points.iter().sum::<Vector>() / points.len() as f64;
    // Sums of whole numbers, so that points with the same neighbours are equally flat whatever the origin of
    // the coordinates.
    let products: Matrix3<f64> = points.iter().map(|p| p * p.transpose()).sum();
    let sum = points.iter().sum::<Vector>();
    let count = points.len() as f64;
    let eigen = SymmetricEigen::new((products * count - sum * sum.transpose()) / (count * count));
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let values = order.map(|k| eigen.eigenvalues[k]);
    let normal: Vector = eigen.eigenvectors.column(order[0]).into();
    (values[1] > 1e-9 * values[2]).then(|| (normal, values[0].max(0.0), mean))
}

fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let high = values.len() / 2;
    if values.len() % 2 == 1 { values[high] } else { (values[high - 1] + values[high]) / 2.0 }
}

/// Whether each distance is consistent (equations 6 and 7).
fn consistent(distances: &[f64]) -> Vec<bool> {
    let middle = median(distances);
    let deviations: Vec<f64> = distances.iter().map(|d| (d - middle).abs()).collect();
    let mad = 1.4826 * median(&deviations);
    deviations.iter().map(|deviation| mad <= 0.0 || deviation / mad < 2.5).collect()
}

fn facts(points: &[[i64; 3]], of: usize, settings: &Settings) -> Option<Facts> {
    let squared = |other: usize| (0..3).map(|k| (points[other][k] - points[of][k]).pow(2)).sum::<i64>();
    let mut near: Vec<(i64, usize)> = (0..points.len())
        .map(|other| (squared(other), other))
        .filter(|(squared, _)| *squared <= settings.reach_mm.pow(2))
        .collect();
    near.sort_unstable();
    near.truncate(settings.neighbours);
    if near.len() < 6 {
        return None;
    }
    let places: Vec<Vector> =
        near.iter().map(|(_, other)| vector(points[*other]) - vector(points[of])).collect();
    let (normal, flatness, mean) = plane(&places[..places.len() / 2])?;
    let distances: Vec<f64> = places.iter().map(|place| normal.dot(&(place - mean)).abs()).collect();
    let kept = near.iter().zip(consistent(&distances)).filter(|(_, holds)| *holds);
    Some(Facts { flatness, normal, consistent: kept.map(|((_, other), _)| *other).collect() })
}

/// SplitMix64 from a seed, and three different numbers from it.
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let a = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let b = (a ^ a >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        usize::try_from((u128::from(b ^ b >> 31) * count as u128) >> 64).expect("below a usize")
    }

    fn three(&mut self, count: usize) -> [usize; 3] {
        let mut left: Vec<usize> = (0..count).collect();
        [(); 3].map(|()| {
            let at = self.below(left.len());
            left.remove(at)
        })
    }
}

/// The robust plane of a slice: normal, a point on it, and its consistent points with their deviation.
struct Robust {
    normal: Vector,
    mean: Vector,
    consistent: BTreeSet<usize>,
    deviation: f64,
}

impl Robust {
    fn distance(&self, point: [i64; 3]) -> f64 {
        self.normal.dot(&(vector(point) - self.mean)).abs()
    }
}

fn slice(points: &[[i64; 3]], members: &[usize], refit: bool) -> Option<Robust> {
    let start = vector(points[members[0]]);
    let places: Vec<Vector> = members.iter().map(|member| vector(points[*member]) - start).collect();
    let half = (members.len() / 2).max(3);
    let mut random = Random(members.len() as u64);
    let mut best: Option<(Vector, f64, Vector)> = None;
    for _ in 0..69 {
        let [a, b, c] = random.three(members.len()).map(|at| places[at]);
        let normal = (b - a).cross(&(c - a));
        if normal.norm() == 0.0 {
            continue;
        }
        let normal = normal / normal.norm();
        let mut order: Vec<(f32, usize)> = places
            .iter()
            .enumerate()
            .map(|(at, place)| ((normal.dot(place) - normal.dot(&a)).abs() as f32, at))
            .collect();
        order.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        let nearest: Vec<Vector> = order[..half].iter().map(|(_, at)| places[*at]).collect();
        if let Some(found) = plane(&nearest)
            && best.is_none_or(|best| found.1 < best.1)
        {
            best = Some(found);
        }
    }
    let (mut normal, _, mut mean) = best?;
    let distances: Vec<f64> = places.iter().map(|place| normal.dot(&(place - mean)).abs()).collect();
    let kept: Vec<usize> = (0..members.len())
        .zip(consistent(&distances))
        .filter(|(_, holds)| *holds)
        .map(|(at, _)| at)
        .collect();
    let near: Vec<Vector> = kept.iter().map(|at| places[*at]).collect();
    if let Some(better) = plane(&near).filter(|_| refit) {
        (normal, mean) = (better.0, better.2);
    }
    let squared = near.iter().map(|place| normal.dot(&(place - mean)).powi(2)).sum::<f64>();
    Some(Robust {
        normal,
        mean: mean + start,
        deviation: (squared / kept.len() as f64).sqrt(),
        consistent: kept.into_iter().map(|at| members[at]).collect(),
    })
}

/// The points that take part, their indices among all points, and their normals.
struct Cloud<'a> {
    own: &'a [[i64; 3]],
    kept: &'a [usize],
    facts: &'a [Option<Facts>],
}

/// A tree of merged slices for each surface, and the number of merged pairs.
struct Merged {
    parent: Vec<usize>,
    pairs: usize,
}

impl Cloud<'_> {
    /// The slice of each point (`usize::MAX` for none), and the merged slices.
    fn merge(&self, slices: &[(Vec<usize>, Robust)], settings: &Settings) -> (Vec<usize>, Merged) {
        let Self { own, kept, facts } = *self;
        let mut of_point = vec![usize::MAX; own.len()];
        for (number, (members, ..)) in slices.iter().enumerate() {
            members.iter().for_each(|member| of_point[*member] = number);
        }
        let mut parent: Vec<usize> = (0..slices.len()).collect();
        fn root(parent: &[usize], mut at: usize) -> usize {
            while parent[at] != at {
                at = parent[at];
            }
            at
        }
        let least = settings.angle_deg.to_radians().cos();
        // The distances of the points of borders from the planes of the other slices.
        let mut borders: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
        for (a, facts_a) in facts.iter().enumerate() {
            for &b in facts_a.iter().flat_map(|facts| &facts.consistent) {
                let mutual = facts[b].as_ref().is_some_and(|there| there.consistent.contains(&a));
                let (p, q) = (of_point[a], of_point[b]);
                if !mutual || p == q || p == usize::MAX || q == usize::MAX {
                    continue;
                }
                let [one, other] = [p, q].map(|slice| &slices[slice].1);
                let holds = one.consistent.contains(&kept[a]) && other.consistent.contains(&kept[b]);
                if holds && one.normal.dot(&other.normal).abs() > least {
                    borders.entry((p.min(q), p.max(q))).or_default().push(one.distance(own[b]));
                }
            }
        }
        borders.retain(|(p, q), distances| {
            let mean = distances.iter().sum::<f64>() / distances.len() as f64;
            let deviation = slices[*p].1.deviation.max(slices[*q].1.deviation).max(1.0);
            settings.border_score <= 0.0 || mean < settings.border_score * deviation
        });
        for (p, q) in borders.keys() {
            let (one, other) = (root(&parent, *p), root(&parent, *q));
            parent[one.max(other)] = one.min(other);
        }
        let pairs = borders.len();
        (of_point, Merged { parent, pairs })
    }
}

/// For each point the smallest point of its surface, whatever its size; and the numbers of slices, of merged
/// pairs, of points that changed their surface in contests, and of surfaces merged after these.
pub(crate) fn surfaces(
    points: &[[i64; 3]],
    ground: &[bool],
    settings: &Settings,
) -> (Vec<Option<usize>>, [usize; 4]) {
    // Ground points do not take part. The others are in the order of their places, which decides ties.
    let mut kept: Vec<usize> = (0..points.len()).filter(|id| !ground[*id]).collect();
    kept.sort_by_key(|id| (points[*id], *id));
    let own: Vec<[i64; 3]> = kept.iter().map(|id| points[*id]).collect();
    let facts: Vec<Option<Facts>> = (0..own.len()).map(|of| facts(&own, of, settings)).collect();
    let values: Vec<f64> = facts.iter().flatten().map(|facts| facts.flatness).collect();
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let deviation =
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt();

    let link = |of: usize| {
        let here = facts[of].as_ref()?;
        // Points in one place are linked to each other.
        if of > 0 && own[of] == own[of - 1] {
            return Some(of - 1);
        }
        let flatter = |other: &usize| {
            facts[*other].as_ref().is_some_and(|there| (there.flatness, *other) < (here.flatness, of))
        };
        let alike =
            |other: usize| facts[other].as_ref().map_or(0.0, |there| here.normal.dot(&there.normal).abs());
        let squared = |other: usize| (0..3).map(|k| (own[other][k] - own[of][k]).pow(2)).sum::<i64>();
        here.consistent
            .iter()
            .copied()
            .filter(flatter)
            .max_by(|&a, &b| alike(a).total_cmp(&alike(b)).then(squared(b).cmp(&squared(a))).then(b.cmp(&a)))
    };
    let mut clusters: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for point in (0..own.len()).filter(|point| facts[*point].is_some()) {
        let mut root = point;
        while let Some(next) = link(root) {
            root = next;
        }
        clusters.entry(root).or_default().push(point);
    }
    let is_centre = |root: usize| {
        facts[root].as_ref().is_some_and(|facts| facts.flatness < mean + deviation || deviation <= 0.0)
    };
    let mut slices: Vec<(Vec<usize>, Robust)> = Vec::new();
    for (root, members) in clusters {
        if members.len() < 10 || !is_centre(root) {
            continue;
        }
        let ids: Vec<usize> = members.iter().map(|member| kept[*member]).collect();
        if let Some(robust) = slice(points, &ids, settings.refit_planes) {
            slices.push((members, robust));
        }
    }
    let cloud = Cloud { own: &own, kept: &kept, facts: &facts };
    let (of_point, merged) = cloud.merge(&slices, settings);
    let root = |at: usize| {
        let mut at = at;
        while merged.parent[at] != at {
            at = merged.parent[at];
        }
        at
    };
    let mut first: BTreeMap<usize, usize> = BTreeMap::new();
    let mut found = vec![None; points.len()];
    let slice = |number: &usize| if *number == usize::MAX { usize::MAX } else { root(*number) };
    let mut of_point: Vec<usize> = of_point.iter().map(slice).collect();
    let [changed, joined] = contest_oracle::contests(&own, &mut of_point, settings);
    let with_surface = || of_point.iter().enumerate().filter(|(_, surface)| **surface != usize::MAX);
    for (point, &surface) in with_surface() {
        let smallest = first.entry(surface).or_insert(kept[point]);
        *smallest = kept[point].min(*smallest);
    }
    for (point, surface) in with_surface() {
        found[kept[point]] = Some(first[surface]);
    }
    (found, [slices.len(), merged.pairs, changed, joined])
}
