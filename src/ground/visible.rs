//! Input and output of filters that work on voxels: points that are not noise in, ground points out.

use super::noise::voxel_edge;
use crate::model::{AlgorithmError, Lattice, PointClass};
use crate::spatial::{TileView, VoxelIndex};

/// Classifies the points of a tile by voxels whose edge is `voxel_m` metres: the points of the voxels that
/// `ground_voxels` finds are ground. It gets the voxels, the number of points of each that are not noise, and
/// the lattice.
///
/// # Errors
/// When the points cannot be indexed, see [`AlgorithmError`].
pub(super) fn classify(
    name: &'static str,
    voxel_m: f64,
    view: &mut TileView<'_>,
    classes: &mut [PointClass],
    ground_voxels: impl FnOnce(&VoxelIndex, &[u32], Lattice) -> Vec<bool>,
) -> Result<(), AlgorithmError> {
    let lattice = view.cloud().lattice;
    let index = view.voxels(name, voxel_edge(lattice, voxel_m))?;
    let ground = ground_voxels(index, &visible_points(index, classes), lattice);
    mark_ground(index, &ground, classes);
    Ok(())
}

/// How many points of each voxel are not noise.
fn visible_points(index: &VoxelIndex, classes: &[PointClass]) -> Vec<u32> {
    let mut visible = vec![0; index.len()];
    for (points, voxel) in index.streaks() {
        visible[voxel] += classes[points].iter().map(|class| u32::from(!class.is_noise())).sum::<u32>();
    }
    visible
}

/// Marks the points of ground voxels as ground; noise stays noise.
fn mark_ground(index: &VoxelIndex, ground: &[bool], classes: &mut [PointClass]) {
    for (points, voxel) in index.streaks() {
        if ground[voxel] {
            for class in classes[points].iter_mut().filter(|class| !class.is_noise()) {
                *class = PointClass::Ground;
            }
        }
    }
}
