//! The cloud-optimised file of a drive: its columns by memory, and its two passes, `copc points` and `copc nodes`.

use crate::error::Result;
use crate::model::Kind;
use crate::output::LabelledFile;
use crate::output::points::copc::{CopcFormat, Cube};
use crate::run::drive::Tiled;
use crate::run::engine::{Driver, Outline};
use crate::run::finish::names::CLOUD;
use crate::run::open::Opened;
use crate::run::passes::copc_nodes::{self, CopcNodesPass};
use crate::run::passes::copc_points::{self, Columns, CopcPointsPass};
use crate::run::passes::copies::Shown;
use crate::run::passes::relabel::{self, PointColumns};
use crate::spatial::{CellMap, PackedCells};
use crate::store::{RunDir, StoreError};

/// Everything that the file is made of.
pub(crate) struct Cloud<'a> {
    pub(crate) open: &'a Opened<'a>,
    pub(crate) tiled: &'a Tiled<'a>,
    pub(crate) columns: &'a PointColumns,
    pub(crate) kinds: &'a [Kind],
    pub(crate) labelled: &'a [LabelledFile],
    pub(crate) run_dir: &'a RunDir,
    pub(crate) export: &'a Outline,
}

impl Cloud<'_> {
    /// Its passes, as far as they are known before the points are counted, to announce them.
    pub(crate) fn outlines(export: &Outline) -> [Outline; 2] {
        let points = copc_points::outline(export);
        let nodes = copc_nodes::outline(&points, &[]);
        [points, nodes]
    }

    /// Writes the file. `None` if the driver does not compute it.
    pub(crate) fn complete<D: Driver>(&self, driver: &mut D) -> Result<Option<()>> {
        let Self { open, tiled, run_dir, .. } = self;
        let drive = tiled.drive;
        let classifies = open.chain.method.classifies();
        let format = CopcFormat::of(drive.catalog.files(), &open.config.output.dimension, classifies)?;
        let columns = self.columns_within(copc_nodes::bytes_per_point(&format));
        let outline = copc_points::outline(self.export);
        let nodes = copc_nodes::outline(&outline, &columns.list);
        let points = CopcPointsPass {
            drive,
            point_columns: self.columns,
            kinds: self.kinds,
            labelled: self.labelled,
            shown: Shown::of(tiled),
            columns: &columns,
            format: &format,
            runs: relabel::runs(tiled),
            folder: copc_points::folder(run_dir),
            outline,
        };
        let Some(grouped) = driver.complete(&points)? else { return Ok(None) };
        let path = run_dir.out().join(CLOUD);
        let pass = CopcNodesPass {
            drive,
            columns: &columns,
            grouped: &grouped,
            format: &format,
            path: &path,
            outline: nodes,
        };
        let Some(()) = driver.complete(&pass)? else { return Ok(None) };
        // The file is complete. Its points and chunks are as large as itself, and are not needed any more.
        for outline in [&points.outline, &pass.outline] {
            run_dir.pass(&outline.folder, outline.depends.clone()).clear()?;
        }
        let folder = copc_points::folder(run_dir);
        fs_err::remove_dir_all(&folder).map_err(StoreError::io("remove", &folder))?;
        Ok(Some(()))
    }

    /// The columns that fit the memory: half of the budget for each thread.
    fn columns_within(&self, bytes_per_point: u64) -> Columns {
        let Self { open, tiled, .. } = self;
        let (low, high) = tiled.surveyed.extent();
        let edge = tiled.drive.grid.edge();
        let budget = open.budget.beside(tiled.surveyed.held_bytes());
        let most = budget.memory / 2 / budget.threads.max(1) as u64 / bytes_per_point;
        let mut cells = CellMap::default();
        for (cell, points) in tiled.plan.cells().iter().filter(|(cell, _)| tiled.plan.is_inside(*cell)) {
            *cells.entry(cell) = points;
        }
        Columns::of(Cube::around([low, high], edge), &PackedCells::from(cells), edge, most)
    }
}
