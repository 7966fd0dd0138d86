//! The exponential function, the logarithm and shares of classes as fixed sequences of IEEE operations. The
//! functions of the platforms differ in the last bit.

/// Number of units of a score per 1: scores are whole numbers.
pub(super) const UNITS: f64 = 65_536.0;

/// Sum of the shares of a row.
pub(super) const WHOLE: u8 = 255;

/// ln 2 in two parts. The first has few digits, so that its product with a small whole number is exact.
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// Number of terms of the series. The error of 13 terms is below the last digit for arguments up to ln 2 / 2.
const TERMS: i32 = 13;

/// Argument below which the result is 0: it would be smaller than 1e-300.
const LOWEST: f64 = -690.0;

/// 1.5 * 2^52. Adding and subtracting it rounds a number below 2^51 to a whole number, because doubles of
/// this size have no fractions. The function of the platform would be a call for each number.
const TO_WHOLE: f64 = 6_755_399_441_055_744.0;

/// e to the power of each `x`, for `x` up to 690. All numbers take each step together, so that no division
/// waits for another one.
#[inline]
fn exps<const N: usize>(x: [f64; N]) -> [f64; N] {
    let power = x.map(|x| (x.clamp(LOWEST, -LOWEST) * std::f64::consts::LOG2_E + TO_WHOLE) - TO_WHOLE);
    let rest: [f64; N] = std::array::from_fn(|n| (x[n] - power[n] * LN2_HIGH) - power[n] * LN2_LOW);
    let mut sum = [1.0; N];
    for term in (1..=TERMS).rev() {
        for (sum, rest) in sum.iter_mut().zip(rest) {
            *sum = 1.0 + rest * *sum / f64::from(term);
        }
    }
    std::array::from_fn(|n| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number from 23 to 2023"
        )]
        let exponent = (power[n] + 1023.0) as u64;
        if x[n] < LOWEST { 0.0 } else { sum[n] * f64::from_bits(exponent << 52) }
    })
}

/// e to the power of `x`, for `x` up to 690.
pub(super) fn exp(x: f64) -> f64 {
    let [exp] = exps([x]);
    exp
}

/// The natural logarithm of `x`, which is from 1e-12 to 1: Halley's method on [`exp`].
pub(super) fn ln(x: f64) -> f64 {
    let mut y = 0.0;
    // Once the error is below 1, each step cubes it. Before that, a step is about 2.
    for _ in 0..24 {
        let e = exp(y);
        y += 2.0 * (x - e) / (x + e);
    }
    y
}

/// Probabilities of the classes from their scores.
#[inline]
pub(super) fn softmax(scores: &[i32], probabilities: &mut [f64]) {
    let most = scores.iter().copied().max().unwrap_or(0);
    let below = |score: i32| (f64::from(score) - f64::from(most)) / UNITS;
    let (fours, rest) = scores.as_chunks::<4>();
    let (of_fours, of_rest) = probabilities.as_chunks_mut::<4>();
    of_fours.iter_mut().zip(fours).for_each(|(exp, &scores)| *exp = exps(scores.map(below)));
    of_rest.iter_mut().zip(rest).for_each(|(one, &score)| *one = exp(below(score)));
    let sum = probabilities.iter().fold(0.0, |sum, exp| sum + exp);
    probabilities.iter_mut().for_each(|probability| *probability /= sum);
}

/// Whole shares from scores. They add up to [`WHOLE`]: each is rounded down, and the remainder goes to the
/// largest fractions, among equal ones to the first class.
#[inline]
pub(super) fn shares<const K: usize>(scores: &[i32; K]) -> [u8; K] {
    let mut fractions = [0.0; K];
    softmax(scores, &mut fractions);
    let mut shares = [0; K];
    let mut left = WHOLE;
    for (share, fraction) in shares.iter_mut().zip(&mut fractions) {
        let exact = *fraction * f64::from(WHOLE);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 255")]
        let whole = exact as u8;
        *share = whole;
        // Rounding can make the sum of the products exceed the whole in its last digit; then nothing is left.
        left = left.saturating_sub(whole);
        *fraction = exact - f64::from(whole);
    }
    for _ in 0..left {
        let mut best = 0;
        for class in 1..K {
            if fractions[class] > fractions[best] {
                best = class;
            }
        }
        shares[best] += 1;
        fractions[best] = -1.0;
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_those_of_the_platform_but_for_the_last_digits() {
        for step in -6_000..=600_i32 {
            let x = f64::from(step) / 10.0;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-14, "exp({x})");
        }
        assert_eq!(exp(0.0).to_bits(), 1.0_f64.to_bits());
        assert_eq!(exp(-1e9).to_bits(), 0.0_f64.to_bits());
        let bits = |exps: [f64; 4]| exps.map(f64::to_bits);
        assert_eq!(bits(exps([-700.0, -0.1, 0.0, -3.0])), bits([0.0, exp(-0.1), 1.0, exp(-3.0)]));
        // Expected bits, computed once: a platform or compiler that contracts operations would change them.
        assert_eq!(exp(-1.0).to_bits(), (-1.0_f64).exp().to_bits());
        for x in [1e-12, 1e-6, 0.01, 0.125, 0.5, 0.999, 1.0] {
            assert!((ln(x) - f64::ln(x)).abs() < 1e-13, "ln({x})");
        }
    }

    #[test]
    fn shares_add_up_and_follow_the_scores() {
        for seed in 0..2_000_i32 {
            let score = |class: i32| seed.wrapping_mul(7_919).wrapping_add(class * 104_729) % 400_000;
            let scores: [i32; 8] = std::array::from_fn(|class| score(i32::try_from(class).unwrap() * seed));
            let found = shares(&scores);
            assert_eq!(found.iter().map(|&share| u32::from(share)).sum::<u32>(), 255);
            for a in 0..8 {
                for b in 0..8 {
                    assert!(scores[a] <= scores[b] || found[a] >= found[b], "{scores:?} {found:?}");
                }
            }
        }
        assert_eq!(shares(&[0, 0]), [128, 127]);
        assert_eq!(shares(&[i32::MAX, i32::MIN, 0]), [255, 0, 0]);
    }
}
