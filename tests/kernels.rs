//! Noise, ground and single-link clusters against brute force, and changes that must not affect them.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use chainage::cluster::{Clusterer, Euclidean, EuclideanConfig};
use chainage::ground::{
    GroundFilter, IsolatedNoise, NoiseConfig, Opening, OpeningConfig, UpwardGrowing, UpwardGrowingConfig,
    VoxelColumn, VoxelColumnConfig,
};
use chainage::model::{Lattice, PointClass, PointId, TileCloud};
use chainage::spatial::TileView;
use proptest::prelude::*;

use crate::util::oracle;

const LATTICE: Lattice = Lattice::MILLIMETRE;
/// Scenes of a few metres must test the context, so the noise filter searches 4 voxels around instead of 10.
const NOISE: NoiseConfig =
    NoiseConfig { enabled: true, voxel: 0.3, min_component_points: 4, keep_sparse: false, high: 0.9 };
const GROUND: VoxelColumnConfig =
    VoxelColumnConfig { voxel: 0.3, run_height: 1.0, step: 0.5, radius: 1.5, lowest_points: 1 };

type Points = Vec<[i64; 3]>;

/// A coordinate: anywhere, on a face of a voxel, just below one, or at a multiple of 100 (where distances of
/// exactly 300 are frequent).
fn coordinate(extent: i64) -> impl Strategy<Value = i64> {
    prop_oneof![
        0..extent,
        (0..=extent / 300).prop_map(|index| index * 300),
        (0..=extent / 300).prop_map(|index| index * 300 - 1),
        (0..=extent / 100).prop_map(|index| index * 100),
    ]
}

/// A small cloud somewhere around the origin, sparse or dense, often with equal points.
fn points() -> impl Strategy<Value = Points> {
    let extent = || prop::sample::select(&[300_i64, 900, 2_400, 6_000]);
    (extent(), extent(), extent(), 1..120_usize, -3_000..3_000_i64).prop_flat_map(
        |(x, y, z, count, shift)| {
            let point = (coordinate(x), coordinate(y), coordinate(z), any::<prop::sample::Index>(), 0..10);
            prop::collection::vec(point, count).prop_map(move |drawn| {
                let mut points = Points::new();
                for (x, y, z, copied, dice) in drawn {
                    let copy = (dice == 0 && !points.is_empty()).then(|| *copied.get(&points));
                    points.push(copy.unwrap_or([x + shift, y - shift, z]));
                }
                points
            })
        },
    )
}

/// A cloud whose origin is `slack` below its points, with these ids.
fn cloud(points: &[[i64; 3]], ids: &[PointId], slack: i32) -> TileCloud {
    let mut cloud = TileCloud::from_lattice_points(LATTICE, points);
    cloud.id = ids.to_vec();
    for axis in [&mut cloud.x, &mut cloud.y, &mut cloud.z] {
        axis.iter_mut().for_each(|value| *value += slack);
    }
    cloud.origin = cloud.origin.map(|value| value - i64::from(slack));
    cloud
}

fn numbered(points: &[[i64; 3]]) -> TileCloud {
    TileCloud::from_lattice_points(LATTICE, points)
}

fn noise_classes(cloud: &TileCloud) -> Vec<PointClass> {
    let mut classes = vec![PointClass::Object; cloud.len()];
    IsolatedNoise::new(&NOISE).unwrap().mark(&mut TileView::new(cloud), &mut classes).unwrap();
    classes
}

fn ground_classes(cloud: &TileCloud) -> Vec<PointClass> {
    let mut classes = noise_classes(cloud);
    VoxelColumn::new(&GROUND).unwrap().classify(&mut TileView::new(cloud), &mut classes).unwrap();
    classes
}

/// Noise, then `filter`.
fn filtered(filter: &dyn GroundFilter, cloud: &TileCloud) -> Vec<PointClass> {
    let mut classes = noise_classes(cloud);
    filter.classify(&mut TileView::new(cloud), &mut classes).unwrap();
    classes
}

/// The filter with voxels of `voxel` millimetres and blocks of `block` voxels.
fn upward_growing(voxel: i64, block: i64) -> UpwardGrowing {
    let voxel_m = voxel as f64 / 1_000.0;
    let config = UpwardGrowingConfig {
        voxel: voxel_m,
        block: voxel_m * block as f64,
        ..UpwardGrowingConfig::default()
    };
    UpwardGrowing::new(&config).unwrap()
}

fn cluster(cloud: &TileCloud, d_t: f64) -> Vec<u32> {
    let mut labels = vec![u32::MAX; cloud.len()];
    let config = EuclideanConfig { max_gap_m: d_t, ..EuclideanConfig::default() };
    let clusters = Euclidean::new(&config).unwrap().cluster(cloud, &mut labels).unwrap();
    let mut seen: Vec<u32> = labels.clone();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen, (1..=clusters).collect::<Vec<_>>());
    labels
}

