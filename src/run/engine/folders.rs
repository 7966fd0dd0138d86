//! Names of passes for the user, and of their folders in the state.

use crate::store::{Inputs, RunDir};

/// Separates the folder of a pass from the number of a round.
const ROUND: &str = "-round-";

/// The outline of a pass: its name, its folder, and the values that it depends on. It is known before the
/// pass runs.
#[derive(Debug, Clone)]
pub(crate) struct Outline {
    /// Name, as the user sees it.
    pub(crate) name: &'static str,
    /// Folder of its units in the state.
    pub(crate) folder: String,
    /// The values that it depends on, by name.
    pub(crate) depends: Inputs,
}

impl Outline {
    /// The pass `name`, with its number in the flow.
    pub(crate) fn new(number: u32, name: &'static str, depends: Inputs) -> Self {
        Self { name, folder: format!("{}{name}", prefix(number)), depends }
    }

    /// A pass of a method. These passes share a number in the flow and have numbers of their own.
    pub(crate) fn of_step(number: u32, step: usize, name: &'static str, depends: Inputs) -> Self {
        Self { name, folder: format!("{}{}-{name}", prefix(number), step + 1), depends }
    }

    /// Name of the pass with the number of its round, as workers name it: `growth`, `growth-round-2`.
    pub(crate) fn title(&self) -> String {
        match self.folder.split_once(ROUND) {
            Some((_, round)) => format!("{}{ROUND}{round}", self.name),
            None => self.name.to_owned(),
        }
    }

    /// Whether a title names this pass or one of its rounds.
    pub(crate) fn is_named(&self, title: &str) -> bool {
        title.strip_prefix(self.name).is_some_and(|rest| rest.is_empty() || rest.starts_with(ROUND))
    }

    /// Whether a folder belongs to this pass or to one of its rounds.
    pub(crate) fn owns(&self, folder: &str) -> bool {
        folder.strip_prefix(&self.folder).is_some_and(|rest| rest.is_empty() || rest.starts_with(ROUND))
    }

    /// Round `round` of a repeated step. The first round is the pass itself.
    pub(crate) fn round(&self, round: u32) -> Self {
        if round == 0 {
            return self.clone();
        }
        let folder = format!("{}{ROUND}{round}", self.folder);
        Self { name: self.name, folder, depends: self.depends.clone().with("round", round) }
    }
}

/// Prefix of the folders of all passes with a number.
pub(crate) fn prefix(number: u32) -> String {
    format!("{}{number:02}-", RunDir::PASS)
}
