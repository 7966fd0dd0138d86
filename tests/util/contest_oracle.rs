//! Contests among surfaces by brute force over the whole cloud: local planes from all points, neighbours from
//! all pairs of points.

use std::collections::BTreeMap;

use crate::util::surface_oracle::{Settings, Vector, plane, vector};

/// No surface.
const NONE: usize = usize::MAX;

type Cube = [i64; 3];

struct Local {
    normal: Vector,
    mean: Vector,
    deviation: f64,
}

impl Local {
    fn distance(&self, point: [i64; 3]) -> f64 {
        self.normal.dot(&(vector(point) - self.mean)).abs()
    }

    /// Score of a point; infinite if the point is not consistent.
    fn score(&self, point: [i64; 3]) -> f64 {
        let distance = self.distance(point);
        if distance < 2.5 * self.deviation { self.deviation + distance / 2.0 } else { f64::INFINITY }
    }
}

fn cube(point: [i64; 3]) -> Cube {
    point.map(|value| value.div_euclid(500))
}

/// The local planes of every cube with points, by surface.
fn planes(points: &[[i64; 3]], surfaces: &[usize]) -> BTreeMap<Cube, BTreeMap<usize, Local>> {
    let mut found: BTreeMap<Cube, BTreeMap<usize, Local>> = BTreeMap::new();
    for &centre in points {
        let centre = cube(centre);
        if found.contains_key(&centre) {
            continue;
        }
        let corner = centre.map(|index| index * 500);
        let mut members: BTreeMap<usize, Vec<Vector>> = BTreeMap::new();
        for (point, surface) in points.iter().zip(surfaces).filter(|(_, surface)| **surface != NONE) {
            if (0..3).all(|k| (cube(*point)[k] - centre[k]).abs() <= 1) {
                members.entry(*surface).or_default().push(vector(*point) - vector(corner));
            }
        }
        let local = members.into_iter().filter(|(_, members)| members.len() >= 50).filter_map(
            |(surface, members)| {
                let (normal, flatness, mean) = plane(&members)?;
                let deviation = flatness.sqrt().max(1.0);
                Some((surface, Local { normal, mean: mean + vector(corner), deviation }))
            },
        );
        found.insert(centre, local.collect());
    }
    found
}

/// The nearest points of each point, itself included, the nearest first.
fn neighbours(points: &[[i64; 3]], settings: &Settings) -> Vec<Vec<usize>> {
    let nearest = |of: &[i64; 3]| {
        let squared = |other: &[i64; 3]| (0..3).map(|k| (other[k] - of[k]).pow(2)).sum::<i64>();
        let mut near: Vec<(i64, usize)> =
            points.iter().enumerate().map(|(at, other)| (squared(other), at)).collect();
        near.retain(|(squared, _)| *squared <= settings.reach_mm.pow(2));
        near.sort_unstable();
        near.into_iter().take(settings.neighbours).map(|(_, at)| at).collect()
    };
    points.iter().map(nearest).collect()
}

/// Pairs of points of two surfaces.
#[derive(Default)]
struct Pairs {
    distances: f64,
    deviations: f64,
}

/// Runs all contests of the settings. `surfaces` has the surface of each point. Returns how often points
/// changed their surface, and how many pairs of surfaces were merged.
pub(crate) fn contests(points: &[[i64; 3]], surfaces: &mut [usize], settings: &Settings) -> [usize; 2] {
    let near = neighbours(points, settings);
    let least = settings.angle_deg.to_radians().cos();
    let (mut changed, mut merged) = (0, 0);
    for _ in 0..settings.contest_rounds {
        let local = planes(points, surfaces);
        let score = |point: usize, surface: usize| {
            let plane = local[&cube(points[point])].get(&surface);
            plane.map_or(f64::INFINITY, |plane| plane.score(points[point]))
        };
        let mut now = surfaces.to_vec();
        let mut consistent = vec![false; points.len()];
        for point in 0..points.len() {
            let mut best = score(point, surfaces[point]);
            for &other in &near[point] {
                let of_other = score(point, surfaces[other]);
                if of_other < best {
                    (best, now[point]) = (of_other, surfaces[other]);
                }
            }
            consistent[point] = best.is_finite();
            changed += usize::from(now[point] != surfaces[point]);
        }
        let local = planes(points, &now);
        let mut touching: BTreeMap<(usize, usize), Pairs> = BTreeMap::new();
        for point in (0..points.len()).filter(|point| consistent[*point]) {
            let here = &local[&cube(points[point])];
            for &other in near[point].iter().filter(|other| consistent[**other]) {
                let (a, b) = (now[point], now[other]);
                let (Some(one), Some(two)) = (here.get(&a), here.get(&b)) else { continue };
                let deviation = one.deviation.max(two.deviation);
                let far = two.distance(points[point]) >= 2.0 * settings.border_score * deviation;
                let is_far = settings.border_score > 0.0 && far;
                if a == b || one.normal.dot(&two.normal).abs() <= least || is_far {
                    continue;
                }
                let pairs = touching.entry((a.min(b), a.max(b))).or_default();
                pairs.distances += two.distance(points[point]) + one.distance(points[other]);
                pairs.deviations += deviation;
            }
        }
        surfaces.copy_from_slice(&now);
        let mut names: BTreeMap<usize, usize> = now.iter().map(|surface| (*surface, *surface)).collect();
        for ((a, b), pairs) in touching {
            let close = pairs.distances / 2.0 < settings.border_score * pairs.deviations;
            if settings.border_score > 0.0 && !close {
                continue;
            }
            merged += 1;
            let (keep, drop) = (names[&a].min(names[&b]), names[&a].max(names[&b]));
            names.values_mut().filter(|name| **name == drop).for_each(|name| *name = keep);
        }
        surfaces.iter_mut().for_each(|surface| *surface = names[surface]);
    }
    [changed, merged]
}
