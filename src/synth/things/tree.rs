//! Plants, from bushes to palms: stems grow on stems, level by level, with leaves. Also leaves strewn over
//! hedges.
//!
//! After Weber and Penn, Creation and rendering of realistic trees (SIGGRAPH 1995), simplified: one rule for
//! every level; a habit is a table of levels.

use glam::{FloatExt, Vec3};
use obvhs::aabb::Aabb;
use rand::RngExt;
use serde::Deserialize;

use crate::synth::random::{Random, direction, gauss};
use crate::synth::scene::shape::{Primitive, Shape};

/// The stems of one level of growth, and the leaves around their ends; explained in `things.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Level {
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

/// Amount by which a stem turns at random from its foot to its end.
const WANDER: f32 = 0.1;

/// A Bézier curve from the first number to the last, with the middle one as its control point.
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
pub(crate) fn strew(within: &Aabb, count: u16, random: &mut Random) -> Vec<Primitive> {
    let low = Vec3::from(within.min);
    let size = Vec3::from(within.diagonal());
    (0..count).map(|_| leaf(low + size * random.random::<Vec3>(), 0.04, random)).collect()
}

/// The parts that grow on a stem through these points, which are equally spaced: the stems of the first
/// level, and the other levels on them.
pub(crate) fn grow(levels: &[Level], parent: &[Vec3], random: &mut Random) -> Vec<Primitive> {
    let Some((level, further)) = levels.split_first() else { return Vec::new() };
    let pieces = parent.len() - 1;
    let span = parent[0].distance(parent[1]) * pieces as f32;
    let mut parts = Vec::new();
    for number in 0..level.count {
        let x = (f32::from(number) + random.random::<f32>()) / f32::from(level.count);
        let place = level.along[0].lerp(level.along[1], x) * pieces as f32;
        let piece = (place as usize).min(pieces - 1);
        let below = parent[piece];
        let above = parent[piece + 1];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::random::sequence;

    #[test]
    fn stems_stand_on_stems_and_leaves_about_their_ends() {
        #[derive(Deserialize)]
        struct Habit {
            growth: Vec<Level>,
        }
        // A trunk of 10 m, with three horizontal branches of 2 m in its upper half and four leaves at the end
        // of each.
        let text = r#"growth = [
            { of = "bark", count = 1, along = [0, 0], turn = 0, rise = [90, 90, 90], length = [10, 10, 10], radius = [0.02, 0.01, 0], pieces = 2, bend = 0 },
            { of = "bark", count = 3, along = [0.5, 1], turn = 120, rise = [0, 0, 0], length = [0.2, 0.2, 0.2], radius = [0.03, 0.02, 0.01], pieces = 1, bend = 0, leaves = [4, 0.05, 0] },
        ]"#;
        let Habit { growth } = toml::from_str(text).unwrap();
        let parts = grow(&growth, &[Vec3::ZERO, Vec3::Z], &mut sequence(1, 2, 3));
        assert_eq!(parts.len(), 2 + 3 * (1 + 4));
        let rod = |part: &Primitive| match part.shape {
            Shape::Rod(from, to, radii) => (from, to, radii),
            ref other => panic!("a piece of a stem is a rod, not {other:?}"),
        };
        let ((foot, middle, [thick, half]), (joint, top, [_, thin])) = (rod(&parts[0]), rod(&parts[1]));
        // Chance turns a stem by 0.1 and shortens it by up to 16 %.
        let height = 2.0 * foot.distance(middle);
        assert!(foot == Vec3::ZERO && joint == middle && (8.4..=10.001).contains(&height) && top.z > 8.3);
        // Radii of 2 % at the foot, 1 % half way: 0.25 * 0.02 + 0.5 * 0.01, nothing at the end.
        assert!((thick / height - 0.02).abs() < 1e-5 && (half / height - 0.01).abs() < 1e-5 && thin == 0.0);
        for branch in parts[2..].chunks(5) {
            let (from, to, _) = rod(&branch[0]);
            let length = from.distance(to) / height;
            assert!(
                (0.49..1.0).contains(&(from.z / height)) && (0.168..=0.2001).contains(&length),
                "{from} {to}"
            );
            assert!((to.z - from.z).abs() < 0.25 * from.distance(to), "{from} {to}");
            for leaf in &branch[1..] {
                assert!(matches!(leaf.shape, Shape::Disc(at, ..) if at == to));
            }
        }
    }
}
