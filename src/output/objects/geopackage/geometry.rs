//! Geometries as a GeoPackage stores them: a header with the box around them, then ISO well-known binary (OGC
//! 12-128r18, clause 2.1.3), all little-endian.

use crate::output::objects::number::{OUTLINE_PLACES, rounded};

/// Flags of the header: little-endian, without a box.
const NO_BOX: u8 = 0b0000_0001;
/// Flags of the header: little-endian, with a box in x and y.
const XY_BOX: u8 = 0b0000_0011;
const POLYGON: u32 = 3;
const POINT_Z: u32 = 1_001;
const LINE_M: u32 = 2_002;

/// A geometry and the box around it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Geometry {
    pub(super) bytes: Vec<u8>,
    /// Smallest and largest x, smallest and largest y.
    pub(super) bounds: [f64; 4],
}

/// A polygon without holes. `None` if it has fewer than three vertices. The ring may be closed or not.
pub(super) fn polygon(ring: &[[f64; 2]], srs: i32) -> Option<Geometry> {
    let mut places: Vec<[f64; 2]> = ring.iter().map(|place| place.map(coordinate)).collect();
    if places.len() > 1 && same(places[0], places[places.len() - 1]) {
        places.pop();
    }
    if places.len() < 3 {
        return None;
    }
    places.push(places[0]);
    let bounds = bounds(places.iter().copied());
    let mut bytes = header(srs, XY_BOX, &bounds);
    well_known(&mut bytes, POLYGON);
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(count(places.len()));
    places.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    Some(Geometry { bytes, bounds })
}

/// A point with a height.
pub(super) fn point(place: [f64; 3], srs: i32) -> Geometry {
    let place = place.map(coordinate);
    let bounds = bounds([[place[0], place[1]]].into_iter());
    let mut bytes = header(srs, NO_BOX, &bounds);
    well_known(&mut bytes, POINT_Z);
    place.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    Geometry { bytes, bounds }
}

/// A line whose third coordinate is a measure. `None` if it has fewer than two vertices.
pub(super) fn line(places: &[[f64; 3]], srs: i32) -> Option<Geometry> {
    if places.len() < 2 {
        return None;
    }
    let bounds = bounds(places.iter().map(|[x, y, _]| [*x, *y].map(coordinate)));
    let mut bytes = header(srs, XY_BOX, &bounds);
    well_known(&mut bytes, LINE_M);
    bytes.extend(count(places.len()));
    places.iter().flatten().for_each(|value| bytes.extend(coordinate(*value).to_le_bytes()));
    Some(Geometry { bytes, bounds })
}

/// A coordinate as it is written.
fn coordinate(value: f64) -> f64 {
    rounded(value, OUTLINE_PLACES).unwrap_or(0.0)
}

fn same(a: [f64; 2], b: [f64; 2]) -> bool {
    a.map(f64::to_bits) == b.map(f64::to_bits)
}

fn bounds(places: impl Iterator<Item = [f64; 2]>) -> [f64; 4] {
    let nothing = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    places.fold(nothing, |[x0, x1, y0, y1], [x, y]| [x0.min(x), x1.max(x), y0.min(y), y1.max(y)])
}

fn header(srs: i32, flags: u8, bounds: &[f64; 4]) -> Vec<u8> {
    let mut bytes = vec![b'G', b'P', 0, flags];
    bytes.extend(srs.to_le_bytes());
    if flags == XY_BOX {
        bounds.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// Writes the byte order and the type of well-known binary.
fn well_known(bytes: &mut Vec<u8>, geometry_type: u32) {
    bytes.push(1);
    bytes.extend(geometry_type.to_le_bytes());
}

fn count(vertices: usize) -> [u8; 4] {
    // The raster of an outline has fewer cells than that, and an axis has fewer vertices.
    u32::try_from(vertices).unwrap_or(u32::MAX).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_is_closed_once_and_has_its_box() {
        let ring = [[1.0, 2.0], [4.000_4, 2.0], [4.0, 6.0]];
        let open = polygon(&ring, 25_832).unwrap();
        let closed = polygon(&[ring[0], ring[1], ring[2], ring[0]], 25_832).unwrap();
        assert_eq!(open, closed);
        assert_eq!(open.bounds.map(f64::to_bits), [1.0, 4.0, 2.0, 6.0].map(f64::to_bits));
        assert_eq!(&open.bytes[..8], [b'G', b'P', 0, 3, 0xe8, 0x64, 0, 0]);
        // Header, box, order and type, one ring of four vertices.
        assert_eq!(open.bytes.len(), 8 + 32 + 5 + 4 + 4 + 4 * 16);
        assert_eq!(&open.bytes[40..53], [1, 3, 0, 0, 0, 1, 0, 0, 0, 4, 0, 0, 0]);
        assert_eq!(polygon(&ring[..2], 1), None);
        assert_eq!(polygon(&[ring[0], ring[1], ring[0]], 1), None);
    }

    #[test]
    fn points_have_heights_and_lines_have_measures() {
        let point = point([1.0, 2.0, 3.0], -1);
        assert_eq!((point.bytes.len(), point.bytes[3], point.bounds), (8 + 5 + 24, 1, [1.0, 1.0, 2.0, 2.0]));
        assert_eq!(point.bytes[9..13], 1_001_u32.to_le_bytes());
        let line = line(&[[0.0, 0.0, 5.0], [3.0, 4.0, 10.0]], -1).unwrap();
        assert_eq!(line.bytes[41..45], 2_002_u32.to_le_bytes());
        assert_eq!(line.bytes[line.bytes.len() - 8..], 10.0_f64.to_le_bytes());
        assert_eq!(super::line(&[[0.0; 3]], -1), None);
    }
}
