//! Numbers of tiles and files, as types of their own: a number of one thing is never taken for that of another, and one
//! that does not fit is a panic with a reason instead of wrong data.

use serde::{Deserialize, Serialize};

/// A count or a number that fits 32 bits wherever memory and files allow it.
///
/// # Panics
/// With `what`, when it does not fit: wrong data would be worse. A panic is caught at the tile.
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

macro_rules! number {
    ($name:ident, $what:literal) => {
        impl $name {
            #[doc = concat!("The ", $what, " with a number.")]
            #[must_use]
            pub const fn new(number: u32) -> Self {
                Self(number)
            }

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

            #[doc = concat!("The number of the ", $what, ".")]
            #[must_use]
            pub const fn number(self) -> u32 {
                self.0
            }

            /// The first so many, ascending.
            pub fn first(count: usize) -> impl DoubleEndedIterator<Item = Self> {
                (0..count).map(Self::at)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(out)
            }
        }
    };
}

number!(TileId, "tile");
number!(FileId, "file");
