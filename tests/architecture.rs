//! The rules of the architecture, checked in the sources: which module may use which, that no files import
//! each other in a circle, how long a file may be, and how it starts; and that defaults are written down
//! once.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use chainage::config::{Config, DEFAULT_TOML};
use chainage::ground::{IsolatedNoise, NoiseConfig};
use chainage::{cluster, ground};

use crate::util::imports::{self, Graph};
use crate::util::shipped;

/// Largest number of lines of the production part of a file.
const LONGEST: usize = 500;

/// A source file: path below `src`, text, and the text without its unit tests.
struct Source {
    path: String,
    text: String,
    production: String,
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn sources() -> Vec<Source> {
    let root = shipped("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    files.sort();
    assert!(files.len() > 40, "{} files", files.len());
    files
        .into_iter()
        .map(|file| {
            let text = std::fs::read_to_string(&file).expect("readable");
            let production = text.split("#[cfg(test)]\n").next().expect("a first part").to_owned();
            let path = file.strip_prefix(&root).expect("below").to_string_lossy().into_owned();
            Source { path, text, production }
        })
        .collect()
}

impl Source {
    /// The module at the top that the file belongs to.
    fn module(&self) -> &str {
        self.path.split('/').next().expect("a name").trim_end_matches(".rs")
    }

    /// The code without comments, in which the used names are searched.
    fn code(&self) -> String {
        self.production
            .lines()
            .map(|line| line.split("//").next().unwrap_or(""))
            .collect::<Vec<_>>()
            .join("\n")
    }

    /// Whether the code names another crate.
    fn names_crate(&self, name: &str) -> bool {
        let code = self.code();
        code.match_indices(&format!("{name}::"))
            .any(|(at, _)| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'))
    }
}

/// Which file imports which.
fn graph() -> Graph {
    let sources = sources();
    imports::graph(sources.iter().map(|source| (source.path.as_str(), source.production.as_str())))
}

/// The module at the top that a file belongs to.
fn module_of(file: &str) -> &str {
    file.split('/').next().expect("a name").trim_end_matches(".rs")
}

/// The layers, from the lowest up. A module uses modules of lower layers only, and none of its own layer or
/// above.
const LAYERS: [&[&str]; 7] = [
    &["error", "allocator", "open_files", "words", "host"],
    &["codec", "scratch_folder", "whole_file", "table"],
    &["model", "spill"],
    // In one layer, because the search for neighbours and the learning from tables know no settings of the
    // program, and settings do not need them.
    &["spatial", "boosting", "config"],
    &["input", "survey", "tiling", "ground", "cluster", "stitch", "inventory", "output", "store"],
    &["run", "eval", "synth"],
    &["cli"],
];

/// Allowed imports between modules of one layer: a labelled copy is made from the bytes of its input.
const BESIDE: [(&str, &str); 1] = [("output", "input")];

/// Modules of the flow that others than `run`, which joins them all, may use.
const JOINED_ELSEWHERE: [(&str, &[&str]); 3] = [
    ("eval", &["input", "survey"]),
    ("synth", &["output"]),
    ("cli", &["input", "survey", "ground", "cluster", "output"]),
];

#[test]
fn modules_use_only_what_is_in_layers_below() {
    let layer = |module: &str| LAYERS.iter().position(|layer| layer.contains(&module));
    let flow = LAYERS[4];
    let mut joined = BTreeSet::new();
    for (file, imported) in graph() {
        let user = module_of(&file);
        if user == "main" || user == "lib" {
            continue;
        }
        let own = layer(user).unwrap_or_else(|| panic!("src/{file} is in no layer"));
        for used in imported.iter().map(|file| module_of(file)).filter(|used| *used != user) {
            let theirs = layer(used).unwrap_or_else(|| panic!("{used} is in no layer"));
            assert!(
                theirs < own || BESIDE.contains(&(user, used)),
                "src/{file} uses {used}, which is not below it"
            );
            if !flow.contains(&used) {
                continue;
            }
            match JOINED_ELSEWHERE.iter().find(|(module, _)| *module == user) {
                _ if user == "run" => _ = joined.insert(used.to_owned()),
                Some((_, allowed)) => {
                    assert!(allowed.contains(&used), "src/{file} uses {used}: only run joins it")
                }
                None => {}
            }
        }
    }
    let all = flow.iter().map(|module| (*module).to_owned());
    assert_eq!(joined, all.collect(), "run joins the flow: the test sees imports");
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let graph = graph();
    let circles = imports::circles(&graph);
    let drawn: Vec<String> = circles.iter().map(|circle| imports::drawn(&graph, circle)).collect();
    assert!(circles.is_empty(), "{} circles:\n{}", circles.len(), drawn.join("\n"));
}

#[test]
fn imports_are_seen_through_re_exports_and_make_circles() {
    let read = |sources: &[(&'static str, &'static str)]| imports::graph(sources.iter().copied());
    // If a child uses a name through its parent that a sibling defines, it imports the sibling, and the
    // parent imports nothing.
    let mod_rs = "mod one;\nmod two;\npub use one::{One, Other};\npub(crate) use two::two;\n";
    let one =
        "use std::fmt;\npub struct One;\npub struct Other { text: &'static str } // crate::nothing::At\n";
    let two =
        "use super::One;\npub(crate) fn two(_: One) -> char { let _ = \"use crate::none::X;\"; '\"' }\n";
    let sources = [("a/mod.rs", mod_rs), ("a/one.rs", one), ("a/two.rs", two), ("lib.rs", "mod a;")];
    let graph = read(&sources);
    assert_eq!(graph["a/two.rs"], BTreeSet::from(["a/one.rs".to_owned()]));
    assert!(graph["a/mod.rs"].is_empty() && graph["lib.rs"].is_empty() && graph["a/one.rs"].is_empty());
    assert!(imports::circles(&graph).is_empty());
    // A path in the code, through a renamed module, closes the circle.
    let closing = "use crate::a as b;\npub struct One; pub struct Other;\nfn f(x: One) { b::two(x); }\n";
    let graph = read(&[sources[0], ("a/one.rs", closing), sources[2], sources[3]]);
    let circle = BTreeSet::from(["a/one.rs".to_owned(), "a/two.rs".to_owned()]);
    assert_eq!(imports::circles(&graph), [circle]);
    // A parent whose own code uses a name that it re-exports imports its child.
    let using =
        "mod one;\nmod two;\npub use one::{One, Other};\npub(crate) use two::two;\npub struct S(Other);\n";
    let graph = read(&[("a/mod.rs", using), sources[1], sources[2], sources[3]]);
    assert_eq!(graph["a/mod.rs"], BTreeSet::from(["a/one.rs".to_owned()]));
}

#[test]
fn methods_see_no_files_no_threads_and_no_clock() {
    let methods = ["ground", "cluster", "stitch", "tiling", "inventory"];
    for source in sources().iter().filter(|source| methods.contains(&source.module())) {
        for word in [
            "std::fs",
            "fs_err",
            "std::path",
            "PathBuf",
            "std::thread",
            "rayon",
            "std::time",
            "Instant",
            "rand::",
        ] {
            // All rows of a table are in memory, and there are no tiles to process in parallel.
            let rows = word == "rayon" && source.path.ends_with("/rows.rs");
            assert!(rows || !source.code().contains(word), "src/{} knows {word}", source.path);
        }
    }
    for (file, imported) in graph().iter().filter(|(file, _)| methods.contains(&module_of(file))) {
        assert!(!imported.contains("whole_file.rs"), "src/{file} writes files");
    }
}

/// Crates that only the modules that wrap them may use: their names, and the places where they may be named.
const WRAPPED: [(&str, &[&str]); 17] = [
    ("clap", &["cli/"]),
    ("clap_complete", &["cli/"]),
    ("clap_mangen", &["cli/"]),
    ("indicatif", &["cli/"]),
    ("signal_hook", &["cli/"]),
    ("las", &["input/", "output/"]),
    ("laz", &["input/", "output/"]),
    ("memmap2", &["input/mapped.rs"]),
    ("kiddo", &["spatial/nearest.rs", "spatial/neighbours.rs"]),
    ("plotters", &["output/report/chart.rs"]),
    ("postcard", &["codec.rs"]),
    ("base64", &["output/report/packed.rs"]),
    ("miniz_oxide", &["output/report/packed.rs"]),
    ("sha2", &["output/report/packed.rs"]),
    ("httparse", &["cli/http.rs"]),
    ("httpdate", &["cli/http.rs"]),
    ("rustix", &["host.rs", "open_files.rs"]),
];

#[test]
fn types_of_other_crates_stay_in_the_module_that_wraps_them() {
    let sources = sources();
    for (name, places) in WRAPPED {
        let users: Vec<&str> = sources
            .iter()
            .filter(|source| source.names_crate(name))
            .map(|source| source.path.as_str())
            .collect();
        assert!(!users.is_empty(), "nobody uses {name}: the test does not see it");
        for user in users {
            assert!(places.iter().any(|place| user.starts_with(place)), "src/{user} uses {name}");
        }
    }
}

#[test]
fn unsafe_code_is_in_four_files() {
    let users: Vec<String> = sources()
        .into_iter()
        .filter(|source| {
            source.code().split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == "unsafe")
        })
        .map(|source| source.path)
        .collect();
    assert_eq!(users, ["allocator.rs", "boosting/evaluate.rs", "input/mapped.rs", "spatial/vectors/mod.rs"]);
}

#[test]
fn every_file_says_its_duty_first_and_none_is_long() {
    let mut all: Vec<PathBuf> = Vec::new();
    for folder in ["src", "tests", "benches"] {
        rust_files(&shipped(folder), &mut all);
    }
    for path in all {
        let text = std::fs::read_to_string(&path).expect("readable");
        let first = text.lines().next().unwrap_or_default();
        assert!(first.starts_with("//! ") && first.len() > 12, "{} begins with {first:?}", path.display());
    }
    for source in sources() {
        let lines = source.production.lines().count();
        assert!(lines <= LONGEST, "src/{} has {lines} lines before its tests", source.path);
        assert!(!source.text.contains("Temporary."), "src/{} is a placeholder", source.path);
    }
}

#[test]
fn comments_are_as_wide_as_code() {
    let settings: toml::Table =
        std::fs::read_to_string(shipped("rustfmt.toml")).expect("readable").parse().expect("TOML");
    let widest = usize::try_from(settings["max_width"].as_integer().expect("a number")).expect("a width");
    let mut all: Vec<PathBuf> = Vec::new();
    for folder in ["src", "tests", "benches", "python/src"] {
        rust_files(&shipped(folder), &mut all);
    }
    for path in all {
        let text = std::fs::read_to_string(&path).expect("readable");
        for (number, line) in (1..).zip(text.lines()) {
            let is_comment = line.trim_start().starts_with("//");
            assert!(!is_comment || line.chars().count() <= widest, "{}:{number}: {line}", path.display());
        }
    }
}

/// The section of `name` in the defaults.
fn section(name: &str) -> toml::Table {
    Config::resolve(None, &[]).expect("the defaults").method_table(name)
}

#[test]
fn the_file_of_defaults_and_the_defaults_of_methods_are_the_same() {
    assert_eq!(DEFAULT_TOML, std::fs::read_to_string(shipped("config/default.toml")).expect("read"));
    let empty = toml::Table::new();
    for entry in ground::REGISTRY {
        let table = section(entry.name);
        assert!(!table.is_empty(), "config/default.toml has no section [{}]", entry.name);
        let built = [&table, &empty].map(|table| format!("{:?}", (entry.build)(table).expect("valid")));
        assert_eq!(built[0], built[1], "{}", entry.name);
    }
    let config = Config::resolve(None, &[]).expect("the defaults");
    for entry in cluster::REGISTRY {
        assert!(!section(entry.name).is_empty(), "config/default.toml has no section [{}]", entry.name);
        let written = (entry.build)(&|name| config.method_table(name)).expect("valid");
        let default = (entry.build)(&|_| empty.clone()).expect("valid");
        assert_eq!(format!("{written:?}"), format!("{default:?}"), "{}", entry.name);
    }
    let noise: NoiseConfig = chainage::config::section("noise", &section("noise")).expect("valid");
    assert_eq!(noise, NoiseConfig::default());
    IsolatedNoise::new(&noise).expect("valid");
}

/// Every section of the defaults belongs to a part of the program or to a method. Every key has a comment of
/// its own, or one in the lines above.
#[test]
fn the_file_of_defaults_explains_every_key() {
    let methods = ground::REGISTRY
        .iter()
        .map(|entry| entry.name)
        .chain(cluster::REGISTRY.iter().map(|entry| entry.name));
    let known: BTreeSet<&str> =
        ["input", "axis", "tiling", "noise", "ground", "cluster", "epsilon", "output", "run"]
            .into_iter()
            .chain(methods)
            .collect();
    for line in DEFAULT_TOML.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if let Some(rest) = line.strip_prefix('[') {
            let name = rest.split(']').next().expect("a name");
            assert!(known.contains(name), "[{name}] belongs to nothing");
        } else {
            assert!(line.contains(" # "), "no comment: {line}");
        }
    }
}

#[test]
fn the_readme_lists_every_method() {
    let readme = std::fs::read_to_string(shipped("README.md")).expect("README.md");
    for name in ground::REGISTRY
        .iter()
        .map(|entry| entry.name)
        .chain(cluster::REGISTRY.iter().map(|entry| entry.name))
    {
        assert!(readme.contains(&format!("`{name}`")), "README.md does not name `{name}`");
    }
}
