//! Which dimensions are compared, and how.

use std::path::PathBuf;

use crate::config::{CLUSTER_ID, SURFACE_ID};
use crate::input::{Catalog, InputFile};

/// The dimension of the predicted classes of objects that is compared by default.
const OBJECT_CLASS: &str = "object_class";

/// Which dimensions contain the labels, and how points are matched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompareSettings {
    /// Dimension of the predicted segments. `None` means `cluster_id`, or `surface_id` if no file has
    /// `cluster_id` and all files have `surface_id`.
    pub prediction_dim: Option<String>,
    /// Dimension of the reference objects.
    pub reference_dim: String,
    /// Dimension of the reference classes; none when there are no classes.
    pub class_dim: Option<String>,
    /// Dimension of the predicted classes of objects. `None` means `object_class`, if all files have it.
    pub named_dim: Option<String>,
    /// LAS classes of the prediction that are ground.
    pub ground_classes: Vec<u16>,
    /// LAS classes of the prediction that are isolated noise.
    pub noise_classes: Vec<u16>,
    /// Whether points are matched by coordinates alone, even if both sides have times.
    pub ignore_time: bool,
    /// Folder for scratch files.
    pub scratch: PathBuf,
}

impl Default for CompareSettings {
    fn default() -> Self {
        Self {
            prediction_dim: None,
            reference_dim: "gt_instance".to_owned(),
            class_dim: Some("gt_class".to_owned()),
            named_dim: None,
            ground_classes: vec![2],
            noise_classes: vec![7, 18],
            ignore_time: false,
            scratch: std::env::temp_dir(),
        }
    }
}

impl CompareSettings {
    /// The dimension of the predicted segments.
    pub(super) fn prediction_dim_in(&self, prediction: &Catalog) -> &str {
        let files = prediction.files();
        let has = |file: &InputFile, name| file.layout().dimension(name).is_some();
        let surfaces = files.iter().all(|file| has(file, SURFACE_ID) && !has(file, CLUSTER_ID));
        self.prediction_dim.as_deref().unwrap_or(if surfaces { SURFACE_ID } else { CLUSTER_ID })
    }

    /// A warning if the compared dimension may not be the one that the user means: the files have both
    /// surfaces and objects of an earlier run.
    #[must_use]
    pub fn warning(&self, prediction: &Catalog) -> Option<String> {
        let both = |file: &&InputFile| {
            [CLUSTER_ID, SURFACE_ID].iter().all(|name| file.layout().dimension(name).is_some())
        };
        let file = prediction.files().iter().find(both).filter(|_| self.prediction_dim.is_none())?;
        Some(format!(
            "{} has {CLUSTER_ID} and {SURFACE_ID}: {CLUSTER_ID} is compared; for the surfaces use --prediction-dim \
             {SURFACE_ID}",
            file.path().display()
        ))
    }

    /// The dimension of the predicted classes of objects, if they are compared: the reference has classes,
    /// and either a dimension was named or all files have the dimension of this program. `none` names no
    /// dimension.
    pub(super) fn named_dim_in(&self, prediction: &Catalog) -> Option<&str> {
        let everywhere = || {
            prediction
                .files()
                .iter()
                .all(|file| file.layout().dimension(OBJECT_CLASS).is_some())
                .then_some(OBJECT_CLASS)
        };
        self.class_dim.as_ref()?;
        self.named_dim.as_deref().or_else(everywhere).filter(|name| *name != "none")
    }
}
