//! The ground surface of one cell: height, mesh, materials.

use glam::{DVec2, DVec3, Vec3};

use super::axis::{Axis, CELL, Line, Node};
use super::preset::Plan;
use super::section::FACE;
use crate::synth::scene::material::{Material, material};
use crate::synth::scene::model::Model;
use crate::synth::scene::shape::Shape;

/// Distance between rows of the mesh, metres.
const ROW: f64 = 2.0;
/// Distance beyond the pavement over which the height of the axis turns into the height of the land, metres.
const BLEND: f64 = 10.0;

/// Value above which a sum of three waves of amplitude 1 makes the ground wet. This is so on 2 % of the
/// plane, in patches of about a metre (chosen, because dry roads have few points below them in real scans).
const WET: f64 = 2.4;

impl Plan {
    /// Height of the ground at `offset` (left positive) from the axis at chainage `s`; there the axis passes
    /// through `node`.
    pub(crate) fn height(&self, node: Node, s: f64, offset: f64) -> f64 {
        let section = self.section(s);
        let d = offset.abs();
        let beyond = d - section.walk;
        let over = smooth(beyond / BLEND);
        // Land and slopes depend on the place, not on the chainage. So both parts agree where a street
        // returns.
        let on_axis = node.point;
        let here = node.left(offset);
        let base = self.land.over(on_axis) * (1.0 - over) + self.land.over(here) * over;
        let slope = section.slopes * self.slopes.over(here);
        let dip = self.dip(s) * (beyond / FACE).clamp(0.0, 1.0);
        base + section.profile(d) + slope * smooth((beyond - 2.0) / 12.0) - dip
    }
}

fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The ground of one cell, and its position relative to other parts of the street.
#[derive(Debug)]
pub(crate) struct Ground {
    pub(crate) plan: Plan,
    pub(crate) cell: usize,
    /// Chainage of the start of the cell, and of the end of the whole street.
    pub(crate) start: f64,
    pub(crate) end: f64,
    /// The axis in this cell and its neighbours, and the axis in cells further away, which may return to this
    /// cell.
    pub(crate) line: Line,
    foreign: Line,
    /// Middle of the cell, metres from the street's origin, and direction of the axis there. They are the
    /// frame of the mesh, so that boxes are tight around its rows.
    pub(crate) origin: DVec3,
    pub(crate) turn: DVec2,
}

impl Ground {
    /// The ground of a cell; the axis is laid beyond it.
    pub(crate) fn new(plan: Plan, axis: &Axis, cell: usize) -> Self {
        let start = cell as f64 * CELL;
        let end = axis.end;
        let Node { point, way } = axis.line.at(start + CELL * 0.5);
        let far = |from, to| if end.is_finite() { axis.line.part(from, to) } else { Line::default() };
        Self {
            plan,
            cell,
            start,
            end,
            line: axis.line.part(start - CELL, start + 2.0 * CELL),
            foreign: far(0.0, start - 2.0 * CELL).and(far(start + 3.0 * CELL, end)),
            origin: point.extend(plan.land.over(point)),
            turn: way,
        }
    }

    /// The point of the ground at a chainage and offset (left positive), metres from the street's origin.
    pub(crate) fn at(&self, place: DVec2) -> DVec3 {
        let node = self.line.at(place.x);
        node.left(place.y).extend(self.plan.height(node, place.x, place.y))
    }

    /// Chainage and offset of a point relative to another part of the street, if that part is nearer than
    /// `offset`.
    pub(crate) fn elsewhere(&self, point: DVec2, offset: f64) -> Option<(f64, f64)> {
        self.foreign.nearest(point).filter(|(_, other)| other.abs() < offset.abs())
    }

    /// A point of the mesh in its frame, and whether it lies well within another part of the street. If the
    /// axis of the other part is nearer, its height applies.
    fn vertex(&self, s: f64, offset: f64) -> (Vec3, bool) {
        let mut point = self.at(DVec2::new(s, offset));
        let mut nearer = 0.0;
        if let Some((s, other)) = self.elsewhere(point.truncate(), offset) {
            point.z = self.plan.height(self.foreign.at(s), s, other);
            nearer = offset.abs() - other.abs();
        }
        let arm = point - self.origin;
        let local = DVec2::new(self.turn.dot(arm.truncate()), self.turn.perp_dot(arm.truncate()));
        (local.extend(arm.z).as_vec3(), nearer > 3.0)
    }

    /// The surface.
    pub(crate) fn mesh(&self) -> Model {
        let rows = ((self.end - self.start).min(CELL) / ROW).ceil() as usize;
        let row = |row: usize| {
            let s = self.start + row as f64 * ROW;
            self.plan.section(s).breaks().map(|offset| self.vertex(s, offset)).collect::<Vec<_>>()
        };
        let rows: Vec<_> = (0..=rows.max(1)).map(row).collect();
        let mut primitives = Vec::new();
        for pair in rows.windows(2) {
            for (here, next) in pair[0].windows(2).zip(pair[1].windows(2)) {
                let corners = [here[0], here[1], next[0], next[1]];
                // The other part of the street has its own surface there.
                if !corners.iter().all(|(_, far)| *far) {
                    let [a, b, c, d] = corners.map(|(point, _)| point);
                    let halves = [[a, b, c], [d, c, b]].map(Shape::Triangle);
                    primitives.extend(halves.map(|half| half.of("asphalt")));
                }
            }
        }
        Model::new(primitives)
    }

    /// A point of the mesh in the plane, metres from the street's origin.
    fn plane(&self, point: Vec3) -> DVec2 {
        self.origin.truncate() + self.turn.rotate(point.as_dvec3().truncate())
    }

    /// Whether the ground is wet at a point of the mesh, in its frame.
    pub(crate) fn wet(&self, point: Vec3) -> bool {
        self.plan.wet.over(self.plane(point)) > WET
    }

    /// The material at a point of the mesh, in its frame.
    pub(crate) fn material(&self, point: Vec3) -> &'static Material {
        let (s, offset) = self.line.nearest(self.plane(point)).unwrap_or_default();
        let section = self.plan.section(s);
        let d = offset.abs();
        let near = |line: f64| (d - line).abs() < 0.07;
        let centre = section.median < 0.3 && (d - 0.13).abs() < 0.06;
        let edge = near(section.lanes - 0.1) || (section.median >= 0.3 && near(section.median + 0.3));
        let count = ((section.lanes - section.median) / section.lane).round() as i32;
        let mut between = (1..count).map(|lane| section.median + f64::from(lane) * section.lane);
        material(match d {
            d if d < section.median => "grass",
            d if d <= section.kerb - 0.02 => {
                let painted = centre || edge || (s.rem_euclid(9.0) < 3.0 && between.any(near));
                if painted { "marking" } else { "asphalt" }
            }
            d if d <= section.kerb + 0.15 => "paving",
            d if d >= section.verge && d < section.walk => "paving",
            _ if self.plan.layout(self.cell).paved => "paving",
            _ => "grass",
        })
    }
}
