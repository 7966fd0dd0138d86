//! Which components are near each other, by the boxes around them.

use std::collections::{BTreeMap, BTreeSet};

use super::part::Part;
use crate::model::Lattice;

/// Edge of the blocks by which boxes are searched, in metres: a few vehicles or pieces of a fence.
const BLOCK_M: f64 = 16.0;

/// Pairs of positions in `parts` whose boxes are at most `reach` apart in x and in y. Each pair is listed
/// once, in ascending order, and has one class. `reach` gives the reach of a class, in lattice units.
pub(crate) fn pairs(
    parts: &[&Part],
    reach: impl Fn(u8) -> i64,
    lattice: Lattice,
) -> impl Iterator<Item = (u32, u32)> {
    let block = lattice.units(BLOCK_M);
    let blocks = |part: &Part, beyond: i64| {
        let [from, to] = [(part.min, -beyond), (part.max, beyond)]
            .map(|(corner, by)| corner.map(|at| (at + by).div_euclid(block)));
        (from[0]..=to[0]).flat_map(move |i| (from[1]..=to[1]).map(move |j| [i, j]))
    };
    let mut within: BTreeMap<(u8, [i64; 2]), Vec<u32>> = BTreeMap::new();
    for (number, part) in (0_u32..).zip(parts) {
        blocks(part, 0).for_each(|at| within.entry((part.class, at)).or_default().push(number));
    }
    let mut found = BTreeSet::new();
    for (number, part) in (0_u32..).zip(parts) {
        let reach = reach(part.class);
        for other in blocks(part, reach).filter_map(|at| within.get(&(part.class, at))).flatten() {
            let near = |axis: usize| apart(part, parts[*other as usize], axis) <= reach;
            if number < *other && near(0) && near(1) {
                found.insert((number, *other));
            }
        }
    }
    found.into_iter()
}

/// The gap between two boxes along an axis, in lattice units; negative where they overlap.
fn apart(one: &Part, other: &Part, axis: usize) -> i64 {
    one.min[axis].max(other.min[axis]) - one.max[axis].min(other.max[axis])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;
    use crate::cluster::street::shares::{FENCE, VEHICLE};

    fn reach(class: u8) -> i64 {
        if class == FENCE { 25_000 } else { 1_700 }
    }

    proptest! {
        /// Equal to a comparison of all pairs, with boxes on both sides of zero and longer than a block.
        #[test]
        fn equal_to_brute_force(
            boxes in prop::collection::vec(
                (any::<bool>(), [-60_000..60_000_i64, -60_000..60_000_i64], [0..50_000_i64, 0..9_000_i64]),
                0..40,
            ),
        ) {
            let part = |&(is_fence, from, size): &(bool, [i64; 2], [i64; 2])| {
                let class = if is_fence { FENCE } else { VEHICLE };
                let corner = |at: [i64; 2]| Part::of_voxel(class, NO_BAND, [0, 0, 0], 0, [at[0], at[1], 0]);
                let mut part = corner(from);
                part.merge(&corner([from[0] + size[0], from[1] + size[1]]));
                part
            };
            let parts: Vec<Part> = boxes.iter().map(part).collect();
            let mut expected = Vec::new();
            for (number, one) in (0_u32..).zip(&parts) {
                for (next, other) in (0_u32..).zip(&parts).skip(number as usize + 1) {
                    let near = |axis: usize| {
                        other.min[axis] - one.max[axis] <= reach(one.class)
                            && one.min[axis] - other.max[axis] <= reach(one.class)
                    };
                    if one.class == other.class && near(0) && near(1) {
                        expected.push((number, next));
                    }
                }
            }
            let parts: Vec<&Part> = parts.iter().collect();
            prop_assert_eq!(pairs(&parts, reach, Lattice::MILLIMETRE).collect::<Vec<_>>(), expected);
        }
    }
}
