//! `density-peaks` against brute force over whole clouds, and with any division into tiles.

use chainage::cluster::{DensityPeaks, DensityPeaksConfig};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::memory_drive::MemoryDrive;
use crate::util::peaks_oracle::{self, Settings};

type Points = Vec<[i64; 3]>;

/// A small street: ground with a hole or two, poles, walls, crowns on stems, dust. Its density varies
/// everywhere.
fn scene(rng: &mut ChaCha8Rng) -> (Points, Vec<bool>) {
    let length = rng.random_range(3_000..9_000_i64);
    let width = rng.random_range(1_000..5_000_i64);
    let shift = [
        rng.random_range(-4_000..4_000_i64),
        rng.random_range(-4_000..4_000_i64),
        rng.random_range(-900..900_i64),
    ];
    let mut points = Points::new();
    let mut ground = Vec::new();
    let mut add = |point: [i64; 3], is_ground: bool| {
        points.push([0, 1, 2].map(|axis| point[axis] + shift[axis]));
        ground.push(is_ground);
    };
    if rng.random_range(0..8) > 0 {
        for _ in 0..60 {
            let x = rng.random_range(0..length);
            let y = rng.random_range(0..width);
            add([x, y, x / 20 + rng.random_range(-30..30)], true);
        }
    }
    for _ in 0..rng.random_range(2..7) {
        let x = rng.random_range(0..length);
        let y = rng.random_range(0..width);
        let height = rng.random_range(500..4_500_i64);
        let step = rng.random_range(60..290);
        let thick = *[5, 60, 400].get(rng.random_range(0..3_usize)).unwrap();
        for z in (0..height).step_by(step) {
            add([x + rng.random_range(0..thick), y + rng.random_range(0..thick), z + 100], false);
        }
        if rng.random_range(0..2) == 0 {
            for _ in 0..rng.random_range(5..40) {
                let offset = [(); 3].map(|()| rng.random_range(-900..900_i64));
                add([x + offset[0], y + offset[1], height + offset[2]], false);
            }
        }
    }
    if rng.random_range(0..2) == 0 {
        let y = rng.random_range(0..width);
        let spacing = rng.random_range(150..280);
        for x in (0..length).step_by(spacing) {
            for z in (200..2_400).step_by(spacing) {
                add([x, y + rng.random_range(0..15), z], false);
            }
        }
    }
    for _ in 0..rng.random_range(0..20) {
        add([rng.random_range(0..length), rng.random_range(0..width), rng.random_range(0..6_000)], false);
    }
    (points, ground)
}

/// The settings of Table 2 of the paper, in units of the lattice.
fn printed() -> Settings {
    Settings {
        voxel: 300,
        rho_t: 4.0,
        delta_t: 3.0,
        d_t: 5.0,
        d_neighbor: 13.0,
        d_th: 500,
        c_t: 0.08,
        reassign: 1_500,
    }
}

fn settings(rng: &mut ChaCha8Rng) -> Settings {
    let printed = printed();
    match rng.random_range(0..3) {
        0 => printed,
        1 => Settings { rho_t: 2.5, delta_t: 1.0, d_neighbor: 5.0, reassign: 400, ..printed },
        _ => Settings {
            voxel: 430,
            rho_t: 1.5,
            delta_t: 1.5,
            d_t: 3.0,
            d_neighbor: 4.5,
            c_t: 0.03,
            d_th: 800,
            ..printed
        },
    }
}

fn method(s: &Settings) -> DensityPeaks {
    let metres = |millimetres: i64| millimetres as f64 / 1_000.0;
    DensityPeaks::new(&DensityPeaksConfig {
        voxel: metres(s.voxel),
        min_density: s.rho_t,
        min_separation: s.delta_t,
        scale_above: s.d_t,
        search_radius: s.d_neighbor,
        pair_gap_m: metres(s.d_th),
        merge_below: s.c_t,
        reassign: metres(s.reassign),
        most_points: 0,
    })
    .unwrap()
}

