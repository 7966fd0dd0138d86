//! Properties of an object besides its points.

use glam::DVec3;

use super::truth::Truth;

/// Where an object is.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Place {
    /// The object stands: its foot in metres from the street's origin, at a chainage.
    Stands { base: DVec3, s: f64 },
    /// The object moves, with this speed in km/h.
    Moves { speed_kmh: f64 },
}

/// Properties of an object besides its points.
#[derive(Debug)]
pub(crate) struct Object {
    /// Number in the drive, from 1.
    pub(crate) id: u32,
    pub(crate) class: u8,
    pub(crate) kind: &'static str,
    pub(crate) place: Place,
    pub(crate) height: f64,
    /// The true measures that an inventory should find.
    pub(crate) truth: Truth,
}
