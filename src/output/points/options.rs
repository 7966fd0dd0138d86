//! What labelled copies carry.

use serde::{Deserialize, Serialize};

use crate::config::{CLUSTER_ID, LasCodes, OutputFormat};

/// What labelled copies carry, and whether they are compressed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LabelOptions {
    /// Whether they are compressed.
    pub format: OutputFormat,
    /// Name of the dimension with the object of a point: 1 to 31 bytes.
    pub dimension: String,
    /// Whether ground and noise are written as the class of the point; other points keep theirs.
    pub set_classification: bool,
    /// LAS codes of classes of objects other than those of ASPRS.
    pub class_codes: LasCodes,
    /// Whether the class of the input is kept in a dimension of its own, `original_classification`.
    pub keep_original: bool,
    /// Whether the class of the object of a point is written to the dimension `object_class`.
    pub object_class: bool,
}

impl Default for LabelOptions {
    fn default() -> Self {
        Self {
            format: OutputFormat::Same,
            dimension: CLUSTER_ID.into(),
            set_classification: true,
            class_codes: LasCodes::default(),
            keep_original: false,
            object_class: false,
        }
    }
}
