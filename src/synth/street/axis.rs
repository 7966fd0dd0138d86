//! The axis of the street in plan: a sequence of arcs. Heights and cross-section are elsewhere.
//!
//! Coordinates are metres from the street's origin, east and north; chainage `s` counts along the axis. An
//! arc of 50 m takes 56 bytes. Apart from the axis, only the list of seen moving things grows with a drive.

use std::f64::consts::FRAC_PI_6;

use glam::DVec2;

use crate::synth::random::{Waves, sequence};

/// Length of a cell of the street, and of an arc of an open street, metres.
pub(crate) const CELL: f64 = 50.0;
/// Length of the street before the start of the drive, metres. It gives the scanner something to see behind
/// it.
pub(crate) const LEAD: f64 = 100.0;
/// Length of the stretch that the `loop` preset drives twice, metres.
pub(crate) const STEM: f64 = 300.0;
/// Smallest curvature of an arc, 1/m: the radius is so large that the arc is straight in practice.
const STRAIGHT: f64 = 1e-9;

/// A point of the axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    pub(crate) point: DVec2,
    /// Unit vector of growing chainage.
    pub(crate) way: DVec2,
}

impl Node {
    /// The point `offset` metres to the left.
    pub(crate) fn left(&self, offset: f64) -> DVec2 {
        self.point + self.way.perp() * offset
    }

    /// Distances by which a point is ahead and to the left.
    fn local(&self, point: DVec2) -> DVec2 {
        let arm = point - self.point;
        DVec2::new(self.way.dot(arm), self.way.perp_dot(arm))
    }
}

/// A piece of the axis with one curvature, positive to the left.
#[derive(Debug, Clone, Copy)]
struct Arc {
    from: f64,
    to: f64,
    /// The axis at `from`.
    node: Node,
    curvature: f64,
}

impl Arc {
    fn at(&self, s: f64) -> Node {
        let half = DVec2::from_angle((s - self.from) * self.curvature * 0.5);
        let chord = self.node.way.rotate(half);
        let point = self.node.point + chord * (2.0 * half.y / self.curvature);
        Node { point, way: chord.rotate(half) }
    }

    /// Chainage and signed offset (left positive) of the nearest place on the arc. Beyond the ends, the
    /// distance to the end is used. Arcs are shorter than half a circle.
    fn nearest(&self, point: DVec2) -> (f64, f64) {
        // From the centre, in radii.
        let local = self.node.local(point) * self.curvature;
        let s = self.from + local.x.atan2(1.0 - local.y) / self.curvature;
        if (self.from..=self.to).contains(&s) {
            return (s, (1.0 - local.x.hypot(1.0 - local.y)) / self.curvature);
        }
        let end = s.clamp(self.from, self.to);
        let local = self.at(end).local(point);
        (end, local.length().copysign(local.y))
    }
}

/// Arcs in the order of chainage.
#[derive(Debug, Clone, Default)]
pub(crate) struct Line(Vec<Arc>);

impl Line {
    /// The axis at chainage `s`, which is on the line or close to it.
    pub(crate) fn at(&self, s: f64) -> Node {
        self.0[self.0.partition_point(|arc| arc.to < s).min(self.0.len() - 1)].at(s)
    }

    /// Chainage and signed offset of the nearest place on the line, if there is any line.
    pub(crate) fn nearest(&self, point: DVec2) -> Option<(f64, f64)> {
        let places = self.0.iter().map(|arc| arc.nearest(point));
        places.min_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))
    }

    /// The part of this line within a range of chainage.
    pub(crate) fn part(&self, from: f64, to: f64) -> Self {
        let cut = |arc: &Arc| {
            let from = arc.from.max(from);
            let to = arc.to.min(to);
            (from < to).then(|| Arc { from, to, node: arc.at(from), ..*arc })
        };
        Self(self.0.iter().filter_map(cut).collect())
    }

    /// This line and, after a gap, another one.
    pub(crate) fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// Chainage of the end.
    fn end(&self) -> f64 {
        self.0.last().map_or(0.0, |last| last.to)
    }

    fn extend(&mut self, length: f64, curvature: f64) {
        let from = self.end();
        let start = Node { point: DVec2::ZERO, way: DVec2::X };
        let node = self.0.last().map_or(start, |last| last.at(from));
        let curvature = if curvature.abs() < STRAIGHT { STRAIGHT } else { curvature };
        self.0.push(Arc { from, to: from + length, node, curvature });
    }
}

/// The axis of the whole street.
#[derive(Debug)]
pub(crate) struct Axis {
    /// The part of the axis that is already laid.
    pub(crate) line: Line,
    /// Heading of an open street.
    heading: Waves<2>,
    /// Chainage at which the street returns to its stem; infinite if it does not.
    pub(crate) end: f64,
}

