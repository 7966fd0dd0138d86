//! Points in columns, and the two inner loops of a search: `look` finds points near a place, `keep` drops
//! those that are no longer near enough. `avx2.rs` has the same loops for processors with AVX2.
//!
//! Squared distances are in single precision. Integers up to 2^24 are exact in it, and larger ones are never
//! rounded below 2^24. So squared distances below [`EXACT`] are exact, and so are comparisons with limits
//! below it.

use crate::spatial::ranks::threshold_from;

/// Number of values of a vector. Columns have room for one vector after the last value.
pub(in crate::spatial) const LANES: usize = SLOTS as usize;
/// The same as a number of slots: block n has the 8 slots from 8 n.
pub(super) const SLOTS: u32 = 8;
/// Squared distances below this are exact.
pub(in crate::spatial) const EXACT: u64 = 1 << 24;

/// Largest number of points in columns.
pub(in crate::spatial) const MOST: usize = 1_024;
/// Room of columns: one more vector, for values beyond the last point.
const ROOM: usize = MOST + LANES;

/// At most as many points as a vector has values.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block {
    /// Integer coordinates, not negative.
    pub(in crate::spatial) axes: [[i32; LANES]; 3],
    /// Number of points.
    pub(in crate::spatial) len: u32,
}

/// The boxes of blocks that may be near.
#[derive(Debug, Default)]
pub(crate) struct Boxes {
    /// Numbers of the blocks.
    pub(super) blocks: Vec<u32>,
    /// Their lower and upper corners, relative to one common place. Entries beyond the last box are
    /// infinitely far away.
    pub(super) low: [Vec<f32>; 3],
    pub(super) high: [Vec<f32>; 3],
}

impl Boxes {
    /// Begins a new list.
    pub(in crate::spatial) fn clear(&mut self) {
        self.blocks.clear();
        self.low.iter_mut().chain(&mut self.high).for_each(Vec::clear);
    }

    /// Number of blocks.
    pub(in crate::spatial) fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Adds the box of a block.
    #[inline]
    pub(in crate::spatial) fn push(&mut self, block: u32, low: [i32; 3], high: [i32; 3], origin: [i32; 3]) {
        self.blocks.push(block);
        for axis in 0..3 {
            self.low[axis].push((low[axis] - origin[axis]) as f32);
            self.high[axis].push((high[axis] - origin[axis]) as f32);
        }
    }

    /// Completes the list with boxes that are infinitely far away.
    pub(in crate::spatial) fn end(&mut self) {
        let len = self.blocks.len() + LANES;
        self.low.iter_mut().chain(&mut self.high).for_each(|corner| corner.resize(len, f32::INFINITY));
    }
}

/// A search request.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    /// The first box and the end of the boxes that are searched.
    pub(in crate::spatial) first: usize,
    pub(in crate::spatial) end: usize,
    /// The place around which points are searched. `limit` is their largest squared distance.
    pub(in crate::spatial) place: [i32; 3],
    /// The place to which the corners of the boxes are relative.
    pub(in crate::spatial) origin: [i32; 3],
    pub(in crate::spatial) limit: f32,
    /// The search stops when more points than this are found. At most [`MOST`] minus one vector.
    pub(in crate::spatial) most: usize,
}

/// Points near a place. Arrays of fixed size save most bounds checks.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    pub(super) len: usize,
    /// No point is further than this (squared).
    pub(super) limit: f32,
    pub(super) squared: [f32; ROOM],
    pub(super) by: [[i32; ROOM]; 3],
    pub(super) at: [u32; ROOM],
}

impl Default for Columns {
    fn default() -> Self {
        Self { len: 0, limit: 0.0, squared: [0.0; ROOM], by: [[0; ROOM]; 3], at: [0; ROOM] }
    }
}

impl Columns {
    /// Begins a search for points within `limit` (squared).
    pub(in crate::spatial) fn begin(&mut self, limit: f32) {
        self.len = 0;
        self.limit = limit;
    }

    /// Adds a point. There must be room for it.
    pub(in crate::spatial) fn push(&mut self, squared: f32, by: [i32; 3], at: u32) {
        self.squared[self.len] = squared;
        self.by.iter_mut().zip(by).for_each(|(axis, by)| axis[self.len] = by);
        self.at[self.len] = at;
        self.len += 1;
    }

    /// Number of points.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The slot of each point in the index.
    #[inline]
    pub(crate) fn at(&self) -> &[u32] {
        &self.at[..self.len]
    }

    /// No point is further than this (squared).
    #[inline]
    pub(crate) fn limit(&self) -> f32 {
        self.limit
    }

