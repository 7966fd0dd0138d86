//! The page `report.html`: one file with everything in it. It requests nothing from any network, and its
//! policy forbids such requests. Texts of files are data for its script and never markup.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::{Value, json};

use super::cloud::{Intensities, planes};
use super::packed::{Compressed, Compressor, json, source_of};
use super::rows::{self, PageFrame};
use super::sample::{STEPS_PER_M, SamplePoint};
use crate::output::objects::ObjectTable;
use crate::output::palette::CLASS_COLOURS;
use crate::spill::Spill;
use crate::words::{counted, separated};

const MARKUP: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/style.css");
/// The files of the script, in the order in which they use one another.
const SCRIPT: [&str; 16] = [
    include_str!("page/data.js"),
    include_str!("page/colours.js"),
    include_str!("page/cloud.js"),
    include_str!("page/scene.js"),
    include_str!("page/camera.js"),
    include_str!("page/poses.js"),
    include_str!("page/octree.js"),
    include_str!("page/stream.js"),
    include_str!("page/plan.js"),
    include_str!("page/table.js"),
    include_str!("page/statistics.js"),
    include_str!("page/run.js"),
    include_str!("page/head.js"),
    include_str!("page/legend.js"),
    include_str!("page/link.js"),
    include_str!("page/app.js"),
];

/// What markup and script say about `objects.csv`. A page without this table leaves it out.
const OF_CSV: [&str; 2] = [" and objects.csv", " objects.csv has them."];

/// The classes of objects: their names and codes.
const CLASSES: &str = include_str!("../../../config/classes.toml");

/// Bytes of a page per shown point in the budget: 5 to 7 were measured on streets.
const BYTES_PER_POINT: u64 = 10;
/// The table of objects may take one part in this many of the limit, after the markup, style and script of
/// every page are subtracted.
const TABLE_PART: u64 = 3;

/// Number of points that a page with a limit in bytes may show.
#[must_use]
pub(crate) fn point_budget(limit_bytes: u64) -> usize {
    usize::try_from(limit_bytes / BYTES_PER_POINT).unwrap_or(usize::MAX)
}

/// The table of objects, ready for the page.
#[derive(Debug)]
pub(crate) struct PageTable {
    packed: String,
    shown: usize,
    all: usize,
}

impl PageTable {
    /// The rows that fit the limit: all rows, or the rows of the objects with most points. `points` gives the
    /// number of points of the object at a position. `spill` makes a temporary file.
    ///
    /// # Errors
    /// Errors of reading a row, and errors of the temporary file.
    pub(crate) fn of(
        table: &ObjectTable<'_>,
        points: &dyn Fn(usize) -> u64,
        frame: PageFrame,
        limit_bytes: u64,
        spill: &dyn Fn() -> io::Result<Spill>,
    ) -> io::Result<Self> {
        let own = MARKUP.len() + STYLE.len() + SCRIPT.map(str::len).iter().sum::<usize>();
        let room = usize::try_from(limit_bytes.saturating_sub(own as u64) / TABLE_PART).unwrap_or(usize::MAX);
        let mut largest: Vec<usize> = (0..table.len).collect();
        largest.sort_by_key(|&position| (std::cmp::Reverse(points(position)), position));
        loop {
            let mut shown = largest.clone();
            shown.sort_unstable();
            // Without rows there is nothing left to leave out.
            let most = if shown.is_empty() { usize::MAX } else { room };
            let mut compressor = Compressor::new(most);
            let mut columns = spill()?;
            rows::write_json(table, &shown, frame, &mut columns, &mut compressor)?;
            let packed = compressor.finish()?;
            if packed.text_len() <= room || shown.is_empty() {
                return Ok(Self { packed: packed.text(), shown: shown.len(), all: table.len });
            }
            // A tenth fewer rows than would fit in proportion, so that the second attempt mostly fits.
            largest.truncate(largest.len() * (room / 10 * 9) / packed.text_len());
        }
    }
}

