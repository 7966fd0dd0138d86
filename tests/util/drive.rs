//! Runs a drive through the library, and reads its outputs.

use std::path::{Path, PathBuf};

use chainage::config::Config;
use chainage::input::{Catalog, Fields, InputOptions, LengthUnit};
use chainage::run::{CancelToken, Registries, RunRequest, RunSummary, Silent, run};

/// The folder for tests: in memory if the system offers that, because a run syncs every unit.
pub(crate) fn scratch() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir()
        && let Ok(folder) = tempfile::tempdir_in(memory)
    {
        return folder;
    }
    tempfile::tempdir().expect("a temporary folder")
}

/// The configuration with these assignments, and otherwise the fastest methods, because most tests are about
/// the engine.
pub(crate) fn config(assignments: &[String]) -> Config {
    let methods = settings(&["cluster.method=euclidean", "ground.method=voxel-column"]);
    Config::resolve(None, &[&methods, assignments].concat()).expect("valid settings")
}

/// `a=b` texts in the form of the configuration.
pub(crate) fn settings(texts: &[&str]) -> Vec<String> {
    texts.iter().map(ToString::to_string).collect()
}

/// Runs a drive with methods of the caller.
pub(crate) fn run_with(
    inputs: &[PathBuf],
    out: &Path,
    assignments: &[String],
    registries: Registries<'_>,
) -> chainage::Result<RunSummary> {
    let request = RunRequest {
        inputs: inputs.to_vec(),
        out: out.to_owned(),
        config: config(assignments),
        fresh: false,
        registries,
    };
    run(&request, &Silent, &CancelToken::default())
}

/// Runs a drive.
pub(crate) fn drive(inputs: &[PathBuf], out: &Path, assignments: &[String]) -> chainage::Result<RunSummary> {
    run_with(inputs, out, assignments, Registries::default())
}

/// The labelled points of a drive, all files in order.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Labelled {
    /// Lattice coordinates.
    pub(crate) at: Vec<[i64; 3]>,
    /// LAS classes.
    pub(crate) class: Vec<u8>,
    /// Object ids.
    pub(crate) label: Vec<u32>,
    /// Intensities. Tests use them as marks.
    pub(crate) mark: Vec<u16>,
}

impl Labelled {
    /// Reads the labelled copies of `inputs` in `out`.
    pub(crate) fn read(inputs: &[PathBuf], out: &Path) -> Self {
        let copies: Vec<PathBuf> =
            inputs.iter().map(|input| out.join(input.file_name().expect("a file"))).collect();
        Self::of(&copies)
    }

    /// Reads labelled files.
    pub(crate) fn of(files: &[PathBuf]) -> Self {
        let options = InputOptions { mmap: true, unit: LengthUnit::Auto };
        let catalog = Catalog::open(files, &options).expect("labelled copies open");
        let mut all = Self::default();
        for file in catalog.files() {
            let layout = file.layout();
            let of_objects = layout.dimension("cluster_id").or_else(|| layout.dimension("surface_id"));
            let label = of_objects.expect("labelled").offset;
            for block in 0..file.blocks().len() {
                let mut buffer = Vec::new();
                for record in
                    file.records(block, Fields::All, &mut buffer).expect("readable").chunks(layout.record_len)
                {
                    let four = |at: usize| <[u8; 4]>::try_from(&record[at..at + 4]).expect("four bytes");
                    let xyz = [0, 4, 8].map(|at| i32::from_le_bytes(four(at)));
                    all.at.push(file.transform().apply(xyz));
                    all.class.push(record[layout.classification] & layout.classification_mask);
                    all.label.push(u32::from_le_bytes(four(label)));
                    all.mark.push(u16::from_le_bytes([record[12], record[13]]));
                }
            }
        }
        all
    }

    /// For each point, the smallest index with its label; `None` for label 0.
    pub(crate) fn partition(&self) -> Vec<Option<usize>> {
        let mut first = std::collections::BTreeMap::new();
        for (index, &label) in self.label.iter().enumerate().filter(|(_, label)| **label != 0) {
            first.entry(label).or_insert(index);
        }
        self.label.iter().map(|label| first.get(label).copied()).collect()
    }

    /// The points at `order`, in this order.
    pub(crate) fn pick(&self, order: &[usize]) -> Self {
        Self {
            at: order.iter().map(|&index| self.at[index]).collect(),
            class: order.iter().map(|&index| self.class[index]).collect(),
            label: order.iter().map(|&index| self.label[index]).collect(),
            mark: order.iter().map(|&index| self.mark[index]).collect(),
        }
    }
}

/// The outputs of a run by name, without the report (which has times), the same part of the page, and the
/// GeoPackage (which has a layer of the tiles; its other values are those of the tables).
pub(crate) fn outputs(out: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(out).expect("an output folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_file() && !["report.json", "objects.gpkg"].contains(&&*name) {
            let bytes = std::fs::read(&path).expect("readable");
            files.push(if name == "report.html" { (name, without_run(bytes)) } else { (name, bytes) });
        }
    }
    files.sort();
    assert!(
        files.len() >= 3,
        "labelled copies and two tables: {:?}",
        files.iter().map(|file| &file.0).collect::<Vec<_>>()
    );
    files
}

/// The page without the part about the run: times, memory, tiles. A truncated page stays as it is.
fn without_run(page: Vec<u8>) -> Vec<u8> {
    let text = String::from_utf8(page).expect("a page is text");
    let begin = text.split_once("id=\"data-run\">").map(|(before, _)| before.len());
    let end = begin.and_then(|begin| text[begin..].find("</script>").map(|end| begin + end));
    let (Some(begin), Some(end)) = (begin, end) else { return text.into_bytes() };
    format!("{}{}", &text[..begin], &text[end..]).into_bytes()
}

/// Compares the outputs of two runs, byte by byte.
pub(crate) fn assert_same_outputs(one: &Path, other: &Path, what: &str) {
    let one = outputs(one);
    let other = outputs(other);
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&one), names(&other), "{what}");
    for ((name, one), (_, other)) in one.iter().zip(&other) {
        let first = one.iter().zip(other).position(|(a, b)| a != b);
        assert!(
            one == other,
            "{what}: {name} differs ({} and {} bytes, first at {first:?})",
            one.len(),
            other.len()
        );
    }
}

/// Moves the time of a file forward, as copying the file or `touch` does.
pub(crate) fn touch(path: &Path) {
    let file = std::fs::File::options().write(true).open(path).expect("the file");
    file.set_modified(std::time::SystemTime::now() + std::time::Duration::from_secs(5)).expect("a new time");
}
