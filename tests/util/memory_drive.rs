//! A drive in memory for methods of any number of steps: points in cells of a metre, cells dealt to tiles in
//! any way.

use std::collections::BTreeMap;

use chainage::Result;
use chainage::cluster::{DriveWindow, Grouped, Labelled, Method, Reduced, Repeat, TilePoints, TileWindow};
use chainage::model::{Field, FieldSums, Lattice, PointId, TileCloud, TileId};
use chainage::spatial::{Cell, CellGrid, CellMap, DisjointSets, PackedCells};

const CELL: i64 = 1_000;

/// Points, and the tile of every occupied cell.
#[derive(Debug)]
pub(crate) struct MemoryDrive<'a> {
    pub(crate) points: &'a [[i64; 3]],
    pub(crate) ground: &'a [bool],
    pub(crate) owners: BTreeMap<Cell, u32>,
    pub(crate) tiles: u32,
    occupied: PackedCells,
    payloads: Vec<Vec<Vec<u8>>>,
    borders: Vec<Vec<u8>>,
    globals: Vec<Vec<u8>>,
    again: Vec<u8>,
    round: u32,
    /// Number of payloads that tiles have read.
    reads: std::cell::Cell<usize>,
}

pub(crate) fn cell_of(point: [i64; 3]) -> Cell {
    [0, 1].map(|axis| i32::try_from(point[axis].div_euclid(CELL)).expect("a cell nearby"))
}

/// The index of a point in the list of all points.
fn index(id: PointId) -> usize {
    usize::try_from(id.number()).expect("an index")
}

/// The result of a method on a drive.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// For each point the smallest id of its object, whatever its size.
    pub(crate) objects: Vec<Option<usize>>,
    /// Which labels are one object, if the method says so.
    pub(crate) grouped: Option<Grouped>,
    /// Number of payloads that the tiles have read in the last round of each step.
    pub(crate) reads: Vec<usize>,
}

impl<'a> MemoryDrive<'a> {
    /// A drive whose cells are dealt to `tiles` tiles by `deal`.
    pub(crate) fn new(
        points: &'a [[i64; 3]],
        ground: &'a [bool],
        tiles: u32,
        mut deal: impl FnMut(Cell) -> u32,
    ) -> Self {
        let mut owners = BTreeMap::new();
        let mut counts = CellMap::<u32>::default();
        for &point in points {
            owners.entry(cell_of(point)).or_insert_with_key(|cell| deal(*cell));
            *counts.entry(cell_of(point)) += 1;
        }
        Self {
            points,
            ground,
            owners,
            tiles,
            occupied: counts.into(),
            payloads: Vec::new(),
            borders: Vec::new(),
            globals: Vec::new(),
            again: Vec::new(),
            round: 0,
            reads: std::cell::Cell::new(0),
        }
    }

    /// Runs all steps. Tiles run in descending order, because the order must not matter. Every tile runs in
    /// every round.
    pub(crate) fn run(mut self, method: &dyn Method) -> Outcome {
        let last = method.steps().len() - 1;
        let mut labelled = Vec::new();
        let mut reads = vec![0; last + 1];
        for (step, facts) in method.steps().iter().enumerate() {
            (self.round, self.again) = (0, Vec::new());
            self.payloads.push(Vec::new());
            loop {
                self.reads.set(0);
                let mapped: Vec<_> = (0..self.tiles)
                    .rev()
                    .map(|tile| method.map(step, &Around { drive: &self, tile }).expect("a step"))
                    .collect();
                reads[step] = self.reads.get();
                let mut borders = Vec::new();
                self.payloads[step].clear();
                labelled.clear();
                for mapped in mapped.into_iter().rev() {
                    assert_eq!(mapped.labelled.is_some(), step == last);
                    self.payloads[step].push(mapped.payload);
                    borders.push(mapped.border);
                    labelled.extend(mapped.labelled);
                }
                let none = vec![Vec::new(); borders.len()];
                let settled = borders == *if self.round == 0 { &none } else { &self.borders };
                self.borders = borders;
                self.round += 1;
                match facts.repeat {
                    Repeat::UntilSettled { most } => assert!(self.round <= most, "not settled"),
                    Repeat::Once => assert!(settled, "a step that runs once has no border"),
                }
                if !settled {
                    continue;
                }
                if step == last {
                    break;
                }
                match method.reduce(step, &self).expect("a reduction") {
                    Reduced::Global(global) => {
                        self.globals.push(global);
                        break;
                    }
                    Reduced::Again(bytes) => self.again = bytes,
                    other => panic!("step {step} returned {other:?}"),
                }
            }
        }
        match method.reduce(last, &self).expect("a reduction") {
            Reduced::SharedPoints => {
                Outcome { objects: self.by_shared_points(&labelled), grouped: None, reads }
            }
            Reduced::Groups(grouped) => {
                let objects = self.by_groups(&labelled, &grouped);
                Outcome { objects, grouped: Some(grouped), reads }
            }
            other => panic!("{} ended with {other:?}", method.name()),
        }
    }

