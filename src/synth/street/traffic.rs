//! Moving traffic: which things move along the street, and where they are at any time.
//!
//! A lane is an endless row of places, and all of them move along the axis with one speed. Whether a place is
//! taken, and by what, depends on its number alone. So traffic is a pure function of (plan, time).

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3, Mat3A, vec3};
use rand::RngExt;

use super::axis::Line;
use super::preset::{Lane, Plan, kind};
use crate::synth::random::{Random, pick, sequence};
use crate::synth::scene::{Moving, Owner, Placed};
use crate::synth::street::Library;
use crate::synth::things::object::{Object, Place};
use crate::synth::things::truth::Truth;

/// Numbers of moving objects: the first one, and the count per lane. A street of 2,000 km uses 40 million
/// numbers for standing objects.
const FIRST_ID: i64 = 1_000_000_000;
const IDS: i64 = 100_000_000;
/// Difference between the numbers of a moving object as two heads see it. The second head passes the thing at
/// another time, when the thing is elsewhere, so it sees an object of its own.
const IDS_OF_HEAD: u32 = 1_000_000_000;
/// Streams of random numbers: for the speeds of the lanes, and for the places of the first lane.
const SPEEDS: u64 = 40;
const PLACES: u64 = 3_000;
/// Length over which the direction of a thing without a span is found, metres.
const STEP: f64 = 1.0;

/// The number of an object as a head sees it.
pub(crate) fn seen_by(object: &Object, head: usize) -> u32 {
    match object.place {
        Place::Stands { .. } => object.id,
        Place::Moves { .. } => object.id + head as u32 * IDS_OF_HEAD,
    }
}

/// The number of the object that a head sees under the number `seen`.
pub(crate) fn whose(seen: u32) -> u32 {
    let first = FIRST_ID as u32;
    if seen < first { seen } else { first + (seen - first) % IDS_OF_HEAD }
}

/// The moving things at time `t` within `reach` of a point of the plane, where the axis is laid. Velocities
/// are means over `half` seconds before and after `t`. `s` is the chainage of the point.
pub(crate) fn moving(
    plan: &Plan,
    axis: &Line,
    library: &Library,
    (t, half): (f64, f64),
    (s, point, reach): (f64, DVec2, f64),
) -> Vec<Moving> {
    let mut all = Vec::new();
    for (number, lane) in (0..).zip(plan.traffic()) {
        let speed = speed(plan, number, lane);
        // In a bend, the street is longer than its chord.
        let around = 1.2 * reach + lane.every;
        let [first, last] = [-around, around].map(|d| ((s + d - speed * t) / lane.every).floor() as i64);
        for place in first..=last {
            let mut random = sequence(plan.seed, PLACES + number, place as u64);
            let jitter = lane.jitter * random.random_range(-0.5..=0.5);
            if !random.random_bool(lane.share) {
                continue;
            }
            let way = Way { plan, axis, lane, start: place as f64 * lane.every + jitter, speed };
            // There is no street before its start.
            if way.chainage(t) < 5.0 || way.at(t).truncate().distance(point) > reach {
                continue;
            }
            let id = FIRST_ID + number.cast_signed() * IDS + (IDS / 2 + place).rem_euclid(IDS);
            all.push(way.thing(library, id as u32, (t, half), &mut random));
        }
    }
    all
}

/// Speed of all things in a lane along the axis, m/s.
fn speed(plan: &Plan, number: u64, lane: &Lane) -> f64 {
    let (slow, fast) = lane.speed_kmh;
    let share: f64 = sequence(plan.seed, SPEEDS, number).random();
    (slow + (fast - slow) * share) / 3.6
}

/// The motion of a thing.
struct Way<'a> {
    plan: &'a Plan,
    axis: &'a Line,
    lane: &'static Lane,
    /// Chainage at time 0.
    start: f64,
    speed: f64,
}

