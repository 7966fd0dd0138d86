//! Small vocabulary for putting models together.

use glam::Vec3;

use super::material::Material;
use super::shape::{Primitive, Shape};

/// A model under construction; x along the street, y away from the road, z up, origin on the ground.
#[derive(Debug, Default)]
pub(super) struct Builder(pub(super) Vec<Primitive>);

impl Builder {
    pub(super) fn add(&mut self, shape: Shape, material: Material) {
        self.0.push(shape.of(material));
    }

    pub(super) fn block(&mut self, low: [f32; 3], high: [f32; 3], material: Material) {
        self.add(Shape::Block(low.into(), high.into()), material);
    }

    /// A block of `size` with the middle of its base at `at`.
    pub(super) fn stand(&mut self, at: [f32; 3], size: [f32; 3], material: Material) {
        let [x, y, z] = at;
        let [w, d, h] = size;
        self.block([x - w * 0.5, y - d * 0.5, z], [x + w * 0.5, y + d * 0.5, z + h], material);
    }

    pub(super) fn rod(&mut self, a: Vec3, b: Vec3, r: [f32; 2], material: Material) {
        self.add(Shape::Rod(a, b, r), material);
    }

    pub(super) fn triangle(&mut self, a: Vec3, b: Vec3, c: Vec3, material: Material) {
        self.add(Shape::Triangle([a, b, c]), material);
    }

    pub(super) fn sheet(&mut self, a: Vec3, u: Vec3, v: Vec3, material: Material) {
        self.add(Shape::Sheet(a, u, v), material);
    }
}
