//! Pseudo-random numbers that are a function of another number, so that no result depends on chance.
//!
//! Source: SplitMix64, Steele, Lea, Flood, "Fast splittable pseudorandom number generators" (2014),
//! doi:10.1145/2660193.2660195.

/// Step of a sequence: its numbers are [`splitmix64`] of the seed plus one step, of the seed plus two steps,
/// and so on. It is 2^64 divided by the golden ratio, rounded to an odd number.
pub(crate) const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// Spreads the bits of a number over all 64 (the finaliser of SplitMix64).
#[inline]
pub(crate) fn splitmix64(bits: u64) -> u64 {
    let mixed = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

/// A fixed sequence of numbers that look random.
#[derive(Debug)]
pub(crate) struct Chance(u64);

impl Chance {
    /// The sequence of a seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number.
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN_GAMMA);
        splitmix64(self.0)
    }

    /// The next number below `count`; 0 if this is 0.
    #[expect(clippy::cast_possible_truncation, reason = "below a usize")]
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next()) * count as u128) >> 64) as usize
    }

    /// Three different numbers below `count`, which is at least 3.
    pub(crate) fn three(&mut self, count: usize) -> [usize; 3] {
        let first = self.below(count);
        let mut second = self.below(count - 1);
        second += usize::from(second >= first);
        let mut third = self.below(count - 2);
        for taken in [first.min(second), first.max(second)] {
            third += usize::from(third >= taken);
        }
        [first, second, third]
    }
}