impl Axis {
    /// An open street with bends of this amplitude (radians) and wavelength (metres), or a street that
    /// returns to its stem, with a drive of `loop_drive` metres in all.
    pub(crate) fn new(seed: u64, (turn, length): (f64, f64), loop_drive: Option<f64>) -> Self {
        let parts = [(turn, length), (0.15 * turn, 0.37 * length)];
        let heading = Waves::new(parts, &mut sequence(seed, 1, 0));
        let mut axis = Self { line: Line::default(), heading, end: f64::INFINITY };
        if let Some(drive) = loop_drive {
            axis.line.extend(LEAD + STEM, 0.0);
            // The loop has the shape of a drop: 60 degrees to the left, 300 to the right, 60 to the left
            // again, all with one radius. It ends where it began, in the opposite direction.
            let arc = (drive - 2.0 * STEM) / 14.0;
            for steps in [2.0, -5.0, -5.0, 2.0f64] {
                axis.line.extend(steps.abs() * arc, FRAC_PI_6.copysign(steps) / arc);
            }
            axis.end = axis.line.end();
        }
        axis
    }

    /// Lays an open street up to chainage `s`.
    pub(crate) fn reach(&mut self, s: f64) {
        while self.line.end() < s.min(self.end) {
            let [here, next] = [0.0, CELL].map(|ahead| self.heading.along(self.line.end() + ahead));
            self.line.extend(CELL, (next - here) / CELL);
        }
    }

    /// The cells whose middles are within `reach` of the axis at chainage `s`, in order. The street is laid
    /// beyond them.
    pub(crate) fn near(&mut self, s: f64, reach: f64) -> Vec<usize> {
        self.reach(s + reach + 3.0 * CELL);
        let place = self.line.at(s).point;
        let middle = |cell: &usize| self.line.at((*cell as f64 + 0.5) * CELL).point;
        // All cells are checked, because a street may return. This takes about ten nanoseconds per cell, once
        // per ten metres of driving.
        let cells = 0..(self.line.end() / CELL).ceil() as usize;
        cells.filter(|cell| middle(cell).distance(place) < reach).collect()
    }
}

/// The cell of a chainage. A chainage before the start of the street is in the first cell.
pub(crate) fn cell_at(s: f64) -> usize {
    (s / CELL).max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn street(reach: f64) -> Line {
        let mut axis = Axis::new(5, (0.4, 600.0), None);
        axis.reach(reach);
        axis.line
    }

    #[test]
    fn arcs_join_without_a_gap_and_do_not_depend_on_how_far_the_street_is_laid() {
        let line = street(500.0);
        let a = line.at(350.0 - 1e-7);
        let b = line.at(350.0 + 1e-7);
        assert!(a.point.distance(b.point) < 1e-6 && a.way.distance(b.way) < 1e-6);
        assert_eq!(line.at(123.0).point, street(2_000.0).at(123.0).point);
    }

    #[test]
    fn nearest_inverts_left_on_arcs_and_on_straight_lines() {
        let mut closed = Axis::new(5, (0.4, 600.0), Some(1_400.0)).line;
        for line in [street(500.0), closed.clone(), closed.part(0.0, 40.0).and(closed.part(500.0, 600.0))] {
            for (s, offset) in [(20.0, 30.0), (571.3, -7.5), (571.3, 7.5)] {
                let s = if line.end() < 560.0 { s * 0.7 } else { s };
                let (s1, offset1) = line.nearest(line.at(s).left(offset)).unwrap();
                assert!((s1 - s).abs() < 1e-5 && (offset1 - offset).abs() < 1e-5, "{s1} {offset1}");
            }
        }
        closed = closed.part(0.0, 40.0);
        let (s, offset) = closed.nearest(closed.at(43.0).left(4.0)).unwrap();
        assert!((s - 40.0).abs() < 1e-6 && (offset - 5.0).abs() < 1e-6, "3 m beyond the end: {s} {offset}");
    }

    #[test]
    fn the_loop_ends_where_the_stem_ends_in_the_opposite_direction() {
        let axis = Axis::new(9, (0.4, 600.0), Some(1_400.0));
        assert!((axis.end - 1_200.0).abs() < 1e-9); // 100 m of lead, 300 m of stem, 800 m of loop
        let stem = axis.line.at(400.0);
        let closed = axis.line.at(axis.end);
        assert!(stem.point.distance(closed.point) < 1e-6, "{stem:?} {closed:?}");
        assert!((closed.way + stem.way).length() < 1e-6);
    }
}
