//! The street, cell by cell: what stands where. A cell is a pure function of (preset, seed, cell).

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, DVec2, DVec3, Mat3, Vec3, vec3};

use super::axis::{Axis, CELL, LEAD};
use super::building::{self, Measures};
use super::ground::Ground;
use super::preset::{Buildings, Facing, Line, Plan, Row, kind};
use super::random::Random;
use super::scene::{Item, Model, Owner, Placed, Window};
use super::{things, tree};

/// Length of a piece of hedge, fence or rail, metres.
const PIECE: f64 = 2.5;
/// Distance between poles of the overhead line, metres.
const POLES: f64 = 34.0;

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

/// One cell of the street.
#[derive(Debug)]
pub(super) struct Cell {
    origin: DVec3,
    placed: Vec<Placed>,
    /// Number of the first object of this cell and of the next one.
    pub(super) first_id: u32,
    next_id: u32,
}

/// The street of a drive.
#[derive(Debug)]
pub(super) struct Street {
    plan: Plan,
    pub(super) axis: Axis,
    library: Library,
    /// Number of the first object of every cell made so far, and of the next.
    first_ids: Vec<u32>,
}

type Library = BTreeMap<String, Vec<Arc<Model>>>;

impl Street {
    /// The street of a plan; `loop_drive` is the length of a drive that closes.
    pub(super) fn new(plan: Plan, loop_drive: Option<f64>) -> Self {
        let mut library = Library::new();
        for (kind, model) in tree::models(plan.seed).into_iter().chain(things::models()) {
            library.entry(kind).or_default().push(Arc::new(model));
        }
        Self { plan, axis: Axis::new(plan.seed, plan.land, loop_drive), library, first_ids: vec![1] }
    }

    /// Cell `index`, numbered after all cells before it.
    pub(super) fn cell(&mut self, index: usize) -> Cell {
        loop {
            let last = self.first_ids.len() - 1;
            let cell = self.build(index.min(last));
            if index >= last {
                self.first_ids.push(cell.next_id);
            }
            if index <= last {
                return cell;
            }
        }
    }

    fn build(&mut self, index: usize) -> Cell {
        let first_id = self.first_ids[index];
        let mut site = Site {
            library: &self.library,
            ground: Ground::new(self.plan, &mut self.axis, index),
            taken: Vec::new(),
            next_id: first_id,
            placed: Vec::new(),
        };
        site.fill();
        let Site { ground, mut placed, next_id, .. } = site;
        let ((model, map), origin) = (ground.mesh(), ground.origin);
        placed.push(Placed { model: Arc::new(model), map, owner: Owner::Ground(Arc::new(ground)) });
        Cell { origin, placed, first_id, next_id }
    }
}

