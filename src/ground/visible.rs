//! Input and output of filters that work on voxels: points that are not noise in, ground points out.

use crate::model::PointClass;
use crate::spatial::VoxelIndex;

/// How many points of each voxel are not noise.
pub(super) fn visible_points(index: &VoxelIndex, classes: &[PointClass]) -> Vec<u32> {
    let mut visible = vec![0; index.len()];
    for (points, voxel) in index.streaks() {
        visible[voxel] += classes[points].iter().map(|class| u32::from(!class.is_noise())).sum::<u32>();
    }
    visible
}

/// Marks the points of ground voxels as ground; noise stays noise.
pub(super) fn mark_ground(index: &VoxelIndex, ground: &[bool], classes: &mut [PointClass]) {
    for (points, voxel) in index.streaks() {
        if ground[voxel] {
            for class in classes[points].iter_mut().filter(|class| !class.is_noise()) {
                *class = PointClass::Ground;
            }
        }
    }
}
