//! Which of some values are the smallest, without sorting: a threshold is guessed and corrected until the
//! right number of values is not above it. Values are distances, or squares of distances in a plane, so their
//! number below a threshold is about proportional to it, and a few guesses suffice. Each guess counts without
//! branches, four values at a time.

/// Most guesses. Equal values may have no threshold between them, then no guess is right.
const GUESSES: usize = 12;

/// A value above which all but the `count` smallest of these values are. `None` if it is not found, for
/// example because the values around it are equal. Values are finite and not negative; `count` is 1 to their
/// number.
pub(crate) fn threshold(values: &[f32], count: usize) -> Option<f32> {
    // Eight sums side by side, because additions of floats keep their order.
    let (rows, rest) = values.as_chunks::<8>();
    let mut sums = [0.0_f32; 8];
    for row in rows {
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    let sum = sums.iter().chain(rest).sum::<f32>();
    // `low` is below, `high` is above: the numbers of values that are not above them.
    let (mut low, mut high) = ((0.0_f32, 0_usize), (f32::INFINITY, values.len() + 1));
    // Even values from 0 have this share below: twice the mean is the largest.
    let mut guess = 2.0 * sum / values.len() as f32 * (count as f32 / values.len() as f32);
    for _ in 0..GUESSES {
        let found: u32 = values.iter().map(|value| u32::from(*value <= guess)).sum();
        let found = found as usize;
        if found == count {
            return Some(guess);
        }
        if found < count {
            low = (guess, found);
        } else {
            high = (guess, found);
        }
        guess = if high.0.is_finite() {
            // Between both, aimed at the middle between two values.
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

/// The median of values: finite, not negative. `scratch` is overwritten. 0 without values.
pub(crate) fn median(values: &[f32], scratch: &mut Vec<f32>) -> f32 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let count = last / 2 + 1;
    let (lower, upper) = if let Some(limit) = threshold(values, count) {
        values.iter().fold((0.0_f32, f32::INFINITY), |(lower, upper), &value| {
            let below = value <= limit;
            (lower.max(if below { value } else { 0.0 }), upper.min(if below { f32::INFINITY } else { value }))
        })
    } else {
        scratch.clear();
        scratch.extend_from_slice(values);
        let (_, lower, above) = scratch.select_nth_unstable_by(count - 1, f32::total_cmp);
        (*lower, above.iter().copied().fold(f32::INFINITY, f32::min))
    };
    if values.len().is_multiple_of(2) { f32::midpoint(lower, upper) } else { lower }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(count: usize, steps: u64, power: i32) -> Vec<f32> {
        let mut state = count as u64 + steps;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % steps
        };
        (0..count).map(|_| (next() as f32).powi(power)).collect()
    }

    #[test]
    fn thresholds_leave_as_many_values_as_asked_and_are_found_for_different_values() {
        let (mut found, mut all) = (0, 0);
        for (count, steps, power) in
            [(1, 5, 1), (2, 9, 1), (50, 1_000_000, 1), (97, 1 << 30, 2), (255, 1 << 24, 3)]
        {
            let values = values(count, steps, power);
            for asked in 1..=count {
                all += 1;
                if let Some(limit) = threshold(&values, asked) {
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
            let values = values(count, steps, power);
            let mut sorted = values.clone();
            sorted.sort_by(f32::total_cmp);
            let expected = f32::midpoint(sorted[(count - 1) / 2], sorted[count / 2]);
            assert_eq!(median(&values, &mut Vec::new()).to_bits(), expected.to_bits(), "{count} {steps}");
        }
        assert_eq!(median(&[], &mut Vec::new()).to_bits(), 0.0_f32.to_bits());
        assert_eq!(threshold(&[0.0; 40], 20), None);
    }
}
