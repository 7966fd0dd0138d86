//! Step `cores`: the parts of the drive that are certainly one object each, class by class.
//!
//! Chains are decided before: their voxels take the class of the chain (`chained`). Then the voxels of one
//! class are joined within the reach of this class, over all tiles. Wires are cut at the poles that carry
//! them (`supports`), and hanging parts join their pole (`arms`). Components that are large enough, stand on
//! the ground (not buildings and wires) and do not hang in foliage are cores. Trees are different, because
//! crowns touch: their voxels near the ground are cut into height bands, and `seeds` finds the stems in them.
#![expect(
    clippy::cast_possible_truncation,
    reason = "voxels of a tile fit u32; heights above ground in lattice units fit i32"
)]

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::arms;
use super::chained;
use super::cuts::{self, Cut};
use super::facades::{self, Near};
use super::joining;
use super::part::{NO_BAND, Part};
use super::parts::Links;
use super::remaining::{Components, Pairs, Remaining, may_be_core};
use super::rules::keeps;
use super::supports;
use super::uniting;
use crate::cluster::columns::{Border, Joining, Voxel};
use crate::cluster::street::chains::stage_chains;
use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::cores::trees::crowns::{self, Crown};
use crate::cluster::street::cores::trees::seeds;
use crate::cluster::street::cores::vehicles::trails;
use crate::cluster::street::settings::{CLASSES, EDGE_M, STEP_CORES};
use crate::cluster::street::shares::{self, GROUND, TREE};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::Result;
use crate::model::{Lattice, TileId};
use crate::spatial::Cell;

/// Distance around a tile within which voxels are read, in metres. Crowns reach farthest. Buildings that
/// are near each other are at most 3.6 m apart.
const REACH_M: f64 = crowns::REACH_M;

/// The payload of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Payload {
    /// Class of each voxel of the tile, plus [`DECIDED`] where `chained` decided it.
    class: Vec<u8>,
    /// Component of each voxel of the tile plus one, or 0.
    part: Vec<u32>,
    /// Voxels of trunks: number of the voxel in the tile, and chain.
    pub(crate) trunks: Vec<(u32, u32)>,
    /// Figures of the components; `None` for components without voxels that the tile owns.
    pub(crate) parts: Vec<Option<Part>>,
    pub(crate) border: Border,
    /// Components of low tree voxels in adjacent bands that touch, the lower first.
    pub(crate) rising: Vec<(u32, u32)>,
    /// Components of buildings that are near each other.
    near: Vec<Near>,
    /// Crowns that the tile owns.
    crowns: Vec<Crown>,
    /// Voxels in the cores of crowns: number of the voxel in the tile, and cell of the crown.
    in_crowns: Vec<(u32, Cell)>,
}

const DECIDED: u8 = 0x80;

/// A core: an object whose other voxels are yet to be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Core {
    /// Number from 1 in an order that does not depend on tiles.
    pub(crate) label: u32,
    pub(crate) class: u8,
    /// Where it stands, in lattice units. For a vehicle in a row, this is the middle of the row.
    pub(crate) place: [i64; 2],
}

/// The slice of the global result for one tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct OfTile {
    /// Label of each component, or 0.
    labels: Vec<u32>,
    /// Components with a voxel in the tile that are several objects: the component, how it is cut, and the
    /// labels of the objects.
    cuts: Vec<(u32, Cut, Vec<u32>)>,
    /// Label of each chain that has a trunk voxel in the tile.
    chains: Vec<(u32, u32)>,
    /// Label of each crown that is a tree of its own and has a voxel in the tile.
    crowns: Vec<(Cell, u32)>,
    /// The cores of these labels, ascending.
    pub(crate) cores: Vec<Core>,
}

/// The voxels around a tile with class, shares and label.
pub(crate) struct Cored {
    pub(crate) around: Classified,
    /// Class of each voxel.
    pub(crate) class: Vec<u8>,
    /// Label of each voxel of a core, or 0.
    pub(crate) label: Vec<u32>,
    /// The cores of the labels.
    pub(crate) cores: BTreeMap<u32, Core>,
}

