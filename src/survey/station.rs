//! Where a place is along the axis: its chainage and its offset.
//!
//! The two ends of the axis are extended straight without a limit. An end of a stretch is extended as well if
//! the recording has a gap there, because a scanner sees objects beside the road that it did not drive.
//! Chainage includes the straight line over the gap. Each of the two extensions is at most half as long as
//! this line, so that no chainage occurs twice and chainage never decreases along the drive. An end from
//! which the drive continues along an earlier stretch is not extended: places there belong to the earlier
//! stretch.

use crate::survey::axis::Axis;
use crate::survey::runs::distance;

/// Number of vertices at an end of a stretch that give the direction of its extension. A single step
/// fluctuates.
const END_VERTICES: usize = 10;

/// The foot of a place on the axis.
struct Foot {
    /// Distance of the place in metres.
    away: f64,
    chainage: f64,
    /// The distance, negative to the right.
    offset: f64,
}

impl Foot {
    /// The foot on a segment with these ends and their chainage; `None` if it has no length.
    fn on([from, to]: [[f64; 2]; 2], chainage: [f64; 2], place: [f64; 2]) -> Option<Self> {
        let dx = to[0] - from[0];
        let dy = to[1] - from[1];
        let length = dx.hypot(dy);
        if length <= 0.0 {
            return None;
        }
        let px = place[0] - from[0];
        let py = place[1] - from[1];
        let share = ((px * dx + py * dy) / (length * length)).clamp(0.0, 1.0);
        let away = (px - share * dx).hypot(py - share * dy);
        let offset = if dx * py - dy * px < 0.0 { -away } else { away };
        Some(Self { away, chainage: chainage[0] + share * (chainage[1] - chainage[0]), offset })
    }
}

impl Axis {
    /// Chainage of the foot of a place on the axis, and its signed offset (positive to the left), in metres.
    /// The axis is extended straight beyond its two ends, and into gaps in the recording by up to half of the
    /// gap. Before its beginning, chainage is negative.
    #[must_use]
    pub fn locate(&self, place: [f64; 2]) -> (f64, f64) {
        if self.vertices.is_empty() {
            return (0.0, 0.0);
        }
        let vertex = self.nearest(place);
        if let Some(beyond) = self.beyond(vertex, place) {
            return beyond;
        }
        let beside = [vertex.checked_sub(1), Some(vertex)].into_iter().flatten();
        let segments = beside
            .filter(|&start| start + 1 < self.vertices.len() && self.joined[start])
            .map(|start| (self.ends([start, start + 1]), [self.chainage[start], self.chainage[start + 1]]));
        let mut best: Option<Foot> = None;
        for (ends, chainage) in segments.chain(self.extensions(vertex)) {
            let foot = Foot::on(ends, chainage, place);
            if let Some(foot) = foot.filter(|foot| best.as_ref().is_none_or(|best| foot.away < best.away)) {
                best = Some(foot);
            }
        }
        best.map_or_else(
            || (self.chainage[vertex], distance(place, self.vertices[vertex])),
            |foot| (foot.chainage, foot.offset),
        )
    }

    /// Smallest and largest chainage of the places whose nearest vertex this is, in metres, apart from the
    /// step to its neighbours and from places beyond the two ends of the axis.
    #[must_use]
    pub fn span_m(&self, vertex: usize) -> (f64, f64) {
        let chainage = self.chainage[vertex];
        let reach = self.reach.get(&vertex).copied().unwrap_or(0.0);
        if self.begins(vertex) { (chainage - reach, chainage) } else { (chainage, chainage + reach) }
    }

    /// Whether a stretch begins at a vertex.
    fn begins(&self, vertex: usize) -> bool {
        vertex == 0 || !self.joined[vertex - 1]
    }

    fn ends(&self, vertices: [usize; 2]) -> [[f64; 2]; 2] {
        vertices.map(|vertex| self.vertices[vertex])
    }

    /// Direction of the drive at a vertex where a stretch begins or ends; `None` if the stretch has no
    /// length.
    fn course(&self, vertex: usize) -> Option<[f64; 2]> {
        let last = self.vertices.len() - 1;
        let inner = if self.begins(vertex) {
            (vertex + 1..=(vertex + END_VERTICES).min(last)).take_while(|&at| self.joined[at - 1]).last()?
        } else {
            (vertex.saturating_sub(END_VERTICES)..vertex).rev().take_while(|&at| self.joined[at]).last()?
        };
        let [from, to] = self.ends([inner.min(vertex), inner.max(vertex)]);
        let length = distance(from, to);
        (length > 0.0).then(|| [(to[0] - from[0]) / length, (to[1] - from[1]) / length])
    }

