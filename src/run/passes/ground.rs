//! Pass `ground`: separates ground and isolated noise from objects, one class per point, tile by tile.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::config::Config;
use crate::error::Result;
use crate::ground::{LowPoints, NoGround};
use crate::inventory::{Terrain, TerrainSums};
use crate::model::{PointClass, PointId, TileId};
use crate::run::chain::{Chain, with_section};
use crate::run::drive::section;
use crate::run::drive::{Classified, Surveyed, TileVerdicts, Tiled, sections};
use crate::run::engine::{Outline, Pass, Payloads};
use crate::run::summary::Counts;
use crate::spatial::{Cell, TileView};
use crate::store::Inputs;
use crate::tiling::Plan;

const NUMBER: u32 = 2;
const NAME: &str = "ground";

/// Raised when a method gives different results for the same input and settings.
pub(crate) const ALGORITHM_EPOCH: u32 = 6;

/// Bytes per point that a tile of this pass needs at its peak (columns, voxels, sorting).
/// `scripts/tile_memory.py` measured 37 to 44 on streets, and 44 to 51 in forests, where few points share a
/// voxel.
pub(crate) const BYTES_PER_POINT: u64 = 52;

/// One cell in this many is checked for low points: how many there are, and how many of them are ground. That
/// is enough for a warning. A sample of single points would not do, because the neighbours of a point decide
/// whether it lies low.
const LOW_SHARE: i64 = 8;

/// The ground pass depends on the content of the input, the tiles, and its own settings.
pub(crate) fn outline(surveyed: &Surveyed, plan: &Plan, config: &Config, chain: &Chain) -> Outline {
    let depends = Inputs::new()
        .with("algorithm epoch", ALGORITHM_EPOCH)
        .with("input content", format!("{:016x}", surveyed.content_digest()))
        .with("tiles", format!("{} tiles, geometry {:016x}", plan.tiles.len(), plan.digest()))
        .with("reach of ground and noise", format!("{} lattice units", chain.ground_reach))
        .with("ground.method", &config.ground.method);
    let depends =
        section::depends(config).into_iter().fold(depends, |all, (key, value)| all.with(key, value));
    let depends = with_section(with_section(depends, config, "noise"), config, &config.ground.method);
    Outline::new(NUMBER, NAME, depends)
}

pub(crate) struct GroundPass<'a> {
    tiled: &'a Tiled<'a>,
    chain: &'a Chain,
    outline: Outline,
}

impl<'a> GroundPass<'a> {
    pub(crate) fn of(tiled: &'a Tiled<'a>, chain: &'a Chain, outline: Outline) -> Self {
        Self { tiled, chain, outline }
    }
}

/// The payload of a tile, without the classes of its points.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct GroundPayload {
    /// Points by class code.
    pub(crate) counts: [u64; PointClass::COUNT],
    /// How many of the low points are ground, counted in one cell in [`LOW_SHARE`].
    pub(crate) low: LowPoints,
    /// Number of ground points and the sum of their lattice z, by cell.
    pub(crate) heights: Vec<(Cell, u32, i64)>,
}

/// Sums of heights by cell. Neighbouring points are mostly in the same cell, so the last one is cached.
#[derive(Debug, Default)]
struct HeightSums {
    sums: BTreeMap<Cell, (u32, i64)>,
    last: Cell,
    open: (u32, i64),
}

impl HeightSums {
    fn add(&mut self, cell: Cell, z: i64) {
        if cell != self.last {
            self.flush();
            self.last = cell;
        }
        self.open.0 += 1;
        self.open.1 += z;
    }

    fn flush(&mut self) {
        if self.open.0 > 0 {
            let sum = self.sums.entry(self.last).or_default();
            sum.0 += self.open.0;
            sum.1 += self.open.1;
            self.open = (0, 0);
        }
    }

    fn finish(mut self) -> Vec<(Cell, u32, i64)> {
        self.flush();
        self.sums.into_iter().map(|(cell, (count, sum))| (cell, count, sum)).collect()
    }
}