/// A stretch of the axis: vertices in metres from the origin of the page, with their chainage.
#[derive(Debug, Default, Serialize)]
pub(crate) struct PageStretch {
    /// Chainage in metres.
    pub(crate) s: Vec<f64>,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
}

/// The file from which `chainage view` streams all points, and the conversion of its coordinates to those of
/// the page.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct PageCloud {
    /// Its name.
    pub(crate) file: &'static str,
    /// Origin of the coordinates of the page, in metres of the world frame.
    pub(crate) origin_m: [f64; 3],
    /// Metres per unit of the file.
    pub(crate) units_m: [f64; 3],
}

/// The content of a page.
#[derive(Debug)]
pub(crate) struct Page<'a> {
    pub(crate) title: String,
    /// The files in a few words.
    pub(crate) files: String,
    /// The units of coordinates in the plane, and of heights.
    pub(crate) units: [String; 2],
    pub(crate) axis: Vec<PageStretch>,
    pub(crate) table: &'a PageTable,
    pub(crate) points: Vec<SamplePoint>,
    /// The file with all points, if the run writes one.
    pub(crate) cloud: Option<PageCloud>,
    /// Whether the run writes `objects.csv`.
    pub(crate) csv: bool,
    /// Points of the drive.
    pub(crate) all_points: u64,
    /// The content of `report.json`, with the tiles.
    pub(crate) run: &'a Value,
    pub(crate) limit_bytes: u64,
}

impl Page<'_> {
    /// Writes the page. It shows as many points as fit the limit.
    ///
    /// # Errors
    /// Errors of `out`.
    pub(crate) fn write(mut self, out: &mut dyn Write) -> io::Result<()> {
        let script = self.said(&format!("\"use strict\";\n{}", SCRIPT.join("\n")));
        let markup = self.said(MARKUP);
        let run = json(self.run)?;
        // Only a page whose points can be streamed may send requests, and only to its own server.
        let connect = if self.cloud.is_some() { " connect-src 'self';" } else { "" };
        let policy = format!(
            "default-src 'none'; script-src {}; style-src {};{connect} img-src data:; base-uri 'none'; form-action 'none'",
            source_of(&script),
            source_of(STYLE)
        );
        let heading = self.title.replace('&', "&amp;").replace('<', "&lt;");
        let title = format!("chainage: {heading}");
        let fixed = markup.len()
            + STYLE.len()
            + [&script, &run, &self.table.packed, &policy, &title, &heading]
                .map(String::len)
                .iter()
                .sum::<usize>();
        // Sorted in place, because a million points are 24 MB.
        let mut points = std::mem::take(&mut self.points);
        let (page, points) = loop {
            let count = points.len();
            let range = Intensities::of(&points);
            let page = json(&self.facts(count, range))?;
            let packed = Compressed::of(&planes(&mut points, range));
            let room =
                usize::try_from(self.limit_bytes).unwrap_or(usize::MAX).saturating_sub(fixed + page.len());
            if packed.text_len() <= room || count == 0 {
                drop(points);
                break (page, packed.text());
            }
            points.sort_unstable();
            points.truncate(count.min(count * (room / 100 * 97) / packed.text_len()));
        };
        let parts = [
            ("policy", policy.as_str()),
            ("title", &title),
            ("heading", &heading),
            ("style", STYLE),
            ("page", &page),
            ("run", &run),
            ("table", &self.table.packed),
            ("points", &points),
            ("script", &script),
        ];
        fill(&markup, &parts, out)
    }

    /// A text of the program as this page has it.
    fn said(&self, text: &str) -> String {
        let left_out: &[&str] = if self.csv { &[] } else { &OF_CSV };
        left_out.iter().fold(text.to_owned(), |text, words| text.replace(words, ""))
    }

    /// The facts that the script reads first. They do not depend on tiles, threads or time.
    fn facts(&self, count: usize, range: Intensities) -> Value {
        json!({
            "title": self.title,
            "files": self.files,
            "units": self.units,
            "classes": class_names(),
            "colours": class_colours(),
            "axis": self.axis,
            "points": self.all_points,
            "cloud": self.cloud,
            "sample": {
                "points": count,
                "intensities": [range.low, range.high],
                "step_m": 1.0 / STEPS_PER_M,
                "sentence": self.sentence(count),
            },
        })
    }

    /// A sentence about what is shown and what was left out.
    fn sentence(&self, count: usize) -> String {
        let result = &self.run["result"];
        let what = if result["surfaces"] == true { "surface" } else { "object" };
        let of = |class: &str| result["counts"][class].as_u64().unwrap_or(0);
        let noise = of("low_noise") + of("high_noise");
        let withheld = of("withheld");
        // The sampler takes neither.
        let eligible = self.all_points.saturating_sub(noise + withheld);
        let mut text = if count as u64 >= eligible {
            let verb = if eligible == 1 { "is" } else { "are" };
            let class = match (noise, withheld) {
                (0, 0) => String::new(),
                (_, 0) => format!(" that {verb} not noise"),
                (0, _) => format!(" that {verb} not withheld"),
                _ => format!(" that {verb} neither noise nor withheld"),
            };
            format!("The 3D view shows all {}{class}.", counted(eligible, "point"))
        } else {
            let (shown, all) = (separated(count as u64), counted(self.all_points, "point"));
            format!("The 3D view shows {shown} of {all}: at most one of a voxel, and some of every {what}.")
        };
        if noise > 0 {
            text.push_str(&format!(" It leaves out {} of noise.", counted(noise, "point")));
        }
        if withheld > 0 {
            text.push_str(&format!(" It leaves out {}.", counted(withheld, "withheld point")));
        }
        let PageTable { shown, all, .. } = *self.table;
        if shown < all {
            let limit = self.limit_bytes as f64 / 1e6;
            text.push_str(&format!(
                " The page is limited to {limit:.0} MB: the table has the {} of {} with most points{}.",
                separated(shown as u64),
                counted(all as u64, what),
                if self.csv { ", objects.csv has all" } else { "" }
            ));
        }
        text
    }
}

