//! The street, cell by cell: what stands where. A cell is a pure function of (preset, seed, cell).

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3, vec3};

use super::axis::{Axis, CELL, Frame, LEAD};
use super::building::{self, Measures};
use super::ground::{Ground, Station, Surfacing};
use super::material::Material;
use super::preset::{Buildings, Layout, Line, Plan, Row};
use super::random::Random;
use super::scene::{Item, Model, Placed, Window};
use super::things;

/// Length of a piece of hedge, fence or rail, metres.
const PIECE: f64 = 2.5;
/// Distance between poles of the overhead line, metres.
const POLES: f64 = 34.0;
/// Height of the insulators on a `wood_pole` of `things.toml`.
const WIRE_HEIGHT: f64 = 8.1;

/// What there is to know of an object, beside its points.
#[derive(Debug, Clone)]
pub(super) struct Object {
    pub(super) class: u8,
    pub(super) kind: &'static str,
    /// Foot, metres from the street's origin.
    pub(super) base: [f64; 3],
    pub(super) height: f64,
    pub(super) s: f64,
}

/// One cell of the street.
pub(super) struct Cell {
    pub(super) frame: Frame,
    origin: [f64; 3],
    pub(super) objects: Vec<Object>,
    placed: Vec<Placed>,
    ground: Arc<Ground>,
    /// Number of the cell's first object in the drive.
    pub(super) first_id: u32,
}

/// The street of a drive.
pub(super) struct Street {
    pub(super) plan: Plan,
    pub(super) axis: Axis,
    library: BTreeMap<String, Vec<Arc<Model>>>,
    /// Number of the first object of every cell made so far, and of the next.
    first_ids: Vec<u32>,
}

/// Class code of a kind, as in the labelled scenes.
fn class_of(kind: &str) -> u8 {
    match kind.split('_').next().unwrap_or(kind) {
        "tree" => 2,
        "lamp" | "sign" | "gantry" | "wood" => 3,
        "car" => 4,
        "building" | "overpass" => 5,
        "hedge" | "fence" | "wall" | "rail" | "bush" => 6,
        "wire" => 8,
        _ => 7,
    }
}

/// A cell under construction.
struct Site<'a> {
    plan: Plan,
    axis: &'a Axis,
    library: &'a BTreeMap<String, Vec<Arc<Model>>>,
    here: Frame,
    next: Frame,
    /// Other parts of the street within reach.
    foreign: Vec<Frame>,
    end: f64,
    origin: [f64; 3],
    /// Chainage, offset and radius of what stands already.
    taken: Vec<(f64, f64, f64)>,
    objects: Vec<Object>,
    placed: Vec<Placed>,
}

/// Which way a model's y axis points.
#[derive(Clone, Copy, PartialEq)]
enum Facing {
    /// Away from the road.
    Outward,
    /// x in the direction of the traffic.
    Traffic,
    /// Anywhere.
    Free(f32),
}

impl Street {
    /// The street of a plan; `loop_drive` is the length of a drive that closes.
    pub(super) fn new(plan: Plan, loop_drive: Option<f64>) -> Self {
        let library = things::models(plan.seed);
        let axis = Axis::new(plan.seed, plan.preset.terrain(), loop_drive);
        Self { plan, axis, library, first_ids: vec![1] }
    }

    /// Cell `index`, numbered after all cells before it.
    pub(super) fn cell(&mut self, index: usize) -> Cell {
        while self.first_ids.len() <= index {
            let (objects, ..) = self.build(self.first_ids.len() - 1);
            self.count(objects.len());
        }
        let (objects, placed, ground, frame, origin) = self.build(index);
        if self.first_ids.len() == index + 1 {
            self.count(objects.len());
        }
        Cell { frame, origin, objects, placed, ground: Arc::new(ground), first_id: self.first_ids[index] }
    }

    fn count(&mut self, objects: usize) {
        let last = self.first_ids.last().copied().unwrap_or(1);
        self.first_ids.push(last.saturating_add(u32::try_from(objects).unwrap_or(u32::MAX)));
    }

