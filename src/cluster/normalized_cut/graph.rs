//! The weighted graph of the voxels of an object (equation 1 of the paper), in rows of runs.
//!
//! The product of both Gaussians is one exponential of the sum of their exponents. Ours: a weight whose
//! vertical factor is below e^-9 (1.2e-4) is 0, so that the length of a row does not grow with the height of
//! the object; if d_H is below two edges, d_H and both sigmas grow with the voxels, so that coarse voxels
//! stay linked; a voxel has no link to itself.
#![expect(
    clippy::cast_possible_truncation,
    reason = "voxels of an object fit u32; distances are a few edges"
)]

use std::ops::Range;

use super::settings::NormalizedCutConfig;
use crate::cluster::columns::{Columns, Voxel};

/// Vertical distance beyond which weights are 0, in multiples of sigma_V.
const VERTICAL_REACH: f64 = 3.0;

/// Distances of equation 1 in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    d_h: f64,
    sigma_h: f64,
    sigma_v: f64,
    edge: f64,
}

impl Scale {
    /// The distances for voxels of `edge_m` metres.
    pub(super) fn new(config: &NormalizedCutConfig, edge_m: f64) -> Self {
        let factor = (2.0 * edge_m / config.link_radius_m).max(1.0);
        Self {
            d_h: config.link_radius_m * factor,
            sigma_h: config.horizontal_scale_m * factor,
            sigma_v: config.vertical_scale_m * factor,
            edge: edge_m,
        }
    }

    /// The weight between two centroids.
    #[inline]
    fn weight(&self, a: [f64; 3], b: [f64; 3]) -> f32 {
        let [dx, dy, dz] = [0, 1, 2].map(|axis| a[axis] - b[axis]);
        let across = dx * dx + dy * dy;
        if across > self.d_h * self.d_h || dz.abs() > VERTICAL_REACH * self.sigma_v {
            return 0.0;
        }
        exponential(-(across / (self.sigma_h * self.sigma_h) + dz * dz / (self.sigma_v * self.sigma_v)))
            as f32
    }
}

/// Voxels with consecutive numbers that cover the links of a voxel to one column.
#[derive(Debug, Clone, Copy)]
struct Run {
    start: u32,
    end: u32,
}

impl Run {
    fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A graph. The links of a voxel are stored as runs: voxels of one column have consecutive numbers, so a
/// product with a vector reads weights and values in order. A weight inside a run may be 0.
#[derive(Debug, Clone, Default)]
pub(super) struct Graph {
    /// First run and first weight of each voxel, and the ends.
    first: Vec<(usize, usize)>,
    runs: Vec<Run>,
    weight: Vec<f32>,
}

impl Graph {
    /// The graph of voxels with sorted keys and their centroids in metres.
    pub(super) fn of(keys: &[Voxel], centroids: &[[f64; 3]], scale: &Scale) -> Self {
        let columns = Columns::new(keys.iter().copied());
        let heights = columns.heights();
        let mut finder = columns.finder();
        // Centroids lie inside their voxels, so their distance can be up to one edge shorter than the
        // distance of their indices.
        let wide = (scale.d_h / scale.edge) as i32 + 1;
        let high = (VERTICAL_REACH * scale.sigma_v / scale.edge) as i32 + 1;
        let gap = |steps: i32| f64::from((steps.abs() - 1).max(0)) * scale.edge;
        let square: Vec<[i32; 2]> = (-wide..=wide)
            .flat_map(|di| (-wide..=wide).map(move |dj| [di, dj]))
            .filter(|[di, dj]| gap(*di).powi(2) + gap(*dj).powi(2) <= scale.d_h.powi(2))
            .collect();
        let mut graph = Self::default();
        let mut around = Vec::new();
        for (column, &[i, j]) in columns.cells().iter().enumerate() {
            around.clear();
            let cells = square.iter().map(|[di, dj]| finder.column([i + di, j + dj]));
            around.extend(cells.filter(|range| !range.is_empty()));
            for voxel in columns.voxels(column) {
                graph.begin();
                for range in &around {
                    let here = &heights[range.clone()];
                    let low = here.partition_point(|&k| k < heights[voxel] - high);
                    let end = here.partition_point(|&k| k <= heights[voxel] + high);
                    let weights = (range.start + low..range.start + end).map(|other| {
                        if other == voxel { 0.0 } else { scale.weight(centroids[voxel], centroids[other]) }
                    });
                    graph.push(range.start + low, weights);
                }
            }
        }
        graph.begin();
        graph
    }

    /// Begins the next voxel, or ends the last one.
    fn begin(&mut self) {
        self.first.push((self.runs.len(), self.weight.len()));
    }

