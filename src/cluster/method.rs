//! The trait of methods: steps with barriers between them, and the two windows through which a method sees
//! the drive. A method sees no files, no threads and no clock. The engine stores the results of its steps.
//!
//! A step maps every tile to bytes (its *payload*), in any order and in parallel. At its end, a reduction in
//! tile order computes bytes for the whole drive (its *global*). A later step sees the globals of all earlier
//! steps and the payloads of nearby tiles. A step runs once, or in rounds until it has settled. The last step
//! labels points, and its reduction decides which labels are one object.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use crate::config::ConfigError;
use crate::error::Result;
use crate::model::{Chart, Field, FieldSums, Kind, Lattice, Plane, Reach, TileCloud, TileId};
use crate::spatial::{Cell, CellGrid, CellMap, PackedCells};

/// How often a step runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeat {
    /// Once.
    Once,
    /// In rounds. In a round a tile sees the borders ([`Mapped::border`]) of other tiles after the previous
    /// round, and computes its payload again. Only tiles that see a changed border run again. If no border
    /// changes, the step is reduced. The reduction may ask for another round of all tiles
    /// ([`Reduced::Again`]). A tile may start from its own latest payload, but its result must be the same as
    /// from the borders alone.
    UntilSettled {
        /// Maximum number of rounds. After these the run ends with an error.
        most: u32,
    },
}

/// The points from which the memory of a step is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BytesPer {
    /// Bytes for every point that a tile reads, ground included.
    Point(u64),
    /// Bytes for every point of objects that a tile reads.
    ObjectPoint(u64),
}

/// One step of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// Name of its pass.
    pub name: &'static str,
    /// Settings on which its payloads depend, in addition to the settings of earlier steps: `section.key`, or
    /// `section.*` for a whole section.
    pub settings: &'static [&'static str],
    /// Memory that a tile needs at its peak, measured or estimated from sizes.
    pub bytes: BytesPer,
    /// How often it runs.
    pub repeat: Repeat,
}

/// Points around a tile, without noise.
#[derive(Debug)]
pub struct TilePoints {
    /// Core and halo points; the core points in ascending id.
    pub cloud: TileCloud,
    /// Whether the tile owns the point.
    pub core: Vec<bool>,
    /// Whether the point is ground. Empty if only points of objects were requested.
    pub ground: Vec<bool>,
}

/// Points with their labels.
#[derive(Debug)]
pub struct Labelled {
    /// The points. They include all points of objects in the core.
    pub points: TilePoints,
    /// Label of each point: `1..=count`, or 0 for none.
    pub labels: Vec<u32>,
    /// Number of labels.
    pub count: u32,
    /// Whether the labels of points that the tile does not own are used. If so, the labels of two tiles for
    /// the same point are one object ([`Reduced::SharedPoints`]). Otherwise these labels are ignored.
    pub with_halo: bool,
}

/// The result of a step for a tile.
#[derive(Debug, Default)]
pub struct Mapped {
    /// The payload.
    pub payload: Vec<u8>,
    /// The border that other tiles see in the next round, if the step is repeated.
    pub border: Vec<u8>,
    /// The labels. Only the last step has them.
    pub labelled: Option<Labelled>,
}

impl Mapped {
    /// A result without border and labels.
    #[must_use]
    pub fn payload(payload: Vec<u8>) -> Self {
        Self { payload, ..Self::default() }
    }
}

/// The grouping of labels into objects, with figures and charts for the report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Grouped {
    /// Group of label 1, 2, ... of each tile. Labels with equal groups are one object. Group 0 is not an
    /// object.
    pub groups: Vec<Vec<u32>>,
    /// Class and confidence of each group, from methods that classify. Empty otherwise.
    pub kinds: BTreeMap<u32, Kind>,
    /// Plane of each group, from methods that find surfaces. Empty otherwise.
    pub planes: BTreeMap<u32, Plane>,
    /// Figures of the steps for the report, by name.
    pub figures: Figures,
    /// Charts for the choice of thresholds.
    pub charts: Vec<Chart>,
}

