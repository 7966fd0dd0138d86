//! `chainage::synth` with spinning heads: where their beams point, what a single sweep covers, and how it
//! repeats.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::path::Path;

use chainage::synth::{Preset, Scanner, Sensor, Settings, generate};

use crate::synth::{Point, all_points, number, table, write};

/// The spinning sensors.
const SPINNING: [Sensor; 4] =
    [Sensor::Spinning16, Sensor::Spinning32, Sensor::Spinning64, Sensor::Spinning64Wide];

fn sweeps(sensor: Sensor, count: u64) -> Settings {
    let mut settings = Settings::new(Preset::Downtown);
    settings.scanner = Scanner::of(sensor);
    (settings.length_m, settings.sweeps) = (None, Some(count));
    settings
}

fn measured(settings: &Settings) -> (tempfile::TempDir, Vec<Point>) {
    let folder = tempfile::tempdir().unwrap();
    write(settings, folder.path());
    let points = all_points(folder.path());
    (folder, points)
}

/// Position, and the unit vectors forward, left and up, interpolated between the poses of a trajectory.
struct Poses(Vec<[f64; 7]>);

impl Poses {
    fn read(folder: &Path) -> Self {
        let keys = ["gps_time", "x", "y", "z", "roll", "pitch", "heading"];
        Self(
            table(&folder.join("trajectory.csv"))
                .iter()
                .map(|row| keys.map(|key| number(row, key)))
                .collect(),
        )
    }

    /// A point in the frame of the head at its time: ahead, left, up.
    fn local(&self, point: &Point) -> [f64; 3] {
        let after = self.0.partition_point(|pose| pose[0] <= point.time).clamp(1, self.0.len() - 1);
        let [a, b] = [self.0[after - 1], self.0[after]];
        let w = (point.time - a[0]) / (b[0] - a[0]);
        let [_, x, y, z, roll, pitch, heading]: [f64; 7] =
            std::array::from_fn(|column| a[column] + (b[column] - a[column]) * w);
        let [east, north, up] = [point.position[0] - x, point.position[1] - y, point.position[2] - z];
        let (sin, cos) = heading.to_radians().sin_cos();
        let [ahead, right] = [east * sin + north * cos, east * cos - north * sin];
        let (sin, cos) = pitch.to_radians().sin_cos();
        let [ahead, up] = [ahead * cos + up * sin, up * cos - ahead * sin];
        let (sin, cos) = roll.to_radians().sin_cos();
        [ahead, -(right * cos - up * sin), up * cos + right * sin]
    }
}

#[test]
fn every_beam_points_to_its_elevation_and_azimuth() {
    for sensor in SPINNING {
        let (folder, points) = measured(&sweeps(sensor, 2));
        let poses = Poses::read(folder.path());
        let elevations = Scanner::of(sensor).spinning.unwrap().elevations();
        let mut used = BTreeSet::new();
        for point in &points {
            let [ahead, left, up] = poses.local(point);
            let out = ahead.hypot(left);
            let elevation = up.atan2(out).to_degrees();
            let expected = elevations[usize::from(point.beam)];
            // Coordinates have steps of 1 mm, the trajectory has steps of 0.1 mm.
            let allowed = 0.02 + (0.002 / out).atan().to_degrees();
            assert!((elevation - expected).abs() < allowed, "{sensor:?}: {elevation} instead of {expected}");
            let azimuth = (left.atan2(ahead).to_degrees() - point.angle + 540.0).rem_euclid(360.0) - 180.0;
            assert!(azimuth.abs() < allowed, "{sensor:?}: azimuth off by {azimuth}");
            used.insert(point.beam);
        }
        // A beam above the roofs returns few echoes, so not every beam is used.
        assert!(used.len() * 10 >= elevations.len() * 9, "{sensor:?}: {} beams return echoes", used.len());
    }
}