    /// Adds links of a voxel to voxels from `start`. Weights of 0 at the ends are left out.
    fn push(&mut self, start: usize, weights: impl Iterator<Item = f32>) {
        let before = self.weight.len();
        let mut start = start;
        for weight in weights {
            if weight > 0.0 || self.weight.len() > before {
                self.weight.push(weight);
            } else {
                start += 1;
            }
        }
        while self.weight.len() > before && self.weight.last().is_some_and(|weight| *weight <= 0.0) {
            self.weight.pop();
        }
        let count = self.weight.len() - before;
        if count > 0 {
            self.runs.push(Run { start: start as u32, end: (start + count) as u32 });
        }
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// The runs of a voxel with their weights.
    fn runs(&self, voxel: usize) -> impl Iterator<Item = (Range<usize>, &[f32])> + '_ {
        let [(first, mut place), (end, _)] = [self.first[voxel], self.first[voxel + 1]];
        self.runs[first..end].iter().map(move |run| {
            let weights = &self.weight[place..place + run.range().len()];
            place += weights.len();
            (run.range(), weights)
        })
    }

    /// Links of a voxel: the other voxel and the weight.
    pub(super) fn links(&self, voxel: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let all = self.runs(voxel).flat_map(|(range, weights)| range.zip(weights));
        all.filter(|link| *link.1 > 0.0).map(|(to, &weight)| (to, f64::from(weight)))
    }

    /// Sum of the weights of each voxel.
    pub(super) fn degrees(&self) -> Vec<f64> {
        (0..self.len()).map(|voxel| self.links(voxel).map(|link| link.1).sum()).collect()
    }

    /// The product of the matrix of weights and a vector. Each row is summed in four fixed parts, which is
    /// faster than one sum and the same on every machine.
    pub(super) fn product(&self, vector: &[f64], result: &mut [f64]) {
        for (voxel, result) in result.iter_mut().enumerate() {
            let mut sums = [0.0; 4];
            let mut rest = 0.0;
            for (range, weights) in self.runs(voxel) {
                let (weight, weight_rest) = weights.as_chunks::<4>();
                let (value, value_rest) = vector[range].as_chunks::<4>();
                for (weight, value) in weight.iter().zip(value) {
                    for part in 0..4 {
                        sums[part] += f64::from(weight[part]) * value[part];
                    }
                }
                for (&weight, value) in weight_rest.iter().zip(value_rest) {
                    rest += f64::from(weight) * value;
                }
            }
            *result = ((sums[0] + sums[1]) + (sums[2] + sums[3])) + rest;
        }
    }

    /// The connected components, each ascending, in the order of their first voxel.
    pub(super) fn components(&self) -> Vec<Vec<u32>> {
        let mut seen = vec![false; self.len()];
        let mut components = Vec::new();
        for start in 0..self.len() {
            if std::mem::replace(&mut seen[start], true) {
                continue;
            }
            let mut members = vec![start as u32];
            let mut next = 0;
            while let Some(&voxel) = members.get(next) {
                next += 1;
                for (to, _) in self.links(voxel as usize) {
                    if !std::mem::replace(&mut seen[to], true) {
                        members.push(to as u32);
                    }
                }
            }
            members.sort_unstable();
            components.push(members);
        }
        components
    }

