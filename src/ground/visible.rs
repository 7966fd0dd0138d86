//! What a filter that works on voxels sees and says: points that are not noise in, ground points out.

use crate::model::PointClass;
use crate::spatial::VoxelIndex;

/// Whether each voxel holds a point that is not noise.
pub(super) fn visible_voxels(index: &VoxelIndex, classes: &[PointClass]) -> Vec<bool> {
    let mut visible = vec![false; index.len()];
    for (points, voxel) in index.streaks() {
        if !visible[voxel] {
            visible[voxel] = classes[points].iter().any(|class| !class.is_noise());
        }
    }
    visible
}

/// Makes the points of ground voxels ground; noise stays noise.
pub(super) fn mark_ground(index: &VoxelIndex, ground: &[bool], classes: &mut [PointClass]) {
    for (points, voxel) in index.streaks() {
        if ground[voxel] {
            for class in classes[points].iter_mut().filter(|class| !class.is_noise()) {
                *class = PointClass::Ground;
            }
        }
    }
}