/// Figures for the report, by name.
pub type Figures = serde_json::Map<String, serde_json::Value>;

/// The result of a reduction.
#[derive(Debug)]
pub enum Reduced {
    /// The global of a step. The step is not the last.
    Global(Vec<u8>),
    /// A request for another round of all tiles. These bytes are [`DriveWindow::again`] in that round.
    Again(Vec<u8>),
    /// From the last step: labels of two tiles for the same point are one object.
    SharedPoints,
    /// From the last step: the method groups labels into objects.
    Groups(Grouped),
}

/// The drive as reductions and steps see it.
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
    /// Sums of the fields that the method requests ([`Method::fields`]) over all points of the drive.
    fn field_sums(&self) -> &[(Field, FieldSums)];
    /// The payload of a tile from an earlier step. In a reduction, and from the second round on, also the
    /// latest payload of this step. In a round, a tile should read only its own payload, because the payload
    /// of another tile depends on which tiles have run.
    ///
    /// # Errors
    /// When it cannot be read.
    fn payload(&self, step: usize, tile: TileId) -> Result<Vec<u8>>;
    /// The global of an earlier step.
    fn global(&self, step: usize) -> &[u8];
    /// The bytes that the previous reduction returned with [`Reduced::Again`]. Empty before that.
    fn again(&self) -> &[u8];
}

/// A tile as a step sees it.
pub trait TileWindow: DriveWindow {
    /// The tile.
    fn tile(&self) -> TileId;
    /// The raster. A tile owns whole cells.
    fn grid(&self) -> CellGrid;
    /// Points of objects, ground and noise in each occupied cell of the drive.
    fn occupied(&self) -> &PackedCells;
    /// The cells that [`Self::points`] reads. Their values are not 0.
    fn cells(&self, reach: i64) -> CellMap<u8>;
    /// Points of the tile and of every cell within `reach` lattice units of its cells, horizontally. With
    /// `objects_only`, ground is left out.
    ///
    /// # Errors
    /// When they cannot be read.
    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints>;
    /// Points of objects in these cells, anywhere in the drive. None of them is a core point.
    ///
    /// # Errors
    /// When they cannot be read.
    fn points_of(&self, cells: Vec<Cell>) -> Result<TilePoints>;
    /// Tiles that own cells within `reach` lattice units of the points of [`Self::points`] with reach 0, this
    /// tile included, ascending. So `near(a + b)` contains the owners of all cells within b of `points(a)`.
    fn near(&self, reach: i64) -> Vec<TileId>;
    /// Tiles that own cells within `reach` lattice units of the points of these cells, ascending.
    fn near_cells(&self, cells: &[Cell], reach: i64) -> Vec<TileId>;
    /// The tile that owns the first occupied cell (in the order of cells) that meets the square from `lo` to
    /// `hi` (inclusive), in lattice units. `None` if the drive cannot have points there.
    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<TileId>;
    /// Number of the round, from 0, if the step is repeated.
    fn round(&self) -> u32;
    /// The border of a tile after the previous round. Empty in round 0.
    ///
    /// # Errors
    /// When it cannot be read.
    fn border(&self, tile: TileId) -> Result<Vec<u8>>;
}

/// A method that joins points to objects.
pub trait Method: std::fmt::Debug + Send + Sync {
    /// Name of the method in the registry, and of its section in the configuration.
    fn name(&self) -> &'static str;

    /// Smallest and largest number of points of an object, applied to whole objects.
    fn object_size(&self) -> RangeInclusive<u64>;

    /// The steps in their order. The last one runs once and labels points.
    fn steps(&self) -> &[Step];

    /// The kinds of objects that the method can give ([`Grouped::kinds`]), with confidence 0. Empty from
    /// methods that give objects no class.
    fn kinds(&self) -> Vec<Kind> {
        Vec::new()
    }

    /// Whether the method gives objects a class.
    fn classifies(&self) -> bool {
        !self.kinds().is_empty()
    }

    /// Whether objects are surfaces with a plane ([`Grouped::planes`]).
    fn finds_surfaces(&self) -> bool {
        false
    }

