//! Bins of a feature: thresholds between its values, and the number of the bin of each sample.

use super::samples::Samples;

/// Number of features whose bins are stored together: half a cache line. The sums over 64 bins of each are 32
/// KiB, about the size of the first-level cache.
pub(super) const BLOCK: usize = 32;

/// The bins of the features of a block at a sample.
pub(super) type Row = [u8; BLOCK];

/// Thresholds of every feature, and the bins of all samples.
pub(super) struct Binned {
    /// Per feature, ascending. Bin n holds the values above n thresholds.
    pub(super) thresholds: Vec<Vec<f32>>,
    /// Per block of features, the bins of each sample.
    pub(super) blocks: Vec<Vec<Row>>,
    /// The bins of each feature: a split needs one feature of many samples.
    columns: Vec<Vec<u8>>,
}

impl Binned {
    /// Bins with about equal numbers of samples, at most `most` (up to 255) per feature.
    pub(super) fn of(samples: &Samples, most: usize) -> Self {
        let width = samples.features().len();
        let mut thresholds = Vec::with_capacity(width);
        let mut columns = Vec::with_capacity(width);
        let mut blocks = vec![vec![[0; BLOCK]; samples.len()]; width.div_ceil(BLOCK)];
        for feature in 0..width {
            let column: Vec<f32> = samples.values().iter().skip(feature).step_by(width).copied().collect();
            let cuts = thresholds_of(&column, most);
            let bins: Vec<u8> = column.iter().map(|&value| bin(&cuts, value)).collect();
            blocks[feature / BLOCK].iter_mut().zip(&bins).for_each(|(row, &bin)| row[feature % BLOCK] = bin);
            columns.push(bins);
            thresholds.push(cuts);
        }
        Self { thresholds, blocks, columns }
    }

    /// The bin of a sample.
    pub(super) fn bin(&self, feature: usize, sample: u32) -> u8 {
        self.columns[feature][sample as usize]
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.blocks.first().map_or(0, Vec::len)
    }

    /// Drops the thresholds that are not `used` (per feature and threshold), and returns the new number of
    /// each.
    pub(super) fn keep(thresholds: &mut [Vec<f32>], used: &[Vec<bool>]) -> Vec<Vec<u8>> {
        let mut numbers = Vec::with_capacity(used.len());
        for (cuts, used) in thresholds.iter_mut().zip(used) {
            let mut count = 0_u8;
            numbers.push(
                used.iter()
                    .map(|&used| {
                        let number = count;
                        count += u8::from(used);
                        number
                    })
                    .collect(),
            );
            let mut kept = used.iter();
            cuts.retain(|_| kept.next().copied().unwrap_or(false));
        }
        numbers
    }
}

/// The number of thresholds below the value.
fn bin(thresholds: &[f32], value: f32) -> u8 {
    let above = thresholds.partition_point(|&threshold| value > threshold);
    u8::try_from(above).unwrap_or(u8::MAX)
}

/// Thresholds between neighbouring values, so that each bin has about as many samples as any other. With few
/// different values, each has a bin of its own.
fn thresholds_of(column: &[f32], most: usize) -> Vec<f32> {
    let mut sorted: Vec<f32> = column.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let mut groups: Vec<(f32, usize)> = Vec::new();
    for &value in &sorted {
        match groups.last_mut() {
            // 0 and -0 are one value, because a threshold cannot lie between them.
            Some((last, count)) if *last >= value => *count += 1,
            _ => groups.push((value, 1)),
        }
    }
    let mut thresholds = Vec::new();
    let mut left = sorted.len();
    let mut bins = most.min(groups.len());
    let mut taken = 0;
    for (number, pair) in groups.windows(2).enumerate() {
        taken += pair[0].1;
        let groups_left = groups.len() - 1 - number;
        // The remaining samples are shared out again after each bin, because a value with many samples fills
        // a bin alone.
        if bins > 1 && (taken * bins >= left || groups_left < bins) {
            thresholds.push(between(pair[0].0, pair[1].0));
            left -= taken;
            bins -= 1;
            taken = 0;
        }
    }
    thresholds
}

/// A threshold such that `low` is not above it and `high` is above it.
fn between(low: f32, high: f32) -> f32 {
    let middle = low + (high - low) * 0.5;
    if middle < high { middle } else { low }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_have_a_bin_each_and_many_share_them_evenly() {
        let column: Vec<f32> = (0..900_u16).map(|n| f32::from(n % 3)).collect();
        assert_eq!(thresholds_of(&column, 64), [0.5, 1.5]);
        let column: Vec<f32> = (0..6_400_u16).rev().map(f32::from).collect();
        let thresholds = thresholds_of(&column, 64);
        assert_eq!(thresholds.len(), 63);
        let mut counts = [0; 64];
        column.iter().for_each(|&value| counts[usize::from(bin(&thresholds, value))] += 1);
        assert_eq!(counts, [100; 64]);
        // Half of the samples have one value.
        let column: Vec<f32> = (0..1_000_u16).map(|n| f32::from(n.saturating_sub(500))).collect();
        let thresholds = thresholds_of(&column, 11);
        assert_eq!((thresholds.len(), thresholds[0]), (10, 0.5));
        let near = [1.0, f32::from_bits(1.0_f32.to_bits() + 1)];
        let thresholds = thresholds_of(&near, 64);
        assert_eq!([bin(&thresholds, near[0]), bin(&thresholds, near[1])], [0, 1]);
        assert!(thresholds_of(&[f32::NAN, 2.0, 2.0, -0.0, 0.0], 64).len() == 1);
    }

    #[test]
    fn unused_thresholds_are_dropped() {
        let mut thresholds = vec![vec![1.0, 2.0, 3.0], vec![5.0]];
        let numbers = Binned::keep(&mut thresholds, &[vec![false, true, true], vec![false]]);
        assert_eq!(thresholds, [vec![2.0, 3.0], vec![]]);
        assert_eq!(numbers[0][1..], [0, 1]);
    }
}
