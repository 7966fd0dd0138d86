//! A learned model: reading, checking, writing, and the shares that it gives.

use std::fmt::Write;

use super::content::{About, Content, TrainedOn};
use super::error::BoostingError;
use super::evaluate::Forest;
use super::exponential::shares;
use super::file;
use super::tree::Tree;
use crate::error::Result;

/// A learned model.
#[derive(Debug, Clone)]
pub struct Model {
    content: Content,
    forest: Forest,
    checksum: u64,
}

impl Model {
    pub(super) fn new(
        features: Vec<String>,
        classes: Vec<String>,
        thresholds: Vec<Vec<f32>>,
        base: Vec<i32>,
        trees: Vec<Tree>,
        about: About,
    ) -> Result<Self> {
        let content = Content { features, classes, thresholds, base, trees, about };
        let (_, checksum) = file::encode(&content)?;
        Ok(Self::from_content("the new model", content, checksum)?)
    }

    fn from_content(origin: &str, content: Content, checksum: u64) -> Result<Self, BoostingError> {
        let damaged = |what: String| BoostingError::Damaged { origin: origin.to_owned(), what };
        let Content { features, classes, about, .. } = &content;
        let of_features = [content.thresholds.len(), about.importance.len()];
        let mut of_classes = vec![content.base.len(), about.samples.len()];
        of_classes.extend(about.trained_on.iter().map(|source| source.samples.len()));
        if of_features.iter().any(|&length| length != features.len())
            || of_classes.iter().any(|&length| length != classes.len())
        {
            return Err(damaged("its lists have different lengths".to_owned()));
        }
        let forest = Forest::new(&content.thresholds, &content.base, &content.trees).map_err(damaged)?;
        Ok(Self { content, forest, checksum })
    }

    /// Reads a model from the bytes of `origin` (a file, for messages).
    ///
    /// # Errors
    /// [`BoostingError::Foreign`], [`BoostingError::Damaged`] or [`BoostingError::Version`].
    pub fn decode(origin: &str, bytes: &[u8]) -> Result<Self, BoostingError> {
        let (content, checksum) = file::decode(origin, bytes)?;
        Self::from_content(origin, content, checksum)
    }

    /// The bytes of the model at the start of `bytes`, and the bytes after it. Only the length is read.
    ///
    /// # Errors
    /// [`BoostingError::Foreign`] or [`BoostingError::Damaged`].
    pub fn split<'a>(origin: &str, bytes: &'a [u8]) -> Result<(&'a [u8], &'a [u8]), BoostingError> {
        file::split(origin, bytes)
    }

    /// The bytes of the model.
    ///
    /// # Errors
    /// A defect of chainage, if a list of the model cannot be encoded.
    pub fn encode(&self) -> Result<Vec<u8>> {
        Ok(file::encode(&self.content)?.0)
    }

    /// The same model with the names of the sources of its samples.
    ///
    /// # Errors
    /// [`BoostingError::Damaged`] when a source has counts for another number of classes.
    pub fn trained_on(self, sources: Vec<TrainedOn>) -> Result<Self> {
        let mut content = self.content;
        content.about.trained_on = sources;
        let (_, checksum) = file::encode(&content)?;
        Ok(Self::from_content("the new model", content, checksum)?)
    }

    /// Checksum of the bytes of the model.
    #[must_use]
    pub fn checksum(&self) -> u64 {
        self.checksum
    }

    /// Names of the features, in the order of a row.
    #[must_use]
    pub fn features(&self) -> &[String] {
        &self.content.features
    }

    /// Names of the classes.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.content.classes
    }

    /// Where the model comes from.
    #[must_use]
    pub fn about(&self) -> &About {
        &self.content.about
    }

    /// Number of trees, and number of their leaves.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        let trees = &self.content.trees;
        (trees.len(), trees.iter().map(|tree| tree.values.len()).sum())
    }

    /// Refuses a model with other features or classes than these.
    ///
    /// # Errors
    /// [`BoostingError::Unfit`] with the first difference.
    pub fn check(&self, origin: &str, features: &[&str], classes: &[&str]) -> Result<(), BoostingError> {
        let unfit = |what: String| BoostingError::Unfit { origin: origin.to_owned(), what };
        for (kind, have, want) in
            [("features", self.features(), features), ("classes", self.classes(), classes)]
        {
            if have.len() != want.len() {
                return Err(unfit(format!("it has {} {kind}, expected {}", have.len(), want.len())));
            }
            if let Some((number, (have, want))) =
                have.iter().zip(want).enumerate().find(|(_, (have, want))| have != *want)
            {
                let mut what = format!("number {} of its {kind} ", number + 1);
                // Writing to a string cannot fail.
                let _ = write!(what, "is {have}, expected {want}");
                return Err(unfit(what));
            }
        }
        Ok(())
    }

    /// Shares of the `K` classes for each row. The shares of a row add up to 255.
    ///
    /// Rows do not depend on each other. They are evaluated in blocks of 256: a comparison with a threshold
    /// is one bit per row, so that a split of a tree is two operations on words for all of them.
    ///
    /// # Errors
    /// [`BoostingError::Unfit`] when the model has another number of classes, or the values are not whole
    /// rows.
    pub fn shares<const K: usize>(&self, rows: &[f32]) -> Result<Vec<[u8; K]>, BoostingError> {
        let width = self.features().len();
        if K != self.classes().len() || !rows.len().is_multiple_of(width) {
            let what =
                format!("it has {} classes, expected {K}; {} values", self.classes().len(), rows.len());
            return Err(BoostingError::Unfit { origin: "the model".to_owned(), what });
        }
        let mut all = Vec::with_capacity(rows.len() / width);
        self.forest.scores::<K>(rows, &mut |scores| all.push(shares(scores)));
        Ok(all)
    }
}