    /// For each point its tile and label, by the tile that owns it.
    fn own_labels(&self, labelled: &[Labelled]) -> Vec<(u32, u32)> {
        let mut own = vec![(0, 0); self.points.len()];
        for (tile, labelled) in (0_u32..).zip(labelled) {
            for (point, &id) in labelled.points.cloud.id.iter().enumerate() {
                let label = labelled.labels[point];
                assert!(label <= labelled.count);
                if labelled.points.core[point] {
                    own[index(id)] = (tile, label);
                }
            }
        }
        own
    }

    fn by_groups(&self, labelled: &[Labelled], grouped: &Grouped) -> Vec<Option<usize>> {
        let mut first = BTreeMap::<u32, usize>::new();
        let own = self.own_labels(labelled);
        let objects = own.iter().enumerate().map(|(id, &(tile, label))| {
            let group = if label == 0 { 0 } else { grouped.groups[tile as usize][label as usize - 1] };
            (group != 0).then(|| *first.entry(group).or_insert(id))
        });
        objects.collect()
    }

    fn by_shared_points(&self, labelled: &[Labelled]) -> Vec<Option<usize>> {
        let mut starts = vec![0_u32];
        starts.extend(labelled.iter().scan(0, |sum, labelled| {
            *sum += labelled.count;
            Some(*sum)
        }));
        let node = |tile: u32, label: u32| starts[tile as usize] + label - 1;
        let mut sets = DisjointSets::new(*starts.last().expect("an end"));
        let own = self.own_labels(labelled);
        for (tile, labelled) in (0_u32..).zip(labelled) {
            for (&id, &label) in labelled.points.cloud.id.iter().zip(&labelled.labels) {
                let (owner, there) = own[index(id)];
                assert!(
                    label == 0 || there != 0,
                    "point {id} has a label in tile {tile} and none in its own"
                );
                if label != 0 {
                    sets.union(node(tile, label), node(owner, there));
                }
            }
        }
        let mut first = BTreeMap::<u32, usize>::new();
        let object = |(id, &(tile, label)): (usize, &(u32, u32))| {
            (label != 0).then(|| *first.entry(sets.find(node(tile, label))).or_insert(id))
        };
        own.iter().enumerate().map(object).collect()
    }

    fn cells_near(&self, tile: u32, reach: i64) -> impl Iterator<Item = (Cell, u32)> + '_ {
        let own: Vec<Cell> =
            self.owners.iter().filter(|entry| *entry.1 == tile).map(|entry| *entry.0).collect();
        self.cells_near_cells(own, reach)
    }

    fn cells_near_cells(&self, cells: Vec<Cell>, reach: i64) -> impl Iterator<Item = (Cell, u32)> + '_ {
        let gap = |a: i32, b: i32| (i64::from(a.abs_diff(b)) - 1).max(0) * CELL;
        self.owners.iter().map(|(cell, owner)| (*cell, *owner)).filter(move |(cell, _)| {
            cells.iter().any(|o| gap(o[0], cell[0]).pow(2) + gap(o[1], cell[1]).pow(2) <= reach.pow(2))
        })
    }

    fn points_in(&self, tile: Option<u32>, cells: &BTreeMap<Cell, u32>, objects_only: bool) -> TilePoints {
        let near = |id: &usize| cells.contains_key(&cell_of(self.points[*id]));
        let ids: Vec<usize> = (0..self.points.len()).filter(near).collect();
        let taken = ids.into_iter().filter(|&id| !(objects_only && self.ground[id]));
        let ids: Vec<usize> = taken.collect();
        let places: Vec<[i64; 3]> = ids.iter().map(|&id| self.points[id]).collect();
        let mut cloud = TileCloud::from_lattice_points(self.lattice(), &places);
        cloud.id = ids.iter().map(|&id| PointId::at(id)).collect();
        let core = places.iter().map(|&place| Some(cells[&cell_of(place)]) == tile).collect();
        let ground = if objects_only { Vec::new() } else { ids.iter().map(|&id| self.ground[id]).collect() };
        TilePoints { cloud, core, ground }
    }
}

