//! What grows, from bushes to palms: stems upon stems, level by level, with leaves; and leaves strewn over hedges.
//!
//! After Weber and Penn, Creation and rendering of realistic trees (SIGGRAPH 1995), simplified: one rule for every
//! level; a habit is a table of levels.

use glam::{FloatExt, Vec3};
use obvhs::aabb::Aabb;
use rand::RngExt;
use serde::Deserialize;

use super::random::{Random, direction, gauss};
use super::shape::{Primitive, Shape};

/// The stems of one level of growth, and the leaves about their ends; explained in `things.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Level {
    of: String,
    count: u16,
    along: [f32; 2],
    turn: f32,
    rise: Curve,
    length: Curve,
    radius: Curve,
    pieces: u8,
    bend: f32,
    leaves: Option<(u16, f32, f32)>,
}

/// How far a stem turns by chance from its foot to its end.
const WANDER: f32 = 0.1;

/// A Bézier curve: from the first number to the last, drawn towards the one between.
#[derive(Debug, Deserialize)]
struct Curve(f32, f32, f32);

impl Curve {
    fn at(&self, u: f32) -> f32 {
        self.0.lerp(self.1, u).lerp(self.1.lerp(self.2, u), u)
    }
}

fn leaf(at: Vec3, size: f32, random: &mut Random) -> Primitive {
    Shape::Disc(at, direction(random), size * random.random_range(0.7..=1.25)).of("leaf")
}

/// `count` leaves within a box.
pub(super) fn strew(within: &Aabb, count: u16, random: &mut Random) -> Vec<Primitive> {
    let (low, size) = (Vec3::from(within.min), Vec3::from(within.diagonal()));
    (0..count).map(|_| leaf(low + size * random.random::<Vec3>(), 0.04, random)).collect()
}

/// What grows from a stem of these points, at equal distances: the stems of the first level, the others upon them.
pub(super) fn grow(levels: &[Level], parent: &[Vec3], random: &mut Random) -> Vec<Primitive> {
    let Some((level, further)) = levels.split_first() else { return Vec::new() };
    let pieces = parent.len() - 1;
    let span = parent[0].distance(parent[1]) * pieces as f32;
    let mut parts = Vec::new();
    for number in 0..level.count {
        let x = (f32::from(number) + random.random::<f32>()) / f32::from(level.count);
        let place = level.along[0].lerp(level.along[1], x) * pieces as f32;
        let piece = (place as usize).min(pieces - 1);
        let (below, above) = (parent[piece], parent[piece + 1]);
        let onward = (above - below).normalize();
        let azimuth = (f32::from(number) * level.turn).to_radians() + random.random_range(-0.2..=0.2);
        let outward = onward.cross(Vec3::Z).normalize_or(Vec3::X).rotate_axis(onward, azimuth);
        let (up, out) = level.rise.at(x).to_radians().sin_cos();
        let mut way = outward * out + onward * up;
        let length = span * level.length.at(x) * random.random_range(0.84..=1.0);
        let mut at = below.lerp(above, place - piece as f32);
        let mut stem = vec![at];
        for piece in 0..level.pieces {
            let [u, v] = [piece, piece + 1].map(|end| f32::from(end) / f32::from(level.pieces));
            way = (way + (Vec3::Z * level.bend + direction(random) * WANDER) * (v - u)).normalize();
            let from = at;
            at += way * length * (v - u);
            let radii = [u, v].map(|u| level.radius.at(u) * length);
            parts.push(Shape::Rod(from, at, radii).of(&level.of));
            stem.push(at);
        }
        let (leaves, size, spread) = level.leaves.unwrap_or_default();
        for _ in 0..leaves {
            let offset = Vec3::from_array([(); 3].map(|()| gauss(random)));
            parts.push(leaf(at + offset * spread * length, size, random));
        }
        parts.extend(grow(further, &stem, random));
    }
    parts
}
