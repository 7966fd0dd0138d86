//! Detects a drive through a forest. The forest model suits such a drive better, and the run says so.
//!
//! In a forest, crowns are above most of the ground. A cell of the ground raster is *covered* if its points
//! span 6 m of height or more. Counts of tiles can be added: one tile owns a cell and has all its points.

use serde::{Deserialize, Serialize};

use crate::cluster::street::settings::Scene;

/// Smallest height range of the points of a covered cell, in metres.
pub(crate) const COVERED_M: f64 = 6.0;
/// Share of covered cells above which a drive leads through a forest. A real forest has 0.75, a plantation
/// 0.69; of 17 streets, real, simulated and synthetic, none has more than 0.30.
const FOREST: f64 = 0.45;

/// Number of cells with points, and number of covered cells.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Cover {
    pub(crate) cells: u64,
    pub(crate) covered: u64,
}

impl Cover {
    pub(crate) fn add(&mut self, other: Self) {
        self.cells += other.cells;
        self.covered += other.covered;
    }

    /// The warning about a drive whose voxels the model of `scene` classifies.
    pub(crate) fn warning(self, scene: Scene) -> Option<String> {
        let share = self.covered as f64 / self.cells.max(1) as f64;
        (scene == Scene::Street && share > FOREST).then(|| {
            format!(
                "this looks like a forest: in {:.0} % of its cells of 0.5 m, the points span at least {COVERED_M} m of \
                 height; the model of streets was not trained on forests, try --preset forest",
                100.0 * share
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covered_drive_gets_a_warning_unless_the_model_is_that_of_forests() {
        let mut sum = Cover { cells: 60, covered: 20 };
        assert_eq!(sum.warning(Scene::Street), None);
        sum.add(Cover { cells: 40, covered: 26 });
        let said = sum.warning(Scene::Street).unwrap();
        assert!(said.contains("in 46 % of its cells") && said.ends_with("try --preset forest"), "{said}");
        assert_eq!(sum.warning(Scene::Forest), None);
        assert_eq!(Cover::default().warning(Scene::Street), None);
    }
}
