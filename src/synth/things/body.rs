//! Bodies of cars: rounded, and of different sizes.
//!
//! The entries of `things.toml` have flat sides, and one size per kind. Cars in real scans differ in size
//! (there are city cars of 2.7 m), and their ends, sides, bonnets and roofs are curved. Models that learned
//! from flat cars alone took some of them for trees (`benches/results/street.md`, "Cars of real scenes"). So
//! every model of a body is stretched by chance, and its large faces are cut into small triangles and bent.

use glam::{Vec3, vec3};
use rand::RngExt;
use serde::Deserialize;

use crate::synth::random::Random;
use crate::synth::scene::shape::{Primitive, Shape};

/// Longest edge of a triangle before it is bent, metres. The curves below deviate from the middle of such an
/// edge by 3 mm (median), and by at most 3 cm, at the corners of the ends.
const LONGEST_EDGE_M: f32 = 0.5;
/// How far the corners of the ends lie behind their middle, metres.
const BOW_M: f32 = 0.16;
/// Share of the width by which the ends are narrower.
const TAPER: f32 = 0.1;
/// Share of the width by which the sides are narrower at sill and shoulder, and the heights of their widest
/// place and of the sill below it, metres.
const BULGE: f32 = 0.05;
const WIDEST_M: f32 = 0.65;
const SILL_M: f32 = 0.2;
/// How far bonnet and roof fall from the middle to the full width, metres, and the heights between which this
/// fall sets in: lower parts stay.
const CROWN_M: f32 = 0.06;
const CROWNED_M: (f32, f32) = (0.5, 0.9);
/// Height below which parts keep their height when a body is stretched, metres, so that its wheels stay on
/// the ground.
const SILLS_M: f32 = 0.35;

/// Longest edge of a block that stays a block, metres.
const SMALL_M: f32 = 1.0;

/// Ranges of the factors by which the length, width and height of a model of a body differ from its entry.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Body {
    length: (f32, f32),
    width: (f32, f32),
    height: (f32, f32),
}

impl Body {
    /// The primitives of one model, from the primitives of an entry.
    pub(crate) fn of(&self, primitives: &[Primitive], random: &mut Random) -> Vec<Primitive> {
        let factor = |(least, most): (f32, f32), random: &mut Random| random.random_range(least..=most);
        let stretch =
            vec3(factor(self.length, random), factor(self.width, random), factor(self.height, random));
        let half = primitives.iter().fold(Vec3::ZERO, |half, primitive| {
            let bounds = primitive.shape.bounds();
            half.max(Vec3::from(bounds.min).abs()).max(Vec3::from(bounds.max).abs())
        });
        let to = |point: Vec3| stretched(bent(point, half), stretch);
        primitives.iter().flat_map(|primitive| pieces(primitive, &to)).collect()
    }
}

/// The place of a point of a flat body on the rounded body. `half` are the largest distances from the middle
/// of the body.
fn bent(point: Vec3, half: Vec3) -> Vec3 {
    let Vec3 { x, y, z } = point;
    let [u, v] = [x / half.x, y / half.y];
    let side = ((z - WIDEST_M) / (WIDEST_M - SILL_M)).clamp(-1.0, 1.0);
    let (low, high) = CROWNED_M;
    let crowned = ((z - low) / (high - low)).clamp(0.0, 1.0);
    vec3(
        x - BOW_M * u.powi(5) * v * v,
        y * (1.0 - TAPER * u.powi(6)) * (1.0 - BULGE * side * side),
        z - CROWN_M * crowned * v * v,
    )
}

fn stretched(point: Vec3, stretch: Vec3) -> Vec3 {
    let above = (point.z - SILLS_M).max(0.0);
    vec3(point.x * stretch.x, point.y * stretch.y, point.z + above * (stretch.z - 1.0))
}

/// The parts of a rounded body that replace a primitive. Wheels, seats and plates only move.
fn pieces(primitive: &Primitive, to: &impl Fn(Vec3) -> Vec3) -> Vec<Primitive> {
    let of = |shape| Primitive { shape, material: primitive.material };
    match primitive.shape {
        Shape::Triangle(corners) => cut(corners).into_iter().map(|part| of(part.map(to))).collect(),
        Shape::Block(low, high) if (high - low).max_element() > SMALL_M => {
            let faces = block(low, high).into_iter();
            faces.flat_map(cut).map(|part| of(part.map(to))).collect()
        }
        ref shape => vec![of(shape.map(to))],
    }
}

