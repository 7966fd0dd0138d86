//! A method of one step that looks at one tile at a time: it joins points, and tiles are stitched where they share
//! points.

use std::ops::RangeInclusive;

use super::method::{
    BytesPer, DriveWindow, Labelled, Mapped, Method, Reduced, Repeat, Step, TilePoints, TileWindow,
};
use crate::error::{Error, Result};
use crate::model::{AlgorithmError, Lattice, Reach, TileCloud};

/// Bytes per point of objects that a tile needs at its peak: `scripts/tile_memory.py` measured 47 to 83 on streets and 76 to
/// 84 in forests.
pub(crate) const BYTES_PER_POINT: u64 = 88;

/// A method that joins points to objects, tile by tile.
pub trait Clusterer: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// How far from a point other points matter for what it is joined with.
    fn reach(&self, lattice: Lattice) -> Reach;

    /// Smallest and largest number of points of an object, applied to whole objects after stitching.
    fn object_size(&self) -> RangeInclusive<u64>;

    /// Labels the points of `cloud` (objects only, no ground or noise): `labels[i]` in `1..=n`, or 0 for a point
    /// that is in no object whatever its other neighbours are. Returns n. Two points have the same label when they
    /// are connected through points of the cloud; the engine unites labels across tiles.
    ///
    /// # Errors
    /// When the points cannot be indexed, see [`AlgorithmError`].
    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError>;

    /// The same for a tile that owns the points where `core` is true. A method whose points can be in an object
    /// without passing the connection on (border points of `dbscan`) gives such points a label only where the tile
    /// owns them: what is around the others may lie outside, and a label they have elsewhere must not unite objects.
    ///
    /// # Errors
    /// Those of [`Clusterer::cluster`].
    fn cluster_tile(
        &self,
        cloud: &TileCloud,
        core: &[bool],
        labels: &mut [u32],
    ) -> Result<u32, AlgorithmError> {
        debug_assert_eq!(core.len(), cloud.len());
        self.cluster(cloud, labels)
    }
}

/// A [`Clusterer`] as a [`Method`].
#[derive(Debug)]
pub struct OneStep<C> {
    clusterer: C,
    steps: [Step; 1],
}

impl<C: Clusterer> OneStep<C> {
    /// The method of a clusterer that depends on these settings, see [`Step::settings`].
    pub fn new(clusterer: C, settings: &'static [&'static str]) -> Self {
        let bytes = BytesPer::ObjectPoint(BYTES_PER_POINT);
        Self { clusterer, steps: [Step { name: "cluster", settings, bytes, repeat: Repeat::Once }] }
    }
}

/// The points of objects around a tile, labelled by a clusterer.
pub(crate) fn label(clusterer: &dyn Clusterer, tile: &dyn TileWindow, reach: i64) -> Result<Mapped> {
    let points = tile.points(reach, true)?;
    let TilePoints { cloud, core, .. } = &points;
    let mut labels = vec![0; cloud.len()];
    let count = clusterer.cluster_tile(cloud, core, &mut labels)?;
    Ok(Mapped { labelled: Some(Labelled { points, labels, count, with_halo: true }), ..Mapped::default() })
}

impl<C: Clusterer> Method for OneStep<C> {
    fn name(&self) -> &'static str {
        self.clusterer.name()
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        self.clusterer.object_size()
    }

    fn steps(&self) -> &[Step] {
        &self.steps
    }

    fn planning_reach(&self, lattice: Lattice) -> Reach {
        self.clusterer.reach(lattice)
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        label(&self.clusterer, tile, self.reach(step, tile)?)
    }

    fn reduce(&self, step: usize, _drive: &dyn DriveWindow) -> Result<Reduced> {
        match step {
            0 => Ok(Reduced::SharedPoints),
            other => Err(Error::bug(format!("{} has no step {other}", self.name()))),
        }
    }
}
