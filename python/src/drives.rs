//! Drives of files: run, plan, status. Results are JSON, which the Python part decodes.

use std::path::PathBuf;

use chainage::config::{Config, MEMORY_MIB};
use chainage::inventory;
use chainage::run::{Registries, RunRequest, plan_of, run as run_drive, status as status_of};
use pyo3::prelude::*;
use serde::Serialize;

use crate::failure::{bug, raised};
use crate::task::beside;

/// The settings: defaults, preset, file, and assignments `section.key=value`.
pub(crate) fn settings(
    preset: Option<&str>,
    file: Option<PathBuf>,
    assignments: &[String],
) -> chainage::Result<Config> {
    Ok(Config::with_preset(preset, file.as_deref(), assignments)?)
}

fn json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(bug)
}

/// Runs a drive. `progress` is called with every event as JSON.
#[pyfunction]
#[pyo3(signature = (files, out, preset, config, assignments, fresh, progress))]
#[expect(clippy::too_many_arguments, reason = "one call of the Python part, which names them")]
pub(crate) fn run(
    py: Python<'_>,
    files: Vec<PathBuf>,
    out: PathBuf,
    preset: Option<String>,
    config: Option<PathBuf>,
    assignments: Vec<String>,
    fresh: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let summary = beside(py, progress.as_ref(), move |observer, cancel| {
        let config = settings(preset.as_deref(), config, &assignments)?;
        let request = RunRequest { inputs: files, out, config, fresh, registries: Registries::default() };
        run_drive(&request, observer, cancel)
    })?;
    json(&summary)
}

/// The tiles that a run would process.
#[pyfunction]
pub(crate) fn plan(
    py: Python<'_>,
    files: Vec<PathBuf>,
    preset: Option<String>,
    config: Option<PathBuf>,
    assignments: Vec<String>,
) -> PyResult<String> {
    let facts = beside(py, None, move |_, _| {
        let config = settings(preset.as_deref(), config, &assignments)?;
        plan_of(&files, None, &config, &Registries::default())
    })?;
    json(&facts)
}

/// The state of a run.
#[pyfunction]
pub(crate) fn status(py: Python<'_>, out: PathBuf) -> PyResult<String> {
    let state = py.detach(|| {
        status_of(&out, &Registries::default(), |last| settings(None, Some(last.to_owned()), &[]))
    });
    json(&state.map_err(|error| raised(&error))?)
}

/// Columns of the table of objects: names and types.
#[pyfunction]
pub(crate) fn columns() -> Vec<(&'static str, &'static str)> {
    inventory::columns().iter().map(|column| (column.name, column.column_type.label())).collect()
}

/// Memory budgets that are accepted, in MiB: the least and the most.
#[pyfunction]
pub(crate) fn memory_range() -> (u64, u64) {
    MEMORY_MIB.into_inner()
}
