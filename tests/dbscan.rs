//! `dbscan` on drives: both variants against brute force, with any cut into tiles, and through the program.

use std::path::Path;

use chainage::cluster::{Clusterer, Dbscan, DbscanConfig, DbscanVariant};
use chainage::model::{FileId, Lattice, PointId, TileCloud, TileId};
use chainage::stitch::{LocalLabels, Stitcher};
use proptest::prelude::*;

use crate::util::oracle;
use crate::util::program::program;

const LATTICE: Lattice = Lattice::MILLIMETRE;
const REACH: i64 = 300;

type Points = Vec<[i64; 3]>;

fn method(variant: DbscanVariant, min_points: u64, max_points: u64) -> Dbscan {
    Dbscan::new(&DbscanConfig {
        variant,
        epsilon: 0.3.into(),
        min_points,
        max_points,
        ..DbscanConfig::default()
    })
    .unwrap()
}

/// Points of a narrow street 4 m long, sparse or dense, many at distances of exactly 300, some of them equal.
fn points() -> impl Strategy<Value = Points> {
    let coordinate = |extent: i64| prop_oneof![0..extent, (0..extent / 100).prop_map(|step| step * 100)];
    let point = (coordinate(4_000), coordinate(500), coordinate(500)).prop_map(|(x, y, z)| [x, y, z]);
    prop_oneof![prop::collection::vec(point.clone(), 1..160), prop::collection::vec(point, 1..40)]
}

fn expected(points: &Points, variant: DbscanVariant, min_points: usize, max_points: usize) -> Vec<u32> {
    let near =
        |a: usize, b: usize| (0..3).map(|axis| (points[a][axis] - points[b][axis]).pow(2)).sum::<i64>();
    let largest = if max_points == 0 { usize::MAX } else { max_points };
    match variant {
        DbscanVariant::Size => oracle::dbscan_size(points.len(), near, REACH * REACH, min_points, largest),
        DbscanVariant::Core => {
            oracle::dbscan_core(points.len(), near, |at| points[at], REACH * REACH, min_points, largest)
        }
    }
}

/// Object of every point if the street is cut along x into tiles of `width` that read points within `reach`.
fn tiled(method: &Dbscan, points: &Points, width: i64, reach: i64) -> Vec<u32> {
    let owner = |point: usize| TileId::new(u32::try_from(points[point][0] / width).unwrap());
    let tiles = (0..points.len()).map(owner).max().unwrap_or_default().index() + 1;
    let (mut locals, mut label_of) = (Vec::new(), vec![(TileId::default(), 0); points.len()]);
    for tile in TileId::first(tiles) {
        let start = i64::from(tile.number()) * width;
        let (low, high) = (start - reach, start + width - 1 + reach);
        let seen: Vec<usize> = (0..points.len()).filter(|&p| (low..=high).contains(&points[p][0])).collect();
        let coordinates: Points = seen.iter().map(|&point| points[point]).collect();
        let mut cloud = TileCloud::from_lattice_points(LATTICE, &coordinates);
        cloud.id = seen.iter().map(|&point| PointId::at(point)).collect();
        let core: Vec<bool> = seen.iter().map(|&point| owner(point) == tile).collect();
        let mut labels = vec![u32::MAX; seen.len()];
        let count = method.cluster_tile(&cloud, &core, &mut labels).unwrap();
        let size = method.object_size();
        let local = LocalLabels::collect(
            &cloud,
            &core,
            &mut labels,
            count,
            &size,
            |at| owner(seen[at]),
            |_| FileId::new(0),
        );
        for at in (0..seen.len()).filter(|&at| core[at]) {
            label_of[seen[at]] = (tile, labels[at]);
        }
        locals.push(local);
    }
    let mut stitcher = Stitcher::default();
    locals.iter().for_each(|local| stitcher.tile(local.objects.clone()));
    for (tile, local) in TileId::first(tiles).zip(&locals) {
        for seam in &local.seams {
            let there = label_of[usize::try_from(seam.id.number()).unwrap()];
            assert!(stitcher.link((tile, seam.label), there), "{seam:?} {there:?}");
        }
    }
    let stitched = stitcher.finish(&method.object_size());
    let object = |&(tile, label): &(TileId, u32)| match label {
        0 => 0,
        label => stitched.ids[tile.index()][label as usize - 1],
    };
    label_of.iter().map(object).collect()
}

fn variant() -> impl Strategy<Value = DbscanVariant> {
    prop_oneof![Just(DbscanVariant::Size), Just(DbscanVariant::Core)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn objects_are_what_brute_force_says_however_the_street_is_cut(
        points in points(),
        variant in variant(),
        min_points in 1..7_usize,
        max_points in prop_oneof![Just(0_usize), 7..40_usize],
    ) {
        let expected = expected(&points, variant, min_points, max_points);
        let method = method(variant, min_points as u64, max_points as u64);
        let reach = match variant { DbscanVariant::Size => REACH, DbscanVariant::Core => 2 * REACH };
        for width in [10_000, 1_300, 700, 290, 100] {
            prop_assert_eq!(&tiled(&method, &points, width, reach), &expected, "tiles of {}", width);
        }
    }
}

/// The comparison detects tiles that read too little: with half of the reach, a core point is missed.
#[test]
fn tiles_that_see_too_little_are_noticed() {
    let points: Points = [0, 150, 300, 450, 600, 750, 900].map(|x| [x, 0, 0]).to_vec();
    let method = method(DbscanVariant::Core, 5, 0);
    let expected = expected(&points, DbscanVariant::Core, 5, 0);
    assert_eq!(tiled(&method, &points, 300, 2 * REACH), expected);
    assert_ne!(tiled(&method, &points, 300, REACH), expected);
}

/// Labels of the sample of the project, as the program writes them.
fn labelled(folder: &Path, name: &str, arguments: &[&str]) -> Vec<u8> {
    let out = folder.join(name);
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    let output = program()
        .args(["run", "--method", "dbscan", "--set", "dbscan.epsilon=0.6", "--progress", "plain", "-o"])
        .args([&out, &sample])
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    std::fs::read(out.join("tree_road_sweep.laz")).unwrap()
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn nobody_can_tell_the_tiles_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    for variant in [
        &["--set", "dbscan.variant=size", "--set", "dbscan.min_points=30"][..],
        &["--set", "dbscan.variant=core", "--set", "dbscan.min_points=8"],
    ] {
        let mut results = Vec::new();
        for (length, threads) in [("1000", "1"), ("5", "2")] {
            let arguments = [variant, &["--tile-length", length, "--threads", threads]].concat();
            results.push(labelled(folder.path(), &format!("{}-{length}", variant[1]), &arguments));
        }
        assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{variant:?}");
    }
}