/// What encloses the values of the run in a page. The values have no `<`, see [`json`].
const RUN: [&str; 2] = ["<script type=\"application/json\" id=\"data-run\">", "</script>"];

/// A page with changed values of the run; `None` if it has none.
pub(crate) fn with_run(page: &str, change: impl FnOnce(&mut Value)) -> Option<String> {
    let (before, rest) = page.split_once(RUN[0])?;
    let (run, after) = rest.split_once(RUN[1])?;
    let mut run: Value = serde_json::from_str(run).ok()?;
    change(&mut run);
    Some([before, RUN[0], &json(&run).ok()?, RUN[1], after].concat())
}

/// Writes the markup with every `{{name}}` replaced by its part. The parts themselves are not searched for
/// names.
fn fill(markup: &str, parts: &[(&str, &str)], out: &mut dyn Write) -> io::Result<()> {
    let mut rest = markup;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) =
            after.split_once("}}").ok_or_else(|| io::Error::other("a part of the page has no end"))?;
        let (_, text) = parts
            .iter()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| io::Error::other(format!("the page has no part {name}")))?;
        out.write_all(before.as_bytes())?;
        out.write_all(text.as_bytes())?;
        rest = after;
    }
    out.write_all(rest.as_bytes())?;
    out.flush()
}

/// Names of the classes by code. Code 0 is noise in labelled drives, and not a class of objects.
fn class_names() -> Value {
    let table: toml::Table = CLASSES.parse().unwrap_or_default();
    let mut names = serde_json::Map::new();
    for (code, name) in table.get("names").and_then(toml::Value::as_table).into_iter().flatten() {
        names.insert(code.clone(), json!(name.as_str()));
    }
    names.insert("0".to_owned(), json!("no class"));
    names.into()
}

