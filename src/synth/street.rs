//! The street, cell by cell: what stands where. A cell is a pure function of (preset, seed, cell).

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, DVec2, DVec3, Mat3, Mat3A, Vec3, vec3};
use rand::RngExt;

use super::axis::{Axis, CELL, cell_at};
use super::ground::Ground;
use super::preset::{Buildings, Only, Plan, Row, kind};
use super::random::{Random, pick, sequence};
use super::scene::{Model, Owner, Placed};
use super::things;

/// Length of a piece of hedge, fence or rail, metres.
const PIECE: f64 = 2.5;
/// Height of the insulators on a `wood_pole` of `things.toml`.
const WIRE_HEIGHT: f64 = 8.1;

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

/// Numbers of objects that a cell has for itself.
pub(super) const IDS: u32 = 1_000;

/// The street of a drive.
pub(super) struct Street {
    plan: Plan,
    pub(super) axis: Axis,
    library: Library,
}

type Library = BTreeMap<String, Vec<Arc<Model>>>;

impl Street {
    /// The street of a plan; `loop_drive` is the length of a drive that closes.
    pub(super) fn new(plan: Plan, loop_drive: Option<f64>) -> Self {
        let axis = Axis::new(plan.seed, plan.land, loop_drive);
        Self { plan, axis, library: things::models(plan.seed) }
    }

    /// What stands in cell `index`, and its ground.
    pub(super) fn cell(&mut self, index: usize) -> Vec<Placed> {
        let ground = Ground::new(self.plan, &mut self.axis, index);
        let next_id = index as u32 * IDS + 1;
        let mut site =
            Site { library: &self.library, ground, taken: Vec::new(), next_id, placed: Vec::new() };
        site.fill();
        let Site { ground, mut placed, .. } = site;
        let ((model, turn), at) = (ground.mesh(), ground.origin);
        placed.push(Placed { model: Arc::new(model), at, turn, owner: Owner::Ground(Arc::new(ground)) });
        placed
    }
}

/// A cell under construction. Places are given by chainage `s` and offset to the left of the axis.
struct Site<'a> {
    library: &'a Library,
    ground: Ground,
    /// Place and radius of what stands already.
    taken: Vec<(DVec2, f64)>,
    next_id: u32,
    placed: Vec<Placed>,
}