impl DriveWindow for MemoryDrive<'_> {
    fn lattice(&self) -> Lattice {
        Lattice::MILLIMETRE
    }

    fn tiles(&self) -> usize {
        self.tiles as usize
    }

    fn objects(&self) -> u64 {
        self.ground.iter().filter(|ground| !**ground).count() as u64
    }

    fn extent(&self) -> ([i64; 3], [i64; 3]) {
        let end = |pick: fn(i64, i64) -> i64| {
            [0, 1, 2].map(|axis| self.points.iter().map(|point| point[axis]).reduce(pick).unwrap_or(0))
        };
        (end(i64::min), end(i64::max))
    }

    fn longest_tile_m(&self) -> f64 {
        f64::INFINITY
    }

    fn field_sums(&self) -> &[(Field, FieldSums)] {
        &[]
    }

    fn payload(&self, step: usize, tile: TileId) -> Result<Vec<u8>> {
        self.reads.set(self.reads.get() + 1);
        Ok(self.payloads[step][tile.index()].clone())
    }

    fn global(&self, step: usize) -> &[u8] {
        &self.globals[step]
    }

    fn again(&self) -> &[u8] {
        &self.again
    }
}

struct Around<'a> {
    drive: &'a MemoryDrive<'a>,
    tile: u32,
}

impl DriveWindow for Around<'_> {
    fn lattice(&self) -> Lattice {
        self.drive.lattice()
    }

    fn tiles(&self) -> usize {
        self.drive.tiles()
    }

    fn objects(&self) -> u64 {
        self.drive.objects()
    }

    fn extent(&self) -> ([i64; 3], [i64; 3]) {
        self.drive.extent()
    }

    fn longest_tile_m(&self) -> f64 {
        self.drive.longest_tile_m()
    }

    fn field_sums(&self) -> &[(Field, FieldSums)] {
        self.drive.field_sums()
    }

    fn payload(&self, step: usize, tile: TileId) -> Result<Vec<u8>> {
        self.drive.payload(step, tile)
    }

    fn global(&self, step: usize) -> &[u8] {
        self.drive.global(step)
    }

    fn again(&self) -> &[u8] {
        self.drive.again()
    }
}

fn tiles_of(cells: impl Iterator<Item = (Cell, u32)>) -> Vec<TileId> {
    let mut tiles: Vec<TileId> = cells.map(|entry| TileId::new(entry.1)).collect();
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}

impl TileWindow for Around<'_> {
    fn tile(&self) -> TileId {
        TileId::new(self.tile)
    }

    fn grid(&self) -> CellGrid {
        CellGrid::new(CELL)
    }

    fn occupied(&self) -> &PackedCells {
        &self.drive.occupied
    }

    fn cells(&self, reach: i64) -> CellMap<u8> {
        let mut cells = CellMap::default();
        self.drive.cells_near(self.tile, reach).for_each(|(cell, _)| *cells.entry(cell) = 1);
        cells
    }

    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints> {
        let cells = self.drive.cells_near(self.tile, reach).collect();
        Ok(self.drive.points_in(Some(self.tile), &cells, objects_only))
    }

    fn points_of(&self, cells: Vec<Cell>) -> Result<TilePoints> {
        let cells = cells.into_iter().map(|cell| (cell, self.drive.owners[&cell])).collect();
        Ok(self.drive.points_in(None, &cells, true))
    }

    fn near(&self, reach: i64) -> Vec<TileId> {
        tiles_of(self.drive.cells_near(self.tile, reach))
    }

    fn near_cells(&self, cells: &[Cell], reach: i64) -> Vec<TileId> {
        tiles_of(self.drive.cells_near_cells(cells.to_vec(), reach))
    }

    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<TileId> {
        let (from, to) = (cell_of([lo[0], lo[1], 0]), cell_of([hi[0], hi[1], 0]));
        let inside = |cell: &Cell| (0..2).all(|axis| (from[axis]..=to[axis]).contains(&cell[axis]));
        self.drive.owners.iter().find(|(cell, _)| inside(cell)).map(|entry| TileId::new(*entry.1))
    }

    fn round(&self) -> u32 {
        self.drive.round
    }

    fn border(&self, tile: TileId) -> Result<Vec<u8>> {
        Ok(if self.drive.round == 0 { Vec::new() } else { self.drive.borders[tile.index()].clone() })
    }
}
