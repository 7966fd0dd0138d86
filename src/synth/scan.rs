//! Scanning: which ray is fired when, what comes back, and the point records of a slice of time.
//!
//! A slice is a pure function of (settings, seed, window, profiles): slices may be traced by any thread.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, Vec3A};
use obvhs::ray::RayHit;
use rand::RngExt;

use super::drive::Track;
use super::random::{Random, gauss, sequence};
use super::scanner::Scanner;
use super::scene::{Owner, Window};
use super::settings::Settings;

/// GPS time of the start of a drive, adjusted standard seconds (2026-06-15 08:00 GPS time).
pub(super) const START_TIME: f64 = 465_552_000.0;
/// Heads of a pair look backwards and outwards: azimuth of the axis of rotation from straight back, and its
/// elevation, degrees. A crossed pair, fitted to the labelled scenes.
const AZIMUTH: f64 = 45.0;
const ELEVATION: f64 = 22.0;
/// Fraction by which the phase of the profiles advances: the most irrational one, so that no rows line up.
const GOLDEN_SECTION: f64 = 0.618_033_988_749_895;
/// Two echoes of one pulse closer than this are one echo in between, metres (pulse length of some nanoseconds).
const SEPARATION: f32 = 0.6;
/// Most echoes of a pulse that are kept.
const ECHOES: usize = 5;
/// Intensity of a white surface at normal incidence nearer than 6 m, and how it falls with range and incidence:
/// fitted to the medians of the labelled scenes by range and class.
const BRIGHTNESS: (f32, f32, f32) = (31_700.0, 0.75, 0.7);
/// Reflectance times the cosine of incidence at which a target at full range is just seen; the square of the range
/// scales it.
const FAINTEST: f32 = 0.06;

/// From the frame of the first or second of so many profile heads to the vehicle's (forward, left, up): at scan angle 0 a
/// head looks along its -z, at 90 degrees along its -y. A single one looks back over the left shoulder.
fn mount(number: u8, heads: u8) -> DMat4 {
    let side = if number == 0 { 1.0 } else { -1.0 };
    let lever = DVec3::new(-0.4, if heads > 1 { 0.35 * side } else { 0.0 }, 0.0);
    let tilt = DMat4::from_rotation_y(ELEVATION.to_radians());
    DMat4::from_translation(lever) * DMat4::from_rotation_z(AZIMUTH.to_radians() * side) * tilt
}

/// Direction of the pulse at a scan angle, radians, in the frame of its head.
fn fan(angle: f64) -> DVec3 {
    DVec3::new(0.0, -angle.sin(), -angle.cos())
}

/// An echo.
#[derive(Debug, Clone, Copy)]
struct Echo {
    range: f32,
    /// Number and class of the object; of the ground 0 and 1, of a stray 0 and 0.
    instance: u32,
    class: u8,
    intensity: u16,
}

/// A point record of format 6 (LAS 1.4 R15, table 16) with `gt_instance` and `gt_class`, on a little-endian machine.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
pub(super) struct Record {
    /// Millimetres from the street's origin.
    pub(super) steps: [i32; 3],
    intensity: u16,
    /// Return number and number of returns.
    returns: u8,
    /// Scanner channel.
    flags: u8,
    classification: u8,
    user_data: u8,
    /// Scan angle in steps of 0.006 degrees.
    angle: i16,
    /// Point source: the number of the file.
    pub(super) file: u16,
    gps_time: f64,
    pub(super) instance: u32,
    class: u8,
}

const _: () = assert!(cfg!(target_endian = "little"), "records are written as they are in memory");

/// A slice of time, before and after it was traced.
pub(super) struct Slice {
    /// What there is about it.
    pub(super) window: Arc<Window>,
    /// The poses in it and about it.
    pub(super) track: Track,
    /// Profiles of all heads.
    pub(super) profiles: Range<u64>,
    pub(super) records: Vec<Record>,
}