/// Labels, each replaced by the smallest id with that label.
fn by_smallest_id(labels: &[u32], ids: &[PointId]) -> Vec<PointId> {
    let smallest = |label: u32| ids.iter().zip(labels).filter(|(_, l)| **l == label).map(|(id, _)| *id).min();
    labels.iter().map(|&label| smallest(label).unwrap()).collect()
}

fn inside(core: [i64; 4], reach: f64, point: [i64; 3]) -> bool {
    let beyond = |value: i64, low: i64, high: i64| (low - value).max(value - high).max(0) as f64;
    let dx = beyond(point[0], core[0], core[1]);
    let dy = beyond(point[1], core[2], core[3]);
    dx * dx + dy * dy <= (reach * 1_000.0).powi(2)
}

/// Compares the results of `classify` for the points of a core: from all points, and only from the points
/// within `reach`.
fn core_needs_only_its_context(
    points: &Points,
    core: [i64; 4],
    reach: f64,
    classify: impl Fn(&TileCloud) -> Vec<PointClass>,
) -> Result<(), TestCaseError> {
    let whole = classify(&numbered(points));
    let kept: Vec<usize> = (0..points.len()).filter(|&index| inside(core, reach, points[index])).collect();
    let tile: Points = kept.iter().map(|&index| points[index]).collect();
    let classes = classify(&numbered(&tile));
    for (&index, class) in kept.iter().zip(classes) {
        if inside(core, 0.0, points[index]) {
            prop_assert_eq!(class, whole[index], "point {} {:?}", index, points[index]);
        }
    }
    Ok(())
}

/// A wide cloud, for tiles and their context.
fn wide_points() -> impl Strategy<Value = Points> {
    let point = (coordinate(12_000), coordinate(3_000), coordinate(2_100)).prop_map(|(x, y, z)| [x, y, z]);
    prop::collection::vec(point, 1..250)
}

/// A corridor between walls is ground if it is longer than any room. The filter must see its whole length
/// from its end.
#[test]
fn the_far_end_of_a_corridor_is_within_the_reach_of_opening() {
    let config =
        OpeningConfig { voxel: 0.1, radius: 0.0, slope_radius: 0.0, room: 8.0, ..OpeningConfig::default() };
    let filter = Opening::new(&config).unwrap();
    let reach = LATTICE.units(filter.reach(LATTICE).metres());
    let corridor = |length: i64| {
        let mut points = Points::new();
        for (i, j) in (0..length + 2).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
            let is_wall = j != 0 || i == 0 || i == length + 1;
            points.extend((0..if is_wall { 20 } else { 1 }).map(|z| [i * 100 + 50, j * 100 + 50, z * 100]));
        }
        points
    };
    let end = |points: &Points| {
        let mut classes = vec![PointClass::Object; points.len()];
        filter.classify(&mut TileView::new(&numbered(points)), &mut classes).unwrap();
        classes[points.iter().position(|&point| point == [150, 50, 0]).unwrap()]
    };
    assert_eq!(end(&corridor(80)), PointClass::Object, "a room");
    assert_eq!(end(&corridor(81)), PointClass::Ground);
    let seen =
        |points: Points| points.into_iter().filter(|point| point[0] <= 199 + reach).collect::<Points>();
    assert!(seen(corridor(300)).len() < corridor(300).len());
    assert_eq!(end(&seen(corridor(300))), PointClass::Ground);
}

