//! Which components of buildings are one building: pieces of a facade with a gap, pieces that float beside a
//! building, and pieces along the back of a facade.
//!
//! A scanner sees a building from one side. A roof behind a parapet, the rear wall of a courtyard and rooms
//! behind windows are pieces that nothing joins to the facade. A tree in front of a facade hides a part of
//! it. Houses of a row follow each other along the street: two long pieces that do so are two houses.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::part::Part;
use super::parts::{Links, Parts};
use super::uniting;
use crate::cluster::columns::Columns;
use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::shares::BUILDING;
use crate::cluster::street::spans::Extent;
use crate::cluster::street::window::Window;
use crate::model::Lattice;
use crate::spatial::{Cell, DisjointSets};

/// Edge of a cell in voxels, and largest distance in cells between columns of two buildings that are near
/// each other. All pairs up to 3.0 m apart are near, and none beyond 3.6 m. On two labelled scenes, five
/// pieces lie 2.2 to 3.0 m from their building.
const CELL: i32 = 2;
const NEAR_CELLS: i32 = 11;
/// Largest distance between pieces of a facade, in cells: it includes all pairs up to 1.8 m apart, and none
/// beyond 2.4 m. Pieces of a row that are farther apart are two houses, however short they are.
const FACADE_CELLS: i32 = 7;
/// Shortest front of a house, in metres. Of two pieces that follow each other along the longer one, the
/// shorter one has at most 5.8 m if they are one building (21 of 23 pairs on seven labelled scenes and eight
/// drives), and at least 9.5 m if they are two (33 of 35 pairs).
const HOUSE_M: f64 = 8.0;
/// Largest share of the shorter of two pieces, in percent, that lies along the longer one if they follow each
/// other.
const FOLLOWS: i64 = 25;
/// Smallest mean height of a wall that is seen densely, in metres: the area of its voxels divided by its
/// length. Below it, gaps come from the scan. Houses have at least 2.5 m; on scenes with a tenth of the
/// points, facades have at most 1.6 m.
const SEEN_M: f64 = 1.8;
/// Lowest height above ground of a floating piece, in metres. Heights of rooms and roofs are measured from
/// the ground in front of the house, so they come out up to 2 m too low.
const FLOATS_M: f64 = 2.0;
/// Smallest ratio of length to width of a facade. The walls of a detached house are not such a facade: a
/// piece beside them may be the next house.
const FACADE: i64 = 2;
/// Smallest share of the length of a piece, in percent, that lies along a facade if the piece is behind it.
const ALONG: i64 = 50;

/// Two components of buildings that are near each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Near {
    /// The smaller number first.
    pub(crate) of: (u32, u32),
    /// The smallest squared distance between cells with high columns of both, if it is within
    /// [`FACADE_CELLS`]; otherwise `None`.
    pub(crate) apart: Option<u8>,
}

impl Near {
    /// The pair under other names of its components.
    pub(crate) fn renamed(self, name: impl Fn(u32) -> u32) -> Self {
        let (one, other) = (name(self.of.0), name(self.of.1));
        Self { of: (one.min(other), one.max(other)), ..self }
    }
}

/// The cell of each building column, with its lowest building voxel, and whether its highest voxel is high.
fn cells<'a>(
    around: &'a Classified,
    class: &'a [u8],
    high: i32,
) -> impl Iterator<Item = (Cell, usize, bool)> + 'a {
    let columns = &around.voxels.columns;
    columns.cells().iter().enumerate().filter_map(move |(column, cell)| {
        let mut of_building = columns.voxels(column).filter(|&voxel| class[voxel] == BUILDING);
        let lowest = of_building.next()?;
        let top = of_building.chain([lowest]).map(|voxel| around.height[voxel]).max()?;
        Some((cell.map(|index| index.div_euclid(CELL)), lowest, top >= high))
    })
}

/// Numbers in cells, sorted so that they can be searched.
fn numbered(mut cells: Vec<[i32; 3]>) -> Columns {
    cells.sort_unstable();
    cells.dedup();
    Columns::new(cells.into_iter())
}

