//! Buildings: facades with recessed windows, balconies, cornices, shops, flat and gabled roofs.

use glam::{Vec3, vec3};

use super::build::Builder;
use super::material::Material;
use super::random::Random;
use super::scene::Model;
use super::shape::{Facade, Shape};

/// Measures of one building, metres; its front is the line y = 0, x from -width / 2 to width / 2.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measures {
    pub(super) width: f32,
    pub(super) depth: f32,
    pub(super) floors: u32,
    /// A house with a gabled roof and a porch, else a block with shops and a flat roof.
    pub(super) house: bool,
}

/// How far the walls reach below the origin, so that none floats over a slope.
const FOOTING: f32 = 1.5;

struct Style {
    shop: f32,
    storey: f32,
    window: [f32; 2],
    pitch: f32,
    sill: f32,
    depth: f32,
}

/// A building of these measures with a face of its own.
pub(super) fn model(measures: Measures, random: &mut Random) -> Model {
    let mut build = Builder::default();
    let Measures { width, depth, floors, house } = measures;
    let storey = random.range(2.8, 3.3);
    let style = Style {
        shop: if house { 0.4 } else { random.range(3.6, 4.4) },
        storey,
        window: [random.range(1.0, 1.7), storey * random.range(0.42, 0.58)],
        pitch: random.range(2.4, 3.6),
        sill: storey * 0.3,
        depth: random.range(0.12, 0.3),
    };
    let upper = style.storey * if house { floors as f32 } else { (floors - 1) as f32 };
    let eaves = style.shop + upper;
    let (left, right) = (-width * 0.5, width * 0.5);
    let corners =
        [vec3(left, 0.0, 0.0), vec3(right, 0.0, 0.0), vec3(right, depth, 0.0), vec3(left, depth, 0.0)];
    for side in 0..4 {
        let (a, b) = (corners[side], corners[(side + 1) % 4]);
        wall(&mut build, a, b, &style, upper, house);
    }
    if house {
        gable(&mut build, measures, eaves, random);
        porch(&mut build, random);
    } else {
        flat_roof(&mut build, measures, eaves, random);
        fittings(&mut build, measures, &style, random);
    }
    Model::new(build.0)
}

/// A wall from corner `a` to corner `b`, seen from outside: footing, ground floor, upper floors.
fn wall(build: &mut Builder, a: Vec3, b: Vec3, style: &Style, upper: f32, house: bool) {
    let span = b - a;
    let along = span.normalize();
    let width = span.length();
    build.sheet(a - Vec3::Z * FOOTING, span, Vec3::Z * FOOTING, Material::Plaster);
    let facade = |z: f32, height: f32, pitch: [f32; 2], opening: [f32; 2], sill: f32, depth: f32| {
        Shape::Facade(Box::new(Facade {
            corner: a + Vec3::Z * z,
            along,
            size: [width, height],
            pitch,
            opening,
            sill,
            depth,
        }))
    };
    if house {
        build.sheet(a, span, Vec3::Z * style.shop, Material::Plaster);
    } else {
        let pitch = width / (width / 4.2).round().max(1.0);
        let shop = facade(0.0, style.shop, [pitch, style.shop], [pitch - 0.7, style.shop - 1.1], 0.35, 0.35);
        build.add(shop, Material::Plaster);
    }
    let pitch = width / (width / style.pitch).round().max(1.0);
    let window = [style.window[0].min(pitch - 0.5), style.window[1]];
    let floors = facade(style.shop, upper, [pitch, style.storey], window, style.sill, style.depth);
    build.add(floors, Material::Plaster);
}

