//! Which dimensions are compared, and how. Not: comparing them.

use std::path::PathBuf;

/// Which dimensions hold the labels, and how points are matched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompareSettings {
    /// Dimension of the predicted segments.
    pub prediction_dim: String,
    /// Dimension of the reference objects.
    pub reference_dim: String,
    /// Dimension of the reference classes; none when there are no classes.
    pub class_dim: Option<String>,
    /// LAS classes of the prediction that are ground.
    pub ground_classes: Vec<u16>,
    /// LAS classes of the prediction that are isolated noise.
    pub noise_classes: Vec<u16>,
    /// Whether points are recognised by coordinates alone, though both sides have times.
    pub ignore_time: bool,
    /// Folder for scratch files.
    pub scratch: PathBuf,
}

impl Default for CompareSettings {
    fn default() -> Self {
        Self {
            prediction_dim: "cluster_id".to_owned(),
            reference_dim: "gt_instance".to_owned(),
            class_dim: Some("gt_class".to_owned()),
            ground_classes: vec![2],
            noise_classes: vec![7, 18],
            ignore_time: false,
            scratch: std::env::temp_dir(),
        }
    }
}
