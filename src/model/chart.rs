//! A chart as data, made by a method. The output draws it.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// A chart of points and bars over two axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// Name of its file, without the extension.
    pub name: Cow<'static, str>,
    /// What it shows.
    pub title: String,
    /// The horizontal axis.
    pub x: ChartAxis,
    /// The vertical axis.
    pub y: ChartAxis,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

/// An axis of a chart. It begins at 0, or below the smallest positive value if it is logarithmic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChartAxis {
    /// What is measured, with its unit.
    pub name: String,
    /// Whether it is logarithmic.
    pub logarithmic: bool,
    /// Values at which something is decided, and their names.
    pub thresholds: Vec<(Cow<'static, str>, f64)>,
}

/// One part of a chart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Series {
    /// Marks at (x, y); the more there are in one place, the larger the mark.
    Points {
        /// What they are.
        name: String,
        /// Where they are.
        places: Vec<[f64; 2]>,
        /// How many are there, in the same order.
        counts: Vec<u64>,
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
