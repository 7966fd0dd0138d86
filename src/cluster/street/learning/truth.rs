//! The true classes and objects of the voxels of a labelled drive.
//!
//! The label of a voxel is the class of most of its points (ties: the smaller code). Points without a class
//! (code 0: stray returns and unlabelled points) and points outside `gt_core` give no label. The true object
//! of a voxel is the object of most of its labelled points (ties: the smaller number).

use crate::cluster::DriveWindow;
use crate::cluster::columns::Voxel;
use crate::cluster::street::settings::{CLASSES, STEP_VOXELS};
use crate::cluster::street::voxels::stage_voxels::Cut;
use crate::cluster::street::voxels::stored;
use crate::codec;
use crate::error::Result;
use crate::model::{Field, TileId};

/// Section of the labels in the payload of the step `voxels`, after the two sections of `street` that are
/// kept.
const SECTION_LABELS: usize = 2;
/// Section of the true objects of the voxels, four bytes each. Empty if they are not known.
const SECTION_INSTANCES: usize = 3;

/// What a labelled drive knows about its points, besides their classes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    /// Whether it knows where it is labelled completely.
    pub(crate) has_core: bool,
    /// Bytes of the number of the object that a point belongs to, 2 or 4; 0 if the objects are not known.
    pub(crate) instance_bytes: usize,
}

impl Known {
    pub(crate) fn fields(self) -> &'static [Field] {
        const ALL: [Field; 4] = [Field::Core, Field::Class, Field::Instance, Field::InstanceUpper];
        &ALL[usize::from(!self.has_core)..2 + self.instance_bytes / 2]
    }

    /// The sections of the labels and of the true objects.
    pub(crate) fn sections(self, cut: &Cut) -> [Vec<u8>; 2] {
        let instances = self.instances(cut).into_iter().flat_map(u32::to_le_bytes);
        [self.labels(cut), instances.collect()]
    }

    /// The code of the class of each voxel that a tile owns; 0 for none.
    fn labels(self, cut: &Cut) -> Vec<u8> {
        let mut counts = vec![[0_u32; CLASSES]; cut.stored.len()];
        for (_, voxel, place) in self.labelled_points(cut) {
            counts[voxel][place] += 1;
        }
        let label = |counts: &[u32; CLASSES]| {
            let mut best = (0, 0);
            for (&count, code) in counts.iter().zip(1..) {
                if count > best.0 {
                    best = (count, code);
                }
            }
            best.1
        };
        counts.iter().map(label).collect()
    }

    /// The points with a class: each with its number, its voxel and the index of its class.
    fn labelled_points<'a>(self, cut: &'a Cut) -> impl Iterator<Item = (usize, usize, usize)> + 'a {
        let cloud = &cut.points.cloud;
        let class = cloud.field(Field::Class).unwrap_or_default();
        let core = cloud.field(Field::Core).filter(|_| self.has_core);
        let of_voxels = cut.voxel.iter().zip(class).enumerate();
        of_voxels.filter_map(move |(point, (&voxel, &class))| {
            let complete = core.is_none_or(|core| core[point] > 0);
            let place = usize::from(class).checked_sub(1).filter(|place| *place < CLASSES && complete)?;
            let voxel = voxel as usize;
            (voxel < cut.stored.len()).then_some((point, voxel, place))
        })
    }

    /// The true object of each voxel that a tile owns; 0 for none. Empty if the drive has no true objects.
    fn instances(self, cut: &Cut) -> Vec<u32> {
        let cloud = &cut.points.cloud;
        let Some(lower) = cloud.field(Field::Instance) else { return Vec::new() };
        let upper = cloud.field(Field::InstanceUpper);
        let instance =
            |point: usize| u32::from(lower[point]) | upper.map_or(0, |upper| u32::from(upper[point]) << 16);
        let of_point = |(point, voxel, _)| (voxel, instance(point));
        let mut pairs: Vec<(usize, u32)> = self.labelled_points(cut).map(of_point).collect();
        pairs.sort_unstable();
        let mut best = vec![(0, 0); cut.stored.len()];
        for same in pairs.chunk_by(|one, other| one == other) {
            let (voxel, instance) = same[0];
            if same.len() > best[voxel].0 {
                best[voxel] = (same.len(), instance);
            }
        }
        best.into_iter().map(|(_, instance)| instance).collect()
    }
}

/// The true objects of the voxels that a tile owns, in the payload of the step `voxels`.
pub(crate) fn instances(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<u32>> {
    let payload = drive.payload(STEP_VOXELS, tile)?;
    let bytes = codec::section(&payload, SECTION_INSTANCES)?.chunks_exact(4);
    Ok(bytes.map(|four| u32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect())
}

/// The label and key of the voxels that a tile owns.
pub(crate) fn labelled(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<(Voxel, u8)>> {
    let stored = stored::read(drive, tile)?;
    let payload = drive.payload(STEP_VOXELS, tile)?;
    let labels = codec::section(&payload, SECTION_LABELS)?;
    Ok(stored.keys().zip(labels.iter().copied()).collect())
}
