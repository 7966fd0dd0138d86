//! When the recording of a drive begins and ends, and the gaps in it: the first and last profiles see only a
//! part of what they meet.

use std::collections::BTreeMap;

use super::part::TimeBin;
use crate::model::Lattice;

/// Time before an end of the recording in which every scanner head sees all around it, in seconds. Survey
/// scanners measure 50 to 250 profiles per second.
const PROFILE_S: f64 = 0.02;
/// Shortest recording between two gaps that has ends, in seconds (chosen: a single sweep of a spinning head
/// is shorter, and is not cut at its first and last point).
const SHORTEST_S: f64 = 1.0;
/// Shortest time without points that is a gap, in seconds, and the shortest distance of the places before and
/// after it, in metres (chosen: a scanner that pauses while the vehicle waits misses nothing).
const GAP: (f64, f64) = (1.0, 5.0);

/// A short time at the beginning or at the end of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Its first and last GPS time in seconds.
    pub seconds: [f64; 2],
    /// Mean place of the points around it in metres.
    pub place: [f64; 2],
}

impl Moment {
    /// Whether a time is in it.
    #[inline]
    #[must_use]
    pub fn contains(&self, time: f64) -> bool {
        self.seconds[0] <= time && time <= self.seconds[1]
    }

    /// Whether any time between `first` and `last` may be in it.
    #[must_use]
    pub fn meets(&self, (first, last): (f64, f64)) -> bool {
        first <= self.seconds[1] && self.seconds[0] <= last
    }

    /// The moments of a drive in ascending time.
    #[must_use]
    pub fn of(bins: &BTreeMap<i64, TimeBin>, lattice: Lattice) -> Vec<Self> {
        let bins: Vec<(&TimeBin, [f64; 2])> = bins.values().map(|bin| (bin, place(bin, lattice))).collect();
        let goes_on = |one: &(&TimeBin, [f64; 2]), next: &(&TimeBin, [f64; 2])| {
            let apart_m = (next.1[0] - one.1[0]).hypot(next.1[1] - one.1[1]);
            next.0.first - one.0.last < GAP.0 || apart_m < GAP.1
        };
        let mut moments = Vec::new();
        for recording in bins.chunk_by(goes_on) {
            let (begin, end) = (recording[0], recording[recording.len() - 1]);
            if end.0.last - begin.0.first >= SHORTEST_S {
                let (first, last) = (begin.0.first, end.0.last);
                moments.push(Self { seconds: [first, first + PROFILE_S], place: begin.1 });
                moments.push(Self { seconds: [last - PROFILE_S, last], place: end.1 });
            }
        }
        moments
    }
}

/// Mean place of the points of a bin in metres.
fn place(bin: &TimeBin, lattice: Lattice) -> [f64; 2] {
    [bin.sum_x, bin.sum_y].map(|sum| sum as f64 / bin.count.max(1) as f64 * lattice.step_m())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::TIME_BIN_S;

    /// A bin of 100 points at a place on the x axis.
    fn bin(number: i64, x_m: i64) -> (i64, TimeBin) {
        let first = number as f64 * TIME_BIN_S;
        let sum_x = i128::from(x_m) * 1_000 * 100;
        (number, TimeBin { count: 100, sum_x, first, last: first + 0.4, ..TimeBin::default() })
    }

    fn found(bins: impl Iterator<Item = (i64, TimeBin)>) -> Vec<f64> {
        let moments = Moment::of(&bins.collect(), Lattice::MILLIMETRE);
        moments.iter().map(|moment| (moment.seconds[0] * 100.0).round() / 100.0).collect()
    }

    #[test]
    fn a_drive_has_two_moments_and_two_more_at_a_gap_where_the_vehicle_went_on() {
        let whole = (0..20).map(|n| bin(n, 5 * n));
        assert_eq!(found(whole.clone()), [0.0, 9.88]);
        let without = |gap: std::ops::Range<i64>| whole.clone().filter(move |(n, _)| !gap.contains(n));
        assert_eq!(found(without(8..11)), [0.0, 3.88, 5.5, 9.88]);
        assert_eq!(found(without(8..9)), [0.0, 9.88], "too short");
        // Bins 8 to 10 are missing while the vehicle stands.
        let waits =
            (0..20).filter(|n| !(8..11).contains(n)).map(|n| bin(n, if n < 8 { 5 * n } else { 5 * n - 20 }));
        assert_eq!(found(waits), [0.0, 9.88]);
        assert!(found((0..1).map(|n| bin(n, 0))).is_empty(), "a single sweep");
        assert!(found(std::iter::empty()).is_empty());
    }

    #[test]
    fn a_moment_begins_and_ends_with_its_times() {
        let moment = Moment { seconds: [3.0, 3.02], place: [0.0; 2] };
        assert_eq!([2.99, 3.0, 3.02, 3.03].map(|time| moment.contains(time)), [false, true, true, false]);
        assert!(!moment.contains(f64::NAN));
        assert!(moment.meets((1.0, 3.0)) && moment.meets((3.02, 9.0)) && !moment.meets((3.1, 9.0)));
    }
}
