//! The files of one drive: found from the arguments, opened, compared with each other, and put on one
//! lattice.

use std::path::{Path, PathBuf};

use super::boxes::note_boxes;
use super::crs::Crs;
use super::crs_claim::CrsKind;
use super::error::InputError;
use super::file::InputFile;
use super::names;
use super::options::InputOptions;
use super::twins::note_twins;
use super::unit::unit_in_words;
use crate::config::LengthUnit;
use crate::model::{Lattice, PointId};

/// The files of one drive in the given order. The points of all files are numbered consecutively.
#[derive(Debug)]
pub struct Catalog {
    files: Vec<InputFile>,
    /// Id of the first point of every file.
    first_ids: Vec<PointId>,
    point_count: u64,
    lattice: Lattice,
    crs: Crs,
    units_m: [f64; 3],
    warnings: Vec<String>,
}

impl Catalog {
    /// Opens the files of the arguments, in their order. An argument is a file, a folder (its `*.las` and
    /// `*.laz`, sorted by name, without subfolders) or a pattern (sorted). A folder or pattern with the
    /// labelled copies of a run does not give its cloud-optimised file, which has the same points.
    ///
    /// # Errors
    /// The first file that is missing, damaged or not acceptable; a file that is given twice, or whose path
    /// is not UTF-8; contradicting coordinate reference systems.
    pub fn open(arguments: &[PathBuf], options: &InputOptions) -> Result<Self, InputError> {
        Self::open_without(arguments, &[], options)
    }

    /// The same, without the files `left_out`, unless there are no others. These files are the outputs of a
    /// run in one of the searched folders.
    ///
    /// # Errors
    /// Those of [`Self::open`].
    pub(crate) fn open_without(
        arguments: &[PathBuf],
        left_out: &[PathBuf],
        options: &InputOptions,
    ) -> Result<Self, InputError> {
        let paths = find(arguments, left_out)?;
        let mut files =
            paths.iter().map(|path| InputFile::open(path, options)).collect::<Result<Vec<_>, _>>()?;
        let mut warnings = Vec::new();
        for file in &files {
            warnings.extend(file.warnings().iter().map(|warning| format!("{}: {warning}", file.name())));
        }
        let crs = common_crs(&files, options.unit, &mut warnings)?;
        let crs = match options.unit.metres() {
            Some(unit_m) => crs.with_stated_unit(unit_m, &mut warnings),
            None => crs,
        };
        let units_m = [crs.horizontal_unit_m, crs.horizontal_unit_m, crs.vertical_unit_m];
        files.iter_mut().for_each(|file| file.set_units(units_m));
        note_units(units_m, &mut warnings);
        note_clocks(&files, &mut warnings);
        note_boxes(&files, &mut warnings);
        let finest_m = files.iter().map(InputFile::finest_scale_m).fold(f64::INFINITY, f64::min);
        let lattice = Lattice::for_scale(finest_m);
        for file in &mut files {
            file.set_lattice(lattice)?;
        }
        let mut point_count = 0;
        let mut first_ids = Vec::with_capacity(files.len());
        for file in &files {
            first_ids.push(PointId::new(point_count));
            point_count += file.point_count();
        }
        note_twins(&files, &mut warnings);
        Ok(Self { files, first_ids, point_count, lattice, crs, units_m, warnings })
    }

    /// The files in order.
    #[must_use]
    pub fn files(&self) -> &[InputFile] {
        &self.files
    }

    /// The names of the files, with the folders of those whose names agree.
    pub(crate) fn distinct_names(&self) -> Vec<String> {
        names::distinct(&self.files.iter().map(InputFile::path).collect::<Vec<_>>())
    }

    /// The lattice of the drive.
    #[must_use]
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Points of all files.
    #[must_use]
    pub fn point_count(&self) -> u64 {
        self.point_count
    }

    /// Id of the first point of a file. The id of a point is this id plus its record number.
    ///
    /// # Panics
    /// When there is no such file.
    #[must_use]
    pub fn first_id(&self, file: usize) -> PointId {
        self.first_ids[file]
    }

    /// The file of a point: the last one that begins at it or before it, because files without points begin
    /// where the next one does.
    pub(crate) fn file_of(&self, id: PointId) -> usize {
        file_at(&self.first_ids, id)
    }

