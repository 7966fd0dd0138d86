//! How surfaces answer a pulse of near-infrared light; no geometry.

use serde::Deserialize;

/// What a surface is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
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

/// Optical facts of a material. Reflectances near 1550 nm are round figures after the ASTER/ECOSTRESS spectral
/// library; roughness and drop-outs were chosen so that pictures and statistics agree with labelled scenes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Optics {
    /// Diffuse reflectance.
    pub(super) reflectance: f32,
    /// Standard deviation of the reflectance from point to point, relative.
    pub(super) speckle: f32,
    /// Standard deviation of the surface about its shape, metres.
    pub(super) roughness: f32,
    /// Share of pulses without an echo whatever the range: transparent or mirror-like.
    pub(super) lost: f32,
}

impl Material {
    /// Its optics.
    pub(super) fn optics(self) -> Optics {
        let (reflectance, speckle, roughness, lost) = match self {
            Self::Asphalt => (0.17, 0.08, 0.002, 0.0),
            Self::Marking => (0.55, 0.08, 0.001, 0.0),
            Self::Paving => (0.26, 0.10, 0.002, 0.0),
            Self::Grass => (0.38, 0.20, 0.018, 0.0),
            Self::Bark => (0.35, 0.15, 0.004, 0.0),
            Self::Leaf => (0.48, 0.25, 0.004, 0.01),
            Self::Metal => (0.40, 0.15, 0.001, 0.02),
            Self::Retro => (8.0, 0.10, 0.001, 0.0),
            Self::Plaster => (0.42, 0.08, 0.003, 0.0),
            Self::Roof => (0.22, 0.10, 0.006, 0.0),
            Self::Glass => (0.08, 0.40, 0.002, 0.90),
            Self::Paint => (0.30, 0.30, 0.001, 0.10),
            Self::DarkPaint => (0.06, 0.40, 0.001, 0.45),
            Self::Rubber => (0.05, 0.10, 0.002, 0.10),
            Self::Cloth => (0.40, 0.15, 0.006, 0.0),
            Self::Wood => (0.42, 0.12, 0.002, 0.0),
        };
        Optics { reflectance, speckle, roughness, lost }
    }
}
