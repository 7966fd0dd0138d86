//! The rules of the architecture, checked against the sources: who may use what, how long a file may be, and
//! what its first line says. Also: defaults are defined once.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use chainage::config::{Config, DEFAULT_TOML};
use chainage::ground::{IsolatedNoise, NoiseConfig};
use chainage::{cluster, ground};

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
            let production = text.split("#[cfg(test)]\nmod tests").next().expect("a first part").to_owned();
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

    /// The code without comments. What remains shows what it uses.
    fn code(&self) -> String {
        self.production
            .lines()
            .map(|line| line.split("//").next().unwrap_or(""))
            .collect::<Vec<_>>()
            .join("\n")
    }

    /// Modules of this crate that the code names after `crate::`, also in braces.
    fn own_modules(&self) -> BTreeSet<String> {
        let code = self.code();
        let mut found = BTreeSet::new();
        for prefix in ["crate::", "chainage::"] {
            for (at, _) in code.match_indices(prefix) {
                let rest = &code[at + prefix.len()..];
                if let Some(list) = rest.strip_prefix('{') {
                    let end = list.find("};").unwrap_or(list.len());
                    found.extend(first_names(&list[..end]));
                } else {
                    found.extend(first_names(rest.split([';', ' ', ')', '>', ',']).next().unwrap_or("")));
                }
            }
        }
        found
    }

    /// Whether the code names another crate.
    fn names_crate(&self, name: &str) -> bool {
        let code = self.code();
        code.match_indices(&format!("{name}::"))
            .any(|(at, _)| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'))
    }
}

/// The first names of the paths in a `use` list.
fn first_names(list: &str) -> impl Iterator<Item = String> + '_ {
    let mut depth = 0;
    let top = move |c: char| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth == 0 && c == ','
    };
    list.split(top).map(|path| path.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
}

/// Layers of the flow, which only `run` joins.
const LAYERS: [&str; 7] = ["input", "survey", "tiling", "ground", "cluster", "stitch", "output"];

#[test]
fn layers_do_not_know_each_other_and_only_run_joins_them() {
    let mut joined = BTreeSet::new();
    for source in sources() {
        let module = source.module().to_owned();
        let used = source.own_modules();
        let layers: BTreeSet<&str> =
            LAYERS.into_iter().filter(|layer| *layer != module && used.contains(*layer)).collect();
        if module == "run" {
            joined.extend(layers);
            continue;
        }
        let allowed: &[&str] = match module.as_str() {
            // A labelled copy consists of the bytes of its input.
            "output" => &["input"],
            // `error` wraps the errors of all; the program prints facts. `eval` reads labelled files, and
            // `synth` writes them, beside the flow.
            "error" | "lib" | "main" => &LAYERS,
            "eval" => &["input", "output"],
            "synth" => &["output"],
            "cli" => &["input", "survey", "ground", "cluster", "output"],
            _ => &[],
        };
        let foreign: Vec<&&str> = layers.iter().filter(|layer| !allowed.contains(layer)).collect();
        assert!(foreign.is_empty(), "src/{} uses {foreign:?}", source.path);
        if LAYERS.contains(&module.as_str()) {
            assert!(!used.contains("run") && !used.contains("store"), "src/{} uses {used:?}", source.path);
        }
        if module == "ground" || module == "cluster" {
            // Codec: stages keep bytes. Spatial: points of n dimensions in memory, without files.
            let known = ["model", "config", "error", "codec", "space", module.as_str()];
            let foreign: Vec<&String> =
                used.iter().filter(|name| !known.contains(&name.as_str()) && !name.is_empty()).collect();
            assert!(foreign.is_empty(), "src/{} uses {foreign:?}", source.path);
        }
        if module == "model" {
            assert!(
                used.iter().all(|name| ["model", "error", ""].contains(&name.as_str())),
                "src/{}: {used:?}",
                source.path
            );
        }
    }
    assert_eq!(joined, LAYERS.into_iter().collect(), "run joins all layers: the test sees imports");
}

#[test]
fn methods_see_no_files_no_threads_and_no_clock() {
    for source in
        sources().iter().filter(|source| ["ground", "cluster", "stitch", "tiling"].contains(&source.module()))
    {
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
            assert!(!source.code().contains(word), "src/{} knows {word}", source.path);
        }
    }
}

/// Crates that remain in the modules that wrap them: their names, and the places where they may be named.
const WRAPPED: [(&str, &[&str]); 11] = [
    ("clap", &["cli/"]),
    ("clap_complete", &["cli/"]),
    ("clap_mangen", &["cli/"]),
    ("indicatif", &["cli/"]),
    ("ctrlc", &["cli/"]),
    ("las", &["input/", "output/"]),
    ("laz", &["input/", "output/"]),
    ("memmap2", &["input/mapped.rs"]),
    ("kiddo", &["model/nearest.rs", "space/index.rs"]),
    ("plotters", &["output/chart.rs"]),
    ("postcard", &["codec.rs"]),
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
fn unsafe_code_is_in_two_files() {
    let users: Vec<String> = sources()
        .into_iter()
        .filter(|source| {
            source.code().split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == "unsafe")
        })
        .map(|source| source.path)
        .collect();
    assert_eq!(users, ["allocator.rs", "input/mapped.rs"]);
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
    for entry in cluster::REGISTRY {
        let table = section(entry.name);
        assert!(!table.is_empty(), "config/default.toml has no section [{}]", entry.name);
        let built = [&table, &empty].map(|table| format!("{:?}", (entry.build)(table).expect("valid")));
        assert_eq!(built[0], built[1], "{}", entry.name);
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
    let Ok(readme) = std::fs::read_to_string(shipped("README.md")) else {
        println!("skipped: there is no README.md yet");
        return;
    };
    for name in ground::REGISTRY
        .iter()
        .map(|entry| entry.name)
        .chain(cluster::REGISTRY.iter().map(|entry| entry.name))
    {
        assert!(readme.contains(&format!("`{name}`")), "README.md does not name `{name}`");
    }
}
