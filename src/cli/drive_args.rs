//! The arguments that commands share: a drive and its settings. A command has those that have an effect on
//! it.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use chainage::config::{Config, ConfigError, MEMORY_MIB};
use chainage::input::InputError;
use chainage::run::{Registries, holds_run};

use crate::cli::exit::CliError;
use crate::cli::quantities;

/// The default method, and the only one with a model.
const STREET: &str = "street";

/// A drive.
#[derive(Debug, clap::Args)]
pub(crate) struct Inputs {
    /// LAS or LAZ files, folders with *.las or *.laz, or patterns such as 'drive/*.laz'
    #[arg(required = true, value_name = "FILES")]
    files: Vec<PathBuf>,
    /// Search the folders below a folder as well, except those with a run of chainage
    #[arg(short, long)]
    recursive: bool,
}

impl Inputs {
    /// Whether --recursive was given.
    pub(crate) fn is_recursive(&self) -> bool {
        self.recursive
    }

    /// The files, folders and patterns. With --recursive, a folder is followed by the folders below it that
    /// contain LAS or LAZ files.
    pub(crate) fn files(&self) -> Result<Vec<PathBuf>, CliError> {
        if !self.recursive {
            return Ok(self.files.clone());
        }
        let mut files = Vec::new();
        for path in &self.files {
            let before = files.len();
            if path.is_dir() {
                folders_below(path, &mut files)
                    .map_err(|source| InputError::Read { path: path.clone(), source })
                    .map_err(chainage::Error::from)?;
            }
            // A folder without any LAS or LAZ file stays in the list, so that an error names it.
            if files.len() == before {
                files.push(path.clone());
            }
        }
        Ok(files)
    }
}

/// Adds `folder` and the folders below it, in the order of their names, if they contain a LAS or LAZ file. A
/// folder below it with a run is left out, because it has copies of points. Symbolic links are not followed,
/// because they may form a loop.
fn folders_below(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let mut below = Vec::new();
    let mut has_files = false;
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        if entry.file_type()?.is_dir() {
            if !holds_run(&path) {
                below.push(path);
            }
        } else {
            has_files |= matches!(extension.as_deref(), Some("las" | "laz"));
        }
    }
    if has_files {
        found.push(folder.to_owned());
    }
    below.sort();
    below.iter().try_for_each(|path| folders_below(path, found))
}

/// Settings. A flag overrides --set, and --set overrides the configuration file.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct Settings {
    #[command(flatten)]
    pub(crate) choices: Choices,
    #[command(flatten)]
    machine: Machine,
}

/// Settings that the result, or the division into tiles, depends on.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct Choices {
    #[command(flatten)]
    start: Start,
    #[arg(long, value_name = "NAME", help = methods("Clustering method", &clusterers(), STREET))]
    pub(crate) method: Option<String>,
    #[command(flatten)]
    ground: GroundFilter,
    /// Model of the method street, a file that `chainage train` wrote [default: the built-in model]
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    tiles: Tiles,
}

/// What flags change: the settings of a preset, of a file, and single ones.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
struct Start {
    /// Start from the settings of a preset instead of the defaults: see `chainage config --presets`
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    #[command(flatten)]
    written: Written,
}

/// The settings of a file, and single ones.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
struct Written {
    /// Configuration file with the settings that differ from `chainage config`
    #[arg(short = 'c', long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    single: Single,
}

/// Single settings.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
struct Single {
    /// Change a setting, for example --set street.min_points=10; may be repeated
    #[arg(long = "set", value_name = "SECTION.KEY=VALUE")]
    assignments: Vec<String>,
}

#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
struct GroundFilter {
    #[arg(long, value_name = "NAME", help = methods("Ground filter", &filters(), "opening"))]
    ground: Option<String>,
}

/// How the drive is divided.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
struct Tiles {
    /// Length of a tile along the axis, such as 25 or 25m [default: as long as the memory budget allows]
    #[arg(long, value_name = "METRES", value_parser = metres, allow_hyphen_values = true)]
    tile_length: Option<f64>,
    #[command(flatten)]
    axis: AxisSource,
}

#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
struct AxisSource {
    /// Trajectory: CSV with the columns gps_time,x,y,z [default: the axis is derived from the points]
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
}

/// The settings of `info`, which has no passes after the survey.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct LookSettings {
    #[command(flatten)]
    written: Written,
    #[command(flatten)]
    axis: AxisSource,
    #[command(flatten)]
    machine: Machine,
}

