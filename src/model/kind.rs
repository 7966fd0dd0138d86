//! The kind of an object: its class, the confidence in it, and whether it is vegetation.

use serde::{Deserialize, Serialize};

/// Class and confidence of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Kind {
    /// Code of the class: 0 none, 2 tree, 3 pole, 4 vehicle, 5 building, 6 fence, wall, guard rail, hedge or
    /// bush, 7 person or small furniture, 8 wire, 9 other. The codes are those of `config/classes.toml`.
    pub class: u8,
    /// Confidence in steps of 1/255. 0 where the method has no probabilities.
    pub confidence: u8,
    /// Whether an object of class 6 is a hedge or bush.
    pub hedge: Hedge,
}

impl Kind {
    /// The kind of an object with a class, a confidence in steps of 1/255, and no knowledge of a hedge.
    #[must_use]
    pub const fn new(class: u8, confidence: u8) -> Self {
        Self { class, confidence, hedge: Hedge::No }
    }
}

/// Whether an object of class 6 is a hedge or bush, by its height above ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Hedge {
    /// A fence, wall or guard rail, an object of another class, or unknown.
    #[default]
    No,
    /// Low vegetation: up to half a metre.
    Low,
    /// Medium vegetation.
    Medium,
}
