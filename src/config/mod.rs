//! Typed, validated settings with units; the defaults are the embedded `config/default.toml`.

mod error;

pub use error::ConfigError;

use serde::de::DeserializeOwned;

/// Reads one section (a method's settings) from its table; keys are checked, missing keys have their defaults.
///
/// # Errors
/// [`ConfigError::Value`] with the dotted key when a key is unknown or a value has the wrong type.
pub fn section<T: DeserializeOwned>(name: &str, table: &toml::Table) -> Result<T, ConfigError> {
    serde_path_to_error::deserialize(toml::Value::Table(table.clone())).map_err(|error| {
        let path = error.path().to_string();
        let key = if path == "." { name.to_owned() } else { format!("{name}.{path}") };
        let value = table.get(&path).map_or_else(String::new, ToString::to_string);
        ConfigError::value(key, value, error.into_inner().to_string())
    })
}