#[test]
fn a_single_sweep_covers_the_circle_once_and_times_every_pulse() {
    for sensor in SPINNING {
        let (_folder, points) = measured(&sweeps(sensor, 1));
        let scanner = Scanner::of(sensor);
        let elevations = scanner.spinning.as_ref().unwrap().elevations();
        let columns = scanner.pulse_rate_hz / scanner.profiles_hz / elevations.len() as f64;
        let mut sectors = BTreeSet::new();
        let mut per_beam: BTreeMap<u8, u32> = BTreeMap::new();
        let start = points[0].time.floor();
        for pair in points.windows(2) {
            assert!(pair[0].time < pair[1].time, "{sensor:?}: one echo of a pulse, one pulse at a time");
            assert!(pair[0].angle <= pair[1].angle, "{sensor:?}: the circle is not closed before its end");
        }
        for point in &points {
            let since = point.time - start;
            assert!((0.0..0.1).contains(&since), "{sensor:?}: {since} s");
            let azimuth = since * 3_600.0 - 180.0;
            assert!((point.angle - azimuth).abs() < 360.0 / columns + 0.01, "{sensor:?}: {azimuth}");
            #[expect(clippy::cast_possible_truncation, reason = "within half a turn")]
            sectors.insert((point.angle / 10.0).floor().min(17.0) as i64);
            *per_beam.entry(point.beam).or_default() += 1;
        }
        assert_eq!(sectors.len(), 36, "{sensor:?}: every ten degrees return echoes");
        let most = per_beam.values().copied().max().unwrap();
        assert!(f64::from(most) <= columns + 1.0, "{sensor:?}: {most} echoes of a beam in {columns} steps");
        assert!(f64::from(most) > 0.8 * columns, "{sensor:?}: {most} echoes of a beam in {columns} steps");
    }
}

#[test]
fn the_view_ends_at_the_highest_beam() {
    let (folder, points) = measured(&sweeps(Sensor::Spinning64, 1));
    let poses = Poses::read(folder.path());
    let facade: Vec<[f64; 3]> =
        points.iter().filter(|point| point.class == 5).map(|point| poses.local(point)).collect();
    assert!(facade.len() > 1_000, "{} points of facades", facade.len());
    let highest = facade.iter().map(|[ahead, left, up]| up / ahead.hypot(*left)).fold(f64::MIN, f64::max);
    assert!((highest - 2f64.to_radians().tan()).abs() < 1e-3, "{highest}");
}

#[test]
fn ranges_vary_by_the_stated_noise() {
    let ranges = |noise_m: f64| {
        let mut settings = sweeps(Sensor::Spinning16, 1);
        // A narrow beam, so that the footprint on slanting surfaces adds little.
        (settings.scanner.noise_m, settings.scanner.divergence_mrad) = (noise_m, 0.1);
        let (folder, points) = measured(&settings);
        let poses = Poses::read(folder.path());
        let range = |point: &Point| poses.local(point).iter().map(|x| x * x).sum::<f64>().sqrt();
        points.iter().map(|point| (point.time.to_bits(), range(point))).collect::<BTreeMap<_, _>>()
    };
    let exact = ranges(0.0);
    let noise = Scanner::of(Sensor::Spinning16).noise_m;
    let mut errors: Vec<f64> = ranges(noise)
        .iter()
        .filter_map(|(time, range)| exact.get(time).map(|exact| (range - exact).abs()))
        .collect();
    assert!(errors.len() > 10_000, "{} pulses have an echo in both", errors.len());
    errors.sort_unstable_by(f64::total_cmp);
    // Half of the errors of a normal distribution are below 0.6745 standard deviations. Roughness and
    // footprint add to both.
    let deviation = errors[errors.len() / 2] / 0.6745;
    assert!((0.55 * noise..noise * 1.05).contains(&deviation), "{deviation} m");
}

#[test]
fn same_sweeps_for_any_number_of_threads() {
    let read = |threads: usize| {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings { threads, compressed: false, ..sweeps(Sensor::Spinning32, 8) };
        write(&settings, folder.path());
        ["downtown_0001.las", "reference.csv", "trajectory.csv", "scene.json"]
            .map(|name| std::fs::read(folder.path().join(name)).unwrap())
    };
    let one = read(1);
    let reference = String::from_utf8_lossy(&one[1]);
    let moving = reference.lines().skip(1).filter(|row| !row.ends_with(','));
    assert!(moving.count() > 2, "cars and people move: {reference}");
    assert!(read(2) == one, "2 threads give other bytes than 1");
    assert!(read(5) == one, "5 threads give other bytes than 1");
}

