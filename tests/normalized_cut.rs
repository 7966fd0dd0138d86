//! `normalized-cut`: against brute force in any tiles, on odd input, and in the engine on the shipped scan,
//! where it is also stopped in every step.

use std::path::PathBuf;

use chainage::cluster::{EuclideanConfig, NormalizedCut, NormalizedCutConfig};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::cut_oracle::{self, Settings};
use crate::util::drive::scratch;
use crate::util::memory_drive::MemoryDrive;
use crate::util::method_run::{MethodRun, resumed};

type Points = Vec<[i64; 3]>;

/// Trees whose crowns touch, some with a pole between them, a low hedge, a car and dust.
fn scene(rng: &mut ChaCha8Rng) -> (Points, Vec<bool>) {
    let mut points = Points::new();
    let base =
        [rng.random_range(-9_000..9_000_i64), rng.random_range(-9_000..9_000), rng.random_range(-500..500)];
    let mut add = |point: [i64; 3]| points.push([0, 1, 2].map(|axis| base[axis] + point[axis]));
    let step = rng.random_range(2_400..3_600_i64);
    for tree in 0..rng.random_range(2..5_i64) {
        let foot = [tree * step + rng.random_range(-300..300), rng.random_range(-600..600_i64)];
        let height = rng.random_range(2_000..3_200_i64);
        for z in (0..height).step_by(90) {
            add([foot[0] + rng.random_range(-60..60), foot[1] + rng.random_range(-60..60), z]);
        }
        let radius = rng.random_range(1_100..1_900_i64);
        for _ in 0..rng.random_range(250..450) {
            let by = [(); 3].map(|()| rng.random_range(-radius..radius));
            if by.iter().map(|value| value * value).sum::<i64>() <= radius * radius {
                add([foot[0] + by[0], foot[1] + by[1], height + radius / 2 + by[2]]);
            }
        }
    }
    for x in (0..rng.random_range(500..4_000_i64)).step_by(120) {
        add([x, 1_500 + rng.random_range(0..200), rng.random_range(0..900)]);
    }
    for _ in 0..30 {
        add([(); 3].map(|()| rng.random_range(-4_000..9_000_i64)));
    }
    let ground = (0..points.len()).map(|_| rng.random_range(0..40) == 0).collect();
    (points, ground)
}

fn settings(rng: &mut ChaCha8Rng) -> Settings {
    let default = Settings {
        d_t_mm: 300,
        min_points: 50,
        voxel_mm: 300,
        sigma_h: 0.8,
        sigma_v: 2.0,
        d_h: 1.2,
        stop: 0.3,
        tall: 2.5,
        wide: 3.0,
        max_voxels: 20_000,
    };
    match rng.random_range(0..3) {
        0 => default,
        1 => Settings { d_t_mm: 450, min_points: 5, stop: 0.5, tall: 1.5, sigma_v: 1.0, ..default },
        _ => Settings { voxel_mm: 210, d_h: 0.9, sigma_h: 0.5, stop: 0.2, wide: 1.0, ..default },
    }
}

fn method(s: &Settings) -> NormalizedCut {
    let metres = |millimetres: i64| millimetres as f64 / 1_000.0;
    let config = NormalizedCutConfig {
        voxel: metres(s.voxel_mm),
        horizontal_scale_m: s.sigma_h,
        vertical_scale_m: s.sigma_v,
        link_radius_m: s.d_h,
        stop: s.stop,
        tall: s.tall,
        wide: s.wide,
        max_voxels: s.max_voxels as u64,
    };
    let euclidean = EuclideanConfig {
        max_gap_m: metres(s.d_t_mm),
        min_points: s.min_points as u64,
        ..EuclideanConfig::default()
    };
    NormalizedCut::new(&config, &euclidean).unwrap()
}

#[test]
fn any_tiles_give_what_brute_force_finds_in_the_whole_cloud() {
    let mut all_cuts = 0;
    for seed in 0..12 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (points, ground) = scene(&mut rng);
        let settings = settings(&mut rng);
        let (expected, cuts) = cut_oracle::parts(&points, &ground, &settings);
        all_cuts += cuts;
        for tiles in [1, 2, 5] {
            let deal = |_| rng.random_range(0..tiles);
            let found = MemoryDrive::new(&points, &ground, tiles, deal).run(&method(&settings));
            let wrong = expected.iter().zip(&found.objects).filter(|(a, b)| a != b).count();
            assert_eq!(wrong, 0, "seed {seed}, {tiles} tiles, {} points, {cuts} cuts", points.len());
        }
    }
    // Scenes without a cut would prove nothing.
    assert!(all_cuts > 12, "{all_cuts}");
}

/// A row of dense crowns: more than 1000 voxels.
fn row() -> Points {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut points = Points::new();
    for tree in 0..4_i64 {
        for _ in 0..3_000 {
            let by = [(); 3].map(|()| rng.random_range(-1_700..1_700_i64));
            if by.iter().map(|value| value * value).sum::<i64>() <= 1_700 * 1_700 {
                points.push([tree * 3_000 + by[0], by[1], 3_000 + by[2]]);
            }
        }
    }
    points
}

