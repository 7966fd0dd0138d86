//! The report: `report.json`.

use serde_json::json;

use crate::config::Config;
use crate::error::Result;
use crate::output::OutputError;
use crate::run::drive::{AxisFacts, Drive, Surveyed};
use crate::run::finish::names::REPORT;
use crate::run::finish::tables::write_whole;
use crate::run::summary::RunSummary;
use crate::store::RunDir;

/// Writes `report.json`: configuration, figures, times, warnings.
pub(crate) fn write_report(
    run_dir: &RunDir,
    drive: &Drive,
    config: &Config,
    surveyed: &Surveyed,
    summary: &RunSummary,
) -> Result<()> {
    let files: Vec<_> = drive
        .catalog
        .files()
        .iter()
        .map(|file| json!({ "name": file.name(), "points": file.point_count(), "bytes": file.size_bytes() }))
        .collect();
    let report = json!({
        "program": format!("chainage {}", env!("CARGO_PKG_VERSION")),
        "input": files,
        "crs": { "description": drive.catalog.crs().description, "epsg": drive.catalog.crs().epsg },
        "lattice_step_m": drive.lattice().step_m(),
        "axis": AxisFacts::of(&surveyed.axis),
        "result": summary,
        "configuration": config.to_json(),
    });
    write_whole(run_dir, REPORT, |out| {
        serde_json::to_writer_pretty(&mut *out, &report)
            .map_err(std::io::Error::from)
            .and_then(|()| out.write_all(b"\n"))
            .map_err(|source| OutputError::Write { path: run_dir.out().join(REPORT), source })
    })?;
    Ok(())
}
