//! The outline of an object: a polygon around its occupied cells of the plane.
//!
//! The border of the cells is followed, its corners are cut off from middle to middle of its edges, and
//! vertices that hardly matter are dropped. No outline touches itself. Every point is inside the outline or
//! within 0.1 m of it. All decisions use exact integers.

use super::grid::Grid;
use super::sketch::{Frame, Heights, Sketch};
use crate::model::Lattice;

/// Half the width below which gaps are closed, in metres (chosen: the distance between profiles of a vehicle
/// scanner).
const CLOSE_M: f64 = 0.2;
/// Largest distance of a point from the outline in metres.
const WITHIN_M: f64 = 0.1;
/// Largest distance of a dropped vertex from the outline in metres (chosen: less than half a cell, so that
/// corners stay).
const DROPPED_M: f64 = 0.045;
/// Largest number of cells of the raster in which an outline is found. With more, its cells become larger.
const MOST_CELLS: usize = 1 << 22;
/// Rounds of dropping vertices. Each round drops about half of the vertices that can be dropped.
const ROUNDS: usize = 12;

/// A simple polygon on the lattice: counter-clockwise from its smallest vertex (x, y), not closed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Polygon {
    /// Its vertices, at least three.
    pub(crate) vertices: Vec<[i64; 2]>,
}

impl Polygon {
    /// Its area in square lattice units.
    pub(crate) fn area_units2(&self) -> f64 {
        let first = self.vertices.first().copied().unwrap_or_default();
        self.vertices.windows(2).map(|pair| turn(first, pair[0], pair[1])).sum::<i128>() as f64 / 2.0
    }
}

/// The outline of the cells of a plan that `keep` accepts. `None` if there are none.
pub(crate) fn outline(
    plan: &Sketch<Heights>,
    frame: &Frame,
    lattice: Lattice,
    keep: impl Fn(&Heights) -> bool,
) -> Option<Polygon> {
    let kept = plan.voxels.iter().filter(|(_, heights)| keep(heights));
    let mut cells: Vec<[u32; 2]> = kept.map(|([i, j, _], _)| [*i, *j]).collect();
    let mut level = plan.level;
    if cells.is_empty() {
        return None;
    }
    loop {
        let edge = frame.edge_at(level);
        if let Some(grid) = solid(&cells, (lattice.units(CLOSE_M) / edge).max(1)) {
            return Some(of_border(&grid.border(), edge, frame, lattice));
        }
        level += 1;
        for cell in &mut cells {
            *cell = cell.map(|index| index >> 1);
        }
        cells.sort_unstable();
        cells.dedup();
    }
}

/// The corners of one solid part that contains these cells, counter-clockwise, without corners on straight
/// lines. A corner has the index of the cell to its upper right. If there are too many cells for one raster,
/// blocks of 2 by 2 cells become one cell.
pub fn around_cells(cells: &[[i32; 2]]) -> Vec<[i64; 2]> {
    // Counted from the smallest, so that they are not negative.
    let least = [0, 1].map(|k| cells.iter().map(|cell| cell[k]).min().unwrap_or(0));
    let mut size = 1;
    let mut counted: Vec<[u32; 2]> =
        cells.iter().map(|cell| [0, 1].map(|k| cell[k].abs_diff(least[k]))).collect();
    while !counted.is_empty() {
        if let Some(grid) = solid(&counted, 1) {
            let place = |corner: [i64; 2]| [0, 1].map(|k| i64::from(least[k]) + corner[k] * size);
            return without_collinear(&grid.border()).into_iter().map(place).collect();
        }
        size *= 2;
        for cell in &mut counted {
            *cell = cell.map(|index| index >> 1);
        }
        counted.sort_unstable();
        counted.dedup();
    }
    Vec::new()
}

/// The cells in one solid part. `None` if they are too many, or too far apart.
fn solid(cells: &[[u32; 2]], reach: i64) -> Option<Grid> {
    let reach = u32::try_from(reach).unwrap_or(1);
    let mut grid = Grid::of(cells, reach + 2, MOST_CELLS)?;
    grid.close(reach);
    if !grid.join() {
        return None;
    }
    grid.solidify();
    Some(grid)
}

