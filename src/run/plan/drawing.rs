//! The plan as a drawing: tiles, axis and chainage marks as SVG, in metres with north up.

use std::fmt::Write;

use crate::model::Lattice;
use crate::run::drive::{Rows, Surveyed};
use crate::spatial::{Cell, PackedCells};
use crate::tiling::Plan;

/// Width of the drawing in pixels.
const WIDTH_PX: f64 = 1_400.0;
/// Colours that neighbours along the drive take in turn.
const COLOURS: [&str; 6] = ["#4e79a7", "#f28e2b", "#59a14f", "#b07aa1", "#76b7b2", "#edc948"];

/// The drawing. Stray cells far outside are left out, they would shrink the drive to a dot.
pub(crate) fn svg(plan: &Plan, surveyed: &Surveyed, lattice: Lattice) -> String {
    let edge_m = lattice.metres(plan.grid().edge());
    let (lo, hi) = window(&surveyed.cells);
    let (left, top) = (f64::from(lo[0]) * edge_m, f64::from(hi[1] + 1) * edge_m);
    let width_m = f64::from(hi[0] - lo[0] + 1) * edge_m;
    let height_m = f64::from(hi[1] - lo[1] + 1) * edge_m;
    let scale = WIDTH_PX / width_m.max(height_m);
    let place = |x: f64, y: f64| ((x - left) * scale, (top - y) * scale);
    let (width, height) = (width_m * scale, height_m * scale);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" \
         fill=\"white\"/>\n"
    );
    for (number, tile) in plan.tiles.iter().enumerate() {
        let mut path = String::new();
        for (i, from, to) in strips(&plan.core(number)) {
            if i < lo[0] || i > hi[0] || to < lo[1] || from > hi[1] {
                continue;
            }
            let (x, y) = place(f64::from(i) * edge_m, f64::from(to + 1) * edge_m);
            let (w, h) = (edge_m * scale, f64::from(to - from + 1) * edge_m * scale);
            let _ = write!(path, "M{x:.1} {y:.1}h{w:.2}v{h:.2}h-{w:.2}z");
        }
        let colour = COLOURS[number % COLOURS.len()];
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" fill=\"{colour}\" fill-opacity=\"0.55\" shape-rendering=\"crispEdges\"><title>tile {number}: chainage {:.0} to {:.0} m, \
             {} points</title></path>",
            tile.from_m, tile.to_m, tile.points
        );
    }
    for stretch in surveyed.axis.stretches() {
        let points: Vec<String> = stretch
            .iter()
            .map(|vertex| place(vertex[0], vertex[1]))
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"black\" stroke-width=\"1.5\"/>",
            points.join(" ")
        );
    }
    for (vertex, chainage) in surveyed.axis.marks(mark_spacing(surveyed.axis.length_m())) {
        let (x, y) = place(vertex[0], vertex[1]);
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/><text x=\"{:.1}\" y=\"{:.1}\">{chainage:.0} m</text>",
            x + 5.0,
            y - 5.0
        );
    }
    svg.push_str("</svg>\n");
    svg
}

/// Chainage marks about ten to a drawing, at a round distance in metres.
fn mark_spacing(length_m: f64) -> f64 {
    let rough = (length_m / 10.0).max(1.0);
    let decade = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * decade).into_iter().find(|&step| step >= rough).unwrap_or(rough)
}

/// The cells between the 0.5 % and 99.5 % quantiles on both axes, a little widened.
fn window(cells: &PackedCells) -> (Cell, Cell) {
    let ends = [0, 1].map(|k| {
        let rows = Rows::of(cells, k);
        let [first, low, high, last] = [0.0, 0.005, 0.995, 1.0].map(|share| rows.quantile(share));
        let margin = ((high - low) / 10).clamp(5, 200);
        (first.max(low - margin), last.min(high + margin))
    });
    (ends.map(|ends| ends.0), ends.map(|ends| ends.1))
}

/// Runs of cells with equal i and consecutive j: (i, first j, last j).
fn strips(cells: &[Cell]) -> Vec<(i32, i32, i32)> {
    let mut strips: Vec<(i32, i32, i32)> = Vec::new();
    for cell in cells {
        match strips.last_mut() {
            Some(strip) if strip.0 == cell[0] && strip.2 + 1 == cell[1] => strip.2 = cell[1],
            _ => strips.push((cell[0], cell[1], cell[1])),
        }
    }
    strips
}
