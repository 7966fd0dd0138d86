//! Pass `stitch`: joins the labels of all tiles to whole objects with ids. It has one unit, which reads the
//! objects of the tiles but not their points.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cluster::{Figures, Grouped, Method, Reduced};
use crate::codec;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::model::{Chart, Kind, ObjectPart, Plane, PointId, TileId};
use crate::run::drive::{TileVerdicts, is_object};
use crate::run::engine::{Outline, Pass, Payloads};
use crate::run::passes::sections;
use crate::run::passes::window::Progress;
use crate::stitch::{LocalLabels, LocalObject, SeamPoint, Stitched, Stitcher};
use crate::store::Inputs;

const NUMBER: u32 = 4;
const NAME: &str = "stitch";

/// Stitching depends on the last step of the method, and on the settings of the method that no step depends
/// on, because the last reduction may use them.
pub(crate) fn outline(steps: &[Outline], config: &Config, method: &dyn Method) -> Outline {
    let before = steps.last().map_or_else(String::new, |last| last.depends.fingerprint().to_string());
    let mut depends = Inputs::new().with("pass before", before);
    let name = method.name();
    let known: Vec<&str> = method.steps().iter().flat_map(|step| step.settings).copied().collect();
    if !known.contains(&format!("{name}.*").as_str()) {
        for (key, value) in config.method_table(name) {
            let key = format!("{name}.{key}");
            if !known.contains(&key.as_str()) {
                depends = depends.with(key, value);
            }
        }
    }
    Outline::new(NUMBER, NAME, depends)
}

pub(crate) struct StitchPass<'a> {
    progress: &'a Progress<'a>,
    outline: Outline,
}

/// Whole objects, and what the method reports about them.
#[derive(Debug)]
pub(crate) struct Objects {
    /// Object 1, 2, ... in ascending order of the smallest point id.
    pub(crate) objects: Vec<ObjectPart>,
    /// Object of label 1, 2, ... of each tile. 0 if the whole object is too small or too large.
    pub(crate) ids: Vec<Vec<u32>>,
    /// Class and confidence of object 1, 2, ... Empty if the method does not classify.
    pub(crate) kinds: Vec<Kind>,
    /// Plane of object 1, 2, ..., if it has one. Empty if the method finds no surfaces.
    pub(crate) planes: Vec<Option<Plane>>,
    /// Whether the method finds surfaces.
    pub(crate) surfaces: bool,
    /// Figures of the steps of the method, if it has any.
    pub(crate) figures: Figures,
    pub(crate) charts: Vec<Chart>,
}

/// The stored form, with the figures as JSON text.
#[derive(Serialize, Deserialize)]
struct Kept {
    objects: Vec<ObjectPart>,
    ids: Vec<Vec<u32>>,
    kinds: Vec<Kind>,
    planes: Vec<Option<Plane>>,
    figures: String,
    charts: Vec<Chart>,
}

impl<'a> StitchPass<'a> {
    pub(crate) fn of(progress: &'a Progress<'a>, outline: Outline) -> Self {
        Self { progress, outline }
    }

    fn tiles(&self) -> impl DoubleEndedIterator<Item = TileId> + use<> {
        TileId::first(self.progress.plan().tiles.len())
    }

    fn local(&self, tile: TileId) -> Result<LocalLabels> {
        codec::decode(&self.progress.current.reader(tile)?.read_section(sections::OBJECTS)?)
    }

    fn add(&self, stitcher: &mut Stitcher, tile: TileId, objects: Vec<LocalObject>) {
        match self.progress.plan().tiles[tile.index()].inside {
            true => stitcher.tile(objects),
            false => stitcher.tile_beside(objects),
        }
    }

    /// Labels of two tiles for the same point are one object.
    fn by_shared_points(&self) -> Result<Stitched> {
        let mut stitcher = Stitcher::default();
        for tile in self.tiles() {
            self.add(&mut stitcher, tile, self.local(tile)?.objects);
        }
        for tile in self.tiles() {
            let mut of_owner = BTreeMap::<TileId, Vec<SeamPoint>>::new();
            for seam in self.local(tile)?.seams {
                of_owner.entry(seam.owner).or_default().push(seam);
            }
            for (owner, seams) in of_owner {
                self.link(&mut stitcher, tile, owner, &seams)?;
            }
        }
        Ok(stitcher.finish(&self.progress.over.method.object_size()))
    }

    /// Unites the labels of `tile` with those that the owner gave to points of its halo. These points are in
    /// ascending order.
    fn link(&self, stitcher: &mut Stitcher, tile: TileId, owner: TileId, seams: &[SeamPoint]) -> Result<()> {
        let mut labels = OwnLabels::of(self.progress, owner)?;
        let mut last = None;
        for seam in seams {
            let there = labels.label(seam.id)?;
            let link = ((tile, seam.label), (owner, there));
            if last == Some(link) {
                continue;
            }
            last = Some(link);
            if !stitcher.link(link.0, link.1) {
                let text = format!(
                    "point {} has label {} in tile {tile} and {there} in tile {owner}",
                    seam.id, seam.label
                );
                return Err(Error::bug(text));
            }
        }
        Ok(())
    }

