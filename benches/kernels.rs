//! Time per point of the kernels, one thread: voxels, isolated noise, ground, clusters, object parts; and of the curve
//! that epsilon is estimated from (K = 40, tree included), on all cores (`RAYON_NUM_THREADS=1` for one).
//!
//! `CHAINAGE_BENCH_FILE=scan.laz cargo bench --bench kernels` takes the points of that file; without it, a
//! synthetic street of 1.2 million points in the order of a profile scanner. Throughput is per point *given to
//! the kernel*: all points for voxels, noise and ground, the points left over for clusters and object parts.
//! Before timing it prints what the kernels found, and, when the file has the extra-bytes dimension `gt_class`
//! (1: ground), precision and recall of the ground; points that are noise after the first step count as not
//! ground, like every other point that is not ground.
#![expect(clippy::print_stdout, reason = "a bench prints what it found beside its times")]

use std::hint::black_box;

use chainage::cluster::{Clusterer, Dbscan, DbscanConfig, DbscanVariant, Euclidean, EuclideanConfig};
use chainage::epsilon::FIRST_K;
use chainage::ground::{GroundFilter, IsolatedNoise, NoiseConfig, VoxelColumn, VoxelColumnConfig};
use chainage::model::{Lattice, ObjectPart, PointClass, TileCloud, TileView, VoxelIndex};
use chainage::space::{Points, neighbour_curve};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 7;
const STREET_PROFILES: i64 = 6_000;
const STREET_POINTS_PER_PROFILE: i64 = 200;

type AnyError = Box<dyn std::error::Error>;

struct Scene {
    cloud: TileCloud,
    /// Whether each point is ground in truth; empty when the file does not say.
    truth: Vec<bool>,
}

/// Reads a file on the millimetre lattice.
fn read(path: &str) -> Result<Scene, AnyError> {
    let mut reader = las::Reader::from_path(path)?;
    let class_byte = reader.header().all_vlrs().find_map(|vlr| extra_byte(vlr, "gt_class"));
    let points = reader.read_all()?;
    let lattice = Lattice::MILLIMETRE;
    let coordinates: Vec<[i64; 3]> = points
        .x()
        .zip(points.y())
        .zip(points.z())
        .map(|((x, y), z)| [x, y, z].map(|value| lattice.units(value)))
        .collect();
    let mut truth = Vec::new();
    if let Some(byte) = class_byte {
        for point in points.points() {
            truth.push(point?.extra_bytes[byte] == 1);
        }
    }
    Ok(Scene { cloud: TileCloud::from_lattice_points(lattice, &coordinates), truth })
}

/// Position of a one-byte dimension among the extra bytes of a record, from the extra-bytes VLR (LAS 1.4 R15,
/// table 27).
fn extra_byte(vlr: &las::Vlr, name: &str) -> Option<usize> {
    if vlr.user_id.trim_end_matches('\0') != "LASF_Spec" || vlr.record_id != 4 {
        return None;
    }
    let sizes = [0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8];
    let mut position = 0;
    for descriptor in vlr.data.as_chunks::<192>().0 {
        if descriptor[4..36].split(|&byte| byte == 0).next() == Some(name.as_bytes()) {
            return Some(position);
        }
        position += *sizes.get(usize::from(descriptor[2]))?;
    }
    None
}

/// A street with kerbs, facades, trees and poles, seen profile by profile, in millimetres.
fn street() -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let (mut points, mut truth) = (Vec::new(), Vec::new());
    for profile in 0..STREET_PROFILES {
        let x = profile * 20;
        for step in 0..STREET_POINTS_PER_PROFILE {
            let y = (step - STREET_POINTS_PER_PROFILE / 2) * 80;
            let from_tree = (x % 9_000 - 4_500, y.abs() - 5_000);
            let noise = rng.random_range(-8..=8_i64);
            let sidewalk = if y.abs() > 3_500 { 150 } else { 0 };
            let (y, z, ground) = if y.abs() > 7_000 {
                (y.signum() * 7_000 + noise, (y.abs() - 7_000) * 12, false)
            } else if from_tree.0.abs() < 1_500 && from_tree.1.abs() < 1_500 && rng.random_bool(0.7) {
                (y + 3 * noise, 3_500 + rng.random_range(0..2_500_i64), false)
            } else if from_tree.0.abs() < 120 && from_tree.1.abs() < 120 {
                (y.signum() * 5_000 + noise, 150 + rng.random_range(0..3_400_i64), false)
            } else {
                (y, sidewalk + noise, true)
            };
            points.push([x + noise, y, z]);
            truth.push(ground);
        }
    }
    Scene { cloud: TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points), truth }
}