/// Everything in `cells` as one scene, about the origin of the first.
pub(super) fn window<'a>(cells: impl Iterator<Item = &'a Arc<Cell>> + Clone) -> Window {
    let origin = cells.clone().next().map_or(DVec3::ZERO, |cell| cell.origin);
    let items = cells.flat_map(|cell| {
        let shift = (cell.origin - origin).as_vec3();
        cell.placed.iter().map(move |placed| Item::new(placed, shift))
    });
    Window::new(origin, items.collect())
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
        let Ground { plan, cell, start, .. } = self.ground;
        let layout = plan.layout(cell);
        let mut random = Random::new(plan.seed, 5, cell as u64);
        let zebra = random.chance(layout.crossing).then(|| start + f64::from(random.range(12.0, 38.0)));
        self.ground.zebra = zebra;
        if let Some(zebra) = zebra {
            self.crossing(zebra);
        }
        let over = random.unit();
        let middle = start + CELL * 0.5;
        if over < layout.overpass && plan.bridge(middle).is_none() {
            self.put("overpass", middle, 0.0, &mut random);
        } else if over < layout.overpass * 3.0 {
            for side in [1.0, -1.0] {
                let out = plan.section(middle).kerb + 0.8;
                self.put("gantry_signs", middle, side * out, &mut random);
                self.taken.push((DVec2::new(middle, side * out), 0.5));
            }
        }
        self.bridge_rails(&mut random);
        for (number, row) in layout.rows.iter().enumerate() {
            self.row(number as u64, row);
        }
        if layout.wires {
            self.wires();
        }
        if let Some(buildings) = &layout.buildings {
            self.buildings(buildings);
        }
    }

    /// Whether something of radius `r` may stand at a place.
    fn free(&self, s: f64, offset: f64, r: f64) -> bool {
        let ground = &self.ground;
        let section = ground.plan.section(s);
        let over_dip = offset.abs() > section.walk && section.dip > 0.2;
        let foreign = ground.elsewhere(ground.frame.at(s).left(offset));
        let crowded = foreign.is_some_and(|(s, other, _)| {
            other.abs() < ground.plan.section(s).walk + r + 1.0 || other.abs() < offset.abs()
        });
        let place = DVec2::new(s, offset);
        s <= ground.end
            && !over_dip
            && !crowded
            && self.taken.iter().all(|(other, radius)| other.distance(place) > r + radius)
    }

    /// The map of a model that stands at a place, turned from facing away from the road; `inclined` lets x follow the slope of
    /// the ground.
    fn map(&self, s: f64, offset: f64, facing: Facing, inclined: bool, random: &mut Random) -> Affine3A {
        let heading = self.ground.frame.at(s).heading;
        let away = if offset >= 0.0 { heading } else { heading + PI };
        let turn = match facing {
            Facing::Away => away,
            Facing::Traffic => away + PI,
            Facing::Any => f64::from(random.angle()),
        };
        let rise = (self.ground.at(s + 1.0, offset).z - self.ground.at(s - 1.0, offset).z) * 0.5;
        let slope = if inclined { rise * (turn - heading).cos() } else { 0.0 };
        let at = (self.ground.at(s, offset) - self.ground.origin).as_vec3();
        let shear = Mat3::from_cols(vec3(1.0, 0.0, slope as f32), Vec3::Y, Vec3::Z);
        Affine3A::from_translation(at) * Affine3A::from_rotation_z(turn as f32) * Affine3A::from_mat3(shear)
    }

    /// A new object of a kind.
    fn object(&mut self, name: &'static str, s: f64, offset: f64, height: f32) -> Owner {
        let id = self.next_id;
        self.next_id = id.saturating_add(1);
        let (class, base) = (kind(name).class, self.ground.at(s, offset));
        Owner::Object(Arc::new(Object { id, class, kind: name, base, height: f64::from(height), s }))
    }

    /// Places one of the models of a kind, if the library has one.
    fn put(&mut self, name: &'static str, s: f64, offset: f64, random: &mut Random) {
        let Some(models) = self.library.get(name) else { return };
        let kind = kind(name);
        let map = self.map(s, offset, kind.facing, kind.inclined, random);
        let model = Arc::clone(random.pick(models));
        let wide = kind.scale.map_or(1.0, |(low, high)| random.range(low, high));
        let tall = kind.tall.map_or(wide, |(low, high)| random.range(low, high));
        let owner = self.object(name, s, offset, model.height() * tall);
        self.placed.push(Placed { model, map: map * Affine3A::from_scale(vec3(wide, wide, tall)), owner });
    }

    /// Pieces side by side from chainage `s` on, as one object.
    fn line(&mut self, name: &'static str, s: f64, offset: f64, pieces: usize, random: &mut Random) {
        let Some(models) = self.library.get(name) else { return };
        let owner = self.object(name, s, offset, models[0].height());
        for piece in 0..pieces {
            let at = s + PIECE * (piece as f64 + 0.5);
            if self.free(at, offset, 0.1) {
                let model = Arc::clone(random.pick(models));
                let map = self.map(at, offset, Facing::Away, true, random);
                self.placed.push(Placed { model, map, owner: owner.clone() });
            }
        }
    }

    fn crossing(&mut self, zebra: f64) {
        let section = self.ground.plan.section(zebra);
        let mut random = Random::new(self.ground.plan.seed, 6, self.ground.cell as u64);
        for (side, s) in [(-1.0, zebra - 2.0), (1.0, zebra + 5.6)] {
            let offset = side * (section.kerb + 0.8);
            if self.free(s, offset, 0.5) {
                self.put("gantry", s, offset, &mut random);
                self.taken.push((DVec2::new(s, offset), 0.5));
            }
        }
    }

    /// Railings on the edges of a bridge's deck.
    fn bridge_rails(&mut self, random: &mut Random) {
        let Ground { plan, start, .. } = self.ground;
        let pieces = (CELL / PIECE) as usize;
        let over = |piece: &usize| plan.section(start + PIECE * (*piece as f64 + 0.5)).dip > 0.4;
        let covered: Vec<usize> = (0..pieces).filter(over).collect();
        let (Some(first), Some(last)) = (covered.first(), covered.last()) else { return };
        let s = start + PIECE * *first as f64;
        let out = plan.section(s).walk - 0.15;
        for side in [out, -out] {
            self.line("rail", s, side, last - first + 1, random);
        }
    }

    fn row(&mut self, number: u64, row: &'static Row) {
        let Ground { plan, start, zebra, .. } = self.ground;
        let first = (start / row.every).ceil() as usize;
        let sides: &[f64] = if row.line == Line::Axis { &[1.0] } else { &[1.0, -1.0] };
        for (which, side) in sides.iter().enumerate() {
            for place in (first..).take_while(|k| (*k as f64) * row.every < start + CELL) {
                let mut random = Random::new(plan.seed, 100 + number * 2 + which as u64, place as u64);
                let s = place as f64 * row.every + row.jitter * f64::from(random.unit() - 0.5);
                let section = plan.section(s);
                let line = match row.line {
                    Line::Axis => 0.0,
                    Line::Parking if section.kerb - section.lanes < 1.9 => continue,
                    Line::Parking => (section.lanes + section.kerb) * 0.5,
                    Line::Kerb => section.kerb,
                    Line::Walk => section.walk,
                };
                let name = random.pick(&row.kinds).as_str();
                let kind = kind(name);
                let offset = side * (line + row.out);
                // Cars stand bumper to bumper in groups of up to six, with empty kerb between.
                let share = match kind.class {
                    4 => {
                        let key = (place / 6 * 2 + which) as u64;
                        let group = Random::new(plan.seed, 9, key).chance(row.share / 0.85);
                        if group { 0.85 } else { 0.0 }
                    }
                    _ => row.share,
                };
                let crossing = kind.class == 4 && zebra.is_some_and(|z| (s - z - 1.8).abs() < 6.0);
                let on_deck = kind.class == 2 && section.dip > 0.0;
                if !random.chance(share) || crossing || on_deck || !self.free(s, offset, kind.radius) {
                    continue;
                }
                self.taken.push((DVec2::new(s, offset), kind.radius));
                if let Some(gap) = kind.gap {
                    let full = (row.every / PIECE) as usize;
                    let missing = (random.unit() * full as f32 * gap) as usize;
                    self.line(name, s, offset, full - missing, &mut random);
                } else {
                    self.put(name, s, offset, &mut random);
                }
            }
        }
    }

    /// Poles of the overhead line on the left, and the wires to the next pole.
    fn wires(&mut self) {
        let Ground { plan, start, .. } = self.ground;
        let first = (start / POLES).ceil() as usize;
        let up = DVec3::Z * f64::from(things::WIRE_HEIGHT);
        for place in (first..).take_while(|k| (*k as f64) * POLES < start + CELL) {
            let mut random = Random::new(plan.seed, 7, place as u64);
            let [(s, out, a), (t, _, b)] = [place, place + 1].map(|place| {
                let s = place as f64 * POLES;
                let out = plan.section(s).walk - 0.3;
                (s, out, self.ground.at(s, out) + up)
            });
            if s < LEAD || !self.free(s, out, 0.0) {
                continue;
            }
            self.put("wood_pole", s, out, &mut random);
            if !plan.layout((t / CELL) as usize).wires || t >= self.ground.end {
                continue;
            }
            let way = b - a;
            let model = things::wire(way.truncate().length() as f32, way.z as f32, random.range(0.35, 0.8));
            let owner = self.object("wire", s, out, things::WIRE_HEIGHT);
            let map = Affine3A::from_translation((a - self.ground.origin).as_vec3())
                * Affine3A::from_rotation_z(way.y.atan2(way.x) as f32);
            self.placed.push(Placed { model: Arc::new(model), map, owner });
        }
    }

    fn buildings(&mut self, style: &Buildings) {
        let Ground { plan, start, cell, .. } = self.ground;
        let lot = CELL / style.lots_per_cell as f64;
        for place in 0..style.lots_per_cell * 2 {
            let side = if place % 2 == 0 { 1.0 } else { -1.0 };
            let mut random = Random::new(plan.seed, 8, (cell * 8 + place) as u64);
            let s = start + lot * ((place / 2) as f64 + 0.5);
            let [a, b] = [s - lot * 0.5, s + lot * 0.5].map(|s| self.ground.frame.at(s).heading);
            // Towards the inside of a bend lots are shorter, and a straight front cuts the arc.
            let bend = (b - a) / lot * side;
            let mut front = plan.section(s).walk + f64::from(random.range(style.setback.0, style.setback.1));
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
            let map = self.map(s, side * front, Facing::Away, false, &mut random);
            let owner = self.object("building", s, side * front, model.height());
            self.placed.push(Placed { model, map, owner });
        }
    }
}
