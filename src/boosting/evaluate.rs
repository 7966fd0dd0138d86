//! Evaluation of trees for blocks of 256 rows.
//!
//! The rows of a block are the bits of four words. For each threshold, four words say which rows are above
//! it. A leaf is four words with its rows, and a split divides them in two. The numbers of the leaves are
//! then read from five times four words, four per binary digit. So the time depends on the number of splits
//! of a tree and not on its depth, and no branch depends on a value. The idea of trees as bit masks comes
//! from Lucchese et al. 2015 (`QuickScorer`, doi:10.1145/2766462.2767733); ours reverses it and has a bit per
//! row, not per leaf.
//!
//! Comparisons are exact and scores are whole numbers. So all processors give the same scores, with or
//! without AVX2.

#[cfg(target_arch = "x86_64")]
use super::avx2;
use super::portable::{self, BITS, DIGITS, Rows, WORDS};
use super::tree::{MOST_LEAVES, Tree};

/// A split: the rows of a leaf that are above a threshold go to the next new leaf.
#[derive(Debug, Clone, Copy)]
struct Cut {
    leaf: u8,
    /// Number of the threshold among the thresholds of all features.
    threshold: u32,
}

/// Trees in the form that is evaluated.
#[derive(Debug, Clone)]
pub(super) struct Forest {
    /// Features with their thresholds, padded with infinity so that their number is one less than a power of
    /// two.
    features: Vec<(usize, Vec<f32>)>,
    /// Number of features in a row.
    width: usize,
    base: Vec<i32>,
    cuts: Vec<Cut>,
    /// Per tree: the end of its cuts, and the values of its leaves.
    trees: Vec<(usize, [i32; MOST_LEAVES])>,
}

impl Forest {
    /// Checks that every number in a tree refers to something that exists.
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
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "what needs AVX2 can only be called by an unsafe call")]
            // SAFETY: the processor has AVX2.
            unsafe {
                self.scores_with_avx2(rows, take);
            }
            return;
        }
        self.scores_by(rows, portable::compare, portable::add, take);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn scores_with_avx2<const K: usize>(&self, rows: &[f32], take: &mut dyn FnMut(&[i32; K])) {
        // A closure is compiled with the instructions of its function; a function passed as a value is not.
        let compare = |thresholds: &_, values: &_, word, above: &mut _| {
            avx2::compare(thresholds, values, word, above);
        };
        let add = |digits, values: &_, scores: &mut _| avx2::add(digits, values, scores);
        self.scores_by(rows, compare, add, take);
    }

    /// The scores, by the inner loops of a processor. It is compiled into its callers, with their
    /// instructions.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    fn scores_by<const K: usize>(
        &self,
        rows: &[f32],
        compare: impl Fn(&[f32], &[f32; BITS], usize, &mut [Rows]),
        add: impl Fn([u64; DIGITS], &[i32; MOST_LEAVES], &mut [i32; BITS]),
        take: &mut dyn FnMut(&[i32; K]),
    ) {
        let count = self.features.iter().map(|(_, thresholds)| thresholds.len()).sum();
        let mut above = vec![Rows::default(); count];
        let mut scores = vec![[[0_i32; BITS]; WORDS]; K];
        for block in rows.chunks(WORDS * BITS * self.width) {
            for (word, rows) in block.chunks(BITS * self.width).enumerate() {
                let mut rest = &mut above[..];
                for (feature, thresholds) in &self.features {
                    let (words, after) = rest.split_at_mut(thresholds.len());
                    rest = after;
                    let mut values = [f32::NEG_INFINITY; BITS];
                    let of_rows = rows.iter().skip(*feature).step_by(self.width);
                    values.iter_mut().zip(of_rows).for_each(|(to, value)| *to = *value);
                    compare(thresholds, &values, word, words);
                }
            }
            for (scores, &base) in scores.iter_mut().zip(&self.base) {
                scores.as_flattened_mut().fill(base);
            }
            let words = block.len().div_ceil(BITS * self.width);
            let mut from = 0;
            for (tree, (end, values)) in self.trees.iter().enumerate() {
                let digits = leaves(&self.cuts[from..*end], &above);
                for (word, scores) in scores[tree % K].iter_mut().enumerate().take(words) {
                    add(digits.map(|digit| digit[word]), values, scores);
                }
                from = *end;
            }
            let of_row = |row: usize| std::array::from_fn(|class| scores[class][row / BITS][row % BITS]);
            (0..block.len() / self.width).for_each(|row| take(&of_row(row)));
        }
    }
}