#[test]
fn any_tiles_give_what_brute_force_finds_in_the_whole_cloud() {
    let mut compared = 0;
    let mut centres = 0;
    let mut merged = 0;
    let mut reassigned = 0;
    let mut dropped = 0;
    let mut far = 0;
    for seed in 0..60 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (points, ground) = scene(&mut rng);
        let settings = settings(&mut rng);
        let expected = peaks_oracle::density_peaks(&points, &ground, &settings);
        // The curvatures of the oracle are floating-point sums. No decision may depend on their rounding.
        if expected.margin < 1e-9 {
            continue;
        }
        compared += 1;
        centres += expected.centres;
        merged += expected.centres - expected.segments;
        reassigned += expected.reassigned;
        dropped += expected.dropped;
        far += usize::from(expected.farthest_neighbour > 1_500.0);
        let method = method(&settings);
        for tiles in [1_u32, 2, 5] {
            // Stripes, and cells assigned to tiles at random.
            for stripes in [true, false] {
                let mut dice = ChaCha8Rng::seed_from_u64(u64::from(rng.next_u32()));
                let deal = |cell: [i32; 2]| {
                    let tile = if stripes {
                        i64::from(cell[0]).rem_euclid(i64::from(tiles))
                    } else {
                        dice.random_range(0..i64::from(tiles))
                    };
                    u32::try_from(tile).unwrap()
                };
                let outcome = MemoryDrive::new(&points, &ground, tiles, deal).run(&method);
                assert_eq!(
                    outcome.objects, expected.objects,
                    "seed {seed}, {tiles} tiles, stripes {stripes}"
                );
                let figure = |name: &str| {
                    let grouped = outcome.grouped.as_ref().unwrap();
                    usize::try_from(grouped.figures["stages"][name].as_u64().unwrap()).unwrap()
                };
                assert_eq!(figure("clusters_before_merging"), expected.centres, "seed {seed}, {tiles} tiles");
                assert_eq!(figure("clusters_after_merging"), expected.segments, "seed {seed}, {tiles} tiles");
                assert_eq!(
                    figure("halo_voxels_reassigned"),
                    expected.reassigned,
                    "seed {seed}, {tiles} tiles"
                );
                assert_eq!(figure("halo_voxels_dropped"), expected.dropped, "seed {seed}, {tiles} tiles");
            }
        }
    }
    println!(
        "{compared} scenes, {centres} centres, {merged} merged, halo voxels {reassigned} and {dropped}, {far} far"
    );
    assert!(compared > 50 && centres > 100 && merged > 20 && reassigned > 100 && dropped > 50 && far > 3);
}

/// Poles with a dense heap in one of their voxels, and dense heaps in halo voxels beside them. Steps of 30 mm
/// make ties frequent.
#[test]
fn dense_halo_voxels_beside_dense_clusters_join_what_brute_force_says() {
    let settings = printed();
    let method = method(&settings);
    let mut reassigned = 0;
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut points = Points::new();
        // The heaps of the poles are in one voxel.
        let shift = 300 * rng.random_range(-9..9_i64) + 30 * rng.random_range(0..3);
        let mut heap = |from: [i64; 3], sides: [i64; 3], count: usize| {
            let mut point =
                || [0, 1, 2].map(|axis| shift + from[axis] + 30 * rng.random_range(0..sides[axis]));
            points.extend((0..count).map(|_| point()));
        };
        // Two poles, equally far from the heaps between them and beside them.
        for x in [0, 2_100] {
            heap([x, 0, 0], [2, 2, 80], 200);
            heap([x, 0, 900], [8, 8, 8], 450);
        }
        heap([1_050, 0, 900], [6, 8, 8], 300);
        heap([2_850, 0, 930], [8, 8, 8], 300);
        let ground = vec![false; points.len()];
        let expected = peaks_oracle::density_peaks(&points, &ground, &settings);
        assert!(expected.margin > 1e-9, "seed {seed}");
        reassigned += expected.reassigned;
        for tiles in [1_i64, 3] {
            let deal = |cell: [i32; 2]| u32::try_from(i64::from(cell[0]).rem_euclid(tiles)).unwrap();
            let outcome =
                MemoryDrive::new(&points, &ground, u32::try_from(tiles).unwrap(), deal).run(&method);
            assert_eq!(outcome.objects, expected.objects, "seed {seed}, {tiles} tiles");
        }
    }
    assert!(reassigned > 10, "{reassigned}");
}
