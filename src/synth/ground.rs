//! The cross-section of the street and the surface of the ground of one cell: height, mesh, and what lies where.

use glam::{Affine3A, Vec3};
use serde::Deserialize;

use super::axis::{CELL, Frame, Land};
use super::material::Material;
use super::scene::Model;
use super::shape::{Primitive, Shape};

/// Distance between rows of the mesh, metres.
const ROW: f64 = 2.0;
/// Width of a kerb's face or of another step, metres.
const FACE: f64 = 0.03;
/// How far from the axis the land over the axis has become the land itself, beyond the pavement, metres.
const BLEND: f64 = 25.0;

/// Half of a cross-section; all widths are distances from the axis, metres, not falling from one to the next.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
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
}

impl Section {
    /// Between two sections, `w` 0 to 1.
    pub(super) fn between(&self, other: &Self, w: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * w;
        Self {
            median: mix(self.median, other.median),
            lanes: mix(self.lanes, other.lanes),
            kerb: mix(self.kerb, other.kerb),
            verge: mix(self.verge, other.verge),
            walk: mix(self.walk, other.walk),
            kerb_height: mix(self.kerb_height, other.kerb_height),
            slopes: mix(self.slopes, other.slopes),
            lane: mix(self.lane, other.lane),
        }
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
}

fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// One station of the street, as far as the ground is concerned.
#[derive(Debug, Clone, Copy)]
pub(super) struct Station {
    pub(super) section: Section,
    /// How far the land beside the pavement is below it: a bridge over a dip, metres.
    pub(super) dip: f64,
    /// Height gained by the slopes on the left and on the right, metres.
    pub(super) slopes: [f64; 2],
}

impl Station {
    /// Height of the ground at `offset` (left positive) from the axis at chainage `s` of `frame`.
    pub(super) fn height(&self, land: &Land, frame: &Frame, s: f64, offset: f64) -> f64 {
        let node = frame.at(s);
        let d = offset.abs();
        let beyond = d - self.section.walk;
        let [x, y] = node.left(offset);
        let over = smooth(beyond / BLEND);
        let base = land.height(node.x, node.y) * (1.0 - over) + land.height(x, y) * over;
        let slope = self.slopes[usize::from(offset < 0.0)] * smooth((beyond - 2.0) / 12.0);
        base + self.section.profile(d) + slope - self.dip * (beyond / FACE).clamp(0.0, 1.0)
    }
}

/// What is painted on the road and laid beside it, in one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surfacing {
    pub(super) verge: Material,
    pub(super) yard: Material,
    /// Chainage of a zebra crossing.
    pub(super) zebra: Option<f64>,
}

/// The ground of one cell.
#[derive(Debug)]
pub(super) struct Ground {
    frame: Frame,
    sections: Vec<Section>,
    surfacing: Surfacing,
    origin: [f64; 2],
    turn: f64,
}

/// For a point of the plane: height of the ground and distance from the axis as another part of the street gives them.
pub(super) type Elsewhere<'a> = &'a dyn Fn(f64, f64) -> Option<(f64, f64)>;

impl Ground {
    /// The ground of `frame` up to chainage `end`, its mesh, and the map from the mesh's frame to the cell's.
    ///
    /// Where `elsewhere` is nearer to its axis, its height counts.
    pub(super) fn build(
        land: &Land,
        frame: &Frame,
        origin: [f64; 3],
        stations: &dyn Fn(f64) -> Station,
        surfacing: Surfacing,
        end: f64,
        elsewhere: Elsewhere<'_>,
    ) -> (Self, Model, Affine3A) {
        let start = frame.start();
        let rows = (((end - start).min(CELL) / ROW).ceil() as usize).max(1);
        let turn = frame.at(start + CELL * 0.5).heading;
        let (sin, cos) = turn.sin_cos();
        let mut sections = Vec::new();
        let mut mesh: Vec<Vec<(Vec3, bool)>> = Vec::new();
        for row in 0..=rows {
            let s = start + row as f64 * ROW;
            let station = stations(s);
            sections.push(station.section);
            let right = station.section.breaks();
            let offsets = right.clone().rev().map(|d| -d).chain([0.0]).chain(right);
            let vertex = |offset: f64| {
                let [x, y] = frame.at(s).left(offset);
                let own = station.height(land, frame, s, offset);
                let other = elsewhere(x, y).filter(|(_, distance)| *distance < offset.abs());
                let (z, far) = other.map_or((own, false), |(z, distance)| (z, offset.abs() > distance + 3.0));
                let (dx, dy) = (x - origin[0], y - origin[1]);
                let local = [dx * cos + dy * sin, dy * cos - dx * sin, z - origin[2]];
                (Vec3::from(local.map(|v| v as f32)), far)
            };
            mesh.push(offsets.map(vertex).collect());
        }
        let model = Model::new(triangles(&mesh));
        let ground = Self { frame: frame.clone(), sections, surfacing, origin: [origin[0], origin[1]], turn };
        (ground, model, Affine3A::from_rotation_z(turn as f32))
    }

    /// The material at a point of the mesh, in the mesh's frame.
    pub(super) fn material(&self, point: Vec3) -> Material {
        let (sin, cos) = self.turn.sin_cos();
        let (px, py) = (f64::from(point.x), f64::from(point.y));
        let (x, y) = (self.origin[0] + px * cos - py * sin, self.origin[1] + px * sin + py * cos);
        let mut s = self.frame.start() + CELL * 0.5 + px;
        let mut offset = 0.0;
        // Two steps of projection onto the tangent: enough for bends of more than 50 m radius.
        for _ in 0..2 {
            let node = self.frame.at(s.clamp(self.frame.start(), self.frame.start() + CELL));
            let (sin, cos) = node.heading.sin_cos();
            let (dx, dy) = (x - node.x, y - node.y);
            s = s.clamp(self.frame.start(), self.frame.start() + CELL) + dx * cos + dy * sin;
            offset = dy * cos - dx * sin;
        }
        let row = ((s - self.frame.start()) / ROW).max(0.0) as usize;
        self.material_at(&self.sections[row.min(self.sections.len() - 1)], s, offset)
    }

    fn material_at(&self, section: &Section, s: f64, offset: f64) -> Material {
        let d = offset.abs();
        if d < section.median {
            return Material::Grass;
        }
        if d > section.kerb + 0.15 {
            return match d {
                d if d < section.verge => self.surfacing.verge,
                d if d < section.walk => Material::Paving,
                _ => self.surfacing.yard,
            };
        }
        if d > section.kerb - 0.02 {
            return Material::Paving;
        }
        let dash = |on: f64, period: f64| s.rem_euclid(period) < on;
        let near = |line: f64| (d - line).abs() < 0.07;
        let zebra =
            self.surfacing.zebra.is_some_and(|z| s > z && s < z + 3.6 && offset.rem_euclid(1.0) < 0.5);
        let centre = section.median < 0.3 && (d - 0.13).abs() < 0.06;
        let edge = near(section.lanes - 0.1) || (section.median >= 0.3 && near(section.median + 0.3));
        let count = ((section.lanes - section.median) / section.lane).round() as i32;
        let between =
            dash(3.0, 9.0) && (1..count).any(|lane| near(section.median + f64::from(lane) * section.lane));
        if zebra || centre || edge || between { Material::Marking } else { Material::Asphalt }
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
                    primitives.push(Shape::Triangle([a, b, c]).of(Material::Asphalt));
                }
            }
        }
    }
    primitives
}
