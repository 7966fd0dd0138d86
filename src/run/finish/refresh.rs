//! Puts the settings of the last call into report and page if it found every output complete. They differ
//! from those of earlier calls in what has no effect on the outputs.

use serde_json::Value;

use crate::config::Config;
use crate::error::Result;
use crate::output::report::with_run;
use crate::run::finish::names::{PAGE, REPORT};
use crate::run::finish::report::write_report;
use crate::run::finish::tables::write_whole;
use crate::store::{RunDir, StoreError};

/// Replaces the settings and the warnings of an earlier call. Returns whether there were other ones.
pub(super) fn settings(run_dir: &RunDir, config: &Config, warnings: &[String]) -> Result<bool> {
    let path = run_dir.out().join(REPORT);
    let bytes = fs_err::read(&path).map_err(StoreError::io("read", &path))?;
    let damaged =
        |error: serde_json::Error| StoreError::Damaged { path: path.clone(), what: error.to_string() };
    let mut report: Value = serde_json::from_slice(&bytes).map_err(damaged)?;
    let configuration = config.to_json_on_machine_of(&report["configuration"]);
    if report["configuration"] == configuration {
        return Ok(false);
    }
    let change = |run: &mut Value| {
        let Some(run) = run.as_object_mut() else { return };
        run.insert("configuration".to_owned(), configuration.clone());
        if let Some(result) = run.get_mut("result").and_then(Value::as_object_mut) {
            result.insert("warnings".to_owned(), warnings.into());
        }
    };
    change(&mut report);
    if config.output.writes("report") {
        let path = run_dir.out().join(PAGE);
        let page = fs_err::read_to_string(&path).map_err(StoreError::io("read", &path))?;
        let page = with_run(&page, change).ok_or_else(|| {
            let what = "it has no part with the values of the report".to_owned();
            StoreError::Damaged { path, what }
        })?;
        write_whole(run_dir, PAGE, |out| out.write_all(page.as_bytes()))?;
    }
    write_report(run_dir, &report)?;
    Ok(true)
}
