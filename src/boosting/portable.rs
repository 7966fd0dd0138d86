//! The two inner loops of the evaluation of trees, in plain Rust: thresholds to bits, and bits to sums.
//! `avx2.rs` has the same loops for processors with AVX2.

use super::tree::MOST_LEAVES;

/// Number of rows in a word: its bits.
pub(super) const BITS: usize = 64;
/// Number of words side by side: the same as in a vector of AVX2.
pub(super) const WORDS: usize = 4;
/// Number of binary digits of the number of a leaf.
pub(super) const DIGITS: usize = 5;
/// Number of rows whose bins are searched together.
const GROUP: usize = 8;

/// A set of rows of a block: one bit for each row.
pub(super) type Rows = [u64; WORDS];

/// For each index, a word with the bits of the index as bytes: byte n is bit n.
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

/// For every threshold of a feature, writes which of the `values` are above it into word `word` of its entry
/// in `above`. The thresholds are sorted, and there are 2^n - 1 of them, at most 255.
#[inline]
pub(super) fn compare(thresholds: &[f32], values: &[f32; BITS], word: usize, above: &mut [Rows]) {
    // The rows in each bin, then the rows in all bins above a threshold.
    let mut bins = [0_u64; 256];
    for (eight, group) in values.as_chunks::<GROUP>().0.iter().enumerate() {
        for (row, bin) in search(thresholds, group).into_iter().enumerate() {
            bins[bin & 255] |= 1 << (GROUP * eight + row);
        }
    }
    let mut over = 0;
    for (above, rows) in above.iter_mut().zip(&bins[1..]).rev() {
        over |= rows;
        above[word % WORDS] = over;
    }
}

/// For each value, the number of thresholds below it. The search has no branches that depend on a value, and
/// the step of one value does not wait for the step of another.
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

/// Adds the value of each row's leaf to its score. `digits` are the binary digits of the numbers of the
/// leaves.
#[inline]
pub(super) fn add(digits: [u64; DIGITS], values: &[i32; MOST_LEAVES], scores: &mut [i32; BITS]) {
    let bytes = digits.map(u64::to_le_bytes);
    for (eight, scores) in scores.as_chunks_mut::<8>().0.iter_mut().enumerate() {
        let mut numbers = 0;
        for (digit, bytes) in bytes.iter().enumerate() {
            numbers |= SPREAD[usize::from(bytes[eight])] << digit;
        }
        for (score, number) in scores.iter_mut().zip(numbers.to_le_bytes()) {
            *score += values[usize::from(number) % MOST_LEAVES];
        }
    }
}
