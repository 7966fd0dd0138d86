//! `chainage::synth`: the bytes repeat, the truth matches the points, and the statistics match those of the
//! labelled scenes.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::util::skipped;
use chainage::synth::{Preset, Scanner, Sensor, Settings, generate};

/// A scanner with about ten thousand points per second of driving.
fn coarse() -> Scanner {
    Scanner { pulse_rate_hz: 20_000.0, profiles_hz: 50.0, ..Scanner::default() }
}

fn small(preset: Preset) -> Settings {
    let mut settings = Settings::new(preset);
    settings.scanner = coarse();
    settings.length_m = Some(60.0);
    settings
}

pub(crate) fn write(settings: &Settings, folder: &Path) -> chainage::synth::Summary {
    generate(settings, folder, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// One point as stored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub(crate) position: [f64; 3],
    pub(crate) nth: u8,
    pub(crate) total: u8,
    pub(crate) channel: u8,
    /// Beam of a spinning head, and scan angle in degrees.
    pub(crate) beam: u8,
    pub(crate) angle: f64,
    pub(crate) source: u16,
    pub(crate) time: f64,
    pub(crate) instance: u32,
    pub(crate) class: u8,
}

fn little<const N: usize>(record: &[u8], at: usize) -> [u8; N] {
    record[at..at + N].try_into().unwrap()
}

/// The points of a file in point format 6 with the two truth dimensions.
fn points(path: &Path) -> Vec<Point> {
    let mut reader = las::Reader::from_path(path).unwrap();
    let transforms = *reader.header().transforms();
    let data = reader.read_all().unwrap();
    let parse = |record: &[u8]| {
        let axis = |at, transform: las::Transform| transform.direct(i32::from_le_bytes(little(record, at)));
        Point {
            position: [axis(0, transforms.x), axis(4, transforms.y), axis(8, transforms.z)],
            nth: record[14] & 15,
            total: record[14] >> 4,
            channel: (record[15] >> 4) & 3,
            beam: record[17],
            angle: f64::from(i16::from_le_bytes(little(record, 18))) * 0.006,
            source: u16::from_le_bytes(little(record, 20)),
            time: f64::from_le_bytes(little(record, 22)),
            instance: u32::from_le_bytes(little(record, 30)),
            class: record[34],
        }
    };
    data.raw_bytes().chunks_exact(35).map(parse).collect()
}

/// The point files of a folder, in order.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "laz" || e == "las")).collect();
    files.sort();
    files
}

pub(crate) fn all_points(folder: &Path) -> Vec<Point> {
    files(folder).iter().flat_map(|file| points(file)).collect()
}

/// Rows of a CSV file as numbers where they are numbers, by column name.
pub(crate) fn table(path: &Path) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<String> = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let row = |line: &str| header.iter().cloned().zip(line.split(',').map(str::to_owned)).collect();
    lines.map(row).collect()
}

pub(crate) fn number(row: &BTreeMap<String, String>, key: &str) -> f64 {
    row[key].parse().unwrap()
}

