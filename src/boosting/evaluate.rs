//! Evaluation of trees for blocks of 64 rows.
//!
//! The rows of a block are the bits of a word. For each threshold, a word says which rows are above it. A
//! leaf is the word of its rows, and a split divides this word in two. The numbers of the leaves are then
//! read from five words, one per binary digit. So the time depends on the splits of a tree and not on its
//! depth, and no branch depends on a value. The idea of trees as bit masks is that of Lucchese et al. 2015
//! (`QuickScorer`, doi:10.1145/2766462.2767733); ours turns it round and has a bit per row, not per leaf.

use super::tree::{MOST_LEAVES, Tree};

/// Rows of a block: bits of a word.
const ROWS: usize = 64;
/// Rows whose bins are searched together.
const GROUP: usize = 8;
/// Binary digits of the number of a leaf.
const DIGITS: usize = 5;

/// A split: the rows of a leaf that are above a threshold go to the next new leaf.
#[derive(Debug, Clone, Copy)]
struct Cut {
    leaf: u8,
    /// Number of the threshold among those of all features.
    threshold: u32,
}

/// Trees in the form that is evaluated.
#[derive(Debug, Clone)]
pub(super) struct Forest {
    /// Features with their thresholds, filled up with infinity to one less than a power of two.
    features: Vec<(usize, Vec<f32>)>,
    /// Number of features in a row.
    width: usize,
    base: Vec<i32>,
    cuts: Vec<Cut>,
    /// Per tree: the end of its cuts, and the values of its leaves.
    trees: Vec<(usize, [i32; MOST_LEAVES])>,
}

/// The bytes of a word whose bits are those of the index: byte n is bit n.
const SPREAD: [u64; 256] = spread();

const fn spread() -> [u64; 256] {
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        let mut bit = 0;
        while bit < 8 {
            if index & (1 << bit) != 0 {
                table[index] |= 1 << (8 * bit);
            }
            bit += 1;
        }
        index += 1;
    }
    table
}

impl Forest {
    /// Checks that every number of a tree has a meaning.
    pub(super) fn new(thresholds: &[Vec<f32>], base: &[i32], trees: &[Tree]) -> Result<Self, String> {
        if base.is_empty() || thresholds.is_empty() || !trees.len().is_multiple_of(base.len()) {
            return Err("it has no classes, no features, or not one tree per class and round".to_owned());
        }
        let mut starts = Vec::with_capacity(thresholds.len());
        let mut end = 0_u32;
        let mut features = Vec::new();
        for (feature, thresholds) in thresholds.iter().enumerate() {
            if thresholds.len() > 255 || !thresholds.is_sorted_by(|a, b| a < b) {
                return Err(format!("feature {feature} has thresholds out of order"));
            }
            starts.push(end);
            if !thresholds.is_empty() {
                let mut filled = thresholds.clone();
                filled.resize((thresholds.len() + 1).next_power_of_two() - 1, f32::INFINITY);
                end += u32::try_from(filled.len()).unwrap_or(u32::MAX);
                features.push((feature, filled));
            }
        }
        let mut cuts = Vec::new();
        let mut flat = Vec::with_capacity(trees.len());
        for (number, tree) in trees.iter().enumerate() {
            let wrong = || format!("tree {number} is not a tree");
            if tree.values.len() != tree.splits.len() + 1 || tree.values.len() > MOST_LEAVES {
                return Err(wrong());
            }
            for (at, split) in tree.splits.iter().enumerate() {
                let of_feature = thresholds.get(usize::from(split.feature)).ok_or_else(wrong)?;
                if usize::from(split.leaf) > at || usize::from(split.threshold) >= of_feature.len() {
                    return Err(wrong());
                }
                let threshold = starts[usize::from(split.feature)] + u32::from(split.threshold);
                cuts.push(Cut { leaf: split.leaf, threshold });
            }
            let mut values = [0; MOST_LEAVES];
            values[..tree.values.len()].copy_from_slice(&tree.values);
            flat.push((cuts.len(), values));
        }
        Ok(Self { features, width: thresholds.len(), base: base.to_vec(), cuts, trees: flat })
    }

