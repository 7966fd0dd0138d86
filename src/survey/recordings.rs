//! Which positions of a drive were recorded without a gap in time, for the points of a drive and for a
//! trajectory.

/// Longest gap in time within a recording, in seconds. A longer gap means that the recording stopped, or that
/// a part of the drive was cut out.
pub(super) const GAP_S: f64 = 4.0;
/// Length of a GPS week in seconds.
const WEEK_S: f64 = 604_800.0;

/// The recordings of these rows, which ascend by `time` in seconds: in the order of the drive, with a gap in
/// time after each. `longest` gives the longest gap within a recording from the intervals between the rows.
///
/// Seconds of the GPS week start again from 0 at its end: if there is a gap of more than half a week between
/// two rows, those before it were recorded in the next week.
pub(super) fn recordings<T: Copy>(
    mut rows: Vec<T>,
    time: impl Fn(&T) -> f64,
    longest: impl FnOnce(Vec<f64>) -> f64,
) -> Vec<Vec<T>> {
    let (Some(first), Some(last)) = (rows.first().map(&time), rows.last().map(&time)) else {
        return Vec::new();
    };
    let in_a_week = first >= 0.0 && last <= WEEK_S;
    let wrap = rows.windows(2).position(|pair| time(&pair[1]) - time(&pair[0]) > WEEK_S / 2.0);
    if let Some(wrap) = wrap.filter(|_| in_a_week) {
        rows.rotate_left(wrap + 1);
    }
    let interval = |one: &T, next: &T| {
        let seconds = time(next) - time(one);
        if seconds < 0.0 { seconds + WEEK_S } else { seconds }
    };
    let longest = longest(rows.windows(2).map(|pair| interval(&pair[0], &pair[1])).collect());
    rows.chunk_by(|one, next| interval(one, next) <= longest).map(<[T]>::to_vec).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_end_at_gaps_and_go_on_over_the_end_of_the_week() {
        let of = |times: &[f64]| recordings(times.to_vec(), |time| *time, |_| GAP_S);
        assert_eq!(of(&[]), [[0.0; 0]; 0]);
        assert_eq!(of(&[1.0, 5.0, 9.5]), [vec![1.0, 5.0], vec![9.5]]);
        let [low, high] = [WEEK_S - 1.0, WEEK_S];
        assert_eq!(of(&[1.0, 2.0, low, high]), [[low, high, 1.0, 2.0]]);
        // Counted from another moment, the times are not those of a week.
        assert_eq!(of(&[1.0, 2.0, low, high + 1.0]), [vec![1.0, 2.0], vec![low, high + 1.0]]);
        assert_eq!(of(&[-1.0, 0.0, low]), [vec![-1.0, 0.0], vec![low]]);
    }
}
