//! A drive in memory for methods with stages: points in cells of a metre, cells assigned to tiles in any way.

use std::collections::BTreeMap;

use chainage::Result;
use chainage::cluster::{DriveSource, Grouped, StagedClusterer, TilePoints, TileSource};
use chainage::model::{Lattice, TileCloud};

const CELL: i64 = 1_000;

type Cell = [i64; 2];

/// Points, and the tile of every occupied cell.
#[derive(Debug)]
pub(crate) struct MemoryDrive<'a> {
    pub(crate) points: &'a [[i64; 3]],
    pub(crate) ground: &'a [bool],
    pub(crate) owners: BTreeMap<Cell, u32>,
    pub(crate) tiles: u32,
    payloads: Vec<Vec<Vec<u8>>>,
    globals: Vec<Vec<u8>>,
}

pub(crate) fn cell_of(point: [i64; 3]) -> Cell {
    [point[0].div_euclid(CELL), point[1].div_euclid(CELL)]
}

/// The result of a method for a drive.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// For each point the smallest id of its object.
    pub(crate) objects: Vec<Option<usize>>,
    pub(crate) grouped: Grouped,
}

impl<'a> MemoryDrive<'a> {
    /// `deal` assigns cells to `tiles` tiles.
    pub(crate) fn new(
        points: &'a [[i64; 3]],
        ground: &'a [bool],
        tiles: u32,
        mut deal: impl FnMut(Cell) -> u32,
    ) -> Self {
        let mut owners = BTreeMap::new();
        for &point in points {
            owners.entry(cell_of(point)).or_insert_with_key(|cell| deal(*cell));
        }
        Self { points, ground, owners, tiles, payloads: Vec::new(), globals: Vec::new() }
    }

    /// Runs all stages, with tiles in descending order, because the order must not matter.
    pub(crate) fn run(mut self, method: &dyn StagedClusterer) -> Outcome {
        let mut labels: Vec<(u32, u32)> = vec![(0, 0); self.points.len()];
        let last = method.stages().len() - 1;
        for stage in 0..=last {
            let mut payloads = vec![Vec::new(); self.tiles as usize];
            for tile in (0..self.tiles).rev() {
                let mapped = method.map(stage, &Around { drive: &self, tile }).expect("a stage");
                assert_eq!(mapped.labelled.is_some(), stage == last);
                if let Some(labelled) = mapped.labelled {
                    for (point, &id) in labelled.points.cloud.id.iter().enumerate() {
                        let label = labelled.labels[point];
                        assert!(label <= labelled.count);
                        if labelled.points.core[point] {
                            labels[usize::try_from(id).expect("an index")] = (tile, label);
                        }
                    }
                }
                payloads[tile as usize] = mapped.payload;
            }
            self.payloads.push(payloads);
            if stage < last {
                let global = method.reduce(stage, &self).expect("a reduction");
                self.globals.push(global);
            }
        }
        let grouped = method.group(&self).expect("groups");
        let mut first = BTreeMap::<u32, usize>::new();
        let objects = labels.iter().enumerate().map(|(id, &(tile, label))| {
            let group = if label == 0 { 0 } else { grouped.groups[tile as usize][label as usize - 1] };
            (group != 0).then(|| *first.entry(group).or_insert(id))
        });
        let objects = objects.collect();
        Outcome { objects, grouped }
    }

    fn cells_near(&self, tile: u32, reach: i64) -> impl Iterator<Item = (Cell, u32)> + '_ {
        let own: Vec<Cell> =
            self.owners.iter().filter(|entry| *entry.1 == tile).map(|entry| *entry.0).collect();
        let gap = |a: i64, b: i64| ((a - b).abs() - 1).max(0) * CELL;
        self.owners.iter().map(|(cell, owner)| (*cell, *owner)).filter(move |(cell, _)| {
            own.iter().any(|o| gap(o[0], cell[0]).pow(2) + gap(o[1], cell[1]).pow(2) <= reach.pow(2))
        })
    }
}

impl DriveSource for MemoryDrive<'_> {
    fn lattice(&self) -> Lattice {
        Lattice::MILLIMETRE
    }

    fn tiles(&self) -> u32 {
        self.tiles
    }

    fn payload(&self, stage: usize, tile: u32) -> Result<Vec<u8>> {
        Ok(self.payloads[stage][tile as usize].clone())
    }

    fn global(&self, stage: usize) -> &[u8] {
        &self.globals[stage]
    }
}

struct Around<'a> {
    drive: &'a MemoryDrive<'a>,
    tile: u32,
}

impl DriveSource for Around<'_> {
    fn lattice(&self) -> Lattice {
        self.drive.lattice()
    }

    fn tiles(&self) -> u32 {
        self.drive.tiles
    }

    fn payload(&self, stage: usize, tile: u32) -> Result<Vec<u8>> {
        self.drive.payload(stage, tile)
    }

    fn global(&self, stage: usize) -> &[u8] {
        self.drive.global(stage)
    }
}

impl TileSource for Around<'_> {
    fn tile(&self) -> u32 {
        self.tile
    }

    fn cell_edge(&self) -> i64 {
        CELL
    }

    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints> {
        let cells: BTreeMap<Cell, u32> = self.drive.cells_near(self.tile, reach).collect();
        let near = |id: &usize| cells.contains_key(&cell_of(self.drive.points[*id]));
        let ids: Vec<usize> = (0..self.drive.points.len()).filter(near).collect();
        let taken = ids.into_iter().filter(|&id| !(objects_only && self.drive.ground[id]));
        let ids: Vec<usize> = taken.collect();
        let places: Vec<[i64; 3]> = ids.iter().map(|&id| self.drive.points[id]).collect();
        let mut cloud = TileCloud::from_lattice_points(self.lattice(), &places);
        cloud.id = ids.iter().map(|&id| id as u64).collect();
        let core = places.iter().map(|&place| cells[&cell_of(place)] == self.tile).collect();
        let ground =
            if objects_only { Vec::new() } else { ids.iter().map(|&id| self.drive.ground[id]).collect() };
        Ok(TilePoints { cloud, core, ground, whole: cells.len() == self.drive.owners.len() })
    }

    fn near(&self, reach: i64) -> Vec<u32> {
        let mut tiles: Vec<u32> = self.drive.cells_near(self.tile, reach).map(|entry| entry.1).collect();
        tiles.sort_unstable();
        tiles.dedup();
        tiles
    }

    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<u32> {
        let from = cell_of([lo[0], lo[1], 0]);
        let to = cell_of([hi[0], hi[1], 0]);
        let inside = |cell: &Cell| (0..2).all(|axis| (from[axis]..=to[axis]).contains(&cell[axis]));
        self.drive.owners.iter().find(|(cell, _)| inside(cell)).map(|entry| *entry.1)
    }
}
