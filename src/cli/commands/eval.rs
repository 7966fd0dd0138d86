//! `chainage eval`: turns arguments into settings, and writes results to files and terminal. The figures are
//! made in the library.

use std::path::{Path, PathBuf};

use chainage::config::{ConfigError, LengthUnit};
use chainage::eval::metrics::hoover::Tolerance;
use chainage::eval::{
    self, ClassTable, CompareSettings, Counted, Evaluation, MetricSettings, Provenance, Report,
};
use chainage::input::{Catalog, InputOptions};
use chainage::survey::{Axis, AxisSource, read_trajectory};

use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::whole;
use crate::cli::print::{self, JsonOutput, deliver, is_standard_output, note};
use crate::cli::{exit, progress};

/// Scores a segmentation against reference labels.
///
/// Points are matched by the order of records. Where the orders differ, points are matched by coordinates and
/// GPS time. Without --reference, the files PRED must contain the reference labels as well.
#[derive(Debug, clap::Args)]
pub(crate) struct EvalArgs {
    /// LAS or LAZ files with the segmentation, folders or patterns
    #[arg(value_name = "PRED", required = true)]
    prediction: Vec<PathBuf>,

    /// Files with the reference labels [default: the files PRED]
    #[arg(long, value_name = "REF", num_args = 1.., help_heading = "Input")]
    reference: Vec<PathBuf>,

    /// Trajectory for the chainage of objects, as `chainage run` reads it: CSV with the columns gps_time, x
    /// and y in the units of the files [default: the principal axis of the objects]
    #[arg(long, value_name = "CSV", help_heading = "Input")]
    trajectory: Option<PathBuf>,

    /// Dimension with the ids of the predicted segments; 0 or less: no segment [default: cluster_id, or
    /// surface_id if the files have only that]
    #[arg(long, value_name = "NAME", help_heading = "Labels")]
    prediction_dim: Option<String>,

    /// Dimension with the ids of the reference objects; 0 or less: no object
    #[arg(long, value_name = "NAME", default_value = "gt_instance", help_heading = "Labels")]
    reference_dim: String,

    /// Dimension with the classes of the reference, or `none`
    #[arg(long, value_name = "NAME", default_value = "gt_class", help_heading = "Labels")]
    class_dim: String,

    /// Dimension of the predicted classes of objects, to score classes too, or `none` [default: object_class
    /// if all files have it]
    #[arg(long, value_name = "NAME", help_heading = "Labels")]
    object_class_dim: Option<String>,

    /// TOML file with the names of the reference classes, and with the codes of ground and noise [default:
    /// the classes of `chainage synth`]
    #[arg(long, value_name = "FILE", help_heading = "Labels")]
    classes: Option<PathBuf>,

    /// LAS classes of ground in the prediction
    #[arg(long, value_name = "CODE", value_delimiter = ',', default_value = "2", value_parser = whole::<u16>(0..=255, 2), help_heading = "Labels")]
    ground_class: Vec<u16>,

    /// LAS classes of noise in the prediction
    #[arg(long, value_name = "CODE", value_delimiter = ',', default_value = "7,18", value_parser = whole::<u16>(0..=255, 7), help_heading = "Labels")]
    noise_class: Vec<u16>,

    /// Match points by coordinates only, because some software changes GPS times
    #[arg(long, help_heading = "Matching")]
    ignore_time: bool,

    /// Folder for scratch files: up to 32 bytes per point if the orders differ [default: the system's
    /// temporary folder]
    #[arg(long, value_name = "DIR", help_heading = "Matching")]
    scratch: Option<PathBuf>,

    /// Smallest number of points of an object, and of a segment for PQ; smaller ones are left out
    #[arg(
        long,
        value_name = "POINTS",
        default_value_t = 30,
        value_parser = whole::<u64>(1..=u64::MAX, 30),
        help_heading = "Metrics"
    )]
    min_points: u64,

    /// Tolerances of the classes of Hoover et al. 1996: shares of overlap from 0.5 to 1
    #[arg(
        long,
        value_name = "SHARE",
        value_delimiter = ',',
        default_value = "0.8,0.5",
        value_parser = tolerance,
        help_heading = "Metrics"
    )]
    hoover: Vec<Tolerance>,

    #[command(flatten)]
    json: JsonOutput,

    /// Write every reference object with its result in each metric as CSV (-: to standard output)
    #[arg(long, value_name = "FILE", help_heading = "Output", value_parser = print::target())]
    objects: Option<PathBuf>,

    /// Number of objects without a match that are listed below the table
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = whole::<usize>(0..=u64::MAX, 10), help_heading = "Output")]
    worst: usize,
}

/// Reads a tolerance. The library words the error; clap adds the option and the value.
fn tolerance(text: &str) -> Result<Tolerance, String> {
    text.parse().map_err(|error: ConfigError| error.to_string())
}

/// The report of the run whose outputs are in a folder, if there is one.
fn report_of(folder: &Path) -> Option<serde_json::Value> {
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).ok()?).ok()
}

/// The warning if a folder has the result of a section, which is scored like a whole drive.
fn section_warning(folder: &Path) -> Option<String> {
    let report = report_of(folder)?;
    let metres = |key: &str| report.pointer(&format!("/result/section/{key}"))?.as_f64();
    let (from, to, length) = (metres("from_m")?, metres("to_m")?, metres("length_m")?);
    Some(format!(
        "{} is the result of chainage {from:.0} to {to:.0} m of {length:.0} m: objects outside count as lost",
        folder.display()
    ))
}