/// Names the building columns that are near a building column of another tile. The other tile names them too.
pub(crate) fn touch(around: &Classified, class: &[u8], links: &mut Links<'_>) {
    let owned = |voxel: usize| around.voxels.owned[voxel];
    let side = |([i, j], voxel, _): (Cell, usize, bool)| [i, j, i32::from(owned(voxel))];
    let sides = numbered(cells(around, class, 0).map(side).collect());
    let mut near = Window::new(NEAR_CELLS, 0).over(&sides);
    for (cell, voxel, _) in cells(around, class, 0) {
        let mut crosses = false;
        near.visit(cell, i32::from(!owned(voxel)), |_| crosses = true);
        if crosses {
            links.cross(voxel);
        }
    }
}

/// What a tile knows of a component before it looks for pairs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    /// Whether the component has voxels in the tile.
    pub(crate) is_owned: bool,
    /// Whether it may be a core or a part of one, for another reason than a pair.
    pub(crate) counts: bool,
}

/// Pairs of components of buildings that are near each other, each once. `high` is the height from which a
/// column is high, in lattice units above ground. `known` has an entry for each component.
///
/// Pairs that cannot matter are left out: if neither component has voxels in the tile, another tile has the
/// pair; and a component without high columns is no piece of a facade, so it counts by itself or not at all.
/// A tile of a dense street has more than a million of such pairs.
pub(crate) fn near(
    around: &Classified,
    class: &[u8],
    parts: &Parts,
    high: i32,
    known: &[Known],
) -> Vec<Near> {
    // Twice the number of a component, plus one for its high columns.
    let named = |([i, j], voxel, high): (Cell, usize, bool)| {
        let number = i32::try_from(parts.of[voxel]).ok()?.checked_mul(2)?;
        Some([i, j, number + i32::from(high)])
    };
    let components = numbered(cells(around, class, high).filter_map(named).collect());
    let window = Window::new(NEAR_CELLS, 0);
    let most = FACADE_CELLS * FACADE_CELLS + FACADE_CELLS;
    let mut finder = components.finder();
    let mut may_count: Vec<bool> = known.iter().map(|known| known.counts).collect();
    for [_, _, number] in cells(around, class, high).filter_map(named).filter(|[.., number]| number % 2 == 1)
    {
        may_count[(number / 2).unsigned_abs() as usize] = true;
    }
    let matters = |one: i32, other: i32| {
        let [one, other] = [one, other].map(|number| (number / 2).unsigned_abs() as usize);
        may_count[one] && may_count[other] && (known[one].is_owned || known[other].is_owned)
    };
    let mut pairs = FxHashMap::<(u32, u32), Option<u8>>::default();
    for (column, &[i, j]) in components.cells().iter().enumerate() {
        for [di, dj] in window.steps() {
            let others = finder.column([i + di, j + dj]);
            for other in &components.heights()[others] {
                for one in &components.heights()[components.voxels(column)] {
                    if one / 2 >= other / 2 || !matters(*one, *other) {
                        continue;
                    }
                    let square = di * di + dj * dj;
                    let apart = (one % 2 + other % 2 == 2 && square <= most)
                        .then(|| u8::try_from(square).ok())
                        .flatten();
                    let pair = pairs.entry(((one / 2).unsigned_abs(), (other / 2).unsigned_abs()));
                    pair.and_modify(|known| *known = nearest(*known, apart)).or_insert(apart);
                }
            }
        }
    }
    let mut near: Vec<Near> = pairs.into_iter().map(|(of, apart)| Near { of, apart }).collect();
    near.sort_unstable_by_key(|near| near.of);
    near
}

/// The smaller of two distances, where both may be unknown.
fn nearest(one: Option<u8>, other: Option<u8>) -> Option<u8> {
    one.into_iter().chain(other).min()
}

