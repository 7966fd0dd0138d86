//! Properties of an object besides its points.

use glam::DVec3;

use super::truth::Truth;

/// Where an object is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// Its foot, metres from the street's origin, at a chainage.
    Stands { base: DVec3, s: f64 },
    /// It is in another place at any time. Its speed is in km/h.
    Moves { speed_kmh: f64 },
}

/// Properties of an object besides its points.
#[derive(Debug)]
pub(super) struct Object {
    /// Number in the drive, from 1.
    pub(super) id: u32,
    pub(super) class: u8,
    pub(super) kind: &'static str,
    pub(super) place: Place,
    pub(super) height: f64,
    /// What an inventory should find.
    pub(super) truth: Truth,
}
