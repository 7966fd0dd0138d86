//! The tables that are part of the generator.

use serde::de::DeserializeOwned;

/// The values of one of these tables.
#[expect(
    clippy::expect_used,
    reason = "the text is part of the program, and every test of a drive parses it"
)]
pub(crate) fn shipped<T: DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).expect("the shipped tables are valid")
}
