//! Learns the classes of voxels from labelled drives. The flow stops after the step that gives samples.
//!
//! The model of the context must learn from classes that are as often wrong as the classes of a new drive. So
//! two further models of shapes each learn from one half of the drives, and classify the other half. A single
//! drive has no other half: it is classified by the model that learned from it.
//!
//! Another call learns the models of objects, from other drives. They must learn from objects that are as
//! often wrong as the objects of a new drive, and the models of voxels do too well on the drives that they
//! learned from.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::boosting::{self, Confusion, Model, Samples, TrainedOn, learn};
use crate::cluster::Scene;
use crate::cluster::street::{
    self, CLASS_NAMES, CONTEXT_FEATURES, Counts, FEATURES, Known, OBJECT_FEATURES, Purpose, Sample,
    SamplesOfObjects, StreetModel, Training, WHOLE_CLASSES, WHOLE_FEATURES,
};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::input::{Catalog, InputError, InputFile};
use crate::model::{Field, Lattice};
use crate::run::chain::{Chain, Registries};
use crate::run::engine::{CancelToken, Driver, Event, Here, Observer};
use crate::run::error::RunError;
use crate::run::open::{self, Opened};
use crate::run::{computed, flow};

/// Names under which the learning is listed among the passes.
const LEARN_HALVES: &str = "learn from half of the drives";
const LEARN_SHAPES: &str = "learn shapes";
const LEARN_CONTEXT: &str = "learn context";
const LEARN_OBJECTS: &str = "learn objects";
const LEARN_WHOLES: &str = "learn pieces";

/// A request to learn from labelled drives.
#[derive(Debug, Clone)]
pub struct TrainRequest<'a> {
    /// Labelled drives: for each a file, a folder or a pattern.
    pub drives: Vec<PathBuf>,
    /// Folder for the state of one drive at a time. It is created, and removed at the end.
    pub scratch: PathBuf,
    /// Settings. The filters of noise and ground are the same as in a run.
    pub config: Config,
    /// The registries of methods.
    pub registries: Registries<'a>,
    /// Settings of the learning. Their seed also chooses the samples. The context learns in half of the
    /// rounds.
    pub settings: boosting::Settings,
    /// Largest number of samples per class and drive. The context learns from four times as many of all
    /// classes together.
    pub samples: usize,
    /// Shares of the points in further copies of each drive, above 0 and below 1.
    pub thin: Vec<f64>,
}

/// The result of learning.
#[derive(Debug)]
pub struct Trained {
    /// The model.
    pub model: StreetModel,
    /// How the model classifies voxels of the same drives that were held out. For [`train_objects`]: how it
    /// names held-out objects.
    pub held_out: Confusion,
    /// For [`train_objects`]: how the model distinguishes whole objects from pieces.
    pub wholes: Option<Confusion>,
}

/// Reads a model that [`train`] returned and a user stored. Its features and classes must be those of this
/// program.
///
/// # Errors
/// [`InputError::Read`], or a [`BoostingError`](boosting::BoostingError) that says what is wrong with the
/// file.
pub fn read_model(path: &Path) -> Result<StreetModel> {
    Ok(StreetModel::decode(&path.display().to_string(), &content_of(path)?)?)
}

/// Reads the parts of a model that classify voxels, for [`train_objects`]. The other parts may be for another
/// version of the program.
///
/// # Errors
/// As [`read_model`].
pub fn read_model_of_voxels(path: &Path) -> Result<StreetModel> {
    Ok(StreetModel::decode_of_voxels(&path.display().to_string(), &content_of(path)?)?)
}

fn content_of(path: &Path) -> Result<Vec<u8>, InputError> {
    std::fs::read(path).map_err(|source| InputError::Model { path: path.to_owned(), source })
}

/// The model of a scene that comes with the program.
///
/// # Errors
/// A [`BoostingError`](boosting::BoostingError), if the program was built with a model that it cannot use.
pub fn built_in_model(scene: Scene) -> Result<StreetModel> {
    Ok((*street::built_in(scene)?).clone())
}

/// Samples of drives: those to learn from, by half of the drives, and the held-out ones.
struct Sampled {
    halves: [Samples; 2],
    held_out: Samples,
    sources: Vec<TrainedOn>,
}