/// The settings of labelled drives, for `train`. Its method is its own.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct LabelledSettings {
    #[command(flatten)]
    start: Start,
    #[command(flatten)]
    ground: GroundFilter,
    #[command(flatten)]
    tiles: Tiles,
    #[command(flatten)]
    machine: Machine,
}

/// The settings of a process that works on a run, for `work`. All others are those of the run.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct WorkerSettings {
    #[command(flatten)]
    single: Single,
    #[command(flatten)]
    machine: Machine,
}

impl Choices {
    /// The settings of a call that resumes a run: the settings of the last call with these options applied,
    /// or, if a preset or file is given, the settings of a new call.
    pub(crate) fn resolve_after(&self, last: &Path) -> chainage::Result<Config> {
        let Start { preset, written } = &self.start;
        let begins_anew = preset.is_some() || written.config.is_some();
        self.resolve_over(if begins_anew { written.config.as_deref() } else { Some(last) }, &[])
    }

    /// Whether any option was given.
    pub(crate) fn is_any_given(&self) -> bool {
        let Self { start: Start { preset, written }, method, ground, model, tiles } = self;
        preset.is_some()
            || written.config.is_some()
            || !written.single.assignments.is_empty()
            || method.is_some()
            || ground.ground.is_some()
            || model.is_some()
            || tiles.tile_length.is_some()
            || tiles.axis.trajectory.is_some()
    }
}

/// A section of a drive, for `run` and `plan`.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct SectionArgs {
    /// Process from this chainage on, such as 500 or 1.2km; objects are the same as in the whole drive
    #[arg(long, value_name = "CHAINAGE", value_parser = chainage, allow_hyphen_values = true)]
    from: Option<f64>,
    /// Process up to this chainage [default: the end of the drive]
    #[arg(long, value_name = "CHAINAGE", value_parser = chainage, allow_hyphen_values = true)]
    to: Option<f64>,
}

impl SectionArgs {
    /// The section as settings. It is checked here, so that a message names the options.
    pub(crate) fn assignments(&self) -> chainage::Result<impl Iterator<Item = (&'static str, String)>> {
        if let (Some(from), Some(to)) = (self.from, self.to)
            && to != 0.0
            && to <= from
        {
            let expected = format!("above --from, which is {from} m; 0 is the end of the drive");
            return Err(ConfigError::value("--to", to, expected).into());
        }
        let value = |key, metres: Option<f64>| metres.map(|metres| (key, number(metres)));
        Ok([value("tiling.from", self.from), value("tiling.to", self.to)].into_iter().flatten())
    }
}

/// How the machine is used. The result does not depend on it.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Machine")]
struct Machine {
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads, allow_hyphen_values = true)]
    threads: Option<usize>,
    /// Memory budget, for example 800M or 4G [default: half of the free memory]
    #[arg(long, value_name = "SIZE", value_parser = mebibytes, allow_hyphen_values = true)]
    memory: Option<u64>,
    /// Read files instead of mapping them into memory, for unreliable network drives
    #[arg(long)]
    no_mmap: bool,
}

impl Settings {
    /// The number of threads, if it was given.
    pub(crate) fn threads(&self) -> Option<usize> {
        self.machine.threads
    }
}

impl Machine {
    fn is_any_given(&self) -> bool {
        !self.flags().is_empty()
    }

    fn flags(&self) -> Flags {
        let mut all = Vec::new();
        all.extend(self.threads.map(|count| ("run.threads", count.to_string())));
        all.extend(self.memory.map(|mib| ("run.memory_mib", mib.to_string())));
        all.extend(self.no_mmap.then(|| ("input.mmap", "false".to_owned())));
        all
    }
}

/// The names of the clustering methods.
fn clusterers() -> Vec<&'static str> {
    Registries::default().cluster.iter().map(|entry| entry.name).collect()
}

/// The names of the ground filters.
fn filters() -> Vec<&'static str> {
    Registries::default().ground.iter().map(|entry| entry.name).chain(["none"]).collect()
}

/// The help of an argument with the name of a method.
fn methods(what: &str, names: &[&str], default: &str) -> String {
    format!("{what}: {} [default: {default}]", names.join(", "))
}

