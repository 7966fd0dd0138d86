//! Which buildings are one although they do not touch: what floats belongs to a building beside it, and what
//! lies along the back of a facade belongs to it.
//!
//! A scanner sees a building from one side. A roof behind a parapet, the rear wall of a courtyard and rooms
//! behind windows are pieces that nothing joins to the facade. Houses of a row are apart along the street, so
//! they stay two.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::classified::Classified;
use super::part::Part;
use super::parts::{Links, Parts};
use super::shares::BUILDING;
use super::window::Window;
use crate::cluster::columns::Columns;
use crate::model::Lattice;
use crate::spatial::{Cell, DisjointSets};

/// Buildings are near each other if columns of both lie in cells of so many voxels that are so many cells
/// apart. All pairs up to 3.0 m apart are near, and none beyond 3.6 m. On two labelled scenes, five pieces
/// lie 2.2 to 3.0 m from their building.
const CELL: i32 = 2;
const NEAR_CELLS: i32 = 11;
/// Lowest height above ground of what floats, in metres. Heights of rooms and roofs are measured from the
/// ground before the house, and are up to 2 m lower than they are.
const FLOATS_M: f64 = 2.0;
/// A facade is at least so many times as long as wide. The walls of a detached house are no such facade: what
/// is beside it may be the next house.
const FACADE: i64 = 2;
/// Share of the length of a piece, in percent, that lies along a facade if the piece is behind it.
const ALONG: i64 = 50;

/// The cell of each building column, with its lowest building voxel.
fn cells<'a>(around: &'a Classified, class: &'a [u8]) -> impl Iterator<Item = (Cell, usize)> + 'a {
    let columns = &around.voxels.columns;
    columns.cells().iter().enumerate().filter_map(move |(column, cell)| {
        let lowest = columns.voxels(column).find(|&voxel| class[voxel] == BUILDING)?;
        Some((cell.map(|index| index.div_euclid(CELL)), lowest))
    })
}

/// Numbers in cells, in an order in which they can be looked up.
fn numbered(mut cells: Vec<[i32; 3]>) -> Columns {
    cells.sort_unstable();
    cells.dedup();
    Columns::new(cells.into_iter())
}

/// Names the columns of buildings that are near a building column of another tile. Both tiles name them then.
pub(super) fn touch(around: &Classified, class: &[u8], links: &mut Links<'_>) {
    let owned = |voxel: usize| around.voxels.owned[voxel];
    let sides =
        numbered(cells(around, class).map(|([i, j], voxel)| [i, j, i32::from(owned(voxel))]).collect());
    let window = Window::new(NEAR_CELLS, 0);
    let mut finder = sides.finder();
    for (cell, voxel) in cells(around, class) {
        let mut crosses = false;
        window.visit(&sides, &mut finder, cell, i32::from(!owned(voxel)), |_| crosses = true);
        if crosses {
            links.cross(voxel);
        }
    }
}

/// Pairs of components of buildings that are near each other, each once, the smaller number first.
pub(super) fn near(around: &Classified, class: &[u8], parts: &Parts) -> Vec<(u32, u32)> {
    let named = |([i, j], voxel): (Cell, usize)| Some([i, j, i32::try_from(parts.of[voxel]).ok()?]);
    let components = numbered(cells(around, class).filter_map(named).collect());
    let window = Window::new(NEAR_CELLS, i32::MAX / 4);
    let mut finder = components.finder();
    let mut pairs = BTreeSet::new();
    for (column, &cell) in components.cells().iter().enumerate() {
        for one in components.voxels(column) {
            window.visit(&components, &mut finder, cell, 0, |other| {
                let [one, other] = [one, other].map(|entry| components.heights()[entry].unsigned_abs());
                if one < other {
                    pairs.insert((one, other));
                }
            });
        }
    }
    pairs.into_iter().collect()
}

/// Unites components of `parts` that are near each other in `pairs`. `parts` has one entry for each united
/// component then, under the name of one of its components. Returns this name for all others.
pub(super) fn unite(
    parts: &mut BTreeMap<u32, Part>,
    pairs: &BTreeSet<(u32, u32)>,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let names: Vec<u32> =
        pairs.iter().flat_map(|&(one, other)| [one, other]).collect::<BTreeSet<_>>().into_iter().collect();
    let number = |name: u32| names.binary_search(&name).ok();
    // The largest building that a component is a piece of. Of two that are as large, the one with the first
    // voxel counts.
    let mut whole = vec![None::<(u32, Reverse<[i32; 3]>, u32)>; names.len()];
    for &(one, other) in pairs {
        let (Some(a), Some(b)) = (parts.get(&one), parts.get(&other)) else { continue };
        let size = |part: &Part| (part.voxels, Reverse(part.first));
        let (piece, of) = if size(a) < size(b) { (one, other) } else { (other, one) };
        let (piece_part, of_part) = (&parts[&piece], &parts[&of]);
        if (floats(piece_part, lattice) || behind(piece_part, of_part))
            && let Some(number) = number(piece)
        {
            let (voxels, first) = size(of_part);
            whole[number] = whole[number].max(Some((voxels, first, of)));
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "components of a drive fit u32")]
    let mut sets = DisjointSets::new(names.len() as u32);
    for (piece, of) in (0_u32..).zip(&whole) {
        if let Some(of) = of.and_then(|(.., of)| number(of)) {
            #[expect(clippy::cast_possible_truncation, reason = "components of a drive fit u32")]
            sets.union(piece, of as u32);
        }
    }
    let mut united = BTreeMap::new();
    for (number, &name) in (0_u32..).zip(&names) {
        let root = names[sets.find(number) as usize];
        if root != name
            && let Some(part) = parts.remove(&name)
            && let Some(whole) = parts.get_mut(&root)
        {
            whole.merge(&part);
            united.insert(name, root);
        }
    }
    united
}