proptest! {
    #[test]
    fn noise_is_what_brute_force_says(points in points(), keep_sparse: bool) {
        let expected = oracle::noise(&points, [300, 900], 4, keep_sparse);
        let mut classes = vec![PointClass::Object; points.len()];
        let noise = IsolatedNoise::new(&NoiseConfig { keep_sparse, ..NOISE }).unwrap();
        noise.mark(&mut TileView::new(&numbered(&points)), &mut classes).unwrap();
        let classes: Vec<u8> = classes.into_iter().map(PointClass::code).collect();
        prop_assert_eq!(classes, expected);
    }

    #[test]
    fn ground_is_what_brute_force_says(points in points()) {
        let classes = ground_classes(&numbered(&points));
        let hidden: Vec<bool> = classes.iter().map(|class| class.is_noise()).collect();
        let expected = oracle::voxel_column(&points, &hidden, [300, 1_000, 500, 1_500], 1);
        let ground: Vec<bool> = classes.iter().map(|&class| class == PointClass::Ground).collect();
        prop_assert_eq!(ground, expected);
    }

    #[test]
    fn ground_with_a_voxel_of_its_own_is_what_brute_force_says(
        points in points(),
        voxel in 50..700_i64,
        lowest_points in 1..4_u32,
    ) {
        let config = VoxelColumnConfig { voxel: voxel as f64 / 1_000.0, lowest_points, ..GROUND };
        let cloud = numbered(&points);
        let mut view = TileView::new(&cloud);
        let mut classes = vec![PointClass::Object; points.len()];
        IsolatedNoise::new(&NOISE).unwrap().mark(&mut view, &mut classes).unwrap();
        let hidden: Vec<bool> = classes.iter().map(|class| class.is_noise()).collect();
        VoxelColumn::new(&config).unwrap().classify(&mut view, &mut classes).unwrap();
        let expected = oracle::voxel_column(&points, &hidden, [voxel, 1_000, 500, 1_500], lowest_points as usize);
        let ground: Vec<bool> = classes.iter().map(|&class| class == PointClass::Ground).collect();
        prop_assert_eq!(ground, expected);
    }

    #[test]
    fn upward_growing_is_what_brute_force_says(points in points(), voxel in 20..400_i64, block in 1..30_i64) {
        let classes = filtered(&upward_growing(voxel, block), &numbered(&points));
        let hidden: Vec<bool> = classes.iter().map(|class| class.is_noise()).collect();
        let expected = oracle::upward_growing(&points, &hidden, [voxel, block, 300]);
        let ground: Vec<bool> = classes.iter().map(|&class| class == PointClass::Ground).collect();
        prop_assert_eq!(ground, expected);
    }

    #[test]
    fn opening_is_what_brute_force_says(
        points in points(),
        lowest_points in 1..4_u32,
        radius in 0..1_500_i64,
        sparse in prop::sample::select(&[0.0, 0.01, 0.03, 0.06, 0.12, 0.5]),
        room in 0..9_i64,
    ) {
        let of = oracle::Opening {
            voxel: 300,
            lowest_points: lowest_points as usize,
            depth: 400,
            radius,
            slope_radius: 3_000,
            close: 60,
            height: 300,
            clear: 700,
            sparse,
            room,
        };
        let config = OpeningConfig {
            lowest_points,
            depth: 0.4,
            radius: radius as f64 / 1_000.0,
            slope_radius: 3.0,
            close: 0.06,
            height: 0.3,
            clear: 0.7,
            slope: 1.0,
            sparse,
            room: room as f64 * 0.3,
            ..OpeningConfig::default()
        };
        let classes = filtered(&Opening::new(&config).unwrap(), &numbered(&points));
        let expected = oracle::opening(&points, &of);
        let ground: Vec<bool> = classes.iter().map(|&class| class == PointClass::Ground).collect();
        prop_assert_eq!(ground, expected);
    }

    #[test]
    fn filters_need_only_their_context(points in wide_points(), core in 0..9_000_i64) {
        let core = [core, core + 3_000, 0, 3_000];
        let small =
            OpeningConfig { voxel: 0.1, radius: 0.3, slope_radius: 1.0, room: 0.8, ..OpeningConfig::default() };
        let filters: [Box<dyn GroundFilter>; 2] =
            [Box::new(upward_growing(150, 6)), Box::new(Opening::new(&small).unwrap())];
        for filter in filters {
            let noise = IsolatedNoise::new(&NOISE).unwrap();
            let reach = noise.reach(LATTICE).metres() + filter.reach(LATTICE).metres();
            core_needs_only_its_context(&points, core, reach, |cloud| filtered(filter.as_ref(), cloud))?;
        }
    }

    #[test]
    fn clusters_are_what_brute_force_says(points in points()) {
        let expected: Vec<PointId> = oracle::single_link(&points, 300).into_iter().map(PointId::at).collect();
        let cloud = numbered(&points);
        prop_assert_eq!(by_smallest_id(&cluster(&cloud, 0.3), &cloud.id), expected);
    }

    #[test]
    fn clusters_are_what_brute_force_says_at_any_distance(
        distance in prop_oneof![1..8_i64, 1..2_000_i64],
        drawn in prop::collection::vec((0..60_i64, 0..60_i64, 0..60_i64), 1..90),
    ) {
        // Coordinates in twelfths of the distance, so that cells of every offset occur.
        let points: Points = drawn.iter().map(|&(x, y, z)| [x, y, z].map(|value| value * distance / 12)).collect();
        let expected: Vec<PointId> =
            oracle::single_link(&points, distance).into_iter().map(PointId::at).collect();
        let cloud = numbered(&points);
        prop_assert_eq!(by_smallest_id(&cluster(&cloud, distance as f64 / 1_000.0), &cloud.id), expected);
    }

    #[test]
    fn the_order_of_points_changes_nothing(
        (points, order) in points().prop_flat_map(|points| {
            let order = Just((0..points.len()).collect::<Vec<usize>>()).prop_shuffle();
            (Just(points), order)
        }),
    ) {
        let straight = numbered(&points);
        let shuffled_points: Points = order.iter().map(|&index| points[index]).collect();
        let ids: Vec<PointId> = order.iter().map(|&index| PointId::at(index)).collect();
        let shuffled = cloud(&shuffled_points, &ids, 0);
        let classes = ground_classes(&straight);
        let labels = cluster(&straight, 0.3);
        let other_classes = ground_classes(&shuffled);
        let other_labels = cluster(&shuffled, 0.3);
        for (position, &index) in order.iter().enumerate() {
            prop_assert_eq!(other_classes[position], classes[index]);
            prop_assert_eq!(other_labels[position], labels[index]);
        }
    }

    #[test]
    fn clusters_move_with_the_points(points in points(), shift in prop::array::uniform3(-1_000_000..1_000_000_i64), slack in 0..1_000) {
        let moved: Points = points.iter().map(|p| [p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]]).collect();
        let ids: Vec<PointId> = (0..points.len()).map(PointId::at).collect();
        prop_assert_eq!(cluster(&cloud(&moved, &ids, slack), 0.3), cluster(&numbered(&points), 0.3));
    }

    #[test]
    fn ground_moves_with_the_points_by_whole_voxels_and_not_with_the_tile(
        points in points(),
        voxels in prop::array::uniform3(-4_000..4_000_i64),
        slack in 0..1_000,
    ) {
        let shift = voxels.map(|count| count * 300);
        let moved: Points = points.iter().map(|p| [p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]]).collect();
        let ids: Vec<PointId> = (0..points.len()).map(PointId::at).collect();
        prop_assert_eq!(ground_classes(&cloud(&moved, &ids, slack)), ground_classes(&numbered(&points)));
    }

    #[test]
    fn noise_of_a_core_needs_only_its_context(points in wide_points(), low in 2_000..8_000_i64, width in 1..2_000_i64) {
        let core = [low, low + width, 1_000, 2_000];
        let reach = IsolatedNoise::new(&NOISE).unwrap().reach(LATTICE).metres();
        core_needs_only_its_context(&points, core, reach, |cloud| {
            let low_or_high = |class: PointClass| if class.is_noise() { PointClass::LowNoise } else { class };
            noise_classes(cloud).into_iter().map(low_or_high).collect()
        })?;
    }

    #[test]
    fn classes_of_a_core_need_only_its_context(points in wide_points(), low in 2_000..8_000_i64, width in 1..2_000_i64) {
        let core = [low, low + width, 1_000, 2_000];
        let noise = IsolatedNoise::new(&NOISE).unwrap();
        let ground = VoxelColumn::new(&GROUND).unwrap();
        let above = noise.height_reach(LATTICE).metres().max(ground.reach(LATTICE).metres());
        core_needs_only_its_context(&points, core, noise.reach(LATTICE).metres() + above, ground_classes)?;
    }
}