#[test]
fn same_seed_same_bytes_for_any_number_of_threads() {
    let read = |threads: usize, seed: u64| {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings { threads, seed, files_every_s: Some(2.0), ..small(Preset::Mixed) };
        write(&settings, folder.path());
        let mut names: Vec<PathBuf> =
            std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        names.sort();
        names
            .iter()
            .map(|path| (path.file_name().unwrap().to_owned(), std::fs::read(path).unwrap()))
            .collect::<Vec<_>>()
    };
    let one = read(1, 7);
    let reference = one.iter().find(|(name, _)| name == "reference.csv").unwrap();
    let reference = String::from_utf8_lossy(&reference.1);
    let column = |name: &str| reference.lines().next().unwrap().split(',').position(|column| column == name);
    let has = |row: &&str, name: &str| row.split(',').nth(column(name).unwrap()).unwrap() != "";
    assert!(reference.lines().skip(1).any(|row| has(&row, "speed_kmh")), "something moves: {reference}");
    assert!(one.len() >= 5, "three files of points and three of text: {}", one.len());
    assert!(read(2, 7) == one, "2 threads give other bytes than 1");
    assert!(read(4, 7) == one, "4 threads give other bytes than 1");
    assert!(read(2, 8) != one, "another seed gives the same bytes");
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn the_reference_counts_the_points_of_every_preset() {
    for preset in Preset::ALL {
        let folder = tempfile::tempdir().unwrap();
        let mut settings = small(preset);
        if preset == Preset::Loop {
            settings.length_m = Some(1_100.0);
            settings.scanner.pulse_rate_hz = 3_600.0;
            settings.scanner.profiles_hz = 20.0;
        }
        let summary = write(&settings, folder.path());
        let points = all_points(folder.path());
        assert_eq!(points.len() as u64, summary.points);

        let mut counted: BTreeMap<u32, (u8, u64, [f64; 3])> = BTreeMap::new();
        for point in &points {
            match (point.instance, point.class) {
                (0, class) => assert!(class <= 1, "{preset:?}: class {class} without an object"),
                (instance, class) => {
                    let entry = counted.entry(instance).or_insert((class, 0, [f64::MAX; 3]));
                    assert_eq!(entry.0, class, "{preset:?}: object {instance} has two classes");
                    entry.1 += 1;
                    entry.2 = [0, 1, 2].map(|axis| entry.2[axis].min(point.position[axis]));
                }
            }
        }
        let rows = table(&folder.path().join("reference.csv"));
        let ids: Vec<f64> = rows.iter().map(|row| number(row, "instance")).collect();
        assert!(ids.windows(2).all(|pair| pair[0] < pair[1]), "{preset:?}: numbers rise and are unique");
        assert_eq!(rows.len(), counted.len(), "{preset:?}");
        assert_eq!(rows.len() as u64, summary.objects);
        for (row, (instance, (class, count, low))) in rows.iter().zip(&counted) {
            assert_eq!(row["instance"], instance.to_string());
            assert_eq!(row["class"], class.to_string());
            assert_eq!(row["n_points"], count.to_string(), "{preset:?}: object {instance}");
            for (axis, key) in ["xmin", "ymin", "zmin"].into_iter().enumerate() {
                assert!((number(row, key) - low[axis]).abs() < 6e-4, "{preset:?}: object {instance} {key}");
            }
        }
    }
}

#[test]
fn returns_of_a_pulse_are_numbered_and_times_rise() {
    let folder = tempfile::tempdir().unwrap();
    write(&small(Preset::Avenue), folder.path());
    let points = all_points(folder.path());
    assert!(points.windows(2).all(|pair| pair[0].time <= pair[1].time));
    let mut several = 0;
    for pulse in points.chunk_by(|a, b| a.time.total_cmp(&b.time).is_eq() && a.channel == b.channel) {
        for (index, point) in pulse.iter().enumerate() {
            assert_eq!((usize::from(point.nth), usize::from(point.total)), (index + 1, pulse.len()));
        }
        several += usize::from(pulse.len() > 1);
    }
    let share = several as f64 / points.len() as f64;
    assert!((0.01..0.15).contains(&share), "share of pulses with several returns in a dense avenue: {share}");
}

#[test]
fn files_are_cut_by_time_and_the_drive_after_so_many_points() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = small(Preset::Highway);
    settings.files_every_s = Some(1.5);
    (settings.length_m, settings.points) = (None, Some(100_000));
    settings.compressed = false;
    let summary = write(&settings, folder.path());
    let files = files(folder.path());
    assert_eq!(summary.files as usize, files.len());
    assert!(files.len() >= 3 && files[0].ends_with("highway_0001.las"));
    let start = points(&files[0])[0].time;
    for (index, file) in files.iter().enumerate() {
        for point in points(file) {
            assert_eq!(usize::from(point.source), index + 1);
            let late = (point.time - start) / 1.5 - index as f64;
            assert!((-0.01..1.01).contains(&late), "{late}");
        }
    }
    assert_eq!(summary.points, 100_000);
}

