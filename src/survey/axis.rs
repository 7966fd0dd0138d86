//! The axis of the drive: a polyline in the plane along which chainage is measured. Of the results, only
//! columns of the object table depend on it: chainage and offset, clearances over the roadway, and the fronts
//! of buildings, where these stand. Tiles follow it only to be compact.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::spatial::NearestIndex;
use crate::survey::runs::{CORRIDOR_M, distance, tracks};

/// Distance between vertices of the axis in metres. It is the resolution of chainage along tiles.
pub(super) const VERTEX_SPACING_M: f64 = 1.0;
/// Length of the axis behind a vertex that belongs to its own stretch and not to an earlier one, in metres.
const OWN_STRETCH_M: f64 = 40.0;
/// Longest axis in metres. A longer one results from absurd positions.
pub(super) const LONGEST_AXIS_M: f64 = 5e6;

/// The source of the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum AxisSource {
    /// A trajectory file.
    Trajectory,
    /// The mean position of the points of each half second of GPS time, smoothed.
    GpsTime,
    /// The principal axis of the occupied cells.
    Principal,
}

/// The axis: vertices about 1 m apart, in metres of the run's world frame, with their chainage.
#[derive(Debug)]
pub struct Axis {
    /// Its source.
    pub source: AxisSource,
    pub(super) vertices: Vec<[f64; 2]>,
    pub(super) chainage: Vec<f64>,
    /// Whether a vertex is connected to the next one. Omitted stretches leave gaps.
    pub(super) joined: Vec<bool>,
    /// Length of the extension of each end of a stretch that borders a gap in the recording, in metres.
    pub(super) reach: BTreeMap<usize, f64>,
    index: NearestIndex,
}

impl Axis {
    /// The axis along positions in metres that were driven without a gap; `None` if they have no length.
    #[must_use]
    pub fn from_positions(source: AxisSource, positions: &[[f64; 2]]) -> Option<Self> {
        Self::from_runs(source, vec![positions.to_vec()])
    }

    /// The axis along runs of positions in metres, in the order of the drive, with a gap in the recording
    /// after each. `None` if they have no length, or an absurd one.
    #[must_use]
    pub fn from_runs(source: AxisSource, runs: Vec<Vec<[f64; 2]>>) -> Option<Self> {
        let tracks = tracks(runs);
        let length =
            |track: &Vec<[f64; 2]>| track.windows(2).map(|pair| distance(pair[0], pair[1])).sum::<f64>();
        let total: f64 = tracks.iter().map(length).sum();
        if !(total > 0.0 && total <= LONGEST_AXIS_M) {
            return None;
        }
        let resampled: Vec<Vec<[f64; 2]>> =
            tracks.into_iter().map(|track| resample(&track).unwrap_or_else(|| vec![track[0]])).collect();
        let mut axis = first_passes(&resampled);
        // Chainage starts where the drive starts. If the drive is one stretch, chainage is in metres along
        // the road.
        axis.source = source;
        Some(axis)
    }

    pub(super) fn assemble(
        source: AxisSource,
        vertices: Vec<[f64; 2]>,
        chainage: Vec<f64>,
        joined: Vec<bool>,
    ) -> Self {
        let index = NearestIndex::new(&vertices);
        Self { source, vertices, chainage, joined, reach: BTreeMap::new(), index }
    }

    /// Its memory in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let vertex = size_of::<[f64; 2]>() + size_of::<f64>() + size_of::<bool>();
        let extension = size_of::<usize>() + size_of::<f64>();
        (self.vertices.len() * vertex + self.reach.len() * extension) as u64 + self.index.bytes()
    }

    /// Vertices in metres.
    #[must_use]
    pub fn vertices(&self) -> &[[f64; 2]] {
        &self.vertices
    }

    /// Stretches of connected vertices.
    pub fn stretches(&self) -> impl Iterator<Item = &[[f64; 2]]> {
        let mut start = 0;
        (0..self.vertices.len()).filter_map(move |k| {
            let ends = k + 1 == self.vertices.len() || !self.joined[k];
            ends.then(|| &self.vertices[std::mem::replace(&mut start, k + 1)..=k])
        })
    }

    /// A hash of vertices, chainage and extensions.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        for (vertex, chainage) in self.vertices.iter().zip(&self.chainage) {
            [vertex[0], vertex[1], *chainage].iter().for_each(|value| hasher.update(&value.to_le_bytes()));
        }
        for (&vertex, reach) in &self.reach {
            hasher.update(&(vertex as u64).to_le_bytes());
            hasher.update(&reach.to_le_bytes());
        }
        hasher.digest()
    }

    /// A vertex about every `spacing_m` metres of chainage, with its chainage.
    pub fn marks(&self, spacing_m: f64) -> impl Iterator<Item = ([f64; 2], f64)> {
        let mut due = 0.0;
        self.vertices.iter().zip(&self.chainage).filter_map(move |(vertex, &chainage)| {
            // A mark may come half a vertex early, because chainage is a sum of steps: 50 m may be
            // 49.9999999.
            if chainage + 0.5 * VERTEX_SPACING_M < due {
                return None;
            }
            due += spacing_m * ((chainage - due) / spacing_m).floor().max(0.0) + spacing_m;
            Some((*vertex, chainage))
        })
    }

    /// Length in metres: chainage of the last vertex.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.chainage.last().copied().unwrap_or(0.0)
    }

    /// Chainage of the vertices in metres, ascending.
    #[must_use]
    pub fn chainage_m(&self) -> &[f64] {
        &self.chainage
    }

    /// The vertex nearest to a place in metres; an axis has at least one.
    #[must_use]
    pub fn nearest(&self, place: [f64; 2]) -> usize {
        self.index.nearest(place).unwrap_or(0)
    }
}