/// Reads a number of threads.
fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(threads @ 1..=1_024) => Ok(threads),
        _ => Err("--threads takes a number from 1 to 1024, for example 2".to_owned()),
    }
}

/// Reads a length above zero, in metres.
fn metres(text: &str) -> Result<f64, String> {
    let length = number_or_length(text).filter(|length| *length > 0.0);
    length.ok_or_else(|| "must be a number above 0 m, for example 25 or 25m".to_owned())
}

/// Reads a chainage in metres.
fn chainage(text: &str) -> Result<f64, String> {
    let metres = number_or_length(text).filter(|metres| *metres >= 0.0);
    metres.ok_or_else(|| "must be a chainage in metres, 0 or more, for example 250 or 1.2km".to_owned())
}

/// Reads a finite number of metres, or a length with a unit.
fn number_or_length(text: &str) -> Option<f64> {
    let metres = text.parse().ok().or_else(|| quantities::length(text).ok());
    metres.filter(|metres: &f64| metres.is_finite())
}

/// A number as a setting. A whole number in TOML has at most 19 digits, so a larger one is written with an
/// exponent.
fn number(metres: f64) -> String {
    if metres < 1e15 { metres.to_string() } else { format!("{metres:e}") }
}

/// A path as a setting, which is text.
fn quoted(path: &Path) -> chainage::Result<String> {
    let text = path.to_str().ok_or_else(|| InputError::NotUtf8 { path: path.to_owned() })?;
    Ok(format!("{text:?}"))
}

