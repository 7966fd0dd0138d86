//! Detects a drive with sparse points. The classifier is less reliable on its voxels, and the run says so.
//!
//! A voxel is *stacked* if the voxel above or below it has points as well. On dense drives most voxels are
//! stacked, because objects are upright. The share does not depend on tiles, because a tile owns whole
//! columns.

use serde::{Deserialize, Serialize};

use super::stored::StoredVoxels;

/// Smallest share of stacked voxels without a warning. Scenes thinned to half of their points have a share of
/// 0.49 or more and lose 0.03 of F1; to a quarter, 0.32 to 0.40, and they lose 0.06 to 0.15; to a tenth, 0.16
/// to 0.21, and they lose 0.15 to 0.40. A single sweep has a share of 0.53. From
/// `scripts/study_robustness.py`.
const SPARSE: f64 = 0.3;

/// Number of voxels, and number of stacked voxels. Counts of tiles can be added.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stacked {
    voxels: u64,
    stacked: u64,
}

impl Stacked {
    /// Counts the voxels of a tile.
    pub(crate) fn count(stored: &StoredVoxels) -> Self {
        let keys: Vec<_> = stored.keys().collect();
        let above = |[i, j, k]: [i32; 3], other: Option<&[i32; 3]>| other == Some(&[i, j, k + 1]);
        let stacked = (0..keys.len()).filter(|&voxel| {
            let on_another = voxel.checked_sub(1).is_some_and(|below| above(keys[below], keys.get(voxel)));
            on_another || above(keys[voxel], keys.get(voxel + 1))
        });
        Self { voxels: keys.len() as u64, stacked: stacked.count() as u64 }
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.voxels += other.voxels;
        self.stacked += other.stacked;
    }

    /// The warning about a drive with these counts.
    pub(crate) fn warning(self) -> Option<String> {
        let share = self.stacked as f64 / self.voxels.max(1) as f64;
        (self.voxels > 0 && share < SPARSE).then(|| {
            format!(
                "the points are sparse for street: {:.0} % of its voxels of 0.15 m have a neighbour above or below; \
                 below {:.0} %, objects are missed and misnamed",
                100.0 * share,
                100.0 * SPARSE
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::voxels::stored::Storing;

    fn counted(keys: &[[i32; 3]]) -> Stacked {
        let mut storing = Storing::default();
        keys.iter().for_each(|&key| storing.push(key, 1, [0; 3]));
        Stacked::count(&storing.finish())
    }

    #[test]
    fn a_voxel_is_stacked_on_one_of_its_own_column() {
        assert_eq!(counted(&[[0, 0, 0], [0, 0, 1], [0, 0, 3]]), Stacked { voxels: 3, stacked: 2 });
        assert_eq!(counted(&[[0, 0, 4], [0, 1, 5], [1, 1, 6]]), Stacked { voxels: 3, stacked: 0 });
        assert_eq!(counted(&[]), Stacked::default());
    }

    #[test]
    fn sparse_drives_get_a_warning_and_empty_ones_do_not() {
        let warning = |voxels, stacked| Stacked { voxels, stacked }.warning();
        assert_eq!(warning(0, 0), None);
        assert_eq!(warning(100, 30), None);
        assert!(warning(100, 29).unwrap().contains("29 % of its voxels"));
    }
}
