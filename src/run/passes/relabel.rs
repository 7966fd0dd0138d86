//! Pass `relabel`: stores the class and the object of every point, by record. A unit has the values of a run
//! of records, and combines the results of all tiles that own these records.
//!
//! ```text
//! payload := classes objects ends     sections; u8 and u32 per record; objects with points of the first or
//!                                    last profiles
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::codec;
use crate::error::{Error, Result};
use crate::input::Fields;
use crate::model::{FileId, PointClass, TileId, in_u32};
use crate::run::drive::{
    BlockRun, Drive, OwnedBlock, PerPoint, Surveyed, Tiled, is_object, lengths, scatter, sections,
};
use crate::run::engine::{Outline, Pass, Payloads};
use crate::run::passes::sections as of_step;
use crate::run::passes::stitch::Objects;
use crate::run::passes::window::Progress;
use crate::store::{Inputs, UnitReader};
use crate::survey::Moment;

const NUMBER: u32 = 5;
const NAME: &str = "relabel";
/// Raised when the values of points change for the same objects.
const EPOCH: u32 = 3;

/// Sections of the payload of a unit.
const CLASSES: usize = 0;
const OBJECTS: usize = 1;
const ENDS: usize = 2;

/// Relabelling depends on the objects.
pub(crate) fn outline(stitch: &Outline) -> Outline {
    let depends = Inputs::new().with("pass stitch", stitch.depends.fingerprint());
    Outline::new(NUMBER, NAME, depends.with("relabel epoch", EPOCH))
}

/// The class and the object of every point.
#[derive(Debug)]
pub(crate) struct PointColumns {
    /// [`PointClass`] codes. Outside a section, the code is [`PointClass::UNDECIDED`].
    pub(crate) classes: PerPoint<u8>,
    /// Object ids, 0 for none.
    pub(crate) objects: PerPoint<u32>,
    /// Objects with points of the first or last profiles before an end or a gap of the recording, with the
    /// number of the moment.
    pub(crate) ends: BTreeSet<(u32, u32)>,
}

pub(crate) struct RelabelPass<'a> {
    progress: &'a Progress<'a>,
    objects: &'a Objects,
    runs: Vec<BlockRun>,
    /// Finds the tiles that own records of a block.
    owners: BTreeMap<(FileId, u32), Vec<(TileId, OwnedBlock)>>,
    outline: Outline,
}

impl<'a> RelabelPass<'a> {
    pub(crate) fn of(progress: &'a Progress<'a>, objects: &'a Objects, outline: Outline) -> Result<Self> {
        let mut owners = BTreeMap::<_, Vec<_>>::new();
        for tile in TileId::first(progress.plan().tiles.len()) {
            let blocks: Vec<OwnedBlock> = progress.over.classified.section(tile, sections::BLOCKS)?;
            for block in blocks {
                owners.entry((block.file, block.block)).or_default().push((tile, block));
            }
        }
        let runs = runs(progress.over.classified.tiled);
        Ok(Self { progress, objects, runs, owners, outline })
    }

    /// Whether the whole drive is processed, so that every record has an owner.
    fn is_whole(&self) -> bool {
        self.progress.over.classified.tiled.surveyed.section.is_none()
    }

    fn drive(&self) -> &Drive {
        self.progress.over.classified.tiled.drive
    }

    /// The tiles that own records of a run, each with its blocks: the place of the block in the run, and the
    /// records of the block that the tile owns.
    fn by_tile(&self, run: &BlockRun) -> BTreeMap<TileId, Vec<(usize, &OwnedBlock)>> {
        let mut tiles = BTreeMap::<_, Vec<_>>::new();
        for (place, number) in run.blocks.clone().enumerate() {
            let key = (FileId::at(run.file), in_u32(number, "blocks of a file"));
            for (tile, owned) in self.owners.get(&key).into_iter().flatten() {
                tiles.entry(*tile).or_default().push((place, owned));
            }
        }
        tiles
    }

    /// Fills in the values of one tile for the block at `place` of the run.
    fn fill(&self, tile: &OpenTile, block: &OwnedBlock, place: usize, to: &mut Values) -> Result<()> {
        let records = to.blocks[place].clone();
        let runs = lengths(&tile.ground.read(offset(tile.runs, block.runs))?)?;
        let (first, count) = block.points;
        let classes = tile.ground.read(offset(tile.classes, (first, first + count)))?;
        // Outside the section, points keep the class of the input, because the ground is not certain there.
        if self.progress.plan().tiles[tile.id.index()].inside {
            scatter(&runs, &classes, &mut to.classes[records.clone()])?;
        }
        let (first, count) = block.objects;
        let labels = tile.labels.read(offset(tile.first_label, (first * 4, (first + count) * 4)))?;
        let mut ids =
            labels.as_chunks::<4>().0.iter().map(|label| self.object(tile.id, u32::from_le_bytes(*label)));
        to.owned.clear();
        for &class in &classes {
            let id = if is_object(class) { ids.next().transpose()? } else { None };
            to.owned.push(id.unwrap_or(0));
        }
        scatter(&runs, &to.owned, &mut to.objects[records])?;
        to.known[place] += block.points.1;
        Ok(())
    }

