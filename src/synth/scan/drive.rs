//! The vehicle: its distance, position and attitude at any time.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::{DMat4, DVec3};

use crate::synth::random::{Waves, sequence};
use crate::synth::street::axis::{LEAD, Line, STEM};
use crate::synth::street::preset::Plan;

/// Poses per second. Poses in between are interpolated, so that the trajectory file is complete.
const POSES_HZ: f64 = 100.0;

/// Position and attitude at a time; angles in radians.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    /// Seconds since the start of the drive.
    pub(crate) t: f64,
    /// Metres east of, north of and above the street's origin.
    pub(crate) position: DVec3,
    /// Right side down positive.
    pub(crate) roll: f64,
    /// Nose up positive.
    pub(crate) pitch: f64,
    /// Clockwise from north.
    pub(crate) heading: f64,
}

impl Pose {
    /// The transform from the vehicle's frame (forward, left, up) to the street's (east, north, up).
    fn map(&self) -> DMat4 {
        DMat4::from_translation(self.position)
            * DMat4::from_rotation_z(FRAC_PI_2 - self.heading)
            * DMat4::from_rotation_y(-self.pitch)
            * DMat4::from_rotation_x(self.roll)
    }
}

/// The poses of a stretch of time, with the ones just before and after it.
#[derive(Debug)]
pub(crate) struct Track {
    pub(crate) time: Range<f64>,
    pub(crate) poses: Vec<Pose>,
    maps: Vec<DMat4>,
}

impl Track {
    /// The transform of the vehicle's frame at time `t`, interpolated between the poses before and after it.
    pub(crate) fn at(&self, t: f64) -> DMat4 {
        let along = (t - self.poses[0].t) * POSES_HZ;
        let index = (along as usize).min(self.maps.len() - 2);
        let w = along - index as f64;
        self.maps[index] * (1.0 - w) + self.maps[index + 1] * w
    }
}

/// The drive as a function of time, seconds since its start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    plan: Plan,
    /// Chainage at which the street returns to its stem.
    end: f64,
    /// Height of the trajectory's reference point over the road, metres.
    height: f64,
    /// Mean speed in m/s, and the vehicle's lead over it: metres as a function of seconds.
    speed: f64,
    ahead: Waves<2>,
    /// Metres to the left of the driving line, as a function of metres driven.
    wander: Waves<1>,
    /// Movements of the body on its springs, as functions of seconds: metres; radians.
    bounce: Waves<2>,
    pitch: Waves<1>,
    roll: Waves<2>,
}

impl Drive {
    /// A drive with speeds between the two of `speed_kmh` along a street that ends at chainage `end`,
    /// `height` metres over the road.
    pub(crate) fn new(plan: Plan, end: f64, height: f64, (low, high): (f64, f64)) -> Self {
        let mut random = sequence(plan.seed, 4, 0);
        let half = (high - low) / 7.2;
        Self {
            plan,
            end,
            height,
            speed: low / 3.6 + half,
            ahead: Waves::new([(0.7, 47.0), (0.3, 19.0)].map(|(a, t)| (half * a * t / TAU, t)), &mut random),
            wander: Waves::new([(0.15, 70.0)], &mut random),
            // 0.3 to 1.4 Hz.
            bounce: Waves::new([(0.008, 0.91), (0.006, 2.7)], &mut random),
            pitch: Waves::new([(0.003, 1.11)], &mut random),
            roll: Waves::new([(0.0045, 3.23), (0.0025, 0.73)], &mut random),
        }
    }

    /// Metres driven at time `t`.
    pub(crate) fn distance(&self, t: f64) -> f64 {
        self.speed * t + self.ahead.along(t) - self.ahead.along(0.0)
    }

    /// Chainage at time `t`, and 1 if it grows along the drive, -1 if it falls.
    pub(crate) fn place(&self, t: f64) -> (f64, f64) {
        let s = LEAD + self.distance(t);
        if s > self.end { (LEAD + STEM - (s - self.end), -1.0) } else { (s, 1.0) }
    }

    /// Offsets (left positive) of the path from the axis at chainage `s`, metres: on the way out and, if the
    /// street is driven twice, on the way back.
    pub(crate) fn offsets(&self, s: f64) -> [Option<f64>; 2] {
        let back = self.end + STEM - s;
        let returns = s <= LEAD + STEM && back.is_finite();
        [Some(self.offset(s, s - LEAD, 1.0)), returns.then(|| self.offset(s, back, -1.0))]
    }

    /// Offset (left positive) of the path at chainage `s` after `driven` metres, if chainage grows (1) or
    /// falls (-1).
    fn offset(&self, s: f64, driven: f64, way: f64) -> f64 {
        way * (self.wander.along(driven) - self.plan.section(s).driving_line())
    }

    /// The poses from the last one before `time` to the first ones after it.
    pub(crate) fn track(&self, axis: &Line, time: Range<f64>) -> Track {
        let [first, last] = [time.start, time.end].map(|t| (t * POSES_HZ).floor() as u64);
        let poses: Vec<Pose> = (first..last + 3).map(|n| self.pose(axis, n as f64 / POSES_HZ)).collect();
        Track { time, maps: poses.iter().map(Pose::map).collect(), poses }
    }

    fn pose(&self, axis: &Line, t: f64) -> Pose {
        let (here, way) = self.place(t);
        // Measured along the drive, not along the street, so that there is no jump where the loop closes.
        let driven = self.distance(t);
        let offset = |s: f64| self.offset(s, driven + (s - here) * way, way);
        let height = |s: f64| self.plan.height(axis.at(s), s, offset(s));
        let slope = (height(here + 1.5) - height(here - 1.5)) / 3.0 * way;
        let drift = (offset(here + 0.5) - offset(here - 0.5)).atan();
        let course = axis.at(here).way.to_angle() + drift + (1.0 - way) * FRAC_PI_2;
        Pose {
            t,
            position: axis
                .at(here)
                .left(offset(here))
                .extend(height(here) + self.height + self.bounce.along(t)),
            roll: self.roll.along(t),
            pitch: slope.atan() + self.pitch.along(t),
            heading: (FRAC_PI_2 - course).rem_euclid(TAU),
        }
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
