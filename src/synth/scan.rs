//! The scanner: which ray is fired when, what comes back, and the point records of a slice of time.
//!
//! A slice is a pure function of (settings, seed, window, profiles): slices may be traced by any thread.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, IVec3, Vec3A};
use obvhs::ray::RayHit;
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::Settings;
use super::drive::{Pose, Track};
use super::preset::TABLES;
use super::random::{Random, gauss, sequence};
use super::scene::{Owner, Window};
use super::street::Object;

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

/// The scanner; the defaults are close to a RIEGL VMX-450 (two VQ-450 heads of 550 kHz and 200 profiles/s, 8 mm
/// accuracy, 0.3 mrad).
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Scanner {
    /// Profile heads, 1 or 2.
    pub heads: u8,
    /// Pulses per second of one head.
    pub pulse_rate_hz: f64,
    /// Profiles per second of one head.
    pub profiles_hz: f64,
    /// Farthest target, metres.
    pub range_m: f64,
    /// Standard deviation of a measured range, metres.
    pub noise_m: f64,
    /// Divergence of the beam, milliradians.
    pub divergence_mrad: f64,
    /// Share of pulses that return an isolated echo of nothing.
    pub strays: f64,
}

impl Default for Scanner {
    fn default() -> Self {
        TABLES.scanner.clone()
    }
}

impl Scanner {
    /// Pulses of one profile of one head; the pulse rate is exact, the profile rate follows.
    pub(super) fn pulses(&self) -> u64 {
        (self.pulse_rate_hz / self.profiles_hz).round().max(1.0) as u64
    }

    /// Diameter of the beam at a range, metres.
    fn beam(&self, range: f32) -> f32 {
        0.004 + range * self.divergence_mrad as f32 * 1e-3
    }
}

/// One profile head as mounted, in the vehicle's frame (forward, left, up).
struct Head {
    lever: DVec3,
    /// Direction of every pulse of a profile, and the direction in which it turns.
    pulses: Vec<[DVec3; 2]>,
}

impl Head {
    fn new(number: u8, heads: u8, pulses: u64) -> Self {
        // A single head looks back over the left shoulder.
        let side = if number == 0 { 1.0 } else { -1.0 };
        let (elevation, azimuth) = (ELEVATION.to_radians(), AZIMUTH.to_radians() * side);
        let axis =
            DVec3::new(-azimuth.cos() * elevation.cos(), -azimuth.sin() * elevation.cos(), elevation.sin());
        let down = (DVec3::NEG_Z + axis * axis.z).normalize();
        let across = axis.cross(down);
        let direction = |pulse: u64| {
            let (sin, cos) = (TAU * pulse as f64 / pulses as f64 - PI).sin_cos();
            [down * cos + across * sin, across * cos - down * sin]
        };
        let spread = if heads > 1 { 0.35 * side } else { 0.0 };
        Self { lever: DVec3::new(-0.4, spread, 0.0), pulses: (0..pulses).map(direction).collect() }
    }
}

/// An echo.
#[derive(Debug, Clone, Copy)]
struct Echo {
    range: f32,
    /// Index of the item in the window; `None` for a stray.
    item: Option<u32>,
    intensity: u16,
}

/// A point record of format 6 (LAS 1.4 R15, table 16) with `gt_instance` and `gt_class`, on a little-endian machine.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
pub(super) struct Record {
    /// Millimetres from the street's origin.
    steps: [i32; 3],
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
    instance: u32,
    class: u8,
}

const _: () = assert!(cfg!(target_endian = "little"), "records are written as they are in memory");

/// Points of an object: how many, and the box around them in steps of 1 mm from the street's origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tally {
    pub(super) points: u64,
    pub(super) low: IVec3,
    pub(super) high: IVec3,
}

impl Tally {
    pub(super) const NONE: Self = Self { points: 0, low: IVec3::MAX, high: IVec3::MIN };

    fn add(&mut self, steps: IVec3) {
        *self = self.with(Self { points: 1, low: steps, high: steps });
    }