    /// The method says which labels are one object.
    fn by_groups(&self, groups: &[Vec<u32>]) -> Result<Stitched> {
        let mut stitcher = Stitcher::default();
        for (tile, groups) in self.tiles().zip(groups) {
            let mut objects = self.local(tile)?.objects;
            if objects.len() != groups.len() {
                let text = format!("tile {tile} has {} labels and {} groups", objects.len(), groups.len());
                return Err(Error::bug(text));
            }
            for (object, _) in objects.iter_mut().zip(groups).filter(|(_, group)| **group == 0) {
                *object = LocalObject { open: true, part: ObjectPart::empty() };
            }
            self.add(&mut stitcher, tile, objects);
        }
        let mut first = BTreeMap::<u32, (TileId, u32)>::new();
        for (tile, groups) in self.tiles().zip(groups) {
            for (label, &group) in (1_u32..).zip(groups).filter(|(_, group)| **group != 0) {
                let one = *first.entry(group).or_insert((tile, label));
                if one != (tile, label) && !stitcher.link(one, (tile, label)) {
                    return Err(Error::bug(format!("label {label} of tile {tile} does not exist")));
                }
            }
        }
        Ok(stitcher.finish(&self.progress.over.method.object_size()))
    }
}

impl Pass for StitchPass<'_> {
    type Global = Objects;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        1
    }

    /// No points: the pass reads objects only.
    fn points(&self, _unit: usize) -> u64 {
        0
    }

    fn bytes(&self, _unit: usize) -> u64 {
        0
    }

    fn run(&self, _unit: usize) -> Result<Vec<u8>> {
        let method = self.progress.over.method;
        let (stitched, grouped) = match method.reduce(method.steps().len() - 1, self.progress)? {
            Reduced::SharedPoints => (self.by_shared_points()?, Grouped::default()),
            Reduced::Groups(grouped) => (self.by_groups(&grouped.groups)?, grouped),
            other => return Err(Error::bug(format!("{} ended with {other:?}", method.name()))),
        };
        let Stitched { objects, ids, .. } = stitched;
        let Grouped { groups, kinds, planes, figures, charts } = grouped;
        let kinds = of_objects(&ids, &groups, &kinds, objects.len());
        let planes: BTreeMap<u32, Option<Plane>> =
            planes.into_iter().map(|(group, plane)| (group, Some(plane))).collect();
        let planes = of_objects(&ids, &groups, &planes, objects.len());
        let figures = serde_json::Value::Object(figures).to_string();
        codec::encode(&Kept { objects, ids, kinds, planes, figures, charts })
    }

    /// Whole objects.
    fn reduce(&self, payloads: &Payloads) -> Result<Objects> {
        let Kept { objects, ids, kinds, planes, figures, charts } = codec::decode(&payloads.get(0)?)?;
        let figures = serde_json::from_str(&figures)
            .map_err(|error| Error::bug(format!("stored figures cannot be read: {error}")))?;
        let surfaces = self.progress.over.method.finds_surfaces();
        Ok(Objects { objects, ids, kinds, planes, surfaces, figures, charts })
    }
}

/// The value of object 1, 2, ..., from the values of the groups. Empty if no group has a value.
fn of_objects<T: Copy + Default>(
    ids: &[Vec<u32>],
    groups: &[Vec<u32>],
    of_groups: &BTreeMap<u32, T>,
    objects: usize,
) -> Vec<T> {
    if of_groups.is_empty() {
        return Vec::new();
    }
    let mut of_objects = vec![T::default(); objects];
    for (&id, group) in ids.iter().flatten().zip(groups.iter().flatten()) {
        if let (Some(object), Some(value)) = ((id as usize).checked_sub(1), of_groups.get(group)) {
            of_objects[object] = *value;
        }
    }
    of_objects
}

/// The labels that a tile gave to its own points, in ascending order of their ids.
struct OwnLabels<'a> {
    progress: &'a Progress<'a>,
    verdicts: TileVerdicts,
    labels: Vec<u8>,
    /// Ids of the records of the current block (first and end), and the position of each record's label.
    first: PointId,
    places: Vec<Option<u64>>,
}

impl<'a> OwnLabels<'a> {
    fn of(progress: &'a Progress<'a>, tile: TileId) -> Result<Self> {
        let verdicts = progress.over.classified.verdicts(tile)?;
        let labels = progress.current.reader(tile)?.read_section(sections::LABELS)?;
        Ok(Self { progress, verdicts, labels, first: PointId::default(), places: Vec::new() })
    }

    /// The label of a point of objects in the core of the tile.
    fn label(&mut self, id: PointId) -> Result<u32> {
        let foreign = || Error::bug(format!("point {id} does not belong to its owner"));
        if id < self.first || id - self.first >= self.places.len() as u64 {
            self.load(id)?;
        }
        let record = usize::try_from(id - self.first).map_err(|_| foreign())?;
        let place = self.places.get(record).copied().flatten().ok_or_else(foreign)?;
        let (labels, _) = self.labels.as_chunks::<4>();
        let at = usize::try_from(place).map_err(|_| foreign())?;
        labels.get(at).map(|label| u32::from_le_bytes(*label)).ok_or_else(foreign)
    }

    /// Finds the positions of the labels of the block that contains a point.
    fn load(&mut self, id: PointId) -> Result<()> {
        let drive = self.progress.over.classified.tiled.drive;
        let (file, record) = drive.locate(id);
        let blocks = drive.file(file).blocks();
        let number = blocks.partition_point(|block| block.first_record + u64::from(block.count) <= record);
        let entry = self.verdicts.block(file, number);
        let entry = entry.ok_or_else(|| Error::bug(format!("point {id} is in no block of its owner")))?;
        self.first = drive.first_id(file, number);
        self.places.clear();
        self.places.resize(blocks[number].count as usize, None);
        let mut record = 0;
        let mut owned = 0;
        let mut place = entry.objects.0;
        let classes = self.verdicts.classes(entry);
        for pair in self.verdicts.runs(entry)?.chunks_exact(2) {
            record += pair[0] as usize;
            for _ in 0..pair[1] {
                if is_object(classes[owned]) {
                    self.places[record] = Some(place);
                    place += 1;
                }
                record += 1;
                owned += 1;
            }
        }
        Ok(())
    }
}
