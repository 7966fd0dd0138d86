//! What is known of an object besides its points.

use glam::DVec3;

/// What there is to know of an object, beside its points.
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
}
