//! The contract of every ground filter and every clustering method. The tests walk over both registries.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::collections::BTreeSet;

use chainage::cluster::{
    Clusterer, Dbscan, DbscanConfig, DbscanVariant, Euclidean, EuclideanConfig, Method, Repeat,
};
use chainage::ground::GroundFilter;
use chainage::model::{Lattice, PointClass, PointId, Reach, TileCloud};
use chainage::spatial::{Cell, TileView};
use chainage::{cluster, ground};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use crate::util::memory_drive::MemoryDrive;

const LATTICE: Lattice = Lattice::MILLIMETRE;

fn filters() -> impl Iterator<Item = Box<dyn GroundFilter>> {
    ground::REGISTRY.iter().map(|entry| (entry.build)(&toml::Table::new()).unwrap())
}

/// Every method with its defaults, and `dbscan` also in its other variant and with an estimated epsilon.
fn methods() -> impl Iterator<Item = Box<dyn Method>> {
    let empty = |_: &str| toml::Table::new();
    let defaults = cluster::REGISTRY.iter().map(move |entry| (entry.build)(&empty).unwrap());
    let dbscan = cluster::REGISTRY.iter().find(|entry| entry.name == "dbscan").unwrap();
    let others = ["variant = \"core\"\nmin_points = 3", "epsilon = \"auto\"\nmin_points = 1"];
    let other = |text: &str| {
        let table: toml::Table = text.parse().unwrap();
        (dbscan.build)(&|name| if name == "dbscan" { table.clone() } else { toml::Table::new() }).unwrap()
    };
    defaults.chain(others.map(other))
}

/// Whether a method estimates something from the drive, for which it needs more than a few points.
fn estimates(method: &dyn Method) -> bool {
    method.steps().iter().any(|step| step.name == "epsilon")
}

fn classes(filter: &dyn GroundFilter, points: &[[i64; 3]]) -> Vec<PointClass> {
    let cloud = TileCloud::from_lattice_points(LATTICE, points);
    let mut classes = vec![PointClass::Object; points.len()];
    filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
    classes
}

/// The methods of one tile.
fn clusterers() -> [Box<dyn Clusterer>; 3] {
    let core = DbscanConfig { variant: DbscanVariant::Core, min_points: 3, ..DbscanConfig::default() };
    [
        Box::new(Euclidean::new(&EuclideanConfig::default()).unwrap()),
        Box::new(Dbscan::new(&DbscanConfig::default()).unwrap()),
        Box::new(Dbscan::new(&core).unwrap()),
    ]
}

/// For each point the smallest id with its label; `None` for label 0.
fn labelled(method: &dyn Clusterer, cloud: &TileCloud) -> Vec<Option<PointId>> {
    let mut labels = vec![u32::MAX; cloud.len()];
    let count = method.cluster(cloud, &mut labels).unwrap();
    let used: BTreeSet<u32> = labels.iter().copied().filter(|&label| label != 0).collect();
    assert_eq!(used, (1..=count).collect::<BTreeSet<u32>>(), "{}: labels are 1..=n", method.name());
    let first =
        |label: u32| cloud.id.iter().zip(&labels).filter(|(_, l)| **l == label).map(|(id, _)| *id).min();
    labels.iter().map(|&label| if label == 0 { None } else { first(label) }).collect()
}

/// For each point the smallest index in its object, when cells are dealt to `tiles` tiles.
fn partition(method: &dyn Method, points: &[[i64; 3]], tiles: u32) -> Vec<Option<usize>> {
    let ground = vec![false; points.len()];
    let deal = |cell: Cell| (cell[0].unsigned_abs() + 3 * cell[1].unsigned_abs()) % tiles;
    MemoryDrive::new(points, &ground, tiles, deal).run(method).objects
}

