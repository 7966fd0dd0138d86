//! `chainage cluster`: the figures of the paper on its tables, clusters against brute force, and the program
//! itself.

use std::collections::BTreeMap;
use std::path::Path;

use chainage::cluster::DbscanVariant;
use chainage::cluster::dbscan::rows::Dbscan;
use chainage::cluster::p_linkage::PLinkage;
use chainage::spatial::Points;
use chainage::table::Table;
use proptest::prelude::*;

use crate::util::numbers::Numbers;
use crate::util::program::program;
use crate::util::{oracle, shared_data};

/// Points of a table of two dimensions, and the label of each.
fn labelled(path: &Path) -> (Points, Vec<u32>) {
    let table = Table::read(path, false).unwrap();
    let values = table.values(&[0, 1]).unwrap();
    let labels = table.values(&[2]).unwrap().into_iter().map(|label| format!("{label}").parse().unwrap());
    (Points::new(2, values).unwrap(), labels.collect())
}

/// Adjusted Rand index (Hubert and Arabie 1985), with noise as one cluster.
fn adjusted_rand_index(one: &[u32], other: &[u32]) -> f64 {
    let pairs = |groups: BTreeMap<(u32, u32), f64>| groups.values().map(|n| n * (n - 1.0) / 2.0).sum::<f64>();
    let group = |key: &dyn Fn(usize) -> (u32, u32)| {
        let mut groups = BTreeMap::new();
        (0..one.len()).for_each(|point| *groups.entry(key(point)).or_default() += 1.0);
        pairs(groups)
    };
    let both = group(&|p| (one[p], other[p]));
    let a = group(&|p| (one[p], 0));
    let b = group(&|p| (0, other[p]));
    let n = one.len() as f64;
    let expected = a * b / (n * (n - 1.0) / 2.0);
    (both - expected) / (f64::midpoint(a, b) - expected)
}

#[test]
fn the_shape_sets_give_the_clusters_of_the_paper() {
    let Some(folder) = shared_data() else { return };
    for (name, scale, merge, clusters, outliers, index) in [
        ("R15", 5.0, false, 15, 11, 0.971),
        ("D31", 5.0, false, 31, 53, 0.921),
        ("Aggregation", 2.0, true, 7, 90, 0.901),
    ] {
        let (points, truth) = labelled(&folder.join(format!("tables/{name}.txt")));
        let found = PLinkage { scale, merge }.cluster(&points).unwrap();
        let noise = found.labels.iter().filter(|&&label| label == 0).count();
        assert_eq!((found.clusters, noise), (clusters, outliers), "{name}");
        let agreement = adjusted_rand_index(&truth, &found.labels);
        assert!((agreement - index).abs() < 5e-4, "{name}: {agreement}");
    }
}

/// Three round clouds of 200 points each, with the distances of figure 5 of the paper (Lu et al. 2016), in
/// any number of dimensions. Sums of twelve uniform numbers are nearly normal.
fn three_clouds(dimensions: usize) -> Points {
    let mut numbers = Numbers::new(7);
    let mut uniform = || (numbers.bits() >> 11) as f64 / (1_u64 << 53) as f64;
    let mut values = Vec::new();
    for point in 0..600 {
        for axis in 0..dimensions {
            let centre = if axis % 3 == point / 200 { 10.0 } else { 0.0 };
            values.push(centre + (0..12).map(|_| uniform()).sum::<f64>() - 6.0);
        }
    }
    Points::new(dimensions, values).unwrap()
}

#[test]
fn three_clouds_of_200_points_are_three_clusters_in_3_and_4_dimensions() {
    for dimensions in [3, 4] {
        let found = PLinkage::default().cluster(&three_clouds(dimensions)).unwrap();
        assert_eq!(found.clusters, 3, "{dimensions}");
        for cloud in 0..3 {
            let own = u32::try_from(cloud + 1).unwrap();
            let labels = &found.labels[cloud * 200..(cloud + 1) * 200];
            let right = labels.iter().filter(|&&label| label == own).count();
            // The paper: 175, 195 and 191 of 200.
            assert!(right >= 175, "{dimensions} dimensions, cloud {cloud}: {right}");
            assert!(labels.iter().all(|&label| label == own || label == 0), "{dimensions} {cloud}");
        }
    }
}

/// Clouds on a grid of quarters: distances of exactly epsilon are frequent, and squares are exact.
fn clouds() -> impl Strategy<Value = (usize, Vec<Vec<i64>>)> {
    (prop::sample::select(&[2_usize, 3, 4, 6, 8]), 3..14_i64).prop_flat_map(|(dimensions, extent)| {
        let row = prop::collection::vec(0..extent, dimensions);
        (Just(dimensions), prop::collection::vec(row, 1..90))
    })
}

