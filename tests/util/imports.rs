//! Which file of `src` imports which, and which files import each other in a circle: read from the paths in
//! the code.
//!
//! An import is an edge to the file that **defines** the name, through any number of re-exports. A re-export
//! alone is not an edge, so a `mod.rs` that only declares and re-exports has no edge to its children. It has
//! one as soon as its own code uses the name. The name of a module is not an edge either, only names used
//! from it.

use std::collections::{BTreeMap, BTreeSet};

/// Path of a file below `src`.
pub(crate) type File = String;

/// The files that each file imports.
pub(crate) type Graph = BTreeMap<File, BTreeSet<File>>;

/// A word, or a single sign.
#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Path, // `::`
    Sign(char),
}

/// Words and signs of `code`, without comments, strings, characters and lifetimes.
fn tokens(code: &str) -> Vec<Token> {
    let chars: Vec<char> = code.chars().collect();
    let (mut found, mut at) = (Vec::new(), 0);
    let get = |at: usize| chars.get(at).copied().unwrap_or('\n');
    while at < chars.len() {
        let c = chars[at];
        let hashes = chars[at + 1..].iter().take_while(|c| **c == '#').count();
        if c == '/' && get(at + 1) == '/' {
            at += chars[at..].iter().take_while(|c| **c != '\n').count();
        } else if c == '"' {
            at += 1;
            while get(at) != '"' {
                at += if get(at) == '\\' { 2 } else { 1 };
            }
            at += 1;
        } else if c == 'r' && get(at + 1 + hashes) == '"' {
            let end = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect::<Vec<char>>();
            at += 2 + hashes;
            at +=
                chars[at..].windows(end.len()).position(|window| window == end).expect("an end") + end.len();
        } else if c == '\'' {
            // A character literal ends with a quote; a lifetime does not.
            let first = if get(at + 1) == '\\' { 2 } else { 1 };
            let more = chars[at + first + 1..].iter().take_while(|c| **c != '\'').count();
            at += if first == 2 || more == 0 { first + more + 2 } else { 1 };
        } else if c.is_alphanumeric() || c == '_' {
            let word: String = chars[at..].iter().take_while(|c| c.is_alphanumeric() || **c == '_').collect();
            at += word.chars().count();
            found.push(Token::Word(word));
        } else if c == ':' && get(at + 1) == ':' {
            found.push(Token::Path);
            at += 2;
        } else {
            if !c.is_whitespace() {
                found.push(Token::Sign(c));
            }
            at += 1;
        }
    }
    found
}

/// The names that a file defines and re-exports, and the paths that it uses.
#[derive(Default)]
struct Module {
    file: File,
    defines: BTreeSet<String>,
    /// For every `use`, the bound name and its path.
    binds: BTreeMap<String, Vec<String>>,
    /// Names that are re-exported.
    shown: BTreeSet<String>,
    /// Paths of at least two names in the rest of the code.
    paths: BTreeSet<Vec<String>>,
    words: BTreeSet<String>,
}

/// Adds the paths of a `use`, with the names that they bind, from after `use` up to `;`.
fn use_tree(tokens: &[Token], at: &mut usize, before: &[String], found: &mut Vec<(String, Vec<String>)>) {
    let mut path = before.to_vec();
    loop {
        match &tokens[*at] {
            Token::Word(word) if word == "as" => {
                let Token::Word(name) = &tokens[*at + 1] else { panic!("a name after `as`") };
                found.push((name.clone(), path));
                *at += 2;
                return;
            }
            Token::Word(word) => path.push(word.clone()),
            Token::Path => {}
            Token::Sign('{') => {
                *at += 1;
                while tokens[*at] != Token::Sign('}') {
                    use_tree(tokens, at, &path, found);
                    if tokens[*at] == Token::Sign(',') {
                        *at += 1;
                    }
                }
                *at += 1;
                return;
            }
            Token::Sign('*') => {
                // The names that a glob of this crate imports are not known here, so such globs are refused.
                let own = ["crate", "super", "self"].contains(&path[0].as_str());
                assert!(!own, "a glob hides what it imports: {path:?}");
                *at += 1;
                return;
            }
            _ => {
                if path.last().is_some_and(|name| name == "self") && path.len() > 1 {
                    path.pop();
                }
                found.push((path.last().expect("a name").clone(), path));
                return;
            }
        }
        *at += 1;
    }
}

