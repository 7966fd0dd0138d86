//! What a run shows: charts, and the page `report.html` with its points, its table and its script.

mod chart;
mod cloud;
mod packed;
mod page;
mod rows;
mod sample;
mod stream;

pub use chart::{ChartError, chart_svg};
pub(crate) use page::{Page, PageCloud, PageStretch, PageTable, point_budget, with_run};
pub(crate) use rows::PageFrame;
pub(crate) use sample::{Choice, SamplePoint, SampledDrive, Sampler, Sampling};
pub use stream::{Found, PointStream};
