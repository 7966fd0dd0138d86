//! Step `classes`: height above ground and class probabilities for each voxel that a tile owns. It reads no
//! points.
//!
//! The probabilities of a voxel are smoothed: half its own, half the mean over the occupied voxels in the 3 x
//! 3 x 3 block around it. So the tile also classifies the voxels that touch its own.
#![expect(clippy::cast_possible_truncation, reason = "at most 27 voxels, shares of 255")]

use super::classified::{self, Shares};
use super::features::{self, REACH_EDGES};
use crate::cluster::street::settings::{CLASSES, edge};
use crate::cluster::street::voxels::stored::Voxels;
use crate::cluster::street::voxels::terrain::Terrain;
use crate::cluster::{Mapped, TileWindow};
use crate::error::Result;

/// Computes the probabilities of some voxels from their features. The two slices have matching lengths.
pub(crate) type Classify<'a> = &'a dyn Fn(&[f32], &mut [Shares]) -> Result<()>;

/// The probabilities of the voxels whose features `compute` passes on: the numbers of the voxels, and a row
/// for each. The probabilities of other voxels are 0.
pub(crate) fn classified_by(
    classify: Classify<'_>,
    voxels: usize,
    compute: impl FnOnce(&mut dyn FnMut(&[u32], &[f32])),
) -> Result<Vec<Shares>> {
    let mut shares = vec![Shares::default(); voxels];
    let mut found = Vec::new();
    let mut result = Ok(());
    compute(&mut |numbers, rows| {
        found.clear();
        found.resize(numbers.len(), Shares::default());
        if result.is_ok() {
            result = classify(rows, &mut found);
        }
        for (&number, &found) in numbers.iter().zip(&found) {
            shares[number as usize] = found;
        }
    });
    result.map(|()| shares)
}

/// Voxels around a tile with their heights. They suffice to give its own voxels, and those that touch them,
/// the same features as in the whole drive.
#[derive(Debug)]
pub(crate) struct Around {
    pub(crate) voxels: Voxels,
    pub(crate) heights: Vec<i32>,
}

impl Around {
    /// Loads them.
    pub(crate) fn load(tile: &dyn TileWindow) -> Result<Self> {
        // One more edge on each axis for the voxels that touch its own.
        let reach = (REACH_EDGES + 2) * i64::from(edge(tile.lattice()));
        let voxels = Voxels::load(tile, reach)?;
        let heights = Terrain::load(tile, reach)?.heights(&voxels);
        Ok(Self { voxels, heights })
    }
}

/// Computes the payload of a tile.
pub(crate) fn map(tile: &dyn TileWindow, classify: Classify<'_>) -> Result<Mapped> {
    let around = Around::load(tile)?;
    let voxels = &around.voxels;
    let mut wanted = voxels.owned.clone();
    voxels.columns.touching(|a, b| {
        wanted[a] |= voxels.owned[b];
        wanted[b] |= voxels.owned[a];
    });
    let shares = classified_by(classify, voxels.len(), |rows| {
        features::compute(voxels, &around.heights, &wanted, rows);
    })?;
    let smoothed = smooth(voxels, &shares);
    let own = |voxel: &usize| voxels.owned[*voxel];
    let heights: Vec<i32> = (0..voxels.len()).filter(own).map(|voxel| around.heights[voxel]).collect();
    let smoothed: Vec<Shares> = (0..voxels.len()).filter(own).map(|voxel| smoothed[voxel]).collect();
    Ok(Mapped::payload(classified::encode(&heights, &smoothed)?))
}

/// The smoothed probabilities.
fn smooth(voxels: &Voxels, shares: &[Shares]) -> Vec<Shares> {
    // The voxel itself is one of the 27.
    let mut sums: Vec<[u16; CLASSES]> = shares.iter().map(|shares| shares.map(u16::from)).collect();
    let mut counts = vec![1_u16; shares.len()];
    voxels.columns.touching(|a, b| {
        for class in 0..CLASSES {
            sums[a][class] += u16::from(shares[b][class]);
            sums[b][class] += u16::from(shares[a][class]);
        }
        counts[a] += 1;
        counts[b] += 1;
    });
    let half = |voxel: usize| {
        let n = counts[voxel];
        // Over 2 n: n times its own and once the sum.
        let weighted = std::array::from_fn(|class| {
            u32::from(n) * u32::from(shares[voxel][class]) + u32::from(sums[voxel][class])
        });
        divided(weighted, 2 * u32::from(n))
    };
    (0..shares.len()).map(half).collect()
}

/// Values divided by `divisor` such that the sum of the quotients is the quotient of the sum. The largest
/// remainders are rounded up; of equal remainders, the one of the first class.
fn divided(values: [u32; CLASSES], divisor: u32) -> Shares {
    let mut quotients = values.map(|value| (value / divisor) as u8);
    let sum: u32 = quotients.iter().map(|&quotient| u32::from(quotient)).sum();
    let left = values.iter().sum::<u32>() / divisor - sum;
    let mut order: [usize; CLASSES] = std::array::from_fn(|class| class);
    order.sort_by_key(|&class| std::cmp::Reverse(values[class] % divisor));
    for &class in order.iter().take(left as usize) {
        quotients[class] += 1;
    }
    quotients
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Lattice;

    #[test]
    fn quotients_keep_the_sum() {
        assert_eq!(divided([255 * 4, 0, 0, 0, 0, 0, 0, 0], 4), [255, 0, 0, 0, 0, 0, 0, 0]);
        // 127.5 twice: the first of equal remainders is rounded up.
        assert_eq!(divided([0, 255, 0, 255, 0, 0, 0, 0], 2), [0, 128, 0, 127, 0, 0, 0, 0]);
        assert_eq!(divided([1, 2, 3, 4, 5, 6, 7, 227], 1), [1, 2, 3, 4, 5, 6, 7, 227]);
    }

    #[test]
    fn half_of_the_smoothed_probabilities_is_the_mean_of_the_voxels_that_touch() {
        // Three voxels in a row, and one apart.
        let points = [[0, 0, 0], [0, 0, 150], [150, 150, 300], [0, 0, 900]];
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &points);
        let one = |class: usize| std::array::from_fn(|other| if other == class { 255 } else { 0 });
        assert_eq!(voxels.key, [[0, 0, 0], [0, 0, 1], [0, 0, 6], [1, 1, 2]]);
        let smoothed = smooth(&voxels, &[one(0), one(1), one(2), one(3)]);
        // The first voxel: 1/2 + 1/4 of its own, 1/4 of the second.
        assert_eq!(smoothed[0], [191, 64, 0, 0, 0, 0, 0, 0]);
        // The second voxel: 1/2 + 1/6 of its own, 1/6 of the first and of the last: 42.5, 170 and 42.5.
        assert_eq!(smoothed[1], [43, 170, 0, 42, 0, 0, 0, 0]);
        assert_eq!(smoothed[2], one(2));
        assert!(
            smoothed.iter().all(|shares| shares.iter().map(|&share| u32::from(share)).sum::<u32>() == 255)
        );
    }
}
