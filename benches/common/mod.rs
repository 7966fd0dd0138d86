//! What benches measure on: the points of `CHAINAGE_BENCH_FILE`, or a synthetic street, and their classes.

use chainage::ground::{GroundFilter, IsolatedNoise, VoxelColumn};
use chainage::model::{Lattice, PointClass, TileCloud};
use chainage::spatial::TileView;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 7;
const STREET_PROFILES: i64 = 6_000;
const STREET_POINTS_PER_PROFILE: i64 = 200;

pub(crate) type AnyError = Box<dyn std::error::Error>;

/// The points of `CHAINAGE_BENCH_FILE`, else of the street; and whether each is ground in truth, nothing when
/// the file does not say.
pub(crate) fn scene() -> Result<(TileCloud, Vec<bool>), AnyError> {
    match std::env::var("CHAINAGE_BENCH_FILE") {
        Ok(path) => read(&path),
        Err(_) => Ok(street()),
    }
}

/// Reads a file on the millimetre lattice.
fn read(path: &str) -> Result<(TileCloud, Vec<bool>), AnyError> {
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
    Ok((TileCloud::from_lattice_points(lattice, &coordinates), truth))
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
fn street() -> (TileCloud, Vec<bool>) {
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
    (TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points), truth)
}

pub(crate) fn classify(
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

pub(crate) fn objects(cloud: &TileCloud, classes: &[PointClass]) -> TileCloud {
    let mut objects = TileCloud { origin: cloud.origin, ..TileCloud::empty(cloud.lattice) };
    for index in (0..cloud.len()).filter(|&index| classes[index] == PointClass::Object) {
        objects.x.push(cloud.x[index]);
        objects.y.push(cloud.y[index]);
        objects.z.push(cloud.z[index]);
        objects.id.push(cloud.id[index]);
    }
    objects
}
