//! Numbers that look random and are pure functions of (seed, stream, index), so that any thread can compute
//! any of them.

use std::f64::consts::TAU;

use glam::{DVec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_distr::{StandardNormal, UnitSphere};
use xxhash_rust::xxh3::xxh3_64;

/// A short sequence of pseudo-random numbers. Not for cryptography.
pub(crate) type Random = rand_xoshiro::SplitMix64;

/// The sequence that belongs to `index` of `stream`.
pub(crate) fn sequence(seed: u64, stream: u64, index: u64) -> Random {
    Random::seed_from_u64(xxh3_64(bytemuck::bytes_of(&[seed, stream, index])))
}

/// The sequence that belongs to a name. It does not depend on any other name.
pub(crate) fn named(seed: u64, name: &str) -> Random {
    sequence(seed, xxh3_64(name.as_bytes()), 0)
}

/// A normally distributed number with mean 0 and variance 1.
pub(crate) fn gauss(random: &mut Random) -> f32 {
    random.sample(StandardNormal)
}

/// A random unit vector; all directions are equally likely.
pub(crate) fn direction(random: &mut Random) -> Vec3 {
    random.sample::<[f32; 3], _>(UnitSphere).into()
}

/// One of `items`, all equally likely; `items` is not empty.
pub(crate) fn pick<'a, T>(items: &'a [T], random: &mut Random) -> &'a T {
    &items[random.random_range(0..items.len())]
}

/// A sum of sine waves over time, a line or the plane: smooth random variation. Each wave has amplitude,
/// angular frequency, phase and direction in the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Waves<const N: usize>([(f64, f64, f64, DVec2); N]);

impl<const N: usize> Waves<N> {
    /// Waves of these amplitudes and lengths.
    pub(crate) fn new(parts: [(f64, f64); N], random: &mut Random) -> Self {
        Self(parts.map(|(amplitude, length)| {
            let [phase, way] = [0; 2].map(|_| random.random_range(0.0..TAU));
            (amplitude, TAU / length, phase, DVec2::from_angle(way))
        }))
    }

    pub(crate) fn along(&self, x: f64) -> f64 {
        self.0.iter().map(|(amplitude, frequency, phase, _)| amplitude * (x * frequency + phase).sin()).sum()
    }

    pub(crate) fn over(&self, point: DVec2) -> f64 {
        self.0.iter().map(|wave| Waves([*wave]).along(point.dot(wave.3))).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sequence_depends_on_every_part_of_its_key() {
        let first = |a, b, c| sequence(a, b, c).random::<u64>();
        assert_eq!(first(1, 2, 3), first(1, 2, 3));
        assert!(first(1, 2, 3) != first(2, 2, 3) && first(1, 2, 3) != first(1, 3, 3));
        assert!(first(1, 2, 3) != first(1, 2, 4));
    }

    #[test]
    fn waves_repeat_after_their_length() {
        let waves = Waves::new([(2.0, 50.0), (0.5, 12.5)], &mut sequence(1, 2, 3));
        assert!((waves.along(7.0) - waves.along(57.0)).abs() < 1e-9);
        assert!((waves.along(7.0) - waves.along(20.0)).abs() > 0.1 && waves.along(7.0).abs() <= 2.5);
    }
}
