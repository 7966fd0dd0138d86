//! Aiming: when every pulse is fired, from where and in which direction. Scene and echoes are not known here.

use std::f64::consts::{PI, TAU};

use glam::{DMat4, DVec3};

use super::drive::Track;
use super::scanner::Scanner;

/// Azimuth of the axis of rotation of a profile head from straight back, and its elevation, degrees. The
/// heads of a pair look backwards and outwards. They are crossed; the angles are fitted to the labelled
/// scenes.
const AZIMUTH: f64 = 45.0;
const ELEVATION: f64 = 22.0;
/// Fraction of an angular step by which the phase advances from profile to profile. The golden section is the
/// most irrational number, so that no rows line up.
const GOLDEN_SECTION: f64 = 0.618_033_988_749_895;

/// The heads of a scanner and their beams.
pub(crate) struct Aim<'a> {
    scanner: &'a Scanner,
    /// Transforms from the frame of every head to the frame of the vehicle.
    mounts: Vec<DMat4>,
    /// Cosine and sine of the elevation of every beam of a spinning head; empty for profile heads.
    beams: Vec<(f64, f64)>,
    /// Number of pulses of a profile or a rotation, and of pulses of a beam that are traced together.
    pulses: u64,
    together: u64,
}

/// A pulse that is fired.
pub(crate) struct Shot {
    /// Seconds since the start.
    pub(crate) t: f64,
    /// Scan angle, or azimuth of a spinning head, radians from -pi to pi.
    pub(crate) angle: f64,
    /// Metres from the street's origin, and unit vector.
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
}

impl<'a> Aim<'a> {
    pub(crate) fn new(scanner: &'a Scanner) -> Self {
        let elevations = scanner.spinning.as_ref().map(|spinning| spinning.elevations()).unwrap_or_default();
        let level = |elevation: &f64| {
            let (up, out) = elevation.to_radians().sin_cos();
            (out, up)
        };
        let beams: Vec<_> = elevations.iter().map(level).collect();
        let mounts = if beams.is_empty() {
            (0..scanner.heads).map(|number| mount(number, scanner.heads)).collect()
        } else {
            vec![DMat4::IDENTITY]
        };
        Self { scanner, mounts, beams, pulses: scanner.pulses(), together: scanner.together() }
    }

    /// Number of heads.
    pub(crate) fn heads(&self) -> usize {
        self.mounts.len()
    }

    /// Number of beams of all heads.
    pub(crate) fn beams(&self) -> usize {
        self.mounts.len() * self.beams.len().max(1)
    }

    /// The number, among the beams of all heads, of the beam that fires pulse number `count` of a head.
    pub(crate) fn beam(&self, count: u64, head: usize) -> usize {
        match self.beams.len() {
            0 => head,
            beams => (count % beams as u64) as usize,
        }
    }

    /// The middle pulse of a group of pulses that are traced together, if pulse number `count` is the first
    /// one of the group.
    pub(crate) fn middle(&self, count: u64) -> Option<u64> {
        let beams = self.beams.len().max(1) as u64;
        let nth = if self.beams.is_empty() { count % self.pulses } else { count / beams };
        nth.is_multiple_of(self.together).then(|| count + self.together / 2 * beams)
    }

    /// Aims pulse number `count` of a head. `within` is a pulse of the profile; `count` may lie just beyond
    /// the end of this profile.
    pub(crate) fn shot(&self, track: &Track, count: u64, within: u64, head: usize) -> Shot {
        let t = self.scanner.time(count, head);
        let frame = track.at(t) * self.mounts[head];
        let (angle, direction) = if self.beams.is_empty() {
            let profile = within / self.pulses;
            let pulse = count - profile * self.pulses;
            // The mirror is not locked to the laser, so every profile starts at another fraction of a step.
            let phase = (profile as f64 * GOLDEN_SECTION + head as f64 * 0.5).fract();
            let angle = (pulse as f64 + phase) * TAU / self.pulses as f64 - PI;
            (angle, fan(angle))
        } else {
            // The number of pulses of a rotation is not a multiple of the number of beams, so columns shift
            // from sweep to sweep.
            let angle = (count % self.pulses) as f64 * TAU / self.pulses as f64 - PI;
            let (left, ahead) = angle.sin_cos();
            let (out, up) = self.beams[self.beam(count, head)];
            (angle, DVec3::new(ahead * out, left * out, up))
        };
        let direction = frame.transform_vector3(direction).normalize();
        Shot { t, angle, origin: frame.w_axis.truncate(), direction }
    }
}

/// Transform from the frame of profile head `number` of `heads` to the frame of the vehicle (forward, left,
/// up). A head looks along its -z at scan angle 0 and along its -y at 90 degrees. A single head looks back
/// over the left shoulder.
fn mount(number: u8, heads: u8) -> DMat4 {
    let side = if number == 0 { 1.0 } else { -1.0 };
    let lever = DVec3::new(-0.4, if heads > 1 { 0.35 * side } else { 0.0 }, 0.0);
    let tilt = DMat4::from_rotation_y(ELEVATION.to_radians());
    DMat4::from_translation(lever) * DMat4::from_rotation_z(AZIMUTH.to_radians() * side) * tilt
}

/// Direction of the pulse at a scan angle, radians, in the frame of its profile head.
fn fan(angle: f64) -> DVec3 {
    DVec3::new(0.0, -angle.sin(), -angle.cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_look_down_and_back_at_angle_zero_and_cross_each_other() {
        let look = |number, angle| mount(number, 2).transform_vector3(fan(angle));
        let down = look(0, 0.0);
        assert!(down.z < -0.9 && down.x < -0.2 && (down.length() - 1.0).abs() < 1e-12, "{down}");
        // The planes of the two heads are mirror images: y changes sign, and with it the angle.
        let a = look(0, 1.5);
        let b = look(1, -1.5);
        assert!((a - DVec3::new(b.x, -b.y, b.z)).length() < 1e-9, "{a} {b}");
    }
}
