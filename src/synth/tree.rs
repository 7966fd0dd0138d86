//! Trees, palms, hedges and bushes: trunks and branches of cones, leaves of discs in clusters.

use std::f32::consts::PI;

use glam::{Vec3, vec3};

use super::material::Material;
use super::random::Random;
use super::scene::Model;
use super::shape::{Primitive, Shape};

/// Habit of a tree; lengths in metres.
#[derive(Debug, Clone, Copy)]
struct Habit {
    kind: &'static str,
    height: f32,
    /// Height of the lowest leaves.
    crown: f32,
    radius: f32,
    /// Relative radius of the crown at relative height 0 to 1 within it.
    outline: fn(f32) -> f32,
    branches: usize,
    /// How far a branch rises per metre outwards.
    rise: f32,
    leaves: usize,
    leaf: f32,
}

const fn habit(kind: &'static str, height: f32, crown: f32, radius: f32, outline: fn(f32) -> f32) -> Habit {
    Habit { kind, height, crown, radius, outline, branches: 36, rise: 0.55, leaves: 7_600, leaf: 0.07 }
}

fn habits() -> [Habit; 7] {
    [
        habit("tree_round", 10.0, 2.6, 3.6, |x| (1.0 - (1.7 * x - 0.7).powi(2)).max(0.06).sqrt()),
        habit("tree_beech", 9.0, 1.7, 3.1, |x| (1.0 - x).powf(0.55) * (0.5 + x.min(0.25) * 2.0)),
        Habit {
            rise: 1.4,
            ..habit("tree_vase", 9.8, 2.9, 3.7, |x| {
                0.3 + 0.7 * (x * 1.25).min(1.0) - (x - 0.8).max(0.0) * 2.6
            })
        },
        Habit {
            rise: 2.4,
            leaves: 3_000,
            ..habit("tree_columnar", 10.0, 1.2, 1.15, |x| (1.0 - (1.6 * x - 0.6).powi(2)).max(0.05).sqrt())
        },
        Habit {
            branches: 18,
            leaves: 2_400,
            ..habit("tree_apple", 4.6, 1.35, 2.0, |x| (1.0 - (1.6 * x - 0.6).powi(2)).max(0.1).sqrt())
        },
        Habit {
            leaves: 2_200,
            leaf: 0.045,
            rise: 1.0,
            ..habit("tree_birch", 9.3, 2.2, 1.7, |x| (1.0 - (1.5 * x - 0.5).powi(2)).max(0.05).sqrt())
        },
        Habit {
            branches: 60,
            rise: -0.25,
            leaves: 5_000,
            leaf: 0.05,
            ..habit("tree_conifer", 11.5, 0.8, 2.3, |x| 1.0 - 0.93 * x)
        },
    ]
}

/// Three trees of every habit, palms, hedges and bushes, by kind.
pub(super) fn models(seed: u64) -> Vec<(String, Model)> {
    let mut all = Vec::new();
    for (number, habit) in habits().iter().enumerate() {
        for variant in 0..3 {
            let mut random = Random::new(seed, 10 + number as u64, variant);
            all.push((habit.kind.to_owned(), tree(habit, &mut random)));
        }
    }
    for variant in 0..2 {
        let mut random = Random::new(seed, 30, variant);
        all.push(("tree_palm".to_owned(), palm([5.6, 2.1, 0.12], 15, &mut random)));
        all.push(("tree_sago".to_owned(), palm([0.6, 1.75, 0.26], 32, &mut random)));
        all.push(("hedge".to_owned(), hedge(&mut random)));
        all.push(("bush".to_owned(), bush(&mut random)));
    }
    all
}

fn random_direction(random: &mut Random) -> Vec3 {
    let z = random.range(-1.0, 1.0);
    let (sin, cos) = random.angle().sin_cos();
    let r = (1.0 - z * z).sqrt();
    vec3(r * cos, r * sin, z)
}

/// A cluster of `count` leaves about `centre`.
fn leaves(
    parts: &mut Vec<Primitive>,
    centre: Vec3,
    spread: f32,
    count: usize,
    size: f32,
    random: &mut Random,
) {
    for _ in 0..count {
        let offset = vec3(random.gauss(), random.gauss(), random.gauss() * 0.8) * spread;
        let radius = size * random.range(0.7, 1.25);
        parts.push(
            Shape::Disc(centre + offset, random_direction(random).normalize(), radius).of(Material::Leaf),
        );
    }
}

