//! Charts as SVG; the only user of the plotting crate. It does not know what a chart is about.

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::model::{Chart, ChartAxis, Series};

const SIZE_PX: (u32, u32) = (1_000, 700);
/// Colours of the series in turn.
const COLOURS: [RGBColor; 4] =
    [RGBColor(120, 144, 170), RGBColor(200, 60, 50), RGBColor(89, 161, 79), RGBColor(176, 122, 161)];

/// Why a chart could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the chart {name}: {reason}")]
pub struct ChartError {
    name: String,
    reason: String,
}

/// The drawing.
///
/// # Errors
/// If the plotting crate refuses, for example because an axis is not finite.
pub fn chart_svg(chart: &Chart) -> Result<String, ChartError> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE_PX).into_drawing_area();
        draw(chart, &area)
            .map_err(|error| ChartError { name: chart.name.to_string(), reason: error.to_string() })?;
    }
    Ok(svg)
}

/// An axis as drawn: a logarithmic axis contains logarithms.
struct Scale {
    logarithmic: bool,
    from: f64,
    to: f64,
}

impl Scale {
    /// An axis with room for `values`, a margin at its end, and the share `head` of its length for the text
    /// there.
    fn new(axis: &ChartAxis, values: impl Iterator<Item = f64>, head: f64) -> Self {
        let values = values.chain(axis.thresholds.iter().map(|threshold| threshold.1));
        let mut least = f64::INFINITY;
        let mut most = 0.0;
        for value in values.filter(|value| *value > 0.0) {
            (least, most) = (value.min(least), value.max(most));
        }
        if most <= 0.0 {
            (least, most) = (1.0, 1.0);
        }
        let (from, to) = if axis.logarithmic { ((least * 0.7).log10(), most.log10()) } else { (0.0, most) };
        Self { logarithmic: axis.logarithmic, from, to: to + (to - from) * (0.05 + head) }
    }

    /// The position of a value on the axis. A value that a logarithmic axis cannot show is drawn at the start
    /// of the axis.
    fn place(&self, value: f64) -> f64 {
        if !self.logarithmic {
            value
        } else if value > 0.0 {
            value.log10().max(self.from)
        } else {
            self.from
        }
    }

    /// The text at a mark of the axis. Between powers of ten it is empty.
    fn label(&self, at: f64) -> String {
        if !self.logarithmic {
            let text = format!("{at:.3}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else if (at - at.round()).abs() < 1e-6 {
            let value = 10_f64.powf(at.round());
            format!("{value}")
        } else {
            String::new()
        }
    }
}

fn draw<'a>(
    chart: &Chart,
    area: &DrawingArea<SVGBackend<'a>, Shift>,
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let (x, y) = scales(chart);
    area.fill(&WHITE)?;
    let mut context = ChartBuilder::on(area)
        .caption(&chart.title, ("sans-serif", 20))
        .margin(15)
        .x_label_area_size(45)
        .y_label_area_size(70)
        .build_cartesian_2d(x.from..x.to, y.from..y.to)?;
    context
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc(&chart.x.name)
        .y_desc(&chart.y.name)
        .x_label_formatter(&|at| x.label(*at))
        .y_label_formatter(&|at| y.label(*at))
        .label_style(("sans-serif", 13))
        .draw()?;
    for (series, colour) in chart.series.iter().zip(COLOURS.iter().cycle()) {
        let colour = *colour;
        let (drawn, name) = match series {
            Series::Points { name, places, counts } => {
                // Two pixels for one, three for ten, four for a hundred.
                let radius = |count: u64| 2 + count.checked_ilog10().unwrap_or(0);
                let marks = places.iter().zip(counts).map(|(place, &count)| {
                    let place = (x.place(place[0]), y.place(place[1]));
                    Circle::new(place, radius(count), colour.mix(0.7).filled())
                });
                (context.draw_series(marks)?, name)
            }
            Series::Bars { name, width, bars } => {
                let bars = bars.iter().map(|bar| {
                    let corners =
                        [(x.place(bar[0]), y.place(bar[1])), (x.place(bar[0] + width), y.place(bar[2]))];
                    Rectangle::new(corners, colour.filled())
                });
                (context.draw_series(bars)?, name)
            }
        };
        drawn
            .label(name)
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 10, y + 5)], colour.filled()));
    }
    let line = |from, to| PathElement::new(vec![from, to], BLACK);
    let text = |at, (name, value): &(std::borrow::Cow<'static, str>, f64), pos| {
        EmptyElement::at(at) + Text::new(format!("{name} = {value}"), pos, ("sans-serif", 15))
    };
    for threshold in &chart.x.thresholds {
        let at = x.place(threshold.1);
        context.draw_series([line((at, y.from), (at, y.to))])?;
        context.draw_series([text((at, y.to), threshold, (6, 4))])?;
    }
    for threshold in &chart.y.thresholds {
        let at = y.place(threshold.1);
        context.draw_series([line((x.from, at), (x.to, at))])?;
        context.draw_series([text((x.to, at), threshold, (-80, -18))])?;
    }
    context
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font(("sans-serif", 15))
        .border_style(BLACK)
        .background_style(WHITE)
        .draw()?;
    area.present()
}

