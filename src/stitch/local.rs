//! The result of clustering a tile: its objects, whole or in part, and the points that it shares with other
//! tiles.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use crate::model::{FileId, ObjectPart, PointId, TileCloud, TileId};

/// An object, or its part in the core.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocalObject {
    /// Whether it may continue outside the core.
    pub open: bool,
    /// Its points in the core.
    pub part: ObjectPart,
}

/// A halo point with its label in this tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeamPoint {
    /// The point.
    pub id: PointId,
    /// Tile that owns it.
    pub owner: TileId,
    /// Its label in this tile, from 1.
    pub label: u32,
}

/// The result of clustering a tile.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LocalLabels {
    /// Object of label 1, 2, ...
    pub objects: Vec<LocalObject>,
    /// Halo points of open objects in ascending id.
    pub seams: Vec<SeamPoint>,
}

impl LocalLabels {
    /// Keeps the labels of a tile that have a point in the core, and numbers them from 1. A closed label with
    /// fewer points than `size` allows is dropped. A closed label with too many points is kept until objects
    /// are whole, because another tile may own border points of it that this tile did not label. Rewrites
    /// `labels` (0: none). `owner` returns the tile that owns a halo point, and `file` the file of a point
    /// id.
    pub fn collect(
        cloud: &TileCloud,
        core: &[bool],
        labels: &mut [u32],
        count: u32,
        size: &RangeInclusive<u64>,
        owner: impl Fn(usize) -> TileId,
        file: impl Fn(PointId) -> FileId,
    ) -> Self {
        let slots = count as usize + 1;
        let mut points_in_core = vec![0_u64; slots];
        let mut open = vec![false; slots];
        for (label, &in_core) in labels.iter().zip(core) {
            let slot = *label as usize;
            points_in_core[slot] += u64::from(in_core);
            open[slot] |= !in_core;
        }
        let mut number = vec![0_u32; slots];
        let mut kept = 0;
        for slot in 1..slots {
            let large_enough = points_in_core[slot] >= *size.start();
            if points_in_core[slot] > 0 && (open[slot] || large_enough) {
                kept += 1;
                number[slot] = kept;
            }
        }
        let mut seams = Vec::new();
        for (point, label) in labels.iter_mut().enumerate() {
            *label = number[*label as usize];
            if *label != 0 && !core[point] {
                seams.push(SeamPoint { id: cloud.id[point], owner: owner(point), label: *label });
            }
        }
        seams.sort_unstable_by_key(|seam| seam.id);
        let in_core = |point: usize| core[point];
        let parts = ObjectPart::collect(cloud, labels, kept, in_core, file);
        let mut is_open = vec![false; kept as usize];
        for slot in (1..slots).filter(|&slot| number[slot] != 0) {
            is_open[number[slot] as usize - 1] = open[slot];
        }
        let objects = parts.into_iter().zip(is_open).map(|(part, open)| LocalObject { open, part }).collect();
        Self { objects, seams }
    }
}
