//! The axis from GPS time: the mean positions of the points of each half second.

use std::collections::BTreeMap;

use super::axis::{Axis, AxisSource};
use super::recordings::{GAP_S, recordings};
use super::runs::distance;
use crate::model::Lattice;
use crate::survey::{TIME_BIN_S, TimeBin};

/// Number of time bins averaged on each side: two seconds, because the mean of the scanned points fluctuates
/// within this time.
const SMOOTHING_BINS: usize = 4;
/// Number of time bins at each end of the data that may be incomplete: four seconds. If the data is a box cut
/// out of a drive, its first and last profiles were measured from outside the box and cover one side of the
/// road only. The mean of their points moves to this side, by up to 16 m on such a scene.
const INCOMPLETE_BINS: usize = 8;
/// Number of points below which such a bin is incomplete, as a share of the median.
const INCOMPLETE_SHARE: f64 = 0.5;
/// Length of the shortest track in metres. A shorter one means that the scanner did not move.
const SHORTEST_TRACK_M: f64 = 10.0;

impl Axis {
    /// The axis along the smoothed mean positions of the time bins; `None` if the scanner did not move or had
    /// no clock.
    #[must_use]
    pub fn from_time_bins(bins: &BTreeMap<i64, TimeBin>, lattice: Lattice) -> Option<Self> {
        let mut counts: Vec<u64> = bins.values().map(|bin| bin.count).collect();
        counts.sort_unstable();
        let least = counts.get(counts.len() / 2).map_or(0.0, |median| INCOMPLETE_SHARE * *median as f64);
        let bins = bins.iter().map(|(number, bin)| (*number, bin));
        let bins: Vec<(i64, &TimeBin)> = bins.filter(|(_, bin)| bin.is_of_one_place(lattice)).collect();
        let runs = recordings(bins, |(number, _)| *number as f64 * TIME_BIN_S, |_| GAP_S);
        // A recording of less than one usual bin is a single point with a wrong time, or hardly more.
        let points = |run: &[(i64, &TimeBin)]| run.iter().map(|(_, bin)| bin.count).sum::<u64>() as f64;
        let runs = runs.iter().filter(|run| points(run) >= least);
        let runs: Vec<Vec<[f64; 2]>> = runs.map(|run| path(run, least, lattice)).collect();
        let length: f64 =
            runs.iter().flat_map(|run| run.windows(2)).map(|pair| distance(pair[0], pair[1])).sum();
        if length < SHORTEST_TRACK_M { None } else { Self::from_runs(AxisSource::GpsTime, runs) }
    }
}

/// The smoothed mean positions of time bins without a gap. Bins with fewer than `least` points at the ends
/// are left out; the path is extended straight to the mean positions of these bins.
fn path(run: &[(i64, &TimeBin)], least: f64, lattice: Lattice) -> Vec<[f64; 2]> {
    #[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
    let mean = |sum: i128, count: u64| lattice.metres((sum / i128::from(count.max(1))) as i64);
    let place = |bin: &TimeBin| [mean(bin.sum_x, bin.count), mean(bin.sum_y, bin.count)];
    let all: Vec<[f64; 2]> = run.iter().map(|(_, bin)| place(bin)).collect();
    let is_whole = |(_, bin): &&(i64, &TimeBin)| bin.count as f64 >= least;
    let most = INCOMPLETE_BINS.min(run.len() / 4);
    let first = run.iter().take(most).take_while(|bin| !is_whole(bin)).count();
    let last = run.iter().rev().take(most).take_while(|bin| !is_whole(bin)).count();
    let (before, rest) = all.split_at(first);
    let (whole, after) = rest.split_at(rest.len() - last);
    let mut path: Vec<[f64; 2]> = (0..whole.len())
        .map(|k| {
            let reach = SMOOTHING_BINS.min(k).min(whole.len() - 1 - k);
            let window = &whole[k - reach..=k + reach];
            let share = 1.0 / window.len() as f64;
            [0, 1].map(|axis| window.iter().map(|place| place[axis]).sum::<f64>() * share)
        })
        .collect();
    let beyond_start = straight_on(path.iter(), before);
    let beyond_end = straight_on(path.iter().rev(), after);
    path.splice(0..0, beyond_start);
    path.extend(beyond_end);
    path
}

