//! How surfaces reflect a pulse of near-infrared light.

use std::sync::LazyLock;

use rustc_hash::FxHashMap;
use serde::Deserialize;

use crate::synth::shipped::shipped;

/// Optical properties of a material; explained in `materials.toml`.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Material {
    pub(crate) reflectance: f32,
    pub(crate) speckle: f32,
    pub(crate) roughness: f32,
    pub(crate) lost: f32,
    #[serde(default)]
    pub(crate) through: f32,
    #[serde(default)]
    pub(crate) mirrored: f32,
}

static MATERIALS: LazyLock<FxHashMap<String, Material>> =
    LazyLock::new(|| shipped(include_str!("materials.toml")));

/// The material of this name, which must exist.
pub(crate) fn material(name: &str) -> &'static Material {
    &MATERIALS[name]
}
