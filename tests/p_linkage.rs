//! `p-linkage` for surfaces: against brute force in any tiles, on known planes, on odd input, and in the
//! engine on the shipped scan, where it is also stopped in every step.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places and counts of small scenes"
)]

use std::collections::BTreeMap;
use std::path::PathBuf;

use chainage::cluster::p_linkage::{Surfaces, SurfacesConfig};
use chainage::input::{Catalog, InputOptions};
use chainage::model::Plane;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::drive::scratch;
use crate::util::memory_drive::{MemoryDrive, Outcome};
use crate::util::method_run::{MethodRun, resumed};
use crate::util::program::{ended, program, run_to_the_end};
use crate::util::surface_oracle::{self, Settings};

type Points = Vec<[i64; 3]>;

/// A random deviation with about this standard deviation, in millimetres: a sum of 12 uniform numbers.
fn noise(rng: &mut ChaCha8Rng, deviation: f64) -> f64 {
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * deviation
}

/// A rectangle of random points: corner and two sides, in millimetres.
type Rectangle = ([f64; 3], [f64; 3], [f64; 3]);

fn rectangle(rng: &mut ChaCha8Rng, (corner, u, v): Rectangle, count: usize, deviation: f64) -> Points {
    (0..count)
        .map(|_| {
            let (s, t): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            [0, 1, 2].map(|k| (corner[k] + s * u[k] + t * v[k] + noise(rng, deviation)).round() as i64)
        })
        .collect()
}

/// Two walls, a floor, a leaning board and dust, in places that depend on the seed. The noise is much larger
/// than the lattice step: if half of a small slice lay exactly in one plane, the last digit of its eigenvalue
/// would choose the plane.
fn scene(rng: &mut ChaCha8Rng) -> (Points, Vec<bool>) {
    let base = [0, 1, 2].map(|_| rng.random_range(-9_000.0..9_000.0));
    let at = |by: [f64; 3]| [0, 1, 2].map(|k| base[k] + by[k]);
    let deviation = [5.0, 8.0, 11.0][rng.random_range(0..3)];
    let turn: f64 = rng.random_range(0.0..1.5);
    let (along, across) = ([turn.cos(), turn.sin(), 0.0], [-turn.sin(), turn.cos(), 0.0]);
    let scaled = |v: [f64; 3], by: f64| v.map(|part| part * by);
    let mut points = Points::new();
    let mut add = |rng: &mut ChaCha8Rng, rectangle_: Rectangle, count| {
        points.extend(rectangle(rng, rectangle_, count, deviation))
    };
    add(rng, (at([0.0; 3]), scaled(along, 2_200.0), scaled(across, 1_700.0)), 500);
    add(rng, (at([0.0; 3]), scaled(along, 2_200.0), [0.0, 0.0, 1_300.0]), 400);
    add(rng, (at([0.0; 3]), scaled(across, 1_700.0), [0.0, 0.0, 1_300.0]), 300);
    let board = scaled(across, 700.0);
    add(rng, (at(scaled(along, 1_000.0)), scaled(along, 900.0), [board[0], board[1], 900.0]), 250);
    for _ in 0..80 {
        points.push([0, 1, 2].map(|k| (base[k] + rng.random_range(-500.0..2_500.0)) as i64));
    }
    // Some points occur more than once.
    for _ in 0..15 {
        points.push(points[rng.random_range(0..points.len())]);
    }
    let ground = (0..points.len()).map(|_| rng.random_range(0..60) == 0).collect();
    (points, ground)
}

fn method(settings: &Settings) -> Surfaces {
    let config = SurfacesConfig {
        angle_deg: settings.angle_deg,
        border_score: settings.border_score,
        refit_planes: settings.refit_planes,
        contest_rounds: u32::try_from(settings.contest_rounds).unwrap(),
        neighbours: u32::try_from(settings.neighbours).unwrap(),
        reach_m: settings.reach_mm as f64 / 1_000.0,
        ..SurfacesConfig::default()
    };
    Surfaces::new(&config).unwrap()
}

