//! Trees and palms: trunks and branches of rods, leaves of discs in clusters; and leaves strewn over hedges.

use std::f32::consts::{PI, TAU};

use glam::{FloatExt, Vec3, vec3};
use obvhs::aabb::Aabb;
use rand::RngExt;
use serde::Deserialize;

use super::material::Material;
use super::random::{Random, direction, gauss};
use super::shape::{Primitive, Shape};

/// Habit of a tree; explained in `things.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tree {
    height: f32,
    crown: f32,
    radius: f32,
    outline: Vec<f32>,
    branches: u16,
    rise: f32,
    leaves: u16,
    leaf: f32,
}

/// A palm or a cycad: fronds with two rows of leaflets on a trunk; explained in `things.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Palm {
    trunk: f32,
    fronds: u16,
    frond: f32,
    leaflet: f32,
}

/// Between two branches that follow each other: the golden angle, so that no two are over each other.
const TURN: f32 = 2.4;

fn branch(from: Vec3, to: Vec3, radii: [f32; 2]) -> Primitive {
    Shape::Rod(from, to, radii).of(Material::Bark)
}

fn leaf(at: Vec3, size: f32, random: &mut Random) -> Primitive {
    let radius = size * random.random_range(0.7..=1.25);
    Shape::Disc(at, direction(random), radius).of(Material::Leaf)
}

/// `count` leaves within a box.
pub(super) fn strew(within: &Aabb, count: u16, random: &mut Random) -> Vec<Primitive> {
    let (low, size) = (Vec3::from(within.min), Vec3::from(within.diagonal()));
    let leaf = |_| {
        let place = random.random::<Vec3>();
        leaf(low + size * place, 0.04, random)
    };
    (0..count).map(leaf).collect()
}

impl Tree {
    pub(super) fn build(&self, random: &mut Random) -> Vec<Primitive> {
        let mut parts = Vec::new();
        let &Self { height, crown, branches, leaves, .. } = self;
        // The trunk wanders a little; `axis` gives its middle at a height.
        let lean = [random.random_range(-0.02..=0.02), random.random_range(-0.02..=0.02)];
        let phase = random.random_range(0.0..TAU);
        let axis = |z: f32| {
            let bow = 0.09 * ((z * 0.55 + phase).sin() - phase.sin());
            vec3(lean[0] * z + bow, lean[1] * z + bow * 0.6, z)
        };
        let tip = height * 0.9;
        let girth = |z: f32| (0.012 * height + 0.035) * (1.0 - 0.86 * (z / tip)).max(0.1);
        let pieces = 7u8;
        for piece in 0..pieces {
            let [low, high] = [piece, piece + 1].map(|end| tip * f32::from(end) / f32::from(pieces));
            let flare = if piece == 0 { 1.35 } else { 1.0 };
            parts.push(branch(axis(low), axis(high), [girth(low) * flare, girth(high)]));
        }
        let lumps = [random.random_range(0.0..TAU), random.random_range(0.0..TAU)];
        for number in 0..branches {
            let x = (f32::from(number) + random.random::<f32>()) / f32::from(branches);
            let azimuth = f32::from(number) * TURN + random.random_range(-0.4..=0.4);
            let lump = 0.86 + 0.14 * (2.0 * azimuth + lumps[0]).sin() * (5.0 * x + lumps[1]).cos();
            let out = self.radius_at(x) * lump * random.random_range(0.7f32..=1.0).sqrt();
            let z = crown + x * (height - crown);
            let from = axis((z - out * self.rise).clamp(crown * 0.8, tip));
            let outward = Vec3::X.rotate_z(azimuth);
            let end = from.with_z(z) + outward * out;
            let along = |u: f32| from.lerp(end, u) + Vec3::Z * out * 0.08 * (1.0 - (2.0 * u - 1.0).abs());
            let knee = along(0.5);
            let thick = (girth(from.z) * 0.5).min(0.012 + 0.02 * out);
            parts.push(branch(from, knee, [thick, thick * 0.6]));
            parts.push(branch(knee, end, [thick * 0.6, thick * 0.2]));
            let twigs = 4u8;
            for twig in 0..twigs {
                let start =
                    along(0.42 + 0.58 * (f32::from(twig) + random.random::<f32>()) / f32::from(twigs));
                let reach = random.random_range(0.2..=0.42) * (0.5 + out * 0.4);
                let way = direction(random) + (outward + Vec3::Z * 0.35) * 0.7;
                let stop = start + way.normalize() * reach;
                parts.push(branch(start, stop, [thick * 0.3, 0.004]));
                let spread = 0.1 + 0.075 * out.min(3.0) + 0.05 * random.random::<f32>();
                parts.extend(self.cluster(stop, spread, leaves, random));
            }
        }
        parts.extend(self.cluster(axis(tip) + Vec3::Z * 0.2, 0.3, leaves * 6, random));
        parts
    }

    /// Radius of the crown at relative height `x` within it.
    fn radius_at(&self, x: f32) -> f32 {
        let place = x * (self.outline.len() - 1) as f32;
        let below = (place as usize).min(self.outline.len() - 2);
        self.radius * self.outline[below].lerp(self.outline[below + 1], place - below as f32)
    }

    /// `count` leaves about `centre`.
    fn cluster(&self, centre: Vec3, spread: f32, count: u16, random: &mut Random) -> Vec<Primitive> {
        let leaf = |_| {
            let offset = Vec3::from_array([1.0, 1.0, 0.8].map(|wide| wide * gauss(random))) * spread;
            leaf(centre + offset, self.leaf, random)
        };
        (0..count).map(leaf).collect()
    }
}

impl Palm {
    pub(super) fn build(&self, random: &mut Random) -> Vec<Primitive> {
        let mut parts = Vec::new();
        let &Self { trunk, fronds, frond, leaflet } = self;
        let (top, radius) = (vec3(0.05, 0.0, trunk), 0.1 + trunk * 0.012);
        parts.push(branch(Vec3::ZERO, top, [radius * 1.25, radius]));
        for number in 0..fronds {
            let azimuth = f32::from(number) * TURN + random.random_range(-0.2..=0.2);
            let (outward, side) = (Vec3::X.rotate_z(azimuth), Vec3::Y.rotate_z(azimuth));
            let steep = random.random_range(0.05..=1.25); // inner fronds stand up, outer ones hang
            let point = |u: f32| {
                let out = u * (1.0 - 0.25 * u * (1.0 - steep * 0.5));
                top + (outward * out + Vec3::Z * (steep * u - (0.55 + 0.35 * steep) * u * u)) * frond
            };
            let pieces = 12u8;
            for piece in 0..pieces {
                let [u, v] = [piece, piece + 1].map(|end| f32::from(end) / f32::from(pieces));
                let (a, b) = (point(u), point(v));
                parts.push(Shape::Rod(a, b, [0.014, 0.010]).of(Material::Leaf));
                let length = frond * 0.24 * (PI * (0.12 + 0.82 * v)).sin();
                // Two narrow leaflets on each side, with gaps: a frond lets half of the light through.
                for (hand, start) in [(1.0, 0.0), (1.0, 0.5), (-1.0, 0.0), (-1.0, 0.5)] {
                    let foot = a.lerp(b, start);
                    let tip = foot + (side * hand + outward * 0.45 - Vec3::Z * 0.3) * length;
                    let wide = (b - a) * leaflet;
                    parts.push(Shape::Triangle([foot - wide, foot + wide, tip]).of(Material::Leaf));
                }
            }
        }
        parts
    }
}
