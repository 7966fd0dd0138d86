//! The street that a drive went along, and how it is cut into tiles that fit the budget.

use crate::config::Config;
use crate::run::budget::{Budget, TileNeed};
use crate::run::drive::Drive;
use crate::run::methods::Chain;
use crate::run::scene::Scene;
use crate::spatial::{Cell, CellGrid, PackedCells};
use crate::tiling::{Plan, PlanRequest, TileSize};

/// Plans tried until every thread can have any tile in flight. There may be none, for instance where a street meets itself and
/// what is around a tile changes with every metre: then some tiles wait for others.
const ATTEMPTS: usize = 5;

/// The occupied cells in order of chainage. Needed for the plan and not after that.
#[derive(Debug)]
pub(crate) struct Street<'a> {
    scene: &'a Scene,
    grid: CellGrid,
    /// Vertex of the axis that each cell is nearest to, counted from 1.
    strips: PackedCells,
}

impl<'a> Street<'a> {
    /// The street of `scene`.
    pub(crate) fn of(scene: &'a Scene, drive: &Drive) -> Self {
        let edge_m = drive.lattice().metres(drive.grid.edge());
        let centre = |cell: Cell| cell.map(|index| (f64::from(index) + 0.5) * edge_m);
        let strip = |cell| u32::try_from(scene.axis.nearest(centre(cell)) + 1).unwrap_or(u32::MAX);
        Self { scene, grid: drive.grid, strips: scene.cells.map(|cell, _| strip(cell)) }
    }

    /// The plan with tiles of `size`.
    pub(crate) fn plan(&self, size: &TileSize) -> Plan {
        Plan::new(&PlanRequest {
            cells: &self.scene.cells,
            strips: &self.strips,
            chainage_m: self.scene.axis.chainage_m(),
            grid: self.grid,
            size,
        })
    }

    /// The tile size that the configuration asks for or the budget allows, and its plan.
    pub(crate) fn fit(&self, config: &Config, chain: &Chain, budget: &Budget) -> (TileSize, Plan) {
        if config.tiling.tile_length > 0.0 {
            let size = TileSize::Metres(config.tiling.tile_length);
            let plan = self.plan(&size);
            return (size, plan);
        }
        let points = self.scene.survey.points();
        let mut size = TileSize::equal(budget.tiles(points, chain.bytes_per_point()));
        let mut plan = self.plan(&size);
        let mut needs = chain.needs(&plan);
        for _ in 1..ATTEMPTS {
            let Some(parts) = budget.balanced(points, &needs) else { break };
            let other_size = plan.cut_into(&parts);
            let other = self.plan(&other_size);
            let others = chain.needs(&other);
            if budget.fits(&needs) && TileNeed::largest(&others) >= TileNeed::largest(&needs) {
                break;
            }
            (size, plan, needs) = (other_size, other, others);
        }
        (size, plan)
    }
}
