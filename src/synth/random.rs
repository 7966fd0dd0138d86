//! Numbers that look random and are pure functions of (seed, stream, index): any thread may ask for any of them.

use std::f32::consts::TAU;

use glam::Vec3;

/// A short sequence of pseudo-random numbers (SplitMix64: Steele, Lea, Flood 2014, "Fast splittable pseudorandom
/// number generators"). Not for cryptography.
#[derive(Debug, Clone)]
pub(super) struct Random(u64);

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The sequence that belongs to `index` of `stream`.
    pub(super) fn new(seed: u64, stream: u64, index: u64) -> Self {
        Self(mix(mix(seed ^ stream.wrapping_mul(GOLDEN)).wrapping_add(index.wrapping_mul(GOLDEN))))
    }

    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Uniform in [low, high).
    pub(super) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform angle in [0, 2 pi).
    pub(super) fn angle(&mut self) -> f32 {
        self.unit() * TAU
    }

    /// A unit vector, each as likely.
    pub(super) fn direction(&mut self) -> Vec3 {
        let z = self.range(-1.0, 1.0);
        Vec3::X.rotate_z(self.angle()) * (1.0 - z * z).sqrt() + Vec3::Z * z
    }

    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// Nearly normal, mean 0 and variance 1: the sum of four uniforms (Irwin-Hall), cheap and bounded by 3.5, which
    /// a range finder's noise is, too, after its own outlier filter.
    pub(super) fn gauss(&mut self) -> f32 {
        let bits = self.next();
        let sum: u64 = (0..4).map(|part| (bits >> (16 * part)) & 0xffff).sum();
        (sum as f32 / 65_536.0 - 2.0) * 3.0f32.sqrt()
    }

    /// One of `items`, each as likely; `items` is not empty.
    pub(super) fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[(self.next() % items.len() as u64) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut random = Random::new(1, 2, 3);
        let n = 100_000;
        let units: Vec<f32> = (0..n).map(|_| random.unit()).collect();
        let mean = units.iter().sum::<f32>() / n as f32;
        assert!((mean - 0.5).abs() < 0.005, "{mean}"); // sigma of the mean: 0.2887 / sqrt(1e5) = 0.0009
        let normals: Vec<f32> = (0..n).map(|_| random.gauss()).collect();
        let variance = normals.iter().map(|v| v * v).sum::<f32>() / n as f32;
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn a_sequence_depends_on_every_part_of_its_key() {
        let first = |a, b, c| Random::new(a, b, c).next();
        assert_eq!(first(1, 2, 3), first(1, 2, 3));
        assert!(first(1, 2, 3) != first(2, 2, 3) && first(1, 2, 3) != first(1, 3, 3));
        assert!(first(1, 2, 3) != first(1, 2, 4));
    }
}
