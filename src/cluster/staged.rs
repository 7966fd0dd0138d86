//! Methods that need several passes over the tiles with a barrier after each; and the two windows through which such
//! a method sees the drive. No files, no threads, no clock: the engine stores what stages return.
//!
//! A stage maps every tile to bytes (its *payload*), in any order and in parallel, and ends in a reduction, in tile
//! order, to bytes for the whole drive (its *global*). A later stage sees the globals of all earlier ones and the
//! payloads of tiles around it. The last stage labels points; its reduction says which labels are one object.

use std::ops::RangeInclusive;

use crate::error::Result;
use crate::model::{Chart, Lattice, Reach, TileCloud};

/// One stage of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage {
    /// Name of its pass.
    pub name: &'static str,
    /// Keys of the method's section that its payloads depend on, beside all those of earlier stages.
    pub settings: &'static [&'static str],
}

/// Points around a tile, none of them noise.
#[derive(Debug)]
pub struct TilePoints {
    /// Core and halo points.
    pub cloud: TileCloud,
    /// Whether the tile owns the point.
    pub core: Vec<bool>,
    /// Whether the point is ground; empty when only points of objects were asked for.
    pub ground: Vec<bool>,
    /// Whether these are all such points of the drive.
    pub whole: bool,
}

/// What reductions, and stages too, see of the drive.
pub trait DriveSource {
    /// The lattice of the run.
    fn lattice(&self) -> Lattice;
    /// Number of tiles.
    fn tiles(&self) -> u32;
    /// What an earlier stage (for a reduction: the stage itself, too) keeps of a tile.
    ///
    /// # Errors
    /// When it cannot be read.
    fn payload(&self, stage: usize, tile: u32) -> Result<Vec<u8>>;
    /// What the reduction of an earlier stage has returned.
    fn global(&self, stage: usize) -> &[u8];
}

/// What a stage sees of a tile.
pub trait TileSource: DriveSource {
    /// Number of the tile.
    fn tile(&self) -> u32;
    /// Edge of a cell in lattice units. A tile owns whole cells.
    fn cell_edge(&self) -> i64;
    /// Points of the tile and of every cell within `reach` lattice units of its cells, horizontally; with
    /// `objects_only` without ground.
    ///
    /// # Errors
    /// When they cannot be read.
    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints>;
    /// Tiles that own cells within `reach` lattice units of the points that [`Self::points`] gives for 0, itself included,
    /// ascending; so those of `points(a)` and of everything within b of them are in `near(a + b)`.
    fn near(&self, reach: i64) -> Vec<u32>;
    /// The tile that owns the first occupied cell (in the order of cells) that meets the square from `lo` to `hi`
    /// (inclusive), in lattice units; `None` where no point of the drive can be.
    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<u32>;
}

/// Points with their labels.
#[derive(Debug)]
pub struct Labelled {
    /// The points.
    pub points: TilePoints,
    /// Label of each: `1..=count`, or 0 for none. Those of points that the tile does not own are ignored.
    pub labels: Vec<u32>,
    /// Number of labels.
    pub count: u32,
}

/// What a stage returns for a tile.
#[derive(Debug)]
pub struct Mapped {
    /// What is kept.
    pub payload: Vec<u8>,
    /// The labels; from the last stage only.
    pub labelled: Option<Labelled>,
}

/// Which labels are one object, and what there is to say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Grouped {
    /// Group of label 1, 2, ... of each tile; equal groups are one object, 0 is none.
    pub groups: Vec<Vec<u32>>,
    /// Figures of the stages, for the report.
    pub figures: serde_json::Value,
    /// Charts, for people who choose thresholds.
    pub charts: Vec<Chart>,
}

/// A method of several stages; see the module.
pub trait StagedClusterer: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// How far around a tile points are read as a rule; the estimate of memory follows from it.
    fn reach(&self, lattice: Lattice) -> Reach;

    /// Smallest and largest number of points of an object, applied to whole objects.
    fn object_size(&self) -> RangeInclusive<u64>;

    /// The stages in their order.
    fn stages(&self) -> &'static [Stage];

    /// The payload of a tile.
    ///
    /// # Errors
    /// When the source fails or the points cannot be indexed.
    fn map(&self, stage: usize, tile: &dyn TileSource) -> Result<Mapped>;

    /// The global of a stage that is not the last.
    ///
    /// # Errors
    /// When the source fails.
    fn reduce(&self, stage: usize, drive: &dyn DriveSource) -> Result<Vec<u8>>;

    /// The reduction of the last stage.
    ///
    /// # Errors
    /// When the source fails.
    fn group(&self, drive: &dyn DriveSource) -> Result<Grouped>;
}
