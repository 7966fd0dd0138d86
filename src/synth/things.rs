//! Cars, wires, and the other things of `things.toml`: poles, signs, street furniture, fences, people.

use std::collections::BTreeMap;

use glam::{Vec3, vec3};
use serde::Deserialize;

use super::build::Builder;
use super::material::Material;
use super::scene::Model;

/// One or more models of every kind; x along the street, y away from the road.
pub(super) fn models() -> Vec<(String, Model)> {
    let Things { cars, things } = shipped();
    let mut all = Vec::new();
    for paint in [Material::Paint, Material::Paint, Material::DarkPaint] {
        all.extend(cars.iter().map(|(kind, shape)| (kind.clone(), car(shape, paint))));
    }
    for (kind, models) in things {
        all.extend(models.iter().map(|thing| (kind.clone(), thing.build())));
    }
    all.into_iter().map(|(kind, build)| (kind, Model::new(build.0))).collect()
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

/// A form that stands `times` times, each `step` further.
#[derive(Deserialize)]
struct Part {
    of: Material,
    #[serde(flatten)]
    form: Form,
    #[serde(default = "once")]
    times: u8,
    #[serde(default)]
    step: [f32; 3],
}

/// The forms of parts; their values as [`Builder`] takes them.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Form {
    Stand([f32; 3], [f32; 3]),
    Block([f32; 3], [f32; 3]),
    Post(f32, [f32; 2]),
    Rod([f32; 3], [f32; 3], [f32; 2]),
    Disc([f32; 3], [f32; 3], f32),
    Ball([f32; 3], [f32; 3]),
}

fn once() -> u8 {
    1
}

#[expect(
    clippy::expect_used,
    reason = "the text is part of the program, and every test of a preset parses it"
)]
fn shipped() -> Things {
    toml::from_str(include_str!("things.toml")).expect("the shipped things are valid")
}

impl Thing {
    fn build(&self) -> Builder {
        let mut build = Builder::default();
        for Part { of, form, times, step } in &self.parts {
            for copy in 0..*times {
                let shift = Vec3::from(*step) * f32::from(copy);
                let moved = |at: [f32; 3]| Vec3::from(at) + shift;
                match *form {
                    Form::Stand(at, size) => build.stand(moved(at).into(), size, *of),
                    Form::Block(low, high) => build.block(moved(low).into(), moved(high).into(), *of),
                    Form::Post(height, radii) => build.post(height, radii, *of),
                    Form::Rod(from, to, radii) => build.rod(moved(from), moved(to), radii, *of),
                    Form::Disc(centre, normal, radius) => {
                        build.disc(moved(centre), normal.into(), radius, *of)
                    }
                    Form::Ball(centre, radii) => build.ball(moved(centre).into(), radii, *of),
                }
            }
        }
        build
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

fn car(car: &Car, paint: Material) -> Builder {
    let Car { ref outline, glass, belt, width } = *car;
    let mut build = Builder::default();
    let (length, top) = outline.iter().fold((0.0f32, 0.0f32), |(x, z), p| (x.max(p[0].abs()), z.max(p[1])));
    // The greenhouse leans in by a quarter of its half width.
    let half = |z: f32| width * 0.5 * (1.0 - 0.25 * ((z - belt) / (top - belt).max(0.3)).clamp(0.0, 1.0));
    let skin = |i: usize| if glass.contains(&i) { Material::Glass } else { paint };
    build.body(outline, 0.32, half, skin, belt, paint);
    let (x, y) = (length - 0.1, width * 0.5 - 0.1);
    build.block([-x, -y, 0.2], [x, y, 0.33], Material::Rubber);
    for x in [-0.62 * length, 0.64 * length] {
        for y in [-1.0f32, 1.0] {
            let hub = vec3(x, y * (width * 0.5 - 0.19), 0.32);
            build.rod(hub, hub + Vec3::Y * y * 0.2, [0.32, 0.32], Material::Rubber);
            build.disc(hub + Vec3::Y * y * 0.2, Vec3::Y, 0.32, Material::Rubber);
        }
    }
    for x in [-length, length] {
        build.stand([x, 0.0, 0.5], [0.03, 0.5, 0.11], Material::Retro); // number plates
    }
    build
}

/// Height of the cross-arm of a `wood_pole`, and its insulators' places in y.
pub(super) const WIRE_HEIGHT: f32 = 8.1;
pub(super) const WIRE_PLACES: [f32; 3] = [-0.75, 0.0, 0.75];

/// A wire of `span` metres along x from the origin to height `rise`, that sags by `sag`.
pub(super) fn wire(span: f32, rise: f32, sag: f32) -> Model {
    let mut build = Builder::default();
    let pieces = 10;
    let point = |i: usize| {
        let u = i as f32 / pieces as f32;
        vec3(span * u, 0.0, rise * u - 4.0 * sag * u * (1.0 - u))
    };
    for y in WIRE_PLACES {
        for piece in 0..pieces {
            // Cables of 14 mm, seen by a beam of about as much: the radius that returns an echo is larger.
            let side = Vec3::Y * y;
            build.rod(point(piece) + side, point(piece + 1) + side, [0.011, 0.011], Material::Metal);
        }
    }
    Model::new(build.0)
}