    /// Problems of the drive that do not prevent processing, with the names of the files.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The coordinate reference system of the drive, from the first file that names one.
    #[must_use]
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// One unit of x, y and z of the input in metres, from the setting `input.unit`, or else from the
    /// coordinate reference system of the drive. Everything that converts coordinates takes the units from
    /// here, so that points, tables, trajectories and pages agree.
    #[must_use]
    pub fn units_m(&self) -> [f64; 3] {
        self.units_m
    }
}

fn file_at(first_ids: &[PointId], id: PointId) -> usize {
    first_ids.partition_point(|first| *first <= id).saturating_sub(1)
}

/// Name of the cloud-optimised file of a run.
pub(crate) const CLOUD_NAME: &str = "drive.copc.laz";

/// The paths of all arguments, without repetition.
fn find(arguments: &[PathBuf], left_out: &[PathBuf]) -> Result<Vec<PathBuf>, InputError> {
    let mut paths = Vec::new();
    for argument in arguments {
        let found = expand(argument)?;
        if found.is_empty() {
            return Err(InputError::NothingFound { argument: argument.display().to_string() });
        }
        paths.extend(found);
    }
    if paths.is_empty() {
        return Err(InputError::NothingFound { argument: String::new() });
    }
    let mut known = std::collections::BTreeMap::new();
    let mut own = Vec::new();
    for path in &paths {
        let real = path.canonicalize().map_err(|source| InputError::Read { path: path.clone(), source })?;
        // The state of a run and its tables store paths as text.
        if real.to_str().is_none() {
            return Err(InputError::NotUtf8 { path: real });
        }
        own.push(left_out.contains(&real));
        if let Some(first) = known.insert(real, path) {
            return Err(match first.file_name() == path.file_name() {
                true => InputError::Duplicate { path: path.clone() },
                false => InputError::SameFile { path: path.clone(), other: first.clone() },
            });
        }
    }
    if own.contains(&false) {
        let mut own = own.into_iter();
        paths.retain(|_| own.next() == Some(false));
    }
    Ok(paths)
}

/// Removes the cloud-optimised file of a run if its labelled copies are found as well, because it has the
/// same points. The report beside the file shows that a run wrote it.
fn without_clouds(paths: &mut Vec<PathBuf>) {
    let is_cloud = |path: &Path| {
        path.file_name().is_some_and(|name| name == CLOUD_NAME)
            && path.with_file_name("report.json").is_file()
    };
    let has_copies =
        |cloud: &Path| paths.iter().any(|path| path.parent() == cloud.parent() && path.as_path() != cloud);
    let clouds: Vec<PathBuf> =
        paths.iter().filter(|path| is_cloud(path) && has_copies(path)).cloned().collect();
    paths.retain(|path| !clouds.contains(path));
}