impl Site<'_> {
    fn fill(&mut self) {
        let layout = self.ground.plan.layout(self.ground.cell);
        for (number, row) in layout.rows.iter().enumerate() {
            let sides = if row.once { 1 } else { 2 };
            for (which, side) in [1.0, -1.0].into_iter().enumerate().take(sides) {
                self.row(row, side, (100 + number * 2 + which) as u64);
            }
        }
        if let Some(buildings) = &layout.buildings {
            self.buildings(buildings);
        }
    }

    /// One side of a row, with random numbers of its own.
    fn row(&mut self, row: &'static Row, side: f64, stream: u64) {
        let Ground { plan, start, zebra, .. } = self.ground;
        let [first, next] = [start, start + CELL].map(|s| (s / row.every).ceil() as u64);
        for place in first..next {
            let mut random = sequence(plan.seed, stream, place);
            let s = match (row.only, zebra) {
                (Some(Only::Crossing), None) => continue,
                (Some(Only::Crossing), Some(zebra)) => zebra + side * row.from,
                _ => place as f64 * row.every + row.from + row.jitter * random.random_range(-0.5..0.5),
            };
            let section = plan.section(s);
            let Some(out) = row.out(&section) else { continue };
            let (offset, name) = (side * out, row.pick(&mut random));
            let kind = kind(name);
            let mut group = sequence(plan.seed, stream + 1_000, place / kind.together.max(1));
            let grows = !kind.rooted || section.dip <= 0.0;
            if !group.random_bool(row.share) || !grows || !self.free(s, offset, kind.radius) {
                continue;
            }
            let before = self.placed.len();
            match kind.gap {
                Some(gap) => self.line(row, name, s, offset, gap, &mut random),
                None => self.put(name, s, offset, &mut random),
            }
            if kind.wired {
                self.wires(row, s, offset, &mut random);
            }
            if self.placed.len() > before {
                self.taken.push((DVec2::new(s, offset), kind.radius));
            }
        }
    }

    /// Whether something of radius `r` may stand at a place.
    fn free(&self, s: f64, offset: f64, r: f64) -> bool {
        let Ground { plan, end, zebra, ref frame, .. } = self.ground;
        let section = plan.section(s);
        let over_dip = offset.abs() > section.walk && section.dip > 0.2;
        let on_crossing = offset.abs() < section.kerb && zebra.is_some_and(|zebra| (s - zebra).abs() < 6.0);
        let elsewhere = self.ground.elsewhere(frame.at(s).left(offset));
        let crowded = elsewhere.is_some_and(|(_, (s, other))| {
            other.abs() < plan.section(s).walk + r + 1.0 || other.abs() < offset.abs()
        });
        let place = DVec2::new(s, offset);
        let touched = self.taken.iter().any(|(other, radius)| other.distance(place) <= r + radius);
        s <= end && !over_dip && !on_crossing && !crowded && !touched
    }

    /// A new object of a kind.
    fn object(&mut self, name: &'static str, s: f64, offset: f64, height: f32) -> Arc<Object> {
        let id = self.next_id;
        self.next_id += 1;
        let (class, base) = (kind(name).class, self.ground.at(s, offset));
        Arc::new(Object { id, class, kind: name, base, height: f64::from(height), s })
    }

    /// Places a model that is a part of an object, turned by `turn` from facing away from the road.
    fn place(
        &mut self,
        object: &Arc<Object>,
        model: Arc<Model>,
        s: f64,
        offset: f64,
        turn: f64,
        scale: Vec3,
    ) {
        let turn = if offset >= 0.0 { turn } else { turn + PI };
        let heading = self.ground.frame.at(s).heading;
        let mut shear = Mat3A::IDENTITY;
        if kind(object.kind).inclined {
            let rise = self.ground.at(s + 1.0, offset).z - self.ground.at(s - 1.0, offset).z;
            shear.x_axis.z = (rise * 0.5 * turn.cos()) as f32;
        }
        let turn = Mat3A::from_rotation_z((heading + turn) as f32) * shear * Mat3A::from_diagonal(scale);
        let owner = Owner::Object(Arc::clone(object));
        self.placed.push(Placed { model, at: self.ground.at(s, offset), turn, owner });
    }

    /// Places one of the models of a kind.
    fn put(&mut self, name: &'static str, s: f64, offset: f64, random: &mut Random) {
        let (kind, model) = (kind(name), Arc::clone(pick(&self.library[name], random)));
        let turn = random.random_range(kind.turn.0..=kind.turn.1).to_radians();
        let [wide, tall] = [0; 2].map(|_| 1.0 + random.random_range(-kind.varies..=kind.varies));
        let object = self.object(name, s, offset, model.height() * tall);
        self.place(&object, model, s, offset, f64::from(turn), vec3(wide, wide, tall));
    }

    /// Pieces side by side up to the next place of a row, as one object; up to the share `gap` of them is missing.
    fn line(&mut self, row: &Row, name: &'static str, s: f64, offset: f64, gap: f32, random: &mut Random) {
        let pieces = (row.every / PIECE) as usize;
        let missing = (random.random::<f32>() * pieces as f32 * gap) as usize;
        let section = |s: f64| self.ground.plan.section(s);
        let stands = |s: &f64| self.free(*s, offset, 0.1) && (row.only.is_none() || section(*s).dip > 0.4);
        let places = (0..pieces - missing).map(|piece| s + PIECE * (piece as f64 + 0.5));
        let places: Vec<f64> = places.filter(stands).collect();
        let models = &self.library[name];
        let object = self.object(name, s, offset, models[0].height());
        for s in places {
            self.place(&object, Arc::clone(pick(models, random)), s, offset, 0.0, Vec3::ONE);
        }
    }

    /// The wires from a pole to the next one of its row, if there is one.
    fn wires(&mut self, row: &Row, s: f64, offset: f64, random: &mut Random) {
        let Ground { plan, cell, end, .. } = self.ground;
        let t = s + row.every;
        let goes_on = t < end && std::ptr::eq(plan.layout(cell_at(t)), plan.layout(cell));
        let Some(out) = row.out(&plan.section(t)).filter(|_| goes_on) else { return };
        let way = self.ground.at(t, out) - self.ground.at(s, offset);
        let climb = vec3(way.truncate().length() as f32, 0.0, way.z as f32);
        let to_next =
            Affine3A::from_mat3(Mat3::from_cols(climb, Vec3::Y, Vec3::Z * random.random_range(0.35..=0.8)));
        let model = Model::new(things::of("wires")[0].parts(&to_next, random));
        let object = self.object("wire", s, offset, WIRE_HEIGHT as f32);
        let at = object.base + DVec3::Z * WIRE_HEIGHT;
        let turn = Mat3A::from_rotation_z(way.y.atan2(way.x) as f32);
        self.placed.push(Placed { model: Arc::new(model), at, turn, owner: Owner::Object(object) });
    }

    fn buildings(&mut self, style: &Buildings) {
        let Ground { plan, start, cell, .. } = self.ground;
        let lot = CELL / style.lots_per_cell as f64;
        for place in 0..style.lots_per_cell * 2 {
            let side = if place % 2 == 0 { 1.0 } else { -1.0 };
            let mut random = sequence(plan.seed, 8, (cell * 8 + place) as u64);
            let s = start + lot * ((place / 2) as f64 + 0.5);
            let [a, b] = [s - lot * 0.5, s + lot * 0.5].map(|s| self.ground.frame.at(s).heading);
            // Towards the inside of a bend lots are shorter, and a straight front cuts the arc.
            let bend = (b - a) / lot * side;
            let mut front = plan.section(s).walk + random.random_range(style.setback.0..=style.setback.1);
            let length = lot * (1.0 - (bend * (front + f64::from(style.depth))).max(0.0)).max(0.2);
            let width = length * random.random_range(style.front.0..=style.front.1);
            front += width * width * bend.abs() / 8.0;
            let floors = random.random_range(style.floors.0..=style.floors.1);
            let corners = [(-0.5, 0.0), (0.5, 0.0), (-0.5, 1.0), (0.5, 1.0)];
            let stands = corners.iter().all(|(along, out)| {
                self.free(s + along * width, side * (front + out * f64::from(style.depth)), 0.0)
            });
            if width < 6.0 || !stands || !random.random_bool(style.share) {
                continue;
            }
            let model =
                Arc::new(things::building([width as f32, style.depth], floors, style.house, &mut random));
            let object = self.object("building", s, side * front, model.height());
            self.place(&object, model, s, side * front, 0.0, Vec3::ONE);
        }
    }
}
