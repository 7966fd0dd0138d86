//! PLY: the outlines of surfaces as triangles in colours, for viewers of meshes.
//!
//! Format: Turk, "The PLY polygon file format" (1994), ASCII 1.0. Each vertex has x, y, z in the units of the
//! input, as double, and the colour of its surface. Each face is a triangle with the id of its surface. The
//! colour follows from the id alone, so it does not change when surfaces are added.

use std::io::{self, Write};
use std::path::Path;

use crate::model::Value;
use crate::output::objects::number::{OUTLINE_PLACES, rounded};
use crate::output::objects::table::{ObjectFormat, ObjectRow, ObjectTable, stream};

/// The format.
#[derive(Debug)]
pub(super) struct Ply;

impl ObjectFormat for Ply {
    fn write(&self, table: &ObjectTable<'_>, path: &Path) -> io::Result<()> {
        // The header contains the numbers of vertices and faces, so the rows are made twice. None is kept in
        // memory.
        let (mut vertices, mut faces) = (0, 0);
        for row in table.rows() {
            let places = places(&row?);
            vertices += places.len();
            faces += triangles(&places).len();
        }
        stream(path, |out| mesh(table, vertices, faces, out))
    }
}

fn mesh(table: &ObjectTable<'_>, vertices: usize, faces: usize, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "ply\nformat ascii 1.0\ncomment surfaces of chainage\nelement vertex {vertices}")?;
    for axis in ["x", "y", "z"] {
        writeln!(out, "property double {axis}")?;
    }
    for colour in ["red", "green", "blue"] {
        writeln!(out, "property uchar {colour}")?;
    }
    writeln!(
        out,
        "element face {faces}\nproperty list uchar int vertex_indices\nproperty int surface_id\nend_header"
    )?;
    for row in table.rows() {
        let row = row?;
        let [red, green, blue] = colour(id(&row));
        for place in places(&row) {
            let [x, y, z] = place.map(|value| rounded(value, OUTLINE_PLACES).unwrap_or(0.0));
            writeln!(out, "{x:.3} {y:.3} {z:.3} {red} {green} {blue}")?;
        }
    }
    let mut first = 0;
    for row in table.rows() {
        let row = row?;
        let (id, places) = (id(&row), places(&row));
        for [a, b, c] in triangles(&places) {
            writeln!(out, "3 {} {} {} {id}", first + a, first + b, first + c)?;
        }
        first += places.len();
    }
    Ok(())
}

/// The id, which is the first value.
fn id(row: &ObjectRow<'_>) -> u64 {
    match row.values.first() {
        Some(Value::Count(id)) => *id,
        _ => 0,
    }
}

/// The vertices of an outline that is not closed.
fn places(row: &ObjectRow<'_>) -> Vec<[f64; 3]> {
    let heights = row.heights.iter().copied().chain(std::iter::repeat(row.base[2]));
    row.outline.iter().zip(heights).map(|([x, y], z)| [*x, *y, z]).collect()
}

/// A colour that differs clearly from the colours of the next ids: steps of the golden ratio around the
/// circle of hues.
#[expect(clippy::cast_possible_truncation, reason = "a byte")]
fn colour(id: u64) -> [u8; 3] {
    // 6 * 256 hues; 949 is this number divided by the golden ratio, and coprime to it.
    let hue = id.wrapping_mul(949) % 1_536;
    let rising = (hue % 256) as u8;
    let falling = 255 - rising;
    let full = match hue / 256 {
        0 => [255, rising, 0],
        1 => [falling, 255, 0],
        2 => [0, 255, rising],
        3 => [0, falling, 255],
        4 => [rising, 0, 255],
        _ => [255, 0, falling],
    };
    // Every third colour is darker, and every third is paler.
    full.map(|part| match id % 3 {
        0 => part,
        1 => part / 3 * 2,
        _ => 85 + part / 3 * 2,
    })
}

