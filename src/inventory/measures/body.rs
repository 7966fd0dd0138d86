//! The body of an object in the plane, and the box of least area around it.
//!
//! A few points near a vehicle belong to nothing: a pulse that hits its edge and the road behind it gives a
//! point between the two (mixed pixel). One such point moves a side of the box. So the body of a vehicle
//! consists of cells with many points around them, in groups of such cells. Other objects are their own body:
//! the thin parts of a tree or a fence are a part of it.
//!
//! Measured on 234 parked cars of 14 synthetic drives with IoU above 0.8: the width was wrong by more than
//! 0.3 m in 193, now in 31; the RMSE of the base was 0.54 m, now 0.16 m. The RMSE of the middle was 0.15 m on
//! 14 cars of `kitti_street_22`, now 0.10 m; 0.16 m on 8 of `downtown_ts2`, now 0.07 m; and 0.05 m on 9 of
//! `suburb_ts1`, now 0.10 m, because far sides have few points there.

use rustc_hash::FxHashMap;

use super::classes::VEHICLE;
use super::parts::{Frames, Measures};
use super::rectangle::{Rectangle, least_area};
use super::sketch::{Extremes, Frame, Sketch};
use crate::model::{Kind, Lattice, ObjectPart, convex_hull};
use crate::spatial::DisjointSets;

/// Smallest number of points in the cells around a cell of the body: this number, and this share of all
/// points. With 1 in 500 to 1 in 2,000, the errors are nearly the same.
const LEAST_POINTS: u64 = 3;
const LEAST_SHARE: u64 = 1_000;
/// Largest distance between the cells of a group along an axis, in metres. With 0.3 m, far sides with few
/// points are lost more often.
const GROUP_M: f64 = 0.5;
/// Smallest share of the points in a group of the body: 2 %.
const GROUP_SHARE: u64 = 50;
/// Smallest share of the points in the whole body, in percent. Of a vehicle with few points, more would be
/// left out, but single points beside a vehicle are about 0.4 % of its points.
const BODY_SHARE: u64 = 97;

/// The box of least area around the body of an object, in lattice units.
pub(crate) fn box_of_body(
    whole: &ObjectPart,
    kind: Kind,
    measures: &Measures,
    frames: &Frames,
    lattice: Lattice,
) -> Rectangle {
    match kind.class {
        VEHICLE => least_area(&hull(&whole.hull, &measures.body, &frames.plan, lattice)),
        _ => least_area(&whole.hull),
    }
}

/// The hull of the body of an object with the hull `all`: of the vertices of `all` that are in its cells, and
/// of the extremes of these. It is `all` if there is no body.
fn hull(all: &[[i64; 2]], cells: &Sketch<Extremes>, frame: &Frame, lattice: Lattice) -> Vec<[i64; 2]> {
    let body = body(cells, frame, lattice);
    if body.is_empty() {
        return all.to_vec();
    }
    let of_body = |place: &&[i64; 2]| {
        let [i, j, _] = frame.key_at(cells.level, [place[0], place[1], frame.corner[2]]);
        body.contains_key(&[i, j])
    };
    let vertices = all.iter().filter(of_body);
    let mut points: Vec<[i64; 2]> =
        vertices.chain(body.values().flat_map(|cell| &cell.ends)).copied().collect();
    convex_hull(&mut points)
}

