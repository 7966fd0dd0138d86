//! The solids and surfaces of the scene and their intersections with rays, in the frame of a model.
//! Transforms and the physics of materials are elsewhere.
//!
//! A hit is the smallest `t` in (tmin, tmax) with `origin + t direction` on the surface, or infinity.
//! Directions need not have length one: a ray can be transformed into a scaled model without changing `t`.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;
use serde::Deserialize;

use super::material::{Material, material};

/// No hit.
pub(crate) const MISS: f32 = f32::INFINITY;

/// A primitive: models consist of them, in code and in `things.toml`.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Shape {
    /// Three corners.
    Triangle([Vec3; 3]),
    /// Axis-aligned box: low and high corner.
    Block(Vec3, Vec3),
    /// Side of a cylinder or truncated cone, open at its ends: centres and radii of the ends.
    Rod(Vec3, Vec3, [f32; 2]),
    /// Centre, unit normal and radius.
    Disc(Vec3, Vec3, f32),
    /// Ellipsoid: centre and radii along the axes.
    Ball(Vec3, Vec3),
}

/// A primitive and what it is made of.
#[derive(Debug, Clone)]
pub(crate) struct Primitive {
    pub(crate) shape: Shape,
    pub(crate) material: &'static Material,
}

/// The surface at a hit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    /// Unit normal, on either side.
    pub(crate) normal: Vec3,
    pub(crate) material: &'static Material,
    /// Distance to the rim of a leaf, metres; infinite for other shapes.
    pub(crate) rim: f32,
}

impl Shape {
    /// A primitive of this shape, made of the material with this name.
    pub(crate) fn of(self, name: &str) -> Primitive {
        Primitive { shape: self, material: material(name) }
    }

    /// The same shape with its points mapped.
    pub(crate) fn map(&self, to: impl Fn(Vec3) -> Vec3) -> Self {
        match *self {
            Self::Triangle(corners) => Self::Triangle(corners.map(to)),
            Self::Block(low, high) => Self::Block(to(low), to(high)),
            Self::Rod(start, end, radii) => Self::Rod(to(start), to(end), radii),
            Self::Disc(centre, normal, radius) => Self::Disc(to(centre), normal, radius),
            Self::Ball(centre, radii) => Self::Ball(to(centre), radii),
        }
    }

    /// Where `ray` first meets the surface.
    #[inline]
    pub(crate) fn hit(&self, ray: &Ray) -> f32 {
        let o = ray.origin;
        let d = ray.direction;
        let t = match *self {
            Self::Triangle(corners) => {
                let [v0, v1, v2] = corners.map(Vec3A::from);
                Triangle { v0, v1, v2 }.intersect(ray)
            }
            Self::Block(low, high) => Aabb::new(low.into(), high.into()).intersect_ray(ray),
            Self::Rod(from, to, radii) => return hit_rod(ray, from.into(), (to - from).into(), radii),
            Self::Disc(centre, normal, radius) => {
                let c = Vec3A::from(centre);
                let n = Vec3A::from(normal);
                let t = (c - o).dot(n) / d.dot(n);
                if (o + d * t - c).length_squared() <= radius * radius { t } else { MISS }
            }
            Self::Ball(centre, radii) => return hit_ball(ray, centre.into(), radii.into()),
        };
        if t > ray.tmin && t < ray.tmax { t } else { MISS }
    }

    /// The box around the shape.
    pub(crate) fn bounds(&self) -> Aabb {
        match *self {
            Self::Triangle(corners) => around(corners),
            Self::Block(low, high) => around([low, high]),
            Self::Rod(from, to, [r0, r1]) => {
                let n = (to - from).normalize();
                around_disc(from, n, r0).union(&around_disc(to, n, r1))
            }
            Self::Disc(centre, normal, radius) => around_disc(centre, normal, radius),
            Self::Ball(centre, radii) => around([centre - radii, centre + radii]),
        }
    }
}

