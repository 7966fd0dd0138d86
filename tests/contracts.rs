//! What every ground filter and every clustering method keeps, whoever writes it: walked over both registries.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::collections::BTreeSet;

use chainage::ground::GroundFilter;
use chainage::model::{Lattice, PointClass, Reach, TileCloud};
use chainage::spatial::TileView;
use chainage::{cluster, ground};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

const LATTICE: Lattice = Lattice::MILLIMETRE;

fn filters() -> impl Iterator<Item = Box<dyn GroundFilter>> {
    ground::REGISTRY.iter().map(|entry| (entry.build)(&toml::Table::new()).unwrap())
}

fn methods() -> impl Iterator<Item = Box<dyn cluster::Clusterer>> {
    cluster::REGISTRY.iter().filter_map(|entry| match (entry.build)(&toml::Table::new()).unwrap() {
        cluster::Method::Local(method) => Some(method),
        cluster::Method::Staged(_) | cluster::Method::Prepared(_) => None,
    })
}

fn staged() -> impl Iterator<Item = Box<dyn cluster::StagedClusterer>> {
    cluster::REGISTRY.iter().filter_map(|entry| match (entry.build)(&toml::Table::new()).unwrap() {
        cluster::Method::Local(_) | cluster::Method::Prepared(_) => None,
        cluster::Method::Staged(method) => Some(method),
    })
}

fn classes(filter: &dyn GroundFilter, points: &[[i64; 3]]) -> Vec<PointClass> {
    let cloud = TileCloud::from_lattice_points(LATTICE, points);
    let mut classes = vec![PointClass::Object; points.len()];
    filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
    classes
}

/// For each point the smallest index with its label; none for label 0.
fn partition(method: &dyn cluster::Clusterer, cloud: &TileCloud) -> Vec<Option<u64>> {
    let mut labels = vec![u32::MAX; cloud.len()];
    let count = method.cluster(cloud, &mut labels).unwrap();
    let used: BTreeSet<u32> = labels.iter().copied().filter(|&label| label != 0).collect();
    assert_eq!(used, (1..=count).collect::<BTreeSet<u32>>(), "{}: labels are 1..=n", method.name());
    let first =
        |label: u32| cloud.id.iter().zip(&labels).filter(|(_, l)| **l == label).map(|(id, _)| *id).min();
    labels.iter().map(|&label| if label == 0 { None } else { first(label) }).collect()
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
    let build = |entry: &cluster::ClusterEntry| (entry.build)(&toml::Table::new()).unwrap().name();
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
    errors.extend(cluster::REGISTRY.iter().map(|entry| (entry.build)(&table).unwrap_err().to_string()));
    for error in errors {
        assert!(error.contains("no_such_key"), "{error}");
    }
}

#[test]
fn reaches_and_sizes_are_finite_and_not_empty() {
    for reach in filters().map(|f| f.reach(LATTICE)).chain(methods().map(|m| m.reach(LATTICE))) {
        assert!(reach.metres().is_finite() && reach.metres() >= 0.0, "{reach:?}");
    }
    for method in methods() {
        assert!(method.object_size().start() <= method.object_size().end(), "{}", method.name());
    }
}

#[test]
fn stages_have_names_of_their_own_and_settings_that_exist() {
    for method in staged() {
        let names: BTreeSet<&str> = method.stages().iter().map(|stage| stage.name).collect();
        assert_eq!(names.len(), method.stages().len(), "{}", method.name());
        let config = chainage::config::Config::resolve(None, &[]).unwrap();
        let table = config.method_table(method.name());
        for key in method.stages().iter().flat_map(|stage| stage.settings) {
            assert!(table.contains_key(*key), "{}.{key} is not in config/default.toml", method.name());
        }
        assert!(method.object_size().start() <= method.object_size().end(), "{}", method.name());
        let reach = method.reach(LATTICE);
        assert!(reach.metres().is_finite() && reach.metres() >= 0.0, "{reach:?}");
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
            let cloud = TileCloud::from_lattice_points(LATTICE, &points);
            let partition = partition(&*method, &cloud);
            assert!(partition.windows(2).all(|pair| pair[0] == pair[1]), "{} {count}", method.name());
        }
    }
}