#[test]
fn sweeps_begin_where_a_longer_drive_has_them() {
    let (_short, few) = measured(&sweeps(Sensor::Spinning16, 1));
    let (_long, many) = measured(&sweeps(Sensor::Spinning16, 3));
    assert!(many.len() > 2 * few.len());
    let key = |point: &Point| (point.time.to_bits(), point.position.map(f64::to_bits), point.instance);
    assert!(few.iter().map(key).eq(many.iter().take(few.len()).map(key)));
}

/// First number of moving objects.
const MOVING: u32 = 1_000_000_000;

#[test]
fn the_points_of_a_moving_car_move_with_its_speed() {
    let suburb = Settings { preset: Preset::Suburb, ..sweeps(Sensor::Spinning64, 12) };
    let (folder, points) = measured(&suburb);
    let speeds: BTreeMap<u32, f64> = table(&folder.path().join("reference.csv"))
        .iter()
        .filter(|row| row["class"] == "4" && !row["speed_kmh"].is_empty())
        .map(|row| (row["instance"].parse().unwrap(), number(row, "speed_kmh") / 3.6))
        .collect();
    assert!(speeds.keys().all(|instance| *instance >= MOVING), "{speeds:?}");
    let mut followed = 0;
    for (instance, speed) in speeds {
        let mut sweeps: BTreeMap<i64, Vec<[f64; 3]>> = BTreeMap::new();
        for point in points.iter().filter(|point| point.instance == instance) {
            #[expect(clippy::cast_possible_truncation, reason = "tenths of a second of a day")]
            let sweep = (point.time * 10.0).floor() as i64;
            sweeps.entry(sweep).or_default().push([point.time, point.position[0], point.position[1]]);
        }
        sweeps.retain(|_, points| points.len() >= 150);
        let Some((first, last)) = sweeps.values().next().zip(sweeps.values().last()) else { continue };
        // The middle of the box of a sweep. The mean would shift with the visible side.
        let middle = |points: &[[f64; 3]]| {
            let time = points.iter().map(|point| point[0]).sum::<f64>() / points.len() as f64;
            let [x, y] = [1, 2].map(|axis| {
                let low = points.iter().fold(f64::MAX, |low, point| low.min(point[axis]));
                f64::midpoint(low, points.iter().fold(f64::MIN, |high, point| high.max(point[axis])))
            });
            [time, x, y]
        };
        let [a, b] = [first, last].map(|points| middle(points));
        if b[0] - a[0] < 0.35 {
            continue;
        }
        let moved = (b[1] - a[1]).hypot(b[2] - a[2]) / (b[0] - a[0]);
        assert!((moved / speed - 1.0).abs() < 0.2, "{instance}: {moved} m/s and not {speed}");
        followed += 1;
    }
    assert!(followed > 1, "{followed} cars are seen in several sweeps");
}

#[test]
fn mirrors_show_points_below_the_road() {
    let (folder, points) = measured(&sweeps(Sensor::Spinning64, 10));
    let poses = Poses::read(folder.path());
    // The road is 1.8 m below the head, and falls or rises by less than 5 %.
    let below = |point: &&Point| {
        let [ahead, left, up] = poses.local(point);
        up < -2.3 - 0.05 * ahead.hypot(left)
    };
    let deep: Vec<&Point> = points.iter().filter(below).collect();
    assert!(deep.iter().all(|point| (point.instance, point.class) == (0, 0)), "nothing else is there");
    let share = deep.len() as f64 / points.len() as f64;
    assert!((1e-4..0.01).contains(&share), "{share} of the points are below the road");
}

#[test]
fn profile_heads_have_no_sweeps_and_a_spinning_head_has_no_twin() {
    let folder = tempfile::tempdir().unwrap();
    let text = |settings: &Settings| {
        generate(settings, folder.path(), &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    assert_eq!(
        text(&sweeps(Sensor::Profiler, 3)),
        "sweeps = 3: must be left out, because profile heads do not spin"
    );
    let mut settings = sweeps(Sensor::Spinning64, 3);
    settings.scanner.heads = 2;
    assert_eq!(text(&settings), "heads = 2: must be 1, because a spinning scanner has one head");
}
