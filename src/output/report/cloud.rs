//! Points as bytes for the page: planes of one byte per point, which compress well because neighbours are
//! alike.
//!
//! ```text
//! planes := key (4) x (4) y (4) z (4) more      each plane has one byte of every point
//! key    := difference to the point before
//! x y z  := difference to the point before, sign in the lowest bit
//! more   := in the page: intensity (1); in the stream: intensity (2) class of the object (1)
//! ```
//!
//! Coordinates are in steps from an origin: steps of 1 cm in the page, and of the scale of the file in the
//! stream.

use super::sample::SamplePoint;

/// Number of planes of key and place.
const PLACE_PLANES: usize = 16;

/// The bytes of the points of the page. Sorts them by object and place.
pub(super) fn planes(points: &mut [SamplePoint], range: Intensities) -> Vec<u8> {
    points.sort_unstable_by_key(|point| (point.key, along_curve(point.place), point.place, point.rank));
    let mut bytes = coded(points.iter().map(|point| (point.key, point.place)), 1);
    let shades = &mut bytes[PLACE_PLANES * points.len()..];
    for (shade, point) in shades.iter_mut().zip(points.iter()) {
        *shade = range.shade(point.intensity);
    }
    bytes
}

/// The planes of keys and places, followed by `more` planes of zeros. Keys ascend.
pub(super) fn coded(points: impl ExactSizeIterator<Item = (u32, [i32; 3])>, more: usize) -> Vec<u8> {
    let count = points.len();
    let mut bytes = vec![0; (PLACE_PLANES + more) * count];
    let mut word = |plane: usize, at: usize, value: u32| {
        for (byte, part) in value.to_le_bytes().into_iter().enumerate() {
            bytes[(plane + byte) * count + at] = part;
        }
    };
    let mut before = (0_u32, [0_i32; 3]);
    for (at, (key, place)) in points.enumerate() {
        word(0, at, key.wrapping_sub(before.0));
        for (axis, (value, before)) in place.into_iter().zip(before.1).enumerate() {
            word(4 + 4 * axis, at, zigzag(value.wrapping_sub(before)));
        }
        before = (key, place);
    }
    bytes
}

/// A difference with its sign in the lowest bit.
#[expect(clippy::cast_sign_loss, reason = "the bits are meant")]
fn zigzag(difference: i32) -> u32 {
    ((difference << 1) ^ (difference >> 31)) as u32
}

/// Position on a Z-order curve (Morton 1966) with cells of 8 cm, so that neighbours follow one another.
fn along_curve(place: [i32; 3]) -> u64 {
    let spread = |value: i32| {
        #[expect(clippy::cast_sign_loss, reason = "at or above the origin, or far away")]
        let mut bits = u64::from((value >> 3) as u32) & 0x1f_ffff;
        bits = (bits | (bits << 32)) & 0x001f_0000_0000_ffff;
        bits = (bits | (bits << 16)) & 0x001f_0000_ff00_00ff;
        bits = (bits | (bits << 8)) & 0x100f_00f0_0f00_f00f;
        bits = (bits | (bits << 4)) & 0x10c3_0c30_c30c_30c3;
        (bits | (bits << 2)) & 0x1249_2492_4924_9249
    };
    spread(place[0]) | (spread(place[1]) << 1) | (spread(place[2]) << 2)
}

/// The range of intensities within which shades differ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Intensities {
    pub(super) low: u16,
    pub(super) high: u16,
}

impl Intensities {
    /// From the 1st to the 99th percentile, because a few strong reflectors would make everything else dark.
    pub(super) fn of(points: &[SamplePoint]) -> Self {
        let mut all: Vec<u16> = points.iter().map(|point| point.intensity).collect();
        all.sort_unstable();
        let at = |share: usize| all.get(all.len().saturating_sub(1) * share / 100).copied().unwrap_or(0);
        Self { low: at(1), high: at(99) }
    }

    fn shade(self, intensity: u16) -> u8 {
        let over = u32::from(intensity.clamp(self.low, self.high) - self.low);
        let share = over * 255 / u32::from(self.high - self.low).max(1);
        u8::try_from(share).unwrap_or(u8::MAX)
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    fn point(key: u32, place: [i32; 3], intensity: u16) -> SamplePoint {
        SamplePoint { key, place, intensity, ..SamplePoint::zeroed() }
    }

    /// The points as the script of the page reads them.
    fn read(bytes: &[u8]) -> Vec<(u32, [i32; 3], u8)> {
        let count = bytes.len() / (PLACE_PLANES + 1);
        let word = |plane: usize, at: usize| {
            u32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[(plane + byte) * count + at]))
        };
        let (mut key, mut place) = (0, [0_i32; 3]);
        (0..count)
            .map(|at| {
                key += word(0, at);
                for (axis, place) in place.iter_mut().enumerate() {
                    let coded = word(4 + 4 * axis, at);
                    *place += (coded >> 1).cast_signed() ^ -(coded & 1).cast_signed();
                }
                (key, place, bytes[16 * count + at])
            })
            .collect()
    }

    #[test]
    fn planes_hold_every_point() {
        let mut points =
            vec![point(3, [5, -7, 100_000], 40), point(0, [-2, 9, 0], 10), point(3, [4, 0, 99_000], 70)];
        let expected = [(0, [-2, 9, 0], 0), (3, [4, 0, 99_000], 255), (3, [5, -7, 100_000], 255)];
        let range = Intensities::of(&points);
        let mut found = read(&planes(&mut points, range));
        found.sort_unstable();
        assert_eq!(found, expected);
        assert!(planes(&mut [], Intensities::of(&[])).is_empty());
    }
}
