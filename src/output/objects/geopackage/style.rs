//! Styles that QGIS applies on opening: colour by class, label by id. QML, as QGIS stores it in
//! `layer_styles`.

use std::fmt::Write;

use crate::output::palette::class_colour;

/// Codes and names of the classes, as in `config/classes.toml`.
const CLASSES: [(u8, &str); 9] = [
    (2, "tree"),
    (3, "pole"),
    (4, "vehicle"),
    (5, "building"),
    (6, "fence or hedge"),
    (7, "person or small furniture"),
    (8, "wire"),
    (9, "other"),
    (0, "no class"),
];

/// The kind of geometry that is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawn {
    Areas,
    Points,
    Line,
    Frames,
}

/// The style of a layer, as QML. `class` is the column of classes and `label` the column of labels, if the
/// layer has them.
pub(super) fn qml(drawn: Drawn, class: Option<&str>, label: Option<&str>) -> String {
    let mut text = String::from("<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n");
    let labels = u8::from(label.is_some());
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        r#"<qgis version="3.22.0" styleCategories="Symbology|Labeling" labelsEnabled="{labels}">"#
    );
    match class {
        Some(column) => by_class(&mut text, drawn, column),
        None => {
            let _ = writeln!(text, r#" <renderer-v2 type="singleSymbol" symbollevels="0"><symbols>"#);
            symbol(&mut text, 0, drawn, [80, 80, 80]);
            text.push_str(" </symbols></renderer-v2>\n");
        }
    }
    if let Some(column) = label {
        let _ = writeln!(
            text,
            concat!(
                r#" <labeling type="simple"><settings calloutType="simple">"#,
                r#"<text-style fieldName="{}" isExpression="0" fontSize="8" fontSizeUnit="Point" textColor="30,30,30,255" textOpacity="1">"#,
                r#"<text-buffer bufferDraw="1" bufferSize="0.7" bufferSizeUnits="MM" bufferColor="255,255,255,255"/></text-style>"#,
                r#"<placement placement="1"/><rendering scaleVisibility="1" scaleMin="1" scaleMax="2000"/>"#,
                r"</settings></labeling>"
            ),
            escaped(column)
        );
    }
    text.push_str("</qgis>\n");
    text
}

fn by_class(text: &mut String, drawn: Drawn, column: &str) {
    let column = escaped(column);
    let _ = writeln!(
        text,
        r#" <renderer-v2 type="categorizedSymbol" attr="{column}" symbollevels="0"><categories>"#
    );
    for (number, (code, name)) in CLASSES.iter().enumerate() {
        let _ = writeln!(
            text,
            r#"  <category value="{code}" type="long" label="{}" symbol="{number}" render="true"/>"#,
            escaped(name)
        );
    }
    text.push_str(" </categories><symbols>\n");
    for (number, (code, _)) in CLASSES.iter().enumerate() {
        symbol(text, number, drawn, class_colour(*code));
    }
    text.push_str(" </symbols></renderer-v2>\n");
}

/// Writes one symbol. QGIS before 3.26 reads `prop`, later versions read `Option`.
fn symbol(text: &mut String, number: usize, drawn: Drawn, [red, green, blue]: [u8; 3]) {
    let colour = format!("{red},{green},{blue},255");
    let fill = format!("{red},{green},{blue},110");
    let (symbol_type, class, properties): (_, _, Vec<(&str, &str)>) = match drawn {
        Drawn::Areas => (
            "fill",
            "SimpleFill",
            vec![
                ("color", &fill),
                ("style", "solid"),
                ("outline_color", &colour),
                ("outline_width", "0.3"),
                ("outline_style", "solid"),
            ],
        ),
        Drawn::Frames => (
            "fill",
            "SimpleFill",
            vec![
                ("style", "no"),
                ("outline_color", &colour),
                ("outline_width", "0.2"),
                ("outline_style", "dash"),
            ],
        ),
        Drawn::Points => (
            "marker",
            "SimpleMarker",
            vec![
                ("name", "circle"),
                ("color", &colour),
                ("size", "1.6"),
                ("outline_color", "255,255,255,255"),
                ("outline_width", "0.2"),
            ],
        ),
        Drawn::Line => (
            "line",
            "SimpleLine",
            vec![("line_color", &colour), ("line_width", "0.5"), ("line_style", "dash dot")],
        ),
    };
    let _ = writeln!(
        text,
        r#"  <symbol name="{number}" type="{symbol_type}" alpha="1" clip_to_extent="1" force_rhr="0">"#
    );
    let _ = writeln!(text, r#"   <layer class="{class}" enabled="1" locked="0" pass="0">"#);
    text.push_str("    <Option type=\"Map\">");
    for (name, value) in &properties {
        let _ = write!(text, r#"<Option name="{name}" type="QString" value="{value}"/>"#);
    }
    text.push_str("</Option>\n    ");
    for (name, value) in &properties {
        let _ = write!(text, r#"<prop k="{name}" v="{value}"/>"#);
    }
    text.push_str("\n   </layer>\n  </symbol>\n");
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_table_of_classes() {
        let table = include_str!("../../../../config/classes.toml");
        for (code, name) in CLASSES.iter().filter(|(code, _)| *code > 0) {
            assert!(table.contains(&format!("\n{code} = \"{name}\"\n")), "{code} {name}");
        }
    }

    #[test]
    fn every_class_has_a_category_and_a_symbol() {
        let text = qml(Drawn::Areas, Some("class"), Some("id"));
        for (number, (code, name)) in CLASSES.iter().enumerate() {
            let colour = class_colour(*code);
            let category =
                format!(r#"<category value="{code}" type="long" label="{name}" symbol="{number}""#);
            assert!(text.contains(&category), "{category}");
            assert!(text.contains(&format!(r#"<symbol name="{number}" type="fill""#)));
            assert!(text.contains(&format!("{},{},{},255", colour[0], colour[1], colour[2])));
        }
        assert!(text.contains(r#"attr="class""#) && text.contains(r#"fieldName="id""#));
        let plain = qml(Drawn::Line, None, None);
        assert!(
            plain.contains("singleSymbol")
                && !plain.contains("labeling")
                && plain.contains(r#"labelsEnabled="0""#)
        );
    }
}
