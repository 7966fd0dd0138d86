//! Growth of one tree: the leaf with the largest gain is split first. Sums are whole numbers.

use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::bins::{BLOCK, Binned, Row};
use super::exponential::UNITS;
use super::settings::Settings;
use super::tree::{Split, Tree};

/// Number of units of gradients and curvatures per 1.
pub(super) const GRADIENT_UNITS: f64 = 65_536.0;

/// Bits for the number of samples in a word of a [`Sum`]. A curvature is at most a quarter, with a mean
/// weight of 1, so its sum over this many samples needs 38 more bits.
const SAMPLE_BITS: u32 = 24;

/// Largest number of samples.
pub(super) const MOST_SAMPLES: usize = (1 << SAMPLE_BITS) - 1;

/// Smallest curvature of a leaf: below it, a value would be a quotient of rounding errors (as in `LightGBM`).
const LEAST_CURVATURE: f64 = 1e-3;

/// Largest value of a leaf: a factor of nine million in the odds of two classes.
const LARGEST_VALUE: f64 = 16.0;

/// Number of samples whose bins are fetched at a time.
const FETCHED: usize = 256;

/// Gradient and curvature of the loss, summed over the samples of a bin or a leaf, and the number of samples.
/// They are two words, because most of the time goes into adding them: the number is in the lowest bits of
/// the curvature.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sum {
    gradient: i64,
    curvature: i64,
}

impl Sum {
    /// The values of one sample.
    pub(super) fn of(gradient: i64, curvature: i64) -> Self {
        Self { gradient, curvature: (curvature << SAMPLE_BITS) + 1 }
    }

    #[inline]
    fn add(&mut self, other: Self) {
        self.gradient += other.gradient;
        self.curvature += other.curvature;
    }

    fn less(self, other: Self) -> Self {
        Self { gradient: self.gradient - other.gradient, curvature: self.curvature - other.curvature }
    }

    fn samples(self) -> u64 {
        self.curvature.cast_unsigned() & MOST_SAMPLES as u64
    }

    fn slope(self) -> (f64, f64) {
        let curvature = self.curvature >> SAMPLE_BITS;
        (self.gradient as f64 / GRADIENT_UNITS, curvature as f64 / GRADIENT_UNITS)
    }

    /// The amount by which the best value of a leaf lowers twice the loss.
    fn score(self, l2: f64) -> f64 {
        let (gradient, curvature) = self.slope();
        gradient * gradient / (curvature + l2)
    }
}

/// Gradient and curvature of the loss for one class, at each sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slopes<'a> {
    /// Class by class within a sample.
    pub(super) of_samples: &'a [Sum],
    pub(super) classes: usize,
    pub(super) class: usize,
}

impl Slopes<'_> {
    fn of(&self, sample: u32) -> Sum {
        self.of_samples[sample as usize * self.classes + self.class]
    }
}

/// Sums of every bin of every feature, one after the other. Each feature has room for the largest number of
/// bins of any feature.
type Histogram = Vec<Sum>;

/// A split that a leaf could have.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    gain: f64,
    feature: usize,
    threshold: usize,
}

/// A leaf while the tree grows.
struct Leaf {
    /// Samples that the tree learns from.
    samples: Vec<u32>,
    /// Other samples of the leaf. They only get its value.
    others: Vec<u32>,
    histogram: Histogram,
    total: Sum,
    best: Option<Candidate>,
}

/// A tree, with the samples of its leaves and the gains of its splits.
pub(super) struct Grown {
    pub(super) tree: Tree,
    /// Samples of each leaf.
    pub(super) samples: Vec<Vec<u32>>,
    /// Feature and gain of each split.
    pub(super) gains: Vec<(usize, f64)>,
}

/// The input of the growth of trees.
pub(super) struct Grower<'a> {
    pub(super) binned: &'a Binned,
    pub(super) settings: &'a Settings,
    /// Number of places for the bins of a feature in a histogram.
    room: usize,
}

