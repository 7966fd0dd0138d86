//! The street that a drive went along, and how it is cut into tiles that fit the budget.

use crate::config::Config;
use crate::error::Result;
use crate::model::in_u32;
use crate::run::chain::Chain;
use crate::run::drive::{Drive, Surveyed};
use crate::run::engine::{Driver, Event};
use crate::run::plan::budget::{Budget, TileNeed};
use crate::run::plan::needs;
use crate::spatial::{Cell, CellGrid, PackedCells};
use crate::tiling::{Plan, PlanRequest, TileSize};

/// Plans tried until every thread can have any tile in flight. There may be none, for instance where a street meets itself and
/// what is around a tile changes with every metre: then some tiles wait for others.
const ATTEMPTS: usize = 5;

/// Record of how long the tiles are.
const STORED: &str = "plan.json";

/// The occupied cells in order of chainage. Needed for the plan and not after that.
#[derive(Debug)]
pub(crate) struct Street<'a> {
    surveyed: &'a Surveyed,
    grid: CellGrid,
    /// Vertex of the axis that each cell is nearest to, counted from 1.
    strips: PackedCells,
}

impl<'a> Street<'a> {
    /// The street of `surveyed`.
    pub(crate) fn of(surveyed: &'a Surveyed, drive: &Drive) -> Self {
        let edge_m = drive.lattice().metres(drive.grid.edge());
        let centre = |cell: Cell| cell.map(|index| (f64::from(index) + 0.5) * edge_m);
        let strip = |cell| in_u32(surveyed.axis.nearest(centre(cell)) + 1, "vertices of the axis");
        Self { surveyed, grid: drive.grid, strips: surveyed.cells.map(|cell, _| strip(cell)) }
    }

    /// The plan with tiles of `size`.
    pub(crate) fn plan(&self, size: &TileSize) -> Plan {
        Plan::new(&PlanRequest {
            cells: &self.surveyed.cells,
            strips: &self.strips,
            chainage_m: self.surveyed.axis.chainage_m(),
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
        let points = self.surveyed.survey.points();
        let mut size = TileSize::equal(budget.tiles(points, needs::bytes_per_point(chain)));
        let mut plan = self.plan(&size);
        let mut needs = needs::of_plan(chain, &plan);
        for _ in 1..ATTEMPTS {
            let Some(parts) = budget.balanced(points, &needs) else { break };
            let other_size = plan.cut_into(&parts);
            let other = self.plan(&other_size);
            let others = needs::of_plan(chain, &other);
            if budget.fits(&needs) && TileNeed::largest(&others) >= TileNeed::largest(&needs) {
                break;
            }
            (size, plan, needs) = (other_size, other, others);
        }
        (size, plan)
    }
}

/// The plan of an earlier call if it still serves, else one that fits the budget; `None` where the driver may not make
/// one.
pub(crate) fn settle<D: Driver>(
    driver: &D,
    surveyed: &Surveyed,
    drive: &Drive,
    chain: &Chain,
    config: &Config,
    budget: &Budget,
) -> Result<Option<Plan>> {
    let street = Street::of(surveyed, drive);
    let stored: Option<TileSize> = match driver.run_dir() {
        Some(run_dir) => run_dir.read_json(STORED)?,
        None => None,
    };
    if !driver.computes() {
        let length_m = config.tiling.tile_length;
        let asked = |size| if length_m > 0.0 { TileSize::Metres(length_m) } else { size };
        return Ok(stored.map(|size| street.plan(&asked(size))));
    }
    if let (Some(size @ TileSize::Equal { .. }), true) = (&stored, config.tiling.tile_length <= 0.0) {
        let plan = street.plan(size);
        if needs::largest(chain, &plan) <= budget.memory {
            return Ok(Some(plan));
        }
    }
    let (size, plan) = street.fit(config, chain, budget);
    if let Some(run_dir) = driver.run_dir().filter(|_| stored.as_ref() != Some(&size)) {
        run_dir.write_json(STORED, &size)?;
    }
    let largest = needs::largest(chain, &plan);
    if largest > budget.memory {
        let text = format!(
            "the largest tile needs about {} MiB, the budget is {} MiB: it is processed alone",
            largest >> 20,
            budget.memory >> 20
        );
        driver.tell(&Event::Warning { text: &text });
    }
    Ok(Some(plan))
}