    fn build(&mut self, index: usize) -> (Vec<Object>, Vec<Placed>, Ground, Frame, [f64; 3]) {
        let (here, next) = (self.axis.frame(index), self.axis.frame(index + 1));
        let end = self.axis.street_length().unwrap_or(f64::INFINITY);
        let middle = here.at(here.start() + CELL * 0.5);
        let foreign = if self.axis.closes() {
            let cells = (end / CELL).ceil() as usize;
            let far = (0..cells).filter(|cell| cell.abs_diff(index) > 2);
            let mut frames: Vec<Frame> = far.map(|cell| self.axis.frame(cell)).collect();
            frames.retain(|frame| {
                let other = frame.at(frame.start() + CELL * 0.5);
                (other.x - middle.x).hypot(other.y - middle.y) < 180.0
            });
            frames
        } else {
            Vec::new()
        };
        let origin = [middle.x, middle.y, self.axis.land.height(middle.x, middle.y)];
        let mut site = Site {
            plan: self.plan,
            axis: &self.axis,
            library: &self.library,
            here,
            next,
            foreign,
            end,
            origin,
            taken: Vec::new(),
            objects: Vec::new(),
            placed: Vec::new(),
        };
        let ground = site.fill();
        (site.objects, site.placed, ground, site.here, origin)
    }

    /// Everything in `cells` as one scene, about the origin of the first.
    pub(super) fn window(cells: &[Arc<Cell>]) -> Window {
        let origin = cells.first().map_or([0.0; 3], |cell| cell.origin);
        let mut items = Vec::new();
        for cell in cells {
            let shift = Vec3::from([0, 1, 2].map(|axis| (cell.origin[axis] - origin[axis]) as f32));
            for placed in &cell.placed {
                items.push(match placed.object {
                    Some(object) => {
                        let class = cell.objects[object as usize].class;
                        Item::new(placed, shift, cell.first_id + object, class, None)
                    }
                    None => Item::new(placed, shift, 0, 1, Some(Arc::clone(&cell.ground))),
                });
            }
        }
        Window::new(origin, items)
    }
}

