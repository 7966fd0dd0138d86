//! Files in the state of a run that chainage did not write. They stay, and a warning names them.

use crate::error::Result;
use crate::run::drive::identity;
use crate::run::finish::mark;
use crate::run::{open, plan};
use crate::store::RunDir;

/// A warning about each file or folder of the state whose name chainage does not use.
pub(crate) fn warnings(run_dir: &RunDir) -> Result<Vec<String>> {
    let foreign = run_dir.entries()?.into_iter().filter(|name| !is_ours(name));
    Ok(foreign
        .map(|name| {
            let path = run_dir.path(&name);
            format!("chainage did not write {}: it stays until --fresh removes it", path.display())
        })
        .collect())
}

/// Whether an entry of the state has a name that some version of the flow uses.
fn is_ours(name: &str) -> bool {
    let names = [open::REQUEST, open::CONFIGURATION, mark::FINISHED, plan::STRIPS, "export"];
    // `.part`: a file that a process wrote when it was killed.
    names.contains(&name)
        || RunDir::NAMES.contains(&name)
        || name.starts_with(RunDir::PASS)
        || name.ends_with(".part")
        || (name.ends_with(".json") && (identity::is_name(name) || plan::is_stored_name(name)))
}
