//! Numbers that look random and are pure functions of (seed, stream, index): any thread may ask for any of them.

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use xxhash_rust::xxh3::xxh3_64;

/// A short sequence of pseudo-random numbers. Not for cryptography.
pub(super) type Random = rand_xoshiro::SplitMix64;

/// The sequence that belongs to `index` of `stream`.
pub(super) fn sequence(seed: u64, stream: u64, index: u64) -> Random {
    Random::seed_from_u64(xxh3_64(bytemuck::bytes_of(&[seed, stream, index])))
}

/// Normal, mean 0 and variance 1.
pub(super) fn gauss(random: &mut Random) -> f32 {
    random.sample(rand_distr::StandardNormal)
}

/// A unit vector, each as likely.
pub(super) fn direction(random: &mut Random) -> Vec3 {
    random.sample::<[f32; 3], _>(rand_distr::UnitSphere).into()
}

/// One of `items`, each as likely; `items` is not empty.
pub(super) fn pick<'a, T>(items: &'a [T], random: &mut Random) -> &'a T {
    &items[random.random_range(0..items.len())]
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
}
