//! Names of passes: as the user sees them, and as folders of the state.

use crate::store::Inputs;

/// Between the folder of a pass and the number of a round.
const ROUND: &str = "-round-";

/// What is known of a pass before it is run: its name, its folder, and what it depends on.
#[derive(Debug, Clone)]
pub(crate) struct Outline {
    /// Name, as the user sees it.
    pub(crate) name: &'static str,
    /// Folder of its units in the state.
    pub(crate) folder: String,
    /// What it depends on, by name.
    pub(crate) depends: Inputs,
}

impl Outline {
    /// The pass `name`, number `number` of the flow.
    pub(crate) fn new(number: u32, name: &'static str, depends: Inputs) -> Self {
        Self { name, folder: format!("{}{name}", prefix(number)), depends }
    }

    /// A pass of a method: they share a number, and are numbered among themselves.
    pub(crate) fn of_step(number: u32, step: usize, name: &'static str, depends: Inputs) -> Self {
        Self { name, folder: format!("{}{}-{name}", prefix(number), step + 1), depends }
    }

    /// Whether a folder is that of this pass or of one of its rounds.
    pub(crate) fn owns(&self, folder: &str) -> bool {
        folder.strip_prefix(&self.folder).is_some_and(|rest| rest.is_empty() || rest.starts_with(ROUND))
    }

    /// Round `round` of a step that is repeated; the first is the pass itself.
    pub(crate) fn round(&self, round: u32) -> Self {
        if round == 0 {
            return self.clone();
        }
        let folder = format!("{}{ROUND}{round}", self.folder);
        Self { name: self.name, folder, depends: self.depends.clone().with("round", round) }
    }
}

/// How the folders of all passes with a number begin.
pub(crate) fn prefix(number: u32) -> String {
    format!("pass-{number:02}-")
}
