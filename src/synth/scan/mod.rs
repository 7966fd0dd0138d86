//! Scanning: the echoes of every pulse and the point records of a slice of time.
//!
//! A slice is a pure function of (settings, seed, window, pulses): slices may be traced by any thread.

pub(crate) mod aim;
pub(crate) mod drive;
pub(crate) mod roadway;
pub(crate) mod scanner;

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, Vec3, Vec3A};
use obvhs::ray::RayHit;
use rand::RngExt;

use self::aim::{Aim, Shot};
use self::drive::Track;
use self::roadway::Roadway;
use self::scanner::Scanner;
use crate::synth::random::{Random, gauss, sequence};
use crate::synth::scene::material::Material;
use crate::synth::scene::shape::Surface;
use crate::synth::scene::{Beam, Owner, Window};
use crate::synth::settings::Settings;
use crate::synth::street::traffic::seen_by;

/// GPS time of the start of a drive, adjusted standard seconds (2026-06-15 09:46:40 GPS time).
pub(crate) const START_TIME: f64 = 465_552_000.0;
/// Two echoes of one pulse that are closer than this merge into one between them, metres (pulse length of
/// some nanoseconds).
const SEPARATION: f32 = 0.6;
/// Nearest target in metres. Nothing nearer is seen, because the vehicle itself is there.
const NEAREST: f32 = 1.2;
/// Smallest measured range in metres: noise moves an echo of a near target at most this near to the scanner.
const SHORTEST: f32 = 0.5 * NEAREST;
/// Maximum number of echoes of a pulse.
const ECHOES: usize = 5;
/// Intensity of a white surface at normal incidence nearer than 6 m, and the exponents with which it falls
/// with range and with the cosine of incidence. Fitted to the medians of the labelled scenes by range and
/// class.
const BRIGHTNESS: (f32, f32, f32) = (31_700.0, 0.75, 0.7);
/// Smallest product of reflectance and cosine of incidence of a target that is seen at full range. It scales
/// with the square of the range.
const FAINTEST: f32 = 0.06;
/// Share of a pulse that a polished surface mirrors at normal incidence: glass and clear coat with refractive
/// index 1.5.
const MIRRORED: f32 = 0.04;
/// Distance from the mirror below which a mirrored pulse hits nothing, metres: the mirror itself is there.
const CLEAR: f32 = 0.05;

/// An echo.
#[derive(Debug, Clone, Copy)]
struct Echo {
    range: f32,
    /// Number and class of the object: 0 and 1 for the ground, 0 and 0 without a target.
    instance: u32,
    class: u8,
    intensity: u16,
}

/// A point record of format 6 (LAS 1.4 R15, table 16) with `gt_instance` and `gt_class`, on a little-endian
/// machine.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
pub(crate) struct Record {
    /// Millimetres from the street's origin.
    pub(crate) steps: [i32; 3],
    intensity: u16,
    /// Return number and number of returns.
    returns: u8,
    /// Scanner channel.
    flags: u8,
    classification: u8,
    /// Beam of a spinning head, from the lowest.
    user_data: u8,
    /// Scan angle, or azimuth of a spinning head, in steps of 0.006 degrees.
    angle: i16,
    /// Point source: the number of the file.
    pub(crate) file: u16,
    gps_time: f64,
    pub(crate) instance: u32,
    class: u8,
}

const _: () = assert!(cfg!(target_endian = "little"), "records are written as they are in memory");

/// A slice of time, before and after tracing.
pub(crate) struct Slice {
    /// The scene around it.
    pub(crate) window: Window,
    /// Seconds since the start at its middle.
    pub(crate) middle: f64,
    /// The poses within it and around it.
    pub(crate) track: Track,
    /// The roadway within range.
    pub(crate) roadway: Arc<Roadway>,
    /// Pulses of every head.
    pub(crate) pulses: Range<u64>,
    pub(crate) records: Vec<Record>,
}

