//! The columns of the table of objects: what README.md says of them is generated from the registry, and their names
//! keep the rules.

use std::collections::BTreeSet;
use std::fmt::Write;

use chainage::inventory;

use crate::util::shipped;

/// Where the generated part of README.md begins and ends.
const BEGIN: &str =
    "<!-- columns of objects: generated from src/inventory, checked by tests/inventory.rs -->\n";
const END: &str = "<!-- end of columns of objects -->\n";

/// The table of README.md, from the registry.
fn table_of_columns() -> String {
    let mut text = String::from("\n| column | type | unit | definition |\n|---|---|---|---|\n");
    for column in inventory::columns() {
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
    let (_, rest) = readme.split_once(BEGIN).expect("a mark where the table begins");
    let (found, _) = rest.split_once(END).expect("a mark where the table ends");
    let expected = table_of_columns();
    assert!(
        found == expected,
        "README.md and src/inventory differ; between the two marks README.md needs this text:\n{expected}"
    );
}

#[test]
fn columns_are_named_once_and_by_the_rules() {
    let columns = inventory::columns();
    let names: BTreeSet<&str> = columns.iter().map(|column| column.name).collect();
    assert_eq!(names.len(), columns.len(), "a name is used twice");
    assert_eq!(columns.first().map(|column| column.name), Some("id"), "the first column is the id");
    for column in &columns {
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
