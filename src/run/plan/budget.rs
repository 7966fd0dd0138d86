//! How many threads, how much memory, and how long tiles may be for it.

use crate::config::RunConfig;
use crate::run::engine::{Limits, free_bytes};

/// Points of a tile at most: beyond this, larger tiles save hardly any halo and only delay balance and resuming.
const LARGEST_TILE_POINTS: u64 = 8_000_000;
/// Points of a tile at least, however little memory there is: below this a tile is mostly halo.
const SMALLEST_TILE_POINTS: u64 = 20_000;
/// A small drive is cut so that workers share it, but not into tiles smaller than this.
const SHARED_TILE_POINTS: u64 = 400_000;
/// What a byte that is held beside tiles counts for in the budget, so that a drive of any length takes as much. More than
/// one: the budget is shared out by what tiles are estimated to need, of which they take four fifths on streets, beside what
/// is counted the allocator holds about a tenth of it, and of many pairs of tiles the largest is larger than of few.
/// Chosen by `scripts/lengths.sh`.
const HELD_WEIGHT: u64 = 2;
/// The part of a limit that a core takes at least, however much is around it (chosen: with less, most points are read several
/// times, and that is no faster than to let tiles wait for each other).
const LEAST_CORE: f64 = 0.25;
/// Part of the budget that is left when tiles are made equal, because a halo is not what it was around another core.
const SPARE: f64 = 0.03;

/// Threads and memory of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// Worker threads.
    pub(crate) threads: usize,
    /// Bytes for the points in flight.
    pub(crate) memory: u64,
}

impl Budget {
    /// The budget that the settings ask for.
    pub(crate) fn resolve(config: &RunConfig) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = if config.threads == 0 { cores } else { config.threads };
        let memory = if config.memory_mib == 0 { free_bytes() / 2 } else { config.memory_mib << 20 };
        Self { threads, memory }
    }

    /// The budget as limits of what is in flight.
    pub(crate) fn limits(self) -> Limits {
        Limits { threads: self.threads, memory: self.memory }
    }

    /// What is left of the budget beside `held` bytes that grow with the drive, so that the whole does not; half of it at
    /// least, since without tiles in flight nothing gets done.
    pub(crate) fn beside(self, held: u64) -> Self {
        let weight = held.saturating_mul(HELD_WEIGHT);
        Self { memory: self.memory.saturating_sub(weight).max(self.memory / 2), ..self }
    }

    /// Tiles to try first for a drive of `points`, when a point in flight takes `bytes_per_point`.
    pub(crate) fn tiles(&self, points: u64, bytes_per_point: u64) -> u64 {
        let most = (self.each() / bytes_per_point.max(1)).clamp(SMALLEST_TILE_POINTS, LARGEST_TILE_POINTS);
        let shared = (points / SHARED_TILE_POINTS).min(2 * self.threads as u64);
        self.even(points, points.div_ceil(most).max(shared))
    }

    /// How many tiles the street of each of some that need so much should become, so that all but the last need about the same: as
    /// few as fit, so that drives of any length use the same part of the budget. `None` when these fit well.
    pub(crate) fn balanced(&self, points: u64, needs: &[TileNeed]) -> Option<Vec<f64>> {
        let (aim, tried) = (self.each() as f64 * (1.0 - SPARE), needs.len() as u64);
        if TileNeed::largest(needs) as f64 <= aim {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of tiles")]
        let fitting = TileNeed::tiles_within(needs, aim).ceil() as u64;
        let tiles = if self.fits(needs) { tried } else { self.even(points, fitting.max(tried)) };
        let limit = TileNeed::limit_for(needs, tiles).max(aim);
        let mut parts: Vec<f64> = needs.iter().map(|need| need.tiles(limit)).collect();
        self.shorten_last(&mut parts, tiles as f64);
        Some(parts)
    }

    /// Cuts the last of these into what is missing to `tiles`: a count that was rounded up for the threads leaves the others as
    /// large as in a longer drive. About two for each thread, so that none is a mere halo.
    fn shorten_last(&self, parts: &mut [f64], tiles: f64) {
        let missing = tiles - parts.iter().sum::<f64>();
        let enough = missing.max(2.0 * self.threads as f64 - missing);
        let (mut first, mut last) = (parts.len(), 0.0);
        while first > 0 && last < enough {
            first -= 1;
            last += parts[first];
        }
        for part in &mut parts[first..] {
            *part *= 1.0 + missing / last;
        }
    }

    /// Whether every thread can have any of the tiles in flight.
    pub(crate) fn fits(&self, needs: &[TileNeed]) -> bool {
        TileNeed::largest(needs) <= self.each()
    }

    /// Bytes for a tile in flight. Half of all at most: where points of objects are many, a tile needs more than was planned.
    fn each(&self) -> u64 {
        self.memory / (self.threads as u64).max(2)
    }

    /// So many tiles or some more: a multiple of the threads, so that no thread waits for the last one, unless they would be
    /// too small.
    fn even(&self, points: u64, tiles: u64) -> u64 {
        let threads = (self.threads as u64).max(1);
        let even = if tiles <= 1 { 1 } else { tiles.div_ceil(threads).saturating_mul(threads) };
        even.min(points / SMALLEST_TILE_POINTS).max(1)
    }
}