impl Slice {
    /// Traces its pulses.
    pub(crate) fn trace(&mut self, settings: &Settings) {
        let Self { window, middle: time, track, pulses, records, .. } = self;
        let scanner = &settings.scanner;
        let aim = Aim::new(scanner);
        // Per beam: the first echo of its previous pulse, and the items that its next pulses may hit.
        let mut before = vec![None; aim.beams()];
        let mut about = vec![Vec::new(); aim.beams()];
        let mut echoes = Vec::with_capacity(ECHOES + 1);
        let ray = |shot: &Shot| Beam {
            origin: (shot.origin - window.origin).as_vec3a(),
            direction: shot.direction.as_vec3a(),
            late: (shot.t - *time) as f32,
        };
        for count in pulses.clone() {
            for head in 0..aim.heads() {
                let beam = aim.beam(count, head);
                if let Some(middle) = aim.middle(count) {
                    let shot = aim.shot(track, middle, count, head);
                    about[beam] = window.about(&ray(&shot), scanner.range_m as f32);
                }
                let shot = aim.shot(track, count, count, head);
                let mut pulse = Pulse {
                    scanner,
                    window,
                    head,
                    about: &about[beam],
                    beam: ray(&shot),
                    random: sequence(settings.seed, 20 + head as u64, count),
                    echoes: &mut echoes,
                };
                before[beam] = pulse.fire(before[beam]);
                let Shot { t, angle, origin, direction } = shot;
                let file = t / settings.files_every_s.unwrap_or(f64::INFINITY);
                let (shift, turn) = scanner.drift(settings.seed, count);
                let heading = DVec2::from_angle(turn);
                for (index, echo) in echoes.iter().enumerate() {
                    let ray = direction * f64::from(echo.range);
                    let ray = heading.rotate(ray.truncate()).extend(ray.z);
                    let point = origin + ray + shift;
                    records.push(Record {
                        steps: (point / 0.001).round().as_ivec3().to_array(),
                        intensity: echo.intensity,
                        returns: (index + 1) as u8 | (echoes.len() as u8) << 4,
                        flags: (head as u8) << 4,
                        user_data: if scanner.spinning.is_some() { beam as u8 } else { 0 },
                        angle: (angle.to_degrees() / 0.006).round() as i16,
                        // After 65,535 files, the largest number that the field can store, the last file
                        // continues.
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

/// A target of a pulse.
struct Target<'a> {
    surface: Surface,
    material: &'static Material,
    /// Cosine of the angle of incidence.
    cosine: f32,
    instance: u32,
    class: u8,
    owner: &'a Owner,
    /// The point that was hit, in the frame of the model.
    point: Vec3,
}

impl Target<'_> {
    /// Whether the target mirrors at this point. The ground mirrors where it is wet.
    fn polished(&self) -> bool {
        match self.owner {
            Owner::Ground(ground) => ground.wet(self.point),
            Owner::Object(_) => true,
        }
    }
}

/// A pulse and its echoes, in the frame of the window.
struct Pulse<'a> {
    scanner: &'a Scanner,
    window: &'a Window,
    head: usize,
    /// The items that the beam may hit.
    about: &'a [u32],
    beam: Beam,
    random: Random,
    echoes: &'a mut Vec<Echo>,
}

impl<'a> Pulse<'a> {
    /// Finds the echoes. `before` is the first echo of the pulse before; returns the first echo of this one.
    fn fire(&mut self, before: Option<Echo>) -> Option<Echo> {
        self.echoes.clear();
        self.listen();
        // An echo without a target has no edge.
        let first = self.echoes.first().copied().filter(|first| first.class > 0);
        if let (Some(first), Some(before)) = (first, before) {
            self.edge(first, before);
        }
        if self.random.random_bool(self.scanner.strays) {
            self.stray();
        }
        self.echoes.truncate(ECHOES);
        if self.scanner.spinning.is_some() {
            self.strongest();
        }
        first
    }

    /// Keeps the strongest echo, the first of several that are equally strong.
    fn strongest(&mut self) {
        let first = |&(a, b): &(usize, &Echo)| (b.intensity, std::cmp::Reverse(a));
        if let Some((index, _)) = self.echoes.iter().enumerate().max_by_key(first) {
            self.echoes.swap(0, index);
            self.echoes.truncate(1);
        }
    }

    /// The echoes of the surfaces along the beam.
    fn listen(&mut self) {
        let mut near = NEAREST;
        let far = self.scanner.range_m as f32;
        while self.echoes.len() < ECHOES
            && let Some(hit) = self.window.hit(self.about, &self.beam, near, far)
        {
            let (echo, rim) = self.echo(&hit);
            match (echo, self.echoes.last_mut()) {
                (None, _) => {}
                // Too close to distinguish: one echo, somewhere between the two.
                (Some(echo), Some(last)) if echo.range - last.range < SEPARATION => {
                    last.range += (echo.range - last.range) * self.random.random_range(0.0..0.5);
                }
                (Some(echo), _) => self.echoes.push(echo),
            }
            // The part of the beam outside the rim of a leaf continues, and so does the part that glass lets
            // through.
            if rim > self.scanner.beam(hit.t) {
                return;
            }
            near = hit.t + 0.02;
        }
    }

    /// The echo of a hit, if there is one, and the distance to the rim of the leaf that was hit. The distance
    /// is 0 if the pulse goes through the surface.
    fn echo(&mut self, hit: &RayHit) -> (Option<Echo>, f32) {
        let target = self.target(hit, &self.beam);
        let material = target.material;
        let rim = target.surface.rim;
        // Schlick 1994, An inexpensive BRDF model for physically-based rendering: a grazing pulse is mirrored
        // completely.
        let mirrored = MIRRORED + (1.0 - MIRRORED) * (1.0 - target.cosine).powi(5);
        let mirrors = material.mirrored > 0.0
            && self.random.random_bool(f64::from(material.mirrored * mirrored))
            && target.polished();
        if mirrors {
            return (self.mirrored(hit, &target, mirrored), rim);
        }
        let echo = self.answer(&target, hit.t);
        let through =
            echo.is_none() && material.through > 0.0 && self.random.random_bool(f64::from(material.through));
        (echo, if through { 0.0 } else { rim })
    }

    /// The target of a beam.
    fn target(&self, hit: &RayHit, beam: &Beam) -> Target<'a> {
        let (surface, point) = self.window.surface(hit, beam);
        let owner = self.window.owner(hit);
        let (material, instance, class) = match owner {
            Owner::Ground(ground) => (ground.material(point), 0, 1),
            Owner::Object(object) => (surface.material, seen_by(object, self.head), object.class),
        };
        let cosine = beam.direction.dot(surface.normal.into()).abs().max(0.02);
        Target { surface, material, cosine, instance, class, owner, point }
    }

    /// The echo of a target at the end of a path of `way` metres, if it is seen.
    fn answer(&mut self, target: &Target<'_>, way: f32) -> Option<Echo> {
        let &Target { material, cosine, instance, class, .. } = target;
        let random = &mut self.random;
        let reflectance = material.reflectance * (1.0 + material.speckle * gauss(random)).max(0.2);
        let share = way / self.scanner.range_m as f32;
        let seen = reflectance * cosine > FAINTEST * share * share * random.random_range(0.6..=1.4);
        if !seen || random.random_bool(f64::from(material.lost)) {
            return None;
        }
        // Along the beam, the roughness of a surface and the footprint on it are stretched by the incidence.
        let footprint = 0.5 * self.scanner.beam(way);
        let stretch = (1.0 / (cosine * cosine) - 1.0).sqrt().min(8.0);
        let spread = material.roughness.hypot(footprint * stretch * 0.3);
        let range = way + gauss(random) * spread.hypot(self.scanner.noise_m as f32);
        if range < SHORTEST {
            return None;
        }
        let (white, fall, grazing) = BRIGHTNESS;
        let faded = (6.0 / way).min(1.0).powf(fall);
        let intensity = (white * reflectance * cosine.powf(grazing) * faded).clamp(20.0, 65_535.0) as u16;
        Some(Echo { range, instance, class, intensity })
    }

    /// The echo of a pulse of which a surface mirrors this share, if the pulse then hits something else. The
    /// scanner knows only the length of the path. So the point lies on the line of the pulse beyond the
    /// mirror, where there is no target. If the ground is the mirror, the point is below the ground.
    fn mirrored(&mut self, hit: &RayHit, mirror: &Target<'_>, share: f32) -> Option<Echo> {
        let normal = Vec3A::from(mirror.surface.normal);
        let direction = self.beam.direction - normal * (2.0 * normal.dot(self.beam.direction));
        let beam = Beam { origin: self.beam.at(hit.t), direction: direction.normalize(), ..self.beam };
        let far = self.scanner.range_m as f32 - hit.t;
        let about = self.window.about(&beam, far);
        let next = self.window.hit(&about, &beam, CLEAR, far)?;
        // Too close to distinguish: one echo, from the mirror.
        if next.t < SEPARATION {
            return self.answer(mirror, hit.t);
        }
        let target = self.target(&next, &beam);
        let echo = self.answer(&target, hit.t + next.t)?;
        // On the way back, the mirror takes its share again.
        let intensity = (f32::from(echo.intensity) * share).max(20.0) as u16;
        Some(Echo { instance: 0, class: 0, intensity, ..echo })
    }

    /// An edge between this pulse and the previous one. A footprint across the edge returns a mixed point or
    /// two echoes. The probability is the share of the step between two pulses that the footprint covers.
    fn edge(&mut self, first: Echo, before: Echo) {
        let jump = before.range - first.range;
        let near = before.range.min(first.range);
        let step = near * (TAU / self.scanner.columns()) as f32;
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

    /// An echo without a target: a bird, dust, or a second reflection that seems to come from below the
    /// ground.
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
    use std::sync::Arc;

    use glam::{DVec3, Mat3A, vec3};

    use super::*;
    use crate::synth::scene::Placed;
    use crate::synth::scene::model::Model;
    use crate::synth::scene::shape::Shape;
    use crate::synth::things::object::{Object, Place};
    use crate::synth::things::truth::Truth;

    /// Echoes of 16,000 pulses at 45 degrees onto an upright pane of this material, 14.14 m away. Mirrored
    /// pulses hit a wall after 28.28 m more.
    fn echoes(pane: &str) -> Vec<Echo> {
        let slab = |id, low, high, name| {
            let model = Arc::new(Model::new(vec![Shape::Block(low, high).of(name)]));
            let place = Place::Stands { base: DVec3::ZERO, s: 0.0 };
            let object = Object { id, class: 5, kind: "pane", place, height: 3.0, truth: Truth::default() };
            let owner = Owner::Object(Arc::new(object));
            Placed { model, at: DVec3::ZERO, turn: Mat3A::IDENTITY, owner }
        };
        let placed = [
            slab(1, vec3(10.0, 0.0, -3.0), vec3(10.1, 50.0, 3.0), pane),
            slab(2, vec3(-50.0, 30.0, -3.0), vec3(9.0, 31.0, 3.0), "plaster"),
        ];
        let scanner = Scanner { strays: 0.0, noise_m: 0.0, divergence_mrad: 0.0, ..Scanner::default() };
        let window = Window::new(DVec3::ZERO, scanner.spread(), &placed);
        let direction = Vec3A::new(1.0, 1.0, 0.0).normalize();
        let beam = Beam { origin: Vec3A::ZERO, direction, late: 0.0 };
        let about = window.about(&beam, 100.0);
        let mut all = Vec::new();
        for count in 0..16_000 {
            let mut echoes = Vec::new();
            let random = sequence(1, 2, count);
            let scanner = &scanner;
            Pulse { scanner, window: &window, head: 0, about: &about, beam, random, echoes: &mut echoes }
                .fire(None);
            all.extend(echoes);
        }
        all
    }

    #[test]
    fn a_mirrored_pulse_lies_beyond_the_mirror_by_the_length_of_its_way_and_has_no_target() {
        let echoes = echoes("glass");
        let mirrored: Vec<f32> =
            echoes.iter().filter(|echo| echo.class == 0).map(|echo| echo.range).collect();
        // 4.2 % of the pulses, by Schlick's formula, on a quarter of the pane.
        assert!((120..220).contains(&mirrored.len()), "{} of 16,000 pulses", mirrored.len());
        let way = 30.0 * 2f32.sqrt();
        assert!(mirrored.iter().all(|range| (range - way).abs() < 0.05), "{mirrored:?}");
        assert!(echoes.iter().all(|echo| (echo.class == 0) == (echo.instance == 0)));
        // The other pulses hit the pane itself: its front or its back.
        let direct = echoes.iter().filter(|echo| echo.class == 5);
        assert!(direct.clone().count() > 100);
        assert!(direct.clone().all(|echo| echo.instance == 1 && (14.0..14.5).contains(&echo.range)));
    }

    #[test]
    fn what_is_not_polished_mirrors_nothing() {
        let echoes = echoes("plaster");
        assert!(echoes.len() == 16_000 && echoes.iter().all(|echo| echo.instance == 1));
    }
}
