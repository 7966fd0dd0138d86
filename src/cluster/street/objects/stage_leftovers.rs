//! Step `leftovers`: voxels that no core reaches. Their components join the nearest object of a class that
//! they may have, or become objects of their own.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile and components of a drive fit u32")]

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cluster::columns::{Border, Columns, Voxel, join};
use crate::cluster::street::classes::classified::Shares;
use crate::cluster::street::cores::parts::Links;
use crate::cluster::street::growth::stage_growth::Grown;
use crate::cluster::street::settings::{CLASSES, EDGE_M, STEP_LEFTOVERS};
use crate::cluster::street::shares::{BUILDING, FENCE, GROUND, TREE};
use crate::cluster::street::voxels::stored::Voxels;
use crate::cluster::street::window::{Visitor, Window};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::Result;
use crate::model::{Lattice, TileId};
use crate::spatial::Cell;

/// Largest distance between leftover voxels of one component, in voxels in the plane and in levels.
const JOIN: (i32, i32) = (4, 4);
/// Largest number of voxels within [`JOIN`] of a sparse leftover voxel, itself included. With 20 instead,
/// single sweeps have the same figures (`benches/results/street.md`, "Few points").
const SPARSE: u32 = 12;
/// Largest distance between sparse voxels of one component, in the same units: far from a spinning scanner,
/// its rings are one to two metres apart.
const JOIN_SPARSE: (i32, i32) = (4, 10);
/// Largest distance at which a component joins an object that it may be a part of, in metres.
const NEAR_M: f64 = 1.5;
/// Mean share of the class of this object in the component above which it may join, in steps of 1/255.
const NEAR_SHARE: u64 = 51;
/// Smallest number of voxels of an object without a core: of trees and buildings, and of other classes. It
/// excludes crumbs. The model decides whether a larger piece is a far tree or the tip of a branch
/// (`wholes.rs`).
const OWN_VOXELS: (u32, u32) = (20, 12);
/// Height of the lowest voxel above ground from which a fence hangs, in metres. On eleven labelled drives,
/// seven of seven fences that hang higher were pieces of balconies and crowns.
const HANGS_M: f64 = 1.0;
/// Largest distance at which a component of the class tree or building joins an object of its class, in
/// metres, and the number of points from which it does not join but is an object of its own.
const FAR_M: f64 = 3.0;
const FAR_POINTS: u64 = 1000;

/// An object near a component: squared distance, key of its voxel, and label.
type Near = (i64, Voxel, u32);

/// Figures of a component over the voxels of one tile.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Left {
    first: Option<Voxel>,
    /// Lowest height above ground, in lattice units.
    lowest: Option<i32>,
    voxels: u32,
    points: u64,
    shares: [u64; CLASSES],
    /// The nearest object of each class.
    near: [Option<Near>; CLASSES],
}

/// The smaller value, or the only one if one is missing.
fn least<T: Ord>(one: Option<T>, other: Option<T>) -> Option<T> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    }
}

impl Left {
    fn merge(&mut self, other: &Self) {
        self.first = least(self.first, other.first);
        self.lowest = least(self.lowest, other.lowest);
        self.voxels += other.voxels;
        self.points += other.points;
        for class in 0..CLASSES {
            self.shares[class] += other.shares[class];
            self.near[class] = least(self.near[class], other.near[class]);
        }
    }

    /// The class with the largest sum of shares.
    fn class(&self) -> u8 {
        let best = (0..CLASSES).rev().max_by_key(|&class| self.shares[class]);
        best.unwrap_or(usize::from(GROUND)) as u8
    }

    /// Whether its class is fence and it does not stand on the ground.
    fn hangs(&self, lattice: Lattice) -> bool {
        let low = self.lowest.map_or(0, i64::from);
        self.class() == FENCE && low >= lattice.units(HANGS_M)
    }

    /// Whether the component may be an object of its own.
    fn stands_alone(&self, lattice: Lattice) -> bool {
        match self.class() {
            GROUND => false,
            FENCE if self.hangs(lattice) => false,
            TREE | BUILDING => self.voxels >= OWN_VOXELS.0,
            _ => self.voxels >= OWN_VOXELS.1,
        }
    }

