//! A straight axis, and lines through places.
//!
//! The direction of a steady line is the median of the slopes between pairs of places (Theil, 1950; Sen,
//! 1968, doi:10.1080/01621459.1968.10480934). Places are metres from the corner of the frame of the sketch.

use super::circle::length;

/// A straight axis: a place for every height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StemAxis {
    /// Where the axis is at height 0 of the frame.
    pub(crate) foot: [f64; 2],
    /// How far it moves per metre of height.
    pub(crate) slope: [f64; 2],
    /// Height at which it begins, in metres.
    pub(crate) from: f64,
    /// Height at which it ends, in metres.
    pub(crate) to: f64,
    /// Whether its direction is known well enough to be given.
    pub(crate) has_direction: bool,
}

impl StemAxis {
    /// Where the axis is at a height.
    pub(crate) fn at(&self, z: f64) -> [f64; 2] {
        [0, 1].map(|k| self.foot[k] + self.slope[k] * z)
    }

    /// A vertical axis where this one is at the middle of its height.
    pub(super) fn upright(self) -> Self {
        let foot = self.at(f64::midpoint(self.from, self.to));
        Self { foot, slope: [0.0; 2], has_direction: false, ..self }
    }

    /// Angle from the vertical in degrees.
    pub(crate) fn inclination_deg(&self) -> f64 {
        length(self.slope).atan().to_degrees()
    }

    /// Direction in which it leans, in degrees clockwise from north, 0 to 360.
    pub(crate) fn azimuth_deg(&self) -> f64 {
        self.slope[0].atan2(self.slope[1]).to_degrees().rem_euclid(360.0)
    }
}

/// The line through places (x, y, z) by least squares of x and y over z. Vertical if all places have the same
/// height.
pub(super) fn line(places: &[[f64; 3]]) -> Option<StemAxis> {
    let count = places.len() as f64;
    if places.is_empty() {
        return None;
    }
    let mean = [0, 1, 2].map(|k| places.iter().map(|place| place[k]).sum::<f64>() / count);
    let squares: f64 = places.iter().map(|place| (place[2] - mean[2]).powi(2)).sum();
    let slope = [0, 1].map(|k| {
        let products: f64 = places.iter().map(|place| (place[k] - mean[k]) * (place[2] - mean[2])).sum();
        if squares > 1e-6 { products / squares } else { 0.0 }
    });
    let foot = [0, 1].map(|k| mean[k] - slope[k] * mean[2]);
    let from = places.iter().map(|place| place[2]).fold(f64::INFINITY, f64::min);
    let to = places.iter().map(|place| place[2]).fold(f64::NEG_INFINITY, f64::max);
    Some(StemAxis { foot, slope, from, to, has_direction: true })
}

/// The line through places whose slope is the median of the slopes of pairs. The heights of a pair differ by
/// at least `apart` times the height of the line.
pub(super) fn steady_line(places: &[[f64; 3]], apart: f64) -> Option<StemAxis> {
    let ends = line(places)?;
    let least = (ends.to - ends.from) * apart;
    let slope = [0, 1].map(|k| {
        let mut slopes = Vec::new();
        for (number, a) in places.iter().enumerate() {
            let far = places[number + 1..].iter().filter(|b| b[2] - a[2] >= least.max(f64::EPSILON));
            slopes.extend(far.map(|b| (b[k] - a[k]) / (b[2] - a[2])));
        }
        median(&mut slopes)
    });
    let foot = [0, 1].map(|k| {
        let mut feet: Vec<f64> = places.iter().map(|place| place[k] - slope[k] * place[2]).collect();
        median(&mut feet)
    });
    Some(StemAxis { foot, slope, ..ends })
}

/// The median; 0 without values.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => 0.0,
        odd if odd % 2 == 1 => values[half],
        _ => f64::midpoint(values[half - 1], values[half]),
    }
}