impl EvalArgs {
    /// Compares, and shows or writes the requested results.
    pub(crate) fn run(&self) -> Outcome {
        let (counted, metrics, trajectory, provenance) = self.compare()?;
        let evaluation = Evaluation::of(counted.table, &metrics, counted.lattice);
        let axis = trajectory.unwrap_or_else(|| {
            let places = evaluation.judged.scene.objects.iter().map(|object| object.centroid_m);
            Axis::principal_of(&places.map(|[x, y, _]| [x, y]).collect::<Vec<_>>())
        });
        self.show(&Report::new(&evaluation, &metrics, &axis, provenance))?;
        Ok(exit::DONE)
    }

    fn compare(&self) -> chainage::Result<(Counted, MetricSettings, Option<Axis>, Provenance)> {
        self.one_standard_output()?;
        // Every record is read once, so mapping saves no time. How many pages of a mapped file are resident
        // depends on how the file came into the page cache (7 to 18 MB for four blocks of 2 MB, Linux 6.18).
        let options = InputOptions { mmap: false, unit: self.unit() };
        let metrics = self.metrics()?;
        let prediction = Catalog::open(&self.prediction, &options)?;
        let reference = match self.reference.as_slice() {
            [] => None,
            files => Some(Catalog::open(files, &options)?),
        };
        for warning in
            [Some(&prediction), reference.as_ref()].into_iter().flatten().flat_map(Catalog::warnings)
        {
            note(&progress::warning(warning));
        }
        for folder in self.prediction.iter().filter(|path| path.is_dir()) {
            if let Some(text) = section_warning(folder) {
                note(&progress::warning(&text));
            }
        }
        let trajectory = self.axis(&prediction)?;
        let comparison = self.comparison();
        if let Some(text) = comparison.warning(&prediction) {
            note(&progress::warning(&text));
        }
        let counted = eval::count(&prediction, reference.as_ref(), &comparison, &note)?;
        let mut provenance =
            self.provenance(&prediction, reference.as_ref().unwrap_or(&prediction), &counted);
        if let (Some(path), Some(_)) = (&self.trajectory, &trajectory) {
            provenance.chainage_along = format!("trajectory {}", path.display());
        }
        Ok((counted, metrics, trajectory, provenance))
    }

    /// The unit of coordinates in the settings of the run that made the segmentation.
    fn unit(&self) -> LengthUnit {
        let reports = self.prediction.iter().filter_map(|path| report_of(path));
        let told = |report: serde_json::Value| {
            serde_json::from_value(report.pointer("/configuration/input/unit")?.clone()).ok()
        };
        reports.filter_map(told).next().unwrap_or(LengthUnit::Auto)
    }

    /// The axis along the trajectory, if one with a length is given.
    fn axis(&self, files: &Catalog) -> chainage::Result<Option<Axis>> {
        let Some(path) = &self.trajectory else { return Ok(None) };
        let [unit_m, ..] = files.units_m();
        let axis = Axis::from_runs(AxisSource::Trajectory, read_trajectory(path, unit_m)?);
        if axis.is_none() {
            let text = format!("the trajectory {} has no length: it is not used", path.display());
            note(&progress::warning(&text));
        }
        Ok(axis)
    }

    fn one_standard_output(&self) -> Result<(), ConfigError> {
        if self.json.is_printed() && self.objects.as_deref().is_some_and(is_standard_output) {
            Err(ConfigError::value("--objects", "-", "a file when --json is standard output"))
        } else {
            Ok(())
        }
    }

    fn has_classes(&self) -> bool {
        self.class_dim != "none"
    }

    fn metrics(&self) -> Result<MetricSettings, chainage::Error> {
        let classes = match &self.classes {
            _ if !self.has_classes() => ClassTable::unclassified(),
            None => ClassTable::default(),
            Some(path) => {
                let text = std::fs::read_to_string(path)
                    .map_err(|source| ConfigError::Read { path: path.clone(), source })?;
                ClassTable::parse(&path.display().to_string(), &text)?
            }
        };
        Ok(MetricSettings { min_points: self.min_points, hoover: self.hoover.clone(), classes })
    }

    fn comparison(&self) -> CompareSettings {
        CompareSettings {
            prediction_dim: self.prediction_dim.clone(),
            reference_dim: self.reference_dim.clone(),
            class_dim: self.has_classes().then(|| self.class_dim.clone()),
            named_dim: self.object_class_dim.clone(),
            ground_classes: self.ground_class.clone(),
            noise_classes: self.noise_class.clone(),
            ignore_time: self.ignore_time,
            scratch: self.scratch.clone().unwrap_or_else(std::env::temp_dir),
        }
    }

    fn provenance(&self, prediction: &Catalog, reference: &Catalog, counted: &Counted) -> Provenance {
        let paths = |catalog: &Catalog| {
            catalog.files().iter().map(|file| file.path().display().to_string()).collect()
        };
        Provenance {
            prediction: paths(prediction),
            reference: paths(reference),
            prediction_dim: counted.prediction_dim.clone(),
            reference_dim: self.reference_dim.clone(),
            class_dim: self.has_classes().then(|| self.class_dim.clone()),
            named_dim: counted.named_dim.clone(),
            matched_by: counted.matching.name().to_owned(),
            points_withheld: counted.withheld,
            chainage_along: "principal axis of the objects".to_owned(),
        }
    }

    fn show(&self, report: &Report<'_>) -> Result<(), CliError> {
        let json = self.json.deliver_by(|to| report.write_json(to))?;
        let objects = deliver(self.objects.as_deref(), |to| report.write_objects_csv(to))?;
        if json || objects { Ok(()) } else { print::text(&report.text(self.worst)) }
    }
}