/// What a tile needs in the hungriest pass, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TileNeed {
    /// For its core.
    pub(crate) core: u64,
    /// With its halo.
    pub(crate) all: u64,
}

impl TileNeed {
    /// What the largest tile needs.
    pub(crate) fn largest(needs: &[Self]) -> u64 {
        needs.iter().map(|need| need.all).max().unwrap_or(0)
    }

    /// Tiles within `limit` that the street of this one takes: the halo hardly shrinks with the core.
    fn tiles(self, limit: f64) -> f64 {
        let halo = self.all.saturating_sub(self.core) as f64;
        self.core as f64 / (limit - halo).max(limit * LEAST_CORE)
    }

    /// Tiles within `limit` that the same street takes.
    fn tiles_within(needs: &[Self], limit: f64) -> f64 {
        needs.iter().map(|need| need.tiles(limit)).sum()
    }

    /// The least limit within which so many tiles are enough.
    fn limit_for(needs: &[Self], tiles: u64) -> f64 {
        let (mut low, mut high) = (1.0, needs.iter().map(|need| need.core + need.all).sum::<u64>() as f64);
        for _ in 0..64 {
            let middle = f64::midpoint(low, high);
            let enough = Self::tiles_within(needs, middle) <= tiles as f64;
            (low, high) = if enough { (low, middle) } else { (middle, high) };
        }
        high
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_fit_the_budget_and_share_small_drives() {
        let budget = Budget { threads: 2, memory: 400 << 20 };
        // 2,097,152 points fit: 477 tiles, and one more for two threads.
        assert_eq!(budget.tiles(1_000_000_000, 100), 478);
        assert_eq!(budget.tiles(4_000_000, 100), 4);
        assert_eq!(budget.tiles(1_000_000, 100), 2);
        assert_eq!(budget.tiles(10, 100), 1);
        assert_eq!(budget.beside(50 << 20).memory, 300 << 20);
        assert_eq!(budget.beside(900 << 20).memory, 200 << 20);
    }

    #[test]
    fn tiles_are_smaller_where_there_is_more_around_them() {
        let budget = Budget { threads: 2, memory: 400 << 20 };
        let need = |core: u64, all: u64| TileNeed { core: core << 20, all: all << 20 };
        let balanced = |needs: &[TileNeed]| budget.balanced(100_000_000, needs);
        assert_eq!(balanced(&[need(100, 190), need(150, 194)]), None);
        let sum = |parts: Option<Vec<f64>>| parts.map(|parts| parts.iter().sum::<f64>().round());
        // Of 200 MiB (less 3 %) 94 and 44 are left: 1.5 and 3.2 tiles; of two threads, 6.
        assert_eq!(sum(balanced(&[need(140, 240), need(140, 290)])), Some(6.0));
        // Two are enough when the second is shorter: x + 40 = y + 80.
        let parts = balanced(&[need(120, 160), need(121, 201)]).unwrap();
        let lengths = parts.iter().zip([120.0, 121.0]).map(|(part, core)| core / part).collect::<Vec<f64>>();
        assert!(
            (lengths[0] - lengths[1] - 40.0 * f64::from(1 << 20)).abs() < 40.0 * f64::from(1 << 20),
            "{lengths:?}"
        );
        assert!((parts.iter().sum::<f64>() - 2.0).abs() < 1e-6, "{parts:?}");
        // Of 23 that are too large by a tenth, the first stay as large as fits, and the last make up for the even number.
        let many = balanced(&[need(194, 214); 23]).unwrap();
        let full = 194.0 / (194.0 - 20.0);
        assert!(many[..19].iter().all(|part| (part - full).abs() < 0.01), "{many:?}");
        assert!(
            (many.iter().sum::<f64>() - 26.0).abs() < 1e-6 && many[22] > full && many[22] < 2.0 * full,
            "{many:?}"
        );
        // What fits just so is made more equal, but not more.
        let parts = balanced(&[need(100, 160), need(140, 200)]).unwrap();
        assert!((parts.iter().sum::<f64>() - 2.0).abs() < 1e-6 && parts[0] < parts[1], "{parts:?}");
        // Nothing fits beside a halo larger than all there is, and the others are not made as small.
        let parts = balanced(&[need(190, 250), need(190, 1_000)]).unwrap();
        assert!(2.0 * parts[0] < parts[1], "{parts:?}");
    }
}
