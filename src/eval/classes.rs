//! The table of class codes: their names, and which of them are ground or noise. Which point has which class
//! is not known here.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::config::{self, ConfigError};

/// Names and roles of the class codes of a reference.
///
/// ```
/// use chainage::eval::ClassTable;
/// let classes = ClassTable::default();
/// assert_eq!(classes.name(2), "tree");
/// assert!(classes.is_ground(1) && classes.is_noise(0));
/// assert_eq!(classes.name(99), "class 99");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClassTable {
    names: BTreeMap<u16, String>,
    ground: Vec<u16>,
    noise: Vec<u16>,
}

/// The table that ships with the program.
const SHIPPED: &str = include_str!("../../config/classes.toml");

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    ground: Vec<u16>,
    noise: Vec<u16>,
    names: BTreeMap<String, String>,
}

impl ClassTable {
    /// Reads a table from the TOML `text` of `origin` (a file, for messages).
    ///
    /// # Errors
    /// [`ConfigError::Syntax`] if it is not TOML, [`ConfigError::Value`] if a key or a code is not as
    /// expected.
    pub fn parse(origin: &str, text: &str) -> Result<Self, ConfigError> {
        let table = text
            .parse::<toml::Table>()
            .map_err(|source| ConfigError::Syntax { origin: origin.to_owned(), source })?;
        let written: Written = config::section("classes", &table)?;
        let mut names = BTreeMap::new();
        for (code, name) in written.names {
            let number = code.parse().map_err(|_| {
                ConfigError::value(format!("{origin}: names.{code}"), &name, "named by a class code")
            })?;
            names.insert(number, name);
        }
        if let Some(both) = written.ground.iter().find(|code| written.noise.contains(code)) {
            return Err(ConfigError::value(
                format!("{origin}: noise"),
                both,
                "another code than those of ground",
            ));
        }
        Ok(Self { names, ground: written.ground, noise: written.noise })
    }

    /// The table for a reference without classes: all points have code 0, which is neither ground nor noise.
    #[must_use]
    pub fn unclassified() -> Self {
        Self { names: BTreeMap::from([(0, "object".to_owned())]), ground: Vec::new(), noise: Vec::new() }
    }

    /// Name of the class; `class N` for a code without a name.
    #[must_use]
    pub fn name(&self, code: u16) -> String {
        self.names.get(&code).cloned().unwrap_or_else(|| format!("class {code}"))
    }

    /// Whether points of this class are ground.
    #[must_use]
    pub fn is_ground(&self, code: u16) -> bool {
        self.ground.contains(&code)
    }

    /// The first class of the ground.
    #[must_use]
    pub fn first_ground(&self) -> Option<u16> {
        self.ground.first().copied()
    }

    /// Whether any class is ground.
    #[must_use]
    pub fn has_ground(&self) -> bool {
        !self.ground.is_empty()
    }

    /// Whether any class is stray returns.
    #[must_use]
    pub fn has_noise(&self) -> bool {
        !self.noise.is_empty()
    }

    /// Whether points of this class are stray returns.
    #[must_use]
    pub fn is_noise(&self, code: u16) -> bool {
        self.noise.contains(&code)
    }
}

impl Default for ClassTable {
    #[expect(clippy::expect_used, reason = "the text is part of the program and a unit test parses it")]
    fn default() -> Self {
        Self::parse("config/classes.toml", SHIPPED).expect("the shipped class table is valid")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_table_is_valid() {
        let table = ClassTable::parse("shipped", SHIPPED).unwrap();
        assert_eq!(table, ClassTable::default());
        assert_eq!(table.name(8), "wire");
    }

    #[test]
    fn a_wrong_table_is_refused_with_its_key() {
        for (text, says) in [
            ("ground = [1]\nnoise = [0]\n[names]\ntree = 'x'", "names.tree"),
            ("ground = [1]\nnoise = [1]\n[names]\n", "noise = 1"),
            ("ground = [1]\nnoise = [0]\ncolour = 3\n[names]\n", "colour"),
            ("ground = [-1]\nnoise = [0]\n[names]\n", "ground"),
            ("ground = ", "not valid TOML"),
            ("", "classes = ...: must be a table with ground"),
        ] {
            let message = ClassTable::parse("mine.toml", text).unwrap_err().to_string();
            assert!(message.contains(says), "{message} should name {says}");
        }
    }
}