/// The axes of a chart; above it there is room for the legend.
fn scales(chart: &Chart) -> (Scale, Scale) {
    let corners = chart.series.iter().flat_map(|series| -> Vec<[f64; 2]> {
        match series {
            Series::Points { places, .. } => places.clone(),
            Series::Bars { width, bars, .. } => {
                bars.iter().flat_map(|bar| [[bar[0], bar[1]], [bar[0] + width, bar[2]]]).collect()
            }
        }
    });
    let corners: Vec<[f64; 2]> = corners.collect();
    let along = |axis: usize| corners.iter().map(move |corner| corner[axis]);
    (Scale::new(&chart.x, along(0), 0.0), Scale::new(&chart.y, along(1), 0.12))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(name: &str, logarithmic: bool, thresholds: &[(&'static str, f64)]) -> ChartAxis {
        ChartAxis {
            name: name.to_owned(),
            logarithmic,
            thresholds: thresholds.iter().map(|&(name, value)| (name.into(), value)).collect(),
        }
    }

    fn chart(series: Vec<Series>) -> Chart {
        let title = "a title".to_owned();
        let x = axis("metres", false, &[("half", 0.5)]);
        let y = axis("number", true, &[("ten", 10.0)]);
        Chart { name: "test".into(), title, x, y, series }
    }

    #[test]
    fn every_mark_bar_and_threshold_is_drawn_and_named() {
        let places = vec![[1.0, 2.0], [3.0, 4.0], [5.0, 0.0]];
        let svg = chart_svg(&chart(vec![
            Series::Points { name: "dots".to_owned(), places, counts: vec![1, 20, 300] },
            Series::Bars { name: "bars".to_owned(), width: 0.5, bars: vec![[0.0, 0.0, 2.0]] },
        ]))
        .unwrap();
        assert_eq!(svg.matches("<circle").count(), 3);
        assert_eq!(["r=\"2\"", "r=\"3\"", "r=\"4\""].map(|radius| svg.matches(radius).count()), [1; 3]);
        for text in ["a title", "metres", "number", "dots", "bars", "half = 0.5", "ten = 10"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn axes_hold_every_value_and_write_round_numbers() {
        let values = || [0.0, 0.02, 4.0].into_iter();
        let linear = Scale::new(&axis("", false, &[("", 5.0)]), values(), 0.15);
        assert!(
            linear.from.abs() < 1e-12 && (linear.to - 6.0).abs() < 1e-12,
            "{} {}",
            linear.from,
            linear.to
        );
        assert_eq!(["5", "0.25", "0"], [5.0, 0.25, 0.0].map(|at| linear.label(at)));
        let logarithmic = Scale::new(&axis("", true, &[]), values(), 0.0);
        assert!(logarithmic.from < 0.02_f64.log10() && logarithmic.to > 4_f64.log10());
        assert!((logarithmic.place(0.0) - logarithmic.from).abs() < 1e-12);
        assert_eq!(["0.1", "", "100"], [-1.0, 0.5, 2.0].map(|at| logarithmic.label(at)));
    }

    #[test]
    fn a_chart_of_nothing_is_drawn_too() {
        let nothing = Chart { x: axis("", true, &[]), y: axis("", false, &[]), ..chart(Vec::new()) };
        assert!(chart_svg(&nothing).unwrap().contains("a title"));
    }
}
