//! Which runs of a recording follow each other without a gap in the road. A recording stops at a depot or
//! between two files, and continues elsewhere: a straight line from one place to the other would lead through
//! houses.

/// Largest distance between two stretches of the same street, in metres.
pub(super) const CORRIDOR_M: f64 = 12.0;
/// Longest gap in the road that is closed by a straight line, in metres (chosen: a few seconds at the speed
/// of a survey).
const LONGEST_GAP_M: f64 = 100.0;
/// Smallest cosine of the angle between the road and the line over a gap: 20 degrees (chosen: a street goes
/// straight on, or nothing is known of it).
const STRAIGHT: f64 = 0.94;
/// Length of the end of a run that gives its direction, in metres.
const DIRECTION_M: f64 = 10.0;

/// Positions of a drive in metres, in order.
type Track = Vec<[f64; 2]>;

/// The tracks of these runs. Runs are one track if the gap between them is narrower than a street, or if the
/// road goes straight on over it.
pub(super) fn tracks(runs: Vec<Track>) -> Vec<Track> {
    let mut tracks: Vec<Track> = Vec::new();
    for run in runs.into_iter().filter(|run| !run.is_empty()) {
        match tracks.last_mut() {
            Some(track) if goes_on(track, &run) => track.extend(run),
            _ => tracks.push(run),
        }
    }
    tracks
}

/// Whether the road continues from the end of one track, which has a position, to the start of the next.
fn goes_on(before: &[[f64; 2]], after: &[[f64; 2]]) -> bool {
    let (from, to) = (before[before.len() - 1], after[0]);
    let gap = distance(from, to);
    let over = direction(from, to);
    let leads =
        |road: Option<[f64; 2]>| road.is_some_and(|road| road[0] * over[0] + road[1] * over[1] >= STRAIGHT);
    gap <= CORRIDOR_M || (gap <= LONGEST_GAP_M && leads(end(before.iter().rev())) && leads(start(after)))
}

/// Direction of the road at the last of these positions, which come in reverse order.
fn end<'a>(mut places: impl Iterator<Item = &'a [f64; 2]>) -> Option<[f64; 2]> {
    let last = places.next()?;
    places.find(|place| distance(**place, *last) >= DIRECTION_M).map(|place| direction(*place, *last))
}

/// Direction of the road at the first of these positions.
fn start(places: &[[f64; 2]]) -> Option<[f64; 2]> {
    end(places.iter()).map(|backwards| backwards.map(|value| -value))
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Unit vector from one place to another.
fn direction(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let length = distance(from, to).max(f64::MIN_POSITIVE);
    [0, 1].map(|k| (to[k] - from[k]) / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(from: [f64; 2], to: [f64; 2]) -> Track {
        (0..=10)
            .map(|k| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * f64::from(k) / 10.0))
            .collect()
    }

    #[test]
    fn a_straight_road_goes_on_over_a_gap_and_others_do_not() {
        let first = run([0.0, 0.0], [50.0, 0.0]);
        let count = |next: Track| tracks(vec![first.clone(), Vec::new(), next]).len();
        assert_eq!(count(run([120.0, 5.0], [170.0, 0.0])), 1);
        assert_eq!(count(run([170.0, 0.0], [220.0, 0.0])), 2, "120 m");
        assert_eq!(count(run([110.0, 0.0], [110.0, 50.0])), 2, "a bend");
        assert_eq!(count(run([120.0, 0.0], [70.0, 0.0])), 2, "driven back");
        assert_eq!(count(run([50.0, 60.0], [100.0, 60.0])), 2, "another street");
        assert_eq!(count(run([0.0, 0.0], [50.0, 0.0])), 2, "driven again");
        assert_eq!(count(run([53.0, 4.0], [53.0, 60.0])), 1, "a stop");
        assert_eq!(count(vec![[110.0, 0.0]]), 2, "a single position has no direction");
    }
}