/// Cuts a simple polygon in space into triangles of its vertices that are counter-clockwise like the polygon.
/// Ears are cut off in the plane of the two axes in which the polygon is largest.
fn triangles(places: &[[f64; 3]]) -> Vec<[usize; 3]> {
    let normal = normal(places);
    let drop = (0..3).max_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap_or(2);
    let (u, v) = ((drop + 1) % 3, (drop + 2) % 3);
    let turns = normal[drop] < 0.0;
    let flat: Vec<[f64; 2]> =
        places.iter().map(|place| if turns { [place[v], place[u]] } else { [place[u], place[v]] }).collect();
    let turn = |a: usize, b: usize, c: usize| {
        let [p, q] = [b, c].map(|to| [flat[to][0] - flat[a][0], flat[to][1] - flat[a][1]]);
        p[0] * q[1] - p[1] * q[0]
    };
    let mut left: Vec<usize> = (0..places.len()).collect();
    let mut found = Vec::with_capacity(places.len().saturating_sub(2));
    let mut at = 0;
    let mut tried = 0;
    while left.len() > 2 {
        let count = left.len();
        let [a, b, c] = [count - 1, 0, 1].map(|by| left[(at + by) % count]);
        let free = || {
            let inside = |p: usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            left.iter().filter(|p| ![a, b, c].contains(p)).all(|p| !inside(*p))
        };
        // A polygon without an ear is not simple. Then the next corner is cut off, so that every vertex is
        // used.
        if tried >= count || (turn(a, b, c) > 0.0 && free()) {
            found.push([a, b, c]);
            left.remove(at % count);
            tried = 0;
        } else {
            at += 1;
            tried += 1;
        }
        at %= left.len();
    }
    found
}

/// The normal of a polygon, with twice its area as length (Newell's method).
fn normal(places: &[[f64; 3]]) -> [f64; 3] {
    let mut normal = [0.0; 3];
    let Some(first) = places.first() else { return normal };
    for (k, a) in places.iter().enumerate() {
        let b = places[(k + 1) % places.len()];
        let [a, b] = [*a, b].map(|place| [0, 1, 2].map(|axis| place[axis] - first[axis]));
        for (axis, sum) in normal.iter_mut().enumerate() {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += a[u] * b[v] - a[v] * b[u];
        }
    }
    normal
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::objects::table::tests::{car, reports_errors, stray, written};

    fn area(places: &[[f64; 3]], triangles: &[[usize; 3]]) -> f64 {
        let of = |triangle: &[usize; 3]| {
            normal(&triangle.map(|at| places[at])).iter().map(|part| part * part).sum::<f64>().sqrt() / 2.0
        };
        triangles.iter().map(of).sum()
    }

    #[test]
    fn triangles_cover_the_polygon_and_keep_its_direction() {
        // An L of 3 square metres, in three positions.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let positions: [fn([f64; 2]) -> [f64; 3]; 4] = [
            |[u, v]| [u, v, 7.0],
            |[u, v]| [5e6 + u, 4.0, v],
            |[u, v]| [v, u, 0.0],
            |[u, v]| [0.0, -0.6 * u, 0.8 * u + v * 0.0 + v],
        ];
        for position in positions {
            let places = l.map(position);
            let found = triangles(&places);
            assert_eq!(found.len(), 4);
            let whole = normal(&places);
            let size = whole.iter().map(|part| part * part).sum::<f64>().sqrt() / 2.0;
            assert!((area(&places, &found) - size).abs() < 1e-9, "{found:?}");
            for triangle in found {
                let own = normal(&triangle.map(|at| places[at]));
                assert!((0..3).map(|axis| own[axis] * whole[axis]).sum::<f64>() > 0.0, "{triangle:?}");
            }
        }
        assert_eq!(triangles(&[[0.0; 3]; 2]), [[0; 3]; 0]);
        assert_eq!(triangles(&[[0.0; 3]; 5]).len(), 3, "whatever the polygon, it ends");
    }

    #[test]
    fn the_file_has_as_many_lines_as_its_head_says() {
        let text = written(&Ply, &[car(), stray()], None);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[..4].contains(&"element vertex 4") && lines.contains(&"element face 1"), "{text}");
        let end = lines.iter().position(|line| *line == "end_header").unwrap();
        assert_eq!(lines.len(), end + 1 + 4 + 1);
        assert_eq!(lines[end + 1].split(' ').next(), Some("530000.000"));
        assert_eq!(lines[end + 5], "3 2 0 1 7");
        assert!(written(&Ply, &[], None).ends_with("end_header\n"));
    }

    #[test]
    fn neighbouring_ids_have_different_colours() {
        let apart = |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| u32::from(a[k].abs_diff(b[k]))).sum::<u32>();
        assert!((1..2_000).all(|id| apart(colour(id), colour(id + 1)) > 100));
    }

    #[test]
    fn errors_are_reported() {
        assert!(reports_errors(&Ply));
    }
}
