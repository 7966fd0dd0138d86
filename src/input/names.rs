//! Names of the files of a drive that tell them apart: of files with the same name, with their folders.

use std::collections::BTreeMap;
use std::path::Path;

/// The name of each path: its last part, or for paths whose last parts agree, as many parts as tell all of
/// these apart.
pub(crate) fn distinct(paths: &[&Path]) -> Vec<String> {
    let parts = |path: &Path, count: usize| {
        let parts: Vec<String> =
            path.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
        parts[parts.len().saturating_sub(count)..].join("/")
    };
    let mut names: Vec<String> = paths.iter().map(|path| parts(path, 1)).collect();
    let longest = paths.iter().map(|path| path.components().count()).max().unwrap_or(0);
    let mut alike = BTreeMap::<String, Vec<usize>>::new();
    for (path, name) in names.iter().enumerate() {
        alike.entry(name.clone()).or_default().push(path);
    }
    for group in alike.into_values().filter(|group| group.len() > 1) {
        for count in 2..=longest {
            let longer: Vec<String> = group.iter().map(|&path| parts(paths[path], count)).collect();
            let apart = longer.iter().collect::<std::collections::BTreeSet<_>>().len() == group.len();
            if apart || count == longest {
                group.iter().zip(longer).for_each(|(&path, name)| names[path] = name);
                break;
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_with_the_same_name_get_their_folders() {
        let names = |paths: &[&str]| distinct(&paths.iter().map(Path::new).collect::<Vec<_>>());
        assert_eq!(names(&["d1/x.las", "d1/y.las"]), ["x.las", "y.las"]);
        assert_eq!(names(&["d1/x.las", "d2/x.las", "d2/y.las"]), ["d1/x.las", "d2/x.las", "y.las"]);
        assert_eq!(names(&["/a/1/d/x.las", "/a/2/d/x.las"]), ["1/d/x.las", "2/d/x.las"]);
        assert_eq!(names(&["x.las", "d/x.las", "e/x.las"]), ["x.las", "d/x.las", "e/x.las"]);
        assert!(names(&[]).is_empty());
    }
}