fn classify(
    noise: &IsolatedNoise,
    ground: &VoxelColumn,
    cloud: &TileCloud,
) -> Result<Vec<PointClass>, AnyError> {
    let mut classes = vec![PointClass::Object; cloud.len()];
    let mut view = TileView::new(cloud);
    noise.mark(&mut view, &mut classes)?;
    ground.classify(&mut view, &mut classes)?;
    Ok(classes)
}

fn objects(cloud: &TileCloud, classes: &[PointClass]) -> TileCloud {
    let mut objects = TileCloud { origin: cloud.origin, ..TileCloud::empty(cloud.lattice) };
    for index in (0..cloud.len()).filter(|&index| classes[index] == PointClass::Object) {
        objects.x.push(cloud.x[index]);
        objects.y.push(cloud.y[index]);
        objects.z.push(cloud.z[index]);
        objects.id.push(cloud.id[index]);
    }
    objects
}

fn report(scene: &Scene, classes: &[PointClass], labels: &[u32], clusters: u32, size: u64) {
    let count = |class: PointClass| classes.iter().filter(|&&other| other == class).count();
    println!(
        "points {}, low noise {}, high noise {}, ground {}, object {}",
        scene.cloud.len(),
        count(PointClass::LowNoise),
        count(PointClass::HighNoise),
        count(PointClass::Ground),
        count(PointClass::Object)
    );
    if !scene.truth.is_empty() {
        let is_ground = |index: &usize| classes[*index] == PointClass::Ground;
        let right = (0..classes.len()).filter(is_ground).filter(|&index| scene.truth[index]).count() as f64;
        let truth = scene.truth.iter().filter(|&&truth| truth).count() as f64;
        let found = count(PointClass::Ground) as f64;
        println!("ground precision {:.4} recall {:.4}", right / found, right / truth);
    }
    let mut sizes = vec![0_u64; clusters as usize + 1];
    labels.iter().for_each(|&label| sizes[label as usize] += 1);
    let large = sizes.iter().filter(|&&points| points >= size).count();
    println!("clusters {clusters}, of at least {size} points {large}");
}

#[expect(clippy::expect_used, reason = "a bench without points has nothing to time")]
fn kernels(criterion: &mut Criterion) {
    run(criterion).expect("the file can be read and the kernels accept its points");
}

fn run(criterion: &mut Criterion) -> Result<(), AnyError> {
    let scene = match std::env::var("CHAINAGE_BENCH_FILE") {
        Ok(path) => read(&path)?,
        Err(_) => street(),
    };
    let cloud = &scene.cloud;
    let noise = IsolatedNoise::new(&NoiseConfig::default())?;
    let ground = VoxelColumn::new(&VoxelColumnConfig::default())?;
    let euclidean = Euclidean::new(&EuclideanConfig::default())?;
    let classes = classify(&noise, &ground, cloud)?;
    let objects = objects(cloud, &classes);
    let mut labels = vec![0; objects.len()];
    let clusters = euclidean.cluster(&objects, &mut labels)?;
    report(&scene, &classes, &labels, clusters, *euclidean.object_size().start());

    let mut group = criterion.benchmark_group("kernels");
    group.sample_size(10);
    group.throughput(Throughput::Elements(cloud.len() as u64));
    group.bench_function("voxels", |bencher| {
        bencher.iter(|| VoxelIndex::build("bench", black_box(cloud), 300))
    });
    group.bench_function("noise and ground", |bencher| {
        bencher.iter(|| classify(&noise, &ground, black_box(cloud)).map_err(|error| error.to_string()))
    });
    group.throughput(Throughput::Elements(objects.len() as u64));
    group.bench_function("euclidean", |bencher| {
        bencher.iter(|| euclidean.cluster(black_box(&objects), &mut labels))
    });
    for (variant, min_points, name) in
        [(DbscanVariant::Size, 50, "dbscan size"), (DbscanVariant::Core, 10, "dbscan core")]
    {
        let method = Dbscan::new(&DbscanConfig { variant, min_points, ..DbscanConfig::default() })?;
        let mut labels = vec![0; objects.len()];
        group.bench_function(name, |bencher| {
            bencher.iter(|| method.cluster(black_box(&objects), &mut labels))
        });
    }
    let xyz = |at: usize| objects.lattice_point(at).map(|value| value as f64 / 1_000.0);
    let points = Points::new(3, (0..objects.len()).flat_map(xyz).collect())?;
    group.bench_function("curve", |bencher| {
        bencher.iter(|| neighbour_curve(black_box(&points), FIRST_K).map(|curve| curve.queries))
    });
    // As if the points came from two files.
    let half = cloud.len() as u64 / 2;
    let parts =
        || ObjectPart::collect(black_box(&objects), &labels, clusters, |_| true, |id| u32::from(id >= half));
    group.bench_function("object parts", |bencher| bencher.iter(parts));
    group.finish();
    Ok(())
}

criterion_group!(benches, kernels);
criterion_main!(benches);