    /// Squared distances in whole rows, after [`Columns::separate`]. Entries beyond the points are infinite.
    #[inline]
    pub(crate) fn squared(&self) -> &[f32] {
        &self.squared[..self.len.next_multiple_of(LANES)]
    }

    /// Coordinates relative to the place, in whole rows. Entries beyond the points have any value.
    #[inline]
    pub(crate) fn by(&self) -> [&[i32]; 3] {
        [0, 1, 2].map(|axis| &self.by[axis][..self.len.next_multiple_of(LANES)])
    }

    /// Replaces squared distances by other values, in whole rows.
    #[inline]
    pub(crate) fn value_by(&mut self, values: &[f32]) {
        self.squared[..values.len()].copy_from_slice(values);
    }

    /// A limit within which the `count` nearest points are, and no others. Equally near points are ordered by
    /// `number`. Other points at exactly this distance get a slightly larger one. `count` is 1 to the number
    /// of points.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    pub(crate) fn separate(&mut self, count: usize, number: &[u32]) -> f32 {
        self.squared[self.len..self.len + LANES].fill(f32::INFINITY);
        // On a plane, the number of points within a distance is about proportional to its square.
        let guess = self.limit * (count as f32 / self.len as f32);
        match threshold_from(self.squared(), self.len, count, guess) {
            Some(limit) => limit,
            None => self.separate_ties(count, number),
        }
    }

    /// The same if no limit separates the distances.
    #[cold]
    fn separate_ties(&mut self, count: usize, number: &[u32]) -> f32 {
        // Rounding keeps the order of distances, but different ones may become equal. Coordinates are exact.
        let exact = |point: usize| self.by.iter().map(|axis| f64::from(axis[point]).powi(2)).sum::<f64>();
        let key = |point: usize| (exact(point).to_bits(), number[self.at[point] as usize], point);
        let mut order: Vec<(u64, u32, usize)> = (0..self.len).map(key).collect();
        let (_, last, others) = order.select_nth_unstable(count - 1);
        let limit = self.squared[last.2];
        for (_, _, point) in others {
            let squared = &mut self.squared[*point];
            *squared = squared.max(limit.next_up());
        }
        limit
    }
}

/// Adds the points of near blocks until there are too many. Returns the first box that was not searched.
pub(super) fn look(blocks: &[Block], boxes: &Boxes, look: Look, found: &mut Columns) -> usize {
    let Look { first, end, place, origin, limit, most } = look;
    let from_origin = [0, 1, 2].map(|axis| (place[axis] - origin[axis]) as f32);
    for next in first..end {
        let gap = [0, 1, 2].map(|axis| {
            let at = from_origin[axis];
            (boxes.low[axis][next] - at).max(at - boxes.high[axis][next]).max(0.0)
        });
        if gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2] > limit {
            continue;
        }
        let number = boxes.blocks[next];
        let Block { axes, len } = &blocks[number as usize];
        let [x, y, z] = [0, 1, 2].map(|axis| axes[axis].map(|value| value - place[axis]));
        let squared: [f32; LANES] = std::array::from_fn(|lane| {
            let [x, y, z] = [x[lane] as f32, y[lane] as f32, z[lane] as f32];
            x * x + y * y + z * z
        });
        let room = found.len..found.len + LANES;
        let [to_x, to_y, to_z] = found.by.each_mut().map(|axis| &mut axis[room.clone()]);
        let (to_squared, to) = (&mut found.squared[room.clone()], &mut found.at[room]);
        let mut kept = 0;
        for (lane, at) in (0..*len as usize).zip(number * SLOTS..) {
            // Every point is written, but counted only if it is near: a branch could not be predicted.
            (to_x[kept], to_y[kept], to_z[kept]) = (x[lane], y[lane], z[lane]);
            (to_squared[kept], to[kept]) = (squared[lane], at);
            kept += usize::from(squared[lane] <= limit);
        }
        found.len += kept;
        if found.len > most {
            return next + 1;
        }
    }
    end
}

/// Keeps the points within `limit` (squared), in their order.
pub(super) fn keep(found: &mut Columns, limit: f32) {
    let Columns { len, limit: farthest, squared, by: [x, y, z], at } = found;
    *farthest = limit;
    let mut kept = 0;
    for next in 0..*len {
        let value = squared[next];
        (x[kept], y[kept], z[kept]) = (x[next], y[next], z[next]);
        (squared[kept], at[kept]) = (value, at[next]);
        kept += usize::from(value <= limit);
    }
    *len = kept;
}