fn settings(rng: &mut ChaCha8Rng) -> Settings {
    let [neighbours, reach_mm, contest_rounds] =
        [[30, 1_000, 2], [15, 250, 0], [41, 400, 1], [24, 700, 3]][rng.random_range(0..4)];
    let [angle_deg, border_score] = [[10.0, 2.5], [20.0, 0.0], [5.0, 1.0]][rng.random_range(0..3)];
    Settings {
        neighbours,
        reach_mm: i64::try_from(reach_mm).unwrap(),
        angle_deg,
        border_score,
        refit_planes: rng.random_range(0..3) > 0,
        contest_rounds,
    }
}

/// The planes by the smallest point of their surfaces.
fn planes(found: &Outcome) -> BTreeMap<usize, Plane> {
    let grouped = found.grouped.as_ref().unwrap();
    let count = found.objects.iter().flatten().collect::<std::collections::BTreeSet<_>>().len();
    assert!(grouped.planes.len() <= count);
    // Groups have no ids of points, but their centres differ.
    let key = |plane: &Plane| {
        usize::try_from(plane.points).unwrap() * 1_000_003 + plane.centre[0].rem_euclid(1_000_003) as usize
    };
    grouped.planes.values().map(|plane| (key(plane), *plane)).collect()
}

#[test]
fn any_tiles_give_what_brute_force_finds_in_the_whole_cloud() {
    let mut all = [0; 4];
    for seed in 0..16 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (points, ground) = scene(&mut rng);
        let settings = settings(&mut rng);
        let (expected, figures) = surface_oracle::surfaces(&points, &ground, &settings);
        all = [0, 1, 2, 3].map(|k| all[k] + figures[k]);
        let mut runs = Vec::new();
        for tiles in [1, 2, 5] {
            let deal = |_| rng.random_range(0..tiles);
            let found = MemoryDrive::new(&points, &ground, tiles, deal).run(&method(&settings));
            // The eigenvalues of the other library differ in the last digit, which may decide about a point.
            let wrong = expected.iter().zip(&found.objects).filter(|(a, b)| a != b).count();
            assert!(wrong * 1_000 < points.len(), "seed {seed}, {tiles} tiles, {settings:?}: {wrong} points");
            let report = found.grouped.as_ref().unwrap().figures["p-linkage"].clone();
            runs.push((planes(&found), report, found.objects));
        }
        assert!(runs.windows(2).all(|pair| pair[0] == pair[1]), "seed {seed}: tiles show");
    }
    // Scenes without slices, merging or points that change their surface would prove nothing.
    assert!(all[0] > 150 && all[1] > 50 && all[2] > 500 && all[3] > 2, "{all:?}");
}

#[test]
fn in_dense_noise_a_contest_finds_what_brute_force_does() {
    let mut changed = 0;
    for seed in 0..4 {
        let mut rng = ChaCha8Rng::seed_from_u64(500 + seed);
        // Around a corner of cubes of 0.5 m.
        let points: Points = (0..2_000).map(|_| [0, 1, 2].map(|_| rng.random_range(400..600))).collect();
        let ground = vec![false; points.len()];
        // Without merging, because brute force has only the border rule for it.
        let of_contest = Settings { angle_deg: 0.0, contest_rounds: 2, ..settings(&mut rng) };
        let settings = Settings { neighbours: 30, ..of_contest };
        let (expected, figures) = surface_oracle::surfaces(&points, &ground, &settings);
        changed += figures[2];
        let found = MemoryDrive::new(&points, &ground, 1, |_| 0).run(&method(&settings));
        let wrong = expected.iter().zip(&found.objects).filter(|(a, b)| a != b).count();
        assert!(wrong * 100 < points.len(), "seed {seed}, {settings:?}: {wrong} points");
    }
    assert!(changed > 500, "{changed}");
}

/// Walls, floor and ceiling of 4 m by 3 m by 2.5 m, a table, and a niche of 0.3 m: corner, sides, and the
/// unit normal.
fn room() -> Vec<(Rectangle, [f64; 3])> {
    let [x, y, z] = [[4_000.0, 0.0, 0.0], [0.0, 3_000.0, 0.0], [0.0, 0.0, 2_500.0]];
    vec![
        (([0.0; 3], x, y), [0.0, 0.0, 1.0]),
        (([0.0; 3], x, z), [0.0, 1.0, 0.0]),
        (([0.0; 3], y, z), [1.0, 0.0, 0.0]),
        ((x, y, z), [1.0, 0.0, 0.0]),
        ((z, x, y), [0.0, 0.0, 1.0]),
        (([1_200.0, 1_000.0, 750.0], [1_500.0, 0.0, 0.0], [0.0, 800.0, 0.0]), [0.0, 0.0, 1.0]),
        (([500.0, 3_300.0, 0.0], [3_000.0, 0.0, 0.0], [0.0, 0.0, 2_000.0]), [0.0, 1.0, 0.0]),
    ]
}

