//! Charts as SVG; the only user of the plotting crate. Knows nothing of what a chart is about.

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::model::{Chart, Series};

const SIZE_PX: (u32, u32) = (1_000, 700);
/// Colours of the series in turn.
const COLOURS: [RGBColor; 4] =
    [RGBColor(120, 144, 170), RGBColor(200, 60, 50), RGBColor(89, 161, 79), RGBColor(176, 122, 161)];

/// Why a chart could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the chart {name}: {reason}")]
pub struct ChartError {
    name: &'static str,
    reason: String,
}

/// The drawing.
///
/// # Errors
/// When the plotting crate refuses, which it does for axes that are not finite.
pub fn chart_svg(chart: &Chart) -> Result<String, ChartError> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE_PX).into_drawing_area();
        draw(chart, &area).map_err(|error| ChartError { name: chart.name, reason: error.to_string() })?;
    }
    Ok(svg)
}

fn draw<'a>(
    chart: &Chart,
    area: &DrawingArea<SVGBackend<'a>, Shift>,
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let [x_most, y_most] = extent(chart);
    area.fill(&WHITE)?;
    let mut context = ChartBuilder::on(area)
        .caption(&chart.title, ("sans-serif", 20))
        .margin(15)
        .x_label_area_size(45)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..x_most, 0.0..y_most)?;
    context.configure_mesh().light_line_style(WHITE).x_desc(chart.x).y_desc(chart.y).draw()?;
    for (series, colour) in chart.series.iter().zip(COLOURS.iter().cycle()) {
        let colour = *colour;
        let (drawn, name) = match series {
            Series::Points { name, places } => {
                let marks = places.iter().map(|place| Circle::new((place[0], place[1]), 2, colour.filled()));
                (context.draw_series(marks)?, name)
            }
            Series::Bars { name, width, bars } => {
                let bars = bars
                    .iter()
                    .map(|bar| Rectangle::new([(bar[0], bar[1]), (bar[0] + width, bar[2])], colour.filled()));
                (context.draw_series(bars)?, name)
            }
        };
        drawn
            .label(name)
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 10, y + 5)], colour.filled()));
    }
    let line = |from, to| PathElement::new(vec![from, to], BLACK);
    context.draw_series(chart.x_thresholds.iter().map(|&x| line((x, 0.0), (x, y_most))))?;
    context.draw_series(chart.y_thresholds.iter().map(|&y| line((0.0, y), (x_most, y))))?;
    context.configure_series_labels().border_style(BLACK).background_style(WHITE).draw()?;
    area.present()
}

/// The largest coordinates with a little room; never nothing.
fn extent(chart: &Chart) -> [f64; 2] {
    let mut most = [
        chart.x_thresholds.iter().copied().fold(0.0, f64::max),
        chart.y_thresholds.iter().copied().fold(0.0, f64::max),
    ];
    let mut see = |x: f64, y: f64| most = [most[0].max(x), most[1].max(y)];
    for series in &chart.series {
        match series {
            Series::Points { places, .. } => places.iter().for_each(|place| see(place[0], place[1])),
            Series::Bars { width, bars, .. } => bars.iter().for_each(|bar| see(bar[0] + width, bar[2])),
        }
    }
    most.map(|value| if value > 0.0 { value * 1.05 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(series: Vec<Series>) -> Chart {
        let title = "a title".to_owned();
        Chart {
            name: "test",
            title,
            x: "metres",
            y: "number",
            series,
            x_thresholds: vec![0.5],
            y_thresholds: vec![],
        }
    }

    #[test]
    fn every_mark_and_bar_is_drawn_and_named() {
        let svg = chart_svg(&chart(vec![
            Series::Points { name: "dots".to_owned(), places: vec![[1.0, 2.0], [3.0, 4.0], [5.0, 0.0]] },
            Series::Bars { name: "bars".to_owned(), width: 0.5, bars: vec![[0.0, 0.0, 2.0]] },
        ]))
        .unwrap();
        assert_eq!(svg.matches("<circle").count(), 3);
        for text in ["a title", "metres", "number", "dots", "bars"] {
            assert!(svg.contains(text), "{text}");
        }
        let extent = extent(&chart(vec![Series::Points { name: String::new(), places: vec![[2.0, 4.0]] }]));
        assert!((extent[0] - 2.1).abs() < 1e-12 && (extent[1] - 4.2).abs() < 1e-12, "{extent:?}");
    }

    #[test]
    fn a_chart_of_nothing_is_drawn_too() {
        let nothing = Chart { x_thresholds: Vec::new(), ..chart(Vec::new()) };
        assert!(chart_svg(&nothing).unwrap().contains("a title"));
    }
}