/// A diagonal of voxels with one point each, the last one in the far corner: the longest extent of a
/// component of n points. With one point less in view, it would be noise.
#[test]
fn the_reach_of_noise_is_not_larger_than_it_must_be() {
    let points: Points =
        (0..4_i64).map(|step| [step * 300 + 299 * (step / 3), step * 300 + 299 * (step / 3), 0]).collect();
    assert_eq!(noise_classes(&numbered(&points)), [PointClass::Object; 4]);
    let farthest = ((points[3][0] as f64).powi(2) * 2.0).sqrt() / 1_000.0;
    let reach = IsolatedNoise::new(&NOISE).unwrap().reach(LATTICE).metres();
    assert!(farthest <= reach && farthest > reach - 0.005, "{farthest} {reach}");
    assert!(noise_classes(&numbered(&points[..3])).iter().all(|class| class.is_noise()));
}

#[test]
fn stray_points_kilometres_away_change_nothing_but_themselves() {
    let mut points: Points = (0..1_000_i64).map(|index| [index % 40 * 50, index / 40 * 50, 0]).collect();
    let alone = (ground_classes(&numbered(&points)), cluster(&numbered(&points), 0.3));
    points.extend([[2_000_000_000, 0, 0], [0, 2_000_000_000, 0], [0, 0, 10_000_000]]);
    let cloud = numbered(&points);
    let classes = ground_classes(&cloud);
    let labels = cluster(&cloud, 0.3);
    assert_eq!(classes[..1_000], alone.0);
    assert_eq!(classes[1_000..], [PointClass::LowNoise, PointClass::LowNoise, PointClass::HighNoise]);
    assert_eq!(labels[..1_000], alone.1);
    assert_eq!(labels[1_000..], [2, 3, 4]);
}