/// The polygon along a border of cells.
fn of_border(border: &[[i64; 2]], edge: i64, frame: &Frame, lattice: Lattice) -> Polygon {
    let place = |corner: &[i64; 2]| [0, 1].map(|k| frame.corner[k] + corner[k] * edge);
    let corners: Vec<[i64; 2]> = border.iter().map(place).collect();
    let within = WITHIN_M * f64::from(lattice.units_per_m());
    // A cut from middle to middle of two edges removes points at up to this distance from the cut.
    let cut = edge as f64 * std::f64::consts::SQRT_2 / 4.0;
    let (ring, tolerance) = if cut < 0.75 * within {
        let middle = |k: usize| {
            let next = corners[(k + 1) % corners.len()];
            // Edges are even numbers of lattice units.
            [0, 1].map(|axis| i64::midpoint(corners[k][axis], next[axis]))
        };
        ((0..corners.len()).map(middle).collect(), within - cut - 1.0)
    } else {
        (corners, within - 1.0)
    };
    let dropped = DROPPED_M * f64::from(lattice.units_per_m());
    let mut vertices = simplified(&without_collinear(&ring), tolerance.min(dropped).max(0.0));
    let smallest = (0..vertices.len()).min_by_key(|k| vertices[*k]).unwrap_or(0);
    vertices.rotate_left(smallest);
    Polygon { vertices }
}