    /// Chainage and offset of a place beyond the end of the axis at `vertex`; `None` if the vertex is not an
    /// end, or the place is not beyond it.
    fn beyond(&self, vertex: usize, place: [f64; 2]) -> Option<(f64, f64)> {
        if vertex != 0 && vertex + 1 != self.vertices.len() {
            return None;
        }
        let [ux, uy] = self.course(vertex)?;
        let (px, py) = (place[0] - self.vertices[vertex][0], place[1] - self.vertices[vertex][1]);
        let along = px * ux + py * uy;
        let is_beyond = if vertex == 0 { along < 0.0 } else { along > 0.0 };
        is_beyond.then(|| (self.chainage[vertex] + along, ux * py - uy * px))
    }

    /// The extensions on both sides of the gap that a vertex borders, as segments with the chainage of their
    /// ends. None if the vertex borders no gap.
    fn extensions(&self, vertex: usize) -> impl Iterator<Item = ([[f64; 2]; 2], [f64; 2])> + '_ {
        let borders = self.reach.contains_key(&vertex);
        let other_side = if self.begins(vertex) { vertex.checked_sub(1) } else { Some(vertex + 1) };
        let both = [Some(vertex), other_side].into_iter().flatten().filter(move |_| borders);
        both.filter_map(|vertex| {
            let reach = *self.reach.get(&vertex)?;
            let course = self.course(vertex)?;
            let (end, chainage) = (self.vertices[vertex], self.chainage[vertex]);
            let along = |way: f64| [0, 1].map(|axis| end[axis] + way * course[axis]);
            Some(if self.begins(vertex) {
                ([along(-reach), end], [chainage - reach, chainage])
            } else {
                ([end, along(reach)], [chainage, chainage + reach])
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::axis::AxisSource;
    use crate::survey::axis::tests::straight;

    #[test]
    fn chainage_and_offset_of_places_beside_a_straight_axis() {
        let axis = Axis::from_positions(AxisSource::Trajectory, &straight(100.0, 300.0, 7.0)).unwrap();
        let (chainage, offset) = axis.locate([150.4, 10.0]);
        assert!((chainage - 50.4).abs() < 1e-9 && (offset - 3.0).abs() < 1e-9);
        assert!((axis.locate([150.4, 2.0]).1 + 5.0).abs() < 1e-9);
        assert!((axis.length_m() - 200.0).abs() < 1e-9);
    }

    #[test]
    fn beyond_its_ends_the_axis_goes_straight_on() {
        let axis = Axis::from_positions(AxisSource::Trajectory, &straight(100.0, 300.0, 7.0)).unwrap();
        for (place, expected) in [
            ([80.0, 12.0], (-20.0, 5.0)),
            ([312.5, 4.0], (212.5, -3.0)),
            ([100.0, 27.0], (0.0, 20.0)),
            ([300.0, 27.0], (200.0, 20.0)),
        ] {
            let (chainage, offset) = axis.locate(place);
            assert!((chainage - expected.0).abs() < 1e-6 && (offset - expected.1).abs() < 1e-6, "{place:?}");
        }
        // The vertex in the middle of a bend is not an end.
        let mut bend = straight(0.0, 50.0, 0.0);
        bend.extend((1..=50).map(|k| [50.0, f64::from(k)]));
        let axis = Axis::from_positions(AxisSource::Trajectory, &bend).unwrap();
        let (chainage, offset) = axis.locate([53.0, -4.0]);
        assert!((chainage - 50.0).abs() < 0.5 && (offset + 5.0).abs() < 0.5, "{chainage} {offset}");
    }

    /// The recording has a gap of 160 m, in which the street bends by 90 degrees.
    #[test]
    fn a_stretch_goes_straight_on_into_a_gap_in_the_recording() {
        let first = straight(0.0, 200.0, 0.0);
        let second: Vec<[f64; 2]> =
            straight(80.0, 300.0, 0.0).iter().map(|[along, _]| [280.0, *along]).collect();
        let axis = Axis::from_runs(AxisSource::Trajectory, vec![first, second]).unwrap();
        assert_eq!(axis.stretches().count(), 2);
        // Chainage counts the straight line over the gap, of which each side has one half.
        let half = 80_f64.hypot(80.0) / 2.0;
        let second_m = 200.0 + 2.0 * half;
        for (place, expected) in [
            ([180.0, 5.0], (180.0, 5.0)),
            ([230.0, 5.0], (230.0, 5.0)),
            ([250.0, -6.0], (250.0, -6.0)),
            ([276.0, 60.0], (second_m - 20.0, 4.0)),
            ([284.0, 40.0], (second_m - 40.0, -4.0)),
            ([284.0, 100.0], (second_m + 20.0, -4.0)),
        ] {
            let (chainage, offset) = axis.locate(place);
            let close = (chainage - expected.0).abs() < 1e-6 && (offset - expected.1).abs() < 1e-6;
            assert!(close, "{place:?}: {chainage} {offset}");
        }
        // Where both extensions have ended, the nearer one counts, and neither passes the middle.
        for place in [[270.0, 3.0], [290.0, -40.0], [278.0, 10.0]] {
            let (chainage, offset) = axis.locate(place);
            assert!(
                (200.0..=second_m).contains(&chainage) && offset.abs() < 60.0,
                "{place:?}: {chainage} {offset}"
            );
        }
        let spans: Vec<(f64, f64)> = (0..axis.vertices().len()).map(|vertex| axis.span_m(vertex)).collect();
        assert!(spans.windows(2).all(|pair| pair[0].1 <= pair[1].0 + 1e-9), "a chainage occurs twice");
        let wide: Vec<&(f64, f64)> = spans.iter().filter(|(from, to)| to > from).collect();
        assert_eq!(wide.len(), 2);
        assert!(wide.iter().all(|(from, to)| (to - from - half).abs() < 1e-9), "{wide:?}");
    }

    /// To the east, back on the same street, and on to the west, all recorded without a gap: where the street
    /// is driven again, a stretch ends.
    #[test]
    fn a_stretch_that_ends_on_an_earlier_one_is_not_extended() {
        let mut drive = straight(0.0, 200.0, 0.0);
        drive.extend(straight(200.0, 0.0, 3.0));
        drive.extend(straight(0.0, -200.0, 0.0));
        let axis = Axis::from_positions(AxisSource::Trajectory, &drive).unwrap();
        assert!(axis.stretches().count() >= 2 && axis.reach.is_empty());
        let spans = (0..axis.vertices().len()).map(|vertex| axis.span_m(vertex));
        assert!(spans.zip(axis.chainage_m()).all(|(span, at)| span == (*at, *at)));
        // The recording stops while the vehicle is on the earlier stretch: the street that comes next begins
        // at a gap, but no stretch ends at it.
        let away = straight(0.0, 150.0, 300.0);
        let axis = Axis::from_runs(AxisSource::Trajectory, vec![drive[..80].to_vec(), away]).unwrap();
        assert_eq!(axis.reach.len(), 1);
        assert!(axis.chainage_m().windows(2).all(|pair| pair[0] < pair[1]));
    }

    /// A street in two runs that go in opposite directions: no chainage is on both sides of the gap.
    #[test]
    fn chainage_is_unambiguous_whatever_the_directions_at_a_gap() {
        for angle in 0..12 {
            let turn = f64::from(angle) * std::f64::consts::TAU / 12.0;
            let second: Vec<[f64; 2]> = (0..=60)
                .map(|k| [360.0 + f64::from(k) * turn.cos(), 40.0 + f64::from(k) * turn.sin()])
                .collect();
            let axis =
                Axis::from_runs(AxisSource::Trajectory, vec![straight(0.0, 200.0, 0.0), second]).unwrap();
            let spans: Vec<(f64, f64)> =
                (0..axis.vertices().len()).map(|vertex| axis.span_m(vertex)).collect();
            assert!(spans.windows(2).all(|pair| pair[0].1 <= pair[1].0 + 1e-9), "{angle}");
            for place in
                (0..40).flat_map(|i| (-10..20).map(move |j| [f64::from(i) * 10.0, f64::from(j) * 10.0]))
            {
                let (chainage, offset) = axis.locate(place);
                let (from, to) = axis.span_m(axis.nearest(place));
                let at_end = [0, axis.vertices().len() - 1].contains(&axis.nearest(place));
                // The foot may be on the other side of the gap, or a step before or behind the vertex.
                let other = (from - 170.0..=to + 170.0).contains(&chainage);
                assert!(at_end || other, "{angle} {place:?}: {chainage} {from} {to}");
                assert!(
                    at_end || offset.abs() <= distance(place, axis.vertices()[axis.nearest(place)]) + 1e-9
                );
            }
        }
    }
}
