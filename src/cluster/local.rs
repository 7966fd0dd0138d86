//! A method of one step that processes one tile at a time. It joins points, and the engine stitches labels
//! where tiles share points.

use std::ops::RangeInclusive;

use super::method::{
    BytesPer, DriveWindow, Labelled, Mapped, Method, Reduced, Repeat, Step, TilePoints, TileWindow,
};
use crate::error::{Error, Result};
use crate::model::{AlgorithmError, Lattice, Reach, TileCloud};

/// Bytes per point of objects that a tile needs at its peak. `scripts/tile_memory.py` measured 47 to 83 on
/// streets and 76 to 84 in forests.
pub(crate) const BYTES_PER_POINT: u64 = 88;

/// A method that joins points to objects, tile by tile.
pub trait Clusterer: std::fmt::Debug + Send + Sync {
    /// Name of the method in the registry, and of its section in the configuration.
    fn name(&self) -> &'static str;

    /// Largest distance from a point to other points that decide with which points it is joined.
    fn reach(&self, lattice: Lattice) -> Reach;

    /// Smallest and largest number of points of an object, applied to whole objects after stitching.
    fn object_size(&self) -> RangeInclusive<u64>;

    /// Values by name on which its labels depend and that are not settings.
    fn depends_on(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Labels the points of `cloud` (objects only, no ground or noise): `labels[i]` in `1..=n`, or 0 if the
    /// point is in no object, whatever its other neighbours are. Returns n. Two points have the same label if
    /// they are connected through points of the cloud. The engine unites labels across tiles.
    ///
    /// # Errors
    /// When the points cannot be indexed, see [`AlgorithmError`].
    ///
    /// # Panics
    /// When there is not one label per point.
    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError>;

    /// The same for a tile that owns the points where `core` is true. In some methods, a point can be in an
    /// object without connecting it to others (border points of `dbscan`). Such a method labels these points
    /// only if the tile owns them. The surroundings of other points may be cut off, and their labels must not
    /// unite objects.
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
    /// The method of a clusterer. `settings` are those that it depends on, see [`Step::settings`].
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
    // A clusterer may come from another crate.
    let largest = labels.iter().copied().max().unwrap_or(0);
    if largest > count || labels.len() != cloud.len() || count as usize > cloud.len() {
        let name = clusterer.name();
        let points = cloud.len();
        return Err(Error::bug(format!(
            "method {name} says that there are {count} clusters, and its largest label is {largest}, for {points} points"
        )));
    }
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

    fn depends_on(&self, _step: usize) -> Vec<(&'static str, String)> {
        self.clusterer.depends_on()
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
