//! Step `cores`: the parts of the drive that are certainly one object each, class by class.
//!
//! Chains are decided before: their voxels take the class of the chain. Then the voxels of one class are
//! joined with a reach of this class, over all tiles. Components that are large enough, stand on the ground
//! (not buildings and wires) and do not hang in foliage are cores. Trees are different, because crowns touch:
//! their voxels near the ground are cut into bands of height, and `seeds` finds the stems in them.
//!
//! Distances in voxels of 0.15 m are those of the prototype. `benches/results/street.md` has their study.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "voxels of a tile fit u32; heights above ground in lattice units fit i32"
)]

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::chains::{self, Piece, Verdict};
use super::classified::Classified;
use super::parts::{Links, Parts};
use super::seeds;
use super::settings::{CLASSES, EDGE_M, STEP_CORES};
use super::shares::{self, BUILDING, FENCE, GROUND, POLE, SMALL, TREE, VEHICLE, WIRE};
use super::window::Window;
use crate::cluster::columns::{Border, Voxel, join};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::Result;
use crate::model::{Lattice, TileId};
use crate::spatial::Cell;

/// Distance around a tile within which voxels are read, in metres. It covers the longest link (buildings,
/// 1.6 m) and the canopy around a link of trees.
const REACH_M: f64 = 2.0;
/// Distance around these voxels within which pieces of chains change their class, in metres.
const PIECES_M: f64 = 1.6;
/// Distance from the centre of a piece within which its chain takes voxels above and below it, in metres.
const AXIS_M: f64 = 0.45;
/// Height up to which a trunk takes the voxels around its axis, in metres.
const TRUNK_M: f64 = 4.0;
/// Lowest height, height of a band and number of bands of low tree voxels.
const LOW_M: f64 = 0.15;
const BAND_M: f64 = 0.25;
pub(super) const BANDS: u8 = 9;
/// Voxels of a class are joined within so many voxels in the plane and so many levels.
const REACHES: [(u8, i32, i32); 5] =
    [(POLE, 2, 16), (VEHICLE, 2, 2), (FENCE, 6, 8), (SMALL, 3, 3), (WIRE, 4, 4)];
/// Columns of buildings are joined within so many voxels in the plane, whatever their height.
const BUILDING_REACH: i32 = 10;
/// Canopy is looked for within so many voxels of a low tree voxel.
const CANOPY_REACH: i32 = 5;

/// Figures of a component. Sums and extremes, so that the figures of its parts in all tiles add up.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Part {
    pub(super) class: u8,
    /// Band of height of low tree voxels.
    pub(super) band: u8,
    /// First voxel in the order (i, j, k).
    pub(super) first: Voxel,
    pub(super) voxels: u32,
    /// Lowest and highest height above ground in lattice units.
    pub(super) height: (i32, i32),
    /// Smallest and largest coordinates of centres, in lattice units.
    pub(super) min: [i64; 2],
    pub(super) max: [i64; 2],
    /// Sums of the coordinates of centres.
    pub(super) sum: [i64; 2],
    /// Neighbours (of 26) that are trees or buildings.
    pub(super) contact: u32,
    /// Voxels with a vehicle above, below or beside them, if the class is another.
    pub(super) in_vehicle: u32,
    /// Highest tree voxel around low tree voxels, in lattice units above ground.
    pub(super) canopy: i32,
}

impl Part {
    fn of_voxel(class: u8, band: u8, first: Voxel, height: i32, centre: [i64; 3]) -> Self {
        let place = [centre[0], centre[1]];
        Self {
            class,
            band,
            first,
            voxels: 1,
            height: (height, height),
            min: place,
            max: place,
            sum: place,
            contact: 0,
            in_vehicle: 0,
            canopy: i32::MIN,
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.first = self.first.min(other.first);
        self.voxels += other.voxels;
        self.height = (self.height.0.min(other.height.0), self.height.1.max(other.height.1));
        for axis in 0..2 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
            self.sum[axis] += other.sum[axis];
        }
        self.contact += other.contact;
        self.in_vehicle += other.in_vehicle;
        self.canopy = self.canopy.max(other.canopy);
    }

    pub(super) fn centre(&self) -> [i64; 2] {
        self.sum.map(|sum| sum.div_euclid(i64::from(self.voxels.max(1))))
    }

