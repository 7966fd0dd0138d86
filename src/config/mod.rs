//! Typed, validated settings with units. The defaults are the embedded `config/default.toml`.
//!
//! ```
//! use chainage::config::Config;
//!
//! let config = Config::resolve(None, &["euclidean.d_t=0.4".to_owned()])?;
//! assert_eq!(config.cluster.method, "euclidean");
//! assert_eq!(config.method_table("euclidean")["d_t"].as_float(), Some(0.4));
//!
//! let error = Config::resolve(None, &["tiling.cell=0.1".to_owned()]).unwrap_err();
//! assert_eq!(error.to_string(), "tiling.cell = 0.1: must be 0.5 to 10 (metres)");
//! # Ok::<(), chainage::config::ConfigError>(())
//! ```

mod choices;
mod error;
mod merge;

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

pub use choices::{AxisChoice, ClassificationChoice, LengthUnit, OutputFormat};
pub(crate) use choices::{FOOT, US_SURVEY_FOOT};
pub use error::ConfigError;

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
    /// Name of the dimension with the object id.
    pub dimension: String,
    /// What happens to the classification.
    pub classification: ClassificationChoice,
    /// Whether the original class is kept in a dimension of its own.
    pub original_classification: bool,
}

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
}

impl Config {
    /// The defaults, overridden by a configuration file and then by assignments `section.key=value`, in this
    /// order.
    ///
    /// # Errors
    /// When the file cannot be read, a key is unknown, or a value has the wrong type or is out of range.
    pub fn resolve(file: Option<&Path>, assignments: &[String]) -> Result<Self, ConfigError> {
        let mut table = merge::parse(DEFAULT_TOML, "config/default.toml")?;
        if let Some(path) = file {
            let text = fs_err::read_to_string(path)
                .map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
            merge::overlay(&mut table, merge::parse(&text, &path.display().to_string())?)?;
        }
        for text in assignments {
            merge::overlay(&mut table, merge::assignment(text)?)?;
        }
        Self::from_table(table)
    }

    fn from_table(table: toml::Table) -> Result<Self, ConfigError> {
        let config = Self {
            input: typed(&table, "input")?,
            axis: typed(&table, "axis")?,
            tiling: typed(&table, "tiling")?,
            ground: typed(&table, "ground")?,
            cluster: typed(&table, "cluster")?,
            output: typed(&table, "output")?,
            run: typed(&table, "run")?,
            table,
        };
        config.validate()?;
        Ok(config)
    }

    fn validate(&self) -> Result<(), ConfigError> {
        let TilingConfig { cell, tile_length } = self.tiling;
        if !(0.5..=10.0).contains(&cell) {
            return Err(ConfigError::value("tiling.cell", cell, "0.5 to 10 (metres)"));
        }
        if !(tile_length == 0.0 || (1.0..=1e6).contains(&tile_length)) {
            return Err(ConfigError::value("tiling.tile_length", tile_length, "0, or 1 to 1000000 (metres)"));
        }
        if self.run.threads > 1_024 {
            return Err(ConfigError::value("run.threads", self.run.threads, "0 to 1024"));
        }
        let name = &self.output.dimension;
        if name.is_empty() || name.len() > 31 || !name.is_ascii() {
            return Err(ConfigError::value("output.dimension", name, "1 to 31 ASCII characters"));
        }
        Ok(())
    }

    /// The section of a method; empty if there is none.
    #[must_use]
    pub fn method_table(&self, name: &str) -> toml::Table {
        self.table.get(name).and_then(toml::Value::as_table).cloned().unwrap_or_default()
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
    serde_path_to_error::deserialize(toml::Value::Table(table.clone())).map_err(|error| {
        let path = error.path().to_string();
        let key = if path == "." { name.to_owned() } else { format!("{name}.{path}") };
        let (value, error) = (table.get(&path), error.into_inner());
        // A word is shown as it was given, anything else as TOML has it.
        match (value.and_then(toml::Value::as_str), choices::words(error.message())) {
            (Some(word), Some(words)) => ConfigError::value(key, word, words),
            _ => {
                ConfigError::value(key, value.map_or_else(String::new, ToString::to_string), error.message())
            }
        }
    })
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
        let config = set(&["euclidean.d_t=1", "cluster.method=euclidean", "tiling.tile_length=25"]).unwrap();
        assert_eq!(config.method_table("euclidean")["d_t"].as_float(), Some(1.0));
        assert!((config.tiling.tile_length - 25.0).abs() < 1e-12);
        for (text, expected) in [
            ("euclidean.dt=1", "there is no setting euclidean.dt, there is: d_t, min_points, max_points"),
            ("euclid.d_t=1", "there is no setting euclid"),
            ("tiling.cell=0.1", "tiling.cell = 0.1: must be 0.5 to 10 (metres)"),
            ("tiling.cell", "cannot read the assignment tiling.cell, expected section.key=value"),
            ("output.format=shp", "output.format = shp: must be same, las or laz"),
            ("input.unit=yard", "input.unit = yard: must be auto, metre, foot or us-survey-foot"),
            ("output.classification=no", "output.classification = no: must be set or keep"),
            ("run.fail_fast=3", "run.fail_fast = 3: must be a boolean"),
        ] {
            let message = set(&[text]).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