impl Slice {
    /// Traces its pulses.
    pub(super) fn trace(&mut self, settings: &Settings) {
        let Self { window, track, profiles, records } = self;
        let scanner = &settings.scanner;
        let mounts: Vec<DMat4> = (0..scanner.heads).map(|number| mount(number, scanner.heads)).collect();
        // First echo of the previous pulse of every head.
        let mut before = [None; 2];
        let (together, mut about) = (scanner.together(), [const { Vec::new() }; 2]);
        let mut echoes = Vec::with_capacity(ECHOES + 1);
        for profile in profiles.clone() {
            let aim = |pulse: u64, number: usize| {
                let t = scanner.time(profile, pulse, number);
                // The mirror is not locked to the laser: every profile starts at another fraction of a step.
                let phase = (profile as f64 * GOLDEN_SECTION + number as f64 * 0.5).fract();
                let angle = (pulse as f64 + phase) * TAU / scanner.pulses() as f64 - PI;
                let head = track.at(t) * mounts[number];
                let direction = head.transform_vector3(fan(angle)).normalize();
                (t, angle, head.w_axis.truncate() - window.origin, direction)
            };
            for pulse in 0..scanner.pulses() {
                for number in 0..mounts.len() {
                    if pulse % together == 0 {
                        let (_, _, origin, direction) = aim(pulse + together / 2, number);
                        about[number] =
                            window.about(origin.as_vec3a(), direction.as_vec3a(), scanner.range_m as f32);
                    }
                    let (t, angle, origin, direction) = aim(pulse, number);
                    let key = (20 + number as u64, profile * scanner.pulses() + pulse);
                    let mut beam = Beam {
                        scanner,
                        window,
                        about: &about[number],
                        origin: origin.as_vec3a(),
                        direction: direction.as_vec3a(),
                        random: sequence(settings.seed, key.0, key.1),
                        echoes: &mut echoes,
                    };
                    before[number] = beam.fire(before[number]);
                    let file = t / settings.files_every_s.unwrap_or(f64::INFINITY);
                    for (index, echo) in echoes.iter().enumerate() {
                        let point = window.origin + origin + direction * f64::from(echo.range);
                        records.push(Record {
                            steps: (point / 0.001).round().as_ivec3().to_array(),
                            intensity: echo.intensity,
                            returns: (index + 1) as u8 | (echoes.len() as u8) << 4,
                            flags: (number as u8) << 4,
                            angle: (angle.to_degrees() / 0.006).round() as i16,
                            // After 65,535 files, as many as the field can tell apart, the last one goes on.
                            file: file.min(65_534.0) as u16 + 1,
                            gps_time: START_TIME + t,
                            instance: echo.instance,
                            class: echo.class,
                            ..Record::zeroed()
                        });
                    }
                }
            }
        }
    }
}

/// A pulse and its echoes, in the frame of the window.
struct Beam<'a> {
    scanner: &'a Scanner,
    window: &'a Window,
    /// What the beam may meet.
    about: &'a [u32],
    origin: Vec3A,
    direction: Vec3A,
    random: Random,
    echoes: &'a mut Vec<Echo>,
}