    /// Both together.
    pub(super) fn with(self, other: Self) -> Self {
        let points = self.points + other.points;
        Self { points, low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

/// A slice of time to be traced: profiles `from..to` of all heads.
pub(super) struct Job {
    pub(super) window: Arc<Window>,
    pub(super) track: Track,
    pub(super) from: u64,
    pub(super) to: u64,
}

/// What a slice of time gave.
#[derive(Debug)]
pub(super) struct Slice {
    /// The profile after the last one that was traced.
    pub(super) to: u64,
    pub(super) records: Vec<Record>,
    pub(super) tallies: Vec<(Arc<Object>, Tally)>,
    pub(super) poses: Vec<Pose>,
}

/// Everything that does not change during a drive.
pub(super) struct Scan<'a> {
    settings: &'a Settings,
    heads: Vec<Head>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(settings: &'a Settings) -> Self {
        let Scanner { heads, .. } = settings.scanner;
        let pulses = settings.scanner.pulses();
        Self { settings, heads: (0..heads).map(|number| Head::new(number, heads, pulses)).collect() }
    }

    /// Time of a pulse, seconds since the start; the second head fires half a pulse later.
    pub(super) fn time(&self, profile: u64, pulse: u64, head: usize) -> f64 {
        let Scanner { pulse_rate_hz, .. } = self.settings.scanner;
        let count = profile * self.settings.scanner.pulses() + pulse;
        (count as f64 + head as f64 / self.heads.len() as f64) / pulse_rate_hz
    }

    /// Traces the profiles of a job until there are `enough` points.
    pub(super) fn trace(&self, job: &Job, enough: u64) -> Slice {
        let mut tracer = Tracer {
            scan: self,
            window: &job.window,
            records: Vec::new(),
            tallies: vec![Tally::NONE; job.window.items.len()],
            before: [None; 2],
            echoes: Vec::new(),
        };
        let mut to = job.from;
        while to < job.to && (tracer.records.len() as u64) < enough {
            for pulse in 0..self.settings.scanner.pulses() {
                for head in 0..self.heads.len() {
                    tracer.pulse(&job.track, to, pulse, head);
                }
            }
            to += 1;
        }
        let time = self.time(job.from, 0, 0)..self.time(to, 0, 0);
        let poses = job.track.poses.iter().filter(|pose| time.contains(&pose.t)).copied().collect();
        let tallies = tracer.tallies.into_iter().zip(&job.window.items);
        let tallies = tallies.filter_map(|(tally, item)| match &item.owner {
            Owner::Object(object) if tally.points > 0 => Some((Arc::clone(object), tally)),
            _ => None,
        });
        Slice { to, records: tracer.records, tallies: tallies.collect(), poses }
    }
}

/// The state of a slice while it is traced.
struct Tracer<'a> {
    scan: &'a Scan<'a>,
    window: &'a Window,
    records: Vec<Record>,
    /// Points by item of the window.
    tallies: Vec<Tally>,
    /// First echo of the previous pulse of every head.
    before: [Option<Echo>; 2],
    echoes: Vec<Echo>,
}

impl Tracer<'_> {
    fn pulse(&mut self, track: &Track, profile: u64, pulse: u64, number: usize) {
        let (scan, scanner) = (self.scan, &self.scan.settings.scanner);
        let t = scan.time(profile, pulse, number);
        let head = &scan.heads[number];
        let vehicle: DMat4 = track.at(t);
        // The mirror is not locked to the laser: every profile starts at another fraction of a step.
        let step = TAU / scanner.pulses() as f64;
        let phase = (profile as f64 * GOLDEN_SECTION + number as f64 * 0.5).fract();
        let [body, turning] = head.pulses[pulse as usize];
        let direction = vehicle.transform_vector3(body + turning * (phase * step)).normalize();
        let angle = (((pulse as f64 + phase) * step - PI).to_degrees() / 0.006).round() as i16;
        let origin = vehicle.transform_point3(head.lever) - self.window.origin;
        let count = profile * scanner.pulses() + pulse;
        let mut random = sequence(scan.settings.seed, 20 + number as u64, count);

        self.echoes.clear();
        self.listen(origin.as_vec3a(), direction.as_vec3a(), &mut random);
        let first = self.echoes.first().copied();
        self.edge(number, &mut random);
        self.before[number] = first;
        if random.random_bool(scanner.strays) {
            self.stray(&mut random);
        }
        self.echoes.truncate(ECHOES);
        for index in 0..self.echoes.len() {
            let echo = self.echoes[index];
            let point = self.window.origin + origin + direction * f64::from(echo.range);
            let file = t / scan.settings.files_every_s.unwrap_or(f64::INFINITY);
            let mut record = Record {
                steps: (point / 0.001).round().as_ivec3().to_array(),
                intensity: echo.intensity,
                returns: (index + 1) as u8 | (self.echoes.len() as u8) << 4,
                flags: (number as u8) << 4,
                angle,
                // After 65,535 files, as many as the field can tell apart, the last one goes on.
                file: file.min(65_534.0) as u16 + 1,
                gps_time: START_TIME + t,
                ..Record::zeroed()
            };
            if let Some(item) = echo.item {
                (record.instance, record.class) = match &self.window.items[item as usize].owner {
                    Owner::Object(object) => (object.id, object.class),
                    Owner::Ground(_) => (0, 1),
                };
                self.tallies[item as usize].add(record.steps.into());
            }
            self.records.push(record);
        }
    }

