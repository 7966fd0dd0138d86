//! What a method is: steps with barriers between them, and the two windows through which it sees the drive. It sees no
//! files, no threads and no clock: the engine keeps what steps return.
//!
//! A step maps every tile to bytes (its *payload*), in any order and in parallel, and ends in a reduction, in tile order,
//! to bytes for the whole drive (its *global*). A later step sees the globals of all earlier ones and the payloads of
//! tiles around it. A step runs once, or in rounds until it has settled. The last step labels points; its reduction says
//! which labels are one object.

use std::ops::RangeInclusive;

use crate::config::ConfigError;
use crate::error::Result;
use crate::model::{Chart, Field, FieldSums, Lattice, Reach, TileCloud, TileId};
use crate::spatial::{Cell, CellGrid, CellMap, PackedCells};

/// How often a step runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeat {
    /// Once.
    Once,
    /// In rounds. In a round a tile sees the borders ([`Mapped::border`]) that other tiles had in the round before, and
    /// computes its payload anew from them. Only tiles that see a changed border run again. When none does, the step is
    /// reduced; the reduction may ask for another round of all tiles ([`Reduced::Again`]).
    UntilSettled {
        /// Rounds after which the run gives up with an error.
        most: u32,
    },
}

/// Whose bytes the memory of a step is estimated from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BytesPer {
    /// So many bytes for every point that a tile reads, ground included.
    Point(u64),
    /// So many bytes for every point of objects that a tile reads.
    ObjectPoint(u64),
}

/// One step of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// Name of its pass.
    pub name: &'static str,
    /// Settings that its payloads depend on, beside all those of earlier steps: `section.key`, or `section.*` for all of
    /// a section.
    pub settings: &'static [&'static str],
    /// Memory that a tile needs at its peak, measured or estimated from sizes.
    pub bytes: BytesPer,
    /// How often it runs.
    pub repeat: Repeat,
}

/// Points around a tile, none of them noise.
#[derive(Debug)]
pub struct TilePoints {
    /// Core and halo points; the core points in ascending id.
    pub cloud: TileCloud,
    /// Whether the tile owns the point.
    pub core: Vec<bool>,
    /// Whether the point is ground; empty when only points of objects were asked for.
    pub ground: Vec<bool>,
}

/// Points with their labels.
#[derive(Debug)]
pub struct Labelled {
    /// The points; all points of objects in the core are among them.
    pub points: TilePoints,
    /// Label of each: `1..=count`, or 0 for none.
    pub labels: Vec<u32>,
    /// Number of labels.
    pub count: u32,
    /// Whether labels of points that the tile does not own count: then labels of two tiles that share a point are one
    /// object ([`Reduced::SharedPoints`]). Else they are ignored.
    pub with_halo: bool,
}

/// What a step returns for a tile.
#[derive(Debug, Default)]
pub struct Mapped {
    /// What is kept.
    pub payload: Vec<u8>,
    /// What other tiles see of it in the next round, where the step is repeated.
    pub border: Vec<u8>,
    /// The labels; from the last step only.
    pub labelled: Option<Labelled>,
}

impl Mapped {
    /// A payload, without border and labels.
    #[must_use]
    pub fn payload(payload: Vec<u8>) -> Self {
        Self { payload, ..Self::default() }
    }
}

/// Which labels are one object, and what there is to say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Grouped {
    /// Group of label 1, 2, ... of each tile; equal groups are one object, 0 is none.
    pub groups: Vec<Vec<u32>>,
    /// Figures of the steps, for the report, by the name they have there.
    pub figures: Figures,
    /// Charts, for people who choose thresholds.
    pub charts: Vec<Chart>,
}

/// Figures for the report, by name.
pub type Figures = serde_json::Map<String, serde_json::Value>;

/// What a reduction returns.
#[derive(Debug)]
pub enum Reduced {
    /// The global of a step that is not the last.
    Global(Vec<u8>),
    /// Another round of all tiles, which see these bytes as [`DriveWindow::again`].
    Again(Vec<u8>),
    /// Of the last step: labels of two tiles that share a point are one object.
    SharedPoints,
    /// Of the last step: the method says which labels are one object.
    Groups(Grouped),
}

