//! The table from which a model learns: rows of features and the class of each.

use super::error::BoostingError;

/// Samples: rows of features with their classes.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    features: Vec<String>,
    classes: Vec<String>,
    values: Vec<f32>,
    class: Vec<u8>,
}

impl Samples {
    /// An empty table for these features and classes.
    #[must_use]
    pub fn new(features: &[&str], classes: &[&str]) -> Self {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Self { features: owned(features), classes: owned(classes), values: Vec::new(), class: Vec::new() }
    }

    /// Adds a row. A value that is not a number is smaller than every number.
    ///
    /// # Errors
    /// [`BoostingError::Samples`] when the row does not have one value per feature, or the class does not
    /// exist.
    pub fn push(&mut self, row: &[f32], class: u8) -> Result<(), BoostingError> {
        let wrong = |why| BoostingError::Samples { samples: self.len(), why };
        if row.len() != self.features.len() {
            return Err(wrong(format!(
                "a row has {} values for {} features",
                row.len(),
                self.features.len()
            )));
        }
        if usize::from(class) >= self.classes.len() {
            return Err(wrong(format!("class {class} of {}", self.classes.len())));
        }
        self.values.extend_from_slice(row);
        self.class.push(class);
        Ok(())
    }

    /// Adds the rows of `others` after these.
    ///
    /// # Errors
    /// [`BoostingError::Samples`] when they have other features or classes.
    pub fn append(&mut self, others: Self) -> Result<(), BoostingError> {
        if (&self.features, &self.classes) != (&others.features, &others.classes) {
            let why = "rows of other features or classes".to_owned();
            return Err(BoostingError::Samples { samples: self.len(), why });
        }
        self.values.extend(others.values);
        self.class.extend(others.class);
        Ok(())
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.class.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.class.is_empty()
    }

    /// Names of the features.
    #[must_use]
    pub fn features(&self) -> &[String] {
        &self.features
    }

    /// Names of the classes.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// All rows, one after the other.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Class of each row.
    #[must_use]
    pub fn class(&self) -> &[u8] {
        &self.class
    }

    /// Rows of each class.
    #[must_use]
    pub fn counts(&self) -> Vec<u64> {
        let mut counts = vec![0; self.classes.len()];
        self.class.iter().for_each(|&class| counts[usize::from(class)] += 1);
        counts
    }
}