/// The digits of the numbers of the leaves: entry n has bit n of the number of the leaf of each row.
#[inline(always)]
#[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
fn leaves(cuts: &[Cut], above: &[Rows]) -> [Rows; DIGITS] {
    let mut rows = [Rows::default(); MOST_LEAVES];
    rows[0] = [u64::MAX; WORDS];
    for (cut, new) in cuts.iter().zip(1..MOST_LEAVES) {
        let of_leaf = &mut rows[usize::from(cut.leaf) % MOST_LEAVES];
        let over = &above[cut.threshold as usize];
        let moved = std::array::from_fn(|word| of_leaf[word] & over[word]);
        of_leaf.iter_mut().zip(over).for_each(|(rows, over)| *rows &= !over);
        rows[new] = moved;
    }
    // Leaves with an odd number have the last digit set. Then pairs of leaves are joined to leaves whose
    // numbers have one digit less.
    let mut digits = [Rows::default(); DIGITS];
    let mut count = MOST_LEAVES;
    for digit in &mut digits {
        count /= 2;
        for pair in 0..count {
            let [even, odd] = [rows[2 * pair], rows[2 * pair + 1]];
            digit.iter_mut().zip(odd).for_each(|(digit, odd)| *digit |= odd);
            rows[pair] = std::array::from_fn(|word| even[word] | odd[word]);
        }
    }
    digits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boosting::tree::Split;
    use crate::numbers::Numbers;

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

    #[test]
    fn blocks_give_what_a_walk_through_each_tree_gives() {
        let mut numbers = Numbers::new(5);
        let below = |numbers: &mut Numbers, limit: usize| usize::try_from(numbers.next()).unwrap() % limit;
        let sizes = [0, 1, 2, 63, 64, 255];
        let thresholds: Vec<Vec<f32>> =
            sizes.iter().map(|&count| (0..count).map(|n| n as f32).collect()).collect();
        let trees: Vec<Tree> = (0..30)
            .map(|number| {
                let leaves = 1 + number % MOST_LEAVES;
                let split = |at: usize, numbers: &mut Numbers| {
                    let feature = 1 + below(numbers, 5);
                    Split {
                        leaf: u8::try_from(below(numbers, at + 1)).unwrap(),
                        feature: u16::try_from(feature).unwrap(),
                        threshold: u8::try_from(below(numbers, sizes[feature])).unwrap(),
                    }
                };
                let splits = (0..leaves - 1).map(|at| split(at, &mut numbers)).collect();
                let values = (0..leaves).map(|_| i32::try_from(numbers.below(1000)).unwrap() - 500).collect();
                Tree { splits, values }
            })
            .collect();
        let forest = Forest::new(&thresholds, &[7, -7, 3], &trees).unwrap();
        for count in [1, 63, 64, 65, 200, 256, 257, 600] {
            let rows: Vec<f32> =
                (0..count * 6).map(|_| below(&mut numbers, 2600) as f32 / 10.0 - 2.0).collect();
            let mut found = Vec::new();
            forest.scores::<3>(&rows, &mut |scores| found.push(*scores));
            let mut portable = Vec::new();
            forest.scores_by::<3>(&rows, portable::compare, portable::add, &mut |scores| {
                portable.push(*scores)
            });
            assert_eq!(found, portable);
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
