//! The cross-section of the street and the surface of the ground of one cell: height, mesh, and what lies where.

use std::array;

use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, DVec2, DVec3, Vec3};
use serde::Deserialize;

use super::axis::{Axis, CELL, Frame, Land, Node};
use super::material::Material;
use super::preset::Plan;
use super::scene::Model;
use super::shape::{Primitive, Shape};

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

    /// Distances from the axis at which the profile bends.
    fn breaks(&self) -> impl DoubleEndedIterator<Item = f64> + Clone {
        let (m, k, w) = (self.median, self.kerb, self.walk);
        let street = [m, m + FACE, (m + k) * 0.5, k, k + FACE, self.verge.max(k + 2.0 * FACE), w, w + FACE];
        let beyond = [2.0, 5.0, 9.0, 15.0, 24.0, 36.0, 55.0].map(|d| w + d);
        street.into_iter().chain(beyond)
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
    /// The axis in the cell and the next one.
    pub(super) frame: Frame,
    own: Frame,
    /// Other parts of a street that comes back to itself, within reach.
    foreign: Vec<Frame>,
    /// Middle of the cell, metres from the street's origin, and direction of the axis there: the frame of the mesh.
    pub(super) origin: DVec3,
    turn: f64,
    /// Sections along the rows of the mesh.
    sections: Vec<Section>,
    /// What lies between kerb and pavement, and beyond it.
    pub(super) soft: Material,
    /// Chainage of a zebra crossing.
    pub(super) zebra: Option<f64>,
}

impl Ground {
    pub(super) fn new(plan: Plan, axis: &mut Axis, cell: usize) -> Self {
        let (start, end) = (cell as f64 * CELL, axis.end());
        let frame = axis.frame(cell..cell + 2);
        let middle = frame.at(start + CELL * 0.5);
        let cells = if end.is_finite() { (end / CELL).ceil() as usize } else { 0 };
        let mut foreign: Vec<Frame> =
            (0..cells).filter(|far| far.abs_diff(cell) > 2).map(|far| axis.frame(far..far + 1)).collect();
        foreign.retain(|far| far.at(far.start + CELL * 0.5).point.distance(middle.point) < 180.0);
        let rows = (((end - start).min(CELL) / ROW).ceil() as usize).max(1);
        Self {
            plan,
            cell,
            start,
            end,
            frame,
            own: axis.frame(cell..cell + 1),
            foreign,
            origin: middle.point.extend(plan.land.height(middle.point)),
            turn: middle.heading,
            sections: (0..=rows).map(|row| plan.section(start + row as f64 * ROW)).collect(),
            soft: if plan.layout(cell).paved { Material::Paving } else { Material::Grass },
            zebra: None,
        }
    }

    /// The point of the ground at chainage `s` and `offset` (left positive), metres from the street's origin.
    pub(super) fn at(&self, s: f64, offset: f64) -> DVec3 {
        self.frame.at(s).left(offset).extend(self.plan.height(&self.frame, s, offset))
    }

    /// Where a point is from the nearest other part of the street: chainage, offset, and the axis there.
    pub(super) fn elsewhere(&self, point: DVec2) -> Option<(f64, f64, &Frame)> {
        let places = self.foreign.iter().map(|frame| {
            let (s, offset) = frame.nearest(point);
            (s, offset, frame)
        });
        places.filter(|(s, ..)| *s <= self.end).min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// The surface, and the map from its frame to the cell's. Where another part of the street is nearer to its axis, its
    /// height counts.
    pub(super) fn mesh(&self) -> (Model, Affine3A) {
        let vertex = |row: usize, offset: f64| {
            let s = self.start + row as f64 * ROW;
            let own = self.own.at(s).left(offset).extend(self.plan.height(&self.own, s, offset));
            let other = self.elsewhere(own.truncate()).filter(|(_, other, _)| other.abs() < offset.abs());
            let (z, far) = other.map_or((own.z, false), |(s, other, frame)| {
                (self.plan.height(frame, s, other), offset.abs() > other.abs() + 3.0)
            });
            let local = DVec2::from_angle(-self.turn).rotate(own.truncate() - self.origin.truncate());
            (local.extend(z - self.origin.z).as_vec3(), far)
        };
        let mesh = self.sections.iter().enumerate().map(|(row, section)| {
            let right = section.breaks();
            let offsets = right.clone().rev().map(|d| -d).chain([0.0]).chain(right);
            offsets.map(|offset| vertex(row, offset)).collect()
        });
        let model = Model::new(triangles(&mesh.collect::<Vec<_>>()));
        (model, Affine3A::from_rotation_z(self.turn as f32))
    }

    /// The material at a point of the mesh, in the mesh's frame.
    pub(super) fn material(&self, point: Vec3) -> Material {
        let local = point.as_dvec3().truncate();
        let point = self.origin.truncate() + DVec2::from_angle(self.turn).rotate(local);
        let mut place = DVec2::new(self.start + CELL * 0.5 + local.x, 0.0);
        // Two steps of projection onto the tangent: enough for bends of more than 50 m radius.
        for _ in 0..2 {
            let s = place.x.clamp(self.start, self.start + CELL);
            place = DVec2::new(s, 0.0) + self.own.at(s).local(point);
        }
        let row = ((place.x - self.start) / ROW).max(0.0) as usize;
        self.material_at(&self.sections[row.min(self.sections.len() - 1)], place.x, place.y)
    }

    fn material_at(&self, section: &Section, s: f64, offset: f64) -> Material {
        let d = offset.abs();
        let near = |line: f64| (d - line).abs() < 0.07;
        let zebra = self.zebra.is_some_and(|z| s > z && s < z + 3.6 && offset.rem_euclid(1.0) < 0.5);
        let centre = section.median < 0.3 && (d - 0.13).abs() < 0.06;
        let edge = near(section.lanes - 0.1) || (section.median >= 0.3 && near(section.median + 0.3));
        let count = ((section.lanes - section.median) / section.lane).round() as i32;
        let mut between = (1..count).map(|lane| section.median + f64::from(lane) * section.lane);
        match d {
            d if d < section.median => Material::Grass,
            d if d <= section.kerb - 0.02 => {
                let painted = zebra || centre || edge || (s.rem_euclid(9.0) < 3.0 && between.any(near));
                if painted { Material::Marking } else { Material::Asphalt }
            }
            d if d <= section.kerb + 0.15 => Material::Paving,
            d if d >= section.verge && d < section.walk => Material::Paving,
            _ => self.soft,
        }
    }
}

/// Two triangles per mesh of the net; none where another part of the street owns all corners or where the area is 0.
fn triangles(mesh: &[Vec<(Vec3, bool)>]) -> Vec<Primitive> {
    let mut primitives = Vec::new();
    for rows in mesh.windows(2) {
        for column in 1..rows[0].len() {
            let corners = [rows[0][column - 1], rows[0][column], rows[1][column - 1], rows[1][column]];
            if corners.iter().all(|(_, far)| *far) {
                continue;
            }
            let [a, b, c, d] = corners.map(|(point, _)| point);
            for [a, b, c] in [[a, b, c], [d, c, b]] {
                let (u, v) = (b - a, c - a);
                if u.cross(v).length_squared() > 1e-8 {
                    primitives.push(Primitive {
                        shape: Shape::Sheet { a, u, v, half: true },
                        material: Material::Asphalt,
                    });
                }
            }
        }
    }
    primitives
}
