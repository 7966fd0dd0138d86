//! The number of threads, the amount of memory, and the resulting length of tiles.

use crate::config::RunConfig;
use crate::run::engine::{Limits, free_bytes};

/// Maximum number of points of a tile. Larger tiles save hardly any halo, and make balance and resuming
/// worse.
const LARGEST_TILE_POINTS: u64 = 8_000_000;
/// Minimum number of points of a tile, however little memory there is. A smaller tile is mostly halo.
const SMALLEST_TILE_POINTS: u64 = 20_000;
/// A small drive is divided between the workers, but not into tiles smaller than this.
const SHARED_TILE_POINTS: u64 = 400_000;
/// Weight of a byte of data of the whole drive in the budget. With this weight, the peak of memory is the
/// same for a drive of any length. The weight is more than one for three reasons. Tiles on streets use four
/// fifths of their estimated memory. The allocator takes about a tenth more than the counted bytes. The
/// largest of many pairs of tiles is larger than the largest of few. Chosen by `scripts/lengths.sh`.
const HELD_WEIGHT: u64 = 2;
/// Minimum share of a limit that is left for a core, however large its halo is (chosen: with less, most
/// points are read several times, which is no faster than tiles that wait for each other).
const LEAST_CORE: f64 = 0.25;
/// Share of the budget that is kept free when tiles are balanced, because the size of a halo changes with the
/// core.
const SPARE: f64 = 0.03;

/// Threads and memory of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// Worker threads.
    pub(crate) threads: usize,
    /// Bytes for the points in flight.
    pub(crate) memory: u64,
    /// Bytes of the whole budget, as the user knows it.
    pub(crate) asked: u64,
    /// Whether the user set no memory budget, so that it is half of the free memory.
    pub(crate) automatic: bool,
}

impl Budget {
    /// The budget according to the settings.
    pub(crate) fn resolve(config: &RunConfig) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = if config.threads == 0 { cores } else { config.threads };
        let automatic = config.memory_mib == 0;
        let memory = if automatic { free_bytes() / 2 } else { config.memory_mib << 20 };
        Self { threads, memory, asked: memory, automatic }
    }

    /// The budget as limits for units in flight.
    pub(crate) fn limits(self) -> Limits {
        Limits { threads: self.threads, memory: self.memory }
    }

    /// The remaining budget. `held` is the number of bytes for data of the whole drive, which grows with the
    /// drive. At least half of the budget remains, because every tile in flight needs memory.
    pub(crate) fn beside(self, held: u64) -> Self {
        let weight = held.saturating_mul(HELD_WEIGHT);
        Self { memory: self.memory.saturating_sub(weight).max(self.memory / 2), ..self }
    }

    /// Number of tiles for the first attempt, for a drive of `points` points, if a point in flight takes
    /// `bytes_per_point`.
    pub(crate) fn tiles(&self, points: u64, bytes_per_point: u64) -> u64 {
        let most = (self.each() / bytes_per_point.max(1)).clamp(SMALLEST_TILE_POINTS, LARGEST_TILE_POINTS);
        let shared = (points / SHARED_TILE_POINTS).min(2 * self.threads as u64);
        self.even(points, points.div_ceil(most).max(shared))
    }

    /// Into how many tiles to cut each of these tiles, so that all except the last need about the same
    /// memory. The total number is the smallest that fits, so that drives of any length use the same share of
    /// the budget. `None` if the tiles already fit.
    pub(crate) fn balanced(&self, points: u64, needs: &[TileNeed]) -> Option<Vec<f64>> {
        let aim = self.each() as f64 * (1.0 - SPARE);
        let tried = needs.len() as u64;
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

    /// Cuts the last parts further, so that the total is `tiles`. The total was rounded up to a multiple of
    /// the threads, and this way the other tiles stay as large as in a longer drive. About two tiles per
    /// thread are cut, so that none becomes a mere halo.
    fn shorten_last(&self, parts: &mut [f64], tiles: f64) {
        let missing = tiles - parts.iter().sum::<f64>();
        let enough = missing.max(2.0 * self.threads as f64 - missing);
        let mut first = parts.len();
        let mut last = 0.0;
        while first > 0 && last < enough {
            first -= 1;
            last += parts[first];
        }
        for part in &mut parts[first..] {
            *part *= 1.0 + missing / last;
        }
    }

    /// Whether every thread can process any of the tiles at the same time.
    pub(crate) fn fits(&self, needs: &[TileNeed]) -> bool {
        TileNeed::largest(needs) <= self.each()
    }

    /// Whether a plan whose largest tile needs `largest` bytes stays as it is. Results of other processes and
    /// of earlier calls belong to the plan. So a plan made with more free memory stays as long as its largest
    /// tile fits the memory that is free here.
    pub(crate) fn keeps(&self, largest: u64) -> bool {
        largest <= self.memory.saturating_mul(if self.automatic { 2 } else { 1 })
    }

    /// Bytes for one tile in flight. They are at most half of the budget, because a tile with many points of
    /// objects needs more than planned.
    fn each(&self) -> u64 {
        self.memory / (self.threads as u64).max(2)
    }

    /// At least `tiles` tiles, rounded up to a multiple of the threads, so that no thread waits for the last
    /// tile. Fewer if the tiles would be too small.
    fn even(&self, points: u64, tiles: u64) -> u64 {
        let threads = (self.threads as u64).max(1);
        let even = if tiles <= 1 { 1 } else { tiles.div_ceil(threads).saturating_mul(threads) };
        even.min(points / SMALLEST_TILE_POINTS).max(1)
    }
}