impl Module {
    /// Whether the binding of a name is an import: a re-export is one only if the code uses the name as well.
    fn counts(&self, name: &str) -> bool {
        !self.shown.contains(name) || self.words.contains(name)
    }

    fn read(file: &str, production: &str) -> Self {
        let tokens = tokens(production);
        let mut module = Self { file: file.to_owned(), ..Self::default() };
        let (mut at, mut depth) = (0, 0);
        let word = |at: usize| match tokens.get(at) {
            Some(Token::Word(word)) => word.as_str(),
            _ => "",
        };
        while at < tokens.len() {
            match &tokens[at] {
                Token::Sign('{' | '(' | '[') => depth += 1,
                Token::Sign('}' | ')' | ']') => depth -= 1,
                Token::Word(kind) if kind == "use" && tokens[at + 1] != Token::Sign('<') => {
                    let shown = at > 0 && (word(at - 1) == "pub" || tokens[at - 1] == Token::Sign(')'));
                    let mut found = Vec::new();
                    at += 1;
                    use_tree(&tokens, &mut at, &[], &mut found);
                    if shown {
                        module.shown.extend(found.iter().map(|(name, _)| name.clone()));
                    }
                    for (name, path) in found {
                        // `use Trait as _` binds nothing, but imports.
                        let name = if name == "_" { format!("_{}", path.join("_")) } else { name };
                        module.binds.insert(name, path);
                    }
                }
                // Here the name of a module is declared, not used.
                Token::Word(kind) if kind == "mod" => at += 1,
                Token::Word(kind) => {
                    let defined = match kind.as_str() {
                        "struct" | "enum" | "union" | "trait" | "type" | "fn" | "const" | "static" => {
                            word(at + 1)
                        }
                        _ => "",
                    };
                    if depth == 0 && !defined.is_empty() && defined != "fn" {
                        module.defines.insert(defined.to_owned());
                    }
                    let mut path = vec![kind.clone()];
                    while tokens.get(at + 1) == Some(&Token::Path) && !word(at + 2).is_empty() {
                        path.push(word(at + 2).to_owned());
                        at += 2;
                    }
                    module.words.extend(path.first().cloned());
                    if path.len() > 1 {
                        module.paths.insert(path);
                    }
                }
                _ => {}
            }
            at += 1;
        }
        module
    }
}

/// Modules by their path from the root of the crate.
struct Modules(BTreeMap<Vec<String>, Module>);

/// The module of a file: `a/b.rs` and `a/b/mod.rs` are `a::b`, `lib.rs` and `main.rs` the root.
fn module_path(file: &str) -> Vec<String> {
    let path = file.trim_end_matches(".rs").trim_end_matches("/mod");
    match path {
        "lib" => Vec::new(),
        "main" => vec!["main".to_owned()],
        _ => path.split('/').map(str::to_owned).collect(),
    }
}

/// The meaning of a path.
enum Named<'a> {
    /// A name that this file defines.
    In(&'a str),
    /// A module, or a name of another crate.
    Nothing,
}

/// Modules with the paths that were already followed in them, to detect names that are defined by themselves.
type Seen = BTreeSet<(Vec<String>, Vec<String>)>;