#[test]
fn every_plane_of_a_room_is_found_once_with_its_angle_and_offset() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let base = [31_000.0, -8_000.0, 2_000.0];
    let mut points = Points::new();
    let mut of_plane: Vec<usize> = Vec::new();
    for (number, ((corner, u, v), _)) in room().into_iter().enumerate() {
        let norm = |v: [f64; 3]| v.iter().map(|part| part * part).sum::<f64>().sqrt();
        // 1000 points per square metre, noise of 10 mm.
        let count = (norm(u) * norm(v) / 1_000.0) as usize;
        let corner = [0, 1, 2].map(|k| base[k] + corner[k]);
        points.extend(rectangle(&mut rng, (corner, u, v), count, 10.0));
        of_plane.resize(points.len(), number);
    }
    let ground = vec![false; points.len()];
    let default = Surfaces::new(&SurfacesConfig::default()).unwrap();
    let found = MemoryDrive::new(&points, &ground, 2, |cell| cell[0].unsigned_abs() % 2).run(&default);
    let planes: Vec<Plane> = planes(&found).into_values().collect();
    for (number, ((corner, ..), normal)) in room().into_iter().enumerate() {
        let members: Vec<usize> = (0..points.len()).filter(|point| of_plane[*point] == number).collect();
        let mut sizes: BTreeMap<Option<usize>, usize> = BTreeMap::new();
        members.iter().for_each(|point| *sizes.entry(found.objects[*point]).or_default() += 1);
        sizes.remove(&None);
        let mut parts: Vec<usize> = sizes.values().copied().collect();
        parts.sort_unstable();
        let largest = parts.pop().unwrap();
        assert!(largest * 10 > members.len() * 9, "plane {number}: {largest} of {}", members.len());
        assert!(
            parts.iter().all(|part| part * 20 < members.len()),
            "plane {number} is found once: {parts:?}"
        );
        let object = sizes.iter().find(|(_, size)| **size == largest).unwrap().0;
        let all = found.objects.iter().filter(|other| *other == object).count();
        assert!(largest * 10 > all * 9, "plane {number} is one of several in its surface");
        // Exactly one plane with about this many points must agree in normal and place.
        let agrees = |plane: &&Plane| {
            let cosine: f64 = (0..3).map(|k| plane.normal[k] * normal[k]).sum();
            let offset: f64 =
                (0..3).map(|k| (plane.centre[k] as f64 - base[k] - corner[k]) * normal[k]).sum();
            plane.points * 10 > members.len() as u64 * 8
                && cosine.abs() > 0.5_f64.to_radians().cos()
                && offset.abs() < 10.0
        };
        let matching: Vec<&Plane> = planes.iter().filter(agrees).collect();
        assert_eq!(matching.len(), 1, "plane {number}");
        let deviation = matching[0].flatness_units2.sqrt();
        assert!((7.0..12.0).contains(&deviation), "plane {number}: {deviation} mm");
    }
}