impl Sampled {
    fn new(features: &[&str], classes: &[&str]) -> Self {
        let none = || Samples::new(features, classes);
        Self { halves: [none(), none()], held_out: none(), sources: Vec::new() }
    }

    fn add(&mut self, half: usize, name: String, samples: &[Sample]) -> Result<()> {
        let mut counts = vec![0; self.held_out.classes().len()];
        for Sample { class, held_out, features, .. } in samples {
            if *held_out {
                self.held_out.push(features, *class)?;
            } else {
                self.halves[half].push(features, *class)?;
                counts[usize::from(*class)] += 1;
            }
        }
        self.sources.push(TrainedOn { name, samples: counts });
        Ok(())
    }

    /// Adds samples that are changed copies. They do not count as samples of the drive.
    fn add_copies(&mut self, half: usize, copies: &[Sample]) -> Result<()> {
        for copy in copies {
            self.halves[half].push(&copy.features, copy.class)?;
        }
        Ok(())
    }
}

/// Learns a model.
///
/// # Errors
/// Any [`Error`](crate::Error): a drive without `gt_class`, settings out of range, or any error of a run.
pub fn train(request: &TrainRequest<'_>, observer: &dyn Observer, cancel: &CancelToken) -> Result<Trained> {
    request.settings.validate()?;
    let (seed, most) = (request.settings.seed, request.samples);
    let purpose = |_| Ok(Purpose::Shapes { seed, most });
    let shapes = sample(request, &FEATURES, observer, cancel, &purpose)?;
    let Sampled { halves: [mut all, other], sources, .. } = shapes;
    // The model that classifies the drives of one half has learned from the other half.
    let of_halves = if other.is_empty() {
        None
    } else {
        let of_first = learned(LEARN_HALVES, &all, &request.settings, observer, cancel)?;
        Some([learned(LEARN_HALVES, &other, &request.settings, observer, cancel)?, of_first])
    };
    all.append(other)?;
    let shapes = learned(LEARN_SHAPES, &all, &request.settings, observer, cancel)?.trained_on(sources)?;
    drop(all);

    let classifies = |half: usize| of_halves.as_ref().map_or(&shapes, |halves| &halves[half]);
    let purpose =
        |half: usize| Ok(Purpose::Context { seed, most, shapes: Box::new(classifies(half).clone()) });
    let context = sample(request, &CONTEXT_FEATURES, observer, cancel, &purpose)?;
    let Sampled { halves: [mut all, other], held_out, sources } = context;
    all.append(other)?;
    let settings =
        boosting::Settings { rounds: request.settings.rounds.div_ceil(2), ..request.settings.clone() };
    let context = learned(LEARN_CONTEXT, &all, &settings, observer, cancel)?.trained_on(sources)?;
    let held_out = confusion::<{ CLASS_NAMES.len() }>(&context, &held_out)?;
    Ok(Trained {
        model: StreetModel { shapes, context, objects: None, wholes: None },
        held_out,
        wholes: None,
    })
}

/// Learns the models of objects for a model whose models of voxels exist. The models of voxels should have
/// learned from other drives. Names are also learned from copies of the objects with doubtful shares. From
/// drives that do not say which object a point belongs to, only names are learned. If all objects of all
/// drives are whole, there is no model of wholes.
///
/// # Errors
/// As [`train`].
pub fn train_objects(
    model: &StreetModel,
    request: &TrainRequest<'_>,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<Trained> {
    request.settings.validate()?;
    let voxels = StreetModel { objects: None, wholes: None, ..model.clone() };
    let mut names = Sampled::new(&OBJECT_FEATURES, &CLASS_NAMES);
    let mut wholes = Sampled::new(&WHOLE_FEATURES, &WHOLE_CLASSES);
    each_copy(request, observer, cancel, &mut |work, number, share| {
        let samples = work.objects(Purpose::objects(voxels.clone())?, share)?;
        let name = || name_of(work.drive, share);
        names.add(number % 2, name(), &samples.names)?;
        names.add_copies(number % 2, &street::doubtful(&samples.names))?;
        wholes.add(number % 2, name(), &samples.wholes)
    })?;
    let learn = |pass, sampled: Sampled| {
        let Sampled { halves: [mut all, other], held_out, sources } = sampled;
        all.append(other)?;
        Ok::<_, Error>((
            learned(pass, &all, &request.settings, observer, cancel)?.trained_on(sources)?,
            held_out,
        ))
    };
    let (objects, held_out) = learn(LEARN_OBJECTS, names)?;
    let held_out = confusion::<{ CLASS_NAMES.len() }>(&objects, &held_out)?;
    // If all objects are whole, or none is known, there is nothing to distinguish.
    let [first, second] = wholes.halves.each_ref().map(Samples::counts);
    let differ = first.iter().zip(second).filter(|(first, second)| **first + second > 0).count() > 1;
    let (wholes, unseen) = if differ {
        let (wholes, unseen) = learn(LEARN_WHOLES, wholes)?;
        let unseen = confusion::<{ WHOLE_CLASSES.len() }>(&wholes, &unseen)?;
        (Some(wholes), Some(unseen))
    } else {
        (None, None)
    };
    let model = StreetModel { objects: Some(objects), wholes, ..voxels };
    Ok(Trained { model, held_out, wholes: unseen })
}