fn tree(habit: &Habit, random: &mut Random) -> Model {
    let mut parts = Vec::new();
    let girth = 0.012 * habit.height + 0.035;
    // The trunk wanders a little; `axis` gives its middle at a height.
    let lean = [random.range(-0.02, 0.02), random.range(-0.02, 0.02)];
    let phase = random.angle();
    let axis = |z: f32| {
        let bow = 0.09 * ((z * 0.55 + phase).sin() - phase.sin());
        vec3(lean[0] * z + bow, lean[1] * z + bow * 0.6, z)
    };
    let tip = habit.height * 0.9;
    let radius_at = |z: f32| girth * (1.0 - 0.86 * (z / tip)).max(0.1);
    let pieces = 7;
    for piece in 0..pieces {
        let (z0, z1) = (tip * piece as f32 / pieces as f32, tip * (piece + 1) as f32 / pieces as f32);
        let flare = if piece == 0 { 1.35 } else { 1.0 };
        parts.push(Shape::Rod(axis(z0), axis(z1), [radius_at(z0) * flare, radius_at(z1)]).of(Material::Bark));
    }
    let twigs = 4;
    let per_twig = habit.leaves / (habit.branches * twigs + 6);
    let lumps = [random.angle(), random.angle()];
    for branch in 0..habit.branches {
        let x = (branch as f32 + random.unit()) / habit.branches as f32;
        let azimuth = branch as f32 * 2.4 + random.range(-0.4, 0.4); // golden angle: no two branches over each other
        let lump = 0.86 + 0.14 * (2.0 * azimuth + lumps[0]).sin() * (5.0 * x + lumps[1]).cos();
        let out = habit.radius * (habit.outline)(x).max(0.08) * lump * random.range(0.7, 1.0).sqrt();
        let z = habit.crown + x * (habit.height - habit.crown);
        let from = axis((z - out * habit.rise).clamp(habit.crown * 0.8, tip));
        let (sin, cos) = azimuth.sin_cos();
        let end = vec3(from.x + out * cos, from.y + out * sin, z);
        let knee = from.lerp(end, 0.5) + Vec3::Z * out * 0.08;
        let thick = (radius_at(from.z) * 0.5).min(0.012 + 0.02 * out);
        parts.push(Shape::Rod(from, knee, [thick, thick * 0.6]).of(Material::Bark));
        parts.push(Shape::Rod(knee, end, [thick * 0.6, thick * 0.2]).of(Material::Bark));
        for twig in 0..twigs {
            let along = 0.42 + 0.58 * (twig as f32 + random.unit()) / twigs as f32;
            let start =
                if along < 0.5 { from.lerp(knee, along * 2.0) } else { knee.lerp(end, along * 2.0 - 1.0) };
            let reach = random.range(0.2, 0.42) * (0.5 + out * 0.4);
            let stop = start + (random_direction(random) + vec3(cos, sin, 0.35) * 0.7).normalize() * reach;
            parts.push(Shape::Rod(start, stop, [thick * 0.3, 0.004]).of(Material::Bark));
            let spread = 0.1 + 0.075 * out.min(3.0) + 0.05 * random.unit();
            leaves(&mut parts, stop, spread, per_twig, habit.leaf, random);
        }
    }
    leaves(&mut parts, axis(tip) + Vec3::Z * 0.2, 0.3, per_twig * 6, habit.leaf, random);
    Model::new(parts)
}

/// A palm or a cycad: fronds with two rows of leaflets on a trunk.
fn palm([trunk, frond, leaflet_width]: [f32; 3], fronds: usize, random: &mut Random) -> Model {
    let mut parts = Vec::new();
    let radius = 0.1 + trunk * 0.012;
    parts.push(Shape::Rod(Vec3::ZERO, vec3(0.05, 0.0, trunk), [radius * 1.25, radius]).of(Material::Bark));
    let top = vec3(0.05, 0.0, trunk);
    for index in 0..fronds {
        let azimuth = index as f32 * 2.4 + random.range(-0.2, 0.2);
        let (sin, cos) = azimuth.sin_cos();
        let side = vec3(-sin, cos, 0.0);
        let steep = random.range(0.05, 1.25); // inner fronds stand up, outer ones hang
        let point = |u: f32| {
            let out = frond * u * (1.0 - 0.25 * u * (1.0 - steep * 0.5));
            top + vec3(cos * out, sin * out, frond * (steep * u - (0.55 + 0.35 * steep) * u * u))
        };
        let pieces = 12;
        for piece in 0..pieces {
            let (u0, u1) = (piece as f32 / pieces as f32, (piece + 1) as f32 / pieces as f32);
            let (a, b) = (point(u0), point(u1));
            parts.push(Shape::Rod(a, b, [0.014, 0.010]).of(Material::Leaf));
            let length = frond * 0.24 * (PI * (0.12 + 0.82 * u1)).sin();
            for hand in [1.0, -1.0] {
                let leaflet = (side * hand + vec3(cos, sin, 0.0) * 0.45) * length - Vec3::Z * length * 0.3;
                // Two narrow leaflets with gaps: a frond lets half of the light through.
                for start in [0.0, 0.5] {
                    parts.push(
                        Shape::Sheet(a.lerp(b, start), (b - a) * leaflet_width, leaflet).of(Material::Leaf),
                    );
                }
            }
        }
    }
    Model::new(parts)
}

/// Two and a half metres of clipped hedge: an opaque core under a skin of leaves.
fn hedge(random: &mut Random) -> Model {
    let mut parts = Vec::new();
    let size = vec3(2.5, 0.75, 1.4);
    parts.push(Shape::Block(vec3(-1.25, -0.22, 0.0), vec3(1.25, 0.22, 1.18)).of(Material::Leaf));
    for _ in 0..900 {
        let mut point = vec3(random.unit(), random.unit(), random.unit()) - vec3(0.5, 0.5, 0.0);
        // On one of the long sides or the top, up to 15 cm deep.
        let depth = random.unit() * random.unit() * 0.15;
        if random.chance(0.33) {
            point.z = 1.0 - depth / size.z;
        } else {
            point.y = (0.5 - depth / size.y).copysign(point.y);
        }
        let radius = random.range(0.025, 0.05);
        parts
            .push(Shape::Disc(point * size, random_direction(random).normalize(), radius).of(Material::Leaf));
    }
    Model::new(parts)
}

fn bush(random: &mut Random) -> Model {
    let mut parts = Vec::new();
    for _ in 0..9 {
        let (sin, cos) = random.angle().sin_cos();
        let centre = vec3(cos * 0.42, sin * 0.42, random.range(0.45, 0.95));
        parts.push(Shape::Rod(Vec3::ZERO, centre, [0.02, 0.008]).of(Material::Bark));
        leaves(&mut parts, centre, 0.2, 70, 0.045, random);
    }
    Model::new(parts)
}
