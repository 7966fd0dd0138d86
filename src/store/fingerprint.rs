//! The values that a pass depends on, as a list of named values and as one number; and the reasons why a
//! stored result no longer fits.
//!
//! A fingerprint includes the format version, the method, its parameters, the geometry and the content of the
//! input. It does not include threads, memory budget, paths and verbosity: these change when and where a
//! result is computed, but not the result.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_128;

/// Named values that a pass depends on, in a fixed order.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs(Vec<(String, String)>);

impl Inputs {
    /// An empty list.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a named value.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, value: impl ToString) -> Self {
        self.0.push((name.into(), value.to_string()));
        self
    }

    /// One number for the whole list.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        let mut bytes = Vec::new();
        for (name, value) in &self.0 {
            // Each text is preceded by its length, so that different lists have different bytes.
            for text in [name, value] {
                bytes.extend_from_slice(&(text.len() as u64).to_le_bytes());
                bytes.extend_from_slice(text.as_bytes());
            }
        }
        Fingerprint(xxh3_128(&bytes))
    }

    /// The differences from `stored`, by name.
    #[must_use]
    pub fn differences(&self, stored: &Self) -> Vec<StaleReason> {
        let find = |list: &Self, name: &str| {
            list.0.iter().find(|entry| entry.0 == name).map(|entry| entry.1.clone())
        };
        let mut reasons = Vec::new();
        for (name, value) in &self.0 {
            let old = find(stored, name);
            if old.as_ref() != Some(value) {
                reasons.push(StaleReason { name: name.clone(), old, new: Some(value.clone()) });
            }
        }
        for (name, value) in &stored.0 {
            if find(self, name).is_none() {
                reasons.push(StaleReason { name: name.clone(), old: Some(value.clone()), new: None });
            }
        }
        reasons
    }
}

/// One number for all values that a stored result depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint(pub u128);

impl std::fmt::Display for Fingerprint {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:032x}", self.0)
    }
}

/// One reason why a stored result no longer fits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StaleReason {
    /// Name of the changed value.
    pub name: String,
    /// Its value when the result was stored.
    pub old: Option<String>,
    /// Its value now.
    pub new: Option<String>,
}

impl StaleReason {
    /// Whether the change is in an earlier pass, and not in a value of this pass.
    #[must_use]
    pub fn is_of_another_pass(&self) -> bool {
        self.name.starts_with("pass ")
    }
}

impl std::fmt::Display for StaleReason {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let show = |value: &Option<String>| value.clone().unwrap_or_else(|| "(nothing)".to_owned());
        write!(formatter, "{}: {} -> {}", self.name, show(&self.old), show(&self.new))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_name_old_and_new() {
        let old = Inputs::new().with("euclidean.max_gap_m", 0.3).with("gone", 1);
        let new = Inputs::new().with("euclidean.max_gap_m", 0.4);
        assert_ne!(old.fingerprint(), new.fingerprint());
        let reasons: Vec<String> = new.differences(&old).iter().map(ToString::to_string).collect();
        assert_eq!(reasons, ["euclidean.max_gap_m: 0.3 -> 0.4", "gone: 1 -> (nothing)"]);
    }

    #[test]
    fn neighbouring_texts_do_not_run_together() {
        let one = Inputs::new().with("ab", "c");
        let two = Inputs::new().with("a", "bc");
        assert_ne!(one.fingerprint(), two.fingerprint());
    }
}