fn points() -> impl Strategy<Value = Vec<[i64; 3]>> {
    let coordinate = |extent: i64| prop_oneof![0..extent, (0..extent / 100).prop_map(|step| step * 100)];
    let point = (coordinate(9_000), coordinate(2_000), coordinate(2_000)).prop_map(|(x, y, z)| [x, y, z]);
    prop::collection::vec(point, 1..200)
}

#[test]
fn names_are_unique_and_are_the_names_of_the_methods() {
    let names: Vec<&str> = ground::REGISTRY
        .iter()
        .map(|entry| entry.name)
        .chain(cluster::REGISTRY.iter().map(|entry| entry.name))
        .collect();
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "{names:?}");
    let build = |entry: &cluster::ClusterEntry| (entry.build)(&|_| toml::Table::new()).unwrap().name();
    let own: Vec<&str> = filters().map(|f| f.name()).chain(cluster::REGISTRY.iter().map(build)).collect();
    assert_eq!(own, names);
    for (summary, reference) in ground::REGISTRY
        .iter()
        .map(|entry| (entry.summary, entry.reference))
        .chain(cluster::REGISTRY.iter().map(|entry| (entry.summary, entry.reference)))
    {
        assert!(!summary.is_empty() && !summary.contains('\n') && !reference.is_empty(), "{summary}");
    }
}

#[test]
fn an_unknown_key_is_refused_by_name() {
    let table: toml::Table = "no_such_key = 1".parse().unwrap();
    let mut errors: Vec<String> = Vec::new();
    errors.extend(ground::REGISTRY.iter().map(|entry| (entry.build)(&table).unwrap_err().to_string()));
    let refused = |entry: &cluster::ClusterEntry| (entry.build)(&|_| table.clone()).unwrap_err().to_string();
    errors.extend(cluster::REGISTRY.iter().map(refused));
    for error in errors {
        assert!(error.contains("no_such_key"), "{error}");
    }
}

#[test]
fn reaches_and_sizes_are_finite_and_not_empty() {
    for reach in filters().map(|f| f.reach(LATTICE)).chain(methods().map(|m| m.planning_reach(LATTICE))) {
        assert!(reach.metres().is_finite() && reach.metres() >= 0.0, "{reach:?}");
    }
    for method in methods() {
        assert!(method.object_size().start() <= method.object_size().end(), "{}", method.name());
    }
}

#[test]
fn steps_have_names_of_their_own_and_settings_that_exist() {
    let config = chainage::config::Config::resolve(None, &[]).unwrap();
    for method in methods() {
        let names: BTreeSet<&str> = method.steps().iter().map(|step| step.name).collect();
        assert_eq!(names.len(), method.steps().len(), "{}", method.name());
        assert_eq!(method.steps().last().unwrap().repeat, Repeat::Once, "{}", method.name());
        for setting in method.steps().iter().flat_map(|step| step.settings) {
            let (section, key) = setting.split_once('.').unwrap();
            let table = config.method_table(section);
            let there = if key == "*" { !table.is_empty() } else { table.contains_key(key) };
            assert!(there, "{setting} is not in config/default.toml");
        }
    }
}

#[test]
fn no_points_one_point_and_equal_points_are_accepted() {
    for count in [0_usize, 1, 2, 5_000] {
        let points = vec![[-7, 8, 9]; count];
        for filter in filters() {
            let classes = classes(&*filter, &points);
            assert!(classes.windows(2).all(|pair| pair[0] == pair[1]), "{} {count}", filter.name());
        }
        for method in methods() {
            if estimates(&*method) {
                // An estimate is impossible with too few points, or with all points in one place. Another
                // test covers this.
                continue;
            }
            let partition = partition(&*method, &points, 2);
            assert!(partition.windows(2).all(|pair| pair[0] == pair[1]), "{} {count}", method.name());
        }
    }
}

