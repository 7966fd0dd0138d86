//! `chainage train`: learns the model of `street` from labelled drives, and writes it with a card that says
//! from which drives it learned and how well it classifies.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use chainage::boosting::{Confusion, Model, Settings as Learning};
use chainage::cluster::Scene;
use chainage::config::ConfigError;
use chainage::run::{
    CancelToken, Registries, StreetModel, TrainRequest, Trained, built_in_model, read_model,
    read_model_of_voxels, score_model, train, train_objects,
};
use chainage::scratch_folder::ScratchFolder;

use crate::cli::drive_args::LabelledSettings;
use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::{real, whole};
use crate::cli::print::{self, deliver};
use crate::cli::progress::{Kind, Progress};
use crate::cli::{exit, interrupt, scratch};

/// The two forms of use. One line with everything optional would show combinations that are refused.
const USAGE: &str = "chainage train [OPTIONS] --out <MODEL> <DRIVES>...\n       \
                     chainage train [OPTIONS] --model <MODEL> --test <DRIVES>...";

/// Train a model of the method `street` on labelled drives.
///
/// A labelled drive has the extra dimension gt_class (1 ground, 2 tree, 3 pole, 4 vehicle, 5 building, 6
/// fence or hedge, 7 person or small furniture, 8 wire; 0 is not learned). Drives of `chainage synth` have
/// it.
/// Where it also has gt_core, only points with gt_core 1 count. Same drives, settings and seed: same bytes.
///
/// A model classifies voxels. A second call, with --onto and other drives, adds the part that names objects
/// as a whole.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  chainage synth mixed -o one --length 1km\n  \
                        chainage train one -o voxels.model --thin 0.5,0.25\n  \
                        chainage train two --onto voxels.model -o my.model --thin 0.5,0.25\n  \
                        chainage run drive.laz -o out --model my.model\n  \
                        chainage train --model my.model --test other_drive.laz",
    override_usage = USAGE
)]
pub(crate) struct TrainArgs {
    /// Labelled drives: each a LAS or LAZ file, a folder of them, or a pattern
    #[arg(value_name = "DRIVES", required_unless_present = "model")]
    drives: Vec<PathBuf>,
    /// Write the model here
    #[arg(short, long, value_name = "MODEL", required_unless_present = "model", value_parser = print::target())]
    out: Option<PathBuf>,
    /// Keep the parts of this model that classify voxels, and learn the parts that name objects and find
    /// pieces of them, from drives that the model has not learned from; pieces need drives with gt_instance
    #[arg(long, value_name = "MODEL", conflicts_with = "model")]
    onto: Option<PathBuf>,
    /// Score this model with --test, and learn nothing; `built-in` and `built-in-forest` come with the
    /// program
    #[arg(long, value_name = "FILE", conflicts_with_all = ["drives", "out"], requires = "test")]
    model: Option<PathBuf>,
    /// Labelled drives to score the model with; nothing is learned from them
    #[arg(long, value_name = "DRIVES", num_args = 1..)]
    test: Vec<PathBuf>,
    /// Write a card of the model in Markdown (-: to standard output)
    #[arg(long, value_name = "FILE", value_parser = print::target())]
    card: Option<PathBuf>,
    /// Folder for the state of one drive at a time [default: the system's folder for temporary files]
    #[arg(long, value_name = "DIRECTORY")]
    scratch: Option<PathBuf>,
    #[command(flatten)]
    show: Kind,
    #[command(flatten)]
    learning: LearningArgs,
    #[command(flatten)]
    settings: LabelledSettings,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Learning")]
struct LearningArgs {
    /// Seed for the choice of the samples and of the features of each split
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<u64>(0..=u64::MAX, 7))]
    seed: u64,
    /// Largest number of samples per class and drive; for the classes by context, four times as many of all
    /// classes together
    #[arg(long, value_name = "N", default_value_t = 5_000, value_parser = whole::<usize>(1..=1_000_000, 5_000))]
    samples: usize,
    /// Learn also from copies of each drive that have these shares of its points, for sparser scanners
    #[arg(long, value_name = "SHARES", value_delimiter = ',', value_parser = share)]
    thin: Vec<f64>,
    /// Boosting rounds; each adds a tree per class. The classes by context take half as many
    #[arg(long, value_name = "N", default_value_t = Learning::default().rounds, value_parser = whole::<usize>(0..=u64::MAX, 100))]
    rounds: usize,
    /// Largest number of leaves of a tree
    #[arg(long, value_name = "N", default_value_t = Learning::default().leaves, value_parser = whole::<usize>(0..=u64::MAX, 31))]
    leaves: usize,
    /// Learning rate: share of the step towards the best value of a leaf
    #[arg(long, value_name = "SHARE", default_value_t = Learning::default().rate, value_parser = real("0.1"))]
    rate: f64,
    /// Share of the samples from which a tree learns, drawn again for each tree
    #[arg(long, value_name = "SHARE", default_value_t = Learning::default().subsample, value_parser = real("0.5"))]
    subsample: f64,
    /// Regularisation: weight that keeps the values of leaves small
    #[arg(long, value_name = "WEIGHT", default_value_t = Learning::default().l2, value_parser = real("1"))]
    l2: f64,
}