impl Site<'_> {
    fn fill(&mut self) -> Ground {
        let plan = self.plan;
        let cell = self.here.cell;
        let start = self.here.start();
        let layout = plan.layout(cell);
        let mut random = Random::new(plan.seed, 5, cell as u64);
        let zebra = random.chance(layout.crossing).then(|| start + f64::from(random.range(12.0, 38.0)));
        if let Some(zebra) = zebra {
            self.crossing(zebra);
        }
        let over = random.unit();
        let middle = start + CELL * 0.5;
        if over < layout.overpass && plan.bridge(middle).is_none() {
            self.put("overpass", middle, 0.0, Facing::Outward, &mut random);
        } else if over < layout.overpass * 3.0 {
            for side in [1.0, -1.0] {
                let out = self.station(middle).section.kerb + 0.8;
                self.put("gantry_signs", middle, side * out, Facing::Outward, &mut random);
                self.taken.push((middle, side * out, 0.5));
            }
        }
        self.bridge_rails(&mut random);
        for (number, row) in layout.rows.iter().enumerate() {
            self.row(number as u64, row, zebra);
        }
        if layout.wires {
            self.wires();
        }
        if let Some(buildings) = &layout.buildings {
            self.buildings(buildings);
        }
        self.ground(layout, zebra)
    }

    fn ground(&mut self, layout: &'static Layout, zebra: Option<f64>) -> Ground {
        let soft = if layout.paved { Material::Paving } else { Material::Grass };
        let surfacing = Surfacing { verge: soft, yard: soft, zebra };
        let land = &self.axis.land;
        let elsewhere = |x: f64, y: f64| {
            let (frame, s, offset) = self.nearest_foreign(x, y)?;
            Some((self.plan.station(s).height(land, frame, s, offset), offset.abs()))
        };
        let stations = |s: f64| self.plan.station(s);
        let (ground, model, map) =
            Ground::build(land, &self.here, self.origin, &stations, surfacing, self.end, &elsewhere);
        self.placed.push(Placed { model: Arc::new(model), map, object: None });
        ground
    }

    fn station(&self, s: f64) -> Station {
        self.plan.station(s)
    }

    fn frame(&self, s: f64) -> &Frame {
        if s >= self.next.start() { &self.next } else { &self.here }
    }

    fn height(&self, s: f64, offset: f64) -> f64 {
        self.station(s).height(&self.axis.land, self.frame(s), s, offset)
    }

    fn nearest_foreign(&self, x: f64, y: f64) -> Option<(&Frame, f64, f64)> {
        let places = self.foreign.iter().map(|frame| {
            let (s, offset) = frame.nearest(x, y);
            (frame, s, offset)
        });
        places.filter(|(_, s, _)| *s <= self.end).min_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))
    }

    /// Whether something of radius `r` may stand at chainage `s` and `offset`.
    fn free(&self, s: f64, offset: f64, r: f64) -> bool {
        let station = self.station(s);
        let beside = offset.abs() > station.section.walk;
        if s > self.end || (beside && station.dip > 0.2) {
            return false;
        }
        let [x, y] = self.frame(s).at(s).left(offset);
        let crowded = |(_, s, foreign): (&Frame, f64, f64)| {
            foreign.abs() < self.station(s).section.walk + r + 1.0 || foreign.abs() < offset.abs()
        };
        !self.nearest_foreign(x, y).is_some_and(crowded)
            && self.taken.iter().all(|(t, o, q)| (t - s).hypot(o - offset) > r + q)
    }

    /// The map of a model that stands at chainage `s` and `offset`; `tilt` lets x follow the slope of the ground.
    fn map(&self, s: f64, offset: f64, facing: Facing, tilt: bool, scale: Vec3) -> Affine3A {
        let node = self.frame(s).at(s);
        let [x, y] = node.left(offset);
        let z = self.height(s, offset);
        let outward = if offset >= 0.0 { node.heading } else { node.heading + PI };
        let turn = match facing {
            Facing::Outward => outward,
            Facing::Traffic => outward + PI,
            Facing::Free(angle) => f64::from(angle),
        };
        let slope = if tilt {
            let rise = (self.height(s + 1.0, offset) - self.height(s - 1.0, offset)) * 0.5;
            rise * (turn - node.heading).cos()
        } else {
            0.0
        };
        let at = Vec3::from([x - self.origin[0], y - self.origin[1], z - self.origin[2]].map(|v| v as f32));
        let shear = Mat3::from_cols(vec3(1.0, 0.0, slope as f32), Vec3::Y, Vec3::Z);
        Affine3A::from_translation(at)
            * Affine3A::from_rotation_z(turn as f32)
            * Affine3A::from_mat3(shear)
            * Affine3A::from_scale(scale)
    }

    fn object(&mut self, kind: &'static str, s: f64, offset: f64, height: f32) -> u32 {
        let [x, y] = self.frame(s).at(s).left(offset);
        let base = [x, y, self.height(s, offset)];
        let index = self.objects.len() as u32;
        self.objects.push(Object { class: class_of(kind), kind, base, height: f64::from(height), s });
        index
    }

    /// Places one of the models of a kind, if the library has one.
    fn put(&mut self, kind: &'static str, s: f64, offset: f64, facing: Facing, random: &mut Random) {
        let Some(models) = self.library.get(kind) else { return };
        let model = Arc::clone(random.pick(models));
        let scale = match class_of(kind) {
            2 => {
                let wide = random.range(0.82, 1.2);
                vec3(wide, wide, random.range(0.82, 1.22))
            }
            6 if kind == "bush" => Vec3::splat(random.range(0.6, 1.25)),
            7 if kind.starts_with("person") => Vec3::splat(random.range(0.9, 1.06)),
            _ => Vec3::ONE,
        };
        let map = self.map(s, offset, facing, class_of(kind) == 4, scale);
        let object = self.object(kind, s, offset, model.height() * scale.z);
        self.placed.push(Placed { model, map, object: Some(object) });
    }

    /// Pieces side by side from chainage `s` on, as one object.
    fn line(&mut self, kind: &'static str, s: f64, offset: f64, pieces: usize, random: &mut Random) {
        let Some(models) = self.library.get(kind).cloned() else { return };
        let object = self.object(kind, s, offset, models[0].height());
        for piece in 0..pieces {
            let at = s + PIECE * (piece as f64 + 0.5);
            if self.free(at, offset, 0.1) {
                let model = Arc::clone(random.pick(&models));
                let map = self.map(at, offset, Facing::Outward, true, Vec3::ONE);
                self.placed.push(Placed { model, map, object: Some(object) });
            }
        }
    }

    fn crossing(&mut self, zebra: f64) {
        let section = self.station(zebra).section;
        let mut random = Random::new(self.plan.seed, 6, self.here.cell as u64);
        for (side, s) in [(-1.0, zebra - 2.0), (1.0, zebra + 5.6)] {
            let offset = side * (section.kerb + 0.8);
            if self.free(s, offset, 0.5) {
                self.put("gantry", s, offset, Facing::Outward, &mut random);
                self.taken.push((s, offset, 0.5));
            }
        }
    }

    /// Railings on the edges of a bridge's deck.
    fn bridge_rails(&mut self, random: &mut Random) {
        let start = self.here.start();
        let pieces = (CELL / PIECE) as usize;
        let over = |piece: &usize| self.station(start + PIECE * (*piece as f64 + 0.5)).dip > 0.4;
        let covered: Vec<usize> = (0..pieces).filter(over).collect();
        let (Some(first), Some(last)) = (covered.first(), covered.last()) else { return };
        let s = start + PIECE * *first as f64;
        let out = self.station(s).section.walk - 0.15;
        for side in [out, -out] {
            self.line("rail", s, side, last - first + 1, random);
        }
    }

    fn row(&mut self, number: u64, row: &'static Row, zebra: Option<f64>) {
        let start = self.here.start();
        let first = (start / row.every).ceil() as usize;
        let sides: &[f64] = if row.line == Line::Axis { &[1.0] } else { &[1.0, -1.0] };
        for (which, side) in sides.iter().enumerate() {
            for place in (first..).take_while(|k| (*k as f64) * row.every < start + CELL) {
                let mut random = Random::new(self.plan.seed, 100 + number * 2 + which as u64, place as u64);
                let s = place as f64 * row.every + row.jitter * f64::from(random.unit() - 0.5);
                let section = self.station(s).section;
                let line = match row.line {
                    Line::Axis => 0.0,
                    Line::Parking if section.kerb - section.lanes < 1.9 => continue,
                    Line::Parking => (section.lanes + section.kerb) * 0.5,
                    Line::Kerb => section.kerb,
                    Line::Walk => section.walk,
                };
                let kind = random.pick(&row.kinds).as_str();
                let offset = side * (line + row.out);
                let r = match class_of(kind) {
                    2 => 0.45,
                    3 => 0.3,
                    4 => 0.1, // parked cars keep their distance by the spacing of the row
                    _ => 0.35,
                };
                // Cars stand bumper to bumper in groups of up to six, with empty kerb between.
                let share = match class_of(kind) {
                    4 => {
                        let key = (place / 6 * 2 + which) as u64;
                        let group = Random::new(self.plan.seed, 9, key).chance(row.share / 0.85);
                        if group { 0.85 } else { 0.0 }
                    }
                    _ => row.share,
                };
                let crossing = class_of(kind) == 4 && zebra.is_some_and(|z| (s - z - 1.8).abs() < 6.0);
                let on_deck = class_of(kind) == 2 && self.station(s).dip > 0.0;
                if !random.chance(share) || crossing || on_deck || !self.free(s, offset, r) {
                    continue;
                }
                self.taken.push((s, offset, r));
                match kind {
                    "hedge" | "fence" | "wall" | "rail" => {
                        let full = (row.every / PIECE) as usize;
                        let gap =
                            if kind == "rail" { 0 } else { (random.unit() * full as f32 * 0.6) as usize };
                        self.line(kind, s, offset, full - gap, &mut random);
                    }
                    _ => {
                        let facing = match class_of(kind) {
                            4 => Facing::Traffic,
                            2 => Facing::Free(random.angle()),
                            _ if kind.starts_with("person") || kind == "bush" => Facing::Free(random.angle()),
                            _ => Facing::Outward,
                        };
                        self.put(kind, s, offset, facing, &mut random);
                    }
                }
            }
        }
    }

    /// Poles of the overhead line on the left, and the wires to the next pole.
    fn wires(&mut self) {
        let start = self.here.start();
        let first = (start / POLES).ceil() as usize;
        let spot = |site: &Self, place: usize| {
            let s = place as f64 * POLES;
            let out = site.station(s).section.walk - 0.3;
            let [x, y] = site.frame(s).at(s).left(out);
            (s, out, [x, y, site.height(s, out) + WIRE_HEIGHT])
        };
        for place in (first..).take_while(|k| (*k as f64) * POLES < start + CELL) {
            let mut random = Random::new(self.plan.seed, 7, place as u64);
            let (s, out, a) = spot(self, place);
            let (t, _, b) = spot(self, place + 1);
            if s < LEAD || !self.free(s, out, 0.0) {
                continue;
            }
            self.put("wood_pole", s, out, Facing::Outward, &mut random);
            let continues = self.plan.layout((t / CELL) as usize).wires && t < self.end;
            if !continues {
                continue;
            }
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let span = dx.hypot(dy);
            let climb = vec3(span as f32, 0.0, (b[2] - a[2]) as f32);
            let to_next =
                Affine3A::from_mat3(Mat3::from_cols(climb, Vec3::Y, Vec3::Z * random.range(0.35, 0.8)));
            let model = Model::new(things::of("wires")[0].parts(&to_next, &mut random));
            let object = self.object("wire", s, out, WIRE_HEIGHT as f32);
            let at = Vec3::from([0, 1, 2].map(|axis| (a[axis] - self.origin[axis]) as f32));
            let map = Affine3A::from_translation(at) * Affine3A::from_rotation_z(dy.atan2(dx) as f32);
            self.placed.push(Placed { model: Arc::new(model), map, object: Some(object) });
        }
    }

    fn buildings(&mut self, style: &Buildings) {
        let lot = CELL / style.lots_per_cell as f64;
        for place in 0..style.lots_per_cell * 2 {
            let side = if place % 2 == 0 { 1.0 } else { -1.0 };
            let key = (self.here.cell * 8 + place) as u64;
            let mut random = Random::new(self.plan.seed, 8, key);
            let s = self.here.start() + lot * ((place / 2) as f64 + 0.5);
            let section = self.station(s).section;
            let (a, b) = (self.here.at(s - lot * 0.5), self.here.at(s + lot * 0.5));
            // Towards the inside of a bend lots are shorter, and a straight front cuts the arc.
            let bend = (b.heading - a.heading) / lot * side;
            let mut front = section.walk + f64::from(random.range(style.setback.0, style.setback.1));
            let length = lot * (1.0 - (bend * (front + f64::from(style.depth))).max(0.0)).max(0.2);
            let width = length * f64::from(random.range(style.front.0, style.front.1));
            front += width * width * bend.abs() / 8.0;
            let floors =
                style.floors.0 + (random.next() % u64::from(style.floors.1 - style.floors.0 + 1)) as u32;
            let measures = Measures { width: width as f32, depth: style.depth, floors, house: style.house };
            let clear = |along: f64, out: f64| self.free(s + along, side * (front + out), 0.0);
            let corners = [(-0.5, 0.0), (0.5, 0.0), (-0.5, 1.0), (0.5, 1.0)];
            let stands = corners.iter().all(|(u, v)| clear(u * width, v * f64::from(style.depth)));
            if width < 6.0 || !stands || !random.chance(style.share) {
                continue;
            }
            let model = Arc::new(building::model(measures, &mut random));
            let map = self.map(s, side * front, Facing::Outward, false, Vec3::ONE);
            let object = self.object("building", s, side * front, model.height());
            self.placed.push(Placed { model, map, object: Some(object) });
        }
    }
}
