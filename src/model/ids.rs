//! Numbers of tiles and files, as types of their own: a number of one thing is never taken for that of another, and one
//! that does not fit is a panic with a reason instead of wrong data.

use serde::{Deserialize, Serialize};

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
                Self(u32::try_from(place).expect(concat!("a run has fewer than 2^32 of them: ", $what)))
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
