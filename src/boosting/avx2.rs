//! The two inner loops of the evaluation of trees for processors with AVX2. Their results equal those of
//! `portable.rs` to the bit.

use std::arch::x86_64::{
    __m128i, __m256, __m256i, _CMP_GT_OQ, _mm_srli_si128, _mm256_and_si256, _mm256_blendv_ps,
    _mm256_castps_si256, _mm256_castsi256_ps, _mm256_castsi256_si128, _mm256_cmp_ps, _mm256_cmpeq_epi8,
    _mm256_cvtepu8_epi32, _mm256_extracti128_si256, _mm256_movemask_epi8, _mm256_or_si256,
    _mm256_packs_epi16, _mm256_packs_epi32, _mm256_permutevar8x32_epi32, _mm256_set1_epi8, _mm256_set1_epi32,
    _mm256_set1_epi64x, _mm256_set1_ps, _mm256_setr_epi8, _mm256_setzero_si256, _mm256_shuffle_epi8,
    _mm256_slli_epi32,
};

use super::portable::{BITS, DIGITS, Rows, WORDS};
use super::tree::MOST_LEAVES;

/// Number of values in a vector.
const LANES: usize = 8;

/// For every threshold of a feature, writes which of the `values` are above it into word `word` of its entry
/// in `above`.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn compare(thresholds: &[f32], values: &[f32; BITS], word: usize, above: &mut [Rows]) {
    // Packing joins four vectors: first their lower halves in turn, then their upper halves. So vector v of
    // the four has rows 4 v to 4 v + 3 in its lower half, and the rows 16 further on in its upper half. Then
    // bit n of the packed comparisons belongs to row n.
    let vectors: [__m256; LANES] = std::array::from_fn(|vector| {
        let lane = |lane| 32 * (vector / 4) + 16 * (lane / 4) + 4 * (vector % 4) + lane % 4;
        bytemuck::cast::<[f32; LANES], __m256>(std::array::from_fn(|number| values[lane(number)]))
    });
    for (threshold, above) in thresholds.iter().zip(above) {
        let threshold = _mm256_set1_ps(*threshold);
        let greater =
            vectors.map(|vector| _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(vector, threshold)));
        let [low, high] = [0, 4].map(|first| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|next| greater[first + next]);
            let bytes = _mm256_packs_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
            u64::from(_mm256_movemask_epi8(bytes).cast_unsigned())
        });
        above[word % WORDS] = low | high << 32;
    }
}

/// Adds the value of each row's leaf to its score. `digits` are the binary digits of the numbers of the
/// leaves.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn add(digits: [u64; DIGITS], values: &[i32; MOST_LEAVES], scores: &mut [i32; BITS]) {
    let eights: [__m256i; MOST_LEAVES / LANES] = bytemuck::cast(*values);
    let halves: [[i32; 2]; DIGITS] = bytemuck::cast(digits);
    for (half, scores) in scores.as_chunks_mut::<32>().0.iter_mut().enumerate() {
        let numbers = numbers(halves.map(|halves| halves[half]));
        let (low, high) = (_mm256_castsi256_si128(numbers), _mm256_extracti128_si256::<1>(numbers));
        let groups = [low, _mm_srli_si128::<8>(low), high, _mm_srli_si128::<8>(high)];
        for (group, scores) in groups.into_iter().zip(scores.as_chunks_mut::<LANES>().0) {
            let found: [i32; LANES] = bytemuck::cast(look_up(&eights, group));
            scores.iter_mut().zip(found).for_each(|(score, value)| *score += value);
        }
    }
}

/// The numbers of the leaves of 32 rows, one byte each.
#[target_feature(enable = "avx2")]
#[inline]
fn numbers(digits: [i32; DIGITS]) -> __m256i {
    // Byte n gets the byte of the digits that contains bit n, and keeps only this bit.
    let byte = _mm256_setr_epi8(
        0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3,
    );
    let bit = _mm256_set1_epi64x(0x8040_2010_0804_0201_u64.cast_signed());
    let mut numbers = _mm256_setzero_si256();
    for (digit, bits) in digits.into_iter().enumerate() {
        let own = _mm256_and_si256(_mm256_shuffle_epi8(_mm256_set1_epi32(bits), byte), bit);
        let value = _mm256_set1_epi8(1 << digit);
        numbers = _mm256_or_si256(numbers, _mm256_and_si256(_mm256_cmpeq_epi8(own, bit), value));
    }
    numbers
}

/// The values of the leaves whose numbers are the first eight bytes of `numbers`. `eights` are the values of
/// all leaves.
#[target_feature(enable = "avx2")]
#[inline]
fn look_up(eights: &[__m256i; MOST_LEAVES / LANES], numbers: __m128i) -> __m256i {
    let numbers = _mm256_cvtepu8_epi32(numbers);
    // The last three digits choose a value in each eight. Then the other two digits, moved to the sign bits,
    // choose the eight.
    let of_eight = eights.map(|eight| _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(eight, numbers)));
    let fourth = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(numbers));
    let fifth = _mm256_castsi256_ps(_mm256_slli_epi32::<27>(numbers));
    let low = _mm256_blendv_ps(of_eight[0], of_eight[1], fourth);
    let high = _mm256_blendv_ps(of_eight[2], of_eight[3], fourth);
    _mm256_castps_si256(_mm256_blendv_ps(low, high, fifth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boosting::portable;
    use crate::numbers::Numbers;

    /// Numbers that look random.
    fn numbers() -> impl Iterator<Item = u64> {
        let mut numbers = Numbers::new(5);
        std::iter::repeat_with(move || numbers.bits()).map(|bits| bits ^ bits >> 33)
    }

    #[test]
    fn the_loops_give_what_the_portable_ones_give() {
        if is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "what needs AVX2 can only be called by an unsafe call")]
            // SAFETY: the processor has AVX2.
            unsafe {
                compare_loops();
            }
        }
    }

    #[target_feature(enable = "avx2")]
    fn compare_loops() {
        let mut numbers = numbers();
        for count in [1, 3, 63, 255] {
            let mut thresholds: Vec<f32> = numbers.by_ref().take(count).map(|n| (n % 999) as f32).collect();
            thresholds.sort_by(f32::total_cmp);
            let mut values: [f32; BITS] =
                std::array::from_fn(|_| numbers.next().map_or(0.0, |n| (n % 999) as f32));
            values[3] = f32::NAN;
            values[17] = f32::INFINITY;
            values[40] = f32::NEG_INFINITY;
            values[63] = thresholds[count / 2];
            let mut above = [vec![Rows::default(); count], vec![Rows::default(); count]];
            for word in 0..WORDS {
                values.rotate_left(1);
                portable::compare(&thresholds, &values, word, &mut above[0]);
                compare(&thresholds, &values, word, &mut above[1]);
            }
            assert_eq!(above[0], above[1]);
            for (threshold, above) in thresholds.iter().zip(&above[0]) {
                let expected =
                    (0..BITS).fold(0, |word, row| word | u64::from(values[row] > *threshold) << row);
                assert_eq!(above[WORDS - 1], expected);
            }
        }
        let mut scores = [[7; BITS]; 2];
        for _ in 0..20 {
            let digits = std::array::from_fn(|_| numbers.next().unwrap());
            let values = std::array::from_fn(|_| (numbers.next().unwrap() % 9_999) as i32 - 5_000);
            portable::add(digits, &values, &mut scores[0]);
            add(digits, &values, &mut scores[1]);
            assert_eq!(scores[0], scores[1]);
        }
    }
}