impl<'a> Grower<'a> {
    pub(super) fn new(binned: &'a Binned, settings: &'a Settings) -> Self {
        let room = binned.thresholds.iter().map(|thresholds| thresholds.len() + 1).max().unwrap_or(0);
        Self { binned, settings, room }
    }

    /// Grows the tree with this `number`, which makes its random choices differ from those of other trees.
    pub(super) fn grow(&self, slopes: Slopes<'_>, number: u64) -> Grown {
        let all = (0..).take(self.binned.samples());
        let parts: [Vec<u32>; 2] = all.partition(|&sample| self.learns_from(number, sample)).into();
        let histogram = self.histogram(&parts[0], slopes);
        let mut leaves = vec![self.leaf(parts, histogram, (number, 0))];
        let mut splits = Vec::new();
        let mut gains = Vec::new();
        while leaves.len() < self.settings.leaves {
            let mut chosen: Option<(usize, Candidate)> = None;
            for (at, leaf) in leaves.iter().enumerate() {
                if let Some(best) =
                    leaf.best.filter(|best| chosen.is_none_or(|(_, most)| best.gain > most.gain))
                {
                    chosen = Some((at, best));
                }
            }
            let Some((at, best)) = chosen else { break };
            let right = self.split(&mut leaves[at], best, slopes, (number, splits.len()));
            leaves.push(right);
            gains.push((best.feature, best.gain));
            splits.push(Split {
                leaf: narrow(at),
                threshold: narrow(best.threshold),
                feature: u16::try_from(best.feature).unwrap_or(u16::MAX),
            });
        }
        let values = leaves.iter().map(|leaf| self.value(leaf.total)).collect();
        let members = |Leaf { mut samples, others, .. }: Leaf| {
            samples.extend(others);
            samples
        };
        let samples = leaves.into_iter().map(members).collect();
        Grown { tree: Tree { splits, values }, samples, gains }
    }

    /// Whether a tree learns from a sample.
    fn learns_from(&self, tree: u64, sample: u32) -> bool {
        let share = self.settings.subsample;
        let key = [tree, u64::from(sample)].map(u64::to_le_bytes);
        // The upper 32 bits of a hash are a number from 0 to 1 that a double holds exactly.
        let hash = || xxh3_64_with_seed(key.as_flattened(), self.settings.seed) >> 32;
        share >= 1.0 || (hash() as f64) < share * 4_294_967_296.0
    }

    fn leaf(&self, [samples, others]: [Vec<u32>; 2], histogram: Histogram, key: (u64, usize)) -> Leaf {
        let mut total = Sum::default();
        histogram[..self.room].iter().for_each(|bin| total.add(*bin));
        let best = self.best(&histogram, total, key);
        Leaf { samples, others, histogram, total, best }
    }

    /// Sums over samples, which take most of the time of learning. Rows are far apart in memory, so many are
    /// fetched before they are added: no fetch waits for the previous one.
    fn histogram(&self, samples: &[u32], slopes: Slopes<'_>) -> Histogram {
        let mut histogram = vec![Sum::default(); self.binned.thresholds.len() * self.room];
        let mut rows: Vec<Row> = Vec::with_capacity(FETCHED);
        let mut values: Vec<Sum> = Vec::with_capacity(FETCHED);
        for samples in samples.chunks(FETCHED) {
            values.clear();
            values.extend(samples.iter().map(|&sample| slopes.of(sample)));
            for (block, sums) in self.binned.blocks.iter().zip(histogram.chunks_mut(BLOCK * self.room)) {
                rows.clear();
                rows.extend(samples.iter().map(|&sample| block[sample as usize]));
                let features = sums.len() / self.room;
                for (row, value) in rows.iter().zip(&values) {
                    for (sums, &bin) in sums.chunks_exact_mut(self.room).zip(&row[..features]) {
                        sums[usize::from(bin)].add(*value);
                    }
                }
            }
        }
        histogram
    }