/// Noise keeps its class, except that `opening` recognises thin ground that was classified as noise. Noise
/// high above the ground always stays noise. Here it is 7 m above: with ground as thin as this, any point up
/// to 6 m above it counts as an object standing there.
#[test]
fn noise_stays_noise() {
    for filter in filters() {
        let cloud = TileCloud::from_lattice_points(LATTICE, &[[0; 3], [0, 0, 100], [0, 0, 7_000]]);
        let mut classes = [PointClass::LowNoise, PointClass::Object, PointClass::HighNoise];
        filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
        let low = if filter.name() == "opening" { PointClass::Ground } else { PointClass::LowNoise };
        assert_eq!((classes[0], classes[2]), (low, PointClass::HighNoise), "{}", filter.name());
    }
}

#[test]
fn the_order_of_points_changes_nothing() {
    let shuffled = points().prop_flat_map(|points| {
        let order = Just((0..points.len()).collect::<Vec<usize>>()).prop_shuffle();
        (Just(points), order)
    });
    let compare = |(points, order): (Vec<[i64; 3]>, Vec<usize>)| {
        let moved: Vec<[i64; 3]> = order.iter().map(|&index| points[index]).collect();
        for filter in filters() {
            let straight = classes(&*filter, &points);
            let other = classes(&*filter, &moved);
            let expected: Vec<PointClass> = order.iter().map(|&index| straight[index]).collect();
            prop_assert_eq!(other, expected, "{}", filter.name());
        }
        for method in clusterers() {
            let straight = labelled(&*method, &TileCloud::from_lattice_points(LATTICE, &points));
            let mut cloud = TileCloud::from_lattice_points(LATTICE, &moved);
            cloud.id = order.iter().map(|&index| PointId::at(index)).collect();
            let expected: Vec<Option<PointId>> = order.iter().map(|&index| straight[index]).collect();
            prop_assert_eq!(labelled(&*method, &cloud), expected, "{}", method.name());
        }
        Ok(())
    };
    TestRunner::default().run(&shuffled, compare).unwrap();
}

/// The core is x < 3 m. Points that are further away from it than the reach are omitted.
#[test]
fn ground_of_a_core_depends_on_nothing_beyond_the_reach() {
    for filter in filters() {
        let Reach::Exact { metres } = filter.reach(LATTICE) else { continue };
        let compare = |points: Vec<[i64; 3]>| {
            let near: Vec<usize> = (0..points.len())
                .filter(|&index| points[index][0] as f64 <= 3_000.0 + metres * 1_000.0)
                .collect();
            let tile: Vec<[i64; 3]> = near.iter().map(|&index| points[index]).collect();
            let whole = classes(&*filter, &points);
            let tile = classes(&*filter, &tile);
            for (&index, class) in near.iter().zip(tile).filter(|(index, _)| points[**index][0] < 3_000) {
                prop_assert_eq!(class, whole[index], "{}", filter.name());
            }
            Ok(())
        };
        TestRunner::default().run(&points(), compare).unwrap();
    }
}

/// Points along x at distances that barely connect them into chains.
fn chains() -> impl Strategy<Value = Vec<[i64; 3]>> {
    let point = ((0..600_i64).prop_map(|step| step * 10), 0..10_i64).prop_map(|(x, y)| [x, y, 0]);
    prop::collection::vec(point, 2..40)
}

/// Cells are dealt to tiles one by one, so that every object is cut many times.
#[test]
fn objects_of_any_tiles_are_those_of_the_whole() {
    for method in methods() {
        let compare = |(points, tiles): (Vec<[i64; 3]>, u32)| {
            if estimates(&*method) && points.len() < 40 {
                return Ok(());
            }
            let whole = partition(&*method, &points, 1);
            prop_assert_eq!(partition(&*method, &points, tiles), whole, "{}", method.name());
            Ok(())
        };
        TestRunner::default().run(&(chains(), 2..5_u32), compare).unwrap();
        let config = proptest::test_runner::Config { cases: 64, ..Default::default() };
        TestRunner::new(config).run(&(points(), 2..5_u32), compare).unwrap();
    }
}
