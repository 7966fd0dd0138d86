//! The names of the outputs of a run, and whether they may be written.

use crate::cluster::{self, Method};
use crate::config::{ClassificationChoice, Config, ConfigError, LasCodes};
use crate::error::Result;
use crate::input::{CLOUD_NAME, Catalog};
use crate::output::objects;
use crate::output::points::copc::CopcFormat;
use crate::output::points::{RESERVED, is_field_of_records};
use crate::output::{LabelOptions, LabelledFile, OutputError, check_names};
use crate::store::{RunDir, StoreError};

/// Name of the report.
pub(super) const REPORT: &str = "report.json";
/// Name of the page.
pub(super) const PAGE: &str = "report.html";
/// Name of the cloud-optimised file.
pub(crate) const CLOUD: &str = CLOUD_NAME;

/// Outputs of a finished run beside the labelled copies; `surfaces`: whether the method finds surfaces.
pub(crate) fn beside(config: &Config, surfaces: bool) -> Vec<&'static str> {
    let of_surfaces = objects::SURFACES.iter().filter(|_| surfaces);
    let tables =
        objects::REGISTRY.iter().chain(of_surfaces).filter(|entry| config.output.writes(entry.name()));
    let mut names: Vec<&str> = tables.map(|entry| entry.file_name).collect();
    names.push(REPORT);
    names.extend(config.output.writes("report").then_some(PAGE));
    names.extend(config.output.writes("copc").then_some(CLOUD));
    names
}

/// Whether a run may write an output of this name beside its labelled copies, whatever its method and
/// settings.
#[must_use]
pub fn is_output(name: &str) -> bool {
    let mut tables = objects::REGISTRY.iter().chain(objects::SURFACES);
    [REPORT, PAGE, CLOUD].contains(&name)
        || tables.any(|entry| entry.file_name == name)
        || cluster::charts().iter().any(|drawn| chart(drawn) == name)
}

/// Whether an output shows objects one by one: a table or the page.
pub(crate) fn shows_objects(config: &Config) -> bool {
    let mut tables = objects::REGISTRY.iter().chain(objects::SURFACES);
    config.output.writes("report") || tables.any(|entry| config.output.writes(entry.name()))
}

/// Limit of the page in bytes; `None` if it is not written.
pub(crate) fn page_limit_bytes(config: &Config) -> Option<u64> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 200 MB, validated")]
    config.output.writes("report").then_some((config.output.report_mb * 1e6) as u64)
}

/// All outputs of a run.
fn planned(config: &Config, surfaces: bool, files: &[LabelledFile]) -> Vec<String> {
    let points = files.iter().filter(|_| config.output.writes("points")).map(LabelledFile::name);
    points.chain(beside(config, surfaces)).map(str::to_owned).collect()
}

/// Whether the settings name only outputs that exist, and a dimension that is free.
pub(crate) fn check_settings(config: &Config) -> Result<(), ConfigError> {
    let dimension = &config.output.dimension;
    if RESERVED.iter().any(|name| name.eq_ignore_ascii_case(dimension)) {
        let expected = format!("a name other than {}", RESERVED.join(" and "));
        return Err(ConfigError::value("output.dimension", dimension, expected));
    }
    if is_field_of_records(dimension) {
        let expected = "a name that no field of LAS records has".to_owned();
        return Err(ConfigError::value("output.dimension", dimension, expected));
    }
    let mut known = vec!["points"];
    known.extend(objects::REGISTRY.iter().map(objects::ObjectFormatEntry::name));
    let of_surfaces: Vec<&str> = objects::SURFACES.iter().map(objects::ObjectFormatEntry::name).collect();
    known.extend(of_surfaces.into_iter().filter(|name| !known.contains(name)).collect::<Vec<_>>());
    known.extend(["charts", "copc", "report"]);
    match config.output.files.iter().find(|name| !known.contains(&name.as_str())) {
        Some(name) => {
            let expected = format!("a list of these: {}", known.join(", "));
            Err(ConfigError::value("output.files", format!("{name:?}"), expected))
        }
        None => Ok(()),
    }
}

/// Name of the dimension with the objects or surfaces of a method.
pub(crate) fn dimension<'a>(config: &'a Config, method: &dyn Method) -> &'a str {
    config.output.dimension_of(method.finds_surfaces())
}

/// The labelled copies of a run, and warnings about them. Their names do not collide.
pub(crate) fn copies(
    catalog: &Catalog,
    config: &Config,
    method: &dyn Method,
    (finds_ground, finds_noise): (bool, bool),
) -> Result<(Vec<LabelledFile>, Vec<String>)> {
    let (set_classification, class_codes) = match &config.output.classification {
        ClassificationChoice::Keep => (false, LasCodes::default()),
        ClassificationChoice::Set(codes) => (true, codes.clone()),
    };
    let options = LabelOptions {
        format: config.output.format,
        dimension: dimension(config, method).to_owned(),
        surfaces: method.finds_surfaces(),
        set_classification,
        finds_ground,
        finds_noise,
        class_codes,
        keep_original: config.output.original_classification,
        kinds: method.kinds(),
    };
    let mut files: Vec<LabelledFile> = Vec::new();
    let mut warnings = Vec::new();
    for file in catalog.files() {
        let labelled = LabelledFile::plan(file, &options)?;
        warnings.extend(labelled.warnings().iter().cloned());
        files.push(labelled);
    }
    if config.output.writes("copc") {
        CopcFormat::check(catalog.files())?;
    }
    if config.output.writes("points") {
        check_names(&files)?;
        check_against_others(catalog, &files, &others(config, method))?;
    }
    Ok((files, warnings))
}