    /// Gives `take` the scores of each row in turn. `K` is the number of classes.
    pub(super) fn scores<const K: usize>(&self, rows: &[f32], take: &mut dyn FnMut(&[i32; K])) {
        let count = self.features.iter().map(|(_, thresholds)| thresholds.len()).sum();
        let mut above = vec![0_u64; count];
        let mut scores = vec![[0_i32; ROWS]; K];
        for block in rows.chunks(ROWS * self.width) {
            self.compare(block, &mut above);
            for (scores, &base) in scores.iter_mut().zip(&self.base) {
                scores.fill(base);
            }
            let mut from = 0;
            for (tree, (end, values)) in self.trees.iter().enumerate() {
                let leaves = leaves(&self.cuts[from..*end], &above);
                add(&leaves, values, &mut scores[tree % K]);
                from = *end;
            }
            let of_row = |row: usize| std::array::from_fn(|class| scores[class][row]);
            (0..block.len() / self.width).for_each(|row| take(&of_row(row)));
        }
    }

    /// For every threshold, which rows of a block are above it.
    fn compare(&self, block: &[f32], above: &mut [u64]) {
        let mut rest = above;
        for (feature, thresholds) in &self.features {
            let Some((words, after)) = rest.split_at_mut_checked(thresholds.len()) else { return };
            rest = after;
            // The rows in each bin, then the rows in all bins above a threshold.
            let mut bins = [0_u64; 256];
            for (eight, rows) in block.chunks(GROUP * self.width).enumerate() {
                let values = rows.iter().skip(*feature).step_by(self.width);
                let count = rows.len() / self.width;
                let mut group = [f32::NEG_INFINITY; GROUP];
                group.iter_mut().zip(values).for_each(|(to, value)| *to = *value);
                let found = search(thresholds, &group);
                for (row, bin) in found.iter().take(count).enumerate() {
                    bins[bin & 255] |= 1 << (GROUP * eight + row);
                }
            }
            let mut over = 0;
            for (word, rows) in words.iter_mut().zip(&bins[1..]).rev() {
                over |= rows;
                *word = over;
            }
        }
    }
}

/// For each value, the number of thresholds below it. There are 2^n - 1 thresholds. The search has no
/// branches that depend on a value, and does not wait for the step of one value before it begins that of the
/// next.
#[inline]
fn search(thresholds: &[f32], values: &[f32; GROUP]) -> [usize; GROUP] {
    let mut found = [0; GROUP];
    let mut step = thresholds.len().div_ceil(2);
    while step > 0 {
        for (found, value) in found.iter_mut().zip(values) {
            let below = *value > thresholds[*found + step - 1];
            *found += step & usize::from(below).wrapping_neg();
        }
        step /= 2;
    }
    found
}

/// The digits of the numbers of the leaves: word n has the bit n of the number of each row.
#[inline]
fn leaves(cuts: &[Cut], above: &[u64]) -> [u64; DIGITS] {
    let mut rows = [0_u64; MOST_LEAVES];
    rows[0] = u64::MAX;
    for (cut, new) in cuts.iter().zip(1..MOST_LEAVES) {
        let of_leaf = &mut rows[usize::from(cut.leaf) % MOST_LEAVES];
        let over = above[cut.threshold as usize];
        let moved = *of_leaf & over;
        *of_leaf &= !over;
        rows[new] = moved;
    }
    // Leaves with an odd number have the last digit; then pairs of leaves are leaves with one digit less.
    let mut digits = [0; DIGITS];
    let mut count = MOST_LEAVES;
    for digit in &mut digits {
        count /= 2;
        for pair in 0..count {
            *digit |= rows[2 * pair + 1];
            rows[pair] = rows[2 * pair] | rows[2 * pair + 1];
        }
    }
    digits
}