impl Cored {
    /// Loads the voxels within `reach` of a tile, and those of the columns `also`.
    pub(crate) fn load(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        let mut around = Classified::load_with(tile, reach, also)?;
        let count = around.voxels.key.len();
        let mut class = vec![GROUND; count];
        let mut label = vec![0; count];
        let mut cores = BTreeMap::new();
        for (near, places) in around.voxels.by_tile() {
            let payload: Payload = codec::decode(&tile.payload(STEP_CORES, near)?)?;
            let of_tile: OfTile = sliced::slice(tile.global(STEP_CORES), near)?;
            let cuts: BTreeMap<u32, (Cut, Vec<u32>)> =
                of_tile.cuts.into_iter().map(|(part, cut, labels)| (part, (cut, labels))).collect();
            for &(voxel, at) in &places {
                let (voxel, at) = (voxel as usize, at as usize);
                class[at] = payload.class[voxel] & !DECIDED;
                if payload.class[voxel] & DECIDED != 0 {
                    around.shares[at] = shares::decided(&around.shares[at], class[at]);
                }
                if let Some(part) = payload.part[voxel].checked_sub(1) {
                    let [x, y, _] = around.voxels.centre[at];
                    label[at] = match cuts.get(&part) {
                        Some((cut, labels)) => labels[cut.number([x, y])],
                        None => of_tile.labels[part as usize],
                    };
                }
            }
            let chains: BTreeMap<u32, u32> = of_tile.chains.into_iter().collect();
            let trunks: BTreeMap<u32, u32> = payload.trunks.into_iter().collect();
            for &(voxel, at) in &places {
                if let Some(&trunk) = trunks.get(&voxel).and_then(|chain| chains.get(chain)) {
                    label[at as usize] = trunk;
                }
            }
            let crowns: BTreeMap<Cell, u32> = of_tile.crowns.into_iter().collect();
            let in_crowns: BTreeMap<u32, Cell> = payload.in_crowns.into_iter().collect();
            for &(voxel, at) in &places {
                if let Some(&crown) = in_crowns.get(&voxel).and_then(|cell| crowns.get(cell))
                    && label[at as usize] == 0
                {
                    label[at as usize] = crown;
                }
            }
            cores.extend(of_tile.cores.into_iter().map(|core| (core.label, core)));
        }
        Ok(Self { around, class, label, cores })
    }

    /// The cores of these labels, ascending.
    pub(crate) fn cores_of(&self, labels: Vec<u32>) -> Vec<Core> {
        named(labels, |label| self.cores.get(&label).copied())
    }
}

/// The cores of these labels, ascending. `core` finds the core of a label.
pub(crate) fn named(mut labels: Vec<u32>, core: impl Fn(u32) -> Option<Core>) -> Vec<Core> {
    labels.sort_unstable();
    labels.dedup();
    labels.into_iter().filter_map(core).collect()
}

/// The components that a tile sees.
pub(crate) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let lattice = tile.lattice();
    let mut around = Classified::load(tile, lattice.units_up(REACH_M))?;
    let near = tile.near(lattice.units_up(REACH_M + chained::REACH_M + 4.0 * EDGE_M));
    let pieces = stage_chains::load(tile, &near)?;
    let mut class = shares::classes(&around.shares);
    let trunk = chained::take(&mut around, &mut class, &pieces, lattice);
    let band = joining::bands(&around, &class, lattice);
    let mut joined = class.clone();
    let cut = supports::cut(&around, &class, lattice);
    joined.iter_mut().zip(cut).filter(|(_, cut)| *cut).for_each(|(class, _)| *class = GROUND);
    let mut links = Links::new(&around.voxels);
    joining::join_classes(&around, &joined, &mut links);
    joining::join_buildings(&around, &class, &mut links);
    facades::touch(&around, &class, &mut links);
    let rising = joining::join_bands(&around, &band, &mut links);
    let chosen = |voxel: usize| band[voxel] != NO_BAND || joined[voxel] > TREE;
    let parts = links.finish(&around.voxels, chosen);
    let mut figures = joining::figures(&around, &class, &band, &|voxel| trunk[voxel].0, &parts);
    keep_footprints(&mut figures, &parts.border, lattice);
    let mut rising: Vec<(u32, u32)> =
        rising.into_iter().map(|(low, high)| (parts.of[low], parts.of[high])).collect();
    rising.sort_unstable();
    rising.dedup();
    let in_trunks = (0..class.len()).filter(|&voxel| around.voxels.owned[voxel] && trunk[voxel].1 != 0);
    let open = parts.border.shared.iter().map(|(_, component)| *component);
    let open = open.chain(in_trunks.map(|voxel| parts.of[voxel]));
    let known = known(&figures, open, lattice);
    let near = facades::near(&around, &class, &parts, joining::low_wall(lattice), &known);
    let crowns = crowns::find(&around, &class, lattice);
    let in_crown: BTreeMap<usize, Cell> =
        crowns::cores(&around, &class, &crowns, lattice).into_iter().collect();
    let crowns = crowns.into_iter().filter(|(_, owned)| *owned).map(|(crown, _)| crown).collect();
    let mut payload =
        Payload { parts: figures, border: parts.border, rising, near, crowns, ..Payload::default() };
    for (number, voxel) in (0_u32..).zip((0..class.len()).filter(|&voxel| around.voxels.owned[voxel])) {
        let (decided, chain) = trunk[voxel];
        payload.class.push(class[voxel] | if decided { DECIDED } else { 0 });
        payload.part.push(parts.of[voxel].wrapping_add(1));
        if chain != 0 {
            payload.trunks.push((number, chain));
        }
        if let Some(cell) = in_crown.get(&voxel) {
            payload.in_crowns.push((number, *cell));
        }
    }
    Ok(Mapped::payload(codec::encode(&payload)?))
}

