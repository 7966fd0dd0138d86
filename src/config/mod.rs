//! Typed, validated settings with units. The defaults are the embedded `config/default.toml`.
//!
//! ```
//! use chainage::config::Config;
//!
//! let config = Config::resolve(None, &["euclidean.max_gap_m=0.4".to_owned()])?;
//! assert_eq!(config.cluster.method, "street");
//! assert_eq!(config.method_table("euclidean")["max_gap_m"].as_float(), Some(0.4));
//!
//! let error = Config::resolve(None, &["tiling.cell=0.1".to_owned()]).unwrap_err();
//! assert_eq!(error.to_string(), "tiling.cell = 0.1: must be 0.5 to 10 (metres)");
//! # Ok::<(), chainage::config::ConfigError>(())
//! ```

mod choices;
mod error;
mod las_codes;
mod merge;
mod presets;
mod renamed;

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

pub use choices::{AxisChoice, LengthUnit, OutputFormat};
pub(crate) use choices::{FOOT, US_SURVEY_FOOT};
pub use error::ConfigError;
pub use las_codes::{ClassificationChoice, LasCodes};
pub use presets::{PRESETS, Preset};

/// The text of `config/default.toml`: every setting with its unit and default.
pub const DEFAULT_TOML: &str = include_str!("../../config/default.toml");

/// Section `[axis]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisConfig {
    /// The source of the axis.
    pub source: AxisChoice,
    /// Trajectory file; empty if there is none.
    pub trajectory: PathBuf,
}

/// Section `[tiling]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TilingConfig {
    /// Edge of a cell of the occupancy raster in metres.
    pub cell: f64,
    /// Length of a tile in metres of chainage; 0 derives it from the memory budget.
    pub tile_length: f64,
    /// Chainage where the processed section begins, in metres.
    pub from: f64,
    /// Chainage where it ends, in metres; 0 is the end of the drive.
    pub to: f64,
    /// Distance beyond the section within which its objects are followed, in metres.
    pub beyond: f64,
}

/// Section `[ground]` or `[cluster]`: the name of a registered method.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodChoice {
    /// Its name.
    pub method: String,
}

/// Section `[output]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputConfig {
    /// Whether labelled copies are compressed.
    pub format: OutputFormat,
    /// Name of the dimension with the object id; `auto` depends on the method ([`Self::dimension_of`]).
    pub dimension: String,
    /// Whether the classification changes.
    pub classification: ClassificationChoice,
    /// Whether the original class is kept in a dimension of its own.
    pub original_classification: bool,
    /// The outputs to write, by the names of [`Self::writes`]; all except `copc` if the list is empty.
    pub files: Vec<String>,
    /// Whether the cloud-optimised file of the whole drive is written.
    pub copc: bool,
    /// Whether the page `report.html` is written.
    pub report: bool,
    /// Largest size of the page in megabytes.
    pub report_mb: f64,
}

/// Dimension of the objects.
pub const CLUSTER_ID: &str = "cluster_id";
/// Dimension of the surfaces, if the method finds surfaces instead of objects.
pub const SURFACE_ID: &str = "surface_id";

impl OutputConfig {
    /// Name of the dimension with the id of the object of a point, or of its surface if the method finds
    /// `surfaces`.
    #[must_use]
    pub fn dimension_of(&self, surfaces: bool) -> &str {
        match self.dimension.as_str() {
            "auto" if surfaces => SURFACE_ID,
            "auto" => CLUSTER_ID,
            name => name,
        }
    }

    /// Whether an output is written: `points` (labelled copies), `charts` (of the thresholds of the method),
    /// `copc` (the cloud-optimised file), `report` (the page), or a format of the table of objects by its
    /// extension. `report.json` is always written.
    #[must_use]
    pub fn writes(&self, name: &str) -> bool {
        let named = self.files.iter().any(|chosen| chosen == name);
        match name {
            "copc" => named || self.copc,
            "report" => (named || self.files.is_empty()) && self.report,
            _ => named || self.files.is_empty(),
        }
    }
}

/// Accepted memory budgets in MiB: 16 MiB to 16 TiB.
pub const MEMORY_MIB: std::ops::RangeInclusive<u64> = 16..=1 << 24;

/// Section `[run]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    /// Worker threads; 0 is one per core.
    pub threads: usize,
    /// Memory budget in MiB; 0 is half of what is free.
    pub memory_mib: u64,
    /// Whether the run ends at the first tile that fails.
    pub fail_fast: bool,
}

/// Section `[input]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputConfig {
    /// Unit of the coordinates.
    pub unit: LengthUnit,
    /// Whether LAS files are mapped into memory.
    pub mmap: bool,
}