/// Whether a component does not reach down to where a wall begins.
fn floats(piece: &Part, lattice: Lattice) -> bool {
    i64::from(piece.height.0) >= lattice.units(FLOATS_M)
}

/// Whether a piece lies along the long side of a facade, in front of it or behind it.
fn behind(piece: &Part, facade: &Part) -> bool {
    let (Some(spans), Some(others)) = (&facade.spans, &piece.spans) else { return false };
    let around = spans.narrowest();
    let overlap = -spans.gap(others, around);
    around.length >= FACADE * around.width && 100 * overlap >= ALONG * others.length(around.along())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::part::NO_BAND;
    use crate::cluster::street::voxels::Voxels;

    /// Walls, each from a place to another one, with their lowest and highest height, in decimetres.
    type Wall = ([i64; 2], [i64; 2], (i64, i64));

    /// Which of these components, each of some walls, are one building.
    fn buildings(components: &[&[Wall]]) -> Vec<Vec<usize>> {
        let lattice = Lattice::MILLIMETRE;
        let places = |&(from, to, (low, high)): &Wall| {
            let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
            let along =
                move |step: i64| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * step / steps);
            (0..=steps).flat_map(move |step| {
                (low..=high).map(move |z| [along(step)[0], along(step)[1], z].map(|d| 100 * d))
            })
        };
        let points: Vec<[i64; 3]> =
            components.iter().flat_map(|walls| walls.iter()).flat_map(places).collect();
        let voxels = Voxels::of_points(lattice, &points);
        let count = voxels.len();
        let mut of = vec![u32::MAX; count];
        let mut parts = BTreeMap::<u32, Part>::new();
        for (number, walls) in (0..).zip(components) {
            for [x, y, z] in walls.iter().flat_map(places) {
                let key = [x, y, z].map(|value| i32::try_from(value.div_euclid(150)).unwrap());
                let voxel = voxels.find(key).unwrap();
                of[voxel] = number;
                let part = Part::of_voxel(BUILDING, NO_BAND, key, i32::try_from(z).unwrap(), [x, y, z]);
                parts.entry(number).and_modify(|whole| whole.merge(&part)).or_insert(part);
            }
        }
        let around = Classified { voxels, height: vec![0; count], shares: vec![[0; 8]; count] };
        let mut links = Links::new(&around.voxels);
        touch(&around, &vec![BUILDING; count], &mut links);
        let mut named = links.finish(&around.voxels, |_| true);
        named.of = of;
        let pairs = near(&around, &vec![BUILDING; count], &named).into_iter().collect();
        let united = unite(&mut parts, &pairs, lattice);
        assert_eq!(parts.len() + united.len(), components.len());
        let whole = |name: u32| united.get(&name).copied().unwrap_or(name);
        let mut all = BTreeMap::<u32, Vec<usize>>::new();
        (0..).zip(0..components.len()).for_each(|(name, at)| all.entry(whole(name)).or_default().push(at));
        all.into_values().collect()
    }

    const FRONT: Wall = ([0, 0], [300, 0], (0, 80));

    #[test]
    fn what_lies_behind_a_facade_is_a_part_of_it() {
        assert_eq!(buildings(&[&[FRONT], &[([100, 28], [280, 28], (0, 40))]]), [vec![0, 1]]);
        // 4 m behind it may be another house.
        assert_eq!(buildings(&[&[FRONT], &[([100, 42], [280, 42], (0, 40))]]), [vec![0], vec![1]]);
    }

    #[test]
    fn houses_of_a_row_stay_apart_and_what_lies_behind_both_joins_the_larger() {
        let next = ([328, 0], [528, 0], (0, 80));
        assert_eq!(buildings(&[&[FRONT], &[next]]), [vec![0], vec![1]]);
        let rear = ([150, 28], [450, 28], (0, 10));
        assert_eq!(buildings(&[&[FRONT], &[next], &[rear]]), [vec![0, 2], vec![1]]);
    }

    #[test]
    fn what_floats_joins_a_house_beside_it_and_what_stands_does_not() {
        let house: &[Wall] = &[([0, 0], [100, 0], (0, 60)), ([100, 0], [100, 90], (0, 60))];
        let beside = |low| ([128, 10], [128, 60], (low, 70));
        assert_eq!(buildings(&[house, &[beside(25)]]), [vec![0, 1]]);
        assert_eq!(buildings(&[house, &[beside(0)]]), [vec![0], vec![1]]);
    }
}