    /// The echoes of the surfaces along the beam.
    fn listen(&mut self, origin: Vec3A, direction: Vec3A, random: &mut Random) {
        let scanner = &self.scan.settings.scanner;
        let far = scanner.range_m as f32;
        // Nothing nearer than this: the vehicle itself is there.
        let mut near = 1.2;
        while self.echoes.len() < ECHOES {
            let Some(hit) = self.window.hit(origin, direction, near, far) else { return };
            let (echo, rim) = self.echo(&hit, origin, direction, random);
            if let Some(echo) = echo {
                match self.echoes.last_mut() {
                    // Too close to tell apart: one echo, somewhere between the two.
                    Some(last) if echo.range - last.range < SEPARATION => {
                        last.range += (echo.range - last.range) * random.random::<f32>() * 0.5;
                    }
                    _ => self.echoes.push(echo),
                }
            }
            // The part of the beam that passes the rim of a leaf goes on.
            if rim > scanner.beam(hit.t) {
                return;
            }
            near = hit.t + 0.02;
        }
    }

    /// The echo of a hit, if there is one, and the distance to the rim of the leaf that was hit.
    fn echo(&self, hit: &RayHit, o: Vec3A, d: Vec3A, random: &mut Random) -> (Option<Echo>, f32) {
        let scanner = &self.scan.settings.scanner;
        let (surface, point) = self.window.surface(hit, o, d);
        let material = match &self.window.items[hit.instance_id as usize].owner {
            Owner::Ground(ground) => ground.material(point),
            Owner::Object(_) => surface.material,
        };
        let cosine = d.dot(surface.normal.into()).abs().max(0.02);
        let reflectance = material.reflectance * (1.0 + material.speckle * gauss(random)).max(0.2);
        let share = hit.t / scanner.range_m as f32;
        let seen = reflectance * cosine > FAINTEST * share * share * random.random_range(0.6..=1.4);
        if !seen || random.random_bool(f64::from(material.lost)) {
            return (None, surface.rim);
        }
        // Along the beam, the roughness of a surface and the footprint on it are stretched by the incidence.
        let footprint = 0.5 * scanner.beam(hit.t);
        let stretch = (1.0 / (cosine * cosine) - 1.0).sqrt().min(8.0);
        let spread = material.roughness.hypot(footprint * stretch * 0.3);
        let range = hit.t + gauss(random) * spread.hypot(scanner.noise_m as f32);
        let (white, fall, grazing) = BRIGHTNESS;
        let faded = (6.0 / hit.t).min(1.0).powf(fall);
        let intensity = (white * reflectance * cosine.powf(grazing) * faded).clamp(20.0, 65_535.0) as u16;
        (Some(Echo { range, item: Some(hit.instance_id), intensity }), surface.rim)
    }

    /// An edge between this pulse and the one before: the footprint that straddles it returns a mixed point or two
    /// echoes. The chance is the share of the step between two pulses that the footprint covers.
    fn edge(&mut self, head: usize, random: &mut Random) {
        let (Some(first), Some(before)) = (self.echoes.first().copied(), self.before[head]) else { return };
        let (jump, near) = (before.range - first.range, before.range.min(first.range));
        let scanner = &self.scan.settings.scanner;
        let step = near * (TAU / scanner.pulses() as f64) as f32;
        let alone = self.echoes.len() == 1 && jump.abs() >= 0.05;
        if !alone || !random.random_bool(f64::from((scanner.beam(near) / step).min(0.5))) {
            return;
        }
        if jump.abs() < SEPARATION {
            self.echoes[0].range += jump * random.random::<f32>();
        } else {
            self.echoes.insert(usize::from(jump > 0.0), before);
        }
    }

    /// An echo of nothing: a bird, dust, a second reflection that seems to come from below the ground.
    fn stray(&mut self, random: &mut Random) {
        let owner = |echo: &Echo| echo.item.map(|item| &self.window.items[item as usize].owner);
        let ground =
            self.echoes.first().copied().filter(|echo| matches!(owner(echo), Some(Owner::Ground(_))));
        let range = match ground {
            Some(echo) if random.random_bool(0.4) => echo.range + random.random_range(0.3..=3.0),
            Some(echo) => random.random_range(1.5..=echo.range.max(2.0)),
            None => random.random_range(2.0..=self.scan.settings.scanner.range_m as f32 * 0.5),
        };
        self.echoes.clear();
        self.echoes.push(Echo { range, item: None, intensity: random.random_range(40.0..=900.0) as u16 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_look_down_at_angle_zero_and_cross_each_other() {
        let [left, right] = [0, 1].map(|number| Head::new(number, 2, 360));
        let [down, _] = left.pulses[180];
        assert!(down.z < -0.9 && (down.length() - 1.0).abs() < 1e-12);
        // The planes of the two heads are mirror images: y changes sign, and with it the angle.
        let (a, b) = (left.pulses[270][0], right.pulses[90][0]);
        assert!((a - DVec3::new(b.x, -b.y, b.z)).length() < 1e-9, "{a} {b}");
    }

    #[test]
    fn the_rates_of_the_default_are_those_of_the_data_sheet() {
        let settings = Settings::new(super::super::Preset::Suburb);
        assert_eq!(settings.scanner.pulses(), 2_750);
        let scan = Scan::new(&settings);
        assert!((scan.time(1, 0, 0) - 0.005).abs() < 1e-12);
    }
}