/// The end of the straight extension before the first vertex of a path, as far as `places` extend. `None` if
/// they do not extend beyond the path.
fn straight_on<'a>(path: impl Iterator<Item = &'a [f64; 2]>, places: &[[f64; 2]]) -> Option<[f64; 2]> {
    let path: Vec<[f64; 2]> = path.take(INCOMPLETE_BINS + 1).copied().collect();
    let (end, inner) = (*path.first()?, *path.last()?);
    let length = distance(inner, end);
    let along = |place: &[f64; 2]| {
        ((place[0] - end[0]) * (end[0] - inner[0]) + (place[1] - end[1]) * (end[1] - inner[1])) / length
    };
    let farthest = places.iter().map(along).fold(0.0, f64::max);
    let on = |axis: usize| end[axis] + farthest * (end[axis] - inner[axis]) / length;
    (farthest > 0.0).then(|| [on(0), on(1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The drive goes east at 5 m per bin. In its first and last three bins, most points are missing, and the
    /// remaining ones are beside the road.
    #[test]
    fn the_axis_goes_straight_on_where_a_drive_was_cut_off() {
        let bin = |x: i128, y: i128, count: u64| TimeBin {
            count,
            sum_x: x * i128::from(count) * 1_000,
            sum_y: y * i128::from(count) * 1_000,
            ..TimeBin::default()
        };
        let bins: BTreeMap<i64, TimeBin> = (0..40_i64)
            .map(|k| {
                let x = i128::from(k) * 5;
                let cut = match k {
                    0..3 => bin(x, -12, 40),
                    37.. => bin(x, 9, 300),
                    _ => bin(x, 0, 1_000),
                };
                (k, cut)
            })
            .collect();
        let axis = Axis::from_time_bins(&bins, Lattice::MILLIMETRE).unwrap();
        let beside = axis.vertices().iter().map(|vertex| vertex[1].abs()).fold(0.0, f64::max);
        assert!(beside < 1e-6, "{beside} m");
        assert!((axis.length_m() - 195.0).abs() < 0.01, "{}", axis.length_m());
        assert!(axis.vertices()[0][0].abs() < 1e-6);
        // The same applies at a part that was cut out of the middle.
        let cut_out = bins.into_iter().map(|(k, bin)| (if k < 20 { k } else { k + 100 }, bin));
        assert!(Axis::from_time_bins(&cut_out.collect(), Lattice::MILLIMETRE).is_some());
    }

    /// A bin of 1,000 points at a place in metres.
    fn bin([x, y]: [f64; 2]) -> TimeBin {
        let sum = |value: f64| i128::from(Lattice::MILLIMETRE.units(value)) * 1_000;
        TimeBin { count: 1_000, sum_x: sum(x), sum_y: sum(y), ..TimeBin::default() }
    }

    /// East along y = 0 in the first part, and on another street in the second, which the recording reaches
    /// after a gap of 22 s.
    #[test]
    fn no_road_is_made_up_where_the_recording_stopped() {
        let bins = (0..40_i32).map(|k| (i64::from(k), bin([5.0 * f64::from(k), 0.0])));
        let later = (0..40_i32).map(|k| (i64::from(k) + 84, bin([5.0 * f64::from(k), 200.0])));
        let axis = Axis::from_time_bins(&bins.chain(later).collect(), Lattice::MILLIMETRE).unwrap();
        assert_eq!(axis.stretches().count(), 2);
        assert!(axis.vertices().iter().all(|[_, y]| y.abs().min((y - 200.0).abs()) < 1e-9));
        let (chainage, offset) = axis.locate([100.0, 203.0]);
        // 195 m, the straight way to the second street, and 100 m along it.
        assert!((chainage - (195.0 + 195_f64.hypot(200.0) + 100.0)).abs() < 0.1, "{chainage}");
        assert!((offset - 3.0).abs() < 1e-6, "{offset}");
        assert!(axis.chainage_m().is_sorted());
    }

    /// The east half was recorded before the west half, both driven to the east.
    #[test]
    fn a_street_in_two_parts_keeps_its_direction() {
        let east = (0..20_i32).map(|k| (i64::from(k), bin([100.0 + 5.0 * f64::from(k), 0.0])));
        let west = (0..20_i32).map(|k| (i64::from(k) + 8_000, bin([5.0 * f64::from(k), 0.0])));
        let axis = Axis::from_time_bins(&east.chain(west).collect(), Lattice::MILLIMETRE).unwrap();
        for x in [20.0, 50.0, 130.0] {
            assert!((axis.locate([x, 4.0]).1 - 4.0).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn a_drive_goes_on_over_the_end_of_the_gps_week() {
        let plain: BTreeMap<i64, TimeBin> =
            (0..60_i32).map(|k| (i64::from(k) + 100, bin([5.0 * f64::from(k), 0.0]))).collect();
        let wrapped: BTreeMap<i64, TimeBin> = plain
            .iter()
            .map(|(number, bin)| ((number - 130).rem_euclid(2 * 7 * 24 * 3_600), TimeBin { ..*bin }))
            .collect();
        let [plain, wrapped] =
            [plain, wrapped].map(|bins| Axis::from_time_bins(&bins, Lattice::MILLIMETRE).unwrap());
        assert_eq!(plain.vertices(), wrapped.vertices());
        assert_eq!(plain.chainage_m(), wrapped.chainage_m());
    }

    /// A point at the origin of the coordinate system, at a time of the drive or at time 0.
    #[test]
    fn single_points_far_away_do_not_move_the_axis() {
        let place = |k: i64| [600_000.0 + 5.0 * k as f64, 5_400_000.0];
        let drive = || (0..60_i64).map(|k| (1_000 + k, scanned(place(k), 60.0)));
        let plain = Axis::from_time_bins(&drive().collect(), Lattice::MILLIMETRE).unwrap();
        for at in [1_030, 0] {
            let mut bins: BTreeMap<i64, TimeBin> = drive().collect();
            let bin = bins.entry(at).or_default();
            *bin = TimeBin {
                count: bin.count + 1,
                lo: [0; 2],
                hi: [bin.hi[0].max(0), bin.hi[1].max(0)],
                ..*bin
            };
            let axis = Axis::from_time_bins(&bins, Lattice::MILLIMETRE).unwrap();
            assert_eq!(axis.stretches().count(), 1, "{at}");
            assert!((axis.length_m() - plain.length_m()).abs() < 1e-6, "{at}: {}", axis.length_m());
            let beside =
                axis.vertices().iter().map(|vertex| (vertex[1] - 5_400_000.0).abs()).fold(0.0, f64::max);
            assert!(beside < 1e-6, "{at}: {beside} m");
        }
        // Another street, however far away, is one if it has as many points.
        let far = (0..60_i64).map(|k| (9_000 + k, scanned([5.0 * k as f64, 0.0], 60.0)));
        let axis = Axis::from_time_bins(&drive().chain(far).collect(), Lattice::MILLIMETRE).unwrap();
        assert_eq!(axis.stretches().count(), 2);
    }

    /// A bin of 1,000 points within some metres around a place.
    fn scanned(place: [f64; 2], around_m: f64) -> TimeBin {
        let corner = |away: f64| place.map(|value| Lattice::MILLIMETRE.units(value + away));
        TimeBin { lo: corner(-around_m), hi: corner(around_m), ..bin(place) }
    }
}