/// The faces of a block, two triangles each.
fn block(low: Vec3, high: Vec3) -> Vec<[Vec3; 3]> {
    let mut faces = Vec::with_capacity(12);
    for axis in 0..3 {
        let [one, other] = [(axis + 1) % 3, (axis + 2) % 3];
        for end in [low, high] {
            let corner = |first: Vec3, second: Vec3| {
                let mut corner = end;
                corner[one] = first[one];
                corner[other] = second[other];
                corner
            };
            let [a, b, c, d] = [corner(low, low), corner(high, low), corner(high, high), corner(low, high)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    faces
}

/// Triangles without long edges that cover a triangle. Whether an edge is cut depends on its ends alone, so
/// that triangles that share an edge still share it.
fn cut(triangle: [Vec3; 3]) -> Vec<Shape> {
    let mut left = vec![triangle];
    let mut small = Vec::new();
    while let Some(corners) = left.pop() {
        let edges = [0, 1, 2].map(|from| (corners[from], corners[(from + 1) % 3]));
        let is_long = edges.map(|(from, to)| from.distance(to) > LONGEST_EDGE_M);
        let middle = edges.map(|(from, to)| (from + to) * 0.5);
        let long = is_long.iter().filter(|is_long| **is_long).count();
        // Turned so that the edges to cut come first.
        let is_first = |&first: &usize| is_long[first] && (long != 2 || is_long[(first + 1) % 3]);
        let turn = (0..3).find(is_first).unwrap_or_default();
        let [a, b, c] = [0, 1, 2].map(|place| corners[(place + turn) % 3]);
        let [ab, bc, ca] = [0, 1, 2].map(|place| middle[(place + turn) % 3]);
        match long {
            0 => small.push(Shape::Triangle(corners)),
            1 => left.extend([[a, ab, c], [ab, b, c]]),
            2 => left.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
            _ => left.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]),
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::things::models;

    fn corners(shapes: &[Shape]) -> Vec<[Vec3; 3]> {
        let of = |shape: &Shape| match shape {
            Shape::Triangle(corners) => *corners,
            other => panic!("{other:?}"),
        };
        shapes.iter().map(of).collect()
    }

    #[test]
    fn a_triangle_is_cut_into_small_ones_that_cover_it_and_share_their_edges() {
        let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).length() * 0.5;
        let [a, b, c, d] = [[0.0, 0.0], [4.5, 0.0], [4.2, 0.9], [0.1, 1.3]].map(|[x, z]| vec3(x, 0.8, z));
        let two = [[a, b, c], [a, c, d]];
        let parts = two.map(|triangle| corners(&cut(triangle)));
        for (whole, parts) in two.iter().zip(&parts) {
            let sum: f32 = parts.iter().copied().map(area).sum();
            assert!((sum - area(*whole)).abs() < 1e-4, "{sum}");
            assert!(parts.iter().flatten().all(|point| (point.y - 0.8).abs() < 1e-6));
            for [a, b, c] in parts {
                let longest = a.distance(*b).max(b.distance(*c)).max(c.distance(*a));
                assert!(longest <= LONGEST_EDGE_M, "{longest}");
            }
        }
        // The two parts share the same points on the edge between them, so that no gap opens when they are
        // bent.
        let between = parts.map(|parts| {
            let on_edge = |point: &Vec3| (*point - a).cross(c - a).length() < 1e-4;
            let mut found: Vec<[u32; 3]> = parts
                .iter()
                .flatten()
                .filter(|point| on_edge(point))
                .map(|point| point.to_array().map(f32::to_bits))
                .collect();
            found.sort_unstable();
            found.dedup();
            found
        });
        assert!(between[0].len() > 8);
        assert_eq!(between[0], between[1]);
    }

    #[test]
    fn a_block_has_six_faces_around_it() {
        let faces = block(vec3(-1.0, 0.0, 2.0), vec3(2.0, 1.0, 4.0));
        let area: f32 = faces.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).length() * 0.5).sum();
        assert!((area - 2.0 * (3.0 + 6.0 + 2.0)).abs() < 1e-4, "{area}");
        let pieces: Vec<Vec3> = faces.into_iter().flatten().collect();
        assert!(pieces.iter().all(|point| [-1.0, 2.0].contains(&point.x) && [0.0, 1.0].contains(&point.y)));
    }

    #[test]
    fn ends_bonnets_and_sides_are_rounded_and_the_middle_stays() {
        let half = vec3(2.25, 0.9, 1.5);
        let middle = vec3(0.0, 0.0, 0.4);
        assert_eq!(bent(middle, half), middle);
        let corner = bent(vec3(2.25, 0.9, 0.6), half);
        assert!((2.05..2.12).contains(&corner.x) && (0.79..0.83).contains(&corner.y), "{corner}");
        let bonnet = [0.0, 0.8].map(|y| bent(vec3(1.5, y, 1.0), half).z);
        assert!((0.04..0.06).contains(&(bonnet[0] - bonnet[1])), "{bonnet:?}");
        let sides = [0.3, WIDEST_M, 1.0].map(|z| bent(vec3(0.0, 0.9, z), half).y);
        assert!((sides[1] - 0.9).abs() < 1e-6 && sides[0] < 0.88 && sides[2] < 0.88, "{sides:?}");
        // Wheels stay on the ground, and higher parts rise with the height.
        let high = vec3(1.0, 1.0, 1.1);
        for (z, expected) in [(0.32, 0.32), (1.35, 1.45)] {
            assert!((stretched(vec3(1.0, 0.0, z), high).z - expected).abs() < 1e-6, "{z}");
        }
    }

    #[test]
    fn cars_have_many_sizes_and_fit_their_places() {
        let mut lengths = Vec::new();
        for seed in 0..8 {
            for (name, models) in models(seed).iter().filter(|(name, _)| name.starts_with("car_")) {
                for model in models {
                    let bounds = model.bounds();
                    let size = bounds.max - bounds.min;
                    // Parked cars have places of 5.1 m, and keep a distance of 1.02 m from their middle to
                    // the sides.
                    assert!(size.x < 5.05 && size.y < 2.04, "{name}: {size}");
                    assert!(bounds.min.z.abs() < 0.01 && (1.3..2.3).contains(&size.z), "{name}: {size}");
                    lengths.push(size.x);
                }
            }
        }
        lengths.sort_unstable_by(f32::total_cmp);
        let [shortest, longest] = [lengths[0], lengths[lengths.len() - 1]];
        assert!(shortest < 3.0 && longest > 4.9, "{shortest} to {longest} m");
        lengths.dedup();
        assert_eq!(lengths.len(), 8 * 5 * 9, "each model has a size of its own");
    }
}