#[test]
fn the_loop_comes_back_over_its_first_metres_in_the_other_direction() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = small(Preset::Loop);
    settings.length_m = Some(1_200.0);
    settings.scanner.pulse_rate_hz = 1_800.0;
    settings.scanner.profiles_hz = 10.0;
    write(&settings, folder.path());
    let way = table(&folder.path().join("trajectory.csv"));
    let first = way.first().unwrap();
    let last = way.last().unwrap();
    let apart = (number(first, "x") - number(last, "x")).hypot(number(first, "y") - number(last, "y"));
    assert!(apart < 5.0, "ends beside its start, in the other lane: {apart} m");
    let turn = (number(first, "heading") - number(last, "heading")).abs();
    assert!((turn - 180.0).abs() < 6.0, "{turn} degrees");
    let steps = way.windows(2).map(|pair| {
        let [dx, dy, dz] = ["x", "y", "z"].map(|key| number(&pair[1], key) - number(&pair[0], key));
        dx.hypot(dy).hypot(dz)
    });
    // 60 km/h are 0.167 m in 10 ms: there is no jump, not even where the loop closes.
    let longest = steps.fold(0.0, f64::max);
    assert!(longest < 0.19, "{longest} m");
}

/// Noise of a metre moves echoes of near targets behind the scanner, where it measures nothing.
#[test]
fn the_largest_noise_makes_a_drive_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = small(Preset::Suburb);
    settings.scanner.noise_m = 1.0;
    assert!(write(&settings, folder.path()).points > 10_000);
}

#[test]
fn the_trajectory_reaches_beyond_the_first_and_the_last_point() {
    let folder = tempfile::tempdir().unwrap();
    write(&small(Preset::Suburb), folder.path());
    let way = table(&folder.path().join("trajectory.csv"));
    let (first, last) = (number(&way[0], "gps_time"), number(&way[way.len() - 1], "gps_time"));
    let times = all_points(folder.path()).into_iter().map(|point| point.time);
    assert!(times.into_iter().all(|time| first <= time && time <= last + 1e-4));
}

