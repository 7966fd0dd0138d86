//! The things of `things.toml`, from lamps to trees, as models; and the wires of an overhead line.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use glam::{Affine3A, Vec3};
use serde::Deserialize;

use super::material::Material;
use super::random::{Random, sequence};
use super::scene::Model;
use super::shape::{Primitive, Shape};
use super::shipped;
use super::tree::{self, Palm, Tree};

static THINGS: LazyLock<BTreeMap<String, Vec<Thing>>> =
    LazyLock::new(|| shipped(include_str!("things.toml")));

/// An entry of `things.toml`, which explains all of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Thing {
    #[serde(default = "once")]
    models: u8,
    #[serde(default)]
    parts: Vec<Part>,
    #[serde(default)]
    hulls: Vec<Hull>,
    tree: Option<Tree>,
    palm: Option<Palm>,
}

#[derive(Deserialize)]
struct Part {
    of: Material,
    #[serde(flatten)]
    shape: Shape,
    #[serde(default = "once")]
    times: u8,
    #[serde(default)]
    step: Vec3,
    #[serde(default)]
    leaves: u16,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hull {
    of: Vec<Material>,
    outline: Vec<Vec3>,
}

fn once() -> u8 {
    1
}

/// One or more models of every kind; x along the street, y away from the road.
pub(super) fn models(seed: u64) -> BTreeMap<String, Vec<Arc<Model>>> {
    let mut library = BTreeMap::new();
    for (stream, (kind, things)) in (10..).zip(THINGS.iter()) {
        let mut random = sequence(seed, stream, 0);
        let entries = things.iter().flat_map(|thing| (0..thing.models).map(move |number| (thing, number)));
        let models = entries.map(|(thing, number)| Arc::new(thing.model(number, &mut random)));
        library.insert(kind.clone(), models.collect());
    }
    library
}

/// The entries of a kind, which there is.
pub(super) fn of(kind: &str) -> &'static [Thing] {
    &THINGS[kind]
}

impl Thing {
    fn model(&self, number: u8, random: &mut Random) -> Model {
        let mut all = self.parts(&Affine3A::IDENTITY, random);
        all.extend(self.hulls.iter().flat_map(|hull| hull.triangles(usize::from(number))));
        all.extend(self.tree.iter().flat_map(|tree| tree.build(random)));
        all.extend(self.palm.iter().flat_map(|palm| palm.build(random)));
        Model::new(all)
    }

    /// Its parts, with their points moved into the frame of another model; radii and normals remain.
    pub(super) fn parts(&self, map: &Affine3A, random: &mut Random) -> Vec<Primitive> {
        let mut all = Vec::new();
        for part in &self.parts {
            for copy in 0..part.times {
                let shape = part.shape.map(|point| map.transform_point3(point + part.step * f32::from(copy)));
                if part.leaves > 0 {
                    all.extend(tree::strew(&shape.bounds(), part.leaves, random));
                } else {
                    all.push(shape.of(part.of));
                }
            }
        }
        all
    }
}

impl Hull {
    /// The body between the outline and its mirror image, of the material for the model of this number.
    fn triangles(&self, number: usize) -> Vec<Primitive> {
        let of = self.of[number % self.of.len()];
        let mirrored = |point: Vec3| point.with_y(-point.y);
        let span = |ends: &[Vec3]| {
            let [first, a, b] = [self.outline[0], ends[0], ends[1]];
            let side = [first, a, b];
            [side, side.map(mirrored), [a, b, mirrored(b)], [a, mirrored(b), mirrored(a)]]
        };
        let triangles = self.outline.windows(2).flat_map(span);
        triangles.map(|corners| Shape::Triangle(corners).of(of)).collect()
    }
}
