//! The street, cell by cell: its objects and their places. A cell is a pure function of (preset, seed, cell).

pub(crate) mod axis;
pub(crate) mod ground;
pub(crate) mod preset;
pub(crate) mod section;
pub(crate) mod traffic;

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3, Mat3A, Vec3, vec3};
use rand::RngExt;

use self::axis::{Axis, CELL, cell_at};
use self::ground::Ground;
use self::preset::{Kind, Lot, Plan, Row, kind};
use crate::synth::random::{Random, pick, sequence};
use crate::synth::scene::model::Model;
use crate::synth::scene::{Owner, Placed};
use crate::synth::things::object::{Object, Place};
use crate::synth::things::truth::Truth;

/// Number of object numbers that each cell has for itself.
pub(crate) const IDS: u32 = 1_000;

/// Length of the opening after the pieces of an object along the street, metres: access for a vehicle.
/// Without it, rails and hedges that touch each other would look like one object but have several numbers.
const OPENING: f64 = 5.0;

/// Models by kind.
pub(crate) type Library = BTreeMap<String, Vec<Arc<Model>>>;

/// A cell under construction. Places are chainage and offset to the left of the axis.
struct Site<'a> {
    library: &'a Library,
    ground: Arc<Ground>,
    /// Footprints of the things that already stand, with the numbers of their objects.
    taken: Vec<(Footprint, u32)>,
    last_id: u32,
    placed: Vec<Placed>,
}

/// The area of the ground that a thing takes: a rectangle along the street, and everything within a distance
/// of it. Things whose footprints meet would be inside each other. In a bend, metres along the street are
/// measured on the axis. Things of different cells are not compared.
#[derive(Clone, Copy)]
struct Footprint {
    /// Chainage and offset of the middle, and half of the lengths along and across the street, metres.
    middle: DVec2,
    half: DVec2,
    radius: f64,
}

impl Footprint {
    /// The footprint of a thing of this kind at a place. `None` if the thing hangs.
    fn of(kind: &Kind, middle: DVec2) -> Option<Self> {
        let radius = kind.radius?;
        let long = kind.span > 0.0;
        let half = if long { DVec2::new(kind.span / 2.0, radius) } else { DVec2::ZERO };
        Some(Self { middle, half, radius: if long { 0.0 } else { radius } })
    }

    /// The footprint of a building. `front` is the middle of its side towards the street.
    fn of_building(front: DVec2, width: f64, depth: f64) -> Self {
        let half = DVec2::new(width, depth) / 2.0;
        Self { middle: front + DVec2::new(0.0, half.y.copysign(front.y)), half, radius: 0.0 }
    }

    fn meets(&self, other: &Self) -> bool {
        let gap = (self.middle - other.middle).abs() - self.half - other.half;
        gap.max(DVec2::ZERO).length() <= self.radius + other.radius
    }
}