fn around<const N: usize>(points: [Vec3; N]) -> Aabb {
    Aabb::from_points(&points.map(Vec3A::from))
}

fn around_disc(centre: Vec3, normal: Vec3, radius: f32) -> Aabb {
    let spread = (Vec3::ONE - normal * normal).max(Vec3::ZERO).map(f32::sqrt) * radius;
    around([centre - spread, centre + spread])
}

impl Primitive {
    /// The surface at `point`, which is on it.
    pub(crate) fn surface(&self, point: Vec3) -> Surface {
        let mut rim = MISS;
        let normal = match self.shape {
            Shape::Triangle([a, b, c]) => (b - a).cross(c - a).normalize(),
            Shape::Block(low, high) => {
                let from_centre = (point - (low + high) * 0.5) / (high - low);
                Vec3::AXES[from_centre.abs().max_position()]
            }
            Shape::Rod(from, to, [r0, r1]) => {
                let n = (to - from).normalize();
                let radial = (point - from).reject_from_normalized(n).normalize_or(Vec3::X);
                (radial + n * ((r0 - r1) / from.distance(to))).normalize()
            }
            Shape::Ball(centre, radii) => ((point - centre) / (radii * radii)).normalize_or(Vec3::Z),
            Shape::Disc(centre, normal, radius) => {
                rim = radius - (point - centre).length();
                normal
            }
        };
        Surface { normal, material: self.material, rim }
    }
}

/// The nearer root of a t^2 + 2 b t + c = 0 that `accept` accepts, counted from `start`.
fn root(ray: &Ray, start: f32, [a, b, c]: [f32; 3], accept: impl Fn(f32) -> bool) -> f32 {
    let spread = (b * b - a * c).sqrt(); // NaN without a root; NaN is never within the ray
    let first = (-b - spread) / a;
    let second = (-b + spread) / a;
    let within = |t: &f32| start + t > ray.tmin && start + t < ray.tmax && accept(*t);
    [first.min(second), first.max(second)].into_iter().find(within).map_or(MISS, |t| start + t)
}

fn hit_rod(ray: &Ray, base: Vec3A, axis: Vec3A, [r0, r1]: [f32; 2]) -> f32 {
    let d = ray.direction;
    // Distances are counted from the point of the ray nearest to the centre. In f32, the square of a range of
    // 100 m would swamp the square of a radius of 1 cm.
    let start = (base + axis * 0.5 - ray.origin).dot(d) / d.length_squared();
    let p = ray.origin + d * start - base;
    let h = axis.length_squared();
    let m = p.dot(axis) / h;
    let n = d.dot(axis) / h;
    let taper = r1 - r0;
    let radius = r0 + taper * m;
    let a = d.length_squared() - n * n * h - (taper * n) * (taper * n);
    let b = p.dot(d) - m * n * h - radius * taper * n;
    let c = p.length_squared() - m * m * h - radius * radius;
    root(ray, start, [a, b, c], |t| (0.0..=1.0).contains(&(m + t * n)))
}