impl Way<'_> {
    fn chainage(&self, t: f64) -> f64 {
        self.start + self.speed * t
    }

    /// The place on the lane at a chainage, metres from the street's origin. Traffic keeps to the right.
    fn on_lane(&self, s: f64) -> DVec3 {
        let offset = -self.speed.signum() * self.lane.out(&self.plan.section(s));
        let node = self.axis.at(s);
        node.left(offset).extend(self.plan.height(node, s, offset))
    }

    fn at(&self, t: f64) -> DVec3 {
        self.on_lane(self.chainage(t))
    }

    /// The thing with this motion at time `t`.
    fn thing(&self, library: &Library, id: u32, (t, half): (f64, f64), random: &mut Random) -> Moving {
        let name: &'static String = pick(&self.lane.names, random);
        let kind = kind(name);
        let model = pick(&library[name], random);
        let [wide, tall] = [0; 2].map(|_| 1.0 + random.random_range(-kind.varies..=kind.varies));
        let length = kind.span.max(STEP) * self.speed.signum();
        let [rear, front] = [-0.5, 0.5].map(|end| self.on_lane(self.chainage(t) + length * end));
        let mut ahead = (front - rear) / length.abs();
        let mut at = (front + rear) * 0.5;
        if kind.span <= 0.0 {
            ahead.z = 0.0;
            at = self.at(t);
        }
        let across = ahead.truncate().normalize().perp().extend(0.0);
        let frame = Mat3A::from(DMat3::from_cols(ahead, across, DVec3::Z).as_mat3());
        let turn = frame * Mat3A::from_diagonal(vec3(wide, wide, tall));
        let object = Object {
            id,
            class: kind.class,
            kind: name,
            place: Place::Moves { speed_kmh: self.speed.abs() * 3.6 },
            height: f64::from(model.height() * tall),
            truth: Truth::default(),
        };
        let owner = Owner::Object(Arc::new(object));
        let velocity = (self.at(t + half) - self.at(t - half)) / (2.0 * half);
        Moving { placed: Placed { model: Arc::clone(model), at, turn, owner }, velocity }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::synth::street::axis::Axis;
    use crate::synth::street::preset::Preset;
    use crate::synth::things;

    /// Number, position and velocity of the things that move around chainage 500 at time `t`.
    fn around(preset: Preset, seed: u64, t: f64) -> BTreeMap<u32, (DVec3, DVec3)> {
        let plan = Plan::new(preset, seed);
        let mut axis = Axis::new(seed, plan.bends, None);
        axis.reach(1_000.0);
        let library = things::models(seed);
        let point = axis.line.at(500.0).point;
        let all = moving(&plan, &axis.line, &library, (t, 0.0125), (500.0, point, 120.0));
        let entry = |Moving { placed, velocity }: Moving| match placed.owner {
            Owner::Object(object) => (object.id, (placed.at, velocity)),
            Owner::Ground(_) => unreachable!("the ground does not move"),
        };
        let count = all.len();
        let all: BTreeMap<_, _> = all.into_iter().map(entry).collect();
        assert_eq!(all.len(), count, "numbers are unique");
        all
    }

    #[test]
    fn things_move_with_their_speed_and_no_two_meet_in_a_lane() {
        for preset in [Preset::Suburb, Preset::Downtown, Preset::Avenue, Preset::Highway, Preset::Lane] {
            let mut followed = 0;
            for t in [0.0, 5.0, 12.0, 8_000.0] {
                let now = around(preset, 4, t);
                let next = around(preset, 4, t + 0.2);
                for (id, (at, velocity)) in &now {
                    let Some((then, _)) = next.get(id) else { continue };
                    let moved = *then - *at;
                    assert!(
                        velocity.length() > 0.8 && moved.length() > 0.16,
                        "{preset:?}: {id} stands still"
                    );
                    assert!(
                        (moved / 0.2 - *velocity).length() < 0.05 * velocity.length(),
                        "{preset:?}: {id}"
                    );
                    followed += 1;
                }
                let places: Vec<DVec3> = now.values().map(|(at, _)| *at).collect();
                for (index, a) in places.iter().enumerate() {
                    assert!(places[index + 1..].iter().all(|b| a.distance(*b) > 0.8), "{preset:?}: two meet");
                }
            }
            assert!(followed > 3, "{preset:?}: {followed}");
        }
    }

    #[test]
    fn each_head_sees_a_moving_object_as_another_and_a_standing_one_as_the_same() {
        let place = Place::Moves { speed_kmh: 50.0 };
        let moves =
            Object { id: 1_799_999_999, class: 4, kind: "car", place, height: 1.5, truth: Truth::default() };
        let [first, second] = [0, 1].map(|head| seen_by(&moves, head));
        assert_eq!([first, second], [1_799_999_999, 2_799_999_999]);
        assert_eq!([first, second].map(whose), [moves.id; 2]);
        let stands = Object { id: 7, place: Place::Stands { base: DVec3::ZERO, s: 0.0 }, ..moves };
        assert_eq!([seen_by(&stands, 1), whose(7)], [7; 2]);
    }

    #[test]
    fn the_lane_of_the_survey_vehicle_is_free() {
        for preset in Preset::ALL {
            let plan = Plan::new(preset, 4);
            for lane in plan.traffic().iter().filter(|lane| kind(&lane.names[0]).class == 4) {
                for s in [60.0, 370.0, 410.0, 720.0, 1_080.0, 1_420.0] {
                    let section = plan.section(s);
                    let with = lane.speed_kmh.0 > 0.0;
                    let off = (section.driving_line() - lane.out(&section)).abs();
                    assert!(!with || off > 2.8, "{preset:?}: {off} m beside the vehicle");
                    assert!(lane.speed_kmh.0 * lane.speed_kmh.1 > 0.0, "a lane has one direction");
                    assert!(lane.every - lane.jitter >= 8.0, "cars of a lane touch");
                }
            }
        }
        let streets = [Preset::Suburb, Preset::Highway];
        let [one, two] = streets.map(|preset| Plan::new(preset, 4).traffic().len());
        assert!(one > 0 && two > 2 && Plan::new(Preset::Loop, 4).traffic().is_empty());
    }
}