/// Colours of the classes by code, as a style sheet writes them.
fn class_colours() -> Value {
    let written = |[red, green, blue]: [u8; 3]| json!(format!("#{red:02x}{green:02x}{blue:02x}"));
    CLASS_COLOURS
        .iter()
        .map(|(code, colour)| (code.to_string(), written(*colour)))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::output::objects::DriveShape;
    use crate::output::objects::tests::{COLUMNS, car};

    const FRAME: PageFrame = PageFrame { origin_m: [0.0; 2], units_m: [1.0; 2] };

    fn table(rows: usize, limit_bytes: u64) -> PageTable {
        let row = |at: usize| {
            let mut row = car();
            row.values[0] = crate::model::Value::Count(at as u64 + 1);
            row.outline[0][0] = at as f64 * 1.37;
            Ok(row)
        };
        let drive = DriveShape::default();
        let table = ObjectTable { columns: COLUMNS, drive: &drive, len: rows, row: &row };
        let folder = tempfile::tempdir().unwrap();
        let spill = || Spill::create(&folder.path().join("table"));
        PageTable::of(&table, &|at| (at as u64 * 7_919) % 1_000, FRAME, limit_bytes, &spill).unwrap()
    }

    fn points(count: usize) -> Vec<SamplePoint> {
        (0_u32..)
            .take(count)
            .map(|at| {
                let place = [0x9e37_u64, 0x79b9, 0x7f4a]
                    .map(|factor| i32::try_from(u64::from(at) * factor % 4_001).unwrap());
                SamplePoint { key: at % 50, place, intensity: (at % 4_096) as u16, ..SamplePoint::zeroed() }
            })
            .collect()
    }

    fn written(points: Vec<SamplePoint>, table: &PageTable, limit_bytes: u64) -> String {
        written_with(None, points, table, limit_bytes)
    }

    fn written_with(
        cloud: Option<PageCloud>,
        points: Vec<SamplePoint>,
        table: &PageTable,
        limit_bytes: u64,
    ) -> String {
        let run = json!({"warnings": ["</script><script>alert(1)</script>"]});
        text_of(Page { cloud, points, ..page(table, &run, limit_bytes) })
    }

    fn page<'a>(table: &'a PageTable, run: &'a Value, limit_bytes: u64) -> Page<'a> {
        Page {
            cloud: None,
            csv: true,
            title: "a <b> & c".to_owned(),
            files: String::new(),
            units: ["m", "m"].map(str::to_owned),
            axis: Vec::new(),
            table,
            points: Vec::new(),
            all_points: 1_000_000,
            run,
            limit_bytes,
        }
    }

    fn text_of(page: Page<'_>) -> String {
        let mut out = Vec::new();
        page.write(&mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_page_names_objects_csv_only_if_the_run_writes_it() {
        let program = [MARKUP, &SCRIPT.join("\n")].concat();
        let said = OF_CSV.map(|words| program.matches(words).count());
        assert_eq!(said, [1, 1], "each text is said in one place");
        // So small that rows are left out.
        let limit = written(Vec::new(), &table(0, 1 << 20), 1 << 20).len() as u64 + 60_000;
        let (table, run) = (table(20_000, limit), json!({}));
        let found = [true, false].map(|csv| {
            let text = text_of(Page { csv, ..page(&table, &run, limit) });
            assert!(text.contains("The same figures are in report.json"));
            // The policy fits the script.
            let between = |from: &str, to: &str| text.split_once(from).unwrap().1.split_once(to).unwrap().0;
            assert!(text.contains(&format!("script-src {};", source_of(between("<script>", "</script>")))));
            let sentence = text.contains(" objects with most points, objects.csv has all.");
            assert_eq!(sentence, !text.contains(" objects with most points.\""));
            [sentence, text.contains(OF_CSV[0]), text.contains(OF_CSV[1])]
        });
        assert_eq!(found, [[true; 3], [false; 3]]);
    }

    #[test]
    fn texts_of_files_are_never_markup() {
        let text = written(points(100), &table(3, 1 << 20), 1 << 20);
        assert!(text.contains("<title>chainage: a &lt;b> &amp; c</title>"));
        assert!(!text.contains("<script>alert"));
        // The program's own elements, and no others: four of data, one with the script.
        assert_eq!(text.matches("<script").count(), 5);
        assert!(!text.contains("{{") && !text.contains("http://localhost") && !text.contains("https://"));
    }

    #[test]
    fn the_policy_names_the_script_and_the_style_of_the_page() {
        let text = written(points(10), &table(1, 1 << 20), 1 << 20);
        let between = |from: &str, to: &str| text.split_once(from).unwrap().1.split_once(to).unwrap().0;
        let policy = between("Content-Security-Policy\" content=\"", "\">");
        assert!(policy.starts_with("default-src 'none'; "), "{policy}");
        assert!(policy.contains(&format!("script-src {};", source_of(between("<script>", "</script>")))));
        assert!(policy.contains(&format!("style-src {};", source_of(between("<style>", "</style>")))));
        assert!(!policy.contains("connect-src"), "{policy}");
        let cloud = PageCloud { file: "drive.copc.laz", origin_m: [1.0, 2.0, 3.5], units_m: [0.5; 3] };
        let text = written_with(Some(cloud), points(10), &table(1, 1 << 20), 1 << 20);
        assert!(text.contains("; connect-src 'self'; img-src data:;"));
        assert!(text.contains(
            r#""cloud":{"file":"drive.copc.laz","origin_m":[1.0,2.0,3.5],"units_m":[0.5,0.5,0.5]}"#
        ));
    }

    #[test]
    fn a_page_keeps_its_limit_and_says_what_it_left_out() {
        let own = written(Vec::new(), &table(0, 1 << 20), 1 << 20).len();
        for limit in [own as u64 + 60_000, own as u64 + 200_000] {
            let table = table(20_000, limit);
            let text = written(points(100_000), &table, limit);
            assert!(text.len() as u64 <= limit, "{} of {limit}", text.len());
            assert!(table.shown > 100 && table.shown < table.all, "{}", table.shown);
            assert!(
                text.contains("of 20,000 objects with most points") && text.contains(" of 1,000,000 points:")
            );
            assert!(!text.contains("shows 0 of"), "points were left");
        }
        let all = table(20, 1 << 20);
        assert_eq!((all.shown, all.all), (20, 20));
    }

    #[test]
    fn the_sentence_counts_noise_as_left_out() {
        let table = table(1, 1 << 20);
        let said =
            |run: Value, count| Page { all_points: 71_841, ..page(&table, &run, 1 << 20) }.sentence(count);
        let counts = |low: u64, high: u64| json!({"low_noise": low, "high_noise": high});
        let run = |low, high| json!({"result": {"counts": counts(low, high)}});
        let surfaces = json!({"result": {"surfaces": true, "counts": counts(110, 3)}});
        assert_eq!(said(run(0, 0), 71_841), "The 3D view shows all 71,841 points.");
        assert_eq!(
            said(run(110, 3), 71_728),
            "The 3D view shows all 71,728 points that are not noise. It leaves out 113 points of noise."
        );
        let withheld = json!({"result": {"counts": {"low_noise": 1, "withheld": 840}}});
        assert_eq!(
            said(withheld, 71_000),
            "The 3D view shows all 71,000 points that are neither noise nor withheld. It leaves out 1 point of noise. \
             It leaves out 840 withheld points."
        );
        assert_eq!(
            said(surfaces, 71_724),
            "The 3D view shows 71,724 of 71,841 points: at most one of a voxel, and some of every surface. \
             It leaves out 113 points of noise."
        );
    }

    #[test]
    fn classes_have_their_names() {
        let names = class_names();
        assert_eq!((names["2"].as_str(), names["0"].as_str()), (Some("tree"), Some("no class")));
        let colours = class_colours();
        assert_eq!((colours["2"].as_str(), colours["9"].as_str()), (Some("#009e73"), Some("#5c5c5c")));
    }
}
