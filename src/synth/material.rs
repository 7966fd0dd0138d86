//! How surfaces reflect a pulse of near-infrared light; no geometry.

use std::sync::LazyLock;

use rustc_hash::FxHashMap;
use serde::Deserialize;

use super::shipped::shipped;

/// Optical properties of a material; explained in `materials.toml`.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Material {
    pub(super) reflectance: f32,
    pub(super) speckle: f32,
    pub(super) roughness: f32,
    pub(super) lost: f32,
    #[serde(default)]
    pub(super) through: f32,
    #[serde(default)]
    pub(super) mirrored: f32,
}

static MATERIALS: LazyLock<FxHashMap<String, Material>> =
    LazyLock::new(|| shipped(include_str!("materials.toml")));

/// The material of this name, which must exist.
pub(super) fn material(name: &str) -> &'static Material {
    &MATERIALS[name]
}