#[test]
fn settings_and_folders_that_will_not_do_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = |settings: &Settings| {
        generate(settings, folder.path(), &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    let mut settings = small(Preset::Loop);
    assert_eq!(text(&settings), "length = 60: must be 1100 to 2000000 m");
    settings = small(Preset::Suburb);
    settings.scanner.heads = 3;
    assert_eq!(text(&settings), "heads = 3: must be 1 to 2");
    type Change = fn(&mut Scanner);
    let head: Change = |scanner| *scanner = Scanner::of(Sensor::Spinning16);
    let wrong: [(Change, Change, &str); 7] = [
        (|_| {}, |scanner| scanner.strays = f64::NAN, "strays = NaN: must be 0 to 1"),
        (|_| {}, |scanner| scanner.divergence_mrad = -0.1, "divergence = -0.1: must be 0 to 100 mrad"),
        (head, |scanner| scanner.heads = 2, "heads = 2: must be 1, because a spinning scanner has one head"),
        (head, |scanner| scanner.pulse_rate_hz = 500.0, "pulse-rate = 500: must be 1000 to 2000000 Hz"),
        (
            head,
            |scanner| scanner.spinning.as_mut().unwrap().beams = vec![(-15.0, 15.0, 257)],
            "beams = 257: must be 1 to 256",
        ),
        (head, |scanner| scanner.spinning.as_mut().unwrap().beams.clear(), "beams = 0: must be 1 to 256"),
        (
            head,
            |scanner| scanner.spinning.as_mut().unwrap().height_m = 0.0,
            "height = 0: must be 0.5 to 10 m",
        ),
    ];
    for (ready, change, expected) in wrong {
        settings = small(Preset::Suburb);
        ready(&mut settings.scanner);
        change(&mut settings.scanner);
        assert_eq!(text(&settings), expected);
    }
    settings = small(Preset::Suburb);
    let notes = folder.path().join("notes.txt");
    std::fs::write(&notes, "mine").unwrap();
    let error = generate(&settings, folder.path(), &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(error.to_string().ends_with("is not empty") && error.hint().unwrap().contains("another folder"));
    assert_eq!(std::fs::read_to_string(notes).unwrap(), "mine");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Ranges at which points and ground are compared, metres.
const BANDS: [f64; 5] = [2.0, 4.0, 8.0, 16.0, 32.0];

/// Statistics of a scene, computed in the same way for labelled and synthetic ones.
#[derive(Debug)]
struct Look {
    /// Share of the points within 45 m by range band, and share of ground among them.
    by_range: Vec<(f64, f64)>,
    ground: f64,
    /// Share of half-metre cells between 2 and 9 m from the track without a ground point, that is, hidden
    /// cells.
    hidden: f64,
    /// Median points of an object by class, per thousand points of a metre of drive.
    per_object: BTreeMap<u8, f64>,
}

/// The cell of half a metre around a place of the plane.
#[expect(clippy::cast_possible_truncation, reason = "UTM coordinates")]
fn half_metre(x: f64, y: f64) -> (i64, i64) {
    ((x * 2.0).floor() as i64, (y * 2.0).floor() as i64)
}

/// The statistics of a scene from the `points` of one pass, the trajectory and the objects.
fn look(points: &[Point], way: &[BTreeMap<String, String>], objects: &[BTreeMap<String, String>]) -> Look {
    let track: Vec<[f64; 4]> =
        way.iter().map(|row| ["gps_time", "x", "y", "z"].map(|key| number(row, key))).collect();
    let mut bands = vec![(0u64, 0u64); BANDS.len()];
    let inside: Vec<u32> = objects
        .iter()
        .filter(|row| row["base_inside"] == "1")
        .map(|row| row["instance"].parse().unwrap())
        .collect();
    let mut near = 0u64;
    let mut ground = 0u64;
    let mut objects: BTreeMap<(u8, u32), u64> = BTreeMap::new();
    let mut seen: BTreeSet<(i64, i64)> = BTreeSet::new();
    for point in points {
        let index = track.partition_point(|pose| pose[0] <= point.time).clamp(1, track.len() - 1) - 1;
        let pose = track[index];
        let range = (0..3).map(|axis| (point.position[axis] - pose[axis + 1]).powi(2)).sum::<f64>().sqrt();
        let is_ground = u64::from(point.class == 1);
        if range < 45.0 {
            near += 1;
            ground += is_ground;
            if let Some(band) = BANDS.iter().rposition(|low| range >= *low) {
                bands[band].0 += 1;
                bands[band].1 += is_ground;
            }
        }
        if point.class == 1 {
            seen.insert(half_metre(point.position[0], point.position[1]));
        } else if inside.binary_search(&point.instance).is_ok() {
            *objects.entry((point.class, point.instance)).or_default() += 1;
        }
    }
    // Cells beside the track, away from its ends and turns.
    let mut cells = 0u64;
    let mut hidden = 0u64;
    let bounds = |axis: usize| {
        let values = points.iter().filter(|p| p.class == 1).map(move |p| p.position[axis]);
        values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((x0, x1), (y0, y1)) = (bounds(0), bounds(1));
    let mut driven = 0.0;
    for pair in track.windows(2) {
        let dx = pair[1][1] - pair[0][1];
        let dy = pair[1][2] - pair[0][2];
        driven += dx.hypot(dy);
    }
    for pose in track.windows(2).step_by(10) {
        let dx = pose[1][1] - pose[0][1];
        let dy = pose[1][2] - pose[0][2];
        let length = dx.hypot(dy).max(1e-9);
        for step in 4..18 {
            for side in [-1.0, 1.0] {
                let out = side * f64::from(step) * 0.5;
                let [x, y] = [pose[0][1] - dy / length * out, pose[0][2] + dx / length * out];
                if x < x0 + 15.0 || x > x1 - 15.0 || y < y0 || y > y1 || dx.abs() < 1e-9 {
                    continue;
                }
                cells += 1;
                hidden += u64::from(!seen.contains(&half_metre(x, y)));
            }
        }
    }
    let mut by_class: BTreeMap<u8, Vec<u64>> = BTreeMap::new();
    for ((class, _), count) in objects {
        by_class.entry(class).or_default().push(count);
    }
    let per_metre = near as f64 / driven / 1_000.0;
    let median = |mut counts: Vec<u64>| {
        counts.sort_unstable();
        counts[counts.len() / 2] as f64 / per_metre / 1_000.0
    };
    Look {
        by_range: bands
            .iter()
            .map(|(n, g)| (*n as f64 / near as f64, *g as f64 / (*n).max(1) as f64))
            .collect(),
        ground: ground as f64 / near as f64,
        hidden: hidden as f64 / cells.max(1) as f64,
        per_object: by_class.into_iter().map(|(class, counts)| (class, median(counts))).collect(),
    }
}

/// The mean of the figures of several streets; for a class, only of the streets that have it.
fn mean(looks: &[Look]) -> Look {
    let share = |of: &dyn Fn(&Look) -> f64| looks.iter().map(of).sum::<f64>() / looks.len() as f64;
    let bands = 0..looks[0].by_range.len();
    let classes: BTreeSet<u8> = looks.iter().flat_map(|look| look.per_object.keys().copied()).collect();
    let of_class = |class: u8| {
        let counts: Vec<f64> = looks.iter().filter_map(|look| look.per_object.get(&class).copied()).collect();
        (class, counts.iter().sum::<f64>() / counts.len() as f64)
    };
    Look {
        by_range: bands
            .map(|band| (share(&|look| look.by_range[band].0), share(&|look| look.by_range[band].1)))
            .collect(),
        ground: share(&|look| look.ground),
        hidden: share(&|look| look.hidden),
        per_object: classes.into_iter().map(of_class).collect(),
    }
}

/// Pictures are compared by eye; this test limits the figures behind them. The factors say how much the
/// scenes may differ: they are different streets, but of the same kind, and seen by the same kind of scanner.
#[test]
fn statistics_are_those_of_the_labelled_scenes() {
    let shared = std::env::var_os("CHAINAGE_SHARED_DATA")
        .map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    let cases = [
        // 44.13 kHz and 100 profiles per second at 35 km/h; 296 kHz and 150 at 30 km/h.
        ("downtown_ts2", Preset::Downtown, 44_130.0, 100.0, (33.0, 37.0), 200.0),
        ("avenue_road60", Preset::Avenue, 296_000.0, 150.0, (29.0, 31.0), 60.0),
    ];
    for (name, preset, pulse_rate_hz, profiles_hz, speed_kmh, length) in cases {
        let scene = shared.join(format!("sim/{name}.laz"));
        if !scene.exists() {
            return skipped(&format!("density of synth beside {} (it is not there)", scene.display()));
        }
        // One scene was driven through twice; one pass is compared.
        let mut pass = points(&scene);
        pass.retain(|point| point.source == 1);
        let end = pass.iter().fold(f64::MIN, |end, point| end.max(point.time));
        let side = |what: &str| table(&shared.join(format!("sim/{name}_{what}.csv")));
        let mut way = side("trajectory");
        way.retain(|row| number(row, "gps_time") <= end);
        let theirs = look(&pass, &way, &side("reference"));
        // Streets of different seeds have different buildings: the ground share of downtown is 0.52 to 0.60.
        let ours = mean(&[1, 2, 3, 4].map(|seed| {
            let folder = tempfile::tempdir().unwrap();
            let scanner = Scanner { pulse_rate_hz, profiles_hz, ..Scanner::default() };
            let length_m = Some(length);
            write(&Settings { scanner, speed_kmh, length_m, seed, ..Settings::new(preset) }, folder.path());
            let side = |what: &str| table(&folder.path().join(what));
            look(&all_points(folder.path()), &side("trajectory.csv"), &side("reference.csv"))
        }));
        // Figures of benches/results/synth.md: cargo test statistics -- --nocapture
        println!("{name}\n  theirs {theirs:.3?}\n  ours   {ours:.3?}");
        let close = |what: &str, a: f64, b: f64, by: f64| {
            assert!((a - b).abs() <= by, "{name}: {what} is {b:.3}, in the labelled scene {a:.3}");
        };
        close("ground share", theirs.ground, ours.ground, 0.06);
        close("hidden share", theirs.hidden, ours.hidden, 0.06);
        for (band, (a, b)) in BANDS.iter().zip(theirs.by_range.iter().zip(&ours.by_range)) {
            // Windows of synthetic drives let pulses through, as in real scans: rooms behind facades add
            // points from 16 m on (0.219, against 0.148 in downtown_ts2, whose buildings are closed).
            close(&format!("share of points from {band} m"), a.0, b.0, 0.08);
            // The labelled scenes are cut out of longer drives: too few points beyond 32 m for a comparison.
            if *band < 32.0 {
                close(&format!("ground share from {band} m"), a.1, b.1, 0.15);
            }
        }
        // Objects are at about the same distance in both. Cars are on both sides in synthetic drives, and
        // mostly on the near side in the labelled scenes.
        let factors = [(2, 2.0), (3, 2.0), (4, 2.5), (5, 2.0), (6, 2.5), (7, 2.0)];
        for (class, factor) in factors.into_iter().filter(|(class, _)| theirs.per_object.contains_key(class))
        {
            let a = theirs.per_object[&class];
            let b = ours.per_object[&class];
            assert!(
                (1.0 / factor..factor).contains(&(b / a)),
                "{name}: class {class} has {b:.3} per object, there {a:.3}"
            );
        }
    }
}

/// A stopped drive leaves no incomplete file, and its folder can be used again.
#[test]
fn a_stopped_drive_leaves_no_half_files() {
    let folder = tempfile::tempdir().unwrap();
    let settings = Settings { length_m: Some(2_000.0), ..small(Preset::Suburb) };
    let mut calls = 0;
    let mut stop = |_| {
        calls += 1;
        if calls == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let error = generate(&settings, folder.path(), &mut stop).unwrap_err();
    assert_eq!((error.kind(), calls), (chainage::ErrorKind::Interrupted, 2));
    assert!(error.to_string().starts_with("interrupted after "), "{error}");
    assert!(error.hint().unwrap().contains("the same command starts from the beginning"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    generate(&small(Preset::Suburb), folder.path(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(folder.path().join("reference.csv").is_file());
}

/// Ctrl-C, and the incomplete files of a killed process.
#[test]
fn an_interrupted_program_leaves_no_half_files() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    use crate::util::program::program;

    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let begin = || {
        let child = program()
            .args(["synth", "suburb", "--length", "200km", "--threads", "1", "-o"])
            .arg(&out)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        let begun = Instant::now();
        // Files of an earlier process may exist.
        let own = format!("-{}-", child.id());
        let is_own = |file: std::fs::DirEntry| {
            let name = file.file_name().to_string_lossy().into_owned();
            name.contains(".laz.") && name.contains(&own)
        };
        while !out.read_dir().is_ok_and(|mut files| files.any(|file| file.is_ok_and(is_own))) {
            assert!(begun.elapsed() < Duration::from_secs(120), "no points are written");
            std::thread::sleep(Duration::from_millis(20));
        }
        child
    };
    let mut killed = begin();
    killed.kill().expect("killed");
    killed.wait().expect("ended");
    assert!(out.read_dir().unwrap().count() >= 3, "half files stay");
    // They do not count as content of the folder, and are removed.
    let child = begin();
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(sent.success());
    let ended = child.wait_with_output().expect("ends");
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(130), "{errors}");
    assert!(errors.contains("error: interrupted after "), "{errors}");
    assert_eq!(out.read_dir().unwrap().count(), 0);
}
