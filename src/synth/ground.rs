//! The cross-section of the street and the surface of the ground of one cell: height, mesh, and what lies where.

use std::array;

use bytemuck::{Pod, Zeroable};
use glam::{DQuat, DVec2, DVec3, Mat3A, Vec3};
use rand::RngExt;
use serde::Deserialize;

use super::axis::{Axis, CELL, Frame, Land, Node};
use super::material::{Material, material};
use super::preset::Plan;
use super::random::sequence;
use super::scene::Model;
use super::shape::Shape;

/// Distance between rows of the mesh, metres.
const ROW: f64 = 2.0;
/// Width of a kerb's face or of another step, metres.
const FACE: f64 = 0.03;
/// How far from the axis the land over the axis has become the land itself, beyond the pavement, metres.
const BLEND: f64 = 25.0;

/// Half of a cross-section; all widths are distances from the axis, metres, not falling from one to the next.
#[derive(Debug, Clone, Copy, Deserialize, Pod, Zeroable)]
#[repr(C)]
#[serde(deny_unknown_fields)]
pub(super) struct Section {
    /// Edge of the raised median; 0 for none.
    pub(super) median: f64,
    /// Edge of the outermost lane.
    pub(super) lanes: f64,
    /// Kerb, beyond parked cars or the hard shoulder.
    pub(super) kerb: f64,
    /// Edge of the planted strip.
    pub(super) verge: f64,
    /// Edge of the pavement.
    pub(super) walk: f64,
    /// Height of the kerbs.
    pub(super) kerb_height: f64,
    /// Amplitude of the slopes beside the street.
    pub(super) slopes: f64,
    /// Width of a lane.
    pub(super) lane: f64,
    /// How far the land beside the pavement is below it: a bridge over a dip.
    #[serde(skip)]
    pub(super) dip: f64,
    /// Height gained by the slopes on the left and on the right.
    #[serde(skip)]
    pub(super) rise: [f64; 2],
}

impl Section {
    /// Between two sections, `w` 0 to 1.
    pub(super) fn between(self, other: Self, w: f64) -> Self {
        let [a, b]: [[f64; 11]; 2] = [self, other].map(bytemuck::cast);
        bytemuck::cast(array::from_fn::<f64, 11, _>(|i| a[i] + (b[i] - a[i]) * w))
    }

    /// Middle of the outermost lane: where the vehicle drives.
    pub(super) fn driving_line(&self) -> f64 {
        self.lanes - self.lane * 0.5
    }

    /// Offsets from the axis at which the profile bends, from right to left.
    fn breaks(&self) -> impl Iterator<Item = f64> {
        let (m, k, w) = (self.median, self.kerb, self.walk);
        let street = [m, m + FACE, (m + k) * 0.5, k, k + FACE, self.verge.max(k + 2.0 * FACE), w, w + FACE];
        let beyond = [2.0, 5.0, 9.0, 15.0, 24.0, 36.0, 55.0].map(|d| w + d);
        let left = street.into_iter().chain(beyond);
        left.clone().rev().map(|d| -d).chain([0.0]).chain(left)
    }

    /// Height over the axis at distance `d`, without land, dips and slopes: a camber of 2.5 %, kerbs, a pavement
    /// that falls to the road by 2 %.
    fn profile(&self, d: f64) -> f64 {
        let road = -0.025 * d.min(self.kerb);
        // A median narrower than a kerb stone has no height, so that sections blend into each other.
        if d <= self.median {
            return road + self.kerb_height * (self.median / 0.5).min(1.0);
        }
        let beyond = (d - self.kerb) / FACE;
        road + self.kerb_height * beyond.clamp(0.0, 1.0) + 0.02 * (d.min(self.walk) - self.kerb).max(0.0)
    }

    /// Height of the ground at `offset` (left positive) from a point of the axis.
    pub(super) fn height(&self, land: &Land, node: Node, offset: f64) -> f64 {
        let d = offset.abs();
        let beyond = d - self.walk;
        let over = smooth(beyond / BLEND);
        let base = land.height(node.point) * (1.0 - over) + land.height(node.left(offset)) * over;
        let slope = self.rise[usize::from(offset < 0.0)] * smooth((beyond - 2.0) / 12.0);
        base + self.profile(d) + slope - self.dip * (beyond / FACE).clamp(0.0, 1.0)
    }
}

fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The ground of one cell, and where other things are from it.
#[derive(Debug)]
pub(super) struct Ground {
    pub(super) plan: Plan,
    pub(super) cell: usize,
    /// Chainage of the start of the cell, and that at which the whole street ends.
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) frame: Frame,
    /// Other parts of the street within reach.
    foreign: Vec<Frame>,
    /// Middle of the cell, metres from the street's origin, and direction of the axis there: the frame of the mesh.
    pub(super) origin: DVec3,
    turn: f64,
    /// Sections along the rows of the mesh.
    sections: Vec<Section>,
    /// What lies between kerb and pavement, and beyond it.
    soft: &'static str,
    /// Chainage of the middle of a zebra crossing.
    pub(super) zebra: Option<f64>,
}