/// Vertices about [`VERTEX_SPACING_M`] apart along `positions`; `None` if the line has no length or an absurd
/// one.
pub(super) fn resample(positions: &[[f64; 2]]) -> Option<Vec<[f64; 2]>> {
    let total: f64 = positions.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
    if !(total > 0.0 && total <= LONGEST_AXIS_M) {
        return None;
    }
    let mut vertices = vec![positions[0]];
    let mut due = VERTEX_SPACING_M;
    let mut walked = 0.0;
    for pair in positions.windows(2) {
        let step = distance(pair[0], pair[1]);
        while due <= walked + step && step > 0.0 {
            let share = (due - walked) / step;
            vertices.push([0, 1].map(|k| pair[0][k] + share * (pair[1][k] - pair[0][k])));
            due += VERTEX_SPACING_M;
        }
        walked += step;
    }
    let last = positions[positions.len() - 1];
    if distance(vertices[vertices.len() - 1], last) > 0.0 {
        vertices.push(last);
    }
    Some(vertices)
}

/// The axis without the stretches that run along an earlier one. A street that is driven twice then has one
/// chainage, and its tiles are whole strips, not a checkerboard of two passes.
fn first_passes(tracks: &[Vec<[f64; 2]>]) -> Axis {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "grid of corridor width over at most 5,000 km of axis"
    )]
    let bucket = |place: [f64; 2]| place.map(|value| (value / CORRIDOR_M).floor() as i64);
    let mut kept: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    let mut vertices = Vec::new();
    let mut chainage = Vec::new();
    let mut joined = Vec::new();
    let mut driven = 0.0;
    let mut driven_at: Vec<f64> = Vec::new();
    let mut counted = 0.0;
    let mut on_axis = false;
    let mut reach = BTreeMap::new();
    let mut before: Option<[f64; 2]> = None;
    let places = tracks.iter().flat_map(|track| track.iter().enumerate());
    for (k, &place) in places {
        let step = before.replace(place).map_or(0.0, |before| distance(before, place));
        driven += step;
        if k == 0 {
            // All earlier tracks are earlier stretches. The vehicle drove at least straight to this one.
            driven += OWN_STRETCH_M;
            if on_axis {
                reach.insert(vertices.len() - 1, step / 2.0);
            }
            on_axis = false;
            counted += if vertices.is_empty() { 0.0 } else { (step - VERTEX_SPACING_M).max(0.0) };
        }
        let [i, j] = bucket(place);
        let earlier = (i - 1..=i + 1).flat_map(|a| (j - 1..=j + 1).map(move |b| [a, b])).any(|near| {
            kept.get(&near).is_some_and(|list| {
                list.iter().any(|&other: &usize| {
                    driven - driven_at[other] > OWN_STRETCH_M && distance(vertices[other], place) < CORRIDOR_M
                })
            })
        });
        if earlier {
            on_axis = false;
            continue;
        }
        if on_axis {
            counted += step;
            if let Some(last) = joined.last_mut() {
                *last = true;
            }
        } else if !vertices.is_empty() {
            // A gap counts as one step, so that chainage increases strictly across stretches.
            counted += VERTEX_SPACING_M;
        }
        on_axis = true;
        if k == 0 && !vertices.is_empty() {
            reach.insert(vertices.len(), step / 2.0);
        }
        kept.entry([i, j]).or_default().push(vertices.len());
        vertices.push(place);
        driven_at.push(driven);
        chainage.push(counted);
        joined.push(false);
    }
    Axis { reach, ..Axis::assemble(AxisSource::Trajectory, vertices, chainage, joined) }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Positions along a straight line.
    pub(in crate::survey) fn straight(from: f64, to: f64, y: f64) -> Vec<[f64; 2]> {
        let count = 50;
        (0..=count).map(|k| [from + (to - from) * f64::from(k) / f64::from(count), y]).collect()
    }

    #[test]
    fn a_street_driven_twice_has_one_chainage() {
        let mut there_and_back = straight(0.0, 200.0, 0.0);
        there_and_back.extend(straight(200.0, 0.0, 4.0));
        let axis = Axis::from_positions(AxisSource::Trajectory, &there_and_back).unwrap();
        // The first `OWN_STRETCH_M` after the turn count, too.
        assert!(axis.length_m() < 200.0 + 2.0 * OWN_STRETCH_M, "{}", axis.length_m());
        assert!((axis.chainage_m()[axis.nearest([20.0, 4.0])] - 20.0).abs() <= 1.0);
    }

    #[test]
    fn two_streets_are_two_stretches() {
        let mut drive = straight(0.0, 100.0, 0.0);
        drive.extend(straight(100.0, 0.0, 1.0));
        drive.extend(straight(0.0, -100.0, 0.0));
        let axis = Axis::from_positions(AxisSource::Trajectory, &drive).unwrap();
        assert!(axis.stretches().count() >= 2);
        assert!(axis.chainage.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