/// What the tile knows of its components. `open` are those of which other tiles may know more.
fn known(figures: &[Option<Part>], open: impl Iterator<Item = u32>, lattice: Lattice) -> Vec<facades::Known> {
    let of_part = |part: &Option<Part>| facades::Known {
        is_owned: part.is_some(),
        counts: part.as_ref().is_none_or(|part| may_be_core(part, lattice, keeps)),
    };
    let mut known: Vec<facades::Known> = figures.iter().map(of_part).collect();
    for component in open {
        // A voxel of a trunk need not be in a component.
        if let Some(known) = known.get_mut(component as usize) {
            known.counts = true;
        }
    }
    known
}

/// Drops the footprints of components that end in the tile and are not cut.
fn keep_footprints(figures: &mut [Option<Part>], border: &Border, lattice: Lattice) {
    let shared: BTreeSet<u32> = border.shared.iter().map(|(_, component)| *component).collect();
    for (component, part) in (0_u32..).zip(figures) {
        let Some(part) = part.as_mut().filter(|_| !shared.contains(&component)) else { continue };
        if !cuts::may_be_cut(part, lattice) {
            part.footprint = None;
        }
    }
}

/// What the tiles found.
#[derive(Debug, Default)]
struct Found {
    joining: Joining,
    remaining: Vec<Remaining>,
    /// Chains of trunks, each with a component, plus one, in which it has voxels. These pairs say which chain
    /// rises from which piece near the ground.
    trunks: Vec<BTreeSet<(u32, u32)>>,
    crowns: Vec<Crown>,
    in_crowns: Vec<BTreeSet<Cell>>,
}

impl Found {
    /// Reads the results of the tiles. A component that cannot become a core is dropped at once. There are
    /// 13,000 of them per kilometre of street.
    fn of(drive: &dyn DriveWindow) -> Result<Self> {
        let lattice = drive.lattice();
        let mut found = Self::default();
        for tile in TileId::first(drive.tiles()) {
            let payload: Payload = codec::decode(&drive.payload(STEP_CORES, tile)?)?;
            let part = |&(voxel, chain): &(u32, u32)| (chain, payload.part[voxel as usize]);
            let trunks: BTreeSet<(u32, u32)> = payload.trunks.iter().map(part).collect();
            found.joining.add(&payload.border);
            let in_trunks = trunks.iter().filter_map(|(_, part)| part.checked_sub(1));
            let open = payload.border.shared.iter().map(|(_, component)| *component).chain(in_trunks);
            let pairs = Pairs { rising: &payload.rising, near: &payload.near };
            found.remaining.push(Remaining::of(payload.parts, pairs, open, lattice, keeps));
            found.trunks.push(trunks);
            found.crowns.extend(payload.crowns);
            found.in_crowns.push(payload.in_crowns.into_iter().map(|(_, cell)| cell).collect());
        }
        Ok(found)
    }
}

/// Where a core comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Source {
    Component(u32),
    /// An object of a component that is cut: the component, and the number of the object.
    Piece(u32, usize),
    Stem(usize),
    Crown(Cell),
}

/// The labels of the cores, by where they come from.
#[derive(Debug, Default)]
struct Labels {
    of: BTreeMap<Source, u32>,
    /// The core of each label from 1.
    cores: Vec<Core>,
}

impl Labels {
    /// Numbers the cores in the order of their first voxels.
    fn number(mut found: Vec<(Voxel, u8, Source, [i64; 2])>) -> Self {
        found.sort_unstable();
        let mut labels = Self::default();
        for (label, (_, class, source, place)) in (1..).zip(found) {
            labels.of.insert(source, label);
            labels.cores.push(Core { label, class, place });
        }
        labels
    }

    fn get(&self, source: Source) -> Option<u32> {
        self.of.get(&source).copied()
    }

