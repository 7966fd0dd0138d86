//! Overrides one table of settings with another. Every key must exist in the defaults with the same type.

use toml::{Table, Value};

use crate::config::{ConfigError, renamed};
use crate::words;

/// Parses a TOML text that came from `origin` (a file or an option).
pub(super) fn parse(text: &str, origin: &str) -> Result<Table, ConfigError> {
    text.parse().map_err(|source| ConfigError::Syntax { origin: origin.to_owned(), source })
}

/// The table of one assignment `section.key=value`. A value that is not TOML is read as a string. If the
/// section is missing, the error names the sections of `base` with this key.
pub(super) fn assignment(text: &str, base: &Table) -> Result<Table, ConfigError> {
    let unreadable = || ConfigError::Assignment { text: text.to_owned() };
    let (path, value) = text.split_once('=').ok_or_else(unreadable)?;
    let (path, value) = (path.trim(), value.trim());
    let Some((section, key)) = path.split_once('.') else {
        let has = |values: &Value| values.as_table().is_some_and(|values| values.contains_key(path));
        let sections: Vec<String> =
            base.iter().filter(|(_, values)| has(values)).map(|(section, _)| section.clone()).collect();
        let settings: Vec<String> = renamed::once_called(path).collect();
        let (key, value) = (path.to_owned(), value.to_owned());
        return Err(match (sections.is_empty(), settings.is_empty()) {
            (false, _) => ConfigError::NoSection { key, value, sections },
            (true, false) => ConfigError::OldName { key, value, settings },
            (true, true) => unreadable(),
        });
    };
    let parsed = format!("value = {value}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
    let mut inner = Table::new();
    inner.insert(key.to_owned(), parsed.unwrap_or_else(|| Value::String(value.to_owned())));
    let mut outer = Table::new();
    outer.insert(section.to_owned(), Value::Table(inner));
    Ok(outer)
}

/// Overrides values of `base` with values of `upper`. Old names are read with a warning.
pub(super) fn overlay(base: &mut Table, upper: Table, warnings: &mut Vec<String>) -> Result<(), ConfigError> {
    let all: Vec<String> = keys(base).into_iter().chain(renamed::old_names()).collect();
    let similar = |key: &str| {
        let meant = words::similar(key, all.iter().map(String::as_str));
        meant.map(|meant| renamed::today(meant.to_owned()))
    };
    let sections: Vec<String> = base.keys().cloned().collect();
    for (name, value) in upper {
        let Some(Value::Table(section)) = base.get_mut(&name) else {
            let first = value.as_table().and_then(|values| values.keys().next());
            let key = first.map_or_else(|| name.clone(), |first| format!("{name}.{first}"));
            return Err(ConfigError::UnknownKey { similar: similar(&key), key, known: sections });
        };
        let Value::Table(values) = value else {
            return Err(ConfigError::value(name, value, "a section with keys"));
        };
        for (mut key, value) in values {
            if let Some(new) = renamed::new_name(&name, &key) {
                warnings.push(renamed::warning(&name, &key, new));
                new.clone_into(&mut key);
            }
            let known: Vec<String> = section.keys().cloned().collect();
            let dotted = format!("{name}.{key}");
            let Some(old) = section.get_mut(&key) else {
                // Only the key is compared: with a correct section, any two keys would be similar.
                let old = all.iter().filter_map(|known| known.strip_prefix(&name)?.strip_prefix('.'));
                let meant = words::similar(&key, old);
                let similar = meant.map(|meant| renamed::today(format!("{name}.{meant}")));
                return Err(ConfigError::UnknownKey { similar, key: dotted, known });
            };
            *old = same_type(&dotted, old, value)?;
        }
    }
    Ok(())
}

/// The value in `table` of an assigned setting, if it differs from the assigned value by now.
pub(super) fn overridden(table: &Table, assigned: &Table) -> Option<Value> {
    let (section, values) = assigned.iter().next()?;
    let (key, value) = values.as_table()?.iter().next()?;
    let key = renamed::new_name(section, key).unwrap_or(key);
    let now = table.get(section)?.get(key)?;
    let same = match (now, value) {
        (Value::Float(now), Value::Integer(_)) => value.to_string().parse() == Ok(*now),
        _ => now == value,
    };
    (!same).then(|| now.clone())
}

/// Every key of a table of sections, dotted.
fn keys(base: &Table) -> Vec<String> {
    let of_section = |(section, values): (&String, &Value)| {
        let keys = values.as_table().into_iter().flatten().map(|(key, _)| key);
        keys.map(|key| format!("{section}.{key}")).collect::<Vec<_>>()
    };
    base.iter().flat_map(of_section).collect()
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
            let expected = match default {
                Value::Boolean(_) => "true or false".to_owned(),
                Value::Integer(_) => "a whole number".to_owned(),
                Value::Float(_) => "a number".to_owned(),
                Value::String(_) => "text".to_owned(),
                Value::Array(_) => format!("a list, for example [{value}]"),
                Value::Datetime(_) | Value::Table(_) => default.type_str().to_owned(),
            };
            Err(ConfigError::value(key, &value, expected))
        }
    }
}
