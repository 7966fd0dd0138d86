//! Components of voxels over many tiles: a tile names the components that it sees. If two tiles name the same
//! voxel, their components are one.

use crate::cluster::columns::Border;
use crate::cluster::street::voxels::stored::Voxels;
use crate::spatial::DisjointSets;

/// Links between the voxels that a tile sees. A tile makes every link that has an end in a voxel of its own.
pub(crate) struct Links<'a> {
    owned: &'a [bool],
    sets: DisjointSets,
    /// Voxels on either side of a link that leaves the tile. Both tiles name them.
    crossing: Vec<bool>,
}

impl<'a> Links<'a> {
    pub(crate) fn new(voxels: &'a Voxels) -> Self {
        let count = voxels.owned.len();
        #[expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32")]
        let sets = DisjointSets::new(count as u32);
        Self { owned: &voxels.owned, sets, crossing: vec![false; count] }
    }

    /// Notes that a link leaves the tile, without joining its ends. `false` if the tile owns neither end.
    pub(crate) fn touch(&mut self, a: usize, b: usize) -> bool {
        if self.owned[a] != self.owned[b] {
            self.cross(a);
            self.cross(b);
        }
        self.owned[a] || self.owned[b]
    }

    /// Notes that a link with this end leaves the tile. The caller notes the other end, here and in the other
    /// tile.
    pub(crate) fn cross(&mut self, voxel: usize) {
        self.crossing[voxel] = true;
    }

    /// Joins two voxels, if the tile owns one of them.
    #[expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32")]
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        if self.touch(a, b) {
            self.sets.union(a as u32, b as u32);
        }
    }

    /// The components of the `chosen` voxels that the tile owns or names, numbered from 0 in the order of
    /// their first voxel. Other voxels have the number `u32::MAX`.
    #[expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32")]
    pub(crate) fn finish(mut self, voxels: &Voxels, chosen: impl Fn(usize) -> bool) -> Parts {
        let count = self.owned.len();
        let mut numbers = vec![u32::MAX; count];
        let mut of = vec![u32::MAX; count];
        let mut next = 0;
        let mut shared = Vec::new();
        for (voxel, of) in of.iter_mut().enumerate() {
            if !chosen(voxel) || !(self.owned[voxel] || self.crossing[voxel]) {
                continue;
            }
            let root = self.sets.find(voxel as u32) as usize;
            if numbers[root] == u32::MAX {
                numbers[root] = next;
                next += 1;
            }
            *of = numbers[root];
            if self.crossing[voxel] {
                shared.push((voxels.key[voxel], *of));
            }
        }
        Parts { of, border: Border { count: next, shared } }
    }
}

/// The components that a tile names.
pub(crate) struct Parts {
    /// Component of each voxel, or `u32::MAX`.
    pub(crate) of: Vec<u32>,
    pub(crate) border: Border,
}