    /// Longest side of the box in the plane.
    fn extent(&self) -> i64 {
        (self.max[0] - self.min[0]).max(self.max[1] - self.min[1])
    }
}

/// The payload of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Payload {
    /// Class of each voxel of the tile, plus [`DECIDED`] where a chain decided it.
    class: Vec<u8>,
    /// Component of each voxel of the tile plus one, or 0.
    part: Vec<u32>,
    /// Voxels of trunks: number of the voxel in the tile, and chain.
    pub(super) trunks: Vec<(u32, u32)>,
    /// Figures of the components. Empty for those without voxels of the tile.
    pub(super) parts: Vec<Option<Part>>,
    pub(super) border: Border,
    /// Components of low tree voxels in adjacent bands that touch, the lower first.
    pub(super) rising: Vec<(u32, u32)>,
}

const DECIDED: u8 = 0x80;

/// A core: an object whose other voxels are yet to be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Core {
    /// Number from 1 in an order that does not depend on tiles.
    pub(super) label: u32,
    pub(super) class: u8,
    /// Where it stands, in lattice units.
    pub(super) place: [i64; 2],
}

/// The slice of a tile of the global.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct OfTile {
    /// Label of each component, or 0.
    labels: Vec<u32>,
    /// Label of each chain that has a trunk voxel in the tile.
    chains: Vec<(u32, u32)>,
    /// The cores of these labels, ascending.
    pub(super) cores: Vec<Core>,
}

/// The voxels around a tile with class, shares and label.
pub(super) struct Cored {
    pub(super) around: Classified,
    /// Class of each voxel.
    pub(super) class: Vec<u8>,
    /// Label of each voxel of a core, or 0.
    pub(super) label: Vec<u32>,
    /// The cores of the labels.
    pub(super) cores: BTreeMap<u32, Core>,
}

impl Cored {
    /// Loads the voxels within `reach` of a tile, and those of the columns `also`.
    pub(super) fn load(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        let mut around = Classified::load_with(tile, reach, also)?;
        let count = around.voxels.key.len();
        let mut class = vec![GROUND; count];
        let mut label = vec![0; count];
        let mut cores = BTreeMap::new();
        for (near, places) in around.voxels.by_tile() {
            let payload: Payload = codec::decode(&tile.payload(STEP_CORES, near)?)?;
            let of_tile: OfTile = sliced::slice(tile.global(STEP_CORES), near)?;
            for &(voxel, at) in &places {
                let (voxel, at) = (voxel as usize, at as usize);
                class[at] = payload.class[voxel] & !DECIDED;
                if payload.class[voxel] & DECIDED != 0 {
                    around.shares[at] = shares::decided(&around.shares[at], class[at]);
                }
                if let Some(part) = payload.part[voxel].checked_sub(1) {
                    label[at] = of_tile.labels[part as usize];
                }
            }
            let chains: BTreeMap<u32, u32> = of_tile.chains.into_iter().collect();
            let trunks: BTreeMap<u32, u32> = payload.trunks.into_iter().collect();
            for &(voxel, at) in &places {
                if let Some(&trunk) = trunks.get(&voxel).and_then(|chain| chains.get(chain)) {
                    label[at as usize] = trunk;
                }
            }
            cores.extend(of_tile.cores.into_iter().map(|core| (core.label, core)));
        }
        Ok(Self { around, class, label, cores })
    }
}

/// The components that a tile sees.
pub(super) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let lattice = tile.lattice();
    let mut around = Classified::load(tile, lattice.units_up(REACH_M))?;
    let near = tile.near(lattice.units_up(REACH_M + PIECES_M + 4.0 * EDGE_M));
    let pieces = chains::load(tile, &near)?;
    let mut class = shares::classes(&around.shares);
    let trunk = take_chains(&mut around, &mut class, &pieces, lattice);
    let band = bands(&around, &class, lattice);
    let mut links = Links::new(&around.voxels);
    join_classes(&around, &class, &mut links);
    join_buildings(&around, &class, &mut links);
    let rising = join_bands(&around, &band, &mut links);
    let chosen = |voxel: usize| band[voxel] != NO_BAND || class[voxel] > TREE;
    let parts = links.finish(&around.voxels, chosen);
    let figures = figures(&around, &class, &band, &parts);
    let mut rising: Vec<(u32, u32)> =
        rising.into_iter().map(|(low, high)| (parts.of[low], parts.of[high])).collect();
    rising.sort_unstable();
    rising.dedup();
    let mut payload = Payload { parts: figures, border: parts.border, rising, ..Payload::default() };
    for (number, voxel) in (0_u32..).zip((0..class.len()).filter(|&voxel| around.voxels.owned[voxel])) {
        let (decided, chain) = trunk[voxel];
        payload.class.push(class[voxel] | if decided { DECIDED } else { 0 });
        payload.part.push(parts.of[voxel].wrapping_add(1));
        if chain != 0 {
            payload.trunks.push((number, chain));
        }
    }
    Ok(Mapped::payload(codec::encode(&payload)?))
}