/// Twice the signed area of the triangle: positive when `a`, `b`, `c` turn left.
fn turn(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i128 {
    let minus = |p: [i64; 2], q: [i64; 2]| [i128::from(p[0] - q[0]), i128::from(p[1] - q[1])];
    let u = minus(b, a);
    let v = minus(c, a);
    u[0] * v[1] - u[1] * v[0]
}

fn without_collinear(ring: &[[i64; 2]]) -> Vec<[i64; 2]> {
    let count = ring.len();
    let bends = |k: &usize| turn(ring[(k + count - 1) % count], ring[*k], ring[(k + 1) % count]) != 0;
    (0..count).filter(bends).map(|k| ring[k]).collect()
}

/// A ring with fewer vertices, within `tolerance` lattice units of the given one. A vertex is dropped if all
/// dropped vertices between its neighbours are within the tolerance of the new edge, and if no other vertex
/// is in the triangle that is cut off or added. Then the ring stays simple.
fn simplified(ring: &[[i64; 2]], tolerance: f64) -> Vec<[i64; 2]> {
    let mut by_x: Vec<usize> = (0..ring.len()).collect();
    by_x.sort_unstable_by_key(|k| ring[*k]);
    let mut kept: Vec<usize> = (0..ring.len()).collect();
    let mut alive = vec![true; ring.len()];
    for _ in 0..ROUNDS {
        let before = kept.len();
        let mut at = 0;
        let mut dropped_last = false;
        let mut next_kept = Vec::with_capacity(kept.len());
        while at < kept.len() {
            let left = before - (at - next_kept.len());
            // The neighbours of a dropped vertex stay for this round, so that vertices are dropped evenly
            // along the ring.
            let prev = next_kept.last().copied().unwrap_or(kept[kept.len() - 1]);
            let here = kept[at];
            let last_of_ring = at + 1 == kept.len();
            let next =
                if last_of_ring { next_kept.first().copied().unwrap_or(kept[0]) } else { kept[at + 1] };
            let may = !dropped_last && left > 3 && at > 0;
            if may && near(ring, prev, next, tolerance) && is_free(ring, &by_x, &alive, [prev, here, next]) {
                alive[here] = false;
                dropped_last = true;
            } else {
                next_kept.push(here);
                dropped_last = false;
            }
            at += 1;
        }
        kept = next_kept;
        // The next round begins at another vertex, because the first one is never dropped.
        kept.rotate_left(1);
        if kept.len() == before {
            break;
        }
    }
    kept.into_iter().map(|k| ring[k]).collect()
}

/// Whether all vertices of the ring between two are within `tolerance` of the segment from one to the other.
fn near(ring: &[[i64; 2]], from: usize, to: usize, tolerance: f64) -> bool {
    let between = (to + ring.len() - from) % ring.len();
    let apart = |a: [i64; 2], b: [i64; 2]| [(b[0] - a[0]) as f64, (b[1] - a[1]) as f64];
    let [dx, dy] = apart(ring[from], ring[to]);
    let squared = dx * dx + dy * dy;
    (1..between).all(|k| {
        let [px, py] = apart(ring[from], ring[(from + k) % ring.len()]);
        let share = if squared > 0.0 { ((px * dx + py * dy) / squared).clamp(0.0, 1.0) } else { 0.0 };
        (px - share * dx).hypot(py - share * dy) <= tolerance
    })
}

/// Whether no other vertex that is still there lies in a triangle of vertices, its border included.
fn is_free(ring: &[[i64; 2]], by_x: &[usize], alive: &[bool], corners: [usize; 3]) -> bool {
    let [a, b, c] = corners.map(|k| ring[k]);
    let (a, b, c) = if turn(a, b, c) > 0 { (a, b, c) } else { (a, c, b) };
    let lowest = a[0].min(b[0]).min(c[0]);
    let highest = a[0].max(b[0]).max(c[0]);
    let first = by_x.partition_point(|k| ring[*k][0] < lowest);
    by_x[first..].iter().take_while(|k| ring[**k][0] <= highest).all(|k| {
        let p = ring[*k];
        let outside = || turn(a, b, p) < 0 || turn(b, c, p) < 0 || turn(c, a, p) < 0;
        !alive[*k] || corners.contains(k) || outside()
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn plan(points: &[[i64; 2]]) -> (Frame, Sketch<Heights>) {
        let corner = |pick: fn(i64, i64) -> i64| {
            [0, 1].map(|k| points.iter().map(|point| point[k]).reduce(pick).unwrap())
        };
        let [lo, hi] = [corner(i64::min), corner(i64::max)];
        let frame = Frame::new(100, [lo[0], lo[1], 0], [hi[0], hi[1], 0]);
        let heights = Heights { lowest: 0, highest: 0 };
        let cell = |point: &[i64; 2]| (frame.key([point[0], point[1], 0]), heights);
        let sketch = Sketch::of(&frame, points.iter().map(cell).collect(), 1 << 14);
        (frame, sketch)
    }

    /// Whether the closed segments ab and cd have a point in common.
    fn meet(a: [i64; 2], b: [i64; 2], c: [i64; 2], d: [i64; 2]) -> bool {
        let side = |a, b, p| turn(a, b, p).signum();
        let on = |a: [i64; 2], b: [i64; 2], p: [i64; 2]| {
            turn(a, b, p) == 0 && (0..2).all(|k| p[k] >= a[k].min(b[k]) && p[k] <= a[k].max(b[k]))
        };
        (side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0)
            || on(a, b, c)
            || on(a, b, d)
            || on(c, d, a)
            || on(c, d, b)
    }

    /// Distance of a point from a polygon; 0 inside.
    fn distance(polygon: &[[i64; 2]], p: [i64; 2]) -> f64 {
        let count = polygon.len();
        let edge = |k: usize| (polygon[k], polygon[(k + 1) % count]);
        let crossings = (0..count)
            .filter(|&k| {
                let (a, b) = edge(k);
                (a[1] > p[1]) != (b[1] > p[1]) && ((b[1] > a[1]) == (turn(a, b, p) > 0))
            })
            .count();
        if crossings % 2 == 1 {
            return 0.0;
        }
        (0..count)
            .map(|k| {
                let (a, b) = edge(k);
                let d = [(b[0] - a[0]) as f64, (b[1] - a[1]) as f64];
                let v = [(p[0] - a[0]) as f64, (p[1] - a[1]) as f64];
                let share = ((v[0] * d[0] + v[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
                (v[0] - share * d[0]).hypot(v[1] - share * d[1])
            })
            .fold(f64::INFINITY, f64::min)
    }

    fn check(points: &[[i64; 2]]) -> Polygon {
        let (frame, sketch) = plan(points);
        let polygon = outline(&sketch, &frame, Lattice::MILLIMETRE, |_| true).unwrap();
        let vertices = &polygon.vertices;
        let count = vertices.len();
        assert!(count >= 3 && polygon.area_units2() > 0.0, "{vertices:?}");
        assert_eq!(vertices.iter().min(), vertices.first());
        for a in 0..count {
            for b in a + 1..count {
                let [p, q, r, s] = [a, a + 1, b, b + 1].map(|k| vertices[k % count]);
                let next_to = b == a + 1 || (a == 0 && b + 1 == count);
                assert!(next_to || !meet(p, q, r, s), "edges {a} and {b} of {vertices:?}");
                assert!(!next_to || turn(p, q, s) != 0 || turn(q, r, s) != 0 || count == 3, "{vertices:?}");
            }
        }
        for point in points {
            let away = distance(vertices, *point);
            assert!(away <= 100.0, "{point:?} is {away} from {vertices:?}");
        }
        polygon
    }

    #[test]
    fn a_point_and_a_line_have_outlines_too() {
        let one = check(&[[5_420_000_123, -77]]);
        assert!(one.area_units2() <= 10_000.0);
        let wall: Vec<[i64; 2]> = (0..400).map(|k| [k * 50, k * 20]).collect();
        let long = check(&wall);
        assert!(long.vertices.len() < 200, "{}", long.vertices.len());
        assert!((20_000.0..200.0 * 22_000.0).contains(&long.area_units2()), "{}", long.area_units2());
    }

    #[test]
    fn an_l_has_a_third_less_area_than_its_hull() {
        // Two arms of 10 m by 1 m, densely sampled.
        let cells = |long: i64, wide: i64| (0..long * wide).map(move |k| [(k % long) * 50, (k / long) * 50]);
        let points: Vec<[i64; 2]> = cells(200, 20).chain(cells(20, 200)).collect();
        let area = check(&points).area_units2() / 1e6;
        assert!((area - 19.0).abs() < 1.5, "{area} m2 instead of 19");
    }

    #[test]
    fn a_large_circle_has_few_vertices_and_its_area() {
        let points: Vec<[i64; 2]> = (0..40_000_i64)
            .map(|k| [(k * 7_919) % 8_000 - 4_000, (k * 104_729) % 7_993 - 4_000])
            .filter(|p| p[0] * p[0] + p[1] * p[1] < 16_000_000)
            .collect();
        let polygon = check(&points);
        let area = polygon.area_units2() / 1e6;
        assert!((area - 50.3).abs() < 1.5, "{area}");
        assert!(polygon.vertices.len() < 160, "{}", polygon.vertices.len());
    }

    #[test]
    fn cells_of_a_tile_have_corners_around_them() {
        let cells: Vec<[i32; 2]> = (0..50).map(|k| [k / 10 - 3, k % 10 + 1_000]).collect();
        assert_eq!(around_cells(&cells), [[-3, 1_000], [2, 1_000], [2, 1_010], [-3, 1_010]]);
        assert_eq!(around_cells(&[]), [[0; 2]; 0]);
        // Two cells a million apart are merged with their neighbours until they fit a raster.
        let far = around_cells(&[[0, 0], [1_000_000, 700_000]]);
        assert!(far.len() >= 4 && far.iter().any(|corner| corner[0] > 1_000_000), "{far:?}");
    }

    #[test]
    fn far_parts_are_one_polygon() {
        let points: Vec<[i64; 2]> =
            (0..200).map(|k| [(k % 2) * 6_000 + k * 3, (k % 3) * 40_000 + k * 7]).collect();
        check(&points);
        // Too many parts to join: the cells become larger.
        let many: Vec<[i64; 2]> = (0..100).map(|k| [(k % 10) * 3_000, (k / 10) * 3_000]).collect();
        check(&many);
    }

    proptest! {
        #[test]
        fn outlines_are_simple_and_near_every_point(
            points in prop::collection::vec([-2_000..2_000_i64, -2_000..2_000_i64], 1..150),
            shift in prop::array::uniform2(-(1_i64 << 40)..1 << 40),
        ) {
            let places: Vec<[i64; 2]> = points.iter().map(|p| [p[0] + shift[0], p[1] + shift[1]]).collect();
            let here = check(&places);
            let moved: Vec<[i64; 2]> = places.iter().map(|p| [p[0] + 12_800, p[1] - 25_600]).collect();
            let there = check(&moved);
            // The frame moves with whole cells.
            let back: Vec<[i64; 2]> = there.vertices.iter().map(|v| [v[0] - 12_800, v[1] + 25_600]).collect();
            prop_assert_eq!(here.vertices, back);
        }
    }
}
