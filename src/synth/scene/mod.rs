//! Placed copies of models and the closest hit of a ray among them: a hierarchy of bounding boxes over the
//! copies, and one inside every model.

pub(crate) mod material;
pub(crate) mod model;
pub(crate) mod shape;

use std::sync::Arc;

use glam::{Affine3A, DVec3, Mat3A, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ray::{Ray, RayHit};

use self::model::{Model, hierarchy};
use self::shape::Surface;
use crate::synth::street::ground::Ground;
use crate::synth::things::object::Object;

/// A copy of a model.
#[derive(Clone)]
pub(crate) struct Placed {
    pub(crate) model: Arc<Model>,
    /// Where the model's origin is, metres from the street's origin.
    pub(crate) at: DVec3,
    /// How it is turned and stretched.
    pub(crate) turn: Mat3A,
    pub(crate) owner: Owner,
}

/// The ground or the object that a copy is a part of.
#[derive(Debug, Clone)]
pub(crate) enum Owner {
    Ground(Arc<Ground>),
    Object(Arc<Object>),
}

/// A copy that moves in a straight line for the moment of a window.
pub(crate) struct Moving {
    /// The copy at its place in the middle of this moment.
    pub(crate) placed: Placed,
    /// Metres per second.
    pub(crate) velocity: DVec3,
}

/// A copy within a window.
struct Item {
    model: Arc<Model>,
    bounds: Aabb,
    to_model: Affine3A,
    owner: Owner,
    /// Metres per second; 0 if the copy stands.
    velocity: Vec3A,
}

/// A ray, in the frame of a window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beam {
    pub(crate) origin: Vec3A,
    /// Unit vector.
    pub(crate) direction: Vec3A,
    /// Seconds since the middle of the moment of the window; negative before it.
    pub(crate) late: f32,
}

impl Beam {
    /// The point at a range.
    pub(crate) fn at(&self, range: f32) -> Vec3A {
        self.origin + self.direction * range
    }
}

/// Everything that stands within range of the scanner.
struct Still {
    items: Vec<Item>,
    /// Hierarchy over the boxes of the items, each enlarged by some metres on every side.
    bvh: Bvh2,
    /// Metres by which the boxes are enlarged.
    wider: f32,
}

/// Everything within range of the scanner for a moment: the standing copies, and the moving ones.
#[derive(Clone)]
pub(crate) struct Window {
    /// World coordinates of the window's origin, relative to the street's.
    pub(crate) origin: DVec3,
    still: Arc<Still>,
    /// The moving items, each with a box around all places where rays of this moment may meet it. Their
    /// indices follow those of the standing items.
    moving: Arc<[(Item, Aabb)]>,
}

impl Item {
    fn new(origin: DVec3, Placed { model, at, turn, owner }: Placed, velocity: DVec3) -> Self {
        let to_window = Affine3A { matrix3: turn, translation: (at - origin).as_vec3a() };
        // The box around the transformed box of the model.
        let middle = to_window.transform_point3a(model.bounds().center());
        let half = to_window.matrix3.abs() * (model.bounds().diagonal() * 0.5);
        let bounds = Aabb::new(middle - half, middle + half);
        Self { model, bounds, to_model: to_window.inverse(), owner, velocity: velocity.as_vec3a() }
    }

    /// The box of the item, enlarged on every side.
    fn enlarged(&self, by: Vec3A) -> Aabb {
        Aabb::new(self.bounds.min - by, self.bounds.max + by)
    }
}