    /// Further fields of points that the method needs. Their sums over the drive are computed.
    fn fields(&self) -> &[Field] {
        &[]
    }

    /// Values by name on which a step depends and that are not settings, for example the checksum of a model.
    fn depends_on(&self, _step: usize) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// The file of the model that the method needs, as given in a setting. `None` if it needs no model.
    fn model_file(&self) -> Option<&str> {
        None
    }

    /// Loads the model from the content of that file.
    ///
    /// # Errors
    /// When the content is not a model that the method can use.
    fn use_model(&mut self, _file: &str, _content: &[u8]) -> Result<()> {
        Ok(())
    }

    /// Names of the charts that the method draws ([`Grouped::charts`]). They are files of the run.
    fn charts(&self) -> &'static [&'static str] {
        &[]
    }

    /// Distance around a tile within which points are normally read. The plan uses it before anything is
    /// known about the drive.
    fn planning_reach(&self, lattice: Lattice) -> Reach;

    /// Processor time of all steps per point that a tile reads, in microseconds on the machine of
    /// `benches/results`, for estimates of the time of a run.
    fn microseconds_per_point(&self) -> f64 {
        0.9
    }

    /// Bytes that all steps store per point of the drive, for estimates of the disk space of a run. Measured
    /// on the four simulated scenes with the default settings: the largest of the four.
    fn stored_bytes_per_point(&self) -> u64 {
        2
    }

    /// Distance in metres beyond which points normally do not change an object. If only a section of a drive
    /// is processed, all points within this distance of its objects are read.
    fn deciding_reach_m(&self, lattice: Lattice) -> f64 {
        2.0 * self.planning_reach(lattice).metres()
    }

    /// Warning to the user if only a section of a drive is processed: the result depends on a value over all
    /// processed points, which may differ from that of the whole drive. `None` if there is no such value, or
    /// if the settings give it.
    fn of_a_section(&self) -> Option<String> {
        None
    }

    /// Whether [`Self::planning_reach`] is only an estimate, because the reach depends on the drive.
    fn reach_is_provisional(&self) -> bool {
        false
    }

    /// Distance around a tile within which a step reads points, in lattice units. The earlier steps are
    /// complete.
    ///
    /// # Errors
    /// When the results of the earlier steps cannot be used.
    fn reach(&self, _step: usize, drive: &dyn DriveWindow) -> Result<i64> {
        let lattice = drive.lattice();
        Ok(lattice.units_up(self.planning_reach(lattice).metres()))
    }

    /// Distance around a tile within which a repeated step sees the borders of other tiles, in lattice units.
    fn border_reach(&self, _step: usize, _lattice: Lattice) -> i64 {
        0
    }

    /// Computes a step for a tile.
    ///
    /// # Errors
    /// When the window fails or the points cannot be indexed.
    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped>;

    /// Reduces a step over all tiles.
    ///
    /// # Errors
    /// When the window fails.
    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced>;

    /// Warnings to the user about this drive, once all steps except the last are complete.
    ///
    /// # Errors
    /// When a global cannot be read.
    fn warnings(&self, _drive: &dyn DriveWindow) -> Result<Vec<String>> {
        Ok(Vec::new())
    }

    /// Figures to report once all steps except the last are complete, by name.
    ///
    /// # Errors
    /// When a global cannot be read.
    fn figures(&self, _drive: &dyn DriveWindow) -> Result<Figures> {
        Ok(Figures::new())
    }
}

/// The sections of the configuration, by name. A missing section is an empty table.
pub type Sections<'a> = &'a dyn Fn(&str) -> toml::Table;

/// One line of the registry.
#[derive(Debug, Clone, Copy)]
pub struct ClusterEntry {
    /// Name of the method and of its section in the configuration.
    pub name: &'static str,
    /// A description in one line.
    pub summary: &'static str,
    /// Its publication.
    pub reference: &'static str,
    /// Builds the method from its sections of the configuration. Missing keys have their defaults.
    pub build: fn(Sections<'_>) -> Result<Box<dyn Method>, ConfigError>,
}
