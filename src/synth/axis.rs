//! The axis of the street in plan and the land it runs over: pure functions of the seed. No cross-section.
//!
//! Coordinates are metres from the street's origin, east and north; chainage `s` counts along the axis. The axis is
//! cut into cells of [`CELL`] metres; only the start of each cell is kept, 16 bytes per 50 m.

use std::f64::consts::{FRAC_PI_3, TAU};

use serde::Deserialize;

use super::random::Random;

/// Length of a cell, metres.
pub(super) const CELL: f64 = 50.0;
/// Distance between the nodes of a cell, metres.
const STEP: f64 = 1.0;
/// Nodes of a cell, both ends included.
const NODES: usize = 51;
/// Street in front of the start of the drive, so that the scanner sees something behind it, metres.
pub(super) const LEAD: f64 = 100.0;
/// Length of the stretch that the `loop` preset drives twice, metres.
pub(super) const STEM: f64 = 300.0;
/// Length of a `loop` around the stem's end for radius 1: two arcs of 60 degrees and one of 300.
const LOOP_LENGTH: f64 = 7.0 * FRAC_PI_3;

/// A sine wave along the axis.
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

/// How winding and how hilly the land is.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Terrain {
    /// Amplitude of the heading, radians, and its wave length, metres.
    pub(super) bends: (f64, f64),
    /// Amplitude of the hills, metres, and their wave length.
    pub(super) hills: (f64, f64),
}

/// A point of the axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Direction of growing chainage, radians from east to north.
    pub(super) heading: f64,
}

impl Node {
    /// The point `offset` metres to the left.
    pub(super) fn left(&self, offset: f64) -> [f64; 2] {
        [self.x - offset * self.heading.sin(), self.y + offset * self.heading.cos()]
    }
}

/// The axis within one cell.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) cell: usize,
    nodes: Vec<Node>,
}

impl Frame {
    /// Chainage of the start of the cell.
    pub(super) fn start(&self) -> f64 {
        self.cell as f64 * CELL
    }

    /// The axis at chainage `s`, which is in the cell or close to it.
    pub(super) fn at(&self, s: f64) -> Node {
        let along = (s - self.start()) / STEP;
        let index = (along.max(0.0) as usize).min(NODES - 2);
        let (a, b) = (self.nodes[index], self.nodes[index + 1]);
        let rest = (along - index as f64) * STEP;
        let turn = (b.heading - a.heading) / STEP;
        let middle = a.heading + turn * rest * 0.5;
        Node { x: a.x + rest * middle.cos(), y: a.y + rest * middle.sin(), heading: a.heading + turn * rest }
    }

    /// Chainage and signed offset (left positive) of the place of this cell's axis that is nearest to a point.
    pub(super) fn nearest(&self, x: f64, y: f64) -> (f64, f64) {
        let distance = |node: &Node| (node.x - x).powi(2) + (node.y - y).powi(2);
        let best = (0..NODES).min_by(|&i, &j| distance(&self.nodes[i]).total_cmp(&distance(&self.nodes[j])));
        let index = best.unwrap_or(0);
        let node = self.nodes[index];
        let (sin, cos) = node.heading.sin_cos();
        let (dx, dy) = (x - node.x, y - node.y);
        let along = (dx * cos + dy * sin).clamp(-STEP, STEP);
        let offset = dy * cos - dx * sin;
        // Beyond the ends of the cell the distance counts, not the offset.
        let beyond = (index == 0 || index == NODES - 1) && (dx * cos + dy * sin).abs() > STEP;
        let offset = if beyond { dx.hypot(dy).copysign(offset) } else { offset };
        (self.start() + index as f64 * STEP + along, offset)
    }
}

/// The hills.
#[derive(Debug, Clone, Copy)]
pub(super) struct Land([(Wave, f64); 3]);

impl Land {
    /// Height of the land, metres, before anything was built on it.
    pub(super) fn height(&self, x: f64, y: f64) -> f64 {
        self.0.iter().map(|(wave, turn)| wave.at(x * turn.cos() + y * turn.sin())).sum()
    }
}

/// The axis of the whole street.
#[derive(Debug)]
pub(super) struct Axis {
    seed: u64,
    bends: [Wave; 2],
    pub(super) land: Land,
    /// Radius of the loop at the end of the stem; `None` for an open street.
    loop_radius: Option<f64>,
    starts: Vec<[f64; 2]>,
}

