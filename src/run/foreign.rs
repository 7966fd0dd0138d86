//! Files in the state of a run that nobody needs. Those that chainage did not write stay, and a warning names
//! them. Those that killed processes left behind are removed.

use crate::error::Result;
use crate::run::drive::identity;
use crate::run::finish::mark;
use crate::run::{open, plan};
use crate::store::{RunDir, StoreError};
use crate::whole_file;

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

/// Removes half-written files that killed processes left in the state. This process holds the lock, so no
/// other process writes what only the driver of a run writes. A worker writes one file here, the record of
/// compared input: it is removed if its process was on this host and has ended. The folder of a pass is
/// cleared when the pass is complete.
pub(crate) fn remove_left_behind(run_dir: &RunDir) -> Result<()> {
    let outputs = run_dir.own_outputs()?;
    for name in run_dir.entries()? {
        let path = run_dir.path(&name);
        let removable = match whole_file::becomes(&name, &[".json", ".toml"]) {
            Some(of) if identity::is_comparison(of) => whole_file::is_left_behind(&path),
            Some(of) => is_ours(of),
            None => name.strip_suffix(".part").is_some_and(|of| outputs.iter().any(|output| output == of)),
        };
        if removable && path.is_file() {
            fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
        }
    }
    Ok(())
}

/// Whether an entry of the state has a name that some version of the flow uses.
fn is_ours(name: &str) -> bool {
    let names = [open::REQUEST, open::CONFIGURATION, mark::FINISHED, plan::STRIPS, "export"];
    // `.part`: a file that a process writes, or wrote when it was killed.
    names.contains(&name)
        || RunDir::NAMES.contains(&name)
        || name.starts_with(RunDir::PASS)
        || name.ends_with(".part")
        || (name.ends_with(".json") && (identity::is_name(name) || plan::is_stored_name(name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host;

    #[test]
    fn what_killed_processes_left_is_removed_and_nothing_else() {
        let out = tempfile::tempdir().unwrap();
        let run_dir = RunDir::open(out.path(), false).unwrap();
        run_dir.claim_outputs(&["objects.csv".to_owned()]).unwrap();
        let here = host::name();
        // No process has the number 4294967295.
        let gone = [
            "run.toml.node7-12-0.part".to_owned(),
            format!("finished.json.{here}-{}-5.part", std::process::id()),
            format!("input-0123456789abcdef.json.{here}-4294967295-1.part"),
            "objects.csv.part".to_owned(),
        ];
        let stays = [
            format!("input-0123456789abcdef.json.{here}-{}-1.part", std::process::id()),
            "input-0123456789abcdef.json.node7-4294967295-1.part".to_owned(),
            "mine.part".to_owned(),
            "mine.json.node7-12-0.part".to_owned(),
        ];
        for name in gone.iter().chain(&stays) {
            std::fs::write(run_dir.path(name), "half").unwrap();
        }
        remove_left_behind(&run_dir).unwrap();
        assert_eq!(gone.iter().filter(|name| run_dir.path(name).exists()).count(), 0);
        assert_eq!(stays.iter().filter(|name| run_dir.path(name).exists()).count(), stays.len());
    }
}
