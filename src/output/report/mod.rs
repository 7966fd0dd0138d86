//! What is shown of a run: charts.

mod chart;

pub use chart::{ChartError, chart_svg};