    /// Label and class of the object that the component joins.
    fn joins(&self, lattice: Lattice) -> Option<(u32, u8)> {
        let within = |near: &Near, metres: f64| near.0 <= lattice.units(metres).pow(2);
        let hangs = self.hangs(lattice);
        let may_be = |class: usize| hangs || self.shares[class] > NEAR_SHARE * u64::from(self.voxels);
        let near = (0_u8..).zip(&self.near).filter(|(class, _)| may_be(usize::from(*class)));
        let near = near.filter_map(|(class, near)| Some((near.as_ref().copied()?, class)));
        let nearest = near.filter(|(near, _)| within(near, NEAR_M)).min();
        let class = self.class();
        let far = self.near[usize::from(class)]
            .filter(|_| matches!(class, TREE | BUILDING) && self.points < FAR_POINTS)
            .map(|near| (near, class));
        nearest.or(far.filter(|(near, _)| within(near, FAR_M))).map(|((_, _, label), class)| (label, class))
    }
}

/// The payload of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Payload {
    /// Component of each voxel of the tile plus one, or 0.
    part: Vec<u32>,
    parts: Vec<Left>,
    border: Border,
}

/// Components of the voxels that no core reaches.
pub(crate) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let lattice = tile.lattice();
    let grown = Grown::load(tile, lattice.units_up(FAR_M), &[])?;
    let around = &grown.cored.around;
    let voxels = &around.voxels;
    let left: Vec<bool> = (0..grown.label.len())
        .map(|voxel| grown.label[voxel] == 0 && around.shares[voxel][usize::from(GROUND)] <= 127)
        .collect();
    let mut links = Links::new(voxels);
    let sparse = sparse(voxels, &left);
    let mut near = Window::new(JOIN.0, JOIN.1).over(&voxels.columns);
    let mut far = Window::new(JOIN_SPARSE.0, JOIN_SPARSE.1).over(&voxels.columns);
    for voxel in (0..left.len()).filter(|&voxel| left[voxel] && voxels.owned[voxel]) {
        let [i, j, k] = voxels.key[voxel];
        near.visit([i, j], k, |other| {
            if left[other] && other != voxel {
                links.join(voxel, other);
            }
        });
        if sparse[voxel] {
            far.visit([i, j], k, |other| {
                if sparse[other] && other != voxel {
                    links.join(voxel, other);
                }
            });
        }
    }
    let parts = links.finish(voxels, |voxel| left[voxel]);
    let mut payload = Payload {
        parts: vec![Left::default(); parts.border.count as usize],
        border: parts.border,
        ..Payload::default()
    };
    let far = lattice.units(FAR_M);
    let mut search = Nearest { rings: rings(&voxels.columns, far, lattice), grown: &grown };
    for voxel in (0..left.len()).filter(|&voxel| voxels.owned[voxel]) {
        payload.part.push(parts.of[voxel].wrapping_add(1));
        let Some(part) = payload.parts.get_mut(parts.of[voxel] as usize) else { continue };
        let mut one = Left {
            first: Some(voxels.key[voxel]),
            lowest: Some(around.height[voxel]),
            voxels: 1,
            points: u64::from(voxels.points[voxel]),
            shares: around.shares[voxel].map(u64::from),
            near: [None; CLASSES],
        };
        search.objects(voxel, &mut one.near);
        part.merge(&one);
    }
    Ok(Mapped::payload(codec::encode(&payload)?))
}

/// The leftover voxels with few others around them. The result is right for all voxels that may be joined to
/// a voxel of the tile: twice the radius of [`JOIN`] around it would be enough, and [`FAR_M`] is read.
fn sparse(voxels: &Voxels, left: &[bool]) -> Vec<bool> {
    let mut near = Window::new(JOIN.0, JOIN.1).over(&voxels.columns);
    let mut is_sparse = |voxel: usize| {
        let [i, j, k] = voxels.key[voxel];
        let mut count = 0;
        near.visit([i, j], k, |_| count += 1);
        count <= SPARSE
    };
    (0..left.len()).map(|voxel| left[voxel] && is_sparse(voxel)).collect()
}

