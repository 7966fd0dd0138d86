//! Which components are several objects: rows of vehicles, and fences with something beside them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use serde::{Deserialize, Serialize};

use super::beside::{self, Beside};
use super::part::Part;
use super::uniting;
use super::vehicles::rows::{self, Row};
use crate::cluster::columns::Voxel;
use crate::cluster::street::shares::{FENCE, VEHICLE};
use crate::model::Lattice;

/// How a component is cut.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Cut {
    Row(Row),
    Beside(Beside),
}

impl Cut {
    /// Number of objects.
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Row(row) => row.count(),
            Self::Beside(beside) => beside.places().len() + 1,
        }
    }

    /// Number of the object at a place, from 0.
    pub(crate) fn number(&self, place: [i64; 2]) -> usize {
        match self {
            Self::Row(row) => row.vehicle(place),
            Self::Beside(beside) => beside.number(place),
        }
    }

    /// Where the objects stand. `middle` is the middle of the component. Every vehicle of a row gets it.
    pub(crate) fn places(&self, middle: [i64; 2]) -> Vec<[i64; 2]> {
        match self {
            Self::Row(row) => vec![middle; row.count()],
            Self::Beside(beside) => [middle].into_iter().chain(beside.places().iter().copied()).collect(),
        }
    }
}

/// Whether a component may be several objects.
pub(crate) fn may_be_cut(part: &Part, lattice: Lattice) -> bool {
    part.spans.as_ref().is_some_and(|spans| match part.class {
        VEHICLE => rows::may_be_row(spans, lattice),
        FENCE => beside::may_be_beside(spans, lattice),
        _ => false,
    })
}

/// The rows among components of vehicles.
pub(crate) fn rows(whole: &BTreeMap<u32, Part>, lattice: Lattice) -> BTreeMap<u32, Row> {
    let row = |part: &Part| match part.class {
        VEHICLE => Row::of(part.spans.as_deref()?, part.footprint.as_deref()?, lattice),
        _ => None,
    };
    whole.iter().filter_map(|(&component, part)| Some((component, row(part)?))).collect()
}

/// The objects beside fences and hedges. Restricts the figures of their components to the line.
pub(crate) fn take_beside(whole: &mut BTreeMap<u32, Part>, lattice: Lattice) -> BTreeMap<u32, Beside> {
    let fences = whole.iter_mut().filter(|(_, part)| part.class == FENCE);
    let found = fences.filter_map(|(&component, part)| {
        let footprint = part.footprint.take()?;
        let beside = Beside::of(part.spans.as_deref()?, &footprint, lattice)?;
        beside.leave_line(part, &footprint);
        Some((component, beside))
    });
    found.collect()
}

/// The first voxel of each component that is cut, before components are united.
pub(crate) fn first_voxels(
    whole: &BTreeMap<u32, Part>,
    rows: &BTreeMap<u32, Row>,
    beside: &BTreeMap<u32, Beside>,
) -> BTreeMap<u32, Voxel> {
    let first = |component: &u32| Some((*component, whole.get(component)?.first));
    rows.keys().chain(beside.keys()).filter_map(first).collect()
}

/// The cuts by the names under which components are after [`uniting`]. Names depend on tiles, so components
/// are taken in the order of `first`, their first voxels. Of two rows of vehicles that were united, the last
/// one counts.
pub(crate) fn by_name(
    rows: BTreeMap<u32, Row>,
    beside: BTreeMap<u32, Beside>,
    first: &BTreeMap<u32, Voxel>,
    united: &BTreeMap<u32, u32>,
) -> BTreeMap<u32, Cut> {
    let name = |component| uniting::by_name(united, component);
    let mut together: BTreeMap<u32, Beside> = BTreeMap::new();
    for (component, beside) in in_order(beside, first) {
        match together.entry(name(component)) {
            Entry::Vacant(entry) => _ = entry.insert(beside),
            Entry::Occupied(mut entry) => entry.get_mut().merge(beside),
        }
    }
    let rows = in_order(rows, first).into_iter().map(|(component, row)| (name(component), Cut::Row(row)));
    rows.chain(together.into_iter().map(|(name, beside)| (name, Cut::Beside(beside)))).collect()
}

/// Components in the order of their first voxels.
fn in_order<T>(components: BTreeMap<u32, T>, first: &BTreeMap<u32, Voxel>) -> Vec<(u32, T)> {
    let mut components: Vec<(u32, T)> = components.into_iter().collect();
    components.sort_by_key(|(component, _)| first.get(component));
    components
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::cores::footprint::centre;
    use crate::cluster::street::cores::part::NO_BAND;
    use crate::cluster::street::settings::EDGE_M;

    const LATTICE: Lattice = Lattice::MILLIMETRE;

    /// A component with these columns of voxels, each so many voxels high.
    fn component(class: u8, columns: impl IntoIterator<Item = ([i32; 2], i32)>) -> Part {
        let edge = LATTICE.units(EDGE_M);
        let voxels = columns.into_iter().flat_map(|(column, high)| (0..high).map(move |k| (column, k)));
        let voxel = |([i, j], k): ([i32; 2], i32)| {
            let [x, y] = centre([i, j], edge);
            let z = i64::from(k) * edge + edge / 2;
            Part::of_voxel(class, NO_BAND, [i, j, k], i32::try_from(z).unwrap(), [x, y, z])
        };
        let merged = voxels.map(voxel).reduce(|mut whole, one| {
            whole.merge(&one);
            whole
        });
        merged.unwrap()
    }

    /// Cars of 4.2 m from `from` on, with bonnets between their roofs.
    fn cars(from: i32, count: i32) -> Part {
        let high = |i: i32| if (i - from) % 28 < 3 { 3 } else { 10 };
        let columns = (from..from + 28 * count).flat_map(|i| (0..12).map(move |j| ([i, j], high(i))));
        component(VEHICLE, columns)
    }

    /// A fence along y = 0 with a bush beside it.
    fn fence(from: i32, bush: i32) -> Part {
        let line = (from..from + 80).map(|i| ([i, 0], 8));
        let beside = (bush..bush + 8).flat_map(|i| (1..8).map(move |j| ([i, j], 6)));
        component(FENCE, line.chain(beside))
    }

    /// The cut of what these components are united to, if they have these names.
    fn cut(parts: &[Part; 2], names: [u32; 2]) -> Cut {
        let mut whole: BTreeMap<u32, Part> = names.into_iter().zip(parts.iter().cloned()).collect();
        let rows = rows(&whole, LATTICE);
        let beside = take_beside(&mut whole, LATTICE);
        assert_eq!(rows.len() + beside.len(), 2, "both are cut");
        let first = first_voxels(&whole, &rows, &beside);
        let united = BTreeMap::from([(names[0].max(names[1]), names[0].min(names[1]))]);
        let mut cuts = by_name(rows, beside, &first, &united);
        assert_eq!(cuts.len(), 1, "they have one name");
        cuts.pop_first().unwrap().1
    }

    #[test]
    fn a_cut_does_not_depend_on_the_names_of_components() {
        let rows = [cars(0, 2), cars(70, 3)];
        assert_eq!(cut(&rows, [0, 1]).count(), 3, "the last one counts");
        assert_eq!(cut(&rows, [1, 0]), cut(&rows, [0, 1]));
        let fences = [fence(0, 20), fence(90, 130)];
        let found = cut(&fences, [0, 1]);
        assert_eq!(found.count(), 3);
        assert_eq!(cut(&fences, [1, 0]), found);
    }
}