impl Ground {
    pub(super) fn new(plan: Plan, axis: &mut Axis, cell: usize) -> Self {
        let (layout, frame, end) = (plan.layout(cell), axis.frame(cell), axis.end());
        let (start, Node { point, heading }) = (frame.start, frame.middle());
        let mut far = axis.near(start + CELL * 0.5, 180.0);
        // Only a street with an end comes back to itself. A frame reaches into the next cell: two cells lie between.
        far.retain(|far| end.is_finite() && (far + 3 < cell || *far > cell + 2));
        let rows = (((end - start).min(CELL) / ROW).ceil() as usize).max(1);
        let mut random = sequence(plan.seed, 5, cell as u64);
        Self {
            plan,
            cell,
            start,
            end,
            frame,
            foreign: far.into_iter().map(|far| axis.frame(far)).collect(),
            origin: point.extend(plan.land.height(point)),
            turn: heading,
            sections: (0..=rows).map(|row| plan.section(start + row as f64 * ROW)).collect(),
            soft: if layout.paved { "paving" } else { "grass" },
            zebra: random.random_bool(layout.crossing).then(|| start + random.random_range(14.0..=40.0)),
        }
    }

    /// The point of the ground at chainage `s` and `offset` (left positive), metres from the street's origin.
    pub(super) fn at(&self, s: f64, offset: f64) -> DVec3 {
        self.frame.at(s).left(offset).extend(self.plan.height(&self.frame, s, offset))
    }

    /// The nearest other part of the street to a point, and its chainage and offset there.
    pub(super) fn elsewhere(&self, point: DVec2) -> Option<(&Frame, (f64, f64))> {
        let places = self.foreign.iter().map(|frame| (frame, frame.nearest(point)));
        let there = places.filter(|(_, (s, _))| *s <= self.end);
        there.min_by(|(_, (_, a)), (_, (_, b))| a.abs().total_cmp(&b.abs()))
    }

    /// A point of the mesh in its frame, and whether it lies well within another part of the street: where that is nearer
    /// to its axis, its height counts.
    fn vertex(&self, s: f64, offset: f64) -> (Vec3, bool) {
        let mut point = self.at(s, offset);
        let mut nearer = 0.0;
        if let Some((frame, (s, other))) = self.elsewhere(point.truncate())
            && other.abs() < offset.abs()
        {
            point.z = self.plan.height(frame, s, other);
            nearer = offset.abs() - other.abs();
        }
        let local = DQuat::from_rotation_z(-self.turn) * (point - self.origin);
        (local.as_vec3(), nearer > 3.0)
    }

    /// The surface, and the turn from its frame to the street's.
    pub(super) fn mesh(&self) -> (Model, Mat3A) {
        let row = |(row, section): (usize, &Section)| {
            let s = self.start + row as f64 * ROW;
            section.breaks().map(|offset| self.vertex(s, offset)).collect::<Vec<_>>()
        };
        let rows: Vec<_> = self.sections.iter().enumerate().map(row).collect();
        let mut primitives = Vec::new();
        for pair in rows.windows(2) {
            for (here, next) in pair[0].windows(2).zip(pair[1].windows(2)) {
                let corners = [here[0], here[1], next[0], next[1]];
                // What lies well within another part of the street is that part's.
                if !corners.iter().all(|(_, far)| *far) {
                    let [a, b, c, d] = corners.map(|(point, _)| point);
                    let halves = [[a, b, c], [d, c, b]].map(Shape::Triangle);
                    primitives.extend(halves.map(|half| half.of("asphalt")));
                }
            }
        }
        (Model::new(primitives), Mat3A::from_rotation_z(self.turn as f32))
    }

    /// The material at a point of the mesh, in the mesh's frame.
    pub(super) fn material(&self, point: Vec3) -> &'static Material {
        let local = point.as_dvec3().truncate();
        let point = self.origin.truncate() + DVec2::from_angle(self.turn).rotate(local);
        let mut place = DVec2::new(self.start + CELL * 0.5 + local.x, 0.0);
        // Two steps of projection onto the tangent: enough for bends of more than 50 m radius.
        for _ in 0..2 {
            let s = place.x.clamp(self.start, self.start + CELL);
            place = DVec2::new(s, 0.0) + self.frame.at(s).local(point);
        }
        let row = ((place.x - self.start) / ROW).max(0.0) as usize;
        material(self.material_at(&self.sections[row.min(self.sections.len() - 1)], place.x, place.y))
    }

    fn material_at(&self, section: &Section, s: f64, offset: f64) -> &'static str {
        let d = offset.abs();
        let near = |line: f64| (d - line).abs() < 0.07;
        let zebra = self.zebra.is_some_and(|zebra| (s - zebra).abs() < 1.8 && offset.rem_euclid(1.0) < 0.5);
        let centre = section.median < 0.3 && (d - 0.13).abs() < 0.06;
        let edge = near(section.lanes - 0.1) || (section.median >= 0.3 && near(section.median + 0.3));
        let count = ((section.lanes - section.median) / section.lane).round() as i32;
        let mut between = (1..count).map(|lane| section.median + f64::from(lane) * section.lane);
        match d {
            d if d < section.median => "grass",
            d if d <= section.kerb - 0.02 => {
                let painted = zebra || centre || edge || (s.rem_euclid(9.0) < 3.0 && between.any(near));
                if painted { "marking" } else { "asphalt" }
            }
            d if d <= section.kerb + 0.15 => "paving",
            d if d >= section.verge && d < section.walk => "paving",
            _ => self.soft,
        }
    }
}