fn hit_ball(ray: &Ray, centre: Vec3A, radii: Vec3A) -> f32 {
    let d = ray.direction / radii;
    let from = (ray.origin - centre) / radii;
    let start = -from.dot(d) / d.length_squared();
    let p = from + d * start;
    root(ray, start, [d.length_squared(), p.dot(d), p.length_squared() - 1.0], |_| true)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
        Ray::new(origin.into(), direction.into(), 0.0, 1_000.0)
    }

    fn check(shape: &Shape, origin: [f32; 3], direction: [f32; 3], expected: f32) {
        let t = shape.hit(&ray(origin, direction));
        let same = if expected == MISS { t == MISS } else { (t - expected).abs() < 1e-4 };
        assert!(same, "{shape:?} from {origin:?} along {direction:?}: {t}, expected {expected}");
        if t.is_finite() {
            let point = Vec3A::from(origin) + Vec3A::from(direction) * t;
            let bounds = shape.bounds();
            let slack = Vec3A::splat(1e-3);
            assert!(point.cmpge(bounds.min - slack).all() && point.cmple(bounds.max + slack).all());
        }
    }

    #[test]
    fn triangles() {
        let triangle = Shape::Triangle([Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0]);
        check(&triangle, [0.5, 0.5, 5.0], [0.0, 0.0, -1.0], 5.0);
        check(&triangle, [0.5, 0.5, 5.0], [0.0, 0.0, -2.0], 2.5); // t counts in directions, not metres
        check(&triangle, [1.5, 1.5, 5.0], [0.0, 0.0, -1.0], MISS); // beyond the diagonal
        check(&triangle, [2.5, 1.5, 5.0], [0.0, 0.0, -1.0], MISS);
        check(&triangle, [0.5, 0.5, 5.0], [1.0, 0.0, 0.0], MISS); // parallel
    }

    #[test]
    fn blocks() {
        let block = Shape::Block(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
        check(&block, [-4.0, 1.0, 1.0], [1.0, 0.0, 0.0], 4.0);
        check(&block, [-1.0, -1.0, 1.0], [1.0, 1.0, 0.0], 1.0); // exactly the edge
        check(&block, [-4.0, 2.5, 1.0], [1.0, 0.0, 0.0], MISS);
    }

    #[test]
    fn rods() {
        let cylinder = Shape::Rod(Vec3::ZERO, Vec3::Z * 4.0, [0.5, 0.5]);
        check(&cylinder, [-10.0, 0.0, 1.0], [1.0, 0.0, 0.0], 9.5);
        check(&cylinder, [-10.0, 0.3, 1.0], [1.0, 0.0, 0.0], 9.6); // sqrt(0.25 - 0.09) = 0.4
        check(&cylinder, [-10.0, 0.0, 4.5], [1.0, 0.0, 0.0], MISS); // above
        check(&cylinder, [0.0, 0.0, 9.0], [0.0, 0.0, -1.0], MISS); // open ends
        let cone = Shape::Rod(Vec3::ZERO, Vec3::Z * 2.0, [1.0, 0.0]);
        check(&cone, [-10.0, 0.0, 1.0], [1.0, 0.0, 0.0], 9.5); // radius 0.5 half way up
        check(&cone, [-10.0, 0.0, -0.5], [1.0, 0.0, 0.0], MISS); // not the mirrored half
        // A wire of 8 mm radius, 80 m away: 80 - 0.008.
        let wire = Shape::Rod(Vec3::new(80.0, -20.0, 7.0), Vec3::new(80.0, 20.0, 7.0), [0.008, 0.008]);
        check(&wire, [0.0, 0.0, 7.0], [1.0, 0.0, 0.0], 79.992);
        check(&wire, [0.0, 0.0, 7.009], [1.0, 0.0, 0.0], MISS);
    }

    #[test]
    fn balls_and_discs() {
        let ellipsoid = Shape::Ball(Vec3::new(5.0, 0.0, 0.0), Vec3::new(1.0, 2.0, 0.5));
        check(&ellipsoid, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 4.0);
        check(&ellipsoid, [5.0, 0.0, 3.0], [0.0, 0.0, -1.0], 2.5);
        check(&ellipsoid, [5.0, 1.0, 3.0], [0.0, 0.0, -1.0], 3.0 - 0.5 * 0.75f32.sqrt()); // y/ry = 1/2
        check(&ellipsoid, [0.0, 0.0, 0.6], [1.0, 0.0, 0.0], MISS);
        let disc = Shape::Disc(Vec3::Z * 2.0, Vec3::Z, 0.5);
        check(&disc, [0.4, 0.0, 5.0], [0.0, 0.0, -1.0], 3.0);
        check(&disc, [0.6, 0.0, 5.0], [0.0, 0.0, -1.0], MISS);
        let leaf = disc.of("leaf");
        assert!((leaf.surface(Vec3::new(0.4, 0.0, 2.0)).rim - 0.1).abs() < 1e-6);
    }
}