/// `opening` sees thin ground that was taken for noise; nothing else may become of noise, and of noise high above
/// the ground nothing at all.
#[test]
fn noise_stays_noise() {
    for filter in filters() {
        let cloud = TileCloud::from_lattice_points(LATTICE, &[[0; 3], [0, 0, 100], [0, 0, 5_000]]);
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
            let (straight, other) = (classes(&*filter, &points), classes(&*filter, &moved));
            let expected: Vec<PointClass> = order.iter().map(|&index| straight[index]).collect();
            prop_assert_eq!(other, expected, "{}", filter.name());
        }
        for method in methods() {
            let straight = partition(&*method, &TileCloud::from_lattice_points(LATTICE, &points));
            let mut cloud = TileCloud::from_lattice_points(LATTICE, &moved);
            cloud.id = order.iter().map(|&index| index as u64).collect();
            let expected: Vec<Option<u64>> = order.iter().map(|&index| straight[index]).collect();
            prop_assert_eq!(partition(&*method, &cloud), expected, "{}", method.name());
        }
        Ok(())
    };
    TestRunner::default().run(&shuffled, compare).unwrap();
}

/// The core is x < 3 m; what is further than the reach beyond it is left out.
#[test]
fn ground_of_a_core_depends_on_nothing_beyond_the_reach() {
    for filter in filters() {
        let Reach::Exact { metres } = filter.reach(LATTICE) else { continue };
        let compare = |points: Vec<[i64; 3]>| {
            let near: Vec<usize> = (0..points.len())
                .filter(|&index| points[index][0] as f64 <= 3_000.0 + metres * 1_000.0)
                .collect();
            let tile: Vec<[i64; 3]> = near.iter().map(|&index| points[index]).collect();
            let (whole, tile) = (classes(&*filter, &points), classes(&*filter, &tile));
            for (&index, class) in near.iter().zip(tile).filter(|(index, _)| points[**index][0] < 3_000) {
                prop_assert_eq!(class, whole[index], "{}", filter.name());
            }
            Ok(())
        };
        TestRunner::default().run(&points(), compare).unwrap();
    }
}

/// Points along x that just about make chains.
fn chains() -> impl Strategy<Value = Vec<[i64; 3]>> {
    let point = ((0..150_i64).prop_map(|step| step * 10), 0..10_i64).prop_map(|(x, y)| [x, y, 0]);
    prop::collection::vec(point, 2..10)
}

/// The clusters of the points left of `seam` and of those right of it, both with half a reach of the other
/// side, united where they share a point: everything gets the smallest id it is connected with.
fn united(method: &dyn cluster::Clusterer, points: &[[i64; 3]], seam: f64, half: f64) -> Vec<Option<u64>> {
    let tiles = [with_ids(points, |x| x <= seam + half), with_ids(points, |x| x >= seam - half)];
    let parts = tiles.each_ref().map(|tile| partition(method, tile));
    let mut names: Vec<Option<u64>> = vec![None; points.len()];
    loop {
        let before = names.clone();
        for (tile, part) in tiles.iter().zip(&parts) {
            for local in part.iter().flatten().collect::<BTreeSet<&u64>>() {
                let labelled = tile.id.iter().zip(part).filter(|(_, name)| name.as_ref() == Some(local));
                let members: Vec<usize> = labelled.map(|(&id, _)| usize::try_from(id).unwrap()).collect();
                let smallest = members.iter().map(|&id| names[id].unwrap_or(id as u64)).min();
                members.into_iter().for_each(|id| names[id] = smallest);
            }
        }
        if names == before {
            return names;
        }
    }
}

/// The points whose x is to be kept, with their indices as ids.
fn with_ids(points: &[[i64; 3]], keep: impl Fn(f64) -> bool) -> TileCloud {
    let kept: Vec<usize> = (0..points.len()).filter(|&index| keep(points[index][0] as f64)).collect();
    let coordinates: Vec<[i64; 3]> = kept.iter().map(|&index| points[index]).collect();
    let mut cloud = TileCloud::from_lattice_points(LATTICE, &coordinates);
    cloud.id = kept.iter().map(|&index| index as u64).collect();
    cloud
}

/// Every link has both ends in one of two tiles that share a strip as wide as the reach, wherever the seam is.
#[test]
fn clusters_of_two_tiles_that_share_the_reach_are_those_of_the_whole() {
    for method in methods() {
        let Reach::Exact { metres } = method.reach(LATTICE) else { continue };
        let compare = |points: Vec<[i64; 3]>| {
            let whole = partition(&*method, &with_ids(&points, |_| true));
            for seam in (0..1_500).step_by(10) {
                let tiled = united(&*method, &points, f64::from(seam), metres * 500.0);
                prop_assert_eq!(&tiled, &whole, "{} seam {}", method.name(), seam);
            }
            Ok(())
        };
        TestRunner::default().run(&chains(), compare).unwrap();
    }
}