/// The objects in cell `index` of a plan, and its ground. The axis is laid beyond it.
pub(crate) fn cell(plan: Plan, axis: &Axis, library: &Library, index: usize) -> Vec<Placed> {
    let ground = Arc::new(Ground::new(plan, axis, index));
    let model = Arc::new(ground.mesh());
    let owner = Owner::Ground(Arc::clone(&ground));
    let turn = Mat3A::from_rotation_z(ground.turn.to_angle() as f32);
    let placed = vec![Placed { model, at: ground.origin, turn, owner }];
    let last_id = index as u32 * IDS;
    let mut site = Site { library, ground, taken: Vec::new(), last_id, placed };
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
        let Ground { plan, cell, start, end, .. } = *self.ground;
        let [first, next] = [start, start + CELL].map(|s| ((s - row.from) / row.every).ceil() as u64);
        let together = row.together.unwrap_or(1);
        let line = |s: f64| DVec2::new(s, side * row.out(&plan.section(s)));
        let on_street = |s: f64| s <= end && std::ptr::eq(plan.layout(cell_at(s)), plan.layout(cell));
        let mut whole: Option<(u64, Arc<Object>)> = None;
        for place in first..next {
            let group = place / together;
            let nth = place % together;
            let mut random = sequence(plan.seed, stream, place);
            let mut shared = sequence(plan.seed, stream + 1_000, group);
            let s = place as f64 * row.every + row.from + row.jitter * random.random_range(-0.5..=0.5);
            let name = pick(&row.names, if row.joined.is_some() { &mut shared } else { &mut random });
            let kind = kind(name);
            let ends = [-0.5, 0.5].map(|end| s + kind.span * end);
            let missing = row.joined.map_or(0.0, |share| {
                (share * shared.random::<f64>() * together as f64).max(OPENING / row.every)
            });
            let goes_on = shared.random_bool(row.share) && nth as f64 + missing < together as f64;
            let grounded = if row.bridge { plan.dip(s) > 0.4 } else { !kind.rooted || plan.dip(s) <= 0.0 };
            // The things of the next cell are not known here.
            let long = kind.span > 0.0 && kind.radius.is_some();
            let within = !long || ends.into_iter().all(|s| (start..=start + CELL).contains(&s));
            if !goes_on || !grounded || !within || !ends.into_iter().all(on_street) {
                continue;
            }
            // Pieces of an object may touch each other.
            let own = whole
                .as_ref()
                .filter(|(of, _)| row.joined.is_some() && *of == group)
                .map(|(_, object)| object.id);
            let stand = match &row.lot {
                Some(lot) => self.front(lot, row.every, line(s), &mut random),
                None => Some((line(s), Vec3::ONE, Footprint::of(kind, line(s))))
                    .filter(|(place, ..)| self.on_ground(*place, kind.radius.unwrap_or(0.0)))
                    .filter(|(_, _, footprint)| footprint.is_none_or(|footprint| self.free(&footprint, own))),
            };
            let Some((place, size, footprint)) = stand else { continue };
            let model = pick(&self.library[name], &mut random);
            let turn = random.random_range(kind.turn.0..=kind.turn.1).to_radians();
            let [wide, tall] = [0; 2].map(|_| 1.0 + random.random_range(-kind.varies..=kind.varies));
            let class = kind.class;
            let base = self.ground.at(place);
            let height = f64::from(model.height() * tall);
            // A thing with a span leads from one end to the other. A thing without a span stands level.
            let (at, way) = if kind.span > 0.0 {
                let [from, to] = ends.map(|s| self.ground.at(line(s)));
                ((from + to) * 0.5, (to - from) / kind.span)
            } else {
                (base, self.ground.line.at(s).way.extend(0.0))
            };
            let across = way.truncate().normalize().perp().extend(0.0);
            let frame = Mat3A::from(DMat3::from_cols(way, across, DVec3::Z).as_mat3());
            let turn = Mat3A::from_rotation_z((if side > 0.0 { turn } else { turn + PI }) as f32);
            let turn = frame * turn * Mat3A::from_diagonal(size * vec3(wide, wide, tall));
            let object = match whole {
                Some((of, object)) if row.joined.is_some() && of == group => object,
                _ => {
                    self.last_id += 1;
                    let truth = Truth::of(class, model, turn);
                    let place = Place::Stands { base, s };
                    Arc::new(Object { id: self.last_id, class, kind: name, place, height, truth })
                }
            };
            let owner = Owner::Object(Arc::clone(&object));
            self.placed.push(Placed { model: Arc::clone(model), at, turn, owner });
            self.taken.extend(footprint.map(|footprint| (footprint, object.id)));
            whole = Some((group, object));
        }
    }

    /// Whether a place is on ground for a thing of radius `r`: before the end of the street, not beside a
    /// bridge, and off other parts of the street.
    fn on_ground(&self, place: DVec2, r: f64) -> bool {
        let ground = &self.ground;
        let walk = self.ground.plan.section(place.x).walk;
        let over_dip = place.y.abs() > walk && ground.plan.dip(place.x) > 0.2;
        let apart = place.y.abs().max(walk + r + 1.0);
        let crowded = ground.elsewhere(ground.line.at(place.x).left(place.y), apart).is_some();
        place.x <= ground.end && !over_dip && !crowded
    }

    /// Whether no thing stands there, except parts of the object `own`.
    fn free(&self, footprint: &Footprint, own: Option<u32>) -> bool {
        !self.taken.iter().any(|(other, id)| Some(*id) != own && other.meets(footprint))
    }

    /// Place of the front of a building on a lot of length `length` around a place, size of the building, and
    /// its footprint; `None` if there is no room.
    fn front(
        &self,
        lot: &Lot,
        length: f64,
        place: DVec2,
        random: &mut Random,
    ) -> Option<(DVec2, Vec3, Option<Footprint>)> {
        let [a, b] = [-0.5, 0.5].map(|end| self.ground.line.at(place.x + length * end).way);
        // On the inside of a bend lots are shorter, and a straight front cuts the arc.
        let bend = a.angle_to(b) / length * place.y.signum();
        let front = place.y.abs() + random.random_range(0.0..=lot.setback);
        let length = length * (1.0 - (bend * (front + lot.depth)).max(0.0)).max(0.2);
        let width = length * random.random_range(lot.front.0..=lot.front.1);
        let place = place.with_y((front + width * width * bend.abs() / 8.0).copysign(place.y));
        let outwards = DVec2::new(width, lot.depth.copysign(place.y));
        let corners = [(-0.5, 0.0), (0.5, 0.0), (-0.5, 1.0), (0.5, 1.0)].map(DVec2::from);
        let footprint = Footprint::of_building(place, width, lot.depth);
        let on_ground = corners.iter().all(|corner| self.on_ground(place + *corner * outwards, 0.0));
        let stands = width >= 6.0 && on_ground && self.free(&footprint, None);
        stands.then(|| (place, vec3(width as f32, lot.depth as f32, 1.0), Some(footprint)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::street::preset::Preset;
    use crate::synth::things;

    /// Number, place and direction of every piece that leads along the street, without cars and wires.
    fn pieces(preset: Preset) -> Vec<(u32, DVec3, DVec2)> {
        let plan = Plan::new(preset, 3);
        let mut axis = Axis::new(plan.seed, plan.bends, None);
        let library = things::models(plan.seed);
        axis.reach(2_500.0);
        let cells = (0..40).flat_map(|index| cell(plan, &axis, &library, index));
        let piece = |placed: Placed| match placed.owner {
            Owner::Object(object) if object.class == 6 && kind(object.kind).span > 0.0 => {
                Some((object.id, placed.at, placed.turn.x_axis.truncate().as_dvec2().normalize()))
            }
            _ => None,
        };
        cells.filter_map(piece).collect()
    }

    #[test]
    fn no_two_objects_of_pieces_touch_each_other() {
        for preset in [Preset::Suburb, Preset::Avenue, Preset::Highway, Preset::Parkway, Preset::Lane] {
            let pieces = pieces(preset);
            let mut neighbours = 0;
            for (index, (id, at, way)) in pieces.iter().enumerate() {
                for (other, there, _) in &pieces[index + 1..] {
                    let arm = (*there - *at).truncate();
                    let (along, across) = (way.dot(arm).abs(), way.perp_dot(arm).abs());
                    if across > 0.4 || along > 12.0 {
                        continue;
                    }
                    neighbours += usize::from(id != other);
                    // Pieces are 2.5 m long and the opening is 5 m; both are shorter on the inside of a bend.
                    assert!(id == other || along > 6.0, "{preset:?}: {id} and {other} are {along} m apart");
                }
            }
            assert!(neighbours > 3 || preset == Preset::Lane, "{preset:?}: {neighbours} openings");
        }
    }

    /// An earlier version put bins and people inside parked cars, and bushes inside hedges. Nobody can
    /// distinguish these.
    #[test]
    fn nothing_of_a_cell_stands_inside_what_is_longer_than_wide() {
        let of = |name: &'static str| name.split('_').next().unwrap();
        let stands = |placed: Placed| match placed.owner {
            Owner::Object(object) => Some((object.id, object.kind, placed.at, placed.turn)),
            Owner::Ground(_) => None,
        };
        let mut long = 0;
        for preset in Preset::ALL.into_iter().filter(|preset| *preset != Preset::Mixed) {
            let plan = Plan::new(preset, 5);
            let mut axis = Axis::new(plan.seed, plan.bends, None);
            let library = things::models(plan.seed);
            axis.reach(1_200.0);
            for index in 0..20 {
                let all: Vec<_> = cell(plan, &axis, &library, index).into_iter().filter_map(stands).collect();
                for (id, name, at, turn) in &all {
                    let half = match of(name) {
                        "car" => [2.1, 0.95],
                        "hedge" => [1.25, 0.37],
                        "wall" | "fence" | "rail" => [1.25, 0.1],
                        _ => continue,
                    };
                    long += 1;
                    for (other, what, there, _) in &all {
                        let arm = turn.inverse() * (*there - *at).as_vec3a();
                        let inside = arm.x.abs() < half[0] && arm.y.abs() < half[1];
                        let hangs = ["wire", "overpass", "building"].contains(&of(what));
                        assert!(
                            id == other || hangs || !inside,
                            "{preset:?}: {what} {other} stands in {name} {id}"
                        );
                    }
                }
            }
        }
        assert!(long > 1_000, "{long}");
    }

    #[test]
    fn the_pieces_of_an_object_lie_in_one_cell() {
        let presets = Preset::ALL.into_iter().filter(|preset| *preset != Preset::Mixed);
        for preset in presets {
            let rows = &Plan::new(preset, 1).layout(0).rows;
            for row in rows.iter().filter(|row| row.joined.is_some()) {
                let together = row.together.unwrap() as f64;
                let groups = CELL / row.every / together;
                assert!(groups.fract() == 0.0, "{preset:?}: {groups} groups of {:?} in a cell", row.names);
                assert!(row.from < row.every && row.jitter == 0.0 && together * row.every > OPENING);
            }
        }
    }
}