impl Window {
    /// The scene of all standing copies, about `origin`. Rays that are traced together are nowhere more than
    /// `wider` metres from the middle ray.
    pub(crate) fn new<'a>(origin: DVec3, wider: f32, placed: impl IntoIterator<Item = &'a Placed>) -> Self {
        let item = |placed: &Placed| Item::new(origin, placed.clone(), DVec3::ZERO);
        let items: Vec<Item> = placed.into_iter().map(item).collect();
        let boxes: Vec<Aabb> = items.iter().map(|item| item.enlarged(Vec3A::splat(wider))).collect();
        let still = Still { items, bvh: hierarchy(&boxes, 1), wider };
        Self { origin, still: Arc::new(still), moving: Arc::new([]) }
    }

    /// The same window with moving copies. Its rays are at most `half` seconds from the middle of this
    /// moment.
    pub(crate) fn with(&self, moving: Vec<Moving>, half: f64) -> Self {
        let item = |Moving { placed, velocity }| {
            let item = Item::new(self.origin, placed, velocity);
            let bounds = item.enlarged(Vec3A::splat(self.still.wider) + item.velocity.abs() * half as f32);
            (item, bounds)
        };
        Self { moving: moving.into_iter().map(item).collect(), ..self.clone() }
    }

    fn item(&self, index: u32) -> &Item {
        let index = index as usize;
        let still = &self.still.items;
        still.get(index).unwrap_or_else(|| &self.moving[index - still.len()].0)
    }

    /// The ground or the object that was hit.
    pub(crate) fn owner(&self, hit: &RayHit) -> &Owner {
        &self.item(hit.instance_id).owner
    }

    /// The items that the rays traced together with this one may hit, roughly from near to far.
    pub(crate) fn about(&self, beam: &Beam, far: f32) -> Vec<u32> {
        let mut about = Vec::new();
        let Still { items, bvh, .. } = &*self.still;
        let ray = Ray::new(beam.origin, beam.direction, 0.0, far);
        bvh.ray_traverse_anyhit(ray, |ray, slot| {
            let index = bvh.primitive_indices[slot];
            about.push((items[index as usize].bounds.intersect_ray(ray), index));
        });
        for (index, (item, bounds)) in (items.len() as u32..).zip(&*self.moving) {
            if bounds.intersect_ray(&ray) < far {
                about.push((item.bounds.intersect_ray(&ray), index));
            }
        }
        about.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        about.into_iter().map(|(_, index)| index).collect()
    }

    /// The object with a number, if it is in this window.
    pub(crate) fn object(&self, id: u32) -> Option<Arc<Object>> {
        let moving = self.moving.iter().map(|(item, _)| item);
        self.still.items.iter().chain(moving).find_map(|item| match &item.owner {
            Owner::Object(object) if object.id == id => Some(Arc::clone(object)),
            _ => None,
        })
    }

    /// The closest hit on the given items along the beam from `near` to `far`, if any. Its instance is the
    /// index of the item.
    pub(crate) fn hit(&self, about: &[u32], beam: &Beam, near: f32, far: f32) -> Option<RayHit> {
        // The ray starts at `near`: the hierarchy skips boxes behind a ray, but not boxes before its tmin.
        let start = beam.at(near);
        let mut ray = Ray::new(start, beam.direction, 0.0, far - near);
        let mut best = RayHit::none();
        for &index in about {
            let item = self.item(index);
            // The item stays at its place in the middle of the moment. Therefore the ray is shifted against
            // its motion.
            ray.origin = start - item.velocity * beam.late;
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
    pub(crate) fn surface(&self, hit: &RayHit, beam: &Beam) -> (Surface, Vec3) {
        let item = self.item(hit.instance_id);
        let point = beam.at(hit.t) - item.velocity * beam.late;
        let point = Vec3::from(item.to_model.transform_point3a(point));
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

    use super::*;
    use crate::synth::random::sequence;
    use crate::synth::scene::shape::Shape;
    use crate::synth::things::object::Place;
    use crate::synth::things::truth::Truth;

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
            place: Place::Stands { base: DVec3::ZERO, s: 0.0 },
            height: 2.0,
            truth: Truth::default(),
        };
        let at = DVec3::new(110.0, 5.0, 0.0);
        let placed = Placed { model, at, turn, owner: Owner::Object(Arc::new(object)) };
        let window = Window::new(DVec3::X * 100.0, 0.0, vec![&placed]);
        let beam = Beam { origin: Vec3A::new(10.0, 5.0, 10.0), direction: Vec3A::NEG_Z, late: 0.0 };
        let about = window.about(&beam, 100.0);
        let hit = window.hit(&about, &beam, 0.0, 100.0).unwrap();
        assert!((hit.t - 8.0).abs() < 1e-4, "{}", hit.t); // top at 2
        let (surface, point) = window.surface(&hit, &beam);
        assert!((surface.normal - Vec3::Z).length() < 1e-5 && (point.z - 1.0).abs() < 1e-5);
        assert!(matches!(window.owner(&hit), Owner::Object(object) if object.id == 7));
        assert!(window.hit(&about, &beam, 0.0, 7.9).is_none());
        assert!(window.hit(&about, &beam, 3.0, 8.1).is_some_and(|hit| (hit.t - 8.0).abs() < 1e-4));
        let upwards = Beam { direction: Vec3A::Z, ..beam };
        assert!(window.hit(&[0], &upwards, 0.0, 100.0).is_none());
        assert!(window.about(&upwards, 100.0).is_empty());
    }

    #[test]
    fn what_moves_is_hit_where_it_is_at_the_time_of_the_ray() {
        let block = Shape::Block(Vec3::splat(-1.0), Vec3::splat(1.0)).of("metal");
        let model = Arc::new(Model::new(vec![block]));
        let object = Object {
            id: 9,
            class: 4,
            kind: "car",
            place: Place::Moves { speed_kmh: 72.0 },
            height: 1.0,
            truth: Truth::default(),
        };
        let owner = Owner::Object(Arc::new(object));
        let placed = Placed { model, at: DVec3::new(50.0, 0.0, 0.0), turn: Mat3A::IDENTITY, owner };
        // 20 m/s towards the origin.
        let moving = Moving { placed, velocity: DVec3::new(-20.0, 0.0, 0.0) };
        let window = Window::new(DVec3::ZERO, 0.1, &[]).with(vec![moving], 0.1);
        for late in [-0.1, -0.03, 0.0, 0.1] {
            let beam = Beam { origin: Vec3A::ZERO, direction: Vec3A::X, late };
            let about = window.about(&beam, 100.0);
            let hit = window.hit(&about, &beam, 0.0, 100.0).unwrap();
            assert!((hit.t - (49.0 - 20.0 * late)).abs() < 1e-4, "{late} s: {}", hit.t);
            let (surface, point) = window.surface(&hit, &beam);
            assert!((surface.normal.x.abs() - 1.0).abs() < 1e-5 && (point.x + 1.0).abs() < 1e-4);
        }
        // The copy has left this line, or has not reached it yet.
        let beam = |late| Beam { origin: Vec3A::new(51.9, -9.0, 0.0), direction: Vec3A::Y, late };
        let met = |late| window.hit(&window.about(&beam(late), 100.0), &beam(late), 0.0, 100.0).is_some();
        assert!(met(-0.05) && !met(-0.04) && !met(0.1));
        assert!(window.object(9).is_some() && window.object(8).is_none());
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
            place: Place::Stands { base: DVec3::ZERO, s: 0.0 },
            height: 2.0,
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
            let beam = |direction| Beam { origin: o, direction, late: 0.0 };
            let about = window.about(&beam(middle), far);
            few += usize::from(about.len() < 100);
            for _ in 0..20 {
                let d = (middle + Vec3A::from(within(angle * 0.5))).normalize();
                let [some, any] =
                    [&about, &all].map(|items| window.hit(items, &beam(d), 1.0, far).map(|hit| hit.t));
                assert_eq!(some, any, "{o} {d}");
                hits += usize::from(any.is_some());
            }
        }
        assert!(hits > 2_000 && few > 450, "{hits} hits, {few} short lists");
    }
}
