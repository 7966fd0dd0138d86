//! Finds the smallest of some values without sorting: a threshold is guessed and corrected until the right
//! number of values is not above it. Values are distances, or squared distances in a plane. So the number of
//! values below a threshold is about proportional to it, and a few guesses suffice. Each guess counts several
//! values at a time, without branches: values are stored in whole rows, and unused places are infinite.

/// Number of values of a row.
pub(crate) const ROW: usize = 8;
/// Largest number of guesses. There may be no threshold between equal values, and then no guess is right.
const GUESSES: usize = 12;

/// Fills the last row of values with infinity. Returns the number of values before.
pub(crate) fn fill_up(values: &mut Vec<f32>) -> usize {
    let len = values.len();
    values.resize(len.next_multiple_of(ROW), f32::INFINITY);
    len
}

/// A threshold that separates the `count` smallest of the first `len` values, which are not above it, from
/// the others. `None` if none is found, for example because the values around it are equal. Values are finite
/// and not negative; `count` is 1 to their number.
#[inline(always)]
#[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
pub(crate) fn threshold(values: &[f32], len: usize, count: usize) -> Option<f32> {
    // Several sums side by side, because the compiler must not reorder additions of floats.
    let (rows, rest) = values[..len].as_chunks::<ROW>();
    let mut sums = [0.0_f32; ROW];
    for row in rows {
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    let sum = sums.iter().chain(rest).sum::<f32>();
    // If values were evenly spread from 0, the largest would be twice the mean, and this guess would be
    // right.
    let guess = 2.0 * sum / len as f32 * (count as f32 / len as f32);
    threshold_from(values, len, count, guess)
}

/// The same from a first guess.
#[inline(always)]
#[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
pub(crate) fn threshold_from(values: &[f32], len: usize, count: usize, guess: f32) -> Option<f32> {
    // A threshold that is too low and one that is too high, each with the number of values not above it.
    let (mut low, mut high) = ((0.0_f32, 0_usize), (f32::INFINITY, len + 1));
    let mut guess = guess;
    for _ in 0..GUESSES {
        let found = not_above(values, guess);
        if found == count {
            return Some(guess);
        }
        if found < count {
            low = (guess, found);
        } else {
            high = (guess, found);
        }
        guess = if high.0.is_finite() {
            // Interpolated between both.
            let share = (count as f32 - low.1 as f32) / (high.1 as f32 - low.1 as f32);
            low.0 + (high.0 - low.0) * share.clamp(0.05, 0.95)
        } else {
            guess * (count as f32 / found.max(1) as f32).clamp(1.05, 4.0)
        };
        if guess <= low.0 || guess >= high.0 {
            return None;
        }
    }
    None
}

/// Number of values in whole rows that are not above a finite limit.
#[inline(always)]
#[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
fn not_above(values: &[f32], limit: f32) -> usize {
    let mut counts = [0_u32; ROW];
    for row in values.as_chunks::<ROW>().0 {
        counts.iter_mut().zip(row).for_each(|(count, value)| *count += u32::from(*value <= limit));
    }
    counts.iter().sum::<u32>() as usize
}

/// The median of the first `len` values: finite, not negative. `scratch` is overwritten. 0 without values.
#[inline(always)]
#[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
pub(crate) fn median(values: &[f32], len: usize, scratch: &mut Vec<f32>) -> f32 {
    let Some(last) = len.checked_sub(1) else { return 0.0 };
    let count = last / 2 + 1;
    let (lower, upper) = if let Some(limit) = threshold(values, len, count) {
        // For each column of the rows, the largest value not above the limit and the smallest value above it.
        let (mut lower, mut upper) = ([0.0_f32; ROW], [f32::INFINITY; ROW]);
        for row in values.as_chunks::<ROW>().0 {
            for ((lower, upper), &value) in lower.iter_mut().zip(&mut upper).zip(row) {
                let is_below = value <= limit;
                let (below, above) = if is_below { (value, f32::INFINITY) } else { (0.0, value) };
                *lower = if below > *lower { below } else { *lower };
                *upper = if above < *upper { above } else { *upper };
            }
        }
        let lower = lower.into_iter().fold(0.0, f32::max);
        (lower, upper.into_iter().fold(f32::INFINITY, f32::min))
    } else {
        scratch.clear();
        scratch.extend_from_slice(&values[..len]);
        let (_, lower, above) = scratch.select_nth_unstable_by(count - 1, f32::total_cmp);
        (*lower, above.iter().copied().fold(f32::INFINITY, f32::min))
    };
    if len.is_multiple_of(2) { f32::midpoint(lower, upper) } else { lower }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    fn values(count: usize, steps: u64, power: i32) -> Vec<f32> {
        let mut numbers = Numbers::new(count as u64 + steps);
        (0..count).map(|_| (numbers.below(steps) as f32).powi(power)).collect()
    }

    #[test]
    fn thresholds_leave_as_many_values_as_asked_and_are_found_for_different_values() {
        let (mut found, mut all) = (0, 0);
        for (count, steps, power) in
            [(1, 5, 1), (2, 9, 1), (50, 1_000_000, 1), (97, 1 << 30, 2), (255, 1 << 24, 3)]
        {
            let mut values = values(count, steps, power);
            fill_up(&mut values);
            for asked in 1..=count {
                all += 1;
                if let Some(limit) = threshold(&values, count, asked) {
                    found += 1;
                    assert_eq!(values.iter().filter(|value| **value <= limit).count(), asked);
                }
            }
        }
        assert!(found * 10 > all * 9, "{found} of {all}");
    }

    #[test]
    fn medians_are_those_of_sorted_values_also_of_equal_ones() {
        for (count, steps, power) in [
            (1, 9, 1),
            (2, 9, 1),
            (3, 2, 1),
            (50, 3, 1),
            (51, 1, 1),
            (50, 1 << 30, 1),
            (255, 40, 2),
            (90, 1 << 20, 3),
        ] {
            let mut values = values(count, steps, power);
            let mut sorted = values.clone();
            sorted.sort_by(f32::total_cmp);
            let expected = f32::midpoint(sorted[(count - 1) / 2], sorted[count / 2]);
            assert_eq!(fill_up(&mut values), count);
            assert_eq!(
                median(&values, count, &mut Vec::new()).to_bits(),
                expected.to_bits(),
                "{count} {steps}"
            );
        }
        assert_eq!(median(&[], 0, &mut Vec::new()).to_bits(), 0.0_f32.to_bits());
        assert_eq!(threshold(&[0.0; 40], 40, 20), None);
    }
}
