//! The names of the outputs of a run, and whether they may be written.

use crate::config::{ClassificationChoice, Config};
use crate::error::Result;
use crate::input::Catalog;
use crate::output::objects;
use crate::output::{LabelOptions, LabelledFile, check_names};
use crate::store::{RunDir, StoreError};

/// Name of the report.
pub(super) const REPORT: &str = "report.json";
/// Outputs of a finished run beside the labelled copies.
pub(super) const BESIDE: [&str; objects::REGISTRY.len() + 1] = {
    let mut names = [REPORT; objects::REGISTRY.len() + 1];
    let mut index = 0;
    while index < objects::REGISTRY.len() {
        names[index] = objects::REGISTRY[index].file_name;
        index += 1;
    }
    names
};

/// The labelled copies to be written. Their names do not collide, and no foreign file has the name of an
/// output.
pub(crate) fn plan_files(
    catalog: &Catalog,
    config: &Config,
    object_class: bool,
    run_dir: &RunDir,
) -> Result<(Vec<LabelledFile>, Vec<String>)> {
    let options = LabelOptions {
        format: config.output.format,
        dimension: config.output.dimension.clone(),
        set_classification: config.output.classification == ClassificationChoice::Set,
        keep_original: config.output.original_classification,
        object_class,
    };
    let ours = run_dir.own_outputs()?;
    let mut files: Vec<LabelledFile> = Vec::new();
    let mut warnings = Vec::new();
    for file in catalog.files() {
        let labelled = LabelledFile::plan(file, &options)?;
        warnings.extend(labelled.warnings().iter().cloned());
        files.push(labelled);
    }
    check_names(&files)?;
    let names: Vec<String> = files.iter().map(LabelledFile::name).chain(BESIDE).map(str::to_owned).collect();
    for name in names.iter().filter(|name| !ours.contains(name)) {
        let path = run_dir.out().join(name);
        if path.exists() {
            return Err(StoreError::InTheWay { path }.into());
        }
    }
    run_dir.claim_outputs(&names)?;
    Ok((files, warnings))
}

/// Removes the outputs of an earlier run that this run will not write, and names them. Only files that chainage wrote
/// are removed.
pub(crate) fn remove_superseded(run_dir: &RunDir, files: &[LabelledFile]) -> Result<Vec<String>> {
    let names: Vec<String> = files.iter().map(LabelledFile::name).chain(BESIDE).map(str::to_owned).collect();
    let mut removed = Vec::new();
    for name in run_dir.own_outputs()?.into_iter().filter(|name| !names.contains(name)) {
        let path = run_dir.out().join(&name);
        if path.is_file() {
            fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
            removed.push(format!("removed {name}: the earlier run wrote it, and this one does not"));
        }
    }
    run_dir.replace_outputs(&names)?;
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_among_the_outputs() {
        let mut expected = vec!["objects.csv", "objects.geojson"];
        if cfg!(feature = "gpkg") {
            expected.push("objects.gpkg");
        }
        expected.push("report.json");
        assert_eq!(BESIDE.to_vec(), expected);
    }
}
