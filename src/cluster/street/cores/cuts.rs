//! Which components are several objects: rows of vehicles, and fences with something beside them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use serde::{Deserialize, Serialize};

use super::beside::{self, Beside};
use super::part::Part;
use super::uniting;
use super::vehicles::rows::{self, Row};
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

/// The cuts, by the names that components have after [`uniting`]. Of two united rows of vehicles, the last
/// one wins.
pub(crate) fn by_name(
    rows: BTreeMap<u32, Row>,
    beside: BTreeMap<u32, Beside>,
    united: &BTreeMap<u32, u32>,
) -> BTreeMap<u32, Cut> {
    let name = |component| uniting::by_name(united, component);
    let mut together: BTreeMap<u32, Beside> = BTreeMap::new();
    for (component, beside) in beside {
        match together.entry(name(component)) {
            Entry::Vacant(entry) => _ = entry.insert(beside),
            Entry::Occupied(mut entry) => entry.get_mut().merge(beside),
        }
    }
    let rows = rows.into_iter().map(|(component, row)| (name(component), Cut::Row(row)));
    rows.chain(together.into_iter().map(|(name, beside)| (name, Cut::Beside(beside)))).collect()
}
