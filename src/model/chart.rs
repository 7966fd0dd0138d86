//! A chart as data: what a method wants people to see. How it is drawn is not known here.

/// A chart of points and bars over two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Name of its file, without the extension.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// The horizontal axis, with its unit.
    pub x: &'static str,
    /// The vertical axis, with its unit.
    pub y: &'static str,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
    /// Thresholds on the horizontal axis.
    pub x_thresholds: Vec<f64>,
    /// Thresholds on the vertical axis.
    pub y_thresholds: Vec<f64>,
}

/// One part of a chart.
#[derive(Debug, Clone, PartialEq)]
pub enum Series {
    /// Marks at (x, y).
    Points {
        /// What they are.
        name: String,
        /// Where they are.
        places: Vec<[f64; 2]>,
    },
    /// Bars from (x, from) to (x + width, to).
    Bars {
        /// What they are.
        name: String,
        /// Width of a bar.
        width: f64,
        /// x, lower and upper end of every bar.
        bars: Vec<[f64; 3]>,
    },
}
