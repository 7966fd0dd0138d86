//! Which stripes are the trail of one moving vehicle.
//!
//! A spinning scanner sees a moving car once in each rotation, each time 1 to 2 m farther on. Away from the
//! scanner these outlines do not touch, and the trail is a line of stripes across the lane. A standing object
//! is seen from many places, so a parked car is hardly ever one of several stripes in a row.

use std::collections::BTreeMap;

use super::lanes;
use super::rows::LOW_TRAIL_M;
use crate::cluster::street::cores::part::Part;
use crate::cluster::street::cores::uniting;
use crate::cluster::street::shares::VEHICLE;
use crate::model::Lattice;

/// Length below which a piece of a vehicle is a stripe, in metres: an outline from behind, together with the
/// part of a side that is seen in one rotation.
const STRIPE_M: f64 = 2.5;
/// Smallest number of voxels of a stripe. Fewer are noise.
const STRIPE_VOXELS: u32 = 3;
/// Smallest number of stripes of a trail.
const STRIPES: usize = 5;
/// Longest gap to the next stripe, in metres: the distance that a car covers in one rotation at 60 km/h.
pub(crate) const GAP_M: f64 = 1.7;
/// Largest width of the box around stripes, in metres: the width of one car.
const WIDTH_M: f64 = 2.3;

/// Joins the stripes of a trail. `parts` and the result are as for [`uniting::unite`].
pub(crate) fn unite(parts: &mut BTreeMap<u32, Part>, lattice: Lattice) -> BTreeMap<u32, u32> {
    let stripe = |part: &Part| {
        let length = part.spans.as_deref().map(|spans| spans.narrowest().length);
        part.class == VEHICLE
            && part.voxels >= STRIPE_VOXELS
            && length.is_some_and(|length| length < lattice.units(STRIPE_M))
    };
    let stripes = parts.iter().filter(|(_, part)| stripe(part));
    let mut lines: BTreeMap<u32, Part> = stripes.map(|(&name, part)| (name, part.clone())).collect();
    let (gap, cost) = (lattice.units(GAP_M), |one: &Part, other: &Part| cost(one, other, lattice));
    let mut joined = uniting::near(&mut lines, |_, _| true, |_| gap, cost, lattice);
    let mut count: BTreeMap<u32, usize> = BTreeMap::new();
    joined.values().for_each(|&name| *count.entry(name).or_insert(1) += 1);
    lines.retain(|name, part| {
        let length = part.spans.as_deref().map_or(0, |spans| spans.narrowest().length);
        count.get(name).is_some_and(|&count| count >= STRIPES) && length >= lattice.units(LOW_TRAIL_M)
    });
    joined.retain(|_, name| lines.contains_key(name));
    parts.retain(|name, _| !joined.contains_key(name));
    parts.extend(lines);
    joined
}

/// The gap between two pieces of a line of stripes; `None` if they are not on one line.
fn cost(one: &Part, other: &Part, lattice: Lattice) -> Option<i64> {
    let (spans, others) = (one.spans.as_deref()?, other.spans.as_deref()?);
    let around = spans.union(others).narrowest();
    let gap = spans.gap(others, around);
    let fits = gap <= lattice.units(GAP_M) && lanes::is_one(around, WIDTH_M, lattice);
    fits.then_some(gap.max(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;

    /// An outline of voxels of 0.15 m, 0.3 m long and 1.8 m wide, at a place in metres.
    fn outline(x: f64, y: f64) -> Part {
        let at = |along: i32, aside: i32| {
            let place = [x + 0.15 * f64::from(along), y + 0.15 * f64::from(aside)];
            let [u, v] = place.map(|metres| Lattice::MILLIMETRE.units(metres));
            let voxel = [u, v].map(|units| i32::try_from(units / 150).unwrap());
            Part::of_voxel(VEHICLE, NO_BAND, [voxel[0], voxel[1], 0], 800, [u, v, 0])
        };
        let mut all = (0..=2).flat_map(|along| (0..=12).map(move |aside| at(along, aside)));
        let first = all.next().unwrap();
        all.fold(first, |mut part, other| {
            part.merge(&other);
            part
        })
    }

    /// The number of pieces that remain when outlines at these places are united.
    fn left(places: impl IntoIterator<Item = (f64, f64)>) -> usize {
        let pieces = places.into_iter().map(|(x, y)| outline(x, y));
        let mut parts: BTreeMap<u32, Part> = (0..).zip(pieces).collect();
        let before = parts.len();
        let united = unite(&mut parts, Lattice::MILLIMETRE);
        assert_eq!(parts.len() + united.len(), before);
        assert!(united.values().all(|root| parts.contains_key(root)), "{united:?}");
        parts.len()
    }

    #[test]
    fn outlines_in_a_line_are_one_trail() {
        let lane = |count: u8, step: f64| (0..count).map(move |number| (step * f64::from(number), 0.0));
        assert_eq!(left(lane(8, 1.4)), 1);
        assert_eq!(left(lane(8, 2.2)), 8, "the gaps are too long");
        assert_eq!(left(lane(4, 1.9)), 4, "too few");
        assert_eq!(left(lane(6, 1.2)), 6, "not longer than a car");
        let next = (0..8_u8).map(|number| (1.4 * f64::from(number) + 0.6, 3.5));
        assert_eq!(left(lane(8, 1.4).chain(next)), 2, "two lanes");
        // The lane of a bend of 120 m.
        let bend = (0..14_u8).map(|number| {
            let angle = 1.4 * f64::from(number) / 120.0;
            (120.0 * angle.sin(), 120.0 - 120.0 * angle.cos())
        });
        assert_eq!(left(bend), 1, "a bend");
    }
}
