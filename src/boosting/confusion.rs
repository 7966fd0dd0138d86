//! The confusion of classes by a model.

/// Rows of each class (first) by the class that a model gives them (second).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    counts: Vec<Vec<u64>>,
}

impl Confusion {
    /// A confusion of this many classes without rows.
    #[must_use]
    pub fn new(classes: usize) -> Self {
        Self { counts: vec![vec![0; classes]; classes] }
    }

    /// Adds rows of class `truth` that a model calls `called`. Classes beyond the number are ignored.
    pub fn add(&mut self, truth: usize, called: usize, rows: u64) {
        if let Some(count) = self.counts.get_mut(truth).and_then(|row| row.get_mut(called)) {
            *count += rows;
        }
    }

    /// The counts.
    #[must_use]
    pub fn counts(&self) -> &[Vec<u64>] {
        &self.counts
    }

    /// All rows.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.counts.iter().flatten().sum()
    }

    /// Share of the rows that get their true class; `None` without rows.
    #[must_use]
    pub fn accuracy(&self) -> Option<f64> {
        let right: u64 = self.counts.iter().enumerate().map(|(class, row)| row[class]).sum();
        share(right, self.rows())
    }

    /// Share of the rows of a class that get this class.
    #[must_use]
    pub fn recall(&self, class: usize) -> Option<f64> {
        let row = self.counts.get(class)?;
        share(row[class], row.iter().sum())
    }

    /// Share of the rows given a class that are of this class.
    #[must_use]
    pub fn precision(&self, class: usize) -> Option<f64> {
        let right = self.counts.get(class)?[class];
        share(right, self.counts.iter().map(|row| row[class]).sum())
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_worked_by_hand() {
        let mut confusion = Confusion::new(3);
        for (truth, called, rows) in [(0, 0, 6), (0, 1, 2), (1, 1, 2), (7, 0, 9)] {
            confusion.add(truth, called, rows);
        }
        assert_eq!(confusion.rows(), 10);
        assert_eq!(confusion.accuracy(), Some(0.8));
        assert_eq!([0, 1, 2].map(|class| confusion.recall(class)), [Some(0.75), Some(1.0), None]);
        assert_eq!([0, 1, 2].map(|class| confusion.precision(class)), [Some(1.0), Some(0.5), None]);
        assert_eq!(Confusion::new(2).accuracy(), None);
    }
}