proptest! {
    #[test]
    fn clusters_are_what_brute_force_says(
        (dimensions, rows) in clouds(),
        epsilon in 1..8_i64,
        min_points in 1..6_usize,
        max_points in prop_oneof![Just(0_usize), 5..60_usize],
    ) {
        let values = rows.iter().flatten().map(|&value| value as f64 / 4.0).collect();
        let points = Points::new(dimensions, values).unwrap();
        let method = |variant| Dbscan {
            variant,
            epsilon: epsilon as f64 / 4.0,
            min_points: min_points as u64,
            max_points: max_points as u64,
        };
        let largest = if max_points == 0 { usize::MAX } else { max_points };
        let near = |a: usize, b: usize| {
            rows[a].iter().zip(&rows[b]).map(|(p, q)| (p - q).pow(2)).sum::<i64>()
        };
        let expected = oracle::dbscan_size(rows.len(), near, epsilon * epsilon, min_points, largest);
        prop_assert_eq!(method(DbscanVariant::Size).cluster(&points).unwrap().0, expected);
        let expected = oracle::dbscan_core(rows.len(), near, |row| rows[row].clone(), epsilon * epsilon, min_points, largest);
        prop_assert_eq!(method(DbscanVariant::Core).cluster(&points).unwrap().0, expected);
    }
}

#[test]
fn the_program_repeats_the_rows_and_adds_a_column() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("t.csv");
    std::fs::write(&input, "name,x,y\na,0,0\nb,0.5,0\nc, 9 ,9\nd,9,9.5\ne,50,50\n").unwrap();
    let run = |arguments: &[&str]| {
        let output = program().arg("cluster").arg(&input).args(arguments).output().unwrap();
        (
            output.status.code().unwrap(),
            String::from_utf8(output.stdout).unwrap(),
            String::from_utf8(output.stderr).unwrap(),
        )
    };
    let dbscan = ["--method", "dbscan", "--epsilon", "1", "--min-points", "2"];
    let labelled = "name,x,y,cluster_id\na,0,0,1\nb,0.5,0,1\nc, 9 ,9,2\nd,9,9.5,2\ne,50,50,0\n";
    assert_eq!(run(&[&dbscan[..], &["-o", "-"]].concat()), (0, labelled.to_owned(), String::new()));

    let out = folder.path().join("out.csv");
    let (code, json, _) = run(&[&dbscan[..], &["-o", out.to_str().unwrap(), "--json", "-"]].concat());
    assert_eq!((code, std::fs::read_to_string(&out).unwrap()), (0, labelled.to_owned()));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["clusters"], &json["noise"], &json["rows"]), (&2.into(), &1.into(), &5.into()));
    assert_eq!(json["columns"], serde_json::json!(["x", "y"]));

    for (arguments, code, text) in [
        (&["-o", "-", "--json", "-"][..], 3, "--json = -: must be a file when --out is standard output"),
        (
            &["-o", "x.csv", "--svg", "-", "--json", "-"],
            3,
            "--svg = -: must be a file when --json is standard output",
        ),
        (&["-o", "x.csv", "--svg", "x.svg", "--epsilon", "2"], 3, "--svg = x.svg: must be left out unless"),
        (&["-o", "-", "--columns", "x,name"], 4, "line 2 of"),
        (&["-o", "-", "--columns", "x"], 4, "points have 1 dimension; only 2 to 8 can be clustered"),
        (&["-o", "-", "--columns", "x,z"], 4, "has no column z; its columns are: name, x, y"),
        (&["-o", "-", "--id-column", "x"], 4, "already has a column x"),
        (
            &["-o", "-", "--epsilon", "auto"],
            4,
            "a curve over 40 neighbours needs at least 40 points, but there are 5",
        ),
        (&["-o", "-", "--standardise", "--weights", "1"], 3, "must be one weight per column, 2 in all"),
    ] {
        let (found, stdout, stderr) = run(&[&["--method", "dbscan"], arguments].concat());
        assert!(
            found == code && stderr.contains(text) && stdout.is_empty(),
            "{arguments:?}: {found} {stdout} {stderr}"
        );
    }
    let (code, _, stderr) = run(&["--method", "p-linkage", "--epsilon", "1.5", "-o", "x.csv"]);
    let told = "--epsilon = 1.5: must be left out: --method p-linkage does not use it";
    assert!(code == 3 && stderr.contains(told), "{code} {stderr}");
}

#[test]
fn epsilon_is_estimated_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("grid.txt");
    let rows: String = (0..900).map(|i| format!("{} {}\n", i % 30, i / 30)).collect();
    std::fs::write(&input, rows).unwrap();
    let drawing = folder.path().join("curve.svg");
    let output = program()
        .args(["cluster", "--method", "dbscan", "--no-header", "-o", "-"])
        .arg(&input)
        .arg(format!("--json={}", folder.path().join("facts.json").display()))
        .arg("--svg")
        .arg(&drawing)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.starts_with("0 0 1\n1 0 1\n") && text.lines().count() == 900, "{text}");
    let facts = std::fs::read_to_string(folder.path().join("facts.json")).unwrap();
    let facts: serde_json::Value = serde_json::from_str(&facts).unwrap();
    let epsilon = facts["result"]["estimate"]["epsilon"].as_f64().unwrap();
    // Ten neighbours of a point of a unit grid lie within 2 of it.
    assert!((1.0..3.0).contains(&epsilon), "{epsilon}");
    assert!(std::fs::read_to_string(drawing).unwrap().contains("epsilon ="));
}