/// All settings of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Section `[input]`.
    pub input: InputConfig,
    /// Section `[axis]`.
    pub axis: AxisConfig,
    /// Section `[tiling]`.
    pub tiling: TilingConfig,
    /// Section `[ground]`.
    pub ground: MethodChoice,
    /// Section `[cluster]`.
    pub cluster: MethodChoice,
    /// Section `[output]`.
    pub output: OutputConfig,
    /// Section `[run]`.
    pub run: RunConfig,
    table: toml::Table,
    /// Warnings about the settings.
    warnings: Vec<String>,
}

/// Settings that are paths. They are made absolute, because workers and later calls start in other folders.
const PATHS: [(&str, &str); 2] = [("axis", "trajectory"), ("street", "model")];

impl Config {
    /// The defaults, overridden by a configuration file and then by assignments `section.key=value`, in this
    /// order.
    ///
    /// # Errors
    /// When the file cannot be read, a key is unknown, or a value has the wrong type or is out of range.
    pub fn resolve(file: Option<&Path>, assignments: &[String]) -> Result<Self, ConfigError> {
        Self::with_preset(None, file, assignments)
    }

    /// The same, with the defaults overridden by one of the [`PRESETS`] first.
    ///
    /// # Errors
    /// Those of [`Self::resolve`], and a preset that does not exist.
    pub fn with_preset(
        preset: Option<&str>,
        file: Option<&Path>,
        assignments: &[String],
    ) -> Result<Self, ConfigError> {
        let mut table = merge::parse(DEFAULT_TOML, "config/default.toml")?;
        let mut warnings = Vec::new();
        if let Some(preset) = preset.map(Preset::find).transpose()? {
            merge::overlay(&mut table, merge::parse(preset.text, preset.name)?, &mut warnings)?;
        }
        if let Some(path) = file {
            let text = fs_err::read_to_string(path)
                .map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
            merge::overlay(&mut table, merge::parse(&text, &path.display().to_string())?, &mut warnings)?;
        }
        let mut all = Vec::new();
        for text in assignments {
            let assigned = merge::assignment(text, &table)?;
            all.push((text, assigned.clone()));
            merge::overlay(&mut table, assigned, &mut warnings)?;
        }
        for (text, assigned) in &all {
            if let Some(later) = merge::overridden(&table, assigned) {
                warnings.push(format!("{text} has no effect: another option sets it to {later}"));
            }
        }
        Self::from_table(table, warnings)
    }

