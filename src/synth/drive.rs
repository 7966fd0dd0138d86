//! The vehicle: how far it is at a time, where it is and how it is turned. No scanner.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::axis::{Frame, LEAD, Land, STEM};
use super::preset::Plan;
use super::random::Random;

/// Height of the trajectory's point over the road, metres.
const HEIGHT: f64 = 2.35;

/// Position and attitude at a time; angles in radians.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    /// Metres east, north, up of the street's origin.
    pub(super) position: [f64; 3],
    /// Right side down positive.
    pub(super) roll: f64,
    /// Nose up positive.
    pub(super) pitch: f64,
    /// Clockwise from north.
    pub(super) heading: f64,
}

impl Pose {
    /// Forward, left and up of the vehicle as columns (east, north, up).
    pub(super) fn columns(&self) -> [[f64; 3]; 3] {
        let (sy, cy) = (FRAC_PI_2 - self.heading).sin_cos();
        let (sp, cp) = self.pitch.sin_cos();
        let (sr, cr) = self.roll.sin_cos();
        let forward = [cy * cp, sy * cp, sp];
        let (left, up) = ([-sy, cy, 0.0], [-cy * sp, -sy * sp, cp]);
        let mix = |a: [f64; 3], p: f64, b: [f64; 3], q: f64| [0, 1, 2].map(|i| a[i] * p + b[i] * q);
        [forward, mix(left, cr, up, sr), mix(up, cr, left, -sr)]
    }
}

/// A place on the way: chainage, and whether it is driven towards growing chainage.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) s: f64,
    pub(super) forward: bool,
}

/// The drive as a function of time, seconds since its start.
#[derive(Debug, Clone)]
pub(super) struct Drive {
    speed: f64,
    /// Amplitude (m/s), angular frequency and phase of the changes of speed.
    changes: [(f64, f64, f64); 2],
    shake: [f64; 6],
    plan: Plan,
    land: Land,
    /// Length of the street until it comes back to its stem, for the `loop` preset.
    closing: Option<f64>,
}

impl Drive {
    /// A drive with speeds between the two of `speed_mps`.
    pub(super) fn new(plan: Plan, land: Land, closing: Option<f64>, speed_mps: (f64, f64)) -> Self {
        let mut random = Random::new(plan.seed, 4, 0);
        let half = (speed_mps.1 - speed_mps.0) * 0.5;
        let mut change = |share: f64, period: f64| (half * share, TAU / period, f64::from(random.angle()));
        let changes = [change(0.7, 47.0), change(0.3, 19.0)];
        let shake = [0; 6].map(|_| f64::from(random.angle()));
        Self { speed: speed_mps.0 + half, changes, shake, plan, land, closing }
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

    /// Where on the street the vehicle is at time `t`.
    pub(super) fn place(&self, t: f64) -> Place {
        let s = LEAD + self.distance(t);
        match self.closing {
            Some(end) if s > end => Place { s: LEAD + STEM - (s - end), forward: false },
            _ => Place { s, forward: true },
        }
    }

    /// The pose at time `t`; `frame` is the axis about the place.
    pub(super) fn pose(&self, t: f64, frame: &Frame) -> Pose {
        let place = self.place(t);
        let way = if place.forward { 1.0 } else { -1.0 };
        let node = frame.at(place.s);
        let [p0, p1, p2, p3, p4, p5] = self.shake;
        // Counted along the drive, not along the street: no jump where the loop closes.
        let driven = self.distance(t);
        let wander = |s: f64| 0.15 * ((driven + (s - place.s) * way) * TAU / 70.0 + p0).sin();
        let offset = |s: f64| way * (wander(s) - self.plan.station(s).section.driving_line());
        let height = |s: f64| self.plan.station(s).height(&self.land, frame, s, offset(s));
        let [x, y] = node.left(offset(place.s));
        let slope = (height(place.s + 1.5) - height(place.s - 1.5)) / 3.0 * way;
        // Body movements of a car on its springs: some tenths of a degree at 0.3 to 1.4 Hz.
        let bounce = 0.008 * (TAU * 1.1 * t + p1).sin() + 0.006 * (TAU * 0.37 * t + p2).sin();
        let pitch = slope.atan() + 0.0030 * (TAU * 0.9 * t + p3).sin();
        let roll = 0.0045 * (TAU * 0.31 * t + p4).sin() + 0.0025 * (TAU * 1.37 * t + p5).sin();
        let drift = (offset(place.s + 0.5) - offset(place.s - 0.5)).atan();
        let course = node.heading + drift + if place.forward { 0.0 } else { PI };
        Pose {
            position: [x, y, height(place.s) + HEIGHT + bounce],
            roll,
            pitch,
            heading: (FRAC_PI_2 - course).rem_euclid(TAU),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_a_right_handed_frame_with_the_stated_signs() {
        // Heading east, nose up by 0.1, right side down by 0.2.
        let pose = Pose { position: [0.0; 3], roll: 0.2, pitch: 0.1, heading: FRAC_PI_2 };
        let [forward, left, up] = pose.columns();
        assert!(forward[0] > 0.99 && (forward[2] - 0.1f64.sin()).abs() < 1e-12);
        assert!(left[1] > 0.97 && left[2] > 0.19, "the left side is up: {left:?}");
        let cross = [
            forward[1] * left[2] - forward[2] * left[1],
            forward[2] * left[0] - forward[0] * left[2],
            forward[0] * left[1] - forward[1] * left[0],
        ];
        assert!((0..3).all(|i| (cross[i] - up[i]).abs() < 1e-12));
    }
}