#[test]
fn a_road_and_a_pavement_are_two_surfaces_unless_only_normals_decide() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let side = [3_000.0, 0.0, 0.0];
    let mut points = rectangle(&mut rng, ([0.0, -1_500.0, 0.0], side, [0.0, 1_500.0, 0.0]), 4_500, 10.0);
    points.extend(rectangle(&mut rng, ([0.0; 3], side, [0.0, 0.0, 120.0]), 360, 10.0));
    points.extend(rectangle(&mut rng, ([0.0, 0.0, 120.0], side, [0.0, 1_200.0, 0.0]), 3_600, 10.0));
    let (road, pavement) = (0..4_500, 4_860..8_460);
    let ground = vec![false; points.len()];
    let largest = |found: &Outcome, plane: std::ops::Range<usize>| {
        let mut sizes: BTreeMap<usize, usize> = BTreeMap::new();
        found.objects[plane.clone()]
            .iter()
            .flatten()
            .for_each(|object| *sizes.entry(*object).or_default() += 1);
        let (object, size) = sizes.into_iter().max_by_key(|(_, size)| *size).unwrap();
        assert!(size * 10 > plane.len() * 9, "{size} of {}", plane.len());
        object
    };
    let default = SurfacesConfig::default;
    let printed = SurfacesConfig { border_score: 0.0, contest_rounds: 0, ..default() };
    for (config, two) in [(default(), true), (printed, false)] {
        let border_score = config.border_score;
        let method = Surfaces::new(&config).unwrap();
        let found = MemoryDrive::new(&points, &ground, 3, |cell| cell[0].unsigned_abs() % 3).run(&method);
        let apart = largest(&found, road.clone()) != largest(&found, pavement.clone());
        assert_eq!(apart, two, "border_score {border_score}");
    }
}

/// A road, a kerb of 0.12 m and a pavement along 5 m, with 2000 points per square metre and noise of 10 mm.
/// Also returns the range of the points of the kerb.
fn kerb(rng: &mut ChaCha8Rng) -> (Points, std::ops::Range<usize>) {
    let side = [5_000.0, 0.0, 50.0];
    let mut points = rectangle(rng, ([300.0, -800.0, 0.0], side, [0.0, 800.0, 16.0]), 8_000, 10.0);
    points.extend(rectangle(rng, ([300.0, 0.0, 16.0], side, [0.0, 0.0, 120.0]), 1_200, 10.0));
    points.extend(rectangle(rng, ([300.0, 0.0, 136.0], side, [0.0, 800.0, 16.0]), 8_000, 10.0));
    (points, 8_000..9_200)
}

/// Shares of the kerb in the two surfaces with most of its points, and the plane of the first.
fn kerb_found(seed: u64, contest_rounds: u32) -> ([f64; 2], Option<Plane>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (points, kerb) = kerb(&mut rng);
    let ground = vec![false; points.len()];
    let method = Surfaces::new(&SurfacesConfig { contest_rounds, ..SurfacesConfig::default() }).unwrap();
    let found = MemoryDrive::new(&points, &ground, 2, |cell| cell[0].unsigned_abs() % 2).run(&method);
    let mut sizes: BTreeMap<usize, usize> = BTreeMap::new();
    found.objects[kerb.clone()].iter().flatten().for_each(|object| *sizes.entry(*object).or_default() += 1);
    let mut parts: Vec<(usize, usize)> = sizes.into_iter().map(|(object, size)| (size, object)).collect();
    parts.sort_unstable_by(|a, b| b.cmp(a));
    let share = |at: usize| parts.get(at).map_or(0.0, |part| part.0 as f64 / kerb.len() as f64);
    // The largest surface that stands upright; road and pavement are level.
    let upright = |plane: &Plane| plane.normal[2].abs() < 0.2;
    let plane = planes(&found).into_values().filter(upright).max_by_key(|plane| plane.points);
    ([share(0), share(1)], plane)
}

#[test]
fn a_kerb_is_found_once_by_contests_and_in_pieces_without() {
    let default = SurfacesConfig::default().contest_rounds;
    let mut once = 0;
    let seeds = [33, 34, 35, 36, 37];
    for seed in seeds {
        let ([before, _], _) = kerb_found(seed, 0);
        assert!(before < 0.65, "seed {seed}: {before}");
        let ([largest, next], plane) = kerb_found(seed, default);
        assert!(largest > before + 0.1, "seed {seed}: {before} {largest}");
        if largest < 0.8 || next > 0.1 {
            continue;
        }
        once += 1;
        let plane = plane.unwrap();
        assert!(plane.normal[1].abs() > 5.0_f64.to_radians().cos(), "seed {seed}: {plane:?}");
        assert!(plane.centre[1].abs() < 5, "seed {seed}: {plane:?}");
    }
    // In a kerb of 5 m, a leaning slice may survive the contests and keep two pieces apart.
    assert!(once * 2 > seeds.len(), "{once} of {} kerbs are found once", seeds.len());
}

