//! Numbers that look random, for tests: the unit tests of the library have this file as well.

/// A linear congruential generator, which is easy to write in any language: Knuth's MMIX (The Art of Computer
/// Programming, volume 2, section 3.3.4).
#[derive(Debug)]
pub(crate) struct Numbers(u64);

impl Numbers {
    /// The sequence of a seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits. The lower they are, the less random they look.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0
    }

    /// The next number below 2^31.
    pub(crate) fn next(&mut self) -> u64 {
        self.bits() >> 33
    }

    /// The next number below `end`.
    pub(crate) fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }
}
