//! What a pass depends on, as a list of named values and as one number; and why something stored no longer fits.
//!
//! In a fingerprint: format version, method, parameters, geometry, content of the input. Not in it: threads, memory
//! budget, paths, verbosity; they change when and where something is computed and never what.

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

    /// With one more named value.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, value: impl ToString) -> Self {
        self.0.push((name.into(), value.to_string()));
        self
    }

    /// One number for all of it.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        let mut bytes = Vec::new();
        for (name, value) in &self.0 {
            // Lengths first, so that no two lists have the same bytes.
            for text in [name, value] {
                bytes.extend_from_slice(&(text.len() as u64).to_le_bytes());
                bytes.extend_from_slice(text.as_bytes());
            }
        }
        Fingerprint(xxh3_128(&bytes))
    }

    /// What differs from `stored`, by name.
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

/// One number for everything that a stored result depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint(pub u128);

impl std::fmt::Display for Fingerprint {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:032x}", self.0)
    }
}

/// One reason why a stored result does not fit any more.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StaleReason {
    /// What changed.
    pub name: String,
    /// Its value when the result was stored.
    pub old: Option<String>,
    /// Its value now.
    pub new: Option<String>,
}

impl StaleReason {
    /// Whether nothing of the pass itself has changed, but a pass that it depends on.
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
        let old = Inputs::new().with("euclidean.d_t", 0.3).with("gone", 1);
        let new = Inputs::new().with("euclidean.d_t", 0.4);
        assert_ne!(old.fingerprint(), new.fingerprint());
        let reasons: Vec<String> = new.differences(&old).iter().map(ToString::to_string).collect();
        assert_eq!(reasons, ["euclidean.d_t: 0.3 -> 0.4", "gone: 1 -> (nothing)"]);
    }

    #[test]
    fn neighbouring_texts_do_not_run_together() {
        let one = Inputs::new().with("ab", "c");
        let two = Inputs::new().with("a", "bc");
        assert_ne!(one.fingerprint(), two.fingerprint());
    }
}
