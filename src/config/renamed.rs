//! The settings that had another name: the old name is read for one version, with a warning.

/// A setting that has a new name.
#[derive(Debug)]
struct Renamed {
    section: &'static str,
    old: &'static str,
    new: &'static str,
}

const fn renamed(section: &'static str, old: &'static str, new: &'static str) -> Renamed {
    Renamed { section, old, new }
}

/// Renamed in version 0.1, to be removed in 0.2. The old names are the symbols of the papers.
const RENAMED: &[Renamed] = &[
    renamed("euclidean", "d_t", "max_gap_m"),
    renamed("normalized-cut", "sigma_h", "horizontal_scale_m"),
    renamed("normalized-cut", "sigma_v", "vertical_scale_m"),
    renamed("normalized-cut", "d_h", "link_radius_m"),
    renamed("density-peaks", "rho_t", "min_density"),
    renamed("density-peaks", "delta_t", "min_separation"),
    renamed("density-peaks", "d_t", "scale_above"),
    renamed("density-peaks", "d_neighbor", "search_radius"),
    renamed("density-peaks", "d_th", "pair_gap_m"),
    renamed("density-peaks", "c_t", "merge_below"),
];

/// The current name of a setting, if `key` is its old name.
pub(super) fn new_name(section: &str, key: &str) -> Option<&'static str> {
    RENAMED.iter().find(|renamed| renamed.section == section && renamed.old == key).map(|renamed| renamed.new)
}

/// The current names, dotted, of the settings that were called `key`.
pub(super) fn once_called(key: &str) -> impl Iterator<Item = String> {
    let dotted = |renamed: &Renamed| format!("{}.{}", renamed.section, renamed.new);
    RENAMED.iter().filter(move |renamed| renamed.old == key).map(dotted)
}

/// The old names, dotted. A mistyped old name is recognised as well.
pub(super) fn old_names() -> impl Iterator<Item = String> {
    RENAMED.iter().map(|renamed| format!("{}.{}", renamed.section, renamed.old))
}

/// The current form of a dotted name.
pub(super) fn today(dotted: String) -> String {
    let renamed = dotted.split_once('.').and_then(|(section, key)| Some((section, new_name(section, key)?)));
    renamed.map(|(section, new)| format!("{section}.{new}")).unwrap_or(dotted)
}

/// The warning about an old name.
pub(super) fn warning(section: &str, old: &str, new: &str) -> String {
    format!("{section}.{old} is called {section}.{new} now: the old name is read until version 0.2")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DEFAULT_TOML;

    #[test]
    fn new_names_exist_and_old_ones_do_not() {
        let defaults: toml::Table = DEFAULT_TOML.parse().unwrap();
        for Renamed { section, old, new } in RENAMED {
            let keys = defaults[*section].as_table().unwrap();
            assert!(keys.contains_key(*new) && !keys.contains_key(*old), "{section}.{old}");
        }
    }
}