/// Unites components of `parts` that are near each other according to `pairs`. `parts` then has one entry for
/// each united component, under the name of one of its components. The result maps the other names to this
/// one. `keeps` says which components are buildings by themselves.
pub(crate) fn unite(
    parts: &mut BTreeMap<u32, Part>,
    pairs: Vec<Near>,
    keeps: impl Fn(&Part) -> bool,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let mut near = BTreeMap::<(u32, u32), Option<u8>>::new();
    for Near { of, apart } in pairs.into_iter().filter(|pair| pair.of.0 != pair.of.1) {
        near.entry(of).and_modify(|known| *known = nearest(*known, apart)).or_insert(apart);
    }
    let facades = near.iter().filter_map(|(&(one, other), apart)| Some(((*apart)?.into(), one, other)));
    let mut united = uniting::one_by_one(parts, facades, |one, other| !are_two_houses(one, other, lattice));
    let whole = |name: u32| united.get(&name).copied().unwrap_or(name);
    let is_building = |name: u32| parts.get(&name).is_some_and(&keeps);
    let between: BTreeSet<(u32, u32)> = near
        .keys()
        .map(|&(one, other)| (whole(one), whole(other)))
        .map(|(one, other)| (one.min(other), one.max(other)))
        .filter(|&(one, other)| one != other && is_building(one) && is_building(other))
        .collect();
    let behind = unite_wholes(parts, &between, lattice);
    for name in united.values_mut() {
        *name = behind.get(name).copied().unwrap_or(*name);
    }
    united.extend(behind);
    united
}

