//! Properties of an object besides its points.

use glam::DVec3;

use super::truth::Truth;

/// Properties of an object besides its points.
#[derive(Debug)]
pub(super) struct Object {
    /// Number in the drive, from 1.
    pub(super) id: u32,
    pub(super) class: u8,
    pub(super) kind: &'static str,
    /// Foot, metres from the street's origin.
    pub(super) base: DVec3,
    pub(super) height: f64,
    pub(super) s: f64,
    /// What an inventory should find.
    pub(super) truth: Truth,
}