/// Windows of growing size, each with the distance up to which it contains all voxels.
fn rings(columns: &Columns, far: i64, lattice: Lattice) -> Vec<(Visitor<'_>, i64)> {
    let edge = lattice.units(EDGE_M);
    let most = (far / edge) as i32 + 1;
    let mut rings = Vec::new();
    let mut steps = 2;
    while steps < most {
        rings.push((Window::square(steps).over(columns), i64::from(steps - 1) * edge));
        steps *= 2;
    }
    rings.push((Window::square(most).over(columns), far));
    rings
}

/// Finds objects near a voxel.
struct Nearest<'a> {
    rings: Vec<(Visitor<'a>, i64)>,
    grown: &'a Grown,
}

impl Nearest<'_> {
    /// The nearest object of each class in the first window with an object.
    fn objects(&mut self, voxel: usize, near: &mut [Option<Near>; CLASSES]) {
        let voxels = &self.grown.cored.around.voxels;
        let [i, j, k] = voxels.key[voxel];
        let [x, y, z] = voxels.centre[voxel];
        for (window, certain) in &mut self.rings {
            window.visit([i, j], k, |other| {
                let label = self.grown.label[other];
                let Some(core) = self.grown.cored.cores.get(&label) else { return };
                let [u, v, w] = voxels.centre[other];
                let distance = (u - x).pow(2) + (v - y).pow(2) + (w - z).pow(2);
                if distance <= certain.pow(2) {
                    let found = (distance, voxels.key[other], label);
                    let best = &mut near[usize::from(core.class)];
                    *best = Some(best.map_or(found, |best| best.min(found)));
                }
            });
            if near.iter().any(Option::is_some) {
                break;
            }
        }
    }
}

/// The label of the object that each component joins or becomes, or 0, and its class.
pub(crate) fn reduce(drive: &dyn DriveWindow, cores: u32, smallest: u64) -> Result<Vec<u8>> {
    let lattice = drive.lattice();
    let mut borders = Vec::new();
    let mut figures = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: Payload = codec::decode(&drive.payload(STEP_LEFTOVERS, tile)?)?;
        borders.push(payload.border);
        figures.push(payload.parts);
    }
    let component = join(&borders);
    let mut whole: BTreeMap<u32, Left> = BTreeMap::new();
    for (component, part) in component.iter().flatten().zip(figures.iter().flatten()) {
        whole.entry(*component).or_default().merge(part);
    }
    // Label and class.
    let mut label: BTreeMap<u32, (u32, u8)> = BTreeMap::new();
    let mut own: Vec<(Option<Voxel>, u32, u8)> = Vec::new();
    for (&component, part) in &whole {
        if let Some(joined) = part.joins(lattice) {
            label.insert(component, joined);
        } else if part.points >= smallest && part.stands_alone(lattice) {
            own.push((part.first, component, part.class()));
        }
    }
    own.sort_unstable();
    for (number, (_, component, class)) in (cores + 1..).zip(&own) {
        label.insert(*component, (number, *class));
    }
    let of = |component: &u32| label.get(component).copied().unwrap_or((0, 0));
    let slices: Vec<Vec<(u32, u8)>> =
        component.iter().map(|component| component.iter().map(of).collect()).collect();
    sliced::encode(&(cores + own.len() as u32), &slices)
}

/// The objects of the voxels around a tile, complete.
pub(crate) struct Whole {
    pub(crate) grown: Grown,
    /// Class of each label of a voxel.
    pub(crate) class: BTreeMap<u32, u8>,
}

