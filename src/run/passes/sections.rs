//! Sections of the payload of a unit of a step of a method.

/// The payload that the method returns for the tile.
pub(crate) const PAYLOAD: usize = 0;
/// The border that other tiles see in the next round.
pub(crate) const BORDER: usize = 1;
/// In the last step: the objects of the tile, whole or in part, and the points that it shares with other
/// tiles.
pub(crate) const OBJECTS: usize = 2;
/// In the last step: the label of each point of objects in the core, by ascending id, as little-endian u32.
pub(crate) const LABELS: usize = 3;
