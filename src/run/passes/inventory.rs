//! Pass `inventory`: the row of every object in the table of objects.
//!
//! A tile sketches the points that it owns, object by object, and finishes the rows of the objects that lie
//! in it alone. The process that writes the tables merges the sketches of objects that several tiles share,
//! in the order of the tiles, and finishes each row once the last tile of the object is read. So the memory
//! does not grow with the number of points. Finished rows wait in a temporary file, because the rows of 16 km
//! of street take 30 MB.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::{Error, Result};
use crate::inventory::{self, Among, Face, Measures, Object, Place, Site, Station, SurfaceRow, Terrain};
use crate::model::{Kind, ObjectPart, Plane, TileId, Value, in_u32};
use crate::run::drive::{Border, Drive, Surveyed};
use crate::run::engine::{Driver, Outline, Pass, Payloads};
use crate::run::passes::relabel::PointColumns;
use crate::run::passes::stitch::Objects;
use crate::run::passes::window::Progress;
use crate::spill::{Spill, Spilled};
use crate::store::{Inputs, PassDir};
use crate::survey::AxisSource;
use crate::tiling::Wanted;

const NUMBER: u32 = 6;
const NAME: &str = "inventory";

/// Bytes per point of objects that a tile needs at its peak: coordinates and id (20), class and role (2),
/// object (4), the list by object (8), and a voxel to find touching objects (16). The sketches, made for one
/// object at a time, have a bounded size.
const BYTES_PER_POINT: u64 = 52;
/// Bytes for the sketches and the raster of one object.
const BYTES_OF_OBJECT: u64 = 16 << 20;

/// The rows depend on objects and their points, on the axis (for chainage), and on the columns.
pub(crate) fn outline(relabel: &Outline, surveyed: &Surveyed) -> Outline {
    let axis = &surveyed.axis;
    let names: Vec<&str> = inventory::columns().iter().map(|column| column.name).collect();
    let depends = Inputs::new()
        .with("pass relabel", relabel.depends.fingerprint())
        .with("axis", format!("{:?}, {:.3} m, {:016x}", axis.source, axis.length_m(), axis.digest()))
        .with("attributes epoch", inventory::EPOCH)
        .with("columns", names.join(" "));
    Outline::new(NUMBER, NAME, depends)
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Vertices of the outline in the units of the input, counter-clockwise and not closed.
    pub(crate) outline: Vec<[f64; 2]>,
    /// Where the object stands, in the units of the input.
    pub(crate) base: [f64; 3],
    /// One value per column.
    pub(crate) values: Vec<Value<'static>>,
}

/// A row in its stored form: bytes, because there are many rows and they are read one at a time.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Kept {
    place: Place,
    row: Vec<u8>,
    /// The row in the table of surfaces; empty if the object is not a surface.
    surface: Vec<u8>,
}

/// The sketches of an object, or of a part of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Part {
    measures: Measures,
    /// Only for surfaces.
    face: Option<Face>,
}

impl Part {
    fn merge(&mut self, other: Self) {
        self.measures.merge(other.measures);
        match (&mut self.face, other.face) {
            (Some(face), Some(other)) => face.merge(other),
            (own, other) => *own = own.take().or(other),
        }
    }
}

/// The rows of all objects, and how the objects relate to each other.
#[derive(Debug)]
pub(crate) struct Inventory {
    spill: Spill,
    rows: Vec<Spilled>,
    /// Rows in the table of surfaces, in ascending order of ids.
    surfaces: Vec<Spilled>,
    among: Among,
    dir: PassDir,
}

impl Inventory {
    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The row of object `index + 1`.
    pub(crate) fn row(&self, index: usize) -> Result<Row> {
        let place = self.rows.get(index);
        let place = *place.ok_or_else(|| Error::bug(format!("object {} has no row", index + 1)))?;
        let mut row: Row = codec::decode(&self.read(place)?)?;
        inventory::complete(in_u32(index + 1, "objects"), &self.among, &mut row.values);
        Ok(row)
    }

    /// Number of surfaces.
    pub(crate) fn surfaces(&self) -> usize {
        self.surfaces.len()
    }

    /// A row of the table of surfaces.
    pub(crate) fn surface(&self, index: usize) -> Result<SurfaceRow> {
        let place = self.surfaces.get(index);
        let place = *place.ok_or_else(|| Error::bug(format!("there is no surface {index}")))?;
        let (outline, centre, values) = codec::decode(&self.read(place)?)?;
        Ok(SurfaceRow { outline, centre, values })
    }

    fn read(&self, place: Spilled) -> Result<Vec<u8>> {
        Ok(self.spill.read(place).map_err(self.dir.failed("read"))?)
    }

    /// A temporary file for the writer of the tables.
    pub(crate) fn spill(&self) -> Result<Spill> {
        Ok(self.dir.spill("table")?)
    }
}

/// A row in the temporary file.
struct Stored {
    place: Place,
    row: Spilled,
    surface: Option<Spilled>,
}

