//! The report of a run as JSON: `report.json`, and the same values for the page.

use serde_json::{Value, json};

use crate::config::Config;
use crate::error::Result;
use crate::run::drive::{AxisFacts, Drive, Surveyed};
use crate::run::finish::names::REPORT;
use crate::run::finish::tables::write_whole;
use crate::run::summary::RunSummary;
use crate::store::RunDir;

/// The report: configuration, figures, times, warnings.
pub(crate) fn report(drive: &Drive, config: &Config, surveyed: &Surveyed, summary: &RunSummary) -> Value {
    let files: Vec<_> = drive
        .catalog
        .files()
        .iter()
        .map(|file| json!({ "name": file.name(), "points": file.point_count(), "bytes": file.size_bytes() }))
        .collect();
    json!({
        "program": format!("chainage {}", env!("CARGO_PKG_VERSION")),
        "input": files,
        "crs": { "description": drive.catalog.crs().description, "epsg": drive.catalog.crs().epsg },
        "lattice_step_m": drive.lattice().step_m(),
        "axis": AxisFacts::of(&surveyed.axis),
        "result": summary,
        "configuration": config.to_json(),
    })
}

/// Writes `report.json`.
pub(crate) fn write_report(run_dir: &RunDir, report: &Value) -> Result<()> {
    write_whole(run_dir, REPORT, |out| {
        serde_json::to_writer_pretty(&mut *out, report)?;
        out.write_all(b"\n")
    })?;
    Ok(())
}