impl Beam<'_> {
    /// Finds the echoes; `before` is the first one of the pulse before, the result the first one of this.
    fn fire(&mut self, before: Option<Echo>) -> Option<Echo> {
        self.echoes.clear();
        self.listen();
        let first = self.echoes.first().copied();
        if let (Some(first), Some(before)) = (first, before) {
            self.edge(first, before);
        }
        if self.random.random_bool(self.scanner.strays) {
            self.stray();
        }
        self.echoes.truncate(ECHOES);
        first
    }

    /// The echoes of the surfaces along the beam.
    fn listen(&mut self) {
        // Nothing nearer than this: the vehicle itself is there.
        let (mut near, far) = (1.2, self.scanner.range_m as f32);
        while self.echoes.len() < ECHOES
            && let Some(hit) = self.window.hit(self.about, self.origin, self.direction, near, far)
        {
            let (echo, rim) = self.echo(&hit);
            match (echo, self.echoes.last_mut()) {
                (None, _) => {}
                // Too close to tell apart: one echo, somewhere between the two.
                (Some(echo), Some(last)) if echo.range - last.range < SEPARATION => {
                    last.range += (echo.range - last.range) * self.random.random_range(0.0..0.5);
                }
                (Some(echo), _) => self.echoes.push(echo),
            }
            // The part of the beam that passes the rim of a leaf goes on.
            if rim > self.scanner.beam(hit.t) {
                return;
            }
            near = hit.t + 0.02;
        }
    }

    /// The echo of a hit, if there is one, and the distance to the rim of the leaf that was hit.
    fn echo(&mut self, hit: &RayHit) -> (Option<Echo>, f32) {
        let (surface, point) = self.window.surface(hit, self.origin, self.direction);
        let (material, instance, class) = match &self.window.items[hit.instance_id as usize].owner {
            Owner::Ground(ground) => (ground.material(point), 0, 1),
            Owner::Object(object) => (surface.material, object.id, object.class),
        };
        let random = &mut self.random;
        let cosine = self.direction.dot(surface.normal.into()).abs().max(0.02);
        let reflectance = material.reflectance * (1.0 + material.speckle * gauss(random)).max(0.2);
        let share = hit.t / self.scanner.range_m as f32;
        let seen = reflectance * cosine > FAINTEST * share * share * random.random_range(0.6..=1.4);
        if !seen || random.random_bool(f64::from(material.lost)) {
            return (None, surface.rim);
        }
        // Along the beam, the roughness of a surface and the footprint on it are stretched by the incidence.
        let footprint = 0.5 * self.scanner.beam(hit.t);
        let stretch = (1.0 / (cosine * cosine) - 1.0).sqrt().min(8.0);
        let spread = material.roughness.hypot(footprint * stretch * 0.3);
        let range = hit.t + gauss(random) * spread.hypot(self.scanner.noise_m as f32);
        let (white, fall, grazing) = BRIGHTNESS;
        let faded = (6.0 / hit.t).min(1.0).powf(fall);
        let intensity = (white * reflectance * cosine.powf(grazing) * faded).clamp(20.0, 65_535.0) as u16;
        (Some(Echo { range, instance, class, intensity }), surface.rim)
    }

    /// An edge between this pulse and the one before: the footprint that straddles it returns a mixed point or two
    /// echoes. The chance is the share of the step between two pulses that the footprint covers.
    fn edge(&mut self, first: Echo, before: Echo) {
        let (jump, near) = (before.range - first.range, before.range.min(first.range));
        let step = near * (TAU / self.scanner.pulses() as f64) as f32;
        let alone = self.echoes.len() == 1 && jump.abs() >= 0.05;
        if !alone || !self.random.random_bool(f64::from(self.scanner.beam(near) / step).min(0.5)) {
            return;
        }
        if jump.abs() < SEPARATION {
            self.echoes[0].range += jump * self.random.random::<f32>();
        } else {
            self.echoes.insert(usize::from(jump > 0.0), before);
        }
    }

    /// An echo of nothing: a bird, dust, a second reflection that seems to come from below the ground.
    fn stray(&mut self) {
        let random = &mut self.random;
        let range = match self.echoes.first() {
            Some(echo) if echo.class == 1 && random.random_bool(0.4) => {
                echo.range + random.random_range(0.3..=3.0)
            }
            Some(echo) if echo.class == 1 => random.random_range(1.5..=echo.range.max(2.0)),
            _ => random.random_range(2.0..=self.scanner.range_m as f32 * 0.5),
        };
        let intensity = random.random_range(40..=900);
        self.echoes.clear();
        self.echoes.push(Echo { range, instance: 0, class: 0, intensity });
    }
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
        let (a, b) = (look(0, 1.5), look(1, -1.5));
        assert!((a - DVec3::new(b.x, -b.y, b.z)).length() < 1e-9, "{a} {b}");
    }
}