/// Flags as settings.
type Flags = Vec<(&'static str, String)>;

impl Single {
    /// The configuration: defaults, preset, file, --set, flags.
    fn resolve(&self, preset: Option<&str>, file: Option<&Path>, flags: &Flags) -> chainage::Result<Config> {
        let flags = flags.iter().map(|(key, value)| format!("{key}={value}"));
        let assignments: Vec<String> = self.assignments.iter().cloned().chain(flags).collect();
        Ok(Config::with_preset(preset, file, &assignments)?)
    }
}

impl GroundFilter {
    fn flags(&self) -> Flags {
        self.ground.iter().map(|name| ("ground.method", format!("{name:?}"))).collect()
    }
}

impl Tiles {
    fn flags(&self) -> chainage::Result<Flags> {
        let length = self.tile_length.map(|metres| ("tiling.tile_length", number(metres)));
        Ok(length.into_iter().chain(self.axis.flags()?).collect())
    }
}

impl AxisSource {
    fn flags(&self) -> chainage::Result<Flags> {
        self.trajectory.iter().map(|path| Ok(("axis.trajectory", quoted(path)?))).collect()
    }
}

impl Choices {
    /// The configuration with another file, and with `extra` settings.
    pub(crate) fn resolve_over(
        &self,
        file: Option<&Path>,
        extra: &[(&'static str, String)],
    ) -> chainage::Result<Config> {
        let Start { preset, written } = &self.start;
        let mut flags: Flags =
            self.method.iter().map(|name| ("cluster.method", format!("{name:?}"))).collect();
        flags.extend(self.ground.flags());
        if let Some(model) = &self.model {
            flags.push(("street.model", quoted(model)?));
        }
        flags.extend(self.tiles.flags()?);
        flags.extend(extra.iter().cloned());
        let config = written.single.resolve(preset.as_deref(), file, &flags)?;
        let method = &config.cluster.method;
        match &self.model {
            Some(model) if method != STREET => {
                let expected = format!("left out with the method {method}; it is for {STREET}");
                Err(ConfigError::value("--model", model.display(), expected).into())
            }
            _ => Ok(config),
        }
    }

    /// The configuration: defaults, preset, file, --set, flags.
    pub(crate) fn resolve(&self) -> chainage::Result<Config> {
        self.resolve_over(self.start.written.config.as_deref(), &[])
    }
}

impl LookSettings {
    pub(crate) fn resolve(&self) -> chainage::Result<Config> {
        let Written { config, single } = &self.written;
        let flags = [self.axis.flags()?, self.machine.flags()].concat();
        single.resolve(None, config.as_deref(), &flags)
    }
}

impl LabelledSettings {
    pub(crate) fn resolve(&self) -> chainage::Result<Config> {
        let Start { preset, written: Written { config, single } } = &self.start;
        // No drive is run with a model of the settings.
        let no_model = vec![("street.model", "\"\"".to_owned())];
        let flags = [self.ground.flags(), self.tiles.flags()?, self.machine.flags(), no_model].concat();
        single.resolve(preset.as_deref(), config.as_deref(), &flags)
    }
}

impl WorkerSettings {
    /// Those of the run with these settings, as they are used on this machine.
    pub(crate) fn resolve_over(&self, of_run: &Path) -> chainage::Result<Config> {
        self.single.resolve(None, Some(of_run), &self.machine.flags())
    }
}

impl Settings {
    /// Whether any option was given.
    pub(crate) fn is_any_given(&self) -> bool {
        self.choices.is_any_given() || self.machine.is_any_given()
    }

    /// The configuration: defaults, preset, file, --set, flags.
    pub(crate) fn resolve(&self, extra: &[(&'static str, String)]) -> chainage::Result<Config> {
        let all = [&self.machine.flags(), extra].concat();
        self.choices.resolve_over(self.choices.start.written.config.as_deref(), &all)
    }

    /// The settings as arguments of another call of the program, without the flags named in `but`.
    pub(crate) fn as_arguments(&self, but: &[&str]) -> Vec<OsString> {
        let mut arguments = Vec::new();
        let mut add = |flag: &str, value: Option<OsString>| {
            if let (Some(value), false) = (value, but.contains(&flag)) {
                arguments.push(OsString::from(format!("--{flag}")));
                arguments.push(value);
            }
        };
        let text = |value: &Option<String>| value.as_ref().map(OsString::from);
        let path = |path: &Option<PathBuf>| path.clone().map(PathBuf::into_os_string);
        let Self { choices, machine } = self;
        let Choices { start: Start { preset, written }, method, ground, model, tiles } = choices;
        add("preset", text(preset));
        add("config", path(&written.config));
        for assignment in &written.single.assignments {
            add("set", Some(assignment.into()));
        }
        add("method", text(method));
        add("ground", text(&ground.ground));
        add("model", path(model));
        add("threads", machine.threads.map(|count| count.to_string().into()));
        add("memory", machine.memory.map(|mib| format!("{mib}M").into()));
        add("tile-length", tiles.tile_length.map(|metres| metres.to_string().into()));
        add("trajectory", path(&tiles.axis.trajectory));
        if machine.no_mmap {
            arguments.push("--no-mmap".into());
        }
        arguments
    }
}

/// Reads a size like 800M, 4G or 512 (MiB) in MiB.
fn mebibytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = text[digits.len()..].to_ascii_uppercase();
    let factor = match unit.as_str() {
        "" | "M" | "MB" | "MIB" => 1.0,
        "G" | "GB" | "GIB" => 1024.0,
        _ => return Err(format!("{text} is not a size like 800M or 4G")),
    };
    let number: f64 = digits.parse().map_err(|_| format!("{text} is not a size like 800M or 4G"))?;
    // The cast saturates, so numbers beyond the range stay beyond it.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked below")]
    let mib = (number * factor) as u64;
    if !MEMORY_MIB.contains(&mib) {
        let (least, most) = (MEMORY_MIB.start(), MEMORY_MIB.end() >> 10);
        return Err(format!("{text} is not a memory budget: {least}M to {most}G are possible"));
    }
    Ok(mib)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_in_mebibytes() {
        for (text, mib) in [("800M", 800), ("4G", 4096), ("0.5GiB", 512), ("64", 64)] {
            assert_eq!(mebibytes(text), Ok(mib), "{text}");
        }
        for text in ["4T", "1M", "lots", "-3G", "99999999999999G"] {
            assert!(mebibytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_are_explained_by_an_example() {
        assert_eq!((threads("2"), metres("2.5")), (Ok(2), Ok(2.5)));
        assert_eq!((metres("25m"), chainage("1.2km"), chainage("0")), (Ok(25.0), Ok(1_200.0), Ok(0.0)));
        for text in ["two", "0", "-3", "2.5", ""] {
            assert!(threads(text).unwrap_err().contains("for example 2"), "{text}");
        }
        for text in ["wide", "0", "0km", "-3", "-3m", "inf", "25 ft", ""] {
            assert!(metres(text).unwrap_err().contains("above 0 m"), "{text}");
        }
        for text in ["start", "-3", "NaN", "5 miles", ""] {
            assert!(chainage(text).unwrap_err().contains("0 or more"), "{text}");
        }
    }
}
