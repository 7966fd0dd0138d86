//! Small vocabulary for putting models together.

use glam::{Vec3, vec3};

use super::material::Material;
use super::shape::{Primitive, Shape};

/// A model under construction; x along the street, y away from the road, z up, origin on the ground.
#[derive(Debug, Default)]
pub(super) struct Builder(pub(super) Vec<Primitive>);

impl Builder {
    pub(super) fn add(&mut self, shape: Shape, material: Material) {
        self.0.push(Primitive { shape, material });
    }

    pub(super) fn block(&mut self, low: [f32; 3], high: [f32; 3], material: Material) {
        self.add(Shape::Block { low: low.into(), high: high.into() }, material);
    }

    /// A block of `size` with the middle of its base at `at`.
    pub(super) fn stand(&mut self, at: [f32; 3], size: [f32; 3], material: Material) {
        let [x, y, z] = at;
        let [w, d, h] = size;
        self.block([x - w * 0.5, y - d * 0.5, z], [x + w * 0.5, y + d * 0.5, z + h], material);
    }

    /// A rod from `a` to `b` with radii `r`.
    pub(super) fn rod(&mut self, a: Vec3, b: Vec3, r: [f32; 2], material: Material) {
        self.add(Shape::Cone { base: a, axis: b - a, r0: r[0], r1: r[1] }, material);
    }

    /// An upright post at the origin, open at the bottom and closed at the top.
    pub(super) fn post(&mut self, height: f32, r: [f32; 2], material: Material) {
        self.rod(Vec3::ZERO, Vec3::Z * height, r, material);
        self.disc(Vec3::Z * height, Vec3::Z, r[1], material);
    }

    pub(super) fn disc(&mut self, centre: Vec3, normal: Vec3, radius: f32, material: Material) {
        self.add(Shape::Disc { centre, normal: normal.normalize(), radius }, material);
    }

    pub(super) fn ball(&mut self, centre: [f32; 3], radii: [f32; 3], material: Material) {
        self.add(Shape::Ellipsoid { centre: centre.into(), radii: radii.into() }, material);
    }

    pub(super) fn triangle(&mut self, a: Vec3, b: Vec3, c: Vec3, material: Material) {
        self.add(Shape::Sheet { a, u: b - a, v: c - a, half: true }, material);
    }

    /// The quadrilateral a, b, c, d as two triangles.
    pub(super) fn quad(&mut self, [a, b, c, d]: [Vec3; 4], material: Material) {
        self.triangle(a, b, c, material);
        self.triangle(a, c, d, material);
    }

    /// A sheet spanned by `u` and `v` at `a`.
    pub(super) fn sheet(&mut self, a: Vec3, u: Vec3, v: Vec3, material: Material) {
        self.add(Shape::Sheet { a, u, v, half: false }, material);
    }

    /// A body whose outline in the x-z plane is `roof` over the level `floor`, mirrored in y; `half` is its half
    /// width at a height, `skin` the material between two points of the outline.
    pub(super) fn body(
        &mut self,
        roof: &[[f32; 2]],
        floor: f32,
        half: impl Fn(f32) -> f32,
        skin: impl Fn(usize) -> Material,
        belt: f32,
        side: Material,
    ) {
        let at = |[x, z]: [f32; 2], sign: f32| vec3(x, sign * half(z), z);
        for (index, pair) in roof.windows(2).enumerate() {
            let [p, q] = [pair[0], pair[1]];
            self.quad([at(p, 1.0), at(q, 1.0), at(q, -1.0), at(p, -1.0)], skin(index));
            for sign in [1.0, -1.0] {
                let low = |[x, z]: [f32; 2]| [x, z.min(belt)];
                let ground = |[x, _]: [f32; 2]| vec3(x, sign * half(floor), floor);
                self.quad([ground(p), ground(q), at(low(q), sign), at(low(p), sign)], side);
                if p[1] > belt || q[1] > belt {
                    self.quad(
                        [at(low(p), sign), at(low(q), sign), at(q, sign), at(p, sign)],
                        Material::Glass,
                    );
                }
            }
        }
    }
}