/// Memory of a tile in the pass that needs most, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TileNeed {
    /// Of its core.
    pub(crate) core: u64,
    /// Of its core and halo.
    pub(crate) all: u64,
}

impl TileNeed {
    /// Memory of the largest tile.
    pub(crate) fn largest(needs: &[Self]) -> u64 {
        needs.iter().map(|need| need.all).max().unwrap_or(0)
    }

    /// Number of tiles within `limit` into which this tile must be cut. The halo hardly shrinks with the
    /// core.
    fn tiles(self, limit: f64) -> f64 {
        let halo = self.all.saturating_sub(self.core) as f64;
        self.core as f64 / (limit - halo).max(limit * LEAST_CORE)
    }

    /// Number of tiles within `limit` into which all of these must be cut.
    fn tiles_within(needs: &[Self], limit: f64) -> f64 {
        needs.iter().map(|need| need.tiles(limit)).sum()
    }

    /// The smallest limit for which `tiles` tiles are enough.
    fn limit_for(needs: &[Self], tiles: u64) -> f64 {
        let mut low = 1.0;
        let mut high = needs.iter().map(|need| need.core + need.all).sum::<u64>() as f64;
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
        let budget = Budget { threads: 2, memory: 400 << 20, asked: 400 << 20, automatic: false };
        // 2,097,152 points fit: 477 tiles, and one more for two threads.
        assert_eq!(budget.tiles(1_000_000_000, 100), 478);
        assert_eq!(budget.tiles(4_000_000, 100), 4);
        assert_eq!(budget.tiles(1_000_000, 100), 2);
        assert_eq!(budget.tiles(10, 100), 1);
        assert_eq!(budget.beside(50 << 20).memory, 300 << 20);
        assert_eq!(budget.beside(900 << 20).memory, 200 << 20);
    }

    #[test]
    fn a_plan_stays_while_its_tiles_fit_what_was_asked_for_or_what_is_free() {
        let asked = Budget { threads: 2, memory: 400 << 20, asked: 400 << 20, automatic: false };
        assert!(asked.keeps(400 << 20) && !asked.keeps(401 << 20));
        let automatic = Budget { automatic: true, ..asked };
        assert!(automatic.keeps(800 << 20) && !automatic.keeps(801 << 20));
    }

    #[test]
    fn tiles_are_smaller_where_there_is_more_around_them() {
        let budget = Budget { threads: 2, memory: 400 << 20, asked: 400 << 20, automatic: false };
        let need = |core: u64, all: u64| TileNeed { core: core << 20, all: all << 20 };
        let balanced = |needs: &[TileNeed]| budget.balanced(100_000_000, needs);
        assert_eq!(balanced(&[need(100, 190), need(150, 194)]), None);
        let sum = |parts: Option<Vec<f64>>| parts.map(|parts| parts.iter().sum::<f64>().round());
        // Of 200 MiB less 3 %, the halos leave 94 and 44 for cores: 1.5 and 3.2 tiles. For two threads this
        // gives 6.
        assert_eq!(sum(balanced(&[need(140, 240), need(140, 290)])), Some(6.0));
        // Two are enough when the second is shorter: x + 40 = y + 80.
        let parts = balanced(&[need(120, 160), need(121, 201)]).unwrap();
        let lengths = parts.iter().zip([120.0, 121.0]).map(|(part, core)| core / part).collect::<Vec<f64>>();
        assert!(
            (lengths[0] - lengths[1] - 40.0 * f64::from(1 << 20)).abs() < 40.0 * f64::from(1 << 20),
            "{lengths:?}"
        );
        assert!((parts.iter().sum::<f64>() - 2.0).abs() < 1e-6, "{parts:?}");
        // Of 23 tiles that are too large by a tenth, the first become as large as the limit, and the last
        // become shorter to give an even number.
        let many = balanced(&[need(194, 214); 23]).unwrap();
        let full = 194.0 / (194.0 - 20.0);
        assert!(many[..19].iter().all(|part| (part - full).abs() < 0.01), "{many:?}");
        assert!(
            (many.iter().sum::<f64>() - 26.0).abs() < 1e-6 && many[22] > full && many[22] < 2.0 * full,
            "{many:?}"
        );
        // Tiles that just fit are balanced, but not made more numerous.
        let parts = balanced(&[need(100, 160), need(140, 200)]).unwrap();
        assert!((parts.iter().sum::<f64>() - 2.0).abs() < 1e-6 && parts[0] < parts[1], "{parts:?}");
        // A tile whose halo exceeds the whole limit never fits, and the others are not made as small as it.
        let parts = balanced(&[need(190, 250), need(190, 1_000)]).unwrap();
        assert!(2.0 * parts[0] < parts[1], "{parts:?}");
    }
}