    /// The graph of some of its voxels (ascending), with the links between them. The order of voxels stays,
    /// so the rest of a run is a run.
    pub(super) fn part(&self, members: &[u32]) -> Self {
        // Number of members before each voxel, and before the end.
        let mut before = vec![0_u32; self.len() + 1];
        members.iter().for_each(|&member| before[member as usize + 1] = 1);
        for voxel in 0..self.len() {
            before[voxel + 1] += before[voxel];
        }
        let is_member = |voxel: usize| before[voxel + 1] > before[voxel];
        let mut part = Self::default();
        for &member in members {
            part.begin();
            for (range, weights) in self.runs(member as usize) {
                let start = before[range.start] as usize;
                let kept = range.zip(weights).filter(|(to, _)| is_member(*to));
                part.push(start, kept.map(|(_, &weight)| weight));
            }
        }
        part.begin();
        part
    }
}

/// e to the power of `x`, for `x` up to 0. The error is below 1e-9, because weights are stored with 7 digits.
/// Values below e^-60 are 0. This is a fixed sequence of IEEE operations, because the functions of platforms
/// differ in the last bit.
#[inline]
fn exponential(x: f64) -> f64 {
    const INVERSE: [f64; 8] =
        [1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0, 1.0 / 8.0];
    if x < -60.0 {
        return 0.0;
    }
    // An integer power of two, and the rest of the exponent: at most ln(2) / 2.
    let power = (x * std::f64::consts::LOG2_E - 0.5) as i32;
    let rest = x - f64::from(power) * std::f64::consts::LN_2;
    let mut sum = 1.0;
    for inverse in INVERSE.iter().rev() {
        sum = 1.0 + rest * sum * inverse;
    }
    sum * f64::from_bits(u64::from((power + 1023).unsigned_abs()) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    fn scale() -> Scale {
        Scale::new(&NormalizedCutConfig::default(), 0.3)
    }

    /// Voxels at random places of a box, with random centroids.
    fn scene() -> (Vec<Voxel>, Vec<[f64; 3]>) {
        let mut numbers = Numbers::new(7);
        let mut random = |end: i32| numbers.below(u64::from(end.unsigned_abs())) as i32;
        let mut keys: Vec<Voxel> = (0..300).map(|_| [random(16), random(12), random(40)]).collect();
        keys.sort_unstable();
        keys.dedup();
        let centroids = keys
            .iter()
            .map(|key| key.map(|index| (f64::from(index) + f64::from(random(1_000)) / 1_000.0) * 0.3))
            .collect();
        (keys, centroids)
    }

    #[test]
    fn links_are_those_of_all_pairs() {
        let (keys, centroids) = scene();
        let graph = Graph::of(&keys, &centroids, &scale());
        let mut links = 0;
        for a in 0..keys.len() {
            let mut expected = Vec::new();
            for b in (0..keys.len()).filter(|&b| b != a) {
                let [dx, dy, dz] = [0, 1, 2].map(|axis| centroids[a][axis] - centroids[b][axis]);
                if dx.hypot(dy) <= 1.2 && dz.abs() <= 6.0 {
                    let across = (-(dx * dx + dy * dy) / 0.64).exp();
                    expected.push((b, across * (-dz * dz / 4.0).exp()));
                }
            }
            let found: Vec<(usize, f64)> = graph.links(a).collect();
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(found.0, expected.0);
                assert!((found.1 - expected.1).abs() < 1e-7);
            }
            links += found.len();
        }
        assert!(links > 1_000, "{links}");
    }

    #[test]
    fn the_exponential_is_right_to_nine_digits() {
        for step in 0..60_000 {
            let x = -f64::from(step) / 1_000.0;
            assert!((exponential(x) / x.exp() - 1.0).abs() < 1e-9, "{x}");
        }
        assert!(exponential(-1e6) <= 0.0);
    }

    #[test]
    fn coarse_voxels_remain_linked() {
        let keys: Vec<Voxel> = (0..5).map(|i| [i, 0, 0]).collect();
        let centroids: Vec<[f64; 3]> = (0..5).map(|i| [2.4 * f64::from(i) + 1.0, 1.0, 1.0]).collect();
        let graph = Graph::of(&keys, &centroids, &Scale::new(&NormalizedCutConfig::default(), 2.4));
        assert_eq!(graph.components().len(), 1);
        assert_eq!(graph.links(0).map(|link| link.0).collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn products_and_parts_follow_the_links() {
        let (keys, centroids) = scene();
        let graph = Graph::of(&keys, &centroids, &scale());
        let vector: Vec<f64> = (0..graph.len()).map(|voxel| 1.0 / (voxel as f64 + 1.0)).collect();
        let mut product = vec![0.0; graph.len()];
        graph.product(&vector, &mut product);
        for (voxel, value) in product.iter().enumerate() {
            let expected: f64 = graph.links(voxel).map(|(to, weight)| weight * vector[to]).sum();
            assert!((value - expected).abs() < 1e-12);
        }
        let members: Vec<u32> = (0..graph.len() as u32).filter(|voxel| voxel % 3 != 1).collect();
        let part = graph.part(&members);
        for (place, &member) in members.iter().enumerate() {
            let expected: Vec<(usize, f64)> = graph
                .links(member as usize)
                .filter_map(|(to, weight)| Some((members.binary_search(&(to as u32)).ok()?, weight)))
                .collect();
            assert_eq!(part.links(place).collect::<Vec<_>>(), expected);
        }
        let degrees = graph.degrees();
        assert!(
            (degrees.iter().sum::<f64>() - graph.weight.iter().map(|w| f64::from(*w)).sum::<f64>()).abs()
                < 1e-9
        );
    }

    #[test]
    fn voxels_further_apart_than_d_h_are_other_components() {
        let keys = [[0, 0, 0], [0, 0, 9], [3, 0, 0], [9, 0, 0]];
        let centroids = keys.map(|key: Voxel| key.map(|index| f64::from(index) * 0.3));
        let graph = Graph::of(&keys, &centroids, &scale());
        assert_eq!(graph.components(), [vec![0, 1, 2], vec![3]]);
    }
}