/// A share of the points.
fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share: &f64| *share > 0.0 && *share < 1.0);
    share.ok_or_else(|| format!("{text} is not a share above 0 and below 1"))
}

impl TrainArgs {
    pub(crate) fn run(&self) -> Outcome {
        let progress = Progress::new(self.show.progress());
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        self.names_drives_once()?;
        self.learns_from_no_test()?;
        let scratch = scratch::folder(self.scratch.as_deref(), "train")?;
        let request = self.request(&scratch)?;
        let scored = self.model.as_deref();
        let trained = match (scored, &self.onto) {
            (Some(_), _) => None,
            (None, Some(voxels)) => {
                Some(train_objects(&read_model_of_voxels(voxels)?, &request, &progress, &cancel)?)
            }
            (None, None) => Some(train(&request, &progress, &cancel)?),
        };
        let read = match scored {
            Some(path) if path == Path::new("built-in") => Some(built_in_model(Scene::Street)?),
            Some(path) if path == Path::new("built-in-forest") => Some(built_in_model(Scene::Forest)?),
            path => path.map(read_model).transpose()?,
        };
        let Some(model) = trained.as_ref().map(|trained| &trained.model).or(read.as_ref()) else {
            return Err(refused("no drives", "drives to learn from, or --model with --test").into());
        };
        let bytes = model.encode()?;
        deliver(self.out.as_deref(), |to| to.write_all(&bytes))?;
        let mut scores = Vec::new();
        for drive in &self.test {
            scores.push((name(drive), score_model(model, drive, &request, &progress, &cancel)?));
        }
        let learned = match trained.as_ref() {
            Some(trained) if self.onto.is_some() => Learned::Objects(trained),
            Some(trained) => Learned::Voxels(trained),
            None => Learned::Nothing,
        };
        let card = card(model, bytes.len(), &learned, &scores);
        let printed = deliver(self.card.as_deref(), |to| to.write_all(card.as_bytes()))?;
        if !printed {
            print::text(&summary(model, &learned, &scores))?;
        }
        Ok(exit::DONE)
    }

    /// Refuses a drive that is given twice, because its samples would count twice.
    fn names_drives_once(&self) -> Result<(), CliError> {
        for drives in [&self.drives, &self.test] {
            let all: Vec<PathBuf> = drives.iter().map(|path| print::resolved(path)).collect();
            if let Some(at) = (1..all.len()).find(|&at| all[..at].contains(&all[at])) {
                return Err(refused(&drives[at].display().to_string(), "a drive that is given once").into());
            }
        }
        Ok(())
    }

    /// Refuses to score a model with drives from which it learns: such scores are too good.
    fn learns_from_no_test(&self) -> Result<(), CliError> {
        let learned: Vec<PathBuf> = self.drives.iter().map(|path| print::resolved(path)).collect();
        match self.test.iter().find(|drive| learned.contains(&print::resolved(drive))) {
            Some(drive) => {
                let found = format!("--test {}", drive.display());
                Err(refused(&found, "a drive that the model does not learn from").into())
            }
            None => Ok(()),
        }
    }