/// The cells of the body. There are none if it would have too small a share of the points.
#[expect(clippy::cast_possible_truncation, reason = "a sketch has few cells, and groups are few cells apart")]
fn body<'a>(
    cells: &'a Sketch<Extremes>,
    frame: &Frame,
    lattice: Lattice,
) -> FxHashMap<[u32; 2], &'a Extremes> {
    let all: FxHashMap<[u32; 2], &Extremes> =
        cells.voxels.iter().map(|([i, j, _], cell)| ([*i, *j], cell)).collect();
    let total: u64 = all.values().map(|cell| cell.points).sum();
    let at = |[i, j]: [u32; 2], x: i64, y: i64| {
        let [i, j] = [(i, x), (j, y)].map(|(index, by)| u32::try_from(i64::from(index) + by));
        Some([i.ok()?, j.ok()?])
    };
    let is_dense = |cell: &[u32; 2]| {
        let block = (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x, y)));
        let around = block.filter_map(|(x, y)| all.get(&at(*cell, x, y)?));
        let points: u64 = around.map(|cell| cell.points).sum();
        points >= LEAST_POINTS && points * LEAST_SHARE >= total
    };
    let dense: Vec<[u32; 2]> =
        cells.voxels.iter().map(|([i, j, _], _)| [*i, *j]).filter(|cell| is_dense(cell)).collect();
    let number: FxHashMap<[u32; 2], u32> = dense.iter().copied().zip(0..).collect();
    let reach = (lattice.units(GROUP_M) / frame.edge_at(cells.level)).max(1);
    let mut groups = DisjointSets::new(dense.len() as u32);
    for (cell, one) in dense.iter().zip(0..) {
        for (x, y) in (0..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y))) {
            if let Some(&other) = at(*cell, x, y).and_then(|cell| number.get(&cell)) {
                groups.union(one, other);
            }
        }
    }
    let group: Vec<u32> = (0..dense.len() as u32).map(|cell| groups.find(cell)).collect();
    let mut points = vec![0_u64; dense.len()];
    for (cell, group) in dense.iter().zip(&group) {
        points[*group as usize] += all[cell].points;
    }
    let is_large = |group: u32| points[group as usize] * GROUP_SHARE >= total;
    let of_body = dense.into_iter().zip(group).filter(|(_, group)| is_large(*group));
    let body: FxHashMap<[u32; 2], &Extremes> = of_body.map(|(cell, _)| (cell, all[&cell])).collect();
    let kept: u64 = body.values().map(|cell| cell.points).sum();
    if kept * 100 < total * BODY_SHARE { FxHashMap::default() } else { body }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{FileId, TileCloud};

    const CAR: Kind = Kind::new(VEHICLE, 1);

    /// The box around the body of points, each once.
    fn boxed(points: &[[i64; 3]], kind: Kind) -> Rectangle {
        let lattice = Lattice::MILLIMETRE;
        let cloud = TileCloud::from_lattice_points(lattice, points);
        let objects = vec![1; points.len()];
        let whole = ObjectPart::collect(&cloud, &objects, 1, |_| true, |_| FileId::new(0)).remove(0);
        let measures =
            Measures::collect(&cloud, &objects, |_| true, |_| Some((&whole, kind, None))).remove(0).1;
        box_of_body(&whole, kind, &measures, &Frames::new(&whole, kind, None, lattice), lattice)
    }

    /// The sides of a car of 4.4 m by 1.8 m that lies along x, with points every 50 mm in ten layers.
    fn car() -> Vec<[i64; 3]> {
        let ends = (0..=88).flat_map(|n| [[50 * n, 0], [50 * n, 1_800]]);
        let sides = (0..=36).flat_map(|n| [[0, 50 * n], [4_400, 50 * n]]);
        let ring: Vec<[i64; 2]> = ends.chain(sides).collect();
        (0..10).flat_map(|layer| ring.iter().map(move |&[x, y]| [x, y, 150 * layer])).collect()
    }

    #[test]
    fn single_points_beside_a_vehicle_do_not_widen_its_box() {
        let stray = [[2_000, -1_300, 800], [2_100, 3_900, 500], [2_150, 3_950, 500], [-900, 700, 300]];
        let found = boxed(&[car(), stray.to_vec()].concat(), CAR);
        assert_eq!((found.length, found.width, found.middle), (4_400.0, 1_800.0, [2_200.0, 900.0]));
        let fence = boxed(&[car(), stray.to_vec()].concat(), Kind::new(super::super::FENCE, 1));
        assert!(fence.width > 3_000.0, "{fence:?}");
    }

    #[test]
    fn without_single_points_the_box_is_that_of_the_hull() {
        // Turned, so that the extremes along the axes are not its corners.
        let turned: Vec<[i64; 3]> =
            car().iter().map(|&[x, y, z]| [(4 * x - 3 * y) / 5, (3 * x + 4 * y) / 5, z]).collect();
        let mut plane: Vec<[i64; 2]> = turned.iter().map(|&[x, y, _]| [x, y]).collect();
        assert_eq!(boxed(&turned, CAR), least_area(&convex_hull(&mut plane)));
    }

    #[test]
    fn a_vehicle_of_few_points_has_the_box_of_all() {
        let corners = [[0, 0, 0], [4_000, 0, 0], [4_000, 1_700, 0], [0, 1_700, 0]];
        let found = boxed(&corners, CAR);
        assert_eq!((found.length, found.width), (4_000.0, 1_700.0));
        // One side of it is dense, and the other has 4 % of the points.
        let side = (0..=95).map(|n| [40 * n, 0, 500]);
        let other = (0..4).map(|n| [1_000 * n, 1_700, 500]);
        let found = boxed(&side.chain(other).collect::<Vec<_>>(), CAR);
        assert_eq!((found.length, found.width), (3_800.0, 1_700.0));
    }
}
