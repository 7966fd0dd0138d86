//! The vehicle: how far it is at a time, where it is and how it is turned. No scanner.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DMat4, DVec3};
use rand::RngExt;

use super::axis::{Axis, Frame, LEAD, STEM, cell_at};
use super::preset::Plan;
use super::random::sequence;

/// Height of the trajectory's point over the road, metres.
const HEIGHT: f64 = 2.35;
/// Poses per second; in between they are interpolated, so that the trajectory file says all there is.
const POSES_HZ: f64 = 100.0;

/// Position and attitude at a time; angles in radians.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    /// Seconds since the start of the drive.
    pub(super) t: f64,
    /// Metres east, north, up of the street's origin.
    pub(super) position: DVec3,
    /// Right side down positive.
    pub(super) roll: f64,
    /// Nose up positive.
    pub(super) pitch: f64,
    /// Clockwise from north.
    pub(super) heading: f64,
}

impl Pose {
    /// From the vehicle's frame (forward, left, up) to the street's (east, north, up).
    fn map(&self) -> DMat4 {
        DMat4::from_translation(self.position)
            * DMat4::from_rotation_z(FRAC_PI_2 - self.heading)
            * DMat4::from_rotation_y(-self.pitch)
            * DMat4::from_rotation_x(self.roll)
    }
}

/// Poses in a row.
#[derive(Debug)]
pub(super) struct Track {
    pub(super) poses: Vec<Pose>,
    maps: Vec<DMat4>,
}

impl Track {
    /// The map of the vehicle's frame at time `t`, between those of the two poses about it.
    pub(super) fn at(&self, t: f64) -> DMat4 {
        let along = (t - self.poses[0].t) * POSES_HZ;
        let index = (along as usize).min(self.maps.len() - 2);
        let w = along - index as f64;
        self.maps[index] * (1.0 - w) + self.maps[index + 1] * w
    }
}

/// The drive as a function of time, seconds since its start.
#[derive(Debug, Clone)]
pub(super) struct Drive {
    speed: f64,
    /// Amplitude (m/s), angular frequency and phase of the changes of speed.
    changes: [(f64, f64, f64); 2],
    shake: [f64; 6],
    plan: Plan,
    /// Chainage at which the street comes back to its stem.
    end: f64,
}

impl Drive {
    /// A drive with speeds between the two of `speed_kmh` along a street that ends at chainage `end`.
    pub(super) fn new(plan: Plan, end: f64, speed_kmh: (f64, f64)) -> Self {
        let mut random = sequence(plan.seed, 4, 0);
        let (low, high) = (speed_kmh.0 / 3.6, speed_kmh.1 / 3.6);
        let half = (high - low) * 0.5;
        let mut change =
            |share: f64, period: f64| (half * share, TAU / period, random.random_range(0.0..TAU));
        let changes = [change(0.7, 47.0), change(0.3, 19.0)];
        let shake = [0; 6].map(|_| random.random_range(0.0..TAU));
        Self { speed: low + half, changes, shake, plan, end }
    }

    /// Metres driven at time `t`.
    pub(super) fn distance(&self, t: f64) -> f64 {
        let change = |(a, w, phase): &(f64, f64, f64)| a / w * (phase.cos() - (w * t + phase).cos());
        self.speed * t + self.changes.iter().map(change).sum::<f64>()
    }

    /// When `distance` metres are driven, by bisection: the speed is never negative.
    pub(super) fn time(&self, distance: f64) -> f64 {
        let (mut low, mut high) = (0.0, distance / self.speed + 60.0);
        while high - low > 1e-6 {
            let middle = (low + high) * 0.5;
            if self.distance(middle) < distance { low = middle } else { high = middle }
        }
        high
    }

    /// Chainage at time `t`, and 1 where it grows along the drive, -1 where it falls.
    pub(super) fn place(&self, t: f64) -> (f64, f64) {
        let s = LEAD + self.distance(t);
        if s > self.end { (LEAD + STEM - (s - self.end), -1.0) } else { (s, 1.0) }
    }

    /// The poses from the last one before `from` to the first ones after `to`.
    pub(super) fn track(&self, axis: &mut Axis, from: f64, to: f64) -> Track {
        let [first, last] = [from, to].map(|t| (t * POSES_HZ).floor() as u64);
        let mut frames = BTreeMap::new();
        let pose = |number: u64| {
            let t = number as f64 / POSES_HZ;
            let cell = cell_at(self.place(t).0);
            self.pose(frames.entry(cell).or_insert_with(|| axis.frame(cell)), t)
        };
        let poses: Vec<Pose> = (first..last + 3).map(pose).collect();
        Track { maps: poses.iter().map(Pose::map).collect(), poses }
    }

    /// The pose at time `t`; `frame` is the axis about the place.
    fn pose(&self, frame: &Frame, t: f64) -> Pose {
        let (here, way) = self.place(t);
        let node = frame.at(here);
        let [p0, p1, p2, p3, p4, p5] = self.shake;
        // Counted along the drive, not along the street: no jump where the loop closes.
        let driven = self.distance(t);
        let wander = |s: f64| 0.15 * ((driven + (s - here) * way) * TAU / 70.0 + p0).sin();
        let offset = |s: f64| way * (wander(s) - self.plan.section(s).driving_line());
        let height = |s: f64| self.plan.height(frame, s, offset(s));
        let slope = (height(here + 1.5) - height(here - 1.5)) / 3.0 * way;
        // Body movements of a car on its springs: some tenths of a degree at 0.3 to 1.4 Hz.
        let bounce = 0.008 * (TAU * 1.1 * t + p1).sin() + 0.006 * (TAU * 0.37 * t + p2).sin();
        let pitch = slope.atan() + 0.0030 * (TAU * 0.9 * t + p3).sin();
        let roll = 0.0045 * (TAU * 0.31 * t + p4).sin() + 0.0025 * (TAU * 1.37 * t + p5).sin();
        let drift = (offset(here + 0.5) - offset(here - 0.5)).atan();
        let course = node.heading + drift + (1.0 - way) * FRAC_PI_2;
        let position = node.left(offset(here)).extend(height(here) + HEIGHT + bounce);
        Pose { t, position, roll, pitch, heading: (FRAC_PI_2 - course).rem_euclid(TAU) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_is_a_right_handed_frame_with_the_stated_signs() {
        // Heading east, nose up by 0.1, right side down by 0.2.
        let pose = Pose { t: 0.0, position: DVec3::ZERO, roll: 0.2, pitch: 0.1, heading: FRAC_PI_2 };
        let [forward, left, up] = DVec3::AXES.map(|axis| pose.map().transform_vector3(axis));
        assert!(forward.x > 0.99 && (forward.z - 0.1f64.sin()).abs() < 1e-12);
        assert!(left.y > 0.97 && left.z > 0.19, "the left side is up: {left:?}");
        assert!((forward.cross(left) - up).length() < 1e-12);
    }
}
