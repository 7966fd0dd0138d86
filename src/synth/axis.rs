//! The axis of the street in plan and the land it runs over: pure functions of the seed. No cross-section.
//!
//! Coordinates are metres from the street's origin, east and north; chainage `s` counts along the axis. The axis is
//! cut into cells of [`CELL`] metres; only the start of each cell is kept, 16 bytes per 50 m.

use std::f64::consts::{FRAC_PI_3, TAU};

use glam::DVec2;
use rand::RngExt;

use super::random::sequence;

/// Length of a cell, metres.
pub(super) const CELL: f64 = 50.0;
/// Nodes of the axis in a cell: one per metre.
const NODES: usize = 50;
/// Street in front of the start of the drive, so that the scanner sees something behind it, metres.
pub(super) const LEAD: f64 = 100.0;
/// Length of the stretch that the `loop` preset drives twice, metres.
pub(super) const STEM: f64 = 300.0;
/// Length of a `loop` around the stem's end for radius 1: two arcs of 60 degrees and one of 300.
const LOOP_LENGTH: f64 = 7.0 * FRAC_PI_3;

/// A sine wave.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Wave {
    fn at(&self, s: f64) -> f64 {
        self.amplitude * (s * self.frequency + self.phase).sin()
    }
}

/// The lie of the land: the waves of an open street's heading, and the hills, each across a direction of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Land {
    bends: [Wave; 2],
    hills: [(Wave, DVec2); 3],
}

impl Land {
    /// `bends` are amplitude (radians) and wave length (metres) of the heading, `hills` those (metres) of the hills.
    pub(super) fn new(seed: u64, bends: (f64, f64), hills: (f64, f64)) -> Self {
        let mut random = sequence(seed, 1, 0);
        let mut wave = |(amplitude, length): (f64, f64), (a, l): (f64, f64)| Wave {
            amplitude: amplitude * a,
            frequency: TAU / (length * l),
            phase: random.random_range(0.0..TAU),
        };
        let bends = [(1.0, 1.0), (0.15, 0.37)].map(|part| wave(bends, part));
        let hills = [(1.0, 1.0), (0.35, 0.43), (0.1, 0.15)].map(|part| wave(hills, part));
        Self { bends, hills: hills.map(|wave| (wave, DVec2::from_angle(wave.phase * 1.7))) }
    }

    /// Height of the land, metres, before anything was built on it.
    pub(super) fn height(&self, point: DVec2) -> f64 {
        self.hills.iter().map(|(wave, across)| wave.at(point.dot(*across))).sum()
    }
}

/// A point of the axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) point: DVec2,
    /// Direction of growing chainage, radians from east to north.
    pub(super) heading: f64,
}

impl Node {
    /// The point `offset` metres to the left.
    pub(super) fn left(&self, offset: f64) -> DVec2 {
        self.point + DVec2::from_angle(self.heading).perp() * offset
    }

    /// How far a point is ahead and to the left.
    pub(super) fn local(&self, point: DVec2) -> DVec2 {
        DVec2::from_angle(-self.heading).rotate(point - self.point)
    }
}

/// The axis in a cell and the next one.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// Chainage of the first node.
    pub(super) start: f64,
    nodes: Vec<Node>,
}

impl Frame {
    /// The axis at chainage `s`, which is in the frame or close to it.
    pub(super) fn at(&self, s: f64) -> Node {
        let along = s - self.start;
        let index = (along.max(0.0) as usize).min(self.nodes.len() - 2);
        let (a, b) = (self.nodes[index], self.nodes[index + 1]);
        let rest = along - index as f64;
        let turn = b.heading - a.heading;
        let chord = DVec2::from_angle(a.heading + turn * rest * 0.5);
        Node { point: a.point + chord * rest, heading: a.heading + turn * rest }
    }

    /// The middle of the cell.
    pub(super) fn middle(&self) -> Node {
        self.at(self.start + CELL * 0.5)
    }