/// Unites pieces that float or lie behind a facade with the largest building near them.
fn unite_wholes(
    parts: &mut BTreeMap<u32, Part>,
    pairs: &BTreeSet<(u32, u32)>,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let names: Vec<u32> =
        pairs.iter().flat_map(|&(one, other)| [one, other]).collect::<BTreeSet<_>>().into_iter().collect();
    let number = |name: u32| names.binary_search(&name).ok();
    // The largest building that a component is a piece of. Of two equally large ones, the one with the first
    // voxel wins.
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

/// Whether the lowest voxel of a component is above the height at which walls begin.
fn floats(piece: &Part, lattice: Lattice) -> bool {
    i64::from(piece.height.0) >= lattice.units(FLOATS_M)
}

/// Whether two pieces follow each other along a street, and both are as long as a house and densely seen.
fn are_two_houses(one: &Part, other: &Part, lattice: Lattice) -> bool {
    let (Some(spans), Some(others)) = (&one.spans, &other.spans) else { return false };
    let (extent, of_other) = (spans.narrowest(), others.narrowest());
    let seen = |part: &Part, extent: &Extent| {
        f64::from(part.voxels) * EDGE_M * EDGE_M >= SEEN_M * lattice.metres(extent.length)
    };
    // For two pieces of equal length, the choice does not depend on their order.
    let around = std::cmp::max_by_key(extent, of_other, |extent| (extent.length, *extent));
    let shorter = spans.length(around.along()).min(others.length(around.along()));
    let overlap = -spans.gap(others, around);
    let follows = shorter >= lattice.units(HOUSE_M) && 100 * overlap <= FOLLOWS * shorter;
    follows && seen(one, &extent) && seen(other, &of_other)
}

/// Whether a piece lies along the long side of a facade, in front of it or behind it. The box around a house
/// whose side wall is seen is turned. So a piece that is a facade itself must also lie along the other in its
/// own direction, unless it stands across.
fn behind(piece: &Part, facade: &Part) -> bool {
    let (Some(spans), Some(others)) = (&facade.spans, &piece.spans) else { return false };
    let (around, of_piece) = (spans.narrowest(), others.narrowest());
    let is_facade = |extent: &Extent| extent.length >= FACADE * extent.width;
    let lies_along =
        |extent: Extent| -100 * spans.gap(others, extent) >= ALONG * others.length(extent.along());
    let own = is_facade(&of_piece) && around.is_parallel(&of_piece);
    is_facade(&around) && lies_along(around) && (!own || lies_along(of_piece))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;
    use crate::cluster::street::voxels::stored::Voxels;

    /// A wall from one place to another, with its lowest and highest height, in decimetres.
    type Wall = ([i64; 2], [i64; 2], (i64, i64));

    /// Components that consist of walls each: their voxels, their numbers and their figures.
    fn built(components: &[&[Wall]]) -> (Classified, Parts, BTreeMap<u32, Part>) {
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
        let height = voxels.centre.iter().map(|centre| i32::try_from(centre[2]).unwrap()).collect();
        let around = Classified { voxels, height, shares: vec![[0; 8]; count] };
        let mut links = Links::new(&around.voxels);
        touch(&around, &vec![BUILDING; count], &mut links);
        let mut named = links.finish(&around.voxels, |_| true);
        named.of = of;
        (around, named, parts)
    }

    /// The pairs of components that are near each other.
    fn pairs(around: &Classified, named: &Parts, known: &[Known]) -> Vec<Near> {
        near(around, &vec![BUILDING; named.of.len()], named, 1_800, known)
    }

    /// The components of each building. A component consists of some walls.
    fn buildings(components: &[&[Wall]]) -> Vec<Vec<usize>> {
        let (around, named, mut parts) = built(components);
        let pairs = pairs(&around, &named, &vec![Known { is_owned: true, counts: true }; components.len()]);
        let united = unite(&mut parts, pairs, |part| part.voxels >= 150, Lattice::MILLIMETRE);
        assert_eq!(parts.len() + united.len(), components.len());
        let whole = |name: u32| united.get(&name).copied().unwrap_or(name);
        let mut all = BTreeMap::<u32, Vec<usize>>::new();
        (0..).zip(0..components.len()).for_each(|(name, at)| all.entry(whole(name)).or_default().push(at));
        all.into_values().collect()
    }

    const FRONT: Wall = ([0, 0], [300, 0], (0, 80));

    #[test]
    fn pairs_that_cannot_matter_are_left_out() {
        // The front, a low crumb behind it, and a high piece.
        let crumb = ([100, 10], [101, 10], (2, 3));
        let (around, named, _) = built(&[&[FRONT], &[crumb], &[([104, 10], [106, 10], (30, 40))]]);
        let found = |known: [(bool, bool); 3]| {
            let known = known.map(|(is_owned, counts)| Known { is_owned, counts });
            pairs(&around, &named, &known).into_iter().map(|near| near.of).collect::<Vec<_>>()
        };
        let all = [(0, 1), (0, 2), (1, 2)];
        assert_eq!(found([(true, true), (true, true), (true, true)]), all);
        // The crumb counts only by itself, the high piece also because it is near the front.
        assert_eq!(found([(true, true), (true, false), (true, false)]), [(0, 2)]);
        // Another tile has the pairs of components that have no voxels here.
        assert_eq!(found([(true, true), (false, true), (false, true)]), [(0, 1), (0, 2)]);
    }

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
    fn long_pieces_that_follow_each_other_are_two_houses() {
        let from_to = |from, to, top| ([from, 0], [to, 0], (0, top));
        let next = from_to(312, 500, 80);
        assert_eq!(buildings(&[&[FRONT], &[next]]), [vec![0], vec![1]]);
        // A tree hides a metre of a facade: one of the two pieces is not a house.
        assert_eq!(buildings(&[&[FRONT], &[from_to(312, 360, 80)]]), [vec![0, 1]]);
        // The wall beside it runs along the alley and is not a front.
        assert_eq!(buildings(&[&[FRONT], &[([312, 0], [312, 90], (0, 80))]]), [vec![0, 1]]);
        // A pillar in the alley does not join them.
        assert_eq!(
            buildings(&[&[FRONT], &[([310, 0], [314, 0], (0, 80))], &[from_to(321, 500, 80)]]),
            [vec![0, 1], vec![2]]
        );
        // Too little is seen of these walls to call them two houses.
        let low = |from, to| ([from, 0], [to, 0], (18, 24));
        assert_eq!(buildings(&[&[low(0, 300)], &[low(312, 500)]]), [vec![0, 1]]);
        // A low wall joins nothing.
        assert_eq!(buildings(&[&[FRONT], &[from_to(312, 360, 10)]]), [vec![0], vec![1]]);
    }

    #[test]
    fn what_floats_joins_a_house_beside_it_and_what_stands_does_not() {
        let house: &[Wall] = &[([0, 0], [100, 0], (0, 60)), ([100, 0], [100, 90], (0, 60))];
        let beside = |low| ([128, 10], [128, 60], (low, 70));
        assert_eq!(buildings(&[house, &[beside(25)]]), [vec![0, 1]]);
        assert_eq!(buildings(&[house, &[beside(0)]]), [vec![0], vec![1]]);
    }
}
