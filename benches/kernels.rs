//! Time per point of the kernels, one thread: voxels, isolated noise, ground, clusters, object parts; and of
//! the curve that epsilon is estimated from (K = 40, tree included), on all cores (`RAYON_NUM_THREADS=1` for
//! one).
//!
//! `CHAINAGE_BENCH_FILE=scan.laz cargo bench --bench kernels` takes the points of that file; without it, a
//! synthetic street of 1.2 million points in the order of a profile scanner. Throughput is per point *given
//! to the kernel*: all points for voxels, noise and ground, the points left over for clusters and object
//! parts. Before timing it prints what the kernels found, and, when the file has the extra-bytes dimension
//! `gt_class` (1: ground), precision and recall of the ground; points that are noise after the first step
//! count as not ground, like every other point that is not ground.
#![expect(clippy::print_stdout, reason = "a bench prints what it found beside its times")]

use std::hint::black_box;

use chainage::cluster::dbscan::epsilon::FIRST_K;
use chainage::cluster::dbscan::rows::neighbour_curve;
use chainage::cluster::{Clusterer, Dbscan, DbscanConfig, DbscanVariant, Euclidean, EuclideanConfig};
use chainage::ground::{
    GroundFilter, IsolatedNoise, NoiseConfig, Opening, OpeningConfig, UpwardGrowing, UpwardGrowingConfig,
    VoxelColumn, VoxelColumnConfig,
};
use chainage::model::{FileId, ObjectPart, PointClass, PointId, TileCloud};
use chainage::spatial::Points;
use chainage::spatial::{TileView, VoxelIndex};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

use common::{AnyError, classify, objects};

mod common;

fn report(
    cloud: &TileCloud,
    truth: &[bool],
    classes: &[PointClass],
    labels: &[u32],
    clusters: u32,
    size: u64,
) {
    let count = |class: PointClass| classes.iter().filter(|&&other| other == class).count();
    println!(
        "points {}, low noise {}, high noise {}, ground {}, object {}",
        cloud.len(),
        count(PointClass::LowNoise),
        count(PointClass::HighNoise),
        count(PointClass::Ground),
        count(PointClass::Object)
    );
    if !truth.is_empty() {
        let is_ground = |index: &usize| classes[*index] == PointClass::Ground;
        let right = (0..classes.len()).filter(is_ground).filter(|&index| truth[index]).count() as f64;
        let truth = truth.iter().filter(|&&truth| truth).count() as f64;
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
    let (cloud, truth) = common::scene()?;
    let cloud = &cloud;
    let noise = IsolatedNoise::new(&NoiseConfig::default())?;
    let ground = VoxelColumn::new(&VoxelColumnConfig::default())?;
    let euclidean = Euclidean::new(&EuclideanConfig::default())?;
    let classes = classify(&noise, &ground, cloud)?;
    let objects = objects(cloud, &classes);
    let mut labels = vec![0; objects.len()];
    let clusters = euclidean.cluster(&objects, &mut labels)?;
    report(cloud, &truth, &classes, &labels, clusters, *euclidean.object_size().start());

    let mut group = criterion.benchmark_group("kernels");
    group.sample_size(10);
    group.throughput(Throughput::Elements(cloud.len() as u64));
    group.bench_function("voxels", |bencher| {
        bencher.iter(|| VoxelIndex::build("bench", black_box(cloud), 300))
    });
    group.bench_function("noise and ground", |bencher| {
        bencher.iter(|| classify(&noise, &ground, black_box(cloud)).map_err(|error| error.to_string()))
    });
    // Each filter alone, with voxels of its own.
    let filters: [Box<dyn GroundFilter>; 3] = [
        Box::new(VoxelColumn::new(&VoxelColumnConfig::default())?),
        Box::new(UpwardGrowing::new(&UpwardGrowingConfig::default())?),
        Box::new(Opening::new(&OpeningConfig::default())?),
    ];
    for filter in &filters {
        group.bench_function(filter.name(), |bencher| {
            bencher.iter(|| {
                let mut classes = vec![PointClass::Object; cloud.len()];
                filter.classify(&mut TileView::new(black_box(cloud)), &mut classes).map(|()| classes)
            });
        });
    }
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
    let half = PointId::at(cloud.len() / 2);
    let file = |id: PointId| FileId::new(u32::from(id >= half));
    let parts = || ObjectPart::collect(black_box(&objects), &labels, clusters, |_| true, file);
    group.bench_function("object parts", |bencher| bencher.iter(parts));
    group.finish();
    Ok(())
}

criterion_group!(benches, kernels);
criterion_main!(benches);
