//! True measures of trees and poles, from the placed models: the values that an inventory should find.

use glam::{Mat3A, Vec3, Vec3A};

use crate::model::convex_hull;
use crate::synth::scene::model::Model;
use crate::synth::scene::shape::Shape;

/// Classes of objects whose stems are known.
const TREE: u8 = 2;
const POLE: u8 = 3;
/// Breast height over the foot, metres.
const BREAST_HEIGHT: f32 = 1.3;
/// Largest height over the foot to which the stem of a tree is followed, metres.
const STEM_HEIGHT: f32 = 4.0;
/// Distance below which two ends are the same joint, metres.
const JOINT: f32 = 1e-4;

/// The true measures of a tree or a pole; `None` if it does not have one.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Truth {
    /// Mean of the longest extent of leaves and branches in the plane and of the extent across it, metres.
    pub(crate) crown_diameter: Option<f64>,
    /// Diameter of the stem at breast height, metres.
    pub(crate) dbh: Option<f64>,
    /// Angle of the stem or pole from the vertical, and direction in which it leans, clockwise from north,
    /// degrees.
    pub(crate) inclination: Option<[f64; 2]>,
}

impl Truth {
    /// The true measures of a model that is turned and stretched by `turn`. The foot of the model is its
    /// origin.
    pub(crate) fn of(class: u8, model: &Model, turn: Mat3A) -> Self {
        if ![TREE, POLE].contains(&class) {
            return Self::default();
        }
        let stem = stem(model, turn);
        let dbh =
            stem.windows(2).find(|ends| (ends[0].0.z..ends[1].0.z).contains(&BREAST_HEIGHT)).map(|ends| {
                let share = (BREAST_HEIGHT - ends[0].0.z) / (ends[1].0.z - ends[0].0.z);
                f64::from(2.0 * (ends[0].1 + (ends[1].1 - ends[0].1) * share))
            });
        let limit = if class == TREE { STEM_HEIGHT } else { f32::INFINITY };
        let inclination = stem.first().zip(end_below(&stem, limit)).map(|(first, last)| {
            let way = last - first.0;
            let lean = f64::from(way.truncate().length()).atan2(f64::from(way.z)).to_degrees();
            [lean, f64::from(way.x).atan2(f64::from(way.y)).to_degrees().rem_euclid(360.0)]
        });
        let crown_diameter = (class == TREE).then(|| crown_diameter(model, turn));
        Self { crown_diameter, dbh: dbh.filter(|_| class == TREE), inclination }
    }
}

/// The place of a stem at this height, or its end if it ends below.
fn end_below(stem: &[(Vec3, f32)], height: f32) -> Option<Vec3> {
    let ends = stem.windows(2).find(|ends| ends[1].0.z > height);
    match ends {
        Some(ends) => {
            let share = (height - ends[0].0.z) / (ends[1].0.z - ends[0].0.z);
            Some(ends[0].0.lerp(ends[1].0, share))
        }
        None => stem.last().map(|end| end.0).filter(|_| stem.len() > 1),
    }
}

/// The rods from the origin on, each the thickest one at the end of the previous one: their joints and the
/// horizontal radii there, turned and stretched.
fn stem(model: &Model, turn: Mat3A) -> Vec<(Vec3, f32)> {
    let wide = (turn * Vec3A::X).length();
    let mut joints: Vec<(Vec3, f32)> = Vec::new();
    let mut at = Vec3::ZERO;
    loop {
        let next = model
            .primitives
            .iter()
            .filter_map(|part| match part.shape {
                Shape::Rod(from, to, radii) if from.distance(at) < JOINT && to.z > from.z => {
                    Some((from, to, radii))
                }
                _ => None,
            })
            .max_by(|a, b| a.2[0].total_cmp(&b.2[0]));
        let Some((from, to, radii)) = next else { return joints };
        if joints.is_empty() {
            joints.push((Vec3::from(turn * Vec3A::from(from)), radii[0] * wide));
        }
        joints.push((Vec3::from(turn * Vec3A::from(to)), radii[1] * wide));
        at = to;
    }
}