impl Stored {
    fn of(kept: &Kept, spill: &mut Spill) -> std::io::Result<Self> {
        let Kept { place, row, surface } = kept;
        let surface = (!surface.is_empty()).then(|| spill.push(surface)).transpose()?;
        Ok(Self { place: *place, row: spill.push(row)?, surface })
    }
}

/// The result of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Found {
    /// Objects that lie in this tile alone.
    whole: Vec<(u32, Kept)>,
    /// Parts of other objects.
    parts: Vec<(u32, Part)>,
    /// Pairs of objects that touch each other.
    touching: Vec<(u32, u32)>,
}

/// The sources of the rows.
#[derive(Clone, Copy)]
pub(crate) struct Sources<'a> {
    pub(crate) progress: &'a Progress<'a>,
    pub(crate) objects: &'a Objects,
    pub(crate) columns: &'a PointColumns,
    pub(crate) terrain: &'a Terrain,
}

/// Sketches the objects of every tile. The process that writes the rows makes them from the sketches later.
pub(crate) fn complete<D: Driver>(
    driver: &mut D,
    sources: Sources<'_>,
    outline: Outline,
) -> Result<Option<Payloads>> {
    with_pass(sources, outline, |pass| driver.complete(pass))
}

/// The rows of all objects.
pub(crate) fn rows(sources: Sources<'_>, outline: Outline, found: &Payloads) -> Result<Inventory> {
    with_pass(sources, outline, |pass| pass.rows(found))
}

/// Calls `then` with the pass over these sources.
fn with_pass<T>(
    sources: Sources<'_>,
    outline: Outline,
    then: impl FnOnce(&InventoryPass<'_>) -> Result<T>,
) -> Result<T> {
    let Sources { progress, objects, columns, terrain } = sources;
    let tiled = progress.over.classified.tiled;
    let (drive, surveyed) = (tiled.drive, tiled.surveyed);
    let file_names = drive.catalog.distinct_names();
    let file_names: Vec<&str> = file_names.iter().map(String::as_str).collect();
    let locate = |place| {
        let (chainage_m, offset_m) = surveyed.axis.locate(place);
        Station { chainage_m, offset_m }
    };
    let border = Border::of(&surveyed.used, &surveyed.axis, drive.grid, drive.lattice());
    // An object that reaches the end of a section may not be whole, like an object that reaches the end of
    // the data.
    let is_cut_off = |[x, y]: [i64; 2]| {
        let cell = drive.grid.cell(x, y);
        surveyed.section.as_ref().is_some_and(|section| cell.is_none_or(|cell| !section.is_whole(cell)))
    };
    let at_end = |place| border.is_near(place) || is_cut_off(place);
    // Where the drive goes on at another time, the last profiles cut nothing.
    let stops: Vec<_> = surveyed.moments.iter().map(|moment| border.stop_at(moment.place)).collect();
    let is_cut = |id: u32, hull: &[[i64; 2]]| {
        let met = columns.ends.range((id, 0)..=(id, u32::MAX));
        met.filter_map(|(_, moment)| stops[*moment as usize].as_ref()).any(|stop| border.reaches(hull, stop))
    };
    let site = Site {
        lattice: drive.lattice(),
        units_m: drive.catalog.units_m(),
        terrain,
        locate: &locate,
        is_driven: surveyed.axis.source != AxisSource::Principal,
        at_end: &at_end,
        is_cut: &is_cut,
        file_names: &file_names,
    };
    let last_tile = last_tiles(objects);
    then(&InventoryPass { progress, objects, columns, site: &site, last_tile, outline })
}

/// The first and last tile with a label of object 1, 2, ...
fn last_tiles(objects: &Objects) -> Vec<(TileId, TileId)> {
    let mut tiles: Vec<Option<(TileId, TileId)>> = vec![None; objects.objects.len()];
    for (tile, ids) in TileId::first(objects.ids.len()).zip(&objects.ids) {
        for id in ids.iter().filter_map(|id| (*id as usize).checked_sub(1)) {
            tiles[id] = Some((tiles[id].map_or(tile, |(first, _)| first), tile));
        }
    }
    tiles.into_iter().map(|tiles| tiles.unwrap_or_default()).collect()
}

struct InventoryPass<'a> {
    progress: &'a Progress<'a>,
    objects: &'a Objects,
    columns: &'a PointColumns,
    site: &'a Site<'a>,
    /// First and last tile of each object.
    last_tile: Vec<(TileId, TileId)>,
    outline: Outline,
}

