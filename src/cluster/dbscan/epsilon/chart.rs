//! The curve, its fit and the tangent point as a drawing (SVG).

use std::fmt::Write;

use crate::cluster::dbscan::epsilon::Estimate;

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 520.0;
/// Space for the numbers and names of the axes, in pixels.
const MARGIN: f64 = 64.0;
/// Approximate number of marks per axis.
const MARKS: f64 = 8.0;

/// Draws an estimate. `unit` is the unit of its distances.
#[must_use]
pub fn svg(estimate: &Estimate, unit: &str) -> String {
    let last_k = estimate.k as f64;
    let top = estimate.d_k * 1.08;
    let x = |k: f64| MARGIN + k / last_k * (WIDTH - 1.5 * MARGIN);
    let y = |distance: f64| HEIGHT - MARGIN - distance / top * (HEIGHT - 1.7 * MARGIN);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" \
         height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" \
         fill=\"white\"/>\n"
    );
    for k in marks(last_k) {
        let _ = writeln!(
            svg,
            "<path d=\"M{0:.1} {1:.1}V{2:.1}\" stroke=\"#ddd\"/><text x=\"{0:.1}\" y=\"{3:.1}\" \
             text-anchor=\"middle\">{k}</text>",
            x(k),
            y(0.0),
            y(top),
            y(0.0) + 18.0
        );
    }
    for distance in marks(top) {
        let _ = writeln!(
            svg,
            "<path d=\"M{0:.1} {1:.1}H{2:.1}\" stroke=\"#ddd\"/><text x=\"{3:.1}\" y=\"{4:.1}\" \
             text-anchor=\"end\">{5}</text>",
            x(0.0),
            y(distance),
            x(last_k),
            x(0.0) - 6.0,
            y(distance) + 4.0,
            (distance * 1e9).round() / 1e9
        );
    }
    let fitted: Vec<String> = (0..=200)
        .map(|step| 2.0 + (last_k - 2.0) * f64::from(step) / 200.0)
        .map(|k| format!("{:.1},{:.1}", x(k), y(estimate.fit.at(k))))
        .collect();
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#f28e2b\" stroke-width=\"2\"/>",
        fitted.join(" ")
    );
    for (k, mean) in (2_u16..).zip(&estimate.curve.mean[..estimate.k - 1]) {
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.5\" fill=\"#4e79a7\"/>",
            x(f64::from(k)),
            y(*mean)
        );
    }
    let k0 = estimate.k0;
    let epsilon = estimate.epsilon;
    let _ = writeln!(
        svg,
        "<path d=\"M{0:.1} {1:.1}V{2:.1}H{3:.1}\" fill=\"none\" stroke=\"#e15759\" stroke-dasharray=\"5 3\"/>\
         <circle cx=\"{0:.1}\" cy=\"{2:.1}\" r=\"4.5\" fill=\"#e15759\"/><text x=\"{4:.1}\" y=\"{5:.1}\" \
         fill=\"#e15759\">k0 = {k0:.3}, epsilon = {epsilon:.5} {unit}</text>",
        x(k0),
        y(0.0),
        y(epsilon),
        x(0.0),
        x(k0) + 10.0,
        y(epsilon) + 16.0
    );
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">k-th nearest neighbour (the point itself is 1)</text>\
         <text x=\"{:.1}\" y=\"20\">mean distance{} over {} points, fit of degree 5 with R&#178; = {:.5}</text>",
        x(last_k / 2.0),
        HEIGHT - 16.0,
        x(0.0),
        if unit.is_empty() { String::new() } else { format!(" in {unit}") },
        estimate.curve.queries,
        estimate.r_squared
    );
    svg.push_str("</svg>\n");
    svg
}

/// About [`MARKS`] round numbers from 0 to `end`.
fn marks(end: f64) -> impl Iterator<Item = f64> {
    let rough = end / MARKS;
    let decade = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|step| step * decade)
        .into_iter()
        .find(|&step| step >= rough)
        .unwrap_or(rough);
    (0_u32..).map(move |index| f64::from(index) * step).take_while(move |&mark| mark <= end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::dbscan::epsilon::{Attempt, Curve, estimate};

    #[test]
    fn marks_are_round_and_in_range() {
        assert_eq!(marks(40.0).collect::<Vec<_>>(), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0]);
        assert_eq!(marks(0.0035).count(), 8);
    }

    #[test]
    fn a_drawing_has_every_point_of_the_fit_and_the_result() {
        let mean: Vec<f64> = (2..=40).map(|k| f64::from(k).sqrt()).collect();
        let curve = Curve { queries: 50, population: 50, standard_error: vec![0.0; 39], mean };
        let Ok(Attempt::Found(found)) = estimate(curve, 40, 50) else { panic!("no estimate") };
        let drawing = svg(&found, "m");
        assert_eq!(drawing.matches("<circle").count(), 39 + 1);
        // At k = 10, the slope of sqrt(k) equals the slope of its chord, sqrt(40) / 40.
        assert!((found.k0 - 10.0).abs() < 0.3, "{}", found.k0);
        assert!(drawing.contains("over 50 points") && drawing.ends_with("</svg>\n"));
    }
}