/// Mean of the longest extent of all parts in the plane and of the extent across it.
fn crown_diameter(model: &Model, turn: Mat3A) -> f64 {
    let mut places: Vec<[i64; 2]> = Vec::new();
    let mut add = |place: Vec3| {
        let place = turn * Vec3A::from(place);
        places.push([place.x, place.y].map(|value| (value * 1_000.0).round() as i64));
    };
    for part in &model.primitives {
        match part.shape {
            Shape::Rod(from, to, _) => [from, to].into_iter().for_each(&mut add),
            // Points are equally often on either side of the centre of a leaf.
            Shape::Disc(centre, ..) | Shape::Ball(centre, _) => add(centre),
            Shape::Block(low, high) => [low, high].into_iter().for_each(&mut add),
            Shape::Triangle(corners) => corners.into_iter().for_each(&mut add),
        }
    }
    let hull = convex_hull(&mut places);
    let mut longest = (0.0, [1.0, 0.0]);
    for (number, a) in hull.iter().enumerate() {
        for b in &hull[number + 1..] {
            let way = [0, 1].map(|k| (b[k] - a[k]) as f64);
            let length = way[0].hypot(way[1]);
            if length > longest.0 {
                longest = (length, way.map(|value| value / length));
            }
        }
    }
    let (length, [x, y]) = longest;
    let across = |place: &[i64; 2]| place[1] as f64 * x - place[0] as f64 * y;
    let least = hull.iter().map(across).fold(f64::INFINITY, f64::min);
    let most = hull.iter().map(across).fold(f64::NEG_INFINITY, f64::max);
    f64::midpoint(length, most - least) / 1_000.0
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn a_leaning_stem_with_a_crown_is_measured_from_its_parts() {
        let rod = |from, to, radii| Shape::Rod(from, to, radii).of("bark");
        let joint = vec3(0.1, 0.0, 2.0);
        let model = Model::new(vec![
            rod(Vec3::ZERO, joint, [0.2, 0.1]),
            rod(joint, vec3(0.2, 0.0, 4.0), [0.1, 0.05]),
            // A branch at the joint, thinner than the stem.
            rod(joint, vec3(3.0, 0.0, 3.0), [0.03, 0.01]),
            Shape::Disc(vec3(-1.0, 0.0, 4.0), Vec3::Z, 0.1).of("leaf"),
            Shape::Disc(vec3(1.0, 1.0, 4.0), Vec3::Z, 0.1).of("leaf"),
        ]);
        let near = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-3, "{found} and not {expected}")
        };
        let truth = Truth::of(TREE, &model, Mat3A::IDENTITY);
        near(truth.dbh.unwrap(), 2.0 * (0.2 - 0.1 * 0.65));
        near(truth.inclination.unwrap()[0], 0.05_f64.atan().to_degrees());
        near(truth.inclination.unwrap()[1], 90.0);
        // 4 m along the branch, 1 m across.
        near(truth.crown_diameter.unwrap(), 2.5);
        // Turned to the north, half as high and twice as wide.
        let turn =
            Mat3A::from_rotation_z(std::f32::consts::FRAC_PI_2) * Mat3A::from_diagonal(vec3(2.0, 2.0, 0.5));
        let turned = Truth::of(TREE, &model, turn);
        near(turned.crown_diameter.unwrap(), 5.0);
        near(turned.inclination.unwrap()[0], 0.2_f64.atan().to_degrees());
        assert!(turned.inclination.unwrap()[1] < 1e-3 || turned.inclination.unwrap()[1] > 359.999);
        // Breast height is 2.6 m in the model.
        near(turned.dbh.unwrap(), 2.0 * 2.0 * (0.1 - 0.05 * 0.3));
        let pole = Truth::of(POLE, &model, Mat3A::IDENTITY);
        assert!(pole.dbh.is_none() && pole.crown_diameter.is_none() && pole.inclination.is_some());
        assert_eq!(Truth::of(5, &model, Mat3A::IDENTITY), Truth::default());
    }
}