impl Axis {
    /// An open street, or one that comes back to its stem after `drive` metres in all.
    pub(super) fn new(seed: u64, terrain: Terrain, loop_drive: Option<f64>) -> Self {
        let mut random = Random::new(seed, 1, 0);
        let mut wave = |amplitude: f64, length: f64| Wave {
            amplitude,
            frequency: TAU / length,
            phase: f64::from(random.angle()),
        };
        let (bend, length) = terrain.bends;
        let bends = [wave(bend, length), wave(bend * 0.15, length * 0.37)];
        let (height, across) = terrain.hills;
        let hills = [(height, across), (height * 0.35, across * 0.43), (height * 0.1, across * 0.15)]
            .map(|(a, l)| wave(a, l))
            .map(|w| (w, w.phase * 1.7));
        let loop_radius = loop_drive.map(|drive| (drive - 2.0 * STEM) / LOOP_LENGTH);
        Self { seed, bends, land: Land(hills), loop_radius, starts: vec![[0.0, 0.0]] }
    }

    /// Length of the street where it has an end of its own: the loop's closing point.
    pub(super) fn street_length(&self) -> Option<f64> {
        self.loop_radius.map(|radius| LEAD + STEM + radius * LOOP_LENGTH)
    }

    fn heading(&self, s: f64) -> f64 {
        let Some(radius) = self.loop_radius else { return self.bends.iter().map(|wave| wave.at(s)).sum() };
        // A drop: 60 degrees to the left, 300 to the right, 60 to the left again, all with one radius, end where
        // they began, in the opposite direction.
        let along = (s - LEAD - STEM).max(0.0) / radius;
        let base = f64::from(Random::new(self.seed, 2, 0).unit()) * TAU;
        base + if along < FRAC_PI_3 {
            along
        } else if along < 6.0 * FRAC_PI_3 {
            2.0 * FRAC_PI_3 - along
        } else {
            (along - 10.0 * FRAC_PI_3).min(-3.0 * FRAC_PI_3)
        }
    }

    /// The axis in cell `cell`; remembers the starts of all cells up to it.
    pub(super) fn frame(&mut self, cell: usize) -> Frame {
        while self.starts.len() <= cell {
            let last = self.starts.len() - 1;
            let nodes = self.nodes(last);
            self.starts.push([nodes[NODES - 1].x, nodes[NODES - 1].y]);
        }
        Frame { cell, nodes: self.nodes(cell) }
    }

    fn nodes(&self, cell: usize) -> Vec<Node> {
        let [mut x, mut y] = self.starts[cell];
        let start = cell as f64 * CELL;
        let mut nodes = Vec::with_capacity(NODES);
        for index in 0..NODES {
            let s = start + index as f64 * STEP;
            nodes.push(Node { x, y, heading: self.heading(s) });
            let middle = self.heading(s + STEP * 0.5);
            x += STEP * middle.cos();
            y += STEP * middle.sin();
        }
        nodes
    }

    /// Whether the street comes back to itself.
    pub(super) fn closes(&self) -> bool {
        self.loop_radius.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: Terrain = Terrain { bends: (0.4, 600.0), hills: (4.0, 700.0) };

    #[test]
    fn cells_join_without_a_gap_whatever_the_order_of_asking() {
        let mut axis = Axis::new(5, FLAT, None);
        let late = axis.frame(7);
        let early = axis.frame(6);
        let (a, b) = (early.at(350.0), late.at(350.0));
        assert!((a.x - b.x).hypot(a.y - b.y) < 1e-4 && (a.heading - b.heading).abs() < 1e-12);
    }

    #[test]
    fn nearest_inverts_left() {
        let mut axis = Axis::new(5, FLAT, None);
        let frame = axis.frame(3);
        let [x, y] = frame.at(171.3).left(-7.5);
        let (s, offset) = frame.nearest(x, y);
        assert!((s - 171.3).abs() < 0.02 && (offset + 7.5).abs() < 0.01, "{s} {offset}");
    }

    #[test]
    fn the_loop_ends_where_the_stem_ends_in_the_opposite_direction() {
        let mut axis = Axis::new(9, FLAT, Some(1_400.0));
        let end = axis.street_length().unwrap();
        assert!((end - 1_200.0).abs() < 1e-9); // 100 m of lead, 300 m of stem, 800 m of loop
        let stem = axis.frame(7).at(400.0);
        let closed = axis.frame(23).at(end);
        let gap = (stem.x - closed.x).hypot(stem.y - closed.y);
        assert!(gap < 0.5, "{gap}");
        let turn = closed.heading - stem.heading;
        assert!((turn + std::f64::consts::PI).abs() < 1e-6, "{turn}");
    }
}