/// What reductions, and steps too, see of the drive.
pub trait DriveWindow {
    /// The lattice of the run.
    fn lattice(&self) -> Lattice;
    /// Number of tiles.
    fn tiles(&self) -> usize;
    /// Points of objects in the drive.
    fn objects(&self) -> u64;
    /// Smallest and largest coordinates of the drive in lattice units.
    fn extent(&self) -> ([i64; 3], [i64; 3]);
    /// Length of the longest tile along the axis in metres.
    fn longest_tile_m(&self) -> f64;
    /// Sums of the fields that the method asked for ([`Method::fields`]) over all points of the drive.
    fn field_sums(&self) -> &[(Field, FieldSums)];
    /// The payload of a tile from an earlier step; for a reduction, the step itself, too.
    ///
    /// # Errors
    /// When it cannot be read.
    fn payload(&self, step: usize, tile: TileId) -> Result<Vec<u8>>;
    /// The global of an earlier step.
    fn global(&self, step: usize) -> &[u8];
    /// What the reduction of the round before has returned with [`Reduced::Again`]; empty in the first rounds.
    fn again(&self) -> &[u8];
}

/// What a step sees of a tile.
pub trait TileWindow: DriveWindow {
    /// The tile.
    fn tile(&self) -> TileId;
    /// The raster. A tile owns whole cells.
    fn grid(&self) -> CellGrid;
    /// Points of objects, ground and noise in each occupied cell of the drive.
    fn occupied(&self) -> &PackedCells;
    /// The cells that [`Self::points`] reads; values are not 0 there.
    fn cells(&self, reach: i64) -> CellMap<u8>;
    /// Points of the tile and of every cell within `reach` lattice units of its cells, horizontally; with
    /// `objects_only` without ground.
    ///
    /// # Errors
    /// When they cannot be read.
    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints>;
    /// Points of objects of these cells, wherever they are; none of them counts as core.
    ///
    /// # Errors
    /// When they cannot be read.
    fn points_of(&self, cells: Vec<Cell>) -> Result<TilePoints>;
    /// Tiles that own cells within `reach` lattice units of the points that [`Self::points`] gives for 0, itself included,
    /// ascending; so those of `points(a)` and of everything within b of them are in `near(a + b)`.
    fn near(&self, reach: i64) -> Vec<TileId>;
    /// Tiles that own cells within `reach` lattice units of the points of these cells, ascending.
    fn near_cells(&self, cells: &[Cell], reach: i64) -> Vec<TileId>;
    /// The tile that owns the first occupied cell (in the order of cells) that meets the square from `lo` to `hi`
    /// (inclusive), in lattice units; `None` where no point of the drive can be.
    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<TileId>;
    /// Number of the round of a step that is repeated, from 0.
    fn round(&self) -> u32;
    /// The border that a tile had after the round before; empty in round 0.
    ///
    /// # Errors
    /// When it cannot be read.
    fn border(&self, tile: TileId) -> Result<Vec<u8>>;
}

/// A method that joins points to objects.
pub trait Method: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// Smallest and largest number of points of an object, applied to whole objects.
    fn object_size(&self) -> RangeInclusive<u64>;

    /// The steps in their order; the last one runs once and labels points.
    fn steps(&self) -> &[Step];

    /// Further fields of points that it needs, with sums over the drive.
    fn fields(&self) -> &[Field] {
        &[]
    }

    /// How far around a tile points are read as a rule, before anything is known of the drive; the plan follows from it.
    fn planning_reach(&self, lattice: Lattice) -> Reach;

    /// Whether [`Self::planning_reach`] only stands in for a reach that is known once the drive is.
    fn reach_is_provisional(&self) -> bool {
        false
    }

    /// How far around a tile a step reads points, in lattice units, now that the earlier steps are complete.
    ///
    /// # Errors
    /// When what they found cannot be used.
    fn reach(&self, _step: usize, drive: &dyn DriveWindow) -> Result<i64> {
        let lattice = drive.lattice();
        Ok(lattice.units_up(self.planning_reach(lattice).metres()))
    }

    /// How far around a tile a step that is repeated looks at the borders of others, in lattice units.
    fn border_reach(&self, _step: usize, _lattice: Lattice) -> i64 {
        0
    }

    /// What a step makes of a tile.
    ///
    /// # Errors
    /// When the window fails or the points cannot be indexed.
    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped>;

    /// What a step has found over all tiles.
    ///
    /// # Errors
    /// When the window fails.
    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced>;

    /// What there is to report once all steps but the last are complete, by name.
    ///
    /// # Errors
    /// When a global cannot be read.
    fn figures(&self, _drive: &dyn DriveWindow) -> Result<Figures> {
        Ok(Figures::new())
    }
}

/// The sections of the configuration by name; empty tables where there is none.
pub type Sections<'a> = &'a dyn Fn(&str) -> toml::Table;

/// One line of the registry.
#[derive(Debug, Clone, Copy)]
pub struct ClusterEntry {
    /// Name of the method and of its section in the configuration.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// Where it is published.
    pub reference: &'static str,
    /// Builds the method from the sections of the configuration that it asks for; missing keys have their defaults.
    pub build: fn(Sections<'_>) -> Result<Box<dyn Method>, ConfigError>,
}
