//! The cloud-optimised file of a drive: its columns, and its two passes, `copc points` and `copc nodes`.

use crate::error::Result;
use crate::model::Kind;
use crate::output::LabelledFile;
use crate::output::points::copc::{CopcFormat, Cube};
use crate::run::drive::{Surveyed, Tiled};
use crate::run::engine::{Driver, Outline};
use crate::run::finish::names::{self, CLOUD};
use crate::run::open::Opened;
use crate::run::passes::copc_nodes::{self, CopcNodesPass};
use crate::run::passes::copc_points::{self, Columns, CopcPointsPass};
use crate::run::passes::copies::Shown;
use crate::run::passes::relabel::{self, PointColumns};
use crate::spatial::{CellMap, PackedCells};
use crate::store::RunDir;

/// Everything from which the file is made.
pub(crate) struct Cloud<'a> {
    pub(crate) open: &'a Opened<'a>,
    pub(crate) tiled: &'a Tiled<'a>,
    pub(crate) columns: &'a PointColumns,
    pub(crate) kinds: &'a [Kind],
    pub(crate) labelled: &'a [LabelledFile],
    pub(crate) run_dir: &'a RunDir,
    pub(crate) outlines: &'a [Outline; 2],
}

/// What its records look like.
///
/// # Errors
/// [`crate::output::OutputError::Copc`] if the points are too far apart for one file.
pub(crate) fn format<'a>(open: &'a Opened<'_>, surveyed: &Surveyed) -> Result<CopcFormat<'a>> {
    let method = open.chain.method.as_ref();
    let (low, high) = surveyed.extent();
    let frame = (open.drive.lattice(), [low, high]);
    let label = (names::dimension(open.config, method), method.finds_surfaces());
    Ok(CopcFormat::of(open.drive.catalog.files(), frame, label, method.classifies())?)
}

impl Cloud<'_> {
    /// Its passes.
    pub(crate) fn outlines(export: &Outline) -> [Outline; 2] {
        let points = copc_points::outline(export);
        let nodes = copc_nodes::outline(&points);
        [points, nodes]
    }

    /// Writes the file. `None` if the driver does not compute it.
    pub(crate) fn complete<D: Driver>(&self, driver: &mut D) -> Result<Option<()>> {
        let Self { open, tiled, run_dir, .. } = self;
        let drive = tiled.drive;
        let format = format(open, tiled.surveyed)?;
        let columns = self.columns(&format);
        let [outline, nodes] = self.outlines.clone();
        let points = CopcPointsPass {
            drive,
            point_columns: self.columns,
            kinds: self.kinds,
            labelled: self.labelled,
            shown: Shown::of(tiled),
            columns: &columns,
            format: &format,
            runs: relabel::runs(tiled),
            outline,
        };
        let Some(grouped) = driver.complete(&points)? else { return Ok(None) };
        let path = run_dir.out().join(CLOUD);
        let pass = CopcNodesPass {
            drive,
            columns: &columns,
            with_points: grouped.columns(),
            grouped: &grouped,
            format: &format,
            path: &path,
            outline: nodes,
        };
        driver.complete(&pass)
    }

    /// The columns. They follow from the tiles alone, so that every process that shares a run finds the same
    /// ones. A column has at most half as many points as the largest tile. A point of a column takes about as
    /// many bytes as a point of a tile in a clustering method. The other half is room for methods that need
    /// less, whose tiles have more points.
    fn columns(&self, format: &CopcFormat<'_>) -> Columns {
        let Self { tiled, .. } = self;
        let (low, high) = tiled.surveyed.extent();
        let extent = format.extent_in_tree([low, high]);
        let edge = tiled.drive.grid.edge();
        let most = tiled.plan.tiles.iter().map(|tile| tile.points).max().unwrap_or(0) / 2;
        let mut cells = CellMap::default();
        for (cell, points) in tiled.plan.cells().iter().filter(|(cell, _)| tiled.plan.is_inside(*cell)) {
            *cells.entry(cell) = points;
        }
        Columns::of(Cube::around(extent, edge), &PackedCells::from(cells), edge, most)
    }
}
