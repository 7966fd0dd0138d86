//! Which pieces are the trail that a moving vehicle leaves in the points of a spinning scanner.
//!
//! A rotation takes 0.1 s, in which a car moves on by 1 to 2 m. Near the scanner its outlines overlap, and
//! the trail is one component that is longer than any vehicle of its height. Farther away each rotation sees
//! its front or its rear alone, and the trail ends in stripes across the lane. The box of a car contains
//! three or four of them, so they look like cars. Stripes join a trail one after another while they continue
//! along its line. The remaining stripes join each other, see [`super::stripes`].

use std::collections::BTreeMap;

use super::lanes::ASIDE_M;
use super::rows::{self, OUTLINE, Row};
use super::stripes::{self, GAP_M};
use crate::cluster::street::cores::part::Part;
use crate::cluster::street::cores::uniting;
use crate::cluster::street::shares::VEHICLE;
use crate::cluster::street::spans::Extent;
use crate::model::Lattice;

/// Length below which a piece is a stripe, in metres: it is shorter than the shortest car. A longer piece is
/// a stripe if it has as few voxels as an outline.
const STRIPE_M: f64 = 3.0;
/// Largest overlap of a stripe with the trail along its line, in metres. A piece beside a trail is another
/// vehicle.
const WITHIN_M: f64 = 1.0;

/// Joins stripes to trails, then to each other, and these lines to trails. `parts` and the result are as for
/// [`uniting::unite`]. Rows without a trail are parked cars. Nothing joins them.
pub(crate) fn unite(
    parts: &mut BTreeMap<u32, Part>,
    rows: &BTreeMap<u32, Row>,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let mut united = go_on(parts, rows, lattice);
    uniting::go_on(&mut united, stripes::unite(parts, lattice));
    uniting::go_on(&mut united, go_on(parts, rows, lattice));
    united
}

/// Joins to each trail the pieces that continue along its line.
fn go_on(parts: &mut BTreeMap<u32, Part>, rows: &BTreeMap<u32, Row>, lattice: Lattice) -> BTreeMap<u32, u32> {
    let mut united = BTreeMap::new();
    let parked = |name: u32| rows.get(&name).is_some_and(|row| !row.has_trail());
    // A stripe can join only after the piece that it follows has joined. So there is a round for each stripe
    // of the longest end.
    loop {
        let moves = |name: u32, part: &Part| part.class == VEHICLE && !parked(name);
        let (gap, cost) = (lattice.units(GAP_M), |one: &Part, other: &Part| cost(one, other, lattice));
        let joined = uniting::near(parts, moves, |_| gap, cost, lattice);
        if joined.is_empty() {
            return united;
        }
        uniting::go_on(&mut united, joined);
    }
}

fn is_trail((part, extent): (&Part, Extent), lattice: Lattice) -> bool {
    rows::is_trail(extent.length, part.height.1, lattice)
}

/// Voxels per lattice unit of length.
#[expect(clippy::cast_precision_loss, reason = "a length of vehicles")]
fn density((part, extent): (&Part, Extent)) -> f64 {
    f64::from(part.voxels) / extent.length.max(1) as f64
}