fn gable(build: &mut Builder, measures: Measures, eaves: f32, random: &mut Random) {
    let Measures { width, depth, .. } = measures;
    let ridge = eaves + depth * random.range(0.3, 0.5);
    let (x0, x1) = (-width * 0.5 - 0.3, width * 0.5 + 0.3);
    let drop = 0.35 * (ridge - eaves) / (depth * 0.5); // the eaves stand out by 0.35 m
    for (y, out) in [(0.0f32, -0.35f32), (depth, 0.35)] {
        let low = vec3(x0, y + out, eaves - drop);
        build.sheet(low, Vec3::X * (x1 - x0), vec3(x0, depth * 0.5, ridge) - low, Material::Roof);
    }
    for x in [-width * 0.5, width * 0.5] {
        build.triangle(
            vec3(x, 0.0, eaves),
            vec3(x, depth, eaves),
            vec3(x, depth * 0.5, ridge),
            Material::Plaster,
        );
    }
    build.stand(
        [width * random.range(-0.3, 0.3), depth * 0.4, eaves],
        [0.6, 0.6, ridge - eaves + 0.5],
        Material::Plaster,
    );
}

fn porch(build: &mut Builder, random: &mut Random) {
    let x = random.range(-2.0, 2.0);
    build.stand([x, -0.7, -0.3], [2.2, 1.4, 0.5], Material::Paving);
    build.stand([x, -0.8, 2.6], [2.6, 1.7, 0.15], Material::Roof);
    for side in [-1.1, 1.1] {
        build.rod(vec3(x + side, -1.4, 0.0), vec3(x + side, -1.4, 2.6), [0.06, 0.06], Material::Wood);
    }
}

fn flat_roof(build: &mut Builder, measures: Measures, eaves: f32, random: &mut Random) {
    let Measures { width, depth, .. } = measures;
    let (left, right) = (-width * 0.5, width * 0.5);
    build.sheet(vec3(left, 0.0, eaves), Vec3::X * width, Vec3::Y * depth, Material::Roof);
    // Cornice in front, parapets around.
    build.block([left - 0.15, -0.4, eaves - 0.25], [right + 0.15, 0.0, eaves + 0.1], Material::Plaster);
    build.block([left, 0.0, eaves], [right, 0.25, eaves + 0.9], Material::Plaster);
    build.block([left, depth - 0.25, eaves], [right, depth, eaves + 0.9], Material::Plaster);
    let x = width * random.range(-0.3, 0.3);
    build.stand([x, depth * 0.5, eaves], [5.0, 4.0, 2.6], Material::Plaster);
    build.stand([x + 6.0, depth * 0.4, eaves], [0.8, 0.8, 1.8], Material::Plaster);
}

/// Balconies on some axes of the front, awnings over the shops.
fn fittings(build: &mut Builder, measures: Measures, style: &Style, random: &mut Random) {
    let bays = (measures.width / style.pitch).round().max(1.0);
    let pitch = measures.width / bays;
    for bay in 1..(bays as u32).saturating_sub(1) {
        if !random.chance(0.22) {
            continue;
        }
        let x = -measures.width * 0.5 + (bay as f32 + 0.5) * pitch;
        let half = (pitch * 0.5 - 0.1).min(1.5);
        let out = random.range(0.9, 1.4);
        for floor in 0..measures.floors - 1 {
            let z = style.shop + floor as f32 * style.storey;
            build.block([x - half, -out, z - 0.15], [x + half, 0.0, z], Material::Paving);
            build.block([x - half, -out, z], [x + half, -out + 0.05, z + 1.0], Material::Metal);
            for side in [-half, half - 0.05] {
                build.block([x + side, -out, z], [x + side + 0.05, 0.0, z + 1.0], Material::Metal);
            }
        }
    }
    for _ in 0..(measures.width / 12.0) as u32 {
        let x = random.range(-0.4, 0.4) * measures.width;
        let (low, high) = (style.shop - 0.95, style.shop - 0.35);
        let edge = vec3(x - 1.8, -1.3, low);
        build.sheet(edge, Vec3::X * 3.6, vec3(0.0, 1.3, high - low), Material::Cloth);
    }
}
