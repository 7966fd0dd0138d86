//! Placed copies of models and the closest hit of a ray among them: a hierarchy of bounding boxes over the copies, and
//! one inside every model.

use std::sync::Arc;

use glam::{Affine3A, DVec3, Mat3A, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ray::{Ray, RayHit};

use super::ground::Ground;
use super::model::{Model, hierarchy};
use super::object::Object;
use super::shape::Surface;

/// A copy of a model.
#[derive(Clone)]
pub(super) struct Placed {
    pub(super) model: Arc<Model>,
    /// Where the model's origin is, metres from the street's origin.
    pub(super) at: DVec3,
    /// How it is turned and stretched.
    pub(super) turn: Mat3A,
    pub(super) owner: Owner,
}

/// What a copy is a part of.
#[derive(Debug, Clone)]
pub(super) enum Owner {
    Ground(Arc<Ground>),
    Object(Arc<Object>),
}

/// A copy within a window.
pub(super) struct Item {
    model: Arc<Model>,
    bounds: Aabb,
    to_model: Affine3A,
    pub(super) owner: Owner,
}

/// Everything within range of the scanner.
pub(super) struct Window {
    /// World coordinates of the window's origin, relative to the street's.
    pub(super) origin: DVec3,
    pub(super) items: Vec<Item>,
    /// Hierarchy over the boxes of the items, each enlarged by some metres on every side.
    bvh: Bvh2,
}

impl Window {
    /// The scene of all copies, about `origin`. Rays that are traced together are nowhere more than `wider` metres
    /// from the middle one.
    pub(super) fn new<'a>(origin: DVec3, wider: f32, placed: impl IntoIterator<Item = &'a Placed>) -> Self {
        let item = |Placed { model, at, turn, owner }: Placed| {
            let to_window = Affine3A { matrix3: turn, translation: (at - origin).as_vec3a() };
            // The box around the transformed box of the model.
            let middle = to_window.transform_point3a(model.bounds().center());
            let half = to_window.matrix3.abs() * (model.bounds().diagonal() * 0.5);
            let bounds = Aabb::new(middle - half, middle + half);
            Item { model, bounds, to_model: to_window.inverse(), owner }
        };
        let items: Vec<Item> = placed.into_iter().cloned().map(item).collect();
        let wider = Vec3A::splat(wider);
        let boxes: Vec<Aabb> =
            items.iter().map(|item| Aabb::new(item.bounds.min - wider, item.bounds.max + wider)).collect();
        Self { origin, items, bvh: hierarchy(&boxes, 1) }
    }

    /// The items that the rays traced together with this one may hit, roughly from near to far.
    pub(super) fn about(&self, origin: Vec3A, direction: Vec3A, far: f32) -> Vec<u32> {
        let mut about = Vec::new();
        self.bvh.ray_traverse_anyhit(Ray::new(origin, direction, 0.0, far), |ray, slot| {
            let index = self.bvh.primitive_indices[slot];
            about.push((self.items[index as usize].bounds.intersect_ray(ray), index));
        });
        about.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        about.into_iter().map(|(_, index)| index).collect()
    }

    /// The object with a number, if it is here.
    pub(super) fn object(&self, id: u32) -> Option<Arc<Object>> {
        self.items.iter().find_map(|item| match &item.owner {
            Owner::Object(object) if object.id == id => Some(Arc::clone(object)),
            _ => None,
        })
    }

    /// The closest hit on the given items along the ray from `near` to `far`, if any. Its instance is the index of
    /// the item.
    pub(super) fn hit(
        &self,
        about: &[u32],
        origin: Vec3A,
        direction: Vec3A,
        near: f32,
        far: f32,
    ) -> Option<RayHit> {
        // The ray starts at `near`: the hierarchy skips boxes behind a ray, but not boxes before its tmin.
        let mut ray = Ray::new(origin + direction * near, direction, 0.0, far - near);
        let mut best = RayHit::none();
        for &index in about {
            let item = &self.items[index as usize];
            if item.bounds.intersect_ray(&ray) >= ray.tmax {
                continue;
            }
            let local = Ray::new(
                item.to_model.transform_point3a(ray.origin),
                item.to_model.transform_vector3a(ray.direction),
                0.0,
                ray.tmax,
            );
            let mut hit = RayHit { instance_id: index, ..RayHit::none() };
            item.model.bvh.ray_traverse(local, &mut hit, |ray, i| item.model.primitives[i].shape.hit(ray));
            if hit.t < ray.tmax {
                ray.tmax = hit.t;
                best = hit;
            }
        }
        best.t += near;
        (best.t < far).then_some(best)
    }

    /// The surface at a hit, with its normal in the window's frame and its point in the model's.
    pub(super) fn surface(&self, hit: &RayHit, origin: Vec3A, direction: Vec3A) -> (Surface, Vec3) {
        let item = &self.items[hit.instance_id as usize];
        let point = Vec3::from(item.to_model.transform_point3a(origin + direction * hit.t));
        let mut surface = item.model.primitives[hit.primitive_id as usize].surface(point);
        // Normals follow the transposed inverse.
        let normal = item.to_model.matrix3.mul_transpose_vec3a(surface.normal.into());
        surface.normal = Vec3::from(normal.normalize_or(Vec3A::Z));
        (surface, point)
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::random::sequence;
    use super::super::shape::Shape;
    use super::super::truth::Truth;
    use super::*;

    #[test]
    fn a_placed_and_stretched_copy_is_hit_where_it_stands() {
        let block = Shape::Block(Vec3::splat(-1.0), Vec3::splat(1.0)).of("metal");
        let model = Arc::new(Model::new(vec![block]));
        // Twice as high, turned by 90 degrees, 10 m east and 5 m north of the window's origin.
        let turn = Mat3A::from_rotation_z(std::f32::consts::FRAC_PI_2)
            * Mat3A::from_diagonal(Vec3::new(1.0, 1.0, 2.0));
        let object = Object {
            id: 7,
            class: 4,
            kind: "box",
            base: DVec3::ZERO,
            height: 2.0,
            s: 0.0,
            truth: Truth::default(),
        };
        let at = DVec3::new(110.0, 5.0, 0.0);
        let placed = Placed { model, at, turn, owner: Owner::Object(Arc::new(object)) };
        let window = Window::new(DVec3::X * 100.0, 0.0, vec![&placed]);
        let o = Vec3A::new(10.0, 5.0, 10.0);
        let d = Vec3A::NEG_Z;
        let about = window.about(o, d, 100.0);
        let hit = window.hit(&about, o, d, 0.0, 100.0).unwrap();
        assert!((hit.t - 8.0).abs() < 1e-4, "{}", hit.t); // top at 2
        let (surface, point) = window.surface(&hit, o, d);
        assert!((surface.normal - Vec3::Z).length() < 1e-5 && (point.z - 1.0).abs() < 1e-5);
        assert!(
            matches!(&window.items[hit.instance_id as usize].owner, Owner::Object(object) if object.id == 7)
        );
        assert!(window.hit(&about, o, d, 0.0, 7.9).is_none());
        assert!(window.hit(&about, o, d, 3.0, 8.1).is_some_and(|hit| (hit.t - 8.0).abs() < 1e-4));
        assert!(window.hit(&[0], o, Vec3A::Z, 0.0, 100.0).is_none());
        assert!(window.about(o, Vec3A::Z, 100.0).is_empty());
    }

    #[test]
    fn rays_about_another_hit_what_they_would_hit_among_all_items() {
        let mut random = sequence(1, 2, 3);
        let mut within = |half: f32| Vec3::from_array([0; 3].map(|_| random.random_range(-half..=half)));
        let leaf = |centre: Vec3| Shape::Disc(centre, centre.normalize(), 0.3).of("leaf");
        let model = Arc::new(Model::new((0..200).map(|_| leaf(within(2.0))).collect()));
        let object = Arc::new(Object {
            id: 7,
            class: 2,
            kind: "tree",
            base: DVec3::ZERO,
            height: 2.0,
            s: 0.0,
            truth: Truth::default(),
        });
        let place = |_| {
            let turn = Mat3A::from_rotation_z(within(3.0).x) * Mat3A::from_diagonal(within(0.3) + Vec3::ONE);
            let owner = Owner::Object(Arc::clone(&object));
            Placed { model: Arc::clone(&model), at: within(30.0).as_dvec3(), turn, owner }
        };
        let placed: Vec<Placed> = (0..300).map(place).collect();
        let far = 60.0;
        let angle = 0.02;
        let window = Window::new(DVec3::ZERO, far * angle, &placed);
        let all: Vec<u32> = (0..300).collect();
        let mut hits = 0;
        let mut few = 0;
        for _ in 0..500 {
            let o = Vec3A::from(within(30.0));
            let middle = Vec3A::from(within(1.0)).normalize();
            let about = window.about(o, middle, far);
            few += usize::from(about.len() < 100);
            for _ in 0..20 {
                let d = (middle + Vec3A::from(within(angle * 0.5))).normalize();
                let [some, any] =
                    [&about, &all].map(|items| window.hit(items, o, d, 1.0, far).map(|hit| hit.t));
                assert_eq!(some, any, "{o} {d}");
                hits += usize::from(any.is_some());
            }
        }
        assert!(hits > 2_000 && few > 450, "{hits} hits, {few} short lists");
    }
}