#[test]
fn points_on_a_line_or_a_plane_and_equal_points_get_an_answer() {
    let level: Points = (0..400).map(|n| [n * 20, 0, 0]).collect();
    let diagonal: Points = (0..400).map(|n| [n * 20, n * 20, n * 20]).collect();
    let wall: Points = (0..2_000).map(|n| [n % 80 * 50, 0, n / 80 * 50]).collect();
    let one_place: Points = vec![[5, 5, 5]; 3_000];
    let far: Points = (0..200).map(|n| [n * 30_000, n * n * 11, 0]).collect();
    for (name, points, surfaces) in [
        ("level", level, 0),
        ("diagonal", diagonal, 0),
        ("wall", wall, 1),
        ("one place", one_place, 0),
        ("far apart", far, 0),
        ("none", Points::new(), 0),
    ] {
        let ground = vec![false; points.len()];
        let default = Surfaces::new(&SurfacesConfig::default()).unwrap();
        let whole = MemoryDrive::new(&points, &ground, 1, |_| 0).run(&default);
        let found: std::collections::BTreeSet<usize> = whole.objects.iter().flatten().copied().collect();
        assert_eq!(found.len(), surfaces, "{name}");
        assert!(
            surfaces == 0 || whole.objects.iter().all(Option::is_some),
            "{name}: every point is of the wall"
        );
        let tiled = MemoryDrive::new(&points, &ground, 3, |cell| cell[0].unsigned_abs() % 3).run(&default);
        assert_eq!(tiled.objects, whole.objects, "{name}");
        assert_eq!(planes(&tiled), planes(&whole), "{name}");
    }
}

#[test]
fn a_slice_through_many_tiles_is_gathered_by_one_of_them_and_once() {
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    // Exactly flat, so it is one slice.
    let points = rectangle(&mut rng, ([200.0; 3], [23_500.0, 0.0, 0.0], [0.0, 600.0, 0.0]), 6_000, 0.0);
    let ground = vec![false; points.len()];
    let method = Surfaces::new(&SurfacesConfig { contest_rounds: 1, ..SurfacesConfig::default() }).unwrap();
    let whole = MemoryDrive::new(&points, &ground, 1, |_| 0).run(&method);
    let tiles = 24;
    let tiled = MemoryDrive::new(&points, &ground, tiles, |cell| cell[0].unsigned_abs()).run(&method);
    assert_eq!(tiled.objects, whole.objects);
    assert_eq!(planes(&tiled), planes(&whole));
    // The tile that fits the plane of the slice reads the part in each tile. To compare slices, a tile reads
    // its own part and the parts of its two neighbours.
    let tiles = tiles as usize;
    assert_eq!(tiled.reads[1], tiles);
    assert!((tiles..=3 * tiles).contains(&tiled.reads[2]), "{}", tiled.reads[2]);
}

const SURFACES: MethodRun = MethodRun {
    method: "p-linkage",
    results: &[
        "tree_road_sweep.laz",
        "objects.csv",
        "objects.geojson",
        "surfaces.csv",
        "surfaces.geojson",
        "surfaces.ply",
    ],
};

