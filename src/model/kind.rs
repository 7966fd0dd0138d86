//! What an object is: its class and how certain it is.

use serde::{Deserialize, Serialize};

/// Class and confidence of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Kind {
    /// Code of the class: 0 none, 2 tree, 3 pole, 4 vehicle, 5 building, 6 fence, wall, guard rail, hedge or
    /// bush, 7 person or small furniture, 8 wire, 9 other. The codes are those of `config/classes.toml`.
    pub class: u8,
    /// Confidence in steps of 1/255. 0 where the method has no probabilities.
    pub confidence: u8,
}
