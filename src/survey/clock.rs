//! Whether GPS times can be seconds. Some programs write milliseconds or microseconds, and an axis along such
//! bins of time would follow single profiles of the scanner.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use super::part::{BINS_MAX, Survey, TIME_BIN_S, TimeBin};
use crate::model::Lattice;

/// Bins of a block whose mean position is compared with that of the next one: 1,024 s. If these are
/// milliseconds, it is a second, in which any scanner turns several times, so that the mean is that of all
/// directions.
const BLOCK_BINS: usize = 2_048;
/// Chosen: walking in milliseconds is 0.0014 m/s, and driving at 130 km/h is 0.036 m/s. The vehicle of a
/// drive in seconds waits in traffic, but not for hours.
const SLOWEST_M_S: f64 = 0.05;
/// Chosen: scanners measure 10 thousand to 4 million points per second. In milliseconds that is 10 to 4,000,
/// and a bin has half as many. This number distinguishes a scanner that stands still.
const BIN_POINTS: f64 = 5_000.0;

/// Why the times cannot be seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClockDoubt {
    /// The times are in more bins than any drive takes.
    Scattered,
    /// The scanner would hardly move and hardly measure.
    Slow {
        /// Speed in metres per second.
        speed_m_s: f64,
        /// Points per second.
        points_s: f64,
        /// Time with points in seconds.
        seconds: f64,
    },
}

impl ClockDoubt {
    /// The doubt about the times of a survey; `None` if they may be seconds.
    #[must_use]
    pub fn of(survey: &Survey, lattice: Lattice) -> Option<Self> {
        if survey.has_scattered_times() { Some(Self::Scattered) } else { slow(&survey.time_bins, lattice) }
    }
}

impl Display for ClockDoubt {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scattered => write!(
                f,
                "GPS times are in more than {BINS_MAX} different half seconds: they are probably not in seconds, but in \
                 milliseconds or microseconds"
            ),
            Self::Slow { speed_m_s, points_s, seconds } => write!(
                f,
                "by its GPS times, the scanner moved {speed_m_s:.4} m/s for {seconds:.0} s and measured {points_s:.0} \
                 points per second: they are probably not in seconds, but in milliseconds"
            ),
        }
    }
}

fn slow(bins: &BTreeMap<i64, TimeBin>, lattice: Lattice) -> Option<ClockDoubt> {
    let bins: Vec<&TimeBin> = bins.values().filter(|bin| bin.is_of_one_place(lattice)).collect();
    let blocks: Vec<[f64; 2]> =
        bins.chunks_exact(BLOCK_BINS).map(|block| mean_place(block, lattice)).collect();
    if blocks.len() < 2 {
        return None;
    }
    let length_m: f64 =
        blocks.windows(2).map(|pair| (pair[0][0] - pair[1][0]).hypot(pair[0][1] - pair[1][1])).sum();
    let speed_m_s = length_m / ((blocks.len() - 1) * BLOCK_BINS) as f64 / TIME_BIN_S;
    let points: u64 = bins.iter().map(|bin| bin.count).sum();
    let per_bin = points as f64 / bins.len() as f64;
    let seconds = bins.len() as f64 * TIME_BIN_S;
    (speed_m_s < SLOWEST_M_S && per_bin < BIN_POINTS).then_some(ClockDoubt::Slow {
        speed_m_s,
        points_s: per_bin / TIME_BIN_S,
        seconds,
    })
}

/// The mean place of all points of some bins, in metres. Their sums are integers, so it is exact.
fn mean_place(block: &[&TimeBin], lattice: Lattice) -> [f64; 2] {
    let count: i128 = block.iter().map(|bin| i128::from(bin.count)).sum();
    let sums = [block.iter().map(|bin| bin.sum_x).sum::<i128>(), block.iter().map(|bin| bin.sum_y).sum()];
    #[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
    let metres = |sum: i128| lattice.metres((sum / count.max(1)) as i64);
    sums.map(metres)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bins of `points` points, whose place moves `step_mm` from bin to bin and is up to 20 m beside it.
    fn drive(bins: i64, points: u64, step_mm: i64) -> BTreeMap<i64, TimeBin> {
        (0..bins)
            .map(|k| {
                let count = i128::from(points);
                let beside = i128::from(k * 7_919 % 40_000 - 20_000);
                let (sum_x, sum_y) = (i128::from(k * step_mm) * count, beside * count);
                (k, TimeBin { count: points, sum_x, sum_y, ..TimeBin::default() })
            })
            .collect()
    }

    #[test]
    fn milliseconds_are_told_from_slow_drives() {
        let doubt = |bins, points, step_mm| slow(&drive(bins, points, step_mm), Lattice::MILLIMETRE);
        // 8 m/s and 100,000 points per second, in milliseconds.
        let found = doubt(125_000, 50, 4).expect("not seconds");
        let ClockDoubt::Slow { speed_m_s, points_s, seconds } = found else { panic!("{found:?}") };
        assert!((speed_m_s - 0.008).abs() < 0.001, "{speed_m_s}");
        assert_eq!((points_s, seconds), (100.0, 62_500.0));
        for (bins, points, step_mm, what) in [
            (125_000, 50_000, 4, "a scanner that stands still"),
            (125_000, 50, 500, "a walk with few points"),
            (4_000, 50, 4, "half an hour of waiting"),
        ] {
            assert_eq!(doubt(bins, points, step_mm), None, "{what}");
        }
    }
}
