//! Numbers of tiles, files and points, as types of their own. So the number of one thing is never mistaken
//! for the number of another, and a number that does not fit causes a panic with a reason instead of wrong
//! data.

use std::ops::{Add, Sub};

use serde::{Deserialize, Serialize};

/// A count or a number as 32 bits. Any count that memory and files allow fits.
///
/// # Panics
/// With `what` in the message if the number does not fit: wrong data would be worse. The panic is caught at
/// the tile.
#[must_use]
pub(crate) fn in_u32<N: TryInto<u32>>(number: N, what: &str) -> u32 {
    match number.try_into() {
        Ok(number) => number,
        #[expect(clippy::panic, reason = "cut off, it would be another number")]
        Err(_) => panic!("{what}: more than 32 bits can count"),
    }
}

/// Number of a tile in its plan, from 0 in the order of chainage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TileId(u32);

/// Number of a file in its catalog, from 0 in the order in which records are numbered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct FileId(u32);

/// Number of a point in its drive, from 0: files in the order of the catalog, records in the order of the
/// file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
#[repr(transparent)]
pub struct PointId(u64);

impl PointId {
    /// Larger than the number of any point. The search for a smallest number starts with it.
    pub const BEYOND_ALL: Self = Self(u64::MAX);

    /// The point at a place in a list of all points.
    #[must_use]
    pub const fn at(place: usize) -> Self {
        Self(place as u64)
    }

    /// This point and all points after it.
    pub fn onward(self) -> impl Iterator<Item = Self> {
        (self.0..).map(Self)
    }
}

impl Add<u64> for PointId {
    type Output = Self;

    /// The point `records` records later.
    fn add(self, records: u64) -> Self {
        Self(self.0 + records)
    }
}

impl Sub for PointId {
    type Output = u64;

    /// The number of records from an earlier point to this one.
    fn sub(self, earlier: Self) -> u64 {
        self.0 - earlier.0
    }
}

macro_rules! number {
    ($name:ident, $number:ty, $what:literal) => {
        impl $name {
            #[doc = concat!("The ", $what, " with a number.")]
            #[must_use]
            pub const fn new(number: $number) -> Self {
                Self(number)
            }

            #[doc = concat!("The number of the ", $what, ".")]
            #[must_use]
            pub const fn number(self) -> $number {
                self.0
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(out)
            }
        }
    };
}

macro_rules! place {
    ($name:ident, $what:literal) => {
        impl $name {
            #[doc = concat!("The ", $what, " at a place in a list.")]
            ///
            /// # Panics
            /// When the place does not fit 32 bits.
            #[must_use]
            pub fn at(place: usize) -> Self {
                Self(in_u32(place, $what))
            }

            #[doc = concat!("The place of the ", $what, " in a list.")]
            #[must_use]
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            #[doc = concat!("The first `count` ", $what, "s, ascending.")]
            pub fn first(count: usize) -> impl DoubleEndedIterator<Item = Self> {
                (0..count).map(Self::at)
            }
        }
    };
}

number!(TileId, u32, "tile");
number!(FileId, u32, "file");
number!(PointId, u64, "point");
place!(TileId, "tile");
place!(FileId, "file");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec;

    #[test]
    fn stored_numbers_have_the_bytes_of_plain_integers() {
        let numbers = [0, 127, 128, 70_000, u64::MAX];
        let points = numbers.map(PointId::new);
        assert_eq!(codec::encode(&points).unwrap(), codec::encode(&numbers).unwrap());
        assert_eq!(codec::encode(&FileId::new(300)).unwrap(), codec::encode(&300_u32).unwrap());
    }

    #[test]
    fn points_are_counted_from_one_to_another() {
        let first = PointId::new(10_310);
        assert_eq!((first + 7) - first, 7);
        assert_eq!(first.onward().take(2).collect::<Vec<_>>(), [first, first + 1]);
        assert!(PointId::BEYOND_ALL > PointId::at(usize::MAX - 1));
    }
}
