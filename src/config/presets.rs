//! The presets, by name: tested settings for a kind of scene.

use crate::config::ConfigError;

/// A preset: a configuration file that is part of the program.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// Its settings as TOML, with a comment at the top that says what they are for.
    pub text: &'static str,
}

/// Every preset.
pub const PRESETS: &[Preset] = &[
    Preset { name: "dense-trees", text: include_str!("../../config/dense-trees.toml") },
    Preset { name: "forest", text: include_str!("../../config/forest.toml") },
    Preset { name: "density-peaks", text: include_str!("../../config/density-peaks.toml") },
];

impl Preset {
    /// The lines of the comment at the top, without its comment signs.
    pub fn summary(&self) -> impl Iterator<Item = &'static str> {
        self.text.lines().map_while(|line| line.strip_prefix('#')).map(str::trim)
    }

    /// The preset with a name.
    pub(super) fn find(name: &str) -> Result<&'static Self, ConfigError> {
        PRESETS.iter().find(|preset| preset.name == name).ok_or_else(|| ConfigError::UnknownPreset {
            name: name.to_owned(),
            known: PRESETS.iter().map(|preset| preset.name.to_owned()).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn every_preset_is_accepted_and_says_what_it_is_for() {
        for preset in PRESETS {
            Config::with_preset(Some(preset.name), None, &[]).unwrap();
            assert!(preset.summary().map(str::len).sum::<usize>() > 40, "{}", preset.name);
        }
        let error = Config::with_preset(Some("dense-tree"), None, &[]).unwrap_err().to_string();
        assert_eq!(error, "there is no preset dense-tree: did you mean dense-trees?");
    }
}