    /// The slice of a tile, with the cores that it names.
    fn with_cores(&self, of_tile: OfTile) -> OfTile {
        let OfTile { labels, cuts, chains, crowns, .. } = &of_tile;
        let of_trees = chains.iter().map(|chain| chain.1).chain(crowns.iter().map(|crown| crown.1));
        let of_cuts = cuts.iter().flat_map(|cut| cut.2.iter().copied());
        let named: BTreeSet<u32> =
            labels.iter().copied().chain(of_cuts).chain(of_trees).filter(|&label| label != 0).collect();
        let cores = named.into_iter().map(|label| self.cores[label as usize - 1]).collect();
        OfTile { cores, ..of_tile }
    }
}

/// The cores of the drive.
pub(crate) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let lattice = drive.lattice();
    let found = Found::of(drive)?;
    let component = found.joining.finish();
    let Components { mut whole, low, rising, near } = Components::merge(&component, found.remaining);
    let chains = component.iter().zip(&found.trunks).flat_map(|(component, trunks)| {
        trunks.iter().map(|&(chain, part)| (chain, part.checked_sub(1).map(|part| component[part as usize])))
    });
    let places = stage_chains::places(drive)?;
    let stems = seeds::find(&low, rising.into_iter(), chains, &places, lattice);
    drop(low);
    let crowns = crowns::without_stem(&found.crowns, stems.seeds.iter().map(|stem| stem.place), lattice);
    // Rows are found before trails are united, because the empty space between the stripes of a trail would
    // be a valley.
    let rows = cuts::rows(&whole, lattice);
    let beside = cuts::take_beside(&mut whole, lattice);
    let first = cuts::first_voxels(&whole, &rows, &beside);
    let mut united = trails::unite(&mut whole, &rows, lattice);
    uniting::go_on(&mut united, uniting::unite(&mut whole, |part| keeps(part, lattice), lattice));
    let cuts = cuts::by_name(rows, beside, &first, &united);
    united.extend(facades::unite(&mut whole, near, |part| keeps(part, lattice), lattice));
    united.extend(arms::join(&whole, |part| keeps(part, lattice), lattice));

    let kept = whole.iter().filter(|(_, part)| keeps(part, lattice));
    let cores = kept.flat_map(|(&component, part)| {
        let places = match cuts.get(&component) {
            Some(cut) => cut.places(part.centre()).into_iter().enumerate(),
            None => return vec![(part.first, part.class, Source::Component(component), part.centre())],
        };
        let piece = |(number, place)| (part.first, part.class, Source::Piece(component, number), place);
        places.map(piece).collect()
    });
    let of_stems = stems.seeds.iter().enumerate();
    let of_stems = of_stems.map(|(number, stem)| (stem.first, TREE, Source::Stem(number), stem.place));
    let of_crowns = crowns.iter().map(|crown| (crown.first, TREE, Source::Crown(crown.cell), crown.place));
    let labels = Labels::number(cores.chain(of_stems).chain(of_crowns).collect());

    let stem = |stem: &u32| labels.get(Source::Stem(*stem as usize));
    let of_component = |component: &u32| match stems.components.get(component) {
        Some(number) => stem(number),
        None => labels.get(Source::Component(uniting::by_name(&united, *component))),
    };
    let slices: Vec<OfTile> = (0..component.len())
        .map(|tile| {
            let of_parts = component[tile].iter().map(|component| of_component(component).unwrap_or(0));
            let trunks = found.trunks[tile].iter().map(|(chain, _)| chain);
            let chains: BTreeMap<u32, u32> =
                trunks.filter_map(|chain| Some((*chain, stem(stems.chains.get(chain)?)?))).collect();
            let cells = found.in_crowns[tile].iter();
            let crowns = cells.filter_map(|cell| Some((*cell, labels.get(Source::Crown(*cell))?)));
            let piece = |component, number| labels.get(Source::Piece(component, number)).unwrap_or(0);
            let of_cuts = (0..).zip(&component[tile]).filter_map(|(part, component)| {
                let component = uniting::by_name(&united, *component);
                let cut = cuts.get(&component)?;
                let labels = (0..cut.count()).map(|number| piece(component, number)).collect();
                Some((part, cut.clone(), labels))
            });
            labels.with_cores(OfTile {
                labels: of_parts.collect(),
                cuts: of_cuts.collect(),
                chains: chains.into_iter().collect(),
                crowns: crowns.collect(),
                cores: Vec::new(),
            })
        })
        .collect();
    sliced::encode(&(labels.cores.len() as u32), &slices)
}

/// The number of cores of the drive.
pub(crate) fn count(global: &[u8]) -> Result<u32> {
    sliced::head(global)
}

const _: () = assert!(CLASSES <= 128, "a class leaves a bit for DECIDED");