    /// Splits a leaf, which keeps the samples that are not above the threshold, and returns the new leaf.
    fn split(
        &self,
        leaf: &mut Leaf,
        best: Candidate,
        slopes: Slopes<'_>,
        (tree, split): (u64, usize),
    ) -> Leaf {
        let above = |sample: &u32| usize::from(self.binned.bin(best.feature, *sample)) > best.threshold;
        let (right, left): (Vec<u32>, Vec<u32>) = leaf.samples.iter().partition(|sample| above(sample));
        let (others, others_left) = leaf.others.iter().partition(|sample| above(sample));
        // The sums of the larger part are the sums of both parts minus the sums of the smaller part.
        let smaller = self.histogram(if left.len() <= right.len() { &left } else { &right }, slopes);
        let larger: Histogram =
            leaf.histogram.iter().zip(&smaller).map(|(both, one)| both.less(*one)).collect();
        let (on_left, on_right) =
            if left.len() <= right.len() { (smaller, larger) } else { (larger, smaller) };
        *leaf = self.leaf([left, others_left], on_left, (tree, 2 * split + 1));
        self.leaf([right, others], on_right, (tree, 2 * split + 2))
    }

    /// The best split of a leaf among the features that its key draws.
    fn best(&self, histogram: &Histogram, total: Sum, (tree, node): (u64, usize)) -> Option<Candidate> {
        let whole = total.score(self.settings.l2);
        let mut best: Option<Candidate> = None;
        for feature in self.drawn(tree, node as u64) {
            let thresholds = self.binned.thresholds[feature].len();
            let mut left = Sum::default();
            for (threshold, bin) in histogram[feature * self.room..].iter().take(thresholds).enumerate() {
                left.add(*bin);
                let right = total.less(left);
                if !self.may_be_leaf(left) || !self.may_be_leaf(right) {
                    continue;
                }
                let gain = left.score(self.settings.l2) + right.score(self.settings.l2) - whole;
                // Of equal gains, the first in the order of features and thresholds wins.
                if gain > best.map_or(0.0, |best| best.gain) {
                    best = Some(Candidate { gain, feature, threshold });
                }
            }
        }
        best
    }

    fn may_be_leaf(&self, sum: Sum) -> bool {
        sum.samples() >= self.settings.leaf_samples && sum.slope().1 >= LEAST_CURVATURE
    }

    /// The features among which a split chooses, ascending: the features with the smallest hashes.
    fn drawn(&self, tree: u64, node: u64) -> Vec<usize> {
        let width = self.binned.thresholds.len();
        let mut hashed: Vec<(u64, usize)> = (0..width)
            .map(|feature| {
                let key = [tree, node, feature as u64].map(u64::to_le_bytes);
                (xxh3_64_with_seed(key.as_flattened(), self.settings.seed), feature)
            })
            .collect();
        hashed.sort_unstable();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the width")]
        let count = (self.settings.features * width as f64).ceil() as usize;
        let mut features: Vec<usize> = hashed[..count.min(width)].iter().map(|pair| pair.1).collect();
        features.sort_unstable();
        features
    }

    /// The value that a leaf adds to the score.
    fn value(&self, total: Sum) -> i32 {
        let (gradient, curvature) = total.slope();
        let step = -self.settings.rate * gradient / (curvature + self.settings.l2).max(LEAST_CURVATURE);
        #[expect(clippy::cast_possible_truncation, reason = "at most 16 times 65,536")]
        let value = (step.clamp(-LARGEST_VALUE, LARGEST_VALUE) * UNITS).round() as i32;
        value
    }
}

/// The number of a leaf or threshold, which is below 256 by the settings.
fn narrow(number: usize) -> u8 {
    u8::try_from(number).unwrap_or(u8::MAX)
}