    /// Chainage and signed offset (left positive) of the place of this axis that is nearest to a point.
    pub(super) fn nearest(&self, point: DVec2) -> (f64, f64) {
        let distance = |index: &usize| self.nodes[*index].point.distance_squared(point);
        let index = (0..self.nodes.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        let local = self.nodes[index].local(point);
        // Beyond the ends the distance counts, not the offset.
        let offset = if local.x.abs() > 1.0 { local.length().copysign(local.y) } else { local.y };
        (self.start + index as f64 + local.x.clamp(-1.0, 1.0), offset)
    }
}

/// The axis of the whole street.
#[derive(Debug)]
pub(super) struct Axis {
    land: Land,
    /// Radius of the loop at the end of the stem, infinite for an open street.
    radius: f64,
    /// Heading of the stem of a loop.
    stem: f64,
    starts: Vec<DVec2>,
}

impl Axis {
    /// An open street, or one that comes back to its stem after `loop_drive` metres in all.
    pub(super) fn new(seed: u64, land: Land, loop_drive: Option<f64>) -> Self {
        let radius = loop_drive.map_or(f64::INFINITY, |drive| (drive - 2.0 * STEM) / LOOP_LENGTH);
        let stem = sequence(seed, 2, 0).random_range(0.0..TAU);
        Self { land, radius, stem, starts: vec![DVec2::ZERO] }
    }

    /// Chainage at which the street comes back to its stem, infinite if it does not.
    pub(super) fn end(&self) -> f64 {
        LEAD + STEM + self.radius * LOOP_LENGTH
    }

    fn heading(&self, s: f64) -> f64 {
        if self.radius.is_infinite() {
            return self.land.bends.iter().map(|wave| wave.at(s)).sum();
        }
        // A drop: 60 degrees to the left, 300 to the right, 60 to the left again, all with one radius, end where
        // they began, in the opposite direction.
        let along = (s - LEAD - STEM).max(0.0) / self.radius;
        let back = (along - 10.0 * FRAC_PI_3).min(-3.0 * FRAC_PI_3);
        self.stem + along.min(2.0 * FRAC_PI_3 - along).max(back)
    }

    /// The axis in `cell` and the next one; remembers the starts of all cells up to it.
    pub(super) fn frame(&mut self, cell: usize) -> Frame {
        for cell in self.starts.len()..=cell {
            let next = self.nodes(cell - 1)[NODES].point;
            self.starts.push(next);
        }
        Frame { start: cell as f64 * CELL, nodes: self.nodes(cell) }
    }

    fn nodes(&self, cell: usize) -> Vec<Node> {
        let mut next = self.starts[cell];
        let node = |metre: usize| {
            let node = Node { point: next, heading: self.heading(metre as f64) };
            next += DVec2::from_angle(self.heading(metre as f64 + 0.5));
            node
        };
        (cell * NODES..=(cell + 2) * NODES).map(node).collect()
    }

    /// The cells whose middles are within `reach` of the axis at chainage `s`, in order.
    pub(super) fn near(&mut self, s: f64, reach: f64) -> Vec<usize> {
        let (here, span) = (cell_at(s), (reach / CELL) as usize + 1);
        let cells = if self.end().is_finite() {
            0..(self.end() / CELL).ceil() as usize
        } else {
            here.saturating_sub(span)..here + span + 1
        };
        let place = self.frame(here).at(s).point;
        cells.filter(|cell| self.frame(*cell).middle().point.distance(place) < reach).collect()
    }
}

/// The cell of a chainage; the first one in front of the street's start, too.
pub(super) fn cell_at(s: f64) -> usize {
    (s / CELL).max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn land(seed: u64) -> Land {
        Land::new(seed, (0.4, 600.0), (4.0, 700.0))
    }

    #[test]
    fn cells_join_without_a_gap_whatever_the_order_of_asking() {
        let mut axis = Axis::new(5, land(5), None);
        let late = axis.frame(7);
        let early = axis.frame(6);
        let (a, b) = (early.at(350.0), late.at(350.0));
        assert!(a.point.distance(b.point) < 1e-4 && (a.heading - b.heading).abs() < 1e-12);
    }

    #[test]
    fn nearest_inverts_left() {
        let mut axis = Axis::new(5, land(5), None);
        let frame = axis.frame(3);
        let point = frame.at(171.3).left(-7.5);
        let (s, offset) = frame.nearest(point);
        assert!((s - 171.3).abs() < 0.02 && (offset + 7.5).abs() < 0.01, "{s} {offset}");
    }

    #[test]
    fn the_loop_ends_where_the_stem_ends_in_the_opposite_direction() {
        let mut axis = Axis::new(9, land(9), Some(1_400.0));
        let end = axis.end();
        assert!((end - 1_200.0).abs() < 1e-9); // 100 m of lead, 300 m of stem, 800 m of loop
        let stem = axis.frame(7).at(400.0);
        let closed = axis.frame(23).at(end);
        let gap = stem.point.distance(closed.point);
        assert!(gap < 0.5, "{gap}");
        let turn = closed.heading - stem.heading;
        assert!((turn + std::f64::consts::PI).abs() < 1e-6, "{turn}");
    }
}