/// The gap between a trail and a stripe that continues along its line; `None` for any other pair.
fn cost(one: &Part, other: &Part, lattice: Lattice) -> Option<i64> {
    let (spans, others) = (one.spans.as_deref()?, other.spans.as_deref()?);
    let (mut trail, mut stripe) = ((one, spans.narrowest()), (other, others.narrowest()));
    let order = |of| (is_trail(of, lattice), density(of));
    // A line of stripes is as long as a trail. So of two trails, the sparser one is taken as the stripe.
    if order(stripe) > order(trail) {
        std::mem::swap(&mut trail, &mut stripe);
    }
    let is_stripe = stripe.1.length < lattice.units(STRIPE_M) || density(stripe) < OUTLINE * density(trail);
    if !is_trail(trail, lattice) || !is_stripe {
        return None;
    }
    let around = spans.union(others).narrowest();
    let gap = spans.gap(others, around);
    let goes_on = (-lattice.units(WITHIN_M)..=lattice.units(GAP_M)).contains(&gap);
    let in_lane = around.width <= trail.1.width + lattice.units(ASIDE_M);
    (goes_on && in_lane).then_some(gap.max(0))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;

    /// A vehicle with voxels of 0.15 m in a box, in metres.
    fn vehicle(from: [f64; 2], to: [f64; 2]) -> Part {
        let edge = Lattice::MILLIMETRE.units(0.15);
        let [from, to] = [from, to].map(|place| place.map(|metres| Lattice::MILLIMETRE.units(metres)));
        let steps = |axis: usize| (from[axis]..=to[axis]).step_by(usize::try_from(edge).unwrap());
        let voxel = |place: [i64; 2]| {
            let [i, j] = place.map(|at| i32::try_from(at / edge).unwrap());
            Part::of_voxel(VEHICLE, NO_BAND, [i, j, 0], 800, [place[0], place[1], 0])
        };
        let mut all = steps(0).flat_map(|x| steps(1).map(move |y| voxel([x, y])));
        let first = all.next().unwrap();
        all.fold(first, |mut part, other| {
            part.merge(&other);
            part
        })
    }

    /// The number of pieces that remain, with the components that joined another.
    fn united(pieces: Vec<Part>) -> (usize, BTreeMap<u32, u32>) {
        let mut parts: BTreeMap<u32, Part> = (0..).zip(pieces).collect();
        let united = unite(&mut parts, &BTreeMap::new(), Lattice::MILLIMETRE);
        assert!(united.values().all(|root| parts.contains_key(root)), "{united:?}");
        (parts.len(), united)
    }

    proptest! {
        /// Names depend on tiles, but the pieces of a trail do not.
        #[test]
        fn names_do_not_matter(
            places in prop::collection::btree_map((0..70_u8, 0..3_u8), 1..25_u8, 1..12),
            order in any::<prop::sample::Index>(),
        ) {
            let mut pieces = vec![vehicle([10.0, 0.0], [30.0, 1.8]), vehicle([34.0, 1.5], [50.0, 3.3])];
            // No two pieces have the same first voxel, as in real components.
            pieces.extend(places.iter().map(|(&(x, y), &length)| {
                let [x, y] = [f64::from(x), 0.3 + f64::from(y)];
                vehicle([x, y], [x + 0.15 * f64::from(length), y + 1.2])
            }));
            let groups = |pieces: Vec<Part>| {
                let mut parts: BTreeMap<u32, Part> = (0..).zip(pieces).collect();
                let _ = unite(&mut parts, &BTreeMap::new(), Lattice::MILLIMETRE);
                let mut groups: Vec<_> =
                    parts.values().map(|part| (part.first, part.voxels, part.min, part.max)).collect();
                groups.sort_unstable();
                groups
            };
            let expected = groups(pieces.clone());
            let first = order.index(pieces.len());
            pieces.rotate_left(first);
            prop_assert_eq!(&groups(pieces.clone()), &expected);
            pieces.reverse();
            prop_assert_eq!(&groups(pieces), &expected);
        }
    }

    #[test]
    fn stripes_go_on_along_a_trail() {
        let stripe = |x: f64| vehicle([x, 0.0], [x + 0.3, 1.8]);
        let trail = || vehicle([10.0, 0.0], [40.0, 1.8]);
        // The farthest one comes first, so that it can only join after the others.
        let (left, of) = united(vec![stripe(6.0), stripe(7.2), stripe(8.5), trail(), stripe(41.5)]);
        assert_eq!(left, 1);
        assert_eq!(of, BTreeMap::from([(1, 0), (2, 0), (3, 0), (4, 0)]));
        assert_eq!(united(vec![stripe(5.0), trail()]).0, 2, "the gap is too long");
        assert_eq!(united(vec![stripe(0.0), stripe(1.2), stripe(2.4)]).0, 3, "there is no trail");
        assert_eq!(united(vec![trail(), stripe(41.2), vehicle([42.5, 0.0], [80.0, 1.8])]).0, 2, "two cars");
    }

    #[test]
    fn a_row_of_parked_cars_is_no_trail() {
        let mut row = vehicle([0.0, 0.0], [4.5, 1.8]);
        row.merge(&vehicle([5.0, 0.0], [9.5, 1.8]));
        row.merge(&vehicle([10.0, 0.0], [14.5, 1.8]));
        let of = Row::of(row.spans.as_ref().unwrap(), row.footprint.as_ref().unwrap(), Lattice::MILLIMETRE);
        let rows = BTreeMap::from([(0, of.unwrap())]);
        let mut parts = BTreeMap::from([(0, row), (1, vehicle([15.5, 0.0], [16.0, 1.8]))]);
        assert_eq!(unite(&mut parts, &rows, Lattice::MILLIMETRE), BTreeMap::new());
    }

    #[test]
    fn a_parked_car_is_not_a_stripe() {
        let trail = || vehicle([10.0, 0.0], [40.0, 1.8]);
        let stripe = || vehicle([5.0, 0.0], [7.0, 1.8]);
        assert_eq!(united(vec![vehicle([5.0, 0.0], [9.0, 1.8]), trail()]).0, 2, "it is longer");
        assert_eq!(united(vec![vehicle([5.0, 0.0], [9.0, 0.3]), trail()]).0, 1, "an outline");
        assert_eq!(united(vec![vehicle([20.0, 2.4], [22.0, 4.2]), trail()]).0, 2, "it is beside the trail");
        let mut bus = vehicle([8.0, 0.0], [19.0, 2.4]);
        bus.height.1 = 3_100;
        assert_eq!(united(vec![vehicle([5.0, 0.0], [7.0, 1.8]), bus]).0, 2, "a bus");
        assert_eq!(united(vec![stripe(), vehicle([8.0, 0.0], [19.0, 1.8])]).0, 1, "too long for a car");
    }
}
