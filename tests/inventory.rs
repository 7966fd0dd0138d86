//! The columns of the tables of objects and of surfaces: their tables in README.md are generated, their names
//! follow the rules, and an object keeps its `uid`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use chainage::inventory;
use chainage::model::Column;

use crate::util::drive::{drive, scratch, settings};
use crate::util::las::{Point, Shape};
use crate::util::shipped;

/// The columns of a table, and the marks around its generated part of README.md.
fn tables() -> [(Vec<Column>, String, String); 2] {
    let surfaces = inventory::SURFACE_COLUMNS.to_vec();
    [("objects", inventory::columns()), ("surfaces", surfaces)].map(|(of, columns)| {
        let begin = format!(
            "<!-- columns of {of}: generated from src/inventory, checked by tests/inventory.rs -->\n"
        );
        (columns, begin, format!("<!-- end of columns of {of} -->\n"))
    })
}

/// A table of README.md.
fn table_of(columns: &[Column]) -> String {
    let mut text = String::from("\n| column | type | unit | definition |\n|---|---|---|---|\n");
    for column in columns {
        let (column_type, unit) = (column.column_type.label(), column.unit.label());
        writeln!(text, "| `{}` | {column_type} | {unit} | {} |", column.name, column.definition)
            .expect("written");
    }
    text.push('\n');
    text
}

#[test]
fn the_readme_has_the_columns_of_the_registry() {
    let readme = std::fs::read_to_string(shipped("README.md")).expect("README.md");
    for (columns, begin, end) in tables() {
        let (_, rest) = readme.split_once(&begin).expect("a mark where the table begins");
        let (found, _) = rest.split_once(&end).expect("a mark where the table ends");
        let expected = table_of(&columns);
        assert!(
            found == expected,
            "README.md and src/inventory differ; between the two marks README.md needs this text:\n{begin}{expected}"
        );
    }
}

#[test]
fn columns_are_named_once_and_by_the_rules() {
    for (columns, ..) in tables() {
        let names: BTreeSet<&str> = columns.iter().map(|column| column.name).collect();
        assert_eq!(names.len(), columns.len(), "a name is used twice");
        assert_eq!(columns.first().map(|column| column.name), Some("id"), "the first column is the id");
    }
    for column in tables().iter().flat_map(|(columns, ..)| columns) {
        let name = column.name;
        assert!(name.chars().all(|c| matches!(c, 'a'..='z' | '0'..='9' | '_')), "{name}");
        assert!(
            !column.definition.is_empty() && !column.definition.ends_with('.'),
            "{name}: {}",
            column.definition
        );
        assert!(!column.definition.contains(['|', '\n']), "{name} breaks the table: {}", column.definition);
        let suffix = column.unit.suffix();
        let units = ["_m", "_m2", "_deg"];
        assert!(name.ends_with(suffix), "{name} does not name its unit, {}", column.unit.label());
        assert!(
            !suffix.is_empty() || !units.iter().any(|unit| name.ends_with(unit)),
            "{name} has no such unit"
        );
    }
}

/// Ground of 0.2 m spacing from `from` to `to` metres along x, 20 m wide, and a post of points every 5 m.
fn street(from: i64, to: i64) -> Vec<Point> {
    let mut points = Vec::new();
    for x in (from * 1_000..to * 1_000).step_by(200) {
        points.extend((0..20_000).step_by(200).map(|y| Point::at([x, y, x / 50])));
    }
    for x in (from + 2..to).step_by(5) {
        // Two posts across the street, of different sizes and places.
        for (y, height) in [(4_000 + 10 * x, 3_000), (15_000 - 10 * x, 2_000 + 10 * x.rem_euclid(50))] {
            let wide = 100 + 20 * x.rem_euclid(7);
            for z in (400..height).step_by(100) {
                let corner = |k: i64| [x * 1_000 + wide * (k % 3), y + wide * (k / 3), x * 20 + z];
                points.extend((0..9).map(|k| Point::at(corner(k))));
            }
        }
    }
    points
}

/// The rows of the table of objects by `uid`, without objects that are cut.
fn whole_objects(out: &Path) -> BTreeMap<String, BTreeMap<String, String>> {
    let text = std::fs::read_to_string(out.join("objects.csv")).expect("a table");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let rows = lines.map(|line| {
        let row: BTreeMap<String, String> = names
            .iter()
            .zip(line.split(','))
            .map(|(name, value)| ((*name).to_owned(), value.to_owned()))
            .collect();
        (row["uid"].clone(), row)
    });
    rows.filter(|(_, row)| row["cut"] == "false").collect()
}

/// An additional file before the others changes all ids, chainages and tiles, but no `uid`.
#[test]
fn an_object_keeps_its_uid_when_files_are_added_and_tiles_change() {
    let folder = scratch();
    let path = |name: &str| folder.path().join(name);
    let files = [(path("a.las"), -60, 0), (path("b.las"), 0, 80), (path("c.laz"), 80, 120)];
    for (path, from, to) in &files {
        Shape::default().write(path, &street(*from, *to));
    }
    let [a, b, c] = files.map(|(path, ..)| path);
    let run = |inputs: &[&PathBuf], name: &str, list: &[&str]| {
        let inputs: Vec<PathBuf> = inputs.iter().copied().cloned().collect();
        let mut list = settings(list);
        list.push("euclidean.min_points=20".to_owned());
        drive(&inputs, &path(name), &list).expect("a run");
        whole_objects(&path(name))
    };
    let alone = run(&[&b], "alone", &["tiling.tile_length=1000"]);
    let among = run(&[&c, &a, &b], "among", &["tiling.tile_length=7"]);
    assert!((25..40).contains(&alone.len()), "{}", alone.len());
    let stays =
        ["points", "base_x", "base_y", "base_z", "height_m", "length_m", "width_m", "azimuth_deg", "area_m2"];
    let mut moved = 0;
    for (uid, row) in &alone {
        let other = among.get(uid).unwrap_or_else(|| panic!("{uid} is not among {:?}", among.keys()));
        for name in stays {
            assert_eq!(row[name], other[name], "{name} of {uid}");
        }
        moved += usize::from(row["id"] != other["id"] && row["chainage_m"] != other["chainage_m"]);
    }
    assert_eq!(moved, alone.len(), "ids and chainages change");
    assert!(among.len() > 2 * alone.len());
}
