//! Cars, wires, and the other things of `things.toml`: poles, signs, street furniture, fences, people.

use std::collections::BTreeMap;

use glam::{Vec3, vec3};
use serde::Deserialize;

use super::material::Material;
use super::scene::Model;
use super::shape::{Primitive, Shape};
use super::shipped;

/// One or more models of every kind; x along the street, y away from the road.
pub(super) fn models() -> Vec<(String, Model)> {
    let Things { cars, things } = shipped(include_str!("things.toml"));
    let mut all = Vec::new();
    for paint in [Material::Paint, Material::Paint, Material::DarkPaint] {
        all.extend(cars.iter().map(|(kind, car)| (kind.clone(), car.parts(paint))));
    }
    for (kind, models) in things {
        all.extend(models.iter().map(|thing| (kind.clone(), thing.parts())));
    }
    all.into_iter().map(|(kind, parts)| (kind, Model::new(parts))).collect()
}

/// What `things.toml` holds, by kind.
#[derive(Deserialize)]
struct Things {
    cars: BTreeMap<String, Car>,
    #[serde(flatten)]
    things: BTreeMap<String, Vec<Thing>>,
}

/// A model of `things.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Thing {
    parts: Vec<Part>,
}

/// A shape that stands `times` times, each `step` further.
#[derive(Deserialize)]
struct Part {
    of: Material,
    #[serde(flatten)]
    shape: Shape,
    #[serde(default = "once")]
    times: u8,
    #[serde(default)]
    step: Vec3,
}

fn once() -> u8 {
    1
}

impl Thing {
    fn parts(&self) -> Vec<Primitive> {
        let copies = |part: &Part| {
            let Part { of, ref shape, times, step } = *part;
            let copy = |number: u8| shape.moved(step * f32::from(number)).of(of);
            (0..times).map(copy).collect::<Vec<_>>()
        };
        self.parts.iter().flat_map(copies).collect()
    }
}

/// Shape of a car: outline in x (front positive) and z from the rear bumper over the roof to the front, the two spans
/// of it that are windscreens, height of the belt line, width.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Car {
    outline: Vec<[f32; 2]>,
    glass: [usize; 2],
    belt: f32,
    width: f32,
}

impl Car {
    fn parts(&self, paint: Material) -> Vec<Primitive> {
        let Self { ref outline, glass, belt, width } = *self;
        let (length, top) =
            outline.iter().fold((0.0f32, 0.0f32), |(x, z), p| (x.max(p[0].abs()), z.max(p[1])));
        // The greenhouse leans in by a quarter of its half width.
        let half = |z: f32| width * 0.5 * (1.0 - 0.25 * ((z - belt) / (top - belt).max(0.3)).clamp(0.0, 1.0));
        let at = |x: f32, z: f32, side: f32| vec3(x, side * half(z), z);
        let mut parts = Vec::new();
        for (index, pair) in outline.windows(2).enumerate() {
            let [[x, z], [next_x, next_z]] = [pair[0], pair[1]];
            let mut span = |low: [f32; 2], high: [f32; 2], sides: [f32; 2], skin: Material| {
                let corners = [
                    at(x, low[0], sides[0]),
                    at(next_x, low[1], sides[0]),
                    at(next_x, high[1], sides[1]),
                    at(x, high[0], sides[1]),
                ];
                parts.extend(Shape::quad(corners).map(|half| half.of(skin)));
            };
            let [floor, belt] = [[0.32; 2], [z.min(belt), next_z.min(belt)]];
            let roof = [z, next_z];
            span(roof, roof, [1.0, -1.0], if glass.contains(&index) { Material::Glass } else { paint });
            for side in [1.0, -1.0] {
                span(floor, belt, [side; 2], paint);
                span(belt, roof, [side; 2], Material::Glass);
            }
        }
        let (x, y) = (length - 0.1, width * 0.5 - 0.1);
        parts.push(Shape::Block(vec3(-x, -y, 0.2), vec3(x, y, 0.33)).of(Material::Rubber));
        for x in [-0.62 * length, 0.64 * length] {
            for y in [-1.0f32, 1.0] {
                let hub = vec3(x, y * (width * 0.5 - 0.19), 0.32);
                let rim = hub + Vec3::Y * y * 0.2;
                parts.push(Shape::Rod(hub, rim, [0.32, 0.32]).of(Material::Rubber));
                parts.push(Shape::Disc(rim, Vec3::Y, 0.32).of(Material::Rubber));
            }
        }
        for x in [-length, length] {
            let plate = Shape::Block(vec3(x - 0.015, -0.25, 0.5), vec3(x + 0.015, 0.25, 0.61));
            parts.push(plate.of(Material::Retro));
        }
        parts
    }
}

/// Height of the cross-arm of a `wood_pole`, and its insulators' places in y.
pub(super) const WIRE_HEIGHT: f32 = 8.1;
pub(super) const WIRE_PLACES: [f32; 3] = [-0.75, 0.0, 0.75];

/// A wire of `span` metres along x from the origin to height `rise`, that sags by `sag`.
pub(super) fn wire(span: f32, rise: f32, sag: f32) -> Model {
    let mut parts = Vec::new();
    let pieces = 10;
    let point = |i: usize| {
        let u = i as f32 / pieces as f32;
        vec3(span * u, 0.0, rise * u - 4.0 * sag * u * (1.0 - u))
    };
    for y in WIRE_PLACES {
        for piece in 0..pieces {
            // Cables of 14 mm, seen by a beam of about as much: the radius that returns an echo is larger.
            let side = Vec3::Y * y;
            let ends = (point(piece) + side, point(piece + 1) + side);
            parts.push(Shape::Rod(ends.0, ends.1, [0.011, 0.011]).of(Material::Metal));
        }
    }
    Model::new(parts)
}
