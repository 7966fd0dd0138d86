//! The two inner loops of a search for processors with AVX2. Their results equal those of `columns.rs` bit by
//! bit.

use std::arch::x86_64::{
    __m256, __m256i, _CMP_LE_OQ, _mm_cvtsi64_si128, _mm256_add_epi32, _mm256_add_ps, _mm256_cmp_ps,
    _mm256_cvtepi32_ps, _mm256_cvtepu8_epi32, _mm256_max_ps, _mm256_movemask_ps, _mm256_mul_ps,
    _mm256_permutevar8x32_epi32, _mm256_permutevar8x32_ps, _mm256_set1_epi32, _mm256_set1_ps,
    _mm256_setzero_ps, _mm256_sub_epi32, _mm256_sub_ps,
};

use super::columns::{Block, Boxes, Columns, LANES, Look, SLOTS};

/// For each mask, the lanes whose bits are set, ascending, one byte each.
const CHOSEN: [u64; 256] = chosen();

const fn chosen() -> [u64; 256] {
    let mut table = [0; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut next) = (0, 0);
        while lane < LANES {
            if mask & (1 << lane) != 0 {
                table[mask] |= (lane as u64) << (8 * next);
                next += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
}

/// As [`super::columns::look`].
#[target_feature(enable = "avx2,popcnt")]
#[inline]
pub(super) fn look(blocks: &[Block], boxes: &Boxes, look: Look, found: &mut Columns) -> usize {
    let Look { first, end, place, origin, limit, most } = look;
    let from_origin = [0, 1, 2].map(|axis| _mm256_set1_ps((place[axis] - origin[axis]) as f32));
    let place = place.map(|value| _mm256_set1_epi32(value));
    let limit = _mm256_set1_ps(limit);
    let Columns { len, squared, by: [to_x, to_y, to_z], at: to, .. } = found;
    let numbers = &boxes.blocks[..end];
    for eight in (first..end).step_by(LANES) {
        let mut gaps = _mm256_setzero_ps();
        for ((low, high), at) in boxes.low.iter().zip(&boxes.high).zip(from_origin) {
            let below = _mm256_sub_ps(vector(&low[eight..eight + LANES]), at);
            let above = _mm256_sub_ps(at, vector(&high[eight..eight + LANES]));
            let gap = _mm256_max_ps(_mm256_max_ps(below, above), _mm256_setzero_ps());
            gaps = _mm256_add_ps(gaps, _mm256_mul_ps(gap, gap));
        }
        let mut near = within(gaps, limit);
        while near != 0 {
            let next = eight + near.trailing_zeros() as usize;
            near &= near - 1;
            // The last lanes may be beyond the end of the boxes.
            let Some(number) = numbers.get(next) else { break };
            let block = &blocks[*number as usize];
            let by = [0, 1, 2].map(|axis| _mm256_sub_epi32(bytemuck::cast(block.axes[axis]), place[axis]));
            let [x, y, z] = by.map(|by| _mm256_cvtepi32_ps(by));
            let in_plane = _mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y));
            let apart = _mm256_add_ps(in_plane, _mm256_mul_ps(z, z));
            let mask = within(apart, limit) & ((1 << block.len) - 1);
            let order = order(mask);
            let at = _mm256_add_epi32(_mm256_set1_epi32((*number * SLOTS).cast_signed()), order);
            let room = *len..*len + LANES;
            put(&mut squared[room.clone()], apart, order);
            put_whole(&mut to_x[room.clone()], by[0], order);
            put_whole(&mut to_y[room.clone()], by[1], order);
            put_whole(&mut to_z[room.clone()], by[2], order);
            to[room].copy_from_slice(&bytemuck::cast::<__m256i, [u32; LANES]>(at));
            *len += mask.count_ones() as usize;
            if *len > most {
                return next + 1;
            }
        }
    }
    end
}

/// As [`super::columns::keep`].
#[target_feature(enable = "avx2,popcnt")]
#[inline]
pub(super) fn keep(found: &mut Columns, limit: f32) {
    let Columns { len, limit: farthest, squared, by: [x, y, z], at } = found;
    *farthest = limit;
    let limit = _mm256_set1_ps(limit);
    // Values behind the last point must not be kept.
    squared[*len..*len + LANES].fill(f32::INFINITY);
    let mut kept = 0;
    for next in (0..*len).step_by(LANES) {
        let lanes = next..next + LANES;
        let apart = vector(&squared[lanes.clone()]);
        let mask = within(apart, limit);
        let order = order(mask);
        // Only values that have been read already are overwritten.
        let room = kept..kept + LANES;
        put(&mut squared[room.clone()], apart, order);
        for axis in [&mut *x, &mut *y, &mut *z] {
            let by = whole(&axis[lanes.clone()]);
            put_whole(&mut axis[room.clone()], by, order);
        }
        let points = whole(&at[lanes]);
        put_whole(&mut at[room], points, order);
        kept += mask.count_ones() as usize;
    }
    *len = kept;
}

/// The lanes that are not above the limit, one bit each.
#[target_feature(enable = "avx2,popcnt")]
#[inline]
fn within(values: __m256, limit: __m256) -> u32 {
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(values, limit)).cast_unsigned()
}

/// A permutation that moves the lanes of a mask to the front.
#[target_feature(enable = "avx2,popcnt")]
#[inline]
fn order(mask: u32) -> __m256i {
    _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(CHOSEN[mask as usize & 255].cast_signed()))
}

/// A vector of the first values.
#[target_feature(enable = "avx2,popcnt")]
#[inline]
fn vector(values: &[f32]) -> __m256 {
    bytemuck::cast::<[f32; LANES], __m256>(std::array::from_fn(|lane| values[lane]))
}

/// The same for integers.
#[target_feature(enable = "avx2,popcnt")]
#[inline]
fn whole<T: bytemuck::Pod>(values: &[T]) -> __m256i {
    bytemuck::cast::<[T; LANES], __m256i>(std::array::from_fn(|lane| values[lane]))
}

#[target_feature(enable = "avx2,popcnt")]
#[inline]
fn put(to: &mut [f32], values: __m256, order: __m256i) {
    let values = _mm256_permutevar8x32_ps(values, order);
    to.copy_from_slice(&bytemuck::cast::<__m256, [f32; LANES]>(values));
}

#[target_feature(enable = "avx2,popcnt")]
#[inline]
fn put_whole<T: bytemuck::Pod>(to: &mut [T], values: __m256i, order: __m256i) {
    let values = _mm256_permutevar8x32_epi32(values, order);
    to.copy_from_slice(&bytemuck::cast::<__m256i, [T; LANES]>(values));
}
