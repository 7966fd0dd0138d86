//! A request for a run, and the start of a run: its run directory is locked, and its drive is opened.

use std::path::PathBuf;

use crate::config::{Config, LengthUnit};
use crate::error::Result;
use crate::input::{Catalog, Crs};
use crate::output::LabelledFile;
use crate::run::chain::{Chain, Registries};
use crate::run::drive::identity;
use crate::run::finish::names;
use crate::run::foreign;
use crate::run::open::{self, Opened};
use crate::store::RunDir;

/// A request for a run.
#[derive(Debug, Clone)]
pub struct RunRequest<'a> {
    /// LAS/LAZ files, folders and patterns.
    pub inputs: Vec<PathBuf>,
    /// Output directory.
    pub out: PathBuf,
    /// Settings.
    pub config: Config,
    /// Whether to discard the state of an earlier run in `out`.
    pub fresh: bool,
    /// The registries of methods.
    pub registries: Registries<'a>,
}

/// A run that has started. Nothing is computed yet.
pub(crate) struct Begun<'a> {
    pub(crate) run_dir: RunDir,
    pub(crate) open: Opened<'a>,
    /// The labelled copies.
    pub(crate) labelled: Vec<LabelledFile>,
    pub(crate) warnings: Vec<String>,
}

impl<'a> Begun<'a> {
    /// Locks the run directory of a request, and opens its drive.
    pub(crate) fn from(request: &'a RunRequest<'_>) -> Result<Self> {
        let config = &request.config;
        config.validate()?;
        let catalog = open::catalog_beside(&request.inputs, config, Some(&request.out))?;
        // Checked before the names of the copies: if the output folder contains input, each input file would
        // be found twice.
        identity::check_apart(&catalog, &request.out)?;
        let chain = Chain::build(config, &request.registries, catalog.lattice())?;
        let (mut labelled, file_warnings) =
            names::copies(&catalog, config, chain.method.as_ref(), chain.finds())?;
        labelled.iter_mut().for_each(|file| file.in_folder(&request.out));
        let surfaces = chain.method.finds_surfaces();
        // Every check that can refuse the request comes before the state of an earlier run is discarded.
        let run_dir = open::lock(&catalog, &request.out)?;
        names::refuse_foreign(&run_dir, config, surfaces, &labelled)?;
        run_dir.begin(request.fresh)?;
        foreign::remove_left_behind(&run_dir)?;
        let mut warnings = warnings_of(config, &chain, &catalog, file_warnings);
        warnings.extend(open::file_system_warning(&request.inputs, config));
        warnings.extend(foreign::warnings(&run_dir)?);
        let open = Opened::to_run(catalog, chain, config, &run_dir)?;
        // Not before the input is accepted: a file with a claimed name counts as an output of a run, and a
        // later call may remove it.
        names::claim(&run_dir, config, surfaces, &labelled)?;
        if request.fresh {
            warnings.extend(names::remove_superseded(&run_dir, config, surfaces, &labelled)?);
        }
        open.record(&run_dir, &request.inputs)?;
        Ok(Self { run_dir, open, labelled, warnings })
    }
}

/// The warnings about a drive and its settings. Each process of a run finds the same. `of_copies` are the
/// warnings about the labelled copies.
pub(crate) fn warnings_of(
    config: &Config,
    chain: &Chain,
    catalog: &Catalog,
    of_copies: Vec<String>,
) -> Vec<String> {
    let mut warnings = config.warnings().to_vec();
    warnings.extend(chain.warnings.iter().cloned());
    warnings.extend(catalog.warnings().iter().cloned());
    warnings.extend(of_copies);
    let crs = catalog.crs();
    warnings.extend(nameless_warning(crs, config));
    if config.output.writes("copc") && crs.is_known() && crs.text().is_none() {
        warnings.push(format!(
            "{} names no coordinate system: COPC stores it as well-known text, and the files have none ({})",
            names::CLOUD,
            crs.description
        ));
    }
    warnings
}

/// The warning about a coordinate reference system that is not known, or that the GeoJSON cannot name.
fn nameless_warning(crs: &Crs, config: &Config) -> Option<String> {
    let is_written = config.output.writes("geojson");
    match crs.epsg {
        Some(_) => None,
        None if crs.is_known() => is_written.then(|| {
            format!(
                "objects.geojson names no coordinate system, because no EPSG code of {} is known: other programs may \
                 take its coordinates for longitude and latitude (objects.gpkg does not have this problem)",
                crs.description
            )
        }),
        None => {
            let metres = (config.input.unit == LengthUnit::Auto)
                .then_some("coordinates are taken as metres (if they are feet, set input.unit)");
            let degrees = is_written.then_some("other programs may take objects.geojson for degrees");
            let effects: Vec<&str> = [metres, degrees].into_iter().flatten().collect();
            let why = match crs.not_understood {
                true => "the coordinate system is given but not understood",
                false => "no coordinate system is known",
            };
            (!effects.is_empty()).then(|| format!("{why}: {}", effects.join(", and ")))
        }
    }
}
