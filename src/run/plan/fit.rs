//! Cuts the street of a drive into tiles that fit the budget.

use crate::codec;
use crate::config::Config;
use crate::error::Result;
use crate::model::in_u32;
use crate::run::chain::Chain;
use crate::run::drive::{Drive, Surveyed};
use crate::run::engine::{Driver, Event};
use crate::run::plan::budget::{Budget, TileNeed};
use crate::run::plan::needs;
use crate::spatial::{Cell, CellGrid, PackedCells};
use crate::store::Inputs;
use crate::tiling::{Plan, PlanRequest, TileSize};

/// Maximum number of plans that are tried to let every thread process any tile. There may be no such plan,
/// for instance if a street crosses itself and the halo of a tile changes with every metre. Then some tiles
/// wait for others.
const ATTEMPTS: usize = 5;

/// Folder with the vertex of the axis nearest to each cell.
pub(crate) const STRIPS: &str = "strips";

/// The vertices depend on the axis, and the cells on the content of the input.
fn depends(surveyed: &Surveyed, drive: &Drive) -> Inputs {
    Inputs::new()
        .with("input content", format!("{:016x}", surveyed.content_digest()))
        .with("cell", drive.grid.edge())
        .with("lattice.units_per_m", drive.lattice().units_per_m())
        .with("axis", format!("{:016x}", surveyed.axis.digest()))
        .with("section", format!("{:?}", surveyed.section_m()))
}

/// File with the size of the tiles. Sections have files of their own, because their tiles differ.
fn stored_name(surveyed: &Surveyed) -> String {
    match surveyed.section_m() {
        Some((from, to)) => format!("plan-{from}-{to}.json"),
        None => "plan.json".to_owned(),
    }
}

/// Whether a file of the state contains the size of the tiles.
pub(crate) fn is_stored_name(name: &str) -> bool {
    name == "plan.json" || name.starts_with("plan-")
}

/// The occupied cells in order of chainage. Only the plan needs them.
#[derive(Debug)]
pub(crate) struct Street<'a> {
    surveyed: &'a Surveyed,
    grid: CellGrid,
    /// The vertex of the axis nearest to each cell, counted from 1.
    strips: PackedCells,
}

impl<'a> Street<'a> {
    /// The street of `surveyed`. The search for the vertices takes most of the start-up time of a process on
    /// a long drive, so they are stored.
    fn of<D: Driver>(driver: &D, surveyed: &'a Surveyed, drive: &Drive) -> Result<Self> {
        let dir = driver.run_dir().map(|run_dir| run_dir.pass(STRIPS, depends(surveyed, drive)));
        let stored = match &dir {
            Some(dir) => dir.load(0)?.ok().map(|bytes| codec::decode::<Vec<u32>>(&bytes)).transpose()?,
            None => None,
        };
        if let Some(strips) = stored.filter(|strips| strips.len() == surveyed.processed().len()) {
            let mut strips = strips.into_iter();
            let strips = surveyed.processed().map(|_, _| strips.next().unwrap_or(1));
            return Ok(Self { surveyed, grid: drive.grid, strips });
        }
        let edge_m = drive.lattice().metres(drive.grid.edge());
        let centre = |cell: Cell| cell.map(|index| (f64::from(index) + 0.5) * edge_m);
        let mut found = Vec::with_capacity(surveyed.processed().len());
        let strips = surveyed.processed().map(|cell, _| {
            let strip = in_u32(surveyed.axis.nearest(centre(cell)) + 1, "vertices of the axis");
            found.push(strip);
            strip
        });
        if let Some(dir) = dir.filter(|_| driver.computes()) {
            dir.prepare()?;
            dir.commit(0, &codec::encode(&found)?)?;
        }
        Ok(Self { surveyed, grid: drive.grid, strips })
    }

    /// The plan with tiles of `size`.
    pub(crate) fn plan(&self, size: &TileSize) -> Plan {
        Plan::new(&PlanRequest {
            cells: self.surveyed.processed(),
            strips: &self.strips,
            chainage_m: self.surveyed.axis.chainage_m(),
            grid: self.grid,
            size,
            inside: self.surveyed.inside(),
        })
    }

    /// The tile size of the configuration or of the budget, and its plan.
    pub(crate) fn fit(&self, config: &Config, chain: &Chain, budget: &Budget) -> (TileSize, Plan) {
        if config.tiling.tile_length > 0.0 {
            let size = TileSize::Metres(config.tiling.tile_length);
            let plan = self.plan(&size);
            return (size, plan);
        }
        let points = self.surveyed.processed().iter().map(|(_, points)| u64::from(points)).sum();
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

/// The warning about tiles that need more memory than the budget.
pub(crate) fn over_budget(largest: u64, budget: &Budget) -> String {
    let [largest, asked, left] = [largest, budget.asked, budget.memory].map(|bytes| bytes >> 20);
    if largest > asked {
        format!(
            "a tile needs {largest} MiB, more than the memory budget of {asked} MiB (--memory): it runs by itself"
        )
    } else {
        format!(
            "a tile needs {largest} MiB, and {left} MiB of the memory budget of {asked} MiB (--memory) are left for tiles: \
             it runs by itself"
        )
    }
}

/// The plan of an earlier call if it still fits, or else a new plan that fits the budget. `None` if the
/// driver must not make one.
pub(crate) fn settle<D: Driver>(
    driver: &D,
    surveyed: &Surveyed,
    drive: &Drive,
    chain: &Chain,
    config: &Config,
    budget: &Budget,
) -> Result<Option<Plan>> {
    let street = Street::of(driver, surveyed, drive)?;
    let name = stored_name(surveyed);
    let stored: Option<TileSize> = match driver.run_dir() {
        Some(run_dir) if driver.computes() => run_dir.read_json(&name)?,
        Some(run_dir) => run_dir.await_json(&name)?,
        None => None,
    };
    let length_m = config.tiling.tile_length;
    let asked = |size| if length_m > 0.0 { TileSize::Metres(length_m) } else { size };
    if !driver.computes() {
        return Ok(stored.map(|size| street.plan(&asked(size))));
    }
    let kept = match &stored {
        Some(size) if driver.keeps_plan() => Some(street.plan(&asked(size.clone()))),
        Some(size @ TileSize::Equal { .. }) if length_m <= 0.0 => {
            Some(street.plan(size)).filter(|plan| budget.keeps(needs::largest(chain, plan)))
        }
        _ => None,
    };
    let plan = match kept {
        Some(plan) => plan,
        None => {
            let (size, plan) = street.fit(config, chain, budget);
            if let Some(run_dir) = driver.run_dir().filter(|_| stored.as_ref() != Some(&size)) {
                run_dir.write_json(&name, &size)?;
            }
            plan
        }
    };
    let largest = needs::largest(chain, &plan);
    if largest > budget.memory {
        driver.tell(&Event::Warning { text: &over_budget(largest, budget) });
    }
    Ok(Some(plan))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_has_one_number_everywhere() {
        let budget = Budget { threads: 2, memory: 60 << 20, asked: 64 << 20, automatic: false };
        let above = over_budget(200 << 20, &budget);
        assert_eq!(
            above,
            "a tile needs 200 MiB, more than the memory budget of 64 MiB (--memory): it runs by itself"
        );
        let between = over_budget(62 << 20, &budget);
        assert_eq!(
            between,
            "a tile needs 62 MiB, and 60 MiB of the memory budget of 64 MiB (--memory) are left for tiles: it runs \
             by itself"
        );
    }
}