/// Adds the value of each row's leaf to its score.
#[inline]
fn add(digits: &[u64; DIGITS], values: &[i32; MOST_LEAVES], scores: &mut [i32; ROWS]) {
    let bytes = digits.map(u64::to_le_bytes);
    for (eight, scores) in scores.chunks_exact_mut(8).enumerate() {
        let mut numbers = 0;
        for (digit, bytes) in bytes.iter().enumerate() {
            numbers |= SPREAD[usize::from(bytes[eight])] << digit;
        }
        for (score, number) in scores.iter_mut().zip(numbers.to_le_bytes()) {
            *score += values[usize::from(number) % MOST_LEAVES];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boosting::tree::Split;

    /// Score of a row by walking through the splits.
    fn walk(thresholds: &[Vec<f32>], tree: &Tree, row: &[f32]) -> i32 {
        let mut leaf = 0;
        for (number, split) in tree.splits.iter().enumerate() {
            let feature = usize::from(split.feature);
            if leaf == usize::from(split.leaf)
                && row[feature] > thresholds[feature][usize::from(split.threshold)]
            {
                leaf = number + 1;
            }
        }
        tree.values[leaf]
    }

    fn random(state: &mut u64) -> u64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *state >> 33
    }

    #[test]
    fn blocks_give_what_a_walk_through_each_tree_gives() {
        let mut state = 5;
        let below = |state: &mut u64, limit: usize| usize::try_from(random(state)).unwrap() % limit;
        let sizes = [0, 1, 2, 63, 64, 255];
        let thresholds: Vec<Vec<f32>> =
            sizes.iter().map(|&count| (0..count).map(|n| n as f32).collect()).collect();
        let trees: Vec<Tree> = (0..30)
            .map(|number| {
                let leaves = 1 + number % MOST_LEAVES;
                let split = |at: usize, state: &mut u64| {
                    let feature = 1 + below(state, 5);
                    Split {
                        leaf: u8::try_from(below(state, at + 1)).unwrap(),
                        feature: u16::try_from(feature).unwrap(),
                        threshold: u8::try_from(below(state, sizes[feature])).unwrap(),
                    }
                };
                let splits = (0..leaves - 1).map(|at| split(at, &mut state)).collect();
                let values =
                    (0..leaves).map(|_| i32::try_from(random(&mut state) % 1000).unwrap() - 500).collect();
                Tree { splits, values }
            })
            .collect();
        let forest = Forest::new(&thresholds, &[7, -7, 3], &trees).unwrap();
        for count in [1, 63, 64, 65, 200] {
            let rows: Vec<f32> =
                (0..count * 6).map(|_| below(&mut state, 2600) as f32 / 10.0 - 2.0).collect();
            let mut found = Vec::new();
            forest.scores::<3>(&rows, &mut |scores| found.push(*scores));
            assert_eq!(found.len(), count);
            for (row, found) in rows.chunks_exact(6).zip(found) {
                let mut expected = [7, -7, 3];
                for (number, tree) in trees.iter().enumerate() {
                    expected[number % 3] += walk(&thresholds, tree, row);
                }
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        let split = Split { leaf: 0, feature: 0, threshold: 0 };
        let tree =
            |splits: &[Split], values: &[i32]| Tree { splits: splits.to_vec(), values: values.to_vec() };
        let build = |tree: Tree| Forest::new(&[vec![1.0]], &[0], &[tree]);
        build(tree(&[split], &[1, 2])).unwrap();
        for wrong in [
            tree(&[split], &[1]),
            tree(&[Split { leaf: 1, ..split }], &[1, 2]),
            tree(&[Split { feature: 1, ..split }], &[1, 2]),
            tree(&[Split { threshold: 1, ..split }], &[1, 2]),
            tree(&[split; 32], &[0; 33]),
        ] {
            assert!(build(wrong).unwrap_err().contains("not a tree"));
        }
        assert!(Forest::new(&[vec![1.0, 1.0]], &[0], &[]).unwrap_err().contains("out of order"));
        assert!(Forest::new(&[vec![1.0]], &[0, 0], &[tree(&[], &[1])]).is_err());
    }
}