/// The files of one argument.
fn expand(argument: &Path) -> Result<Vec<PathBuf>, InputError> {
    if argument.is_dir() {
        return in_folder(argument);
    }
    let text = argument.to_string_lossy();
    if argument.exists() || !text.contains(['*', '?', '[']) {
        return Ok(vec![argument.to_owned()]);
    }
    let pattern = glob::glob(&text)
        .map_err(|source| InputError::Pattern { argument: text.clone().into_owned(), source })?;
    let mut paths = Vec::new();
    for entry in pattern {
        let path = entry
            .map_err(|error| InputError::Read { path: error.path().to_owned(), source: error.into() })?;
        if path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    without_clouds(&mut paths);
    Ok(paths)
}

/// The LAS and LAZ files directly inside a folder, sorted by name.
fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, InputError> {
    let read_error = |source| InputError::Read { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(read_error)? {
        let path = entry.map_err(read_error)?.path();
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        if matches!(extension.as_deref(), Some("las" | "laz")) && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    without_clouds(&mut paths);
    Ok(paths)
}

/// The common coordinate reference system of the files. An error if the files contradict each other, or if
/// the system is not projected.
fn common_crs(files: &[InputFile], unit: LengthUnit, warnings: &mut Vec<String>) -> Result<Crs, InputError> {
    // A unit in the settings means that coordinates are lengths, whatever they look like.
    if let Some(file) = files.iter().find(|file| unit == LengthUnit::Auto && file.seems_geographic()) {
        let description = "no record names a system, but the coordinates look like degrees".to_owned();
        return Err(InputError::Geographic { path: file.path().to_owned(), description });
    }
    let known = files.iter().filter(|file| file.crs().is_known());
    let first = known.clone().next();
    for file in known {
        let path = file.path().to_owned();
        let description = file.crs().description.clone();
        match file.crs().kind {
            // A unit in the settings means that coordinates are lengths, whatever the record says.
            _ if unit != LengthUnit::Auto => {}
            CrsKind::Geographic => return Err(InputError::Geographic { path, description }),
            CrsKind::Geocentric => return Err(InputError::Geocentric { path, description }),
            CrsKind::Projected | CrsKind::Unknown => {}
        }
        if let Some(first) = first.filter(|first| first.crs().contradicts(file.crs())) {
            let [crs, other_crs] = describe_both(first.crs(), file.crs());
            return Err(InputError::CrsDiffers {
                path: first.path().to_owned(),
                crs,
                other: path,
                other_crs,
            });
        }
    }
    // A file without points has no coordinates.
    let filled = files.iter().filter(|file| file.point_count() > 0);
    let without = filled.clone().filter(|file| !file.crs().is_known()).count();
    if let Some(first) = first.filter(|_| without > 0) {
        let verb = if without == 1 { "does" } else { "do" };
        warnings.push(format!(
            "{without} of {} files {verb} not name a coordinate reference system; all are taken to be in that of {}: {}",
            filled.count(),
            first.name(),
            first.crs().description
        ));
    }
    let given = files.iter().find(|file| file.crs().not_understood);
    Ok(match (first, given) {
        (Some(first), _) => first.crs().clone(),
        (None, Some(given)) => given.crs().in_unit(unit),
        (None, None) => Crs::unknown(unit),
    })
}

/// Two systems, each with its unit unless this is the metre, and with that of heights if the two differ in
/// it.
fn describe_both(first: &Crs, second: &Crs) -> [String; 2] {
    let heights_differ = (first.vertical_unit_m / second.vertical_unit_m - 1.0).abs() > 1e-9;
    [first, second].map(|crs| {
        let mut text = crs.description.clone();
        if (crs.horizontal_unit_m - 1.0).abs() > 1e-9 {
            text.push_str(&format!(" in {}", unit_in_words(crs.horizontal_unit_m)));
        }
        if heights_differ {
            text.push_str(&format!(" with heights in {}", unit_in_words(crs.vertical_unit_m)));
        }
        text
    })
}

/// Bit of the global encoding: GPS times are adjusted standard times, not seconds of the week.
const STANDARD_TIME: u16 = 1;

/// Warns that the files count their times from different moments.
fn note_clocks(files: &[InputFile], warnings: &mut Vec<String>) {
    let timed = files.iter().filter(|file| file.point_count() > 0 && file.layout().gps_time.is_some());
    let (standard, week): (Vec<&InputFile>, Vec<&InputFile>) =
        timed.partition(|file| file.header().global_encoding & STANDARD_TIME != 0);
    if let (Some(standard), Some(week)) = (names(&standard), names(&week)) {
        warnings.push(format!(
            "the files have different clocks: GPS times are adjusted standard times in {standard}, and seconds of the \
             week in {week}; times across these files cannot be compared"
        ));
    }
}

/// The name of the first file, and the number of others; `None` without files.
fn names(files: &[&InputFile]) -> Option<String> {
    let (first, others) = files.split_first()?;
    let first = first.name();
    Some(match others.len() {
        0 => first.to_owned(),
        more => format!("{first} and {more} more"),
    })
}

/// Warns that lengths are not in the units of the coordinates.
fn note_units([plan_m, _, height_m]: [f64; 3], warnings: &mut Vec<String>) {
    if [plan_m, height_m].iter().any(|unit| (unit - 1.0).abs() > 1e-9) {
        let (plan, height) = (unit_in_words(plan_m), unit_in_words(height_m));
        let unit = if plan == height { plan } else { format!("{plan}, heights in {height}") };
        warnings.push(format!(
            "coordinates are in {unit}; tables have coordinates in these units and lengths in metres"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_in_the_last_file_that_begins_before_it() {
        // 3, 0, 2, 0 and 4 points.
        let first_ids = [0, 3, 3, 5, 5].map(PointId::new);
        let files: Vec<usize> = (0..9).map(|id| file_at(&first_ids, PointId::new(id))).collect();
        assert_eq!(files, [0, 0, 0, 2, 2, 4, 4, 4, 4]);
    }
}