impl Whole {
    /// Objects with labels from 1, each a class and a block of points 0.1 m apart from a corner, in
    /// decimetres. For tests.
    #[cfg(test)]
    pub(crate) fn of_blocks(blocks: &[(u8, [i64; 3], [i64; 3])]) -> Self {
        use crate::cluster::street::classes::classified::Classified;
        use crate::cluster::street::cores::stage_cores::Cored;
        let points = |&(_, from, [x, y, z]): &(u8, [i64; 3], [i64; 3])| {
            let steps = (0..x).flat_map(move |i| (0..y).flat_map(move |j| (0..z).map(move |k| [i, j, k])));
            steps.map(move |step| [0, 1, 2].map(|axis| 100 * (from[axis] + step[axis]))).collect::<Vec<_>>()
        };
        let all: Vec<[i64; 3]> = blocks.iter().flat_map(points).collect();
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &all);
        let count = voxels.len();
        let mut label = vec![0; count];
        let mut height = vec![0; count];
        for (number, block) in (1..).zip(blocks) {
            for point in points(block) {
                let key = point.map(|value| i32::try_from(value.div_euclid(150)).unwrap());
                let voxel = voxels.find(key).unwrap();
                label[voxel] = number;
                height[voxel] = i32::try_from(point[2]).unwrap();
            }
        }
        let around = Classified { voxels, height, shares: vec![[0; 8]; count] };
        let cored = Cored { around, class: vec![0; count], label: vec![0; count], cores: BTreeMap::new() };
        let class = (1..).zip(blocks.iter().map(|block| block.0)).collect();
        Self { grown: Grown { cored, label }, class }
    }

    /// Loads the voxels within `reach` of a tile, and those of the columns `also`.
    pub(crate) fn load(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        let mut grown = Grown::load(tile, reach, also)?;
        let mut class: BTreeMap<u32, u8> =
            grown.cored.cores.iter().map(|(label, core)| (*label, core.class)).collect();
        for (near, places) in grown.cored.around.voxels.by_tile() {
            let payload: Payload = codec::decode(&tile.payload(STEP_LEFTOVERS, near)?)?;
            let labels: Vec<(u32, u8)> = sliced::slice(tile.global(STEP_LEFTOVERS), near)?;
            for &(voxel, at) in &places {
                let Some(part) = payload.part[voxel as usize].checked_sub(1) else { continue };
                let (label, of) = labels[part as usize];
                grown.label[at as usize] = label;
                if label != 0 {
                    // A tile may see no voxel of the core of this object.
                    class.insert(label, of);
                }
            }
        }
        Ok(Self { grown, class })
    }

    /// The shares of a voxel.
    pub(crate) fn shares(&self, voxel: usize) -> &Shares {
        &self.grown.cored.around.shares[voxel]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_rings_are_sparse_and_a_wall_is_not() {
        // Two rings of five points, 1.2 m above each other, and a wall of 2 m.
        let ring = |z: i64| (0..5).map(move |n| [200 * n, 0, z]);
        let wall = (0..14).flat_map(|n| (0..14).map(move |m| [9_000 + 150 * n, 0, 150 * m]));
        let points: Vec<[i64; 3]> = ring(1_000).chain(ring(2_200)).chain(wall).collect();
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &points);
        let found = sparse(&voxels, &vec![true; voxels.len()]);
        for (key, sparse) in voxels.key.iter().zip(found) {
            assert_eq!(sparse, key[0] < 30, "{key:?}");
        }
        // Voxels with a core are not leftovers, but they count as neighbours of leftovers.
        let left: Vec<bool> = voxels.key.iter().map(|key| key[0] == 60).collect();
        assert!(!sparse(&voxels, &left).contains(&true));
    }

    #[test]
    fn a_far_tree_stands_alone_and_a_crumb_does_not() {
        let left = |voxels: u32, class: u8| {
            let mut left = Left { voxels, points: u64::from(voxels), ..Left::default() };
            left.shares[usize::from(class)] = 200 * u64::from(voxels);
            left
        };
        let stands = |voxels, class| left(voxels, class).stands_alone(Lattice::MILLIMETRE);
        assert!(stands(20, TREE) && stands(20, BUILDING) && stands(12, FENCE));
        assert!(!stands(19, TREE) && !stands(19, BUILDING) && !stands(11, FENCE) && !stands(99, GROUND));
    }
}