/// Names of the outputs of a run that are not labelled copies.
fn others(config: &Config, method: &dyn Method) -> Vec<String> {
    let charts = method.charts().iter().filter(|_| config.output.writes("charts"));
    let beside = beside(config, method.finds_surfaces()).into_iter().map(str::to_owned);
    beside.chain(charts.map(|name| chart(name))).collect()
}

/// File name of a chart.
pub(super) fn chart(name: &str) -> String {
    format!("{name}.svg")
}

/// Refuses labelled copies with the name of another output, which would overwrite them. Case is ignored,
/// because some file systems ignore it.
fn check_against_others(catalog: &Catalog, files: &[LabelledFile], others: &[String]) -> Result<()> {
    for (input, copy) in catalog.files().iter().zip(files) {
        if let Some(name) = others.iter().find(|name| name.eq_ignore_ascii_case(copy.name())) {
            let (path, name) = (input.path().to_owned(), name.clone());
            return Err(OutputError::NameOfOutput { path, name }.into());
        }
    }
    Ok(())
}

/// Refuses a folder in which a foreign file has the name of an output.
pub(crate) fn refuse_foreign(
    run_dir: &RunDir,
    config: &Config,
    surfaces: bool,
    files: &[LabelledFile],
) -> Result<()> {
    let ours = run_dir.own_outputs()?;
    for name in planned(config, surfaces, files).iter().filter(|name| !ours.contains(name)) {
        let path = run_dir.out().join(name);
        // A broken link is a file of the user, too.
        if path.symlink_metadata().is_ok() {
            return Err(StoreError::InTheWay { path }.into());
        }
    }
    Ok(())
}

/// Claims the names of all outputs. No foreign file has one of them.
pub(crate) fn claim(run_dir: &RunDir, config: &Config, surfaces: bool, files: &[LabelledFile]) -> Result<()> {
    refuse_foreign(run_dir, config, surfaces, files)?;
    Ok(run_dir.claim_outputs(&planned(config, surfaces, files))?)
}

/// Before a run that starts over: removes the outputs of the earlier run that it will not write, and returns
/// their names.
pub(crate) fn remove_superseded(
    run_dir: &RunDir,
    config: &Config,
    surfaces: bool,
    files: &[LabelledFile],
) -> Result<Vec<String>> {
    remove_except(run_dir, &planned(config, surfaces, files))
}

/// After a run: removes outputs of earlier calls that this run does not have, because they would show other
/// objects, and returns their names. Labelled copies and charts in `written` stay.
pub(crate) fn remove_left_out(
    run_dir: &RunDir,
    config: &Config,
    surfaces: bool,
    written: &[String],
) -> Result<Vec<String>> {
    let names: Vec<String> =
        beside(config, surfaces).into_iter().map(str::to_owned).chain(written.iter().cloned()).collect();
    remove_except(run_dir, &names)
}

/// Removes the outputs without one of these names, and returns their names. Only files that chainage wrote
/// are removed.
fn remove_except(run_dir: &RunDir, names: &[String]) -> Result<Vec<String>> {
    let mut removed = Vec::new();
    for name in run_dir.own_outputs()?.into_iter().filter(|name| !names.contains(name)) {
        let path = run_dir.out().join(&name);
        if path.is_file() {
            fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
            removed.push(format!("removed {name}: an earlier call wrote it, and this one does not"));
        }
    }
    run_dir.replace_outputs(names)?;
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_among_the_outputs() {
        let with =
            |settings: &[String], surfaces| beside(&Config::resolve(None, settings).unwrap(), surfaces);
        let beside = |settings: &[String]| with(settings, false);
        let tables =
            &["objects.csv", "objects.geojson", "objects.gpkg"][..2 + usize::from(cfg!(feature = "gpkg"))];
        assert_eq!(beside(&[]), [tables, &["report.json", "report.html"]].concat());
        assert_eq!(beside(&["output.report=false".to_owned()]), [tables, &["report.json"]].concat());
        let csv = ["output.files=[\"csv\"]".to_owned()];
        assert_eq!(beside(&csv), ["objects.csv", "report.json"]);
        assert_eq!(with(&csv, true), ["objects.csv", "surfaces.csv", "report.json"]);
        let shows = |files: &str| {
            let files = [format!("output.files=[{files}]")];
            shows_objects(&Config::resolve(None, &files).unwrap())
        };
        assert!(shows("\"points\", \"csv\"") && shows("\"report\"") && !shows("\"points\", \"copc\""));
    }
}