    /// Adds the objects with points of the first or last profiles in a block. `objects` are those of its
    /// records.
    fn add_ends(
        &self,
        (file, block): (usize, usize),
        objects: &[u32],
        buffer: &mut Vec<u8>,
        ends: &mut BTreeSet<(u32, u32)>,
    ) -> Result<()> {
        let Surveyed { survey, moments, .. } = self.progress.over.classified.tiled.surveyed;
        let Some(times) = survey.zones[file][block].time else { return Ok(()) };
        let moments: Vec<(u32, &Moment)> =
            (0..).zip(moments).filter(|(_, moment)| moment.meets(times)).collect();
        if moments.is_empty() || objects.iter().all(|object| *object == 0) {
            return Ok(());
        }
        let input = self.drive().file(file);
        let view = input.layout().view(input.records(block, Fields::Geometry, buffer)?);
        for (record, &object) in view.bytes.chunks_exact(view.stride).zip(objects) {
            let time = view.time(record).unwrap_or(f64::NAN);
            if object != 0 {
                let here = moments.iter().filter(|(_, moment)| moment.contains(time));
                ends.extend(here.map(|(number, _)| (object, *number)));
            }
        }
        input.release(block);
        Ok(())
    }

    /// The object of a label of a tile.
    fn object(&self, tile: TileId, label: u32) -> Result<u32> {
        let Some(place) = label.checked_sub(1) else { return Ok(0) };
        let id = self.objects.ids.get(tile.index()).and_then(|ids| ids.get(place as usize));
        id.copied().ok_or_else(|| Error::bug(format!("label {label} of tile {tile} has no object")))
    }

    fn open(&self, id: TileId) -> Result<OpenTile> {
        let ground = self.progress.over.classified.ground.reader(id.index())?;
        let labels = self.progress.current.reader(id)?;
        let start = |reader: &UnitReader, section| reader.section(section).map(|range| range.start);
        Ok(OpenTile {
            id,
            runs: start(&ground, sections::RUNS)?,
            classes: start(&ground, sections::CLASSES)?,
            first_label: start(&labels, of_step::LABELS)?,
            ground,
            labels,
        })
    }
}

/// The runs of blocks with records of tiles. For a section, these are not all runs of the drive.
pub(crate) fn runs(tiled: &Tiled<'_>) -> Vec<BlockRun> {
    let mut runs = tiled.drive.block_runs();
    if tiled.surveyed.section.is_some() {
        runs.retain(|run| tiled.may_meet_tiles(run.file, run.blocks.clone()));
    }
    runs
}

/// A tile whose units are being read, and the start of their sections.
struct OpenTile {
    id: TileId,
    ground: UnitReader,
    labels: UnitReader,
    runs: u64,
    classes: u64,
    first_label: u64,
}

/// Values of the records of a run of blocks.
struct Values {
    classes: Vec<u8>,
    objects: Vec<u32>,
    /// The records of each block.
    blocks: Vec<Range<usize>>,
    /// Number of records of each block that tiles own.
    known: Vec<u64>,
    /// Objects of the records of a block that one tile owns.
    owned: Vec<u32>,
}

impl Values {
    /// Values for blocks with these numbers of records. A record that no tile owns is outside the section.
    fn of(counts: impl Iterator<Item = u32>) -> Self {
        let mut records = 0;
        let blocks: Vec<Range<usize>> = counts
            .map(|count| {
                let first = records;
                records += count as usize;
                first..records
            })
            .collect();
        let known = vec![0; blocks.len()];
        let classes = vec![PointClass::UNDECIDED; records];
        Self { classes, objects: vec![0; records], blocks, known, owned: Vec::new() }
    }
}

fn offset(start: u64, (from, to): (u64, u64)) -> Range<u64> {
    start + from..start + to
}

impl Pass for RelabelPass<'_> {
    type Global = PointColumns;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.runs.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.runs[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        // Of a block: class, object, object as owned, label as read, and run lengths. Of all records: class
        // and object, twice.
        self.drive().largest_block_bytes(&self.runs[unit], 0).max(1 << 16)
            + self.runs[unit].points.min(1 << 16) * 24
            + self.runs[unit].points * 10
    }

    /// Visits the tiles one after the other, so that only the files of one tile are open at a time: records
    /// in random order can belong to more tiles than a process may open files.
    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        let blocks = &self.drive().file(run.file).blocks()[run.blocks.clone()];
        let mut values = Values::of(blocks.iter().map(|block| block.count));
        for (tile, owned) in self.by_tile(run) {
            let tile = self.open(tile)?;
            for (block, entry) in owned {
                self.fill(&tile, entry, block, &mut values)?;
            }
        }
        if self.is_whole() {
            for ((number, block), known) in run.blocks.clone().zip(blocks).zip(&values.known) {
                if *known != u64::from(block.count) {
                    let text =
                        format!("the tiles own {known} of the {} records of block {number}", block.count);
                    return Err(Error::bug(text));
                }
            }
        }
        let mut ends = BTreeSet::new();
        let mut buffer = Vec::new();
        for (block, records) in run.blocks.clone().zip(&values.blocks) {
            self.add_ends((run.file, block), &values.objects[records.clone()], &mut buffer, &mut ends)?;
        }
        let objects = bytemuck::cast_slice(&values.objects);
        Ok(codec::pack(&[&values.classes[..], objects, &codec::encode(&ends)?]))
    }

    /// The values of all points.
    fn reduce(&self, payloads: &Payloads) -> Result<PointColumns> {
        let drive = self.drive();
        let mut ends = BTreeSet::new();
        for unit in 0..self.units() {
            let found: BTreeSet<(u32, u32)> = codec::decode(&payloads.section(unit, ENDS)?)?;
            ends.extend(found);
        }
        Ok(PointColumns {
            ends,
            classes: drive.per_point(&self.runs, payloads, CLASSES).with_beside(PointClass::UNDECIDED),
            objects: drive.per_point(&self.runs, payloads, OBJECTS),
        })
    }
}
