//! Which pieces are the trail that a moving vehicle leaves in the points of a spinning scanner.
//!
//! A rotation takes 0.1 s, in which a car goes on by 1 to 2 m. Near the scanner its outlines overlap, and the
//! trail is one component that is longer than any bus. Farther away each rotation sees its front or its rear
//! alone, and the trail ends in stripes across the lane. In the box of a car are three or four of them, so
//! they seem to be cars. Stripes join a trail one after another while they go on along its line.

use std::collections::BTreeMap;

use super::part::Part;
use super::rows::{OUTLINE, Row, TRAIL_M};
use super::shares::VEHICLE;
use super::spans::Spans;
use super::uniting::{by_name, one_by_one};
use crate::model::Lattice;

/// Length below which a component is a stripe, in metres: less than the shortest car. Of longer ones those
/// are stripes that have as few voxels as an outline.
const STRIPE_M: f64 = 3.0;
/// Longest gap to the next stripe, in metres: what a car goes on in a rotation at 60 km/h.
const GAP_M: f64 = 1.7;
/// How far a stripe may lie within the trail, in metres. What lies beside a trail is another vehicle.
const WITHIN_M: f64 = 1.0;
/// How much wider the box of a trail may become by a stripe, in metres. In a bend of 120 m whose middle is
/// 9 m beside its chord, 4 m of the lane go aside by 1.3 m. The next lane is 2 m away.
const ASIDE_M: f64 = 1.5;

/// The length of each component of vehicles, in lattice units.
pub(super) fn lengths(parts: &BTreeMap<u32, Part>) -> BTreeMap<u32, i64> {
    let vehicles = parts.iter().filter(|(_, part)| part.class == VEHICLE);
    vehicles.filter_map(|(&name, part)| Some((name, length(part.spans.as_deref()?)))).collect()
}

fn length(spans: &Spans) -> i64 {
    spans.narrowest().length
}

/// Voxels in each lattice unit of the length.
#[expect(clippy::cast_precision_loss, reason = "a length of vehicles")]
fn density(part: &Part) -> f64 {
    f64::from(part.voxels) / part.spans.as_deref().map_or(1, length).max(1) as f64
}

/// Joins stripes to trails. `parts` are those that [`super::uniting::unite`] leaves, and `united` is what it
/// returns; what joins a trail is added to both. `lengths` has the length of each component before. Returns
/// the rows of vehicles by the names of what they are in then. They are found before, because between stripes
/// is nothing, which would be a valley.
pub(super) fn unite(
    parts: &mut BTreeMap<u32, Part>,
    united: &mut BTreeMap<u32, u32>,
    lengths: &BTreeMap<u32, i64>,
    lattice: Lattice,
) -> BTreeMap<u32, Row> {
    let row = |part: &Part| Row::of(part.spans.as_deref()?, part.footprint.as_deref()?, lattice);
    let rows: BTreeMap<u32, Row> =
        parts.iter().filter_map(|(&name, part)| Some((name, row(part)?))).collect();
    // Length of the longest component in each piece.
    let mut longest: BTreeMap<u32, i64> = BTreeMap::new();
    for (name, &length) in lengths {
        let most = longest.entry(by_name(united, *name)).or_default();
        *most = length.max(*most);
    }
    let is_trail = |longest: i64| longest > lattice.units(TRAIL_M);
    let is_short = |longest: i64| longest < lattice.units(STRIPE_M);
    loop {
        longest.retain(|name, _| parts.contains_key(name));
        let trails = longest.iter().filter(|(_, longest)| is_trail(**longest)).map(|(name, _)| *name);
        let pairs: Vec<(i64, u32, u32)> = trails
            .flat_map(|trail| {
                let (parts, rows) = (&*parts, &rows);
                let pair = move |(&other, &longest): (&u32, &i64)| {
                    let (whole, piece) = (&parts[&trail], &parts[&other]);
                    let cost = cost(whole, piece, lattice)?;
                    let is_stripe = is_short(longest) || density(piece) < OUTLINE * density(whole);
                    (is_stripe && !rows.contains_key(&other)).then_some((cost, trail, other))
                };
                longest.iter().filter_map(pair).collect::<Vec<_>>()
            })
            .collect();
        let joined = one_by_one(parts, pairs.into_iter(), |one, other| cost(one, other, lattice).is_some());
        if joined.is_empty() {
            return rows.into_iter().map(|(name, row)| (by_name(united, name), row)).collect();
        }
        for (name, root) in joined {
            // The smallest name stays, which may be that of a stripe.
            let most = longest[&name].max(longest[&root]);
            longest.insert(root, most);
            united.values_mut().filter(|of| **of == name).for_each(|of| *of = root);
            united.insert(name, root);
        }
    }
}