/// Gives the voxels of chains the class of their chain. Returns for each voxel whether a chain decided its
/// class, and the chain if it is a part of a trunk.
fn take_chains(
    around: &mut Classified,
    class: &mut [u8],
    pieces: &[(Piece, Verdict)],
    lattice: Lattice,
) -> Vec<(bool, u32)> {
    let axis = lattice.units(AXIS_M);
    let top = lattice.units(TRUNK_M) as i32;
    // Nearest piece of each voxel that takes it: squared distance, slice and first voxel.
    let mut taken: Vec<Option<(i64, u8, Voxel, usize)>> = vec![None; class.len()];
    let columns = &around.voxels.columns;
    let mut finder = columns.finder();
    let window = Window::new(4, i32::MAX / 4);
    let edge = lattice.units(EDGE_M);
    for (number, (piece, verdict)) in pieces.iter().enumerate() {
        let cell = piece.centre.map(|value| value.div_euclid(edge) as i32);
        window.visit(columns, &mut finder, cell, 0, |voxel| {
            let of = class[voxel];
            if of != TREE && of != POLE {
                return;
            }
            let [x, y, _] = around.voxels.centre[voxel];
            let distance = (x - piece.centre[0]).pow(2) + (y - piece.centre[1]).pow(2);
            let height = around.height[voxel];
            let inside =
                distance <= piece.radius.pow(2) && height >= piece.height.0 && height <= piece.height.1;
            let along = if verdict.pole { of == POLE } else { height < top };
            if inside || (along && distance <= axis.pow(2)) {
                let found = (distance, piece.slice, piece.first, number);
                taken[voxel] = Some(taken[voxel].map_or(found, |best| best.min(found)));
            }
        });
    }
    let mut trunk = vec![(false, 0); class.len()];
    for (voxel, found) in taken.into_iter().enumerate() {
        let Some((distance, .., number)) = found else { continue };
        let (piece, verdict) = &pieces[number];
        class[voxel] = if verdict.pole { POLE } else { TREE };
        around.shares[voxel] = shares::decided(&around.shares[voxel], class[voxel]);
        let height = around.height[voxel];
        let inside = distance <= piece.radius.pow(2) && height >= piece.height.0 && height <= piece.height.1;
        trunk[voxel] = (true, if inside && !verdict.pole { verdict.chain } else { 0 });
    }
    trunk
}

const NO_BAND: u8 = u8::MAX;

/// The band of height of each low tree voxel.
fn bands(around: &Classified, class: &[u8], lattice: Lattice) -> Vec<u8> {
    let low = lattice.units(LOW_M) as i32;
    let band = lattice.units(BAND_M) as i32;
    let of = |voxel: usize| {
        let above = around.height[voxel] - low;
        if class[voxel] != TREE || above < 0 || above >= band * i32::from(BANDS) {
            return NO_BAND;
        }
        (above / band) as u8
    };
    (0..class.len()).map(of).collect()
}

fn join_classes(around: &Classified, class: &[u8], links: &mut Links<'_>) {
    let columns = &around.voxels.columns;
    let mut finder = columns.finder();
    for (of, radius, levels) in REACHES {
        let window = Window::new(radius, levels);
        for voxel in (0..class.len()).filter(|&voxel| class[voxel] == of && around.voxels.owned[voxel]) {
            let [i, j, k] = around.voxels.key[voxel];
            window.visit(columns, &mut finder, [i, j], k, |other| {
                if class[other] == of && other != voxel {
                    links.join(voxel, other);
                }
            });
        }
    }
}

