//! The street, cell by cell: what stands where. A cell is a pure function of (preset, seed, cell).

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, DVec2, DVec3, Mat3, Mat3A, Vec3, vec3};
use rand::RngExt;

use super::axis::{Axis, CELL, cell_at};
use super::ground::Ground;
use super::preset::{Building, Plan, Row, kind};
use super::random::{Random, pick, sequence};
use super::scene::{Model, Owner, Placed};
use super::things;

/// Height of the insulators on a `wood_pole` of `things.toml`.
const WIRE_HEIGHT: f64 = 8.1;
/// Numbers of objects that a cell has for itself.
pub(super) const IDS: u32 = 1_000;

/// What there is to know of an object, beside its points.
#[derive(Debug)]
pub(super) struct Object {
    /// Number in the drive, from 1.
    pub(super) id: u32,
    pub(super) class: u8,
    pub(super) kind: &'static str,
    /// Foot, metres from the street's origin.
    pub(super) base: DVec3,
    pub(super) height: f64,
    pub(super) s: f64,
}

/// Models by kind.
pub(super) type Library = BTreeMap<String, Vec<Arc<Model>>>;

/// A cell under construction. Places are chainage and offset to the left of the axis.
struct Site<'a> {
    library: &'a Library,
    ground: Arc<Ground>,
    /// Place and radius of what stands already.
    taken: Vec<(DVec2, f64)>,
    next_id: u32,
    placed: Vec<Placed>,
}

/// What stands in cell `index` of a plan, and its ground; the axis is laid beyond it.
pub(super) fn cell(plan: Plan, axis: &Axis, library: &Library, index: usize) -> Vec<Placed> {
    let ground = Arc::new(Ground::new(plan, axis, index));
    let (model, owner) = (Arc::new(ground.mesh()), Owner::Ground(Arc::clone(&ground)));
    let turn = Mat3A::from_rotation_z(ground.turn.to_angle() as f32);
    let placed = vec![Placed { model, at: ground.origin, turn, owner }];
    let next_id = index as u32 * IDS + 1;
    let mut site = Site { library, ground, taken: Vec::new(), next_id, placed };
    for (number, row) in plan.layout(index).rows.iter().enumerate() {
        let sides = if row.once { 1 } else { 2 };
        for (which, side) in [1.0, -1.0].into_iter().enumerate().take(sides) {
            site.row(row, side, (100 + number * 2 + which) as u64);
        }
    }
    site.placed
}

