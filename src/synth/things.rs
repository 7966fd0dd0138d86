//! Cars, poles, signs, street furniture, fences and people.

use glam::{Vec3, vec3};

use super::build::Builder;
use super::material::Material;
use super::scene::Model;

/// One or more models of every kind; x along the street, y away from the road.
pub(super) fn models() -> Vec<(&'static str, Model)> {
    let mut all: Vec<(&'static str, Builder)> = Vec::new();
    for paint in [Material::Paint, Material::Paint, Material::DarkPaint] {
        all.extend(CARS.iter().map(|shape| (shape.kind, car(shape, paint))));
    }
    all.extend([8.2f32, 9.2].map(|height| ("lamp", lamp(height, &[-1.0]))));
    all.push(("lamp_double", lamp(10.5, &[-1.0, 1.0])));
    all.extend([2.7f32, 3.1, 3.6].map(|height| ("sign", sign(height))));
    all.push(("gantry", signal_gantry()));
    all.push(("gantry_signs", sign_gantry()));
    all.push(("wood_pole", wood_pole()));
    all.extend([("fence", fence()), ("wall", wall()), ("rail", rail())]);
    all.extend([0.0f32, 0.3].map(|stride| ("person_walking", person(0.15 + stride))));
    all.push(("person_standing", person(0.04)));
    all.extend([
        ("bollard", bollard()),
        ("bench", bench()),
        ("bin", bin()),
        ("hydrant", hydrant()),
        ("box", cabinet()),
    ]);
    all.push(("overpass", overpass()));
    all.into_iter().map(|(kind, build)| (kind, Model::new(build.0))).collect()
}

/// Shape of a car: outline in x (front positive) and z from the rear bumper over the roof to the front, the two spans
/// of it that are windscreens, height of the belt line, width.
struct Car {
    kind: &'static str,
    outline: &'static [[f32; 2]],
    glass: [usize; 2],
    belt: f32,
    width: f32,
}

#[rustfmt::skip]
static CARS: [Car; 5] = [
    Car {
        kind: "car_sedan",
        outline: &[[-2.25, 0.35], [-2.27, 0.75], [-2.15, 0.98], [-1.65, 1.02], [-0.95, 1.40], [0.25, 1.45],
                   [1.05, 1.0], [2.05, 0.82], [2.22, 0.6], [2.2, 0.35]],
        glass: [3, 5], belt: 0.95, width: 1.78,
    },
    Car {
        kind: "car_hatch",
        outline: &[[-1.95, 0.35], [-2.0, 0.75], [-1.95, 0.95], [-1.6, 1.42], [-0.2, 1.52], [0.3, 1.48],
                   [1.1, 1.0], [1.85, 0.82], [2.0, 0.6], [1.98, 0.35]],
        glass: [2, 5], belt: 0.95, width: 1.72,
    },
    Car {
        kind: "car_wagon",
        outline: &[[-2.35, 0.35], [-2.38, 0.8], [-2.3, 0.98], [-1.95, 1.42], [-0.4, 1.50], [0.25, 1.46],
                   [1.1, 1.0], [2.1, 0.84], [2.3, 0.6], [2.28, 0.35]],
        glass: [2, 5], belt: 0.96, width: 1.80,
    },
    Car {
        kind: "car_suv",
        outline: &[[-2.2, 0.4], [-2.25, 0.9], [-2.2, 1.1], [-1.95, 1.62], [-0.4, 1.74], [0.2, 1.70],
                   [0.95, 1.15], [2.0, 1.02], [2.25, 0.75], [2.22, 0.4]],
        glass: [2, 5], belt: 1.08, width: 1.86,
    },
    Car {
        kind: "car_van",
        outline: &[[-2.5, 0.4], [-2.55, 1.0], [-2.5, 1.2], [-2.42, 1.92], [0.4, 2.0], [1.1, 1.92],
                   [1.75, 1.2], [2.3, 1.05], [2.5, 0.7], [2.48, 0.4]],
        glass: [2, 5], belt: 1.15, width: 1.95,
    },
];

fn car(car: &Car, paint: Material) -> Builder {
    let Car { outline, glass, belt, width, .. } = *car;
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

/// A tapering mast with an arm to every side named (-1 over the road).
fn lamp(height: f32, arms: &[f32]) -> Builder {
    let mut build = Builder::default();
    build.rod(Vec3::ZERO, Vec3::Z * 1.1, [0.13, 0.12], Material::Metal);
    build.rod(Vec3::Z * 1.1, Vec3::Z * height, [0.1, 0.065], Material::Metal);
    for side in arms {
        let (start, knee) = (Vec3::Z * (height - 0.1), vec3(0.0, side * 0.9, height + 0.35));
        let end = vec3(0.0, side * 2.3, height + 0.5);
        build.rod(start, knee, [0.045, 0.04], Material::Metal);
        build.rod(knee, end, [0.04, 0.035], Material::Metal);
        build.stand([0.0, side * 2.5, height + 0.42], [0.26, 0.75, 0.14], Material::Metal);
    }
    build
}

fn sign(height: f32) -> Builder {
    let mut build = Builder::default();
    build.post(height, [0.035, 0.035], Material::Metal);
    // Signs face the traffic, along x.
    match (height * 10.0) as u32 {
        0..=28 => build.stand([0.045, 0.0, height - 0.62], [0.012, 0.6, 0.6], Material::Retro),
        29..=33 => build.disc(vec3(0.05, 0.0, height - 0.32), Vec3::X, 0.32, Material::Retro),
        _ => {
            build.stand([0.045, 0.0, height - 0.75], [0.012, 0.9, 0.7], Material::Retro);
            build.disc(vec3(0.05, 0.0, height - 1.1), Vec3::X, 0.3, Material::Retro);
        }
    }
    build
}

fn signal(build: &mut Builder, at: Vec3) {
    build.stand([at.x, at.y, at.z - 0.5], [0.22, 0.3, 0.95], Material::Metal);
    for z in [-0.3, 0.0, 0.3] {
        build.disc(at + vec3(0.13, 0.0, z), Vec3::X, 0.1, Material::Glass);
    }
}

/// A mast with signals and an arm over the road that carries more.
fn signal_gantry() -> Builder {
    let mut build = Builder::default();
    build.post(6.6, [0.13, 0.1], Material::Metal);
    build.rod(vec3(0.0, 0.0, 6.2), vec3(0.0, -6.0, 6.4), [0.08, 0.05], Material::Metal);
    for y in [-3.1, -5.6] {
        signal(&mut build, vec3(0.1, y, 5.9));
    }
    build.stand([0.06, -4.3, 5.9], [0.02, 1.4, 0.8], Material::Retro);
    signal(&mut build, vec3(0.1, -0.25, 3.1));
    build
}

/// A portal over one carriageway.
fn sign_gantry() -> Builder {
    let mut build = Builder::default();
    for y in [0.0, -11.6] {
        build.rod(vec3(0.0, y, 0.0), vec3(0.0, y, 6.9), [0.16, 0.16], Material::Metal);
    }
    for z in [6.0, 6.8] {
        for x in [-0.35, 0.35] {
            build.rod(vec3(x, 0.0, z), vec3(x, -11.6, z), [0.06, 0.06], Material::Metal);
        }
    }
    for y in 0..12 {
        let (y, z) = (-(y as f32), [6.0, 6.8][y % 2]);
        build.rod(vec3(-0.35, y, z), vec3(-0.35, y - 0.95, 12.8 - z), [0.03, 0.03], Material::Metal);
    }
    for y in [-2.6, -7.4] {
        build.stand([0.45, y, 5.6], [0.05, 3.6, 2.1], Material::Retro);
    }
    build
}

/// Height of the cross-arm of [`wood_pole`], and its insulators' places in y.
pub(super) const WIRE_HEIGHT: f32 = 8.1;
pub(super) const WIRE_PLACES: [f32; 3] = [-0.75, 0.0, 0.75];

fn wood_pole() -> Builder {
    let mut build = Builder::default();
    build.post(8.6, [0.15, 0.1], Material::Wood);
    build.stand([0.0, 0.0, WIRE_HEIGHT - 0.12], [0.1, 1.7, 0.12], Material::Wood);
    for y in WIRE_PLACES {
        build.rod(
            vec3(0.0, y, WIRE_HEIGHT - 0.02),
            vec3(0.0, y, WIRE_HEIGHT + 0.12),
            [0.04, 0.03],
            Material::Metal,
        );
    }
    build
}

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

fn fence() -> Builder {
    let mut build = Builder::default();
    for x in 0..14 {
        build.stand([x as f32 * 0.18 - 1.17, 0.0, 0.08], [0.08, 0.025, 1.05], Material::Wood);
    }
    for z in [0.3, 0.85] {
        build.block([-1.25, 0.012, z], [1.25, 0.05, z + 0.07], Material::Wood);
    }
    build.stand([-1.2, 0.06, 0.0], [0.1, 0.1, 1.2], Material::Wood);
    build
}

fn wall() -> Builder {
    let mut build = Builder::default();
    build.block([-1.25, -0.13, -0.3], [1.25, 0.13, 1.35], Material::Plaster);
    build.block([-1.25, -0.18, 1.35], [1.25, 0.18, 1.43], Material::Paving);
    build
}

fn rail() -> Builder {
    let mut build = Builder::default();
    build.stand([0.0, 0.06, 0.0], [0.06, 0.12, 0.75], Material::Metal);
    for z in [0.45, 0.62] {
        build.rod(vec3(-1.25, -0.03, z), vec3(1.25, -0.03, z), [0.075, 0.075], Material::Metal);
    }
    build
}

fn person(stride: f32) -> Builder {
    let mut build = Builder::default();
    let hip = 0.86;
    for (side, step) in [(1.0f32, stride), (-1.0, -stride)] {
        build.rod(vec3(step, side * 0.09, 0.05), vec3(0.0, side * 0.08, hip), [0.06, 0.085], Material::Cloth);
        build.ball([step + 0.05, side * 0.09, 0.05], [0.13, 0.05, 0.05], Material::Rubber);
        build.rod(
            vec3(-step * 0.8, side * 0.25, 0.85),
            vec3(0.0, side * 0.2, 1.38),
            [0.04, 0.05],
            Material::Cloth,
        );
    }
    build.ball([0.0, 0.0, 1.15], [0.14, 0.21, 0.36], Material::Cloth);
    build.ball([0.0, 0.0, 1.61], [0.1, 0.09, 0.12], Material::Bark);
    build
}

fn bollard() -> Builder {
    let mut build = Builder::default();
    build.rod(Vec3::ZERO, Vec3::Z * 0.95, [0.07, 0.06], Material::Metal);
    build.ball([0.0, 0.0, 0.96], [0.08, 0.08, 0.08], Material::Metal);
    build
}

fn bench() -> Builder {
    let mut build = Builder::default();
    for y in [-0.16, 0.0, 0.16] {
        build.stand([0.0, y, 0.44], [1.8, 0.12, 0.04], Material::Wood);
    }
    for z in [0.6, 0.78] {
        build.stand([0.0, 0.27, z], [1.8, 0.04, 0.13], Material::Wood);
    }
    for x in [-0.75, 0.75] {
        build.stand([x, 0.03, 0.0], [0.06, 0.5, 0.44], Material::Metal);
    }
    build
}

fn bin() -> Builder {
    let mut build = Builder::default();
    build.post(0.92, [0.2, 0.24], Material::Metal);
    build.ball([0.0, 0.0, 0.92], [0.24, 0.24, 0.1], Material::Metal);
    build
}

fn hydrant() -> Builder {
    let mut build = Builder::default();
    build.post(0.62, [0.1, 0.09], Material::Metal);
    build.ball([0.0, 0.0, 0.62], [0.12, 0.12, 0.13], Material::Metal);
    build.rod(vec3(-0.18, 0.0, 0.45), vec3(0.18, 0.0, 0.45), [0.05, 0.05], Material::Metal);
    build
}

fn cabinet() -> Builder {
    let mut build = Builder::default();
    build.stand([0.0, 0.0, 0.0], [0.9, 0.4, 1.25], Material::Metal);
    build.stand([0.0, 0.0, 1.25], [0.96, 0.46, 0.05], Material::Metal);
    build
}

/// A road over the road: its middle is at the origin, the street runs along x below it.
fn overpass() -> Builder {
    let mut build = Builder::default();
    build.block([-5.0, -34.0, 5.4], [5.0, 34.0, 6.3], Material::Paving);
    for x in [-5.0, 5.0] {
        build.stand([x, 0.0, 6.3], [0.3, 68.0, 0.9], Material::Paving);
    }
    for y in [-15.5, 0.0, 15.5] {
        for x in [-3.0, 0.0, 3.0] {
            build.rod(vec3(x, y, -1.0), vec3(x, y, 5.4), [0.45, 0.45], Material::Paving);
        }
    }
    build
}
