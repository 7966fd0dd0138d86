//! How many threads, how much memory, and how long tiles may be for it.

use crate::config::RunConfig;

/// Points of a tile at most: beyond this, larger tiles save hardly any halo and only delay balance and resuming.
const LARGEST_TILE_POINTS: u64 = 8_000_000;
/// Points of a tile at least, however little memory there is: below this a tile is mostly halo.
const SMALLEST_TILE_POINTS: u64 = 20_000;
/// A small drive is cut so that workers share it, but not into tiles smaller than this.
const SHARED_TILE_POINTS: u64 = 400_000;
/// What a byte that is held beside tiles counts for in the budget, which is shared out by what tiles are estimated to need:
/// on streets they take 0.55 of that (tiles of `synth mixed`: 39 MiB of 70), because the estimate covers forests.
const HELD_WEIGHT: u64 = 2;
/// Memory assumed where the system does not say what is free.
const UNKNOWN_FREE_BYTES: u64 = 4 << 30;

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

    /// What is left of the budget beside `held` bytes that grow with the drive, so that the whole does not; half of it at
    /// least, since without tiles in flight nothing gets done.
    pub(crate) fn beside(self, held: u64) -> Self {
        let weight = held.saturating_mul(HELD_WEIGHT);
        Self { memory: self.memory.saturating_sub(weight).max(self.memory / 2), ..self }
    }

    /// Core points per tile to try first for a drive of `points`, when a point in flight takes `bytes_per_point`.
    pub(crate) fn tile_points(&self, points: u64, bytes_per_point: u64) -> u64 {
        let threads = (self.threads as u64).max(1);
        let fitting = self.memory / (threads * bytes_per_point).max(1);
        let most = fitting.clamp(SMALLEST_TILE_POINTS, LARGEST_TILE_POINTS);
        let shared = (points / SHARED_TILE_POINTS).min(2 * threads);
        let tiles = points.div_ceil(most).max(shared);
        if tiles <= 1 {
            return most;
        }
        // Tiles are about equal, so that with a multiple of the threads no thread waits for the last one.
        points.div_ceil(tiles.next_multiple_of(threads)).max(SMALLEST_TILE_POINTS)
    }

    /// Core points per tile to try for a drive of `points` after tiles of `tried` points needed `needed` bytes each at most;
    /// `None` when they fit. As few more tiles as may do, so that drives of any length use the same part of the budget; after
    /// some attempts `in_a_hurry`, because the halo does not shrink with the core.
    pub(crate) fn smaller(&self, points: u64, tried: u64, needed: u64, in_a_hurry: bool) -> Option<u64> {
        let each = self.memory / self.threads as u64;
        if needed <= each || tried <= SMALLEST_TILE_POINTS {
            return None;
        }
        let tiles = points.div_ceil(tried);
        let ratio = needed as f64 / each.max(1) as f64;
        let ratio = if in_a_hurry { (ratio / 0.9).max(1.25) } else { ratio };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a multiple of a count of tiles"
        )]
        let fitting = (tiles as f64 * ratio) as u64;
        // Steps of a percent at least: a plan of many tiles takes a while.
        let more = fitting.max(tiles + 1 + tiles / 100);
        Some(points.div_ceil(more).max(SMALLEST_TILE_POINTS))
    }
}

/// Bytes of memory that are free, as the system sees it.
fn free_bytes() -> u64 {
    status_kib("/proc/meminfo", "MemAvailable:").map_or(UNKNOWN_FREE_BYTES, |kib| kib << 10)
}

/// Peak resident set of this process in bytes, mapped pages included; `None` where the system does not say.
pub(crate) fn peak_resident_bytes() -> Option<u64> {
    status_kib("/proc/self/status", "VmHWM:").map(|kib| kib << 10)
}

fn status_kib(path: &str, field: &str) -> Option<u64> {
    let text = fs_err::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(field))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_fit_the_budget_and_share_small_drives() {
        let budget = Budget { threads: 2, memory: 400 << 20 };
        // 2,097,152 points fit: 477 tiles, and one more for two threads.
        assert_eq!(budget.tile_points(1_000_000_000, 100), 1_000_000_000_u64.div_ceil(478));
        assert_eq!(budget.tile_points(4_000_000, 100), 1_000_000);
        assert_eq!(budget.tile_points(1_000_000, 100), 500_000);
        assert_eq!(budget.tile_points(10, 100), 2_097_152);
        assert_eq!(budget.beside(50 << 20).memory, 300 << 20);
        assert_eq!(budget.beside(900 << 20).memory, 200 << 20);
        // 200 MiB each; ten tiles were tried: two more, one more, and in a hurry four more.
        let points = 10_000_000_u64;
        assert_eq!(budget.smaller(points, 1_000_000, 200 << 20, false), None);
        assert_eq!(budget.smaller(points, 1_000_000, 259 << 20, false), Some(points.div_ceil(12)));
        assert_eq!(budget.smaller(points, 1_000_000, 201 << 20, false), Some(points.div_ceil(11)));
        assert_eq!(budget.smaller(points, 1_000_000, 259 << 20, true), Some(points.div_ceil(14)));
        assert_eq!(budget.smaller(points, SMALLEST_TILE_POINTS, 201 << 20, true), None);
    }
}