    fn from_table(mut table: toml::Table, warnings: Vec<String>) -> Result<Self, ConfigError> {
        for (section, key) in PATHS {
            let value = table.get_mut(section).and_then(|section| section.get_mut(key));
            let Some(toml::Value::String(path)) = value.filter(|value| value.as_str() != Some("")) else {
                continue;
            };
            let absolute = std::path::absolute(&*path).ok();
            *path = absolute.and_then(|path| path.into_os_string().into_string().ok()).ok_or_else(|| {
                let expected =
                    "an absolute path here: the path of this folder is not UTF-8 text, or the folder is gone";
                ConfigError::value(format!("{section}.{key}"), &*path, expected)
            })?;
        }
        let config = Self {
            input: typed(&table, "input")?,
            axis: typed(&table, "axis")?,
            tiling: typed(&table, "tiling")?,
            ground: typed(&table, "ground")?,
            cluster: typed(&table, "cluster")?,
            output: typed(&table, "output")?,
            run: typed(&table, "run")?,
            table,
            warnings,
        };
        config.validate()?;
        Ok(config)
    }

    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        let TilingConfig { cell, tile_length, from, to, beyond } = self.tiling;
        if !(0.5..=10.0).contains(&cell) {
            return Err(ConfigError::value("tiling.cell", cell, "0.5 to 10 (metres)"));
        }
        if !(tile_length == 0.0 || (1.0..=1e6).contains(&tile_length)) {
            return Err(ConfigError::value("tiling.tile_length", tile_length, "0, or 1 to 1000000 (metres)"));
        }
        if !(0.0..=1e7).contains(&from) {
            return Err(ConfigError::value("tiling.from", from, "0 to 10000000 (metres)"));
        }
        if to != 0.0 && !(to > from && to <= 1e7) {
            return Err(ConfigError::value(
                "tiling.to",
                to,
                format!(
                    "above tiling.from, which is {from} m, and at most 10000000; 0 is the end of the drive"
                ),
            ));
        }
        if !(0.0..=10_000.0).contains(&beyond) {
            return Err(ConfigError::value("tiling.beyond", beyond, "0 to 10000 (metres)"));
        }
        if self.run.threads > 1_024 {
            return Err(ConfigError::value("run.threads", self.run.threads, "0 to 1024"));
        }
        if self.run.memory_mib != 0 && !MEMORY_MIB.contains(&self.run.memory_mib) {
            return Err(ConfigError::value(
                "run.memory_mib",
                self.run.memory_mib,
                "0, or 16 to 16777216 (MiB)",
            ));
        }
        if !(1.0..=200.0).contains(&self.output.report_mb) {
            return Err(ConfigError::value(
                "output.report_mb",
                self.output.report_mb,
                "1 to 200 (megabytes)",
            ));
        }
        let name = &self.output.dimension;
        if !(1..=31).contains(&name.len()) || !name.bytes().all(|byte| matches!(byte, b' '..=b'~')) {
            let expected = "1 to 31 printable ASCII characters";
            return Err(ConfigError::value("output.dimension", format!("{name:?}"), expected));
        }
        Ok(())
    }

    /// Whether a section has the settings of a method or a filter, and not those of the program.
    pub(crate) fn is_of_method(&self, section: &str) -> bool {
        let of_program = ["input", "axis", "tiling", "ground", "cluster", "output", "run"];
        self.table.contains_key(section) && !of_program.contains(&section)
    }

    /// The section of a method; empty if there is none.
    #[must_use]
    pub fn method_table(&self, name: &str) -> toml::Table {
        self.table.get(name).and_then(toml::Value::as_table).cloned().unwrap_or_default()
    }

    /// Warnings about the settings: old names that are still read.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The settings that differ from the defaults, as `section.key = value`, in the order of the defaults.
    ///
    /// # Errors
    /// Never: the defaults are valid.
    pub fn differences(&self) -> Result<Vec<String>, ConfigError> {
        let defaults = Self::resolve(None, &[])?.table;
        let mut list = Vec::new();
        for (section, values) in &self.table {
            for (key, value) in values.as_table().into_iter().flatten() {
                if defaults.get(section).and_then(|values| values.get(key)) != Some(value) {
                    list.push(format!("{section}.{key} = {value}"));
                }
            }
        }
        Ok(list)
    }

    /// The first setting with another value in `other`: its name, the value here, and the value in `other`.
    /// Settings of how the machine is used are not compared, because no result depends on them.
    #[must_use]
    pub fn first_difference(&self, other: &Self) -> Option<(String, String, String)> {
        for (section, values) in &self.table {
            for (key, value) in values.as_table().into_iter().flatten() {
                let theirs = other.table.get(section).and_then(|values| values.get(key));
                if theirs != Some(value) && !is_of_machine(section, key) {
                    let theirs = theirs.map_or_else(|| "(nothing)".to_owned(), ToString::to_string);
                    return Some((format!("{section}.{key}"), value.to_string(), theirs));
                }
            }
        }
        None
    }

    /// A digest of all settings that [`Self::first_difference`] compares.
    pub(crate) fn digest(&self) -> String {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        for (section, values) in &self.table {
            let values = values.as_table().into_iter().flatten();
            for (key, value) in values.filter(|(key, _)| !is_of_machine(section, key)) {
                hasher.update(format!("{section}.{key} = {value}\n").as_bytes());
            }
        }
        format!("{:016x}", hasher.digest())
    }

    /// All settings as TOML.
    #[must_use]
    pub fn to_toml(&self) -> String {
        self.table.to_string()
    }

    /// All settings as JSON, for reports.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::to_value(&self.table).unwrap_or(serde_json::Value::Null)
    }

    /// The same, but the machine is used as in `earlier`, the settings of the call that computed everything.
    pub(crate) fn to_json_on_machine_of(&self, earlier: &serde_json::Value) -> serde_json::Value {
        let mut all = self.to_json();
        for (section, values) in all.as_object_mut().into_iter().flatten() {
            for (key, value) in values.as_object_mut().into_iter().flatten() {
                if let Some(before) = earlier[section].get(key).filter(|_| is_of_machine(section, key)) {
                    *value = before.clone();
                }
            }
        }
        all
    }
}

fn typed<T: DeserializeOwned>(table: &toml::Table, name: &str) -> Result<T, ConfigError> {
    let empty = toml::Table::new();
    section(name, table.get(name).and_then(toml::Value::as_table).unwrap_or(&empty))
}

/// Reads one section (the settings of a method) from its table. Keys are checked, and missing keys have their
/// defaults.
///
/// # Errors
/// [`ConfigError::Value`] with the dotted key when a key is unknown or a value has the wrong type.
pub fn section<T: DeserializeOwned>(name: &str, table: &toml::Table) -> Result<T, ConfigError> {
    let read = |table: &toml::Table| T::deserialize(toml::Value::Table(table.clone()));
    read(table).map_err(|error| {
        let (key, value) = match wrong_key(table, &error, |part| read(part).err()) {
            Some((key, value)) => (format!("{name}.{key}"), Some(value)),
            None => (name.to_owned(), None),
        };
        // A word is shown as it was given, and any other value as in TOML.
        match (value.and_then(toml::Value::as_str), choices::words(error.message())) {
            (Some(word), Some(words)) => ConfigError::value(key, word, words),
            _ => {
                let expected = choices::expected(error.message());
                ConfigError::value(key, value.map_or_else(|| "...".to_owned(), ToString::to_string), expected)
            }
        }
    })
}

