//! Options of labelled copies.

use serde::{Deserialize, Serialize};

use crate::config::{CLUSTER_ID, LasCodes, OutputFormat};
use crate::model::Kind;

/// What labelled copies contain, and whether they are compressed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LabelOptions {
    /// Whether they are compressed.
    pub format: OutputFormat,
    /// Name of the dimension with the object of a point: 1 to 31 bytes.
    pub dimension: String,
    /// Whether this dimension has surfaces instead of objects.
    pub surfaces: bool,
    /// Whether ground, noise and objects are written as the LAS class of the point.
    pub set_classification: bool,
    /// Whether a ground filter ran. If so, no other point keeps the class of ground.
    pub finds_ground: bool,
    /// Whether noise was searched for. If so, no other point keeps a class of noise.
    pub finds_noise: bool,
    /// LAS codes for classes of objects that the user chose instead of the ASPRS codes.
    pub class_codes: LasCodes,
    /// Whether the class of the input is kept in a dimension of its own, `original_classification`.
    pub keep_original: bool,
    /// Kinds of objects that the method can give. If there are any, the class of the object of a point is
    /// written to the dimension `object_class`. If not, and the input has a dimension with this name, it gets
    /// 0. It stays beside surfaces whose dimension is not `cluster_id`, because it belongs to the objects
    /// there. No other point keeps the LAS class of one of these kinds.
    pub kinds: Vec<Kind>,
}

impl Default for LabelOptions {
    fn default() -> Self {
        Self {
            format: OutputFormat::Same,
            dimension: CLUSTER_ID.into(),
            surfaces: false,
            set_classification: true,
            finds_ground: false,
            finds_noise: false,
            class_codes: LasCodes::default(),
            keep_original: false,
            kinds: Vec::new(),
        }
    }
}