#[test]
fn tiles_and_threads_do_not_show() {
    SURFACES.assert_tiles_do_not_show(scratch().path());
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn a_run_stopped_in_any_step_ends_in_the_same_bytes() {
    let folder = scratch();
    let settings = ["tiling.tile_length=20", "run.threads=2"];
    let straight: PathBuf = folder.path().join("straight");
    let passes: Vec<&'static str> =
        SURFACES.run_in(&straight, &settings).passes.iter().map(|figures| figures.pass).collect();
    let expected = SURFACES.results(&straight);
    for pass in ["links", "planes", "slices", "contest-1", "contest-2", "contest-3", "contest-4", "surfaces"]
    {
        for after in [0, 1] {
            let out = folder.path().join(format!("{pass}-{after}"));
            assert!(SURFACES.interrupted_in(pass, after, &out, &settings).is_err());
            let summary = SURFACES.run_in(&out, &settings);
            let before = passes.iter().position(|name| *name == pass).unwrap();
            assert!(resumed(&summary)[..before].iter().all(|pass| pass.1), "{pass}: {:?}", resumed(&summary));
            SURFACES.assert_same(&out, &expected, &format!("stopped in {pass} after {after}"));
        }
    }
}

#[test]
fn another_angle_redoes_the_merging_and_not_the_links() {
    let folder = scratch();
    let out = folder.path().join("changed");
    let of_default = SURFACES.run_in(&out, &["tiling.tile_length=20"]).objects;
    let summary = SURFACES.run_in(&out, &["tiling.tile_length=20", "p-linkage.angle_deg=0"]);
    let done: Vec<(&str, bool)> = resumed(&summary);
    let state = |name: &str| done.iter().find(|pass| pass.0 == name).unwrap().1;
    assert!(state("links") && state("planes") && !state("slices") && !state("surfaces"), "{done:?}");
    assert!(summary.objects > of_default, "without merging there are more surfaces: {}", summary.objects);
}

#[test]
fn another_number_of_contests_redoes_what_is_after_them() {
    let folder = scratch();
    let out = folder.path().join("rounds");
    SURFACES.run_in(&out, &["tiling.tile_length=20", "p-linkage.contest_rounds=1"]);
    let summary = SURFACES.run_in(&out, &["tiling.tile_length=20"]);
    let done: Vec<(&str, bool)> = resumed(&summary);
    let state = |name: &str| done.iter().find(|pass| pass.0 == name).unwrap().1;
    assert!(state("links") && state("slices") && state("contest-1"), "{done:?}");
    assert!(!state("contest-2") && !state("surfaces"), "{done:?}");
    let straight = folder.path().join("straight");
    SURFACES.run_in(&straight, &["tiling.tile_length=20"]);
    SURFACES.assert_same(&out, &SURFACES.results(&straight), "with another number of contests before");
}

#[test]
fn another_method_leaves_no_surfaces_behind() {
    let folder = scratch();
    let out = folder.path().join("out");
    SURFACES.run_in(&out, &[]);
    assert!(out.join("surfaces.csv").exists());
    let euclidean = MethodRun { method: "euclidean", results: &["objects.csv"] };
    euclidean.run_in(&out, &[]);
    assert!(!out.join("surfaces.csv").exists() && !out.join("surfaces.ply").exists());
}

/// The number of a surface is not the number of an object, so its dimension has a name of its own, which
/// `eval` finds.
#[test]
fn surfaces_have_a_dimension_of_their_own() {
    let folder = scratch();
    let dimensions = |name: &str, settings: &[&str]| {
        let out = folder.path().join(name);
        SURFACES.run_in(&out, settings);
        let copy = out.join("tree_road_sweep.laz");
        let catalog = Catalog::open(std::slice::from_ref(&copy), &InputOptions::default()).unwrap();
        let names = ["cluster_id", "surface_id", "plane"];
        let layout = catalog.files()[0].layout();
        (copy, names.map(|name| layout.dimension(name).is_some()))
    };
    let (copy, found) = dimensions("auto", &[]);
    assert_eq!(found, [false, true, false]);
    let score = |more: &[&str]| {
        let mut call = program();
        call.args(["eval", "--json", "-", "--class-dim", "none", "--reference-dim", "surface_id"]).args(more);
        let output = call.arg(&copy).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let found = score(&[]);
    assert_eq!(found["compared"]["prediction_dim"], "surface_id");
    assert_eq!(found, score(&["--prediction-dim", "surface_id"]));
    // A drive processed by two methods has both dimensions, so `eval` says which one it compares.
    let out = folder.path().join("both");
    run_to_the_end(&[copy], &out, &[]);
    let said = |more: &[&str]| {
        let mut call = program();
        call.args(["eval", "--class-dim", "none", "--reference-dim", "surface_id"]).args(more);
        let (code, errors) = ended(&call.arg(out.join("tree_road_sweep.laz")).output().unwrap());
        assert_eq!(code, 0, "{errors}");
        errors.matches("cluster_id is compared; for the surfaces use --prediction-dim surface_id").count()
    };
    assert_eq!([said(&[]), said(&["--prediction-dim", "surface_id"])], [1, 0]);
    let (_, found) = dimensions("named", &["output.dimension=plane"]);
    assert_eq!(found, [false, false, true]);
}