/// How a model classifies samples.
fn confusion<const CLASSES: usize>(model: &Model, samples: &Samples) -> Result<Confusion> {
    let mut confusion = Confusion::new(CLASSES);
    let shares = model.shares::<CLASSES>(samples.values())?;
    for (shares, &class) in shares.iter().zip(samples.class()) {
        confusion.add(usize::from(class), usize::from(street::class(shares)), 1);
    }
    Ok(confusion)
}

/// Calls `what` with the work, the number of the drive and the share, for each drive and each share of its
/// points.
fn each_copy(
    request: &TrainRequest<'_>,
    observer: &dyn Observer,
    cancel: &CancelToken,
    what: &mut dyn FnMut(&Work<'_>, usize, f64) -> Result<()>,
) -> Result<()> {
    for (number, drive) in request.drives.iter().enumerate() {
        let work = Work { request, drive, observer, cancel };
        for share in std::iter::once(1.0).chain(request.thin.iter().copied()) {
            what(&work, number, share)?;
        }
        work.clear();
    }
    Ok(())
}

/// The samples of all drives, every other drive in the second half.
fn sample(
    request: &TrainRequest<'_>,
    features: &[&str],
    observer: &dyn Observer,
    cancel: &CancelToken,
    purpose: &dyn Fn(usize) -> Result<Purpose>,
) -> Result<Sampled> {
    let mut sampled = Sampled::new(features, &CLASS_NAMES);
    each_copy(request, observer, cancel, &mut |work, number, share| {
        let half = number % 2;
        let samples = work.voxels(purpose(half)?, share)?;
        sampled.add(half, name_of(work.drive, share), &samples)
    })?;
    Ok(sampled)
}

/// Learns one model and reports its progress.
fn learned(
    pass: &'static str,
    samples: &Samples,
    settings: &boosting::Settings,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<Model> {
    let units = settings.rounds;
    let points = samples.len() as u64;
    let started = Instant::now();
    observer.event(&Event::PassStarted {
        pass,
        units,
        done: 0,
        points: points * units as u64,
        points_done: 0,
    });
    let tell = |round: usize| {
        let seconds = started.elapsed().as_secs_f64();
        observer.event(&Event::UnitFinished { pass, unit: round - 1, points, seconds });
        if cancel.is_cancelled() {
            return Err(RunError::TrainingInterrupted { pass: pass.to_owned() }.into());
        }
        Ok(())
    };
    let model = learn(samples, settings, &tell)?;
    observer.event(&Event::PassFinished { pass, seconds: started.elapsed().as_secs_f64() });
    Ok(model)
}

/// Scores a model with every labelled voxel of a drive, as `street` classifies it. Uses only the folder, the
/// settings of the run and the registries of the request.
///
/// # Errors
/// As [`train`].
pub fn score_model(
    model: &StreetModel,
    drive: &Path,
    request: &TrainRequest<'_>,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<Confusion> {
    let work = Work { request, drive, observer, cancel };
    let (payloads, _) = work.payloads(Purpose::Score(Box::new(model.clone())), 1.0)?;
    work.clear();
    let counts: Counts = Training::counts(&payloads)?;
    let mut confusion = Confusion::new(CLASS_NAMES.len());
    for (truth, row) in counts.iter().enumerate() {
        row.iter().enumerate().for_each(|(called, &rows)| confusion.add(truth, called, rows));
    }
    Ok(confusion)
}

/// The name of a drive in the model: its file or folder, and the share of its points if not all are used.
fn name_of(drive: &Path, share: f64) -> String {
    let name = drive.file_name().unwrap_or(drive.as_os_str()).to_string_lossy();
    if share < 1.0 { format!("{name}, {share} of the points") } else { name.into_owned() }
}

/// Work on one drive.
struct Work<'a> {
    request: &'a TrainRequest<'a>,
    drive: &'a Path,
    observer: &'a dyn Observer,
    cancel: &'a CancelToken,
}

impl Work<'_> {
    fn state(&self) -> PathBuf {
        self.request.scratch.join("drive")
    }

    /// Removes the state of the drive. If this fails, the files remain among the temporary files.
    fn clear(&self) {
        let _ = fs_err::remove_dir_all(self.state());
    }

    /// Samples of the voxels of a share of the points.
    fn voxels(&self, purpose: Purpose, share: f64) -> Result<Vec<Sample>> {
        Training::samples(&self.payloads(purpose, share)?.0)
    }

    /// Samples of the objects in a share of the points.
    fn objects(&self, purpose: Purpose, share: f64) -> Result<SamplesOfObjects> {
        let (payloads, lattice) = self.payloads(purpose, share)?;
        Training::objects(&payloads, lattice)
    }

    /// The results of the last step of [`Training`] for a share of the points, and the lattice of the drive.
    /// The state does not outlive the call of the user, so an interruption gives another error than in a run.
    fn payloads(&self, purpose: Purpose, share: f64) -> Result<(Vec<Vec<u8>>, Lattice)> {
        self.computed(purpose, share).map_err(|error| match error.cause() {
            Some(RunError::Interrupted { pass, .. }) => {
                let pass = format!("{pass} of {}", self.drive.display());
                RunError::TrainingInterrupted { pass }.into()
            }
            _ => error,
        })
    }

    fn computed(&self, purpose: Purpose, share: f64) -> Result<(Vec<Vec<u8>>, Lattice)> {
        let config = &self.request.config;
        let inputs = [self.drive.to_owned()];
        let catalog = open::catalog(&inputs, config)?;
        let unlabelled = |file: &&InputFile| file.layout().field(Field::Class).is_none();
        if let Some(file) = catalog.files().iter().find(unlabelled) {
            let name = Field::Class.name();
            return Err(InputError::NoLabels { path: file.path().to_owned(), name }.into());
        }
        let lattice = catalog.lattice();
        let known = known(&catalog, matches!(purpose, Purpose::Objects(_)));
        let method = Training { purpose, share, known };
        let chain =
            Chain::build(config, &self.request.registries, lattice)?.before(Box::new(method), lattice);
        let run_dir = open::lock(&catalog, &self.state())?;
        run_dir.begin(false)?;
        let warnings = catalog.warnings().to_vec();
        let open = Opened::to_run(catalog, chain, config, &run_dir)?;
        open.record(&run_dir, &inputs)?;
        let limits = open.budget.limits();
        let mut driver = Here::new(&run_dir, limits, config.run.fail_fast, self.observer, self.cancel);
        let surveyed = computed(flow::survey(&open, &mut driver, Some(&run_dir))?)?;
        for text in warnings.iter().chain(&surveyed.warnings) {
            driver.tell(&Event::Warning { text });
        }
        let planned = computed(flow::plan(&open, &mut driver, surveyed)?)?;
        let payloads = flow::payloads_of_last_step(&open, &mut driver, &run_dir, &planned)?;
        Ok((computed(payloads)?, lattice))
    }
}

/// The labels that every file has for its points.
fn known(catalog: &Catalog, with_objects: bool) -> Known {
    let has = |field| catalog.files().iter().all(|file| file.layout().field(field).is_some());
    let instance_bytes = match with_objects {
        true if has(Field::InstanceUpper) => 4,
        true if has(Field::Instance) => 2,
        _ => 0,
    };
    Known { has_core: has(Field::Core), instance_bytes }
}