/// The gap between a trail and a stripe that goes on along its line; `None` if it does not.
fn cost(one: &Part, other: &Part, lattice: Lattice) -> Option<i64> {
    let reach = lattice.units(GAP_M);
    let apart = |axis: usize| one.min[axis].max(other.min[axis]) - one.max[axis].min(other.max[axis]);
    if apart(0) > reach || apart(1) > reach {
        return None;
    }
    let (spans, others) = (one.spans.as_deref()?, other.spans.as_deref()?);
    // Cars follow each other in a lane, so the stripes of two trails meet.
    let trails = [spans, others].into_iter().filter(|spans| length(spans) > lattice.units(TRAIL_M));
    if trails.count() != 1 {
        return None;
    }
    let around = spans.union(others).narrowest();
    let gap = spans.gap(others, around);
    let trail = [spans, others].map(Spans::narrowest).into_iter().max_by_key(|extent| extent.length)?;
    let goes_on = (-lattice.units(WITHIN_M)..=reach).contains(&gap);
    (goes_on && around.width <= trail.width + lattice.units(ASIDE_M)).then_some(gap.max(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::part::NO_BAND;

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
        let lengths = lengths(&parts);
        let mut united = BTreeMap::new();
        unite(&mut parts, &mut united, &lengths, Lattice::MILLIMETRE);
        assert!(united.values().all(|root| parts.contains_key(root)), "{united:?}");
        (parts.len(), united)
    }

    #[test]
    fn stripes_go_on_along_a_trail() {
        let stripe = |x: f64| vehicle([x, 0.0], [x + 0.3, 1.8]);
        let trail = || vehicle([10.0, 0.0], [40.0, 1.8]);
        // The farthest first, so that it can only join after the others.
        let (left, of) = united(vec![stripe(6.0), stripe(7.2), stripe(8.5), trail(), stripe(41.5)]);
        assert_eq!(left, 1);
        assert_eq!(of, BTreeMap::from([(1, 0), (2, 0), (3, 0), (4, 0)]));
        assert_eq!(united(vec![stripe(5.0), trail()]).0, 2, "the gap is too long");
        assert_eq!(united(vec![stripe(0.0), stripe(1.2), stripe(2.4)]).0, 3, "there is no trail");
        assert_eq!(united(vec![trail(), stripe(41.2), vehicle([42.5, 0.0], [80.0, 1.8])]).0, 2, "two cars");
    }

    #[test]
    fn a_parked_car_is_not_a_stripe() {
        let trail = || vehicle([10.0, 0.0], [40.0, 1.8]);
        assert_eq!(united(vec![vehicle([5.0, 0.0], [9.0, 1.8]), trail()]).0, 2, "it is longer");
        assert_eq!(united(vec![vehicle([5.0, 0.0], [9.0, 0.3]), trail()]).0, 1, "an outline");
        assert_eq!(united(vec![vehicle([20.0, 2.4], [22.0, 4.2]), trail()]).0, 2, "it is beside the trail");
        assert_eq!(
            united(vec![vehicle([5.0, 0.0], [7.0, 1.8]), vehicle([8.0, 0.0], [19.0, 2.4])]).0,
            2,
            "a bus"
        );
    }
}