/// The entry of `table` that causes `error`. Reading stops at the first wrong entry, so it is the entry with
/// which the error first appears when the table is read entry by entry. `None` if the error is about the
/// whole table, for instance a missing key.
fn wrong_key<'t>(
    table: &'t toml::Table,
    error: &toml::de::Error,
    read: impl Fn(&toml::Table) -> Option<toml::de::Error>,
) -> Option<(&'t String, &'t toml::Value)> {
    let mut part = toml::Table::new();
    let fails = |part: &toml::Table| read(part).is_some_and(|other| other.message() == error.message());
    if fails(&part) {
        return None;
    }
    table.iter().find(|(key, value)| {
        part.insert((*key).clone(), (*value).clone());
        fails(&part)
    })
}

/// Whether a setting only affects how the machine is used, so that no result depends on it.
fn is_of_machine(section: &str, key: &str) -> bool {
    section == "run" || (section, key) == ("input", "mmap")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(assignments: &[&str]) -> Result<Config, String> {
        let list: Vec<String> = assignments.iter().map(ToString::to_string).collect();
        Config::resolve(None, &list).map_err(|error| error.to_string())
    }

    #[test]
    fn assignments_override_and_are_checked() {
        let config =
            set(&["euclidean.max_gap_m=1", "cluster.method=euclidean", "tiling.tile_length=25"]).unwrap();
        assert_eq!(config.method_table("euclidean")["max_gap_m"].as_float(), Some(1.0));
        assert!(config.warnings().is_empty());
        let old = set(&["euclidean.d_t=1"]).unwrap();
        assert_eq!(old.method_table("euclidean"), config.method_table("euclidean"));
        assert_eq!(
            old.warnings(),
            ["euclidean.d_t is called euclidean.max_gap_m now: the old name is read until version 0.2"]
        );
        assert!((config.tiling.tile_length - 25.0).abs() < 1e-12);
        for (text, expected) in [
            (
                "euclidean.max_gap=1",
                "there is no setting euclidean.max_gap: did you mean euclidean.max_gap_m?",
            ),
            (
                "euclidean.wide=1",
                "there is no setting euclidean.wide; known: max_gap_m, min_points, max_points",
            ),
            ("euclidean.dt=1", "there is no setting euclidean.dt: did you mean euclidean.max_gap_m?"),
            ("euclidian.d_t=1", "there is no setting euclidian.d_t: did you mean euclidean.max_gap_m?"),
            ("nothing.like_it=1", "there is no setting nothing.like_it; known: input, axis, tiling"),
            (
                "d_t=1",
                "d_t is euclidean.max_gap_m and density-peaks.scale_above now: write euclidean.max_gap_m=1",
            ),
            (
                "voxel=1",
                "voxel is a setting of noise, voxel-column, upward-growing, opening, normalized-cut and \
                 density-peaks: write noise.voxel=1",
            ),
            ("threads=2", "threads is a setting of run: write run.threads=2"),
            ("tiling.cell=0.1", "tiling.cell = 0.1: must be 0.5 to 10 (metres)"),
            ("tiling.cell", "cannot read the assignment tiling.cell, expected section.key=value"),
            ("output.format=shp", "output.format = shp: must be same, las or laz"),
            ("input.unit=yard", "input.unit = yard: must be auto, metre, foot or us-survey-foot"),
            (
                "output.classification=no",
                "output.classification = \"no\": must be set, keep, or LAS codes from 0 to 255, each class once, as \
                 in pole=64,vehicle=65 (classes: tree, pole,",
            ),
            ("run.fail_fast=3", "run.fail_fast = 3: must be true or false"),
            ("tiling.cell=wide", "tiling.cell = \"wide\": must be a number"),
            ("tiling.cell=auto", "tiling.cell = \"auto\": must be a number"),
            ("run.memory_mib=8", "run.memory_mib = 8: must be 0, or 16 to 16777216 (MiB)"),
            ("run.memory_mib=17592186044416", "run.memory_mib = 17592186044416: must be 0, or 16 to"),
            ("run.threads=2.5", "run.threads = 2.5: must be a whole number"),
            ("run.threads=-3", "run.threads = -3: must be a whole number, at least 0"),
            ("output.dimension=3", "output.dimension = 3: must be text"),
            ("street.classes=tree", "street.classes = \"tree\": must be a list, for example [\"tree\"]"),
        ] {
            let message = set(&[text]).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
