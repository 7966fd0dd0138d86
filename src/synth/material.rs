//! How surfaces answer a pulse of near-infrared light; no geometry.

use std::sync::LazyLock;

use rustc_hash::FxHashMap;
use serde::Deserialize;

use super::shipped;

/// What a surface is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Material {
    Asphalt,
    Marking,
    Paving,
    Grass,
    Bark,
    Leaf,
    Metal,
    /// Retro-reflective sheet of traffic signs and number plates.
    Retro,
    Plaster,
    Roof,
    Glass,
    Paint,
    DarkPaint,
    Rubber,
    Cloth,
    Wood,
}

/// Optical facts of a material; explained in `materials.toml`.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Optics {
    pub(super) reflectance: f32,
    pub(super) speckle: f32,
    pub(super) roughness: f32,
    pub(super) lost: f32,
}

static OPTICS: LazyLock<FxHashMap<Material, Optics>> =
    LazyLock::new(|| shipped(include_str!("materials.toml")));

impl Material {
    /// Its optics.
    pub(super) fn optics(self) -> Optics {
        OPTICS[&self]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_material_has_optics() {
        assert_eq!(OPTICS.len(), Material::Wood as usize + 1);
    }
}