    fn request(&self, scratch: &ScratchFolder) -> Result<TrainRequest<'static>, CliError> {
        let LearningArgs { seed, samples, thin, rounds, leaves, rate, subsample, l2 } = &self.learning;
        let settings = Learning {
            rounds: *rounds,
            leaves: *leaves,
            rate: *rate,
            subsample: *subsample,
            l2: *l2,
            seed: *seed,
            ..Learning::default()
        };
        Ok(TrainRequest {
            drives: self.drives.clone(),
            scratch: scratch.path().to_owned(),
            config: self.settings.resolve()?,
            registries: Registries::default(),
            settings,
            samples: *samples,
            thin: thin.clone(),
        })
    }
}

fn refused(what: &str, expected: &'static str) -> chainage::Error {
    ConfigError::value("train", what, expected).into()
}

fn name(drive: &Path) -> String {
    drive.file_name().unwrap_or(drive.as_os_str()).to_string_lossy().into_owned()
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}

/// The result of a call.
enum Learned<'a> {
    Voxels(&'a Trained),
    Objects(&'a Trained),
    Nothing,
}

/// The parts of a model with their names.
fn parts(model: &StreetModel) -> Vec<(&'static str, &Model)> {
    let voxels = [("shapes", &model.shapes), ("context", &model.context)];
    let objects = model.objects.as_ref().map(|objects| ("objects", objects));
    let wholes = model.wholes.as_ref().map(|wholes| ("pieces", wholes));
    voxels.into_iter().chain(objects).chain(wholes).collect()
}

/// The summary for the terminal.
fn summary(model: &StreetModel, learned: &Learned<'_>, scores: &[(String, Confusion)]) -> String {
    let mut text = String::new();
    for (name, model) in parts(model) {
        let (trees, leaves) = model.size();
        let samples: u64 = model.about().samples.iter().sum();
        text +=
            &format!("{name}: {trees} trees with {leaves} leaves from {} samples\n", print::count(samples));
    }
    let right = |held_out: &Confusion, of: &str| {
        let rows = print::count(held_out.rows());
        format!(
            "{} of {rows} {of} that were held out are classified correctly\n",
            percent(held_out.accuracy())
        )
    };
    match learned {
        Learned::Voxels(trained) => text += &right(&trained.held_out, "voxels in squares"),
        Learned::Objects(trained) => {
            text += &right(&trained.held_out, "objects");
            if let Some(wholes) = &trained.wholes {
                text += &right(wholes, "objects and pieces");
            }
        }
        Learned::Nothing => {}
    }
    for (name, confusion) in scores {
        let accuracy = percent(confusion.accuracy());
        text += &format!("{accuracy} of {} voxels of {name}\n", print::count(confusion.rows()));
    }
    text
}

/// The card of a model, in Markdown. If only the models of objects were learned, it is the part of the card
/// about them.
fn card(model: &StreetModel, bytes: usize, learned: &Learned<'_>, scores: &[(String, Confusion)]) -> String {
    let mut text =
        format!("# Model {:016x} of `street`\n\n{} bytes.\n", model.checksum(), print::count(bytes as u64));
    let counts =
        |counts: &[u64]| -> Vec<String> { counts.iter().map(|&count| print::count(count)).collect() };
    let parts = || {
        let of_objects = |name: &str| matches!(name, "objects" | "pieces");
        let is_new = move |name: &str| of_objects(name) || !matches!(learned, Learned::Objects(_));
        parts(model).into_iter().filter(move |(name, _)| is_new(name))
    };
    for (name, model) in parts() {
        let about = model.about();
        let (trees, leaves) = model.size();
        text += &format!(
            "\n## Samples of the model of {name}\n\n{trees} trees with {leaves} leaves. {}, seed {}.\n\n",
            about.settings, about.seed
        );
        text += &row("drive", model.classes());
        text += &row("---", &vec!["---:".to_owned(); model.classes().len()]);
        for source in &about.trained_on {
            text += &row(&source.name, &counts(&source.samples));
        }
        text += &row("all", &counts(&about.samples));
    }
    let classes = model.context.classes();
    match learned {
        Learned::Voxels(trained) => {
            text += "\n## Voxels of the same drives in squares that were held out\n\nAs frequent as they are. The \
                     first classes are those of models that learned from other drives.\n\n";
            text += &matrix(classes, &trained.held_out);
        }
        Learned::Objects(trained) => {
            text += "\n## Objects of the drives that the model of objects learned from, held out\n\nEvery fifth one. \
                     The models of voxels learned from other drives.\n\n";
            text += &matrix(classes, &trained.held_out);
            if let (Some(model), Some(wholes)) = (&model.wholes, &trained.wholes) {
                text += "\n## Pieces among these objects\n\nEvery fifth one. A piece has at most half \
                         of the points of what it belongs to.\n\n";
                text += &matrix(model.classes(), wholes);
            }
        }
        Learned::Nothing => {}
    }
    for (name, confusion) in scores {
        text += &format!("\n## Voxels of {name}\n\nNothing was learned from it. All voxels.\n\n");
        text += &matrix(classes, confusion);
    }
    if !scores.is_empty() {
        text +=
            "\n## Where it fails\n\nClasses of which less than half of the voxels of a scene are found.\n\n";
        text += &failures(classes, scores);
    }
    for (name, model) in parts() {
        text += &format!(
            "\n## Importance of the features of the model of {name}\n\nShare in the gain of all splits.\n\n\
             | feature | share |\n|---|---:|\n"
        );
        let mut ranked: Vec<(&String, f64)> =
            model.features().iter().zip(model.about().importance.iter().copied()).collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (feature, share) in ranked {
            text += &format!("| {feature} | {:.2} % |\n", 100.0 * share);
        }
    }
    text
}

/// The classes with less than half of their voxels found, as a table: a row per scene and class.
fn failures(classes: &[String], scores: &[(String, Confusion)]) -> String {
    let head = ["class", "voxels", "recall", "mostly called"].map(str::to_owned);
    let mut text = row("scene", &head) + "|---|---|---:|---:|---|\n";
    for (name, confusion) in scores {
        for (class, counts) in confusion.counts().iter().enumerate() {
            let Some(recall) = confusion.recall(class).filter(|recall| *recall < 0.5) else { continue };
            let most =
                (0..counts.len()).filter(|called| *called != class).max_by_key(|&called| counts[called]);
            let cells = [
                classes[class].clone(),
                print::count(counts.iter().sum()),
                percent(Some(recall)),
                most.map_or_else(String::new, |called| classes[called].clone()),
            ];
            text += &row(name, &cells);
        }
    }
    text
}

fn row(first: &str, others: &[String]) -> String {
    format!("| {first} | {} |\n", others.join(" | "))
}

/// A confusion as a table: a row per true class.
fn matrix(classes: &[String], confusion: &Confusion) -> String {
    let mut text = format!("{} right.\n\n", percent(confusion.accuracy()));
    let head: Vec<String> =
        classes.iter().cloned().chain(["recall".to_owned(), "precision".to_owned()]).collect();
    text += &row("is, called", &head);
    text += &row("---", &vec!["---:".to_owned(); head.len()]);
    for (class, (name, counts)) in classes.iter().zip(confusion.counts()).enumerate() {
        let mut cells: Vec<String> = counts.iter().map(|&count| print::count(count)).collect();
        cells.extend([percent(confusion.recall(class)), percent(confusion.precision(class))]);
        text += &row(name, &cells);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_fails_on_a_class_of_which_less_than_half_is_found() {
        let classes = ["none", "tree", "pole"].map(str::to_owned);
        let mut confusion = Confusion::new(3);
        for (class, called, times) in [(1, 1, 9), (1, 2, 1), (2, 1, 3), (2, 0, 1), (2, 2, 2)] {
            confusion.add(class, called, times);
        }
        let table = failures(&classes, &[("street.laz".to_owned(), confusion)]);
        assert_eq!(table.lines().skip(2).collect::<Vec<_>>(), ["| street.laz | pole | 6 | 33.3 % | tree |"]);
    }

    #[test]
    fn a_share_is_above_0_and_below_1() {
        assert_eq!(share("0.25"), Ok(0.25));
        for text in ["0", "1", "-0.5", "half", "NaN"] {
            assert!(share(text).is_err(), "{text}");
        }
    }
}
