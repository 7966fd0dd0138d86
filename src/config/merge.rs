//! Overrides one table of settings with another. Every key must exist in the defaults with the same type.

use toml::{Table, Value};

use crate::config::ConfigError;

/// Parses a TOML text that came from `origin` (a file or an option).
pub(super) fn parse(text: &str, origin: &str) -> Result<Table, ConfigError> {
    text.parse().map_err(|source| ConfigError::Syntax { origin: origin.to_owned(), source })
}

/// The table of one assignment `section.key=value`. A value that is not TOML is taken as a string.
pub(super) fn assignment(text: &str) -> Result<Table, ConfigError> {
    let unreadable = || ConfigError::Assignment { text: text.to_owned() };
    let (path, value) = text.split_once('=').ok_or_else(unreadable)?;
    let (section, key) = path.trim().split_once('.').ok_or_else(unreadable)?;
    let value = value.trim();
    let parsed = format!("value = {value}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
    let mut inner = Table::new();
    inner.insert(key.to_owned(), parsed.unwrap_or_else(|| Value::String(value.to_owned())));
    let mut outer = Table::new();
    outer.insert(section.to_owned(), Value::Table(inner));
    Ok(outer)
}

/// Overrides values of `base` with those of `upper`.
pub(super) fn overlay(base: &mut Table, upper: Table) -> Result<(), ConfigError> {
    let sections: Vec<String> = base.keys().cloned().collect();
    for (name, value) in upper {
        let Some(Value::Table(section)) = base.get_mut(&name) else {
            return Err(ConfigError::UnknownKey { key: name, known: sections });
        };
        let Value::Table(values) = value else {
            return Err(ConfigError::value(name, value, "a section with keys"));
        };
        for (key, value) in values {
            let known: Vec<String> = section.keys().cloned().collect();
            let dotted = format!("{name}.{key}");
            let Some(old) = section.get_mut(&key) else {
                return Err(ConfigError::UnknownKey { key: dotted, known });
            };
            *old = same_type(&dotted, old, value)?;
        }
    }
    Ok(())
}

/// `value`, if it has the type of the default. An integer is accepted for a real number. So is `auto`, if the
/// section accepts it later.
fn same_type(key: &str, default: &Value, value: Value) -> Result<Value, ConfigError> {
    match (default, value) {
        #[expect(clippy::cast_precision_loss, reason = "settings are small numbers")]
        (Value::Float(_), Value::Integer(number)) => Ok(Value::Float(number as f64)),
        (Value::Float(_), Value::String(text)) if text == "auto" => Ok(Value::String(text)),
        (default, value) if default.same_type(&value) => Ok(value),
        (default, value) => {
            let article = if default.is_integer() { "an" } else { "a" };
            Err(ConfigError::value(key, &value, format!("{article} {}", default.type_str())))
        }
    }
}