impl InventoryPass<'_> {
    fn drive(&self) -> &Drive {
        self.progress.over.classified.tiled.drive
    }

    fn reach(&self) -> i64 {
        inventory::touching_reach(self.drive().lattice())
    }

    fn kind(&self, index: usize) -> Kind {
        self.objects.kinds.get(index).copied().unwrap_or_default()
    }

    /// Extent and plane of an object that is a surface.
    fn plane(&self, id: u32) -> Option<(&ObjectPart, &Plane)> {
        let index = id as usize - 1;
        Some((self.objects.objects.get(index)?, self.objects.planes.get(index)?.as_ref()?))
    }

    /// The row of an object whose points were all sketched.
    fn finished(&self, id: u32, Part { measures, face }: &Part) -> Result<Kept> {
        let index = id as usize - 1;
        let surface = match (face, self.plane(id)) {
            (Some(face), Some((part, plane))) => {
                let SurfaceRow { outline, centre, values } =
                    SurfaceRow::new(id, part, plane, face, self.site);
                codec::encode(&(outline, centre, values))?
            }
            _ => Vec::new(),
        };
        let object = Object::new(id, &self.objects.objects[index], measures, self.kind(index), self.site);
        let row =
            StoredRow { outline: object.ring(), base: object.base(), values: inventory::values(&object) };
        Ok(Kept { place: Place::of(&object), row: codec::encode(&row)?, surface })
    }

    /// The rows of all objects, from the sketches of all tiles.
    fn rows(&self, payloads: &Payloads) -> Result<Inventory> {
        let dir = payloads.dir()?;
        let mut spill = dir.spill("rows")?;
        let mut store = |kept: &Kept| Stored::of(kept, &mut spill).map_err(dir.failed("write"));
        let mut stored: Vec<Option<Stored>> = Vec::new();
        stored.resize_with(self.objects.objects.len(), || None);
        let mut open: BTreeMap<u32, Part> = BTreeMap::new();
        let mut touching = std::collections::BTreeSet::new();
        for tile in TileId::first(self.units()) {
            let found: Found = codec::decode(&payloads.get(tile.index())?)?;
            touching.extend(found.touching);
            for (id, one) in found.whole {
                stored[id as usize - 1] = Some(store(&one)?);
            }
            for (id, part) in found.parts {
                match open.entry(id) {
                    std::collections::btree_map::Entry::Vacant(entry) => _ = entry.insert(part),
                    std::collections::btree_map::Entry::Occupied(mut entry) => entry.get_mut().merge(part),
                }
            }
            let complete: Vec<u32> =
                open.keys().copied().filter(|id| self.last_tile[*id as usize - 1].1 == tile).collect();
            for id in complete {
                if let Some(part) = open.remove(&id) {
                    stored[id as usize - 1] = Some(store(&self.finished(id, &part)?)?);
                }
            }
        }
        let mut places = Vec::with_capacity(stored.len());
        let mut rows = Vec::with_capacity(stored.len());
        let mut surfaces = Vec::new();
        for (index, one) in stored.into_iter().enumerate() {
            let Stored { place, row, surface } =
                one.ok_or_else(|| Error::bug(format!("no tile has points of object {}", index + 1)))?;
            places.push(place);
            rows.push(row);
            surfaces.extend(surface);
        }
        Ok(Inventory { spill, rows, surfaces, among: Among::new(&places, touching), dir: dir.clone() })
    }
}

/// [`Row`] with borrowed texts.
#[derive(Serialize)]
struct StoredRow<'a> {
    outline: Vec<[f64; 2]>,
    base: [f64; 3],
    values: Vec<Value<'a>>,
}

impl Pass for InventoryPass<'_> {
    type Global = Payloads;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.progress.plan().tiles.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.progress.plan().tiles[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.progress.over.classified.object_points(unit, self.reach()) * BYTES_PER_POINT + BYTES_OF_OBJECT
    }

    fn prefetch(&self, unit: usize) {
        self.progress.over.classified.tiled.prefetch(unit, self.reach());
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let region = self.progress.plan().region(unit, self.reach());
        let gathered = self.progress.over.classified.gather(&region, Wanted::Objects, None)?;
        let cloud = &gathered.cloud;
        let ids = self.drive().values_of(&self.columns.objects, &cloud.id)?;
        let whole = |id: u32| {
            let index = id as usize - 1;
            let part = self.objects.objects.get(index)?;
            Some((part, self.kind(index), self.site.ground_below(part)))
        };
        let mut found =
            Found { touching: inventory::touching(cloud, &ids).into_iter().collect(), ..Found::default() };
        let core = |point: usize| gathered.core[point];
        let mut faces = match self.objects.planes.is_empty() {
            true => BTreeMap::new(),
            false => Face::collect(cloud, &ids, core, |id| self.plane(id)).into_iter().collect(),
        };
        for (id, measures) in Measures::collect(cloud, &ids, core, whole) {
            let part = Part { measures, face: faces.remove(&id) };
            let (first, last) = self.last_tile[id as usize - 1];
            if first == last {
                found.whole.push((id, self.finished(id, &part)?));
            } else {
                found.parts.push((id, part));
            }
        }
        codec::encode(&found)
    }

    /// The sketches. They are merged only by the process that writes the tables.
    fn reduce(&self, payloads: &Payloads) -> Result<Payloads> {
        Ok(payloads.clone())
    }
}