impl Site<'_> {
    /// One side of a row, with random numbers of its own.
    fn row(&mut self, row: &'static Row, side: f64, stream: u64) {
        let Ground { plan, start, .. } = *self.ground;
        let [first, next] = [start, start + CELL].map(|s| (s / row.every).ceil() as u64);
        let mut whole: Option<(u64, Arc<Object>)> = None;
        for place in first..next {
            let (group, nth) = (place / row.together, place % row.together);
            let mut random = sequence(plan.seed, stream, place);
            let mut shared = sequence(plan.seed, stream + 1_000, group);
            let s = place as f64 * row.every + row.from + row.jitter * random.random_range(-0.5..=0.5);
            let mut place = DVec2::new(s, side * row.out(&plan.section(s)));
            let name = pick(&row.names, if row.joined.is_some() { &mut shared } else { &mut random });
            let kind = kind(name);
            let missing = row.joined.map_or(0.0, |gap| gap * shared.random::<f64>());
            let goes_on = shared.random_bool(row.share) && nth as f64 / (row.together as f64) < 1.0 - missing;
            let grounded = if row.bridge { plan.dip(s) > 0.4 } else { !kind.rooted || plan.dip(s) <= 0.0 };
            if !goes_on || !grounded || !self.free(place, kind.radius) {
                continue;
            }
            let model = match &row.building {
                None => Arc::clone(pick(&self.library[name], &mut random)),
                Some(style) => match self.building(style, row.every, &mut place, &mut random) {
                    Some(model) => Arc::new(model),
                    None => continue,
                },
            };
            let turn = random.random_range(kind.turn.0..=kind.turn.1).to_radians();
            let [wide, tall] = [0; 2].map(|_| 1.0 + random.random_range(-kind.varies..=kind.varies));
            let object = match whole {
                Some((of, object)) if row.joined.is_some() && of == group => object,
                _ => self.object(name, place, model.height() * tall),
            };
            self.put(&object, model, place, turn, vec3(wide, wide, tall));
            self.taken.push((place, kind.radius));
            whole = Some((group, object));
            if kind.wired {
                self.wires(row, place, &mut random);
            }
        }
    }

    /// Whether something of radius `r` may stand at a place.
    fn free(&self, place: DVec2, r: f64) -> bool {
        let (ground, walk) = (&self.ground, self.ground.plan.section(place.x).walk);
        let over_dip = place.y.abs() > walk && ground.plan.dip(place.x) > 0.2;
        let apart = place.y.abs().max(walk + r + 1.0);
        let crowded = ground.elsewhere(ground.line.at(place.x).left(place.y), apart).is_some();
        let touched = self.taken.iter().any(|(other, radius)| other.distance(place) <= r + radius);
        place.x <= ground.end && !over_dip && !crowded && !touched
    }

    /// A new object of a kind.
    fn object(&mut self, name: &'static str, place: DVec2, height: f32) -> Arc<Object> {
        let id = self.next_id;
        self.next_id += 1;
        let (class, base) = (kind(name).class, self.ground.at(place));
        Arc::new(Object { id, class, kind: name, base, height: f64::from(height), s: place.x })
    }

    /// Puts up a model that is a part of an object, turned by `turn` from facing away from the road.
    fn put(&mut self, object: &Arc<Object>, model: Arc<Model>, place: DVec2, turn: f64, scale: Vec3) {
        let turn = if place.y >= 0.0 { turn } else { turn + PI };
        let mut shear = Mat3A::IDENTITY;
        if kind(object.kind).inclined {
            let [behind, ahead] = [-1.0, 1.0].map(|step| self.ground.at(place + DVec2::X * step).z);
            shear.x_axis.z = ((ahead - behind) * 0.5 * turn.cos()) as f32;
        }
        let turn = Mat3A::from_rotation_z((self.ground.line.at(place.x).way.to_angle() + turn) as f32);
        let (at, owner) = (self.ground.at(place), Owner::Object(Arc::clone(object)));
        self.placed.push(Placed { model, at, turn: turn * shear * Mat3A::from_diagonal(scale), owner });
    }

    /// The wires from a pole to the next one of its row, if there is one.
    fn wires(&mut self, row: &Row, place: DVec2, random: &mut Random) {
        let Ground { plan, cell, end, .. } = *self.ground;
        let s = place.x + row.every;
        if s >= end || !std::ptr::eq(plan.layout(cell_at(s)), plan.layout(cell)) {
            return;
        }
        let next = DVec2::new(s, row.out(&plan.section(s)));
        let way = self.ground.at(next) - self.ground.at(place);
        let climb = vec3(way.truncate().length() as f32, 0.0, way.z as f32);
        let sag = Vec3::Z * random.random_range(0.35..=0.8);
        let to_next = Affine3A::from_mat3(Mat3::from_cols(climb, Vec3::Y, sag));
        let model = Arc::new(Model::new(things::of("wires")[0].parts(&to_next, random)));
        let object = self.object("wire", place, WIRE_HEIGHT as f32);
        let at = object.base + DVec3::Z * WIRE_HEIGHT;
        let turn = Mat3A::from_rotation_z(way.y.atan2(way.x) as f32);
        self.placed.push(Placed { model, at, turn, owner: Owner::Object(object) });
    }

    /// A building on a lot of length `lot` about a place, which is moved to its front; `None` where there is no room.
    fn building(&self, style: &Building, lot: f64, place: &mut DVec2, random: &mut Random) -> Option<Model> {
        let [a, b] = [-0.5, 0.5].map(|end| self.ground.line.at(place.x + lot * end).way);
        // Towards the inside of a bend lots are shorter, and a straight front cuts the arc.
        let bend = a.angle_to(b) / lot * place.y.signum();
        let front = place.y.abs() + random.random_range(0.0..=style.setback);
        let length = lot * (1.0 - (bend * (front + style.depth)).max(0.0)).max(0.2);
        let width = length * random.random_range(style.front.0..=style.front.1);
        place.y = (front + width * width * bend.abs() / 8.0).copysign(place.y);
        let outwards = DVec2::new(width, style.depth.copysign(place.y));
        let corners = [(-0.5, 0.0), (0.5, 0.0), (-0.5, 1.0), (0.5, 1.0)].map(DVec2::from);
        let stands = width >= 6.0 && corners.iter().all(|corner| self.free(*place + *corner * outwards, 0.0));
        let floors = random.random_range(style.floors.0..=style.floors.1);
        let measures = [width as f32, style.depth as f32];
        stands.then(|| things::building(measures, floors, style.house, random))
    }
}
