//! Checks settings without a drive.

use crate::config::Config;
use crate::error::Result;
use crate::model::Lattice;
use crate::run::chain::{Chain, Registries};

/// Checks that the chosen methods exist, and that the settings of every method are in range.
///
/// # Errors
/// The first setting that is out of range.
pub fn check_settings(config: &Config, registries: &Registries<'_>) -> Result<()> {
    // The lattice converts lengths to units. It does not affect the range of a setting.
    Chain::build(config, registries, Lattice::MILLIMETRE).map(|_| ())
}
