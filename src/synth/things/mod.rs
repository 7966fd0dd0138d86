//! The things of `things.toml`, from lamps to trees and buildings, as models.

mod body;
pub(crate) mod object;
pub(crate) mod tree;
pub(crate) mod truth;

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use glam::{Affine3A, Vec3, vec3};
use rand::RngExt;
use serde::Deserialize;

use self::body::Body;
use self::tree::Level;
use crate::synth::random::{Random, named, pick};
use crate::synth::scene::model::Model;
use crate::synth::scene::shape::{Primitive, Shape};
use crate::synth::shipped::shipped;

static THINGS: LazyLock<BTreeMap<String, Vec<Thing>>> =
    LazyLock::new(|| shipped(include_str!("things.toml")));

/// An entry of `things.toml`. That file explains its keys.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Thing {
    models: Option<u8>,
    #[serde(default)]
    parts: Vec<Part>,
    #[serde(default)]
    hulls: Vec<Hull>,
    body: Option<Body>,
    #[serde(default)]
    growth: Vec<Level>,
    #[serde(default)]
    stack: Vec<Storeys>,
}

#[derive(Deserialize)]
struct Part {
    of: String,
    #[serde(flatten)]
    shape: Shape,
    times: Option<u8>,
    #[serde(default)]
    step: Vec3,
    leaves: Option<u16>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hull {
    of: Vec<String>,
    outline: Vec<Vec3>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Storeys {
    of: String,
    count: (u8, u8),
    height: (f32, f32),
}

/// One or more models of every kind; x along the street, y away from the road.
pub(crate) fn models(seed: u64) -> BTreeMap<String, Vec<Arc<Model>>> {
    models_of(&THINGS, seed)
}

/// The models of a table. Every name has a random sequence of its own, so that a new name does not change the
/// models of other names.
fn models_of(table: &BTreeMap<String, Vec<Thing>>, seed: u64) -> BTreeMap<String, Vec<Arc<Model>>> {
    let kind = |(name, things): (&String, &Vec<Thing>)| {
        let mut random = named(seed, name);
        let numbers = |thing| (0..Thing::models(thing)).map(move |number| (thing, number));
        let entries = things.iter().flat_map(numbers);
        let models = entries.map(|(thing, number)| Arc::new(thing.model(number, &mut random)));
        (name.clone(), models.collect())
    };
    table.iter().map(kind).collect()
}

impl Thing {
    /// Number of models of the entry.
    fn models(&self) -> u8 {
        self.models.unwrap_or(1)
    }

    fn model(&self, number: u8, random: &mut Random) -> Model {
        let mut all = self.parts(&Affine3A::IDENTITY, random);
        all.extend(self.hulls.iter().flat_map(|hull| hull.triangles(usize::from(number))));
        if let Some(body) = &self.body {
            all = body.of(&all, random);
        }
        all.extend(tree::grow(&self.growth, &[Vec3::ZERO, Vec3::Z], random));
        let mut foot = 0.0;
        for Storeys { of, count, height } in &self.stack {
            let piece = pick(&THINGS[of], random);
            let height = random.random_range(height.0..=height.1);
            for _ in 0..random.random_range(count.0..=count.1) {
                let upwards = Affine3A::from_translation(Vec3::Z * foot);
                all.extend(piece.parts(&(upwards * Affine3A::from_scale(vec3(1.0, 1.0, height))), random));
                foot += height;
            }
        }
        Model::new(all)
    }

    /// Its parts, with their points transformed into the frame of another thing. Radii and normals stay the
    /// same.
    fn parts(&self, map: &Affine3A, random: &mut Random) -> Vec<Primitive> {
        let mut all = Vec::new();
        for part in &self.parts {
            for copy in 0..part.times.unwrap_or(1) {
                let shape = part.shape.map(|point| map.transform_point3(point + part.step * f32::from(copy)));
                match part.leaves {
                    Some(count) => all.extend(tree::strew(&shape.bounds(), count, random)),
                    None => all.push(shape.of(&part.of)),
                }
            }
        }
        all
    }
}

impl Hull {
    /// The body between the outline and its mirror image, with the material for the model of this number.
    fn triangles(&self, number: usize) -> impl Iterator<Item = Primitive> {
        let span = move |ends: &[Vec3]| {
            let [first, a, b] = [self.outline[0], ends[0], ends[1]];
            // Each point is mirrored only once. When each was mirrored twice, rustc 1.95 lost the sign of one
            // of the two in profile `quick`.
            let [far_first, far_a, far_b] = [first, a, b].map(|point| point * Vec3::new(1.0, -1.0, 1.0));
            [[first, a, b], [far_first, far_a, far_b], [a, b, far_b], [a, far_b, far_a]]
        };
        let triangles = self.outline.windows(2).flat_map(span);
        triangles.map(move |corners| Shape::Triangle(corners).of(&self.of[number % self.of.len()]))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3A, Vec3A};

    use super::*;
    use crate::synth::random::sequence;
    use crate::synth::scene::material::material;
    use crate::synth::scene::{Beam, Owner, Placed, Window};
    use crate::synth::things::object::{Object, Place};
    use crate::synth::things::truth::Truth;

    #[test]
    fn a_new_name_changes_the_models_of_no_other() {
        let parse = |text: &str| shipped::<BTreeMap<String, Vec<Thing>>>(text);
        let text = include_str!("things.toml");
        let before = models_of(&parse(text), 5);
        // The new name sorts before all others, and its models use random numbers.
        let new =
            "[[aaa]]\nmodels = 2\nparts = [{ of = \"leaf\", block = [[0, 0, 0], [1, 1, 1]], leaves = 9 }]\n";
        let after = models_of(&parse(&format!("{text}\n{new}")), 5);
        assert_eq!(after.len(), before.len() + 1);
        let parts = |models: &[Arc<Model>]| {
            models.iter().map(|model| format!("{:?}", model.primitives)).collect::<Vec<_>>()
        };
        for (name, models) in &before {
            assert!(parts(models) == parts(&after[name]), "{name} changes");
        }
        let trees = parts(&before["tree_round"]);
        assert!(trees != parts(&models_of(&parse(text), 6)["tree_round"]), "another seed gives other trees");
    }

    #[test]
    fn hulls_are_symmetric() {
        let hulls = THINGS.values().flatten().flat_map(|thing| &thing.hulls);
        let mut count = 0;
        for hull in hulls {
            let triangles: Vec<[Vec3; 3]> = hull
                .triangles(0)
                .map(|part| match part.shape {
                    Shape::Triangle(corners) => corners,
                    ref other => panic!("{other:?}"),
                })
                .collect();
            for span in triangles.chunks(4) {
                let [[_, a, b], [_, far_a, far_b], near, far] = span else { panic!("four to a span") };
                assert_eq!((*far_a, *far_b), (a.with_y(-a.y), b.with_y(-b.y)));
                assert_eq!((near, far), (&[*a, *b, *far_b], &[*a, *far_b, *far_a]));
                count += 1;
            }
        }
        assert!(count > 20);
    }

    #[test]
    fn storeys_have_walls_reveals_and_glass() {
        // The first kind of storey, stretched to 42 x 16 x 3 m: bays of 3 m, windows 1.4 m wide from 0.9 to
        // 2.34 m.
        let parts =
            THINGS["storey"][0].parts(&Affine3A::from_scale(vec3(42.0, 16.0, 3.0)), &mut sequence(1, 2, 3));
        let object = Object {
            id: 1,
            class: 5,
            kind: "building",
            place: Place::Stands { base: DVec3::ZERO, s: 0.0 },
            height: 3.0,
            truth: Truth::default(),
        };
        let owner = Owner::Object(object.into());
        let model = Model::new(parts).into();
        let at = DVec3::ZERO;
        let turn = Mat3A::IDENTITY;
        let window = Window::new(DVec3::ZERO, 0.0, &[Placed { model, at, turn, owner }]);
        for (origin, direction, t, name) in [
            ([1.5, -5.0, 1.5], [0.0, 1.0, 0.0], 5.2, "glass"), // middle of the first bay to the right
            ([0.0, -5.0, 1.5], [0.0, 1.0, 0.0], 5.0, "plaster"), // between windows
            ([1.5, -5.0, 0.8], [0.0, 1.0, 0.0], 5.0, "plaster"), // below the sill
            ([1.5, -5.0, 2.5], [0.0, 1.0, 0.0], 5.0, "plaster"), // above the window
            ([1.5, 21.0, 1.5], [0.0, -1.0, 0.0], 5.2, "glass"), // from the back
            ([-26.0, 1.6, 1.5], [1.0, 0.0, 0.0], 5.2, "glass"), // from the side
            ([-26.0, 0.3, 1.5], [1.0, 0.0, 0.0], 5.0, "plaster"), // its corner
            ([-2.9, -5.0, 1.5], [1.0, 1.0, 0.0], 5.1, "plaster"), // at 45 degrees: the reveal at x = 2.2
        ] {
            let beam = Beam { origin: Vec3A::from(origin), direction: Vec3A::from(direction), late: 0.0 };
            let hit = window.hit(&[0], &beam, 0.0, 100.0).unwrap();
            assert!((hit.t - t).abs() < 0.03, "{origin:?}: {}", hit.t);
            assert_eq!(*window.surface(&hit, &beam).0.material, *material(name), "{origin:?}");
        }
    }
}
