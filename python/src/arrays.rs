//! Points in arrays: they go through the steps of a run in a temporary folder, and their labels come back as
//! arrays.

use chainage::run::{self, Registries, RunRequest, check_settings};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::drives::settings;
use crate::failure::{bug, raised, raised_of};
use crate::points::{self, Labels, Steps};
use crate::task::beside;

/// Arrays of labels: objects, classes of points, and classes of objects if the method classifies.
type Arrays<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u8>>, Option<Bound<'py, PyArray1<u8>>>);

/// Bytes per point of a folder with points, their labelled copy and the state of the run. 95 were seen with
/// `street`.
const BYTES_PER_POINT: u64 = 200;

/// A folder for so many points: in memory where the system offers that and where they take less than half of
/// the room, because points need not last, else where temporary files go. A container has 64 MiB of such
/// memory by default.
fn scratch(points: usize) -> std::io::Result<tempfile::TempDir> {
    let memory = std::path::Path::new("/dev/shm");
    let room = rustix::fs::statvfs(memory).map_or(0, |facts| facts.f_bavail.saturating_mul(facts.f_frsize));
    let wanted = (points as u64).saturating_mul(BYTES_PER_POINT);
    if wanted < room / 2 { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }
}

/// Labels points. `xyz` has three columns in metres, checked by the Python part.
#[pyfunction]
pub(crate) fn label<'py>(
    py: Python<'py>,
    xyz: PyReadonlyArray2<'py, f64>,
    scale: [f64; 3],
    offset: [f64; 3],
    assignments: Vec<String>,
) -> PyResult<Arrays<'py>> {
    let rows: Vec<[f64; 3]> = xyz.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect();
    if rows.is_empty() {
        check(&assignments).map_err(|error| raised(&error))?;
        return Ok(arrays(py, Labels::default()));
    }
    let folder = scratch(rows.len()).map_err(bug)?;
    let file = folder.path().join("points.las");
    let steps = Steps { scale, offset };
    let written = py.detach(|| points::write(&file, &rows, &steps)).map_err(bug)?;
    if let Err(far) = written {
        let (value, axis) = (rows[far.row][far.axis], ["x", "y", "z"][far.axis]);
        let text = format!(
            "xyz[{}]: {axis} = {value} is too far from {} for steps of {}",
            far.row, offset[far.axis], scale[far.axis]
        );
        return Err(PyValueError::new_err(text));
    }
    drop(rows);
    let request = (file.clone(), folder.path().join("out"));
    let labels = beside(py, None, move |observer, cancel| {
        let (file, out) = request;
        let labelled = out.join("points.las");
        let config = settings(None, None, &assignments)?;
        let inputs = vec![file];
        let request = RunRequest { inputs, out, config, fresh: false, registries: Registries::default() };
        // A failure is told with the name that the points have for the caller.
        Ok(run::run(&request, observer, cancel).and_then(|_| points::labels(labelled)))
    })?;
    drop(folder);
    let labels = labels.map_err(|error| raised_of(&error, &file, "xyz"))?;
    Ok(arrays(py, labels))
}

/// Checks settings without points.
fn check(assignments: &[String]) -> chainage::Result<()> {
    check_settings(&settings(None, None, assignments)?, &Registries::default())
}

fn arrays(py: Python<'_>, labels: Labels) -> Arrays<'_> {
    let Labels { objects, classes, kinds } = labels;
    (objects.into_pyarray(py), classes.into_pyarray(py), kinds.map(|kinds| kinds.into_pyarray(py)))
}