#[test]
fn an_object_with_too_many_voxels_is_cut_on_coarser_ones_first_and_reported() {
    let points = row();
    let ground = vec![false; points.len()];
    let settings = Settings {
        max_voxels: 1_000,
        voxel_mm: 300,
        stop: 0.5,
        d_t_mm: 450,
        min_points: 50,
        sigma_h: 0.8,
        sigma_v: 2.0,
        d_h: 1.2,
        tall: 2.5,
        wide: 3.0,
    };
    let (expected, cuts) = cut_oracle::parts(&points, &ground, &settings);
    assert!(cuts >= 3, "{cuts}");
    let mut reports = Vec::new();
    for tiles in [1, 3] {
        let drive = MemoryDrive::new(&points, &ground, tiles, |cell| cell[0].unsigned_abs() % tiles);
        let found = drive.run(&method(&settings));
        assert!(found.objects == expected, "{tiles} tiles");
        reports.push(found.grouped.unwrap().figures["normalized-cut"].clone());
    }
    assert_eq!(reports[0], reports[1], "the report does not show the tiles");
    let coarse = reports[0]["cut on coarser voxels"].as_array().unwrap();
    assert_eq!(coarse.len(), 1, "{reports:?}");
    assert_eq!(coarse[0]["voxel_m"], 0.6, "voxels of the first cut");
    let fine = method(&Settings { max_voxels: 20_000, ..settings });
    let found = MemoryDrive::new(&points, &ground, 2, |cell| cell[1].unsigned_abs() % 2).run(&fine);
    let report = &found.grouped.unwrap().figures["normalized-cut"];
    assert!(report["cut on coarser voxels"].as_array().unwrap().is_empty(), "{report}");
}

#[test]
fn points_on_a_line_or_a_plane_and_equal_points_get_an_answer() {
    let upright: Points = (0..400).map(|n| [0, 0, n * 20]).collect();
    let level: Points = (0..400).map(|n| [n * 20, 0, 0]).collect();
    let diagonal: Points = (0..400).map(|n| [n * 20, n * 20, n * 20]).collect();
    let wall: Points = (0..2_000).map(|n| [n % 80 * 100, 0, n / 80 * 200]).collect();
    let one_place: Points = vec![[5, 5, 5]; 500];
    for (name, points) in [
        ("upright", upright),
        ("level", level),
        ("diagonal", diagonal),
        ("wall", wall),
        ("one place", one_place),
        ("none", Points::new()),
    ] {
        let ground = vec![false; points.len()];
        let default =
            NormalizedCut::new(&NormalizedCutConfig::default(), &EuclideanConfig::default()).unwrap();
        let whole = MemoryDrive::new(&points, &ground, 1, |_| 0).run(&default).objects;
        assert!(whole.iter().all(Option::is_some), "{name}");
        let tiled = MemoryDrive::new(&points, &ground, 3, |cell| cell[0].unsigned_abs() % 3).run(&default);
        assert_eq!(tiled.objects, whole, "{name}");
    }
}

const CUT: MethodRun = MethodRun {
    method: "normalized-cut",
    results: &["tree_road_sweep.laz", "objects.csv", "objects.geojson"],
};

/// A large gap, because the scan is sparse: 16 beams of one sweep.
const THIN: &str = "euclidean.max_gap_m=0.8";

#[test]
fn tiles_and_threads_do_not_show() {
    CUT.assert_tiles_do_not_show(scratch().path());
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn a_run_stopped_in_any_step_ends_in_the_same_bytes() {
    let folder = scratch();
    let settings = ["tiling.tile_length=20", "run.threads=2", THIN];
    let straight: PathBuf = folder.path().join("straight");
    let passes: Vec<&'static str> =
        CUT.run_in(&straight, &settings).passes.iter().map(|figures| figures.pass).collect();
    let expected = CUT.results(&straight);
    for pass in ["clusters", "cut", "objects"] {
        for after in [0, 1] {
            let out = folder.path().join(format!("{pass}-{after}"));
            assert!(CUT.interrupted_in(pass, after, &out, &settings).is_err());
            let summary = CUT.run_in(&out, &settings);
            let before = passes.iter().position(|name| *name == pass).unwrap();
            assert!(resumed(&summary)[..before].iter().all(|pass| pass.1), "{pass}: {:?}", resumed(&summary));
            CUT.assert_same(&out, &expected, &format!("stopped in {pass} after {after}"));
        }
    }
}

#[test]
fn a_changed_setting_redoes_the_cut_and_not_the_clusters() {
    let folder = scratch();
    let base = ["tiling.tile_length=20", THIN];
    let out = folder.path().join("changed");
    let of_default = CUT.run_in(&out, &base).objects;
    let changed = [base[0], base[1], "normalized-cut.stop=0.0"];
    let summary = CUT.run_in(&out, &changed);
    let done: Vec<(&str, bool)> = resumed(&summary);
    let state = |name: &str| done.iter().find(|pass| pass.0 == name).unwrap().1;
    assert!(state("clusters") && !state("cut") && !state("objects"), "{done:?}");
    assert!(summary.objects < of_default, "without a cut there are fewer objects: {}", summary.objects);
}
