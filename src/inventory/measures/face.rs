//! The face of a surface: which cells of its plane its points occupy, in parts that merge exactly, and its
//! outline.

use serde::{Deserialize, Serialize};

use super::outline::{Polygon, outline};
use super::sketch::{Frame, Heights, Sketch, by_object};
use crate::model::{Lattice, ObjectPart, Plane, TileCloud};

/// Edge of a cell in metres (chosen: the outline lies within half of it of the border of an evenly scanned
/// surface).
const EDGE_M: f64 = 0.05;
/// Largest number of cells. With more, cells become larger. A facade of 20 m by 8 m has this many at 0.1 m.
const MOST_CELLS: usize = 1 << 14;
/// Height of every point of a face over its plane: the same for all, because it is not used.
const LEVEL: Heights = Heights { lowest: 0, highest: 0 };

/// The cells of the plane of a surface, or of a part of it, that have points.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Face {
    cells: Sketch<Heights>,
}

/// The frame of the cells: it follows from the extent of the whole surface.
fn frame(whole: &ObjectPart, plane: &Plane, lattice: Lattice) -> Frame {
    let ends = [whole.lo, whole.hi];
    let corners = (0..8_usize).map(|corner| {
        let end = |axis: usize| ends[corner >> axis & 1][axis];
        plane.local([end(0), end(1), end(2)])
    });
    let (mut lo, mut hi) = ([i64::MAX, i64::MAX, 0], [i64::MIN, i64::MIN, 0]);
    for place in corners {
        for axis in 0..2 {
            // Places are rounded.
            lo[axis] = lo[axis].min(place[axis] - 1);
            hi[axis] = hi[axis].max(place[axis] + 1);
        }
    }
    Frame::new((lattice.units(EDGE_M) / 2 * 2).max(2), lo, hi)
}

impl Face {
    /// The faces of the surfaces with points in `core`. `objects` has the object of each point, 0 for none;
    /// `whole` has the extent and the plane of the objects that are surfaces. Ascending by object.
    #[must_use]
    pub fn collect<'a>(
        cloud: &TileCloud,
        objects: &[u32],
        core: impl Fn(usize) -> bool,
        whole: impl Fn(u32) -> Option<(&'a ObjectPart, &'a Plane)>,
    ) -> Vec<(u32, Self)> {
        let members = by_object(objects, core);
        let mut faces = Vec::new();
        for group in members.chunk_by(|a, b| a.0 == b.0) {
            let Some((part, plane)) = whole(group[0].0) else { continue };
            let frame = frame(part, plane, cloud.lattice);
            let cell = |&(_, point): &(u32, u32)| {
                let [u, v] = plane.local(cloud.lattice_point(point as usize));
                (frame.key([u, v, 0]), LEVEL)
            };
            let cells = Sketch::of(&frame, group.iter().map(cell).collect(), MOST_CELLS);
            faces.push((group[0].0, Self { cells }));
        }
        faces
    }

    /// Adds another part of the same surface.
    pub fn merge(&mut self, other: Self) {
        self.cells.merge(other.cells, MOST_CELLS);
    }

    /// The outline of the whole surface in its plane: counter-clockwise as seen against the normal.
    pub(crate) fn outline(&self, whole: &ObjectPart, plane: &Plane, lattice: Lattice) -> Option<Polygon> {
        outline(&self.cells, &frame(whole, plane, lattice), lattice, |_| true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::FileId;

    #[test]
    fn parts_are_the_whole_and_the_area_is_that_in_the_plane() {
        // 3 m by 2 m, leaning by 4 to 3, a point every 20 mm.
        let points: Vec<[i64; 3]> = (0..15_000_i64)
            .map(|k| [k % 150 * 20, k / 150 * 20])
            .map(|[u, v]| [7_000_000 + u, -40_000 + v * 3 / 5, 900 + v * 4 / 5])
            .collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let plane =
            Plane { centre: points[7_000], normal: [0.0, -0.8, 0.6], flatness_units2: 0.0, points: 15_000 };
        let objects = vec![1; points.len()];
        let part = ObjectPart::collect(&cloud, &objects, 1, |_| true, |_| FileId::new(0)).remove(0);
        let whole = |_: u32| Some((&part, &plane));
        let face = Face::collect(&cloud, &objects, |_| true, whole).remove(0).1;
        let mut merged = Face::collect(&cloud, &objects, |point| point % 3 == 0, whole).remove(0).1;
        merged.merge(Face::collect(&cloud, &objects, |point| point % 3 != 0, whole).remove(0).1);
        assert_eq!(merged, face);
        let outline = face.outline(&part, &plane, Lattice::MILLIMETRE).unwrap();
        let area = outline.area_units2() / 1e6;
        assert!((area - 6.0).abs() < 0.3, "{area}");
        assert_eq!(Face::collect(&cloud, &objects, |_| true, |_| None), []);
    }
}