impl<'a> Pass for GroundPass<'a> {
    type Global = Classified<'a>;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.tiled.count()
    }

    fn points(&self, unit: usize) -> u64 {
        self.tiled.plan.tiles[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.tiled.plan.region_points(unit, self.chain.ground_reach) * BYTES_PER_POINT
    }

    fn prefetch(&self, unit: usize) {
        self.tiled.prefetch(unit, self.chain.ground_reach);
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let gathered = self.tiled.gather_all(unit, self.chain.ground_reach)?;
        let cloud = &gathered.cloud;
        let mut classes = vec![PointClass::Object; cloud.len()];
        {
            // The voxels are freed before the columns of the result are created, because these need as much
            // memory.
            let mut view = TileView::new(cloud);
            if let Some(noise) = &self.chain.noise {
                noise.mark(&mut view, &mut classes)?;
            }
            self.chain.filter.classify(&mut view, &mut classes)?;
        }

        let mut payload = GroundPayload::default();
        let mut ids = Vec::new();
        let mut codes = Vec::new();
        let mut heights = HeightSums::default();
        let grid = self.tiled.drive.grid;
        for (point, class) in classes.iter().enumerate().filter(|(point, _)| gathered.core[*point]) {
            ids.push(cloud.id[point]);
            codes.push(class.code());
            payload.counts[usize::from(class.code())] += 1;
            if *class == PointClass::Ground {
                let [x, y, z] = cloud.lattice_point(point);
                if let Some(cell) = grid.cell(x, y) {
                    heights.add(cell, z);
                }
            }
        }
        payload.heights = heights.finish();
        let asked = |point: usize| {
            let [x, y, _] = cloud.lattice_point(point);
            gathered.core[point] && (grid.index(x) + 3 * grid.index(y)).rem_euclid(LOW_SHARE) == 0
        };
        payload.low = LowPoints::count(cloud, &classes, &grid, asked);
        payload.counts[usize::from(PointClass::Withheld.code())] = gathered.withheld.len() as u64;
        let (ids, codes) = with_withheld(ids, codes, &gathered.withheld);
        let verdicts = TileVerdicts::collect(self.tiled.drive, &ids, codes)?;
        let [blocks, runs, codes] = verdicts.into_sections()?;
        Ok(codec::pack(&[codec::encode(&payload)?, blocks, runs, codes]))
    }

    /// The drive with the classes of its points.
    fn reduce(&self, payloads: &Payloads) -> Result<Classified<'a>> {
        let (objects, warnings) = (Vec::new(), Vec::new());
        let mut classified = Classified { tiled: self.tiled, ground: payloads.clone(), objects, warnings };
        let mut low = LowPoints::default();
        for tile in TileId::first(self.units()) {
            let summary: GroundPayload = classified.section(tile, sections::SUMMARY)?;
            classified.objects.push(summary.counts[usize::from(PointClass::Object.code())]);
            low += summary.low;
        }
        if self.chain.filter.name() != NoGround::NAME {
            classified.warnings.extend(low.warning(self.chain.filter.name()));
        }
        Ok(classified)
    }
}

/// Points (ascending) with their classes, together with withheld points (ascending).
fn with_withheld(ids: Vec<PointId>, codes: Vec<u8>, withheld: &[PointId]) -> (Vec<PointId>, Vec<u8>) {
    if withheld.is_empty() {
        return (ids, codes);
    }
    let mut all: Vec<(PointId, u8)> = ids.into_iter().zip(codes).collect();
    all.extend(withheld.iter().map(|&id| (id, PointClass::Withheld.code())));
    all.sort_unstable_by_key(|(id, _)| *id);
    all.into_iter().unzip()
}

/// Number of points by class, and the height of the ground, from the payloads.
pub(crate) fn summed_up(classified: &Classified<'_>) -> Result<(Counts, Terrain)> {
    let tiled = classified.tiled;
    let mut counts = Counts::default();
    let mut terrain = TerrainSums::new(tiled.drive.grid, tiled.drive.lattice(), tiled.surveyed.lowest());
    for tile in TileId::first(tiled.count()) {
        let mut summary: GroundPayload = classified.section(tile, sections::SUMMARY)?;
        if !tiled.plan.tiles[tile.index()].inside {
            summary.counts = [0; PointClass::COUNT];
        }
        add(summary, &mut counts, &mut terrain);
    }
    Ok((counts, terrain.into_terrain()))
}

/// Adds the heights of a tile.
fn add(summary: GroundPayload, counts: &mut Counts, terrain: &mut TerrainSums) {
    let [object, ground, low_noise, high_noise, withheld] = summary.counts;
    counts.object += object;
    counts.ground += ground;
    counts.low_noise += low_noise;
    counts.high_noise += high_noise;
    counts.withheld += withheld;
    for (cell, points, sum) in summary.heights {
        terrain.add(cell, points, sum);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Lattice;
    use crate::spatial::CellGrid;

    #[test]
    fn counts_are_summed_and_cells_of_all_tiles_are_the_terrain() {
        let tiles = [
            GroundPayload {
                counts: [5, 2, 1, 0, 4],
                low: LowPoints::default(),
                heights: vec![([0, 0], 2, -4_001)],
            },
            GroundPayload {
                counts: [7, 1, 0, 3, 0],
                low: LowPoints::default(),
                heights: vec![([6, 0], 1, 3_000)],
            },
        ];
        let mut counts = Counts::default();
        let mut terrain = TerrainSums::new(CellGrid::new(1_000), Lattice::MILLIMETRE, -2_500);
        tiles.into_iter().for_each(|tile| add(tile, &mut counts, &mut terrain));
        assert_eq!(counts, Counts { object: 12, ground: 3, low_noise: 1, high_noise: 3, withheld: 4 });
        let terrain = terrain.into_terrain();
        assert_eq!(
            [[500, 500], [6_500, 500]].map(|place| terrain.height_m(place)),
            [Some(-2.001), Some(3.0)]
        );
    }
}
