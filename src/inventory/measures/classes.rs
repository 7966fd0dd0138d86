//! Codes of the classes ([`crate::model::Kind::class`]) that attributes distinguish.

/// Trees of any size.
pub(crate) const TREE: u8 = 2;
/// Lamps, signs, signals, utility poles.
pub(crate) const POLE: u8 = 3;
/// Cars and larger.
pub(crate) const VEHICLE: u8 = 4;
/// Houses and their parts.
pub(crate) const BUILDING: u8 = 5;
/// Fences, hedges, walls and bushes.
pub(crate) const FENCE: u8 = 6;
/// Persons and small furniture.
pub(crate) const SMALL: u8 = 7;
/// Wires between poles.
pub(crate) const WIRE: u8 = 8;