impl Modules {
    /// The meaning of `path` in the module `here`; `None` if there is no such name.
    fn named(&self, here: &[String], path: &[String], seen: &mut Seen) -> Option<Named<'_>> {
        if !seen.insert((here.to_vec(), path.to_vec())) {
            return None;
        }
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" | "chainage" => self.below(&[], rest, seen),
            "self" => self.below(here, rest, seen),
            "super" => self.below(here.split_last()?.1, rest, seen),
            _ => {
                let known =
                    self.0.contains_key(&child(here, first)) || self.0[here].binds.contains_key(first);
                if known { self.below(here, path, seen) } else { Some(Named::Nothing) }
            }
        }
    }

    /// The same for a path that starts below the module `here`.
    fn below(&self, here: &[String], path: &[String], seen: &mut Seen) -> Option<Named<'_>> {
        let Some((first, rest)) = path.split_first() else { return Some(Named::Nothing) };
        if first == "super" {
            return self.below(here.split_last()?.1, rest, seen);
        }
        let (module, child) = (self.0.get(here)?, child(here, first));
        let is_module = self.0.contains_key(&child);
        if is_module && !rest.is_empty() {
            return self.below(&child, rest, seen);
        }
        if module.defines.contains(first) {
            return Some(Named::In(&module.file));
        }
        if let Some(target) = module.binds.get(first) {
            let path: Vec<String> = target.iter().chain(rest).cloned().collect();
            return self.named(here, &path, seen);
        }
        is_module.then_some(Named::Nothing)
    }
}

fn child(here: &[String], name: &str) -> Vec<String> {
    here.iter().map(String::as_str).chain([name]).map(str::to_owned).collect()
}

/// The graph of imports, from `(path below src, production code)` of each file.
///
/// # Panics
/// At a path of this crate that names nothing: an import that cannot be resolved must not be missed.
pub(crate) fn graph<'a>(sources: impl Iterator<Item = (&'a str, &'a str)>) -> Graph {
    let modules = Modules(
        sources.map(|(file, production)| (module_path(file), Module::read(file, production))).collect(),
    );
    let mut graph = Graph::new();
    for (here, module) in &modules.0 {
        let used = module.binds.iter().filter(|(name, _)| module.counts(name)).map(|(_, path)| path);
        let mut files = BTreeSet::new();
        for path in used.chain(&module.paths) {
            match modules.named(here, path, &mut Seen::new()) {
                Some(Named::In(file)) if *file == module.file => {}
                Some(Named::In(file)) => _ = files.insert(file.to_owned()),
                Some(Named::Nothing) => {}
                None => panic!("src/{} names {}, which is not found", module.file, path.join("::")),
            }
        }
        graph.insert(module.file.clone(), files);
    }
    graph
}

/// Files that can be reached from `start` over at least one import.
fn reached(graph: &Graph, start: &str) -> BTreeSet<File> {
    let (mut found, mut open) = (BTreeSet::new(), vec![start.to_owned()]);
    while let Some(file) = open.pop() {
        for next in graph.get(&file).into_iter().flatten() {
            if found.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    found
}

/// The circles: sets of files in which each file reaches all others. Circles that share a file are one.
pub(crate) fn circles(graph: &Graph) -> Vec<BTreeSet<File>> {
    let reach: BTreeMap<&File, BTreeSet<File>> =
        graph.keys().map(|file| (file, reached(graph, file))).collect();
    let of = |file: &File| -> BTreeSet<File> {
        reach[file].iter().filter(|other| reach[*other].contains(file)).cloned().collect()
    };
    graph.keys().map(of).filter(|circle| !circle.is_empty()).collect::<BTreeSet<_>>().into_iter().collect()
}

/// The imports among the files of a circle, one per line.
pub(crate) fn drawn(graph: &Graph, circle: &BTreeSet<File>) -> String {
    let mut lines = vec![format!("circle of {} files:", circle.len())];
    for file in circle {
        let inside: Vec<&str> = graph[file].intersection(circle).map(String::as_str).collect();
        lines.push(format!("  {file} -> {}", inside.join(", ")));
    }
    lines.join("\n")
}