/// Joins the columns with building voxels that are near each other in the plane.
fn join_buildings(around: &Classified, class: &[u8], links: &mut Links<'_>) {
    let columns = &around.voxels.columns;
    let window = Window::new(BUILDING_REACH, 0);
    let mut finder = columns.finder();
    let first = |column: usize| columns.voxels(column).find(|&voxel| class[voxel] == BUILDING);
    let of_column: Vec<Option<usize>> = (0..columns.cells().len()).map(first).collect();
    for (column, &[i, j]) in columns.cells().iter().enumerate() {
        let Some(voxel) = of_column[column].filter(|&voxel| around.voxels.owned[voxel]) else { continue };
        for other in columns.voxels(column).filter(|&other| class[other] == BUILDING) {
            links.join(voxel, other);
        }
        for [di, dj] in window.steps() {
            let other = finder.number([i + di, j + dj]).and_then(|other| of_column[other]);
            if let Some(other) = other {
                links.join(voxel, other);
            }
        }
    }
}

/// Joins low tree voxels of the same band, and returns voxels of adjacent bands that touch, the lower first.
fn join_bands(around: &Classified, band: &[u8], links: &mut Links<'_>) -> Vec<(usize, usize)> {
    let columns = &around.voxels.columns;
    let mut finder = columns.finder();
    let window = Window::new(2, 2);
    let mut rising = Vec::new();
    for voxel in (0..band.len()).filter(|&voxel| band[voxel] != NO_BAND && around.voxels.owned[voxel]) {
        let [i, j, k] = around.voxels.key[voxel];
        window.visit(columns, &mut finder, [i, j], k, |other| {
            if other == voxel || band[other] == NO_BAND {
                return;
            }
            if band[other] == band[voxel] {
                links.join(voxel, other);
            } else if band[other].abs_diff(band[voxel]) == 1 {
                links.touch(voxel, other);
                let low_first = band[voxel] < band[other];
                rising.push(if low_first { (voxel, other) } else { (other, voxel) });
            }
        });
    }
    rising
}

/// The figures of the components, over the voxels of the tile.
fn figures(around: &Classified, class: &[u8], band: &[u8], parts: &Parts) -> Vec<Option<Part>> {
    let columns = &around.voxels.columns;
    let mut finder = columns.finder();
    let touching = Window::new(1, 1);
    let beside = Window::new(2, 12);
    let canopy = canopies(around, class);
    let mut figures: Vec<Option<Part>> = vec![None; parts.border.count as usize];
    for voxel in (0..class.len()).filter(|&voxel| around.voxels.owned[voxel]) {
        let Some(figure) = figures.get_mut(parts.of[voxel] as usize) else { continue };
        let key @ [i, j, k] = around.voxels.key[voxel];
        let mut one =
            Part::of_voxel(class[voxel], band[voxel], key, around.height[voxel], around.voxels.centre[voxel]);
        if matches!(class[voxel], FENCE | SMALL | VEHICLE) {
            touching.visit(columns, &mut finder, [i, j], k, |other| {
                one.contact += u32::from(matches!(class[other], TREE | BUILDING));
            });
        }
        if matches!(class[voxel], FENCE | SMALL) {
            beside.visit(columns, &mut finder, [i, j], k, |other| {
                one.in_vehicle |= u32::from(class[other] == VEHICLE);
            });
        }
        if band[voxel] != NO_BAND {
            for [di, dj] in canopy.1.steps() {
                if let Some(column) = finder.number([i + di, j + dj]) {
                    one.canopy = one.canopy.max(canopy.0[column]);
                }
            }
        }
        match figure {
            Some(figure) => figure.merge(&one),
            None => *figure = Some(one),
        }
    }
    figures
}

/// The highest tree voxel of each column.
fn canopies(around: &Classified, class: &[u8]) -> (Vec<i32>, Window) {
    let columns = &around.voxels.columns;
    let highest = |column: usize| {
        let trees = columns.voxels(column).filter(|&voxel| class[voxel] == TREE);
        trees.map(|voxel| around.height[voxel]).max().unwrap_or(i32::MIN)
    };
    ((0..columns.cells().len()).map(highest).collect(), Window::new(CANOPY_REACH, 0))
}

/// The cores of the drive.
pub(super) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let lattice = drive.lattice();
    let mut borders = Vec::new();
    let mut figures = Vec::new();
    let mut rising = Vec::new();
    let mut trunks = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: Payload = codec::decode(&drive.payload(STEP_CORES, tile)?)?;
        borders.push(payload.border);
        figures.push(payload.parts);
        rising.push(payload.rising);
        // Which component a trunk voxel is in tells which chain rises from which piece near the ground.
        let pairs: BTreeSet<(u32, u32)> =
            payload.trunks.iter().map(|&(voxel, chain)| (chain, payload.part[voxel as usize])).collect();
        trunks.push(pairs);
    }
    let component = join(&borders);
    let mut whole: BTreeMap<u32, Part> = BTreeMap::new();
    for (component, part) in component.iter().flatten().zip(figures.iter().flatten()) {
        if let Some(part) = part {
            whole.entry(*component).and_modify(|whole| whole.merge(part)).or_insert_with(|| part.clone());
        }
    }
    let rising = component.iter().zip(&rising).flat_map(|(component, rising)| {
        rising.iter().map(|&(low, high)| (component[low as usize], component[high as usize]))
    });
    let chains = component.iter().zip(&trunks).flat_map(|(component, trunks)| {
        trunks.iter().map(|&(chain, part)| (chain, part.checked_sub(1).map(|part| component[part as usize])))
    });
    let stems = seeds::find(&whole, rising, chains, lattice);

    // Labels in the order of first voxels.
    let mut cores: Vec<(Voxel, u8, u64, [i64; 2])> = Vec::new();
    for (&component, part) in whole.iter().filter(|(_, part)| part.band == NO_BAND && keeps(part, lattice)) {
        cores.push((part.first, part.class, u64::from(component), part.centre()));
    }
    for (number, stem) in (0_u64..).zip(&stems.seeds) {
        cores.push((stem.first, TREE, (1 << 32) | number, stem.place));
    }
    cores.sort_unstable();
    let mut of_component: BTreeMap<u32, u32> = BTreeMap::new();
    let mut of_stem = vec![0; stems.seeds.len()];
    for (label, core) in (1_u32..).zip(&cores) {
        match core.2 >> 32 {
            0 => drop(of_component.insert(core.2 as u32, label)),
            _ => of_stem[core.2 as u32 as usize] = label,
        }
    }
    for (component, stem) in &stems.components {
        of_component.insert(*component, of_stem[*stem as usize]);
    }
    let slices: Vec<OfTile> = component
        .iter()
        .zip(&trunks)
        .map(|(component, trunks)| {
            let label = |component: &u32| of_component.get(component).copied().unwrap_or(0);
            let labels: Vec<u32> = component.iter().map(label).collect();
            let mut chains: Vec<(u32, u32)> = trunks
                .iter()
                .filter_map(|(chain, _)| Some((*chain, of_stem[*stems.chains.get(chain)? as usize])))
                .collect();
            chains.dedup();
            let named: BTreeSet<u32> =
                labels.iter().copied().chain(chains.iter().map(|chain| chain.1)).collect();
            let cores = named
                .into_iter()
                .filter(|&label| label != 0)
                .map(|label| {
                    let (_, class, _, place) = cores[label as usize - 1];
                    Core { label, class, place }
                })
                .collect();
            OfTile { labels, chains, cores }
        })
        .collect();
    sliced::encode(&(cores.len() as u32), &slices)
}

/// Whether a component is a core.
fn keeps(part: &Part, lattice: Lattice) -> bool {
    let low = lattice.metres(part.height.0.into());
    let high = lattice.metres(part.height.1.into());
    let tall = high - low;
    let extent = lattice.metres(part.extent());
    let voxels = part.voxels;
    // A small piece with many neighbours in crowns or facades is foliage or a part of a facade.
    let free = voxels >= 80 || f64::from(part.contact) <= 1.5 * f64::from(voxels);
    let in_vehicle = voxels < 150 && f64::from(part.in_vehicle) >= 0.7 * f64::from(voxels);
    let stands = low < 0.8;
    match part.class {
        BUILDING => voxels >= 150 && high > 2.5,
        POLE => tall >= 1.0 && voxels >= 6 && (stands || (low < 1.6 && tall >= 1.5)),
        VEHICLE => voxels >= 60 && extent > 1.5 && stands && free,
        FENCE => voxels >= 12 && stands && free && !in_vehicle,
        SMALL => voxels >= 5 && stands && free && !in_vehicle,
        WIRE => extent >= 3.0,
        _ => false,
    }
}

/// The number of cores of the drive.
pub(super) fn count(global: &[u8]) -> Result<u32> {
    sliced::head(global)
}

const _: () = assert!(CLASSES <= 128, "a class leaves a bit for DECIDED");
