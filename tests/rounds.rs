//! Steps that are repeated until they have settled, tested with a small method that needs one round per tile:
//! the smallest id along a chain of voxels through all tiles. Also `status`, which names exactly the passes
//! that `run` executes.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use chainage::cluster::{
    self, BytesPer, ClusterEntry, DriveWindow, Grouped, Labelled, Mapped, Method, Reduced, Repeat, Step,
    TileWindow,
};
use chainage::model::{Lattice, Reach, TileId};
use chainage::run::{
    CancelToken, Event, Observer, Registries, RunError, RunRequest, RunSummary, run, status,
};
use chainage::{Result, ground};

use crate::util::drive::{assert_same_outputs, config, run_with, scratch, settings};
use crate::util::las::{Point, Shape};
use crate::util::shipped;

/// Edge of a voxel in lattice units.
const EDGE: i64 = 200;

/// Voxels with the smallest id that is known to be connected with them.
type Names = BTreeMap<[i64; 3], u64>;

/// A method in which every voxel takes the smallest id of all voxels that are connected with it.
#[derive(Debug)]
struct Smallest {
    steps: [Step; 3],
}

impl Smallest {
    fn new(most: u32) -> Self {
        let step = |name, repeat| Step { name, settings: &[], bytes: BytesPer::Point(100), repeat };
        Self {
            steps: [
                step("voxels", Repeat::Once),
                step("spread", Repeat::UntilSettled { most }),
                step("label", Repeat::Once),
            ],
        }
    }
}

fn voxel(point: [i64; 3]) -> [i64; 3] {
    point.map(|value| value.div_euclid(EDGE))
}

fn touch(a: &[i64; 3], b: &[i64; 3]) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() <= 1)
}

fn encode(names: &Names) -> Vec<u8> {
    names
        .iter()
        .flat_map(|(voxel, id)| voxel.iter().map(|k| k.cast_unsigned()).chain([*id]))
        .flat_map(u64::to_le_bytes)
        .collect()
}

fn decode(bytes: &[u8]) -> Names {
    let words: Vec<u64> = bytes.as_chunks::<8>().0.iter().map(|word| u64::from_le_bytes(*word)).collect();
    words.chunks(4).map(|row| ([0, 1, 2].map(|k| row[k].cast_signed()), row[3])).collect()
}

/// Every voxel takes the smallest name that it reaches through `names` and, with a single step, in `beyond`.
fn spread(names: &mut Names, beyond: &Names) {
    loop {
        let before = names.clone();
        for (voxel, name) in names.iter_mut() {
            let around = before.iter().chain(beyond).filter(|(other, _)| touch(voxel, other));
            *name = around.map(|(_, id)| *id).min().map_or(*name, |least| least.min(*name));
        }
        if *names == before {
            return;
        }
    }
}

impl Method for Smallest {
    fn name(&self) -> &'static str {
        "smallest"
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        1..=u64::MAX
    }

    fn steps(&self) -> &[Step] {
        &self.steps
    }

    fn planning_reach(&self, _lattice: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }

    fn border_reach(&self, _step: usize, _lattice: Lattice) -> i64 {
        2 * EDGE
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        match step {
            0 => {
                let points = tile.points(0, true)?;
                let mut names = Names::new();
                for point in 0..points.cloud.len() {
                    let name = names.entry(voxel(points.cloud.lattice_point(point))).or_insert(u64::MAX);
                    *name = (*name).min(points.cloud.id[point].number());
                }
                Ok(Mapped::payload(encode(&names)))
            }
            1 => {
                let mut names = decode(&tile.payload(0, tile.tile())?);
                let mut beyond = Names::new();
                for near in tile.near(2 * EDGE).into_iter().filter(|near| *near != tile.tile()) {
                    for (voxel, id) in decode(&tile.border(near)?) {
                        let name = beyond.entry(voxel).or_insert(u64::MAX);
                        *name = (*name).min(id);
                    }
                }
                spread(&mut names, &beyond);
                let payload = encode(&names);
                Ok(Mapped { border: payload.clone(), payload, labelled: None })
            }
            _ => {
                let names = decode(&tile.payload(1, tile.tile())?);
                let points = tile.points(0, true)?;
                let mut all: Vec<u64> = names.values().copied().collect();
                all.sort_unstable();
                all.dedup();
                let name = |point: usize| names[&voxel(points.cloud.lattice_point(point))];
                let label =
                    |point| u32::try_from(all.binary_search(&name(point)).expect("a name") + 1).expect("few");
                let labels = (0..points.cloud.len()).map(label).collect();
                let payload = all.iter().flat_map(|id| id.to_le_bytes()).collect();
                let count = u32::try_from(all.len()).expect("few");
                let labelled = Some(Labelled { points, labels, count, with_halo: false });
                Ok(Mapped { payload, labelled, ..Mapped::default() })
            }
        }
    }

    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        if step < 2 {
            return Ok(Reduced::Global(vec![7; step]));
        }
        assert_eq!((drive.global(0), drive.global(1)), (&[][..], &[7][..]));
        let mut groups = Vec::new();
        for tile in TileId::first(drive.tiles()) {
            let names = drive.payload(2, tile)?;
            let names = names
                .as_chunks::<8>()
                .0
                .iter()
                .map(|id| u32::try_from(u64::from_le_bytes(*id) + 1).expect("few points"));
            groups.push(names.collect());
        }
        Ok(Reduced::Groups(Grouped { groups, ..Grouped::default() }))
    }
}

const SMALLEST: ClusterEntry = ClusterEntry {
    name: "smallest",
    summary: "the smallest id along a chain",
    reference: "none",
    build: |_| Ok(Box::new(Smallest::new(64))),
};
const IMPATIENT: ClusterEntry = ClusterEntry { build: |_| Ok(Box::new(Smallest::new(3))), ..SMALLEST };

/// A wire of 40 m whose smallest id is at one end, and one of 12 m beside it.
fn wires(folder: &Path) -> PathBuf {
    let mut points: Vec<Point> = (0..400).map(|step| Point::at([step * 100, 0, 3_000])).collect();
    points.extend((0..120).map(|step| Point::at([14_000 + step * 100, 2_000, 3_000])));
    let path = folder.join("wires.las");
    Shape { format: 0, ..Shape::default() }.write(&path, &points);
    path
}

const PLAIN: [&str; 4] =
    ["cluster.method=smallest", "ground.method=none", "noise.enabled=false", "tiling.cell=0.5"];

fn with(more: &[&str]) -> Vec<String> {
    settings(&[&PLAIN[..], more].concat())
}

fn registries(cluster: &[ClusterEntry]) -> Registries<'_> {
    Registries { ground: ground::REGISTRY, cluster }
}

/// Parallel wires: the first neighbours are on a line, whose curve has no tangent point, and from about 30 on
/// they are on a plane.
fn many_wires(folder: &Path) -> PathBuf {
    let wire = |wire: i64| (0..300).map(move |step| Point::at([step * 100, wire * 1_500, 3_000]));
    let points: Vec<Point> = (0..10).flat_map(wire).collect();
    let path = folder.join("many.las");
    Shape { format: 0, ..Shape::default() }.write(&path, &points);
    path
}

/// Remembers passes with their units, and cancels after the first unit of the pass with a given number.
struct Watch<'a> {
    passes: Mutex<Vec<(String, usize)>>,
    stop: Option<(usize, &'a CancelToken)>,
    started: AtomicUsize,
}

impl<'a> Watch<'a> {
    fn new(stop: Option<(usize, &'a CancelToken)>) -> Self {
        Self { passes: Mutex::default(), stop, started: AtomicUsize::new(0) }
    }

    fn names(self) -> Vec<(String, usize)> {
        self.passes.into_inner().expect("not poisoned")
    }
}

impl Observer for Watch<'_> {
    fn event(&self, event: &Event<'_>) {
        match event {
            Event::PassStarted { pass, units, .. } => {
                self.started.fetch_add(1, Ordering::Relaxed);
                self.passes.lock().expect("not poisoned").push(((*pass).to_owned(), *units));
            }
            Event::UnitFinished { .. } => {
                if let Some((pass, cancel)) = self.stop
                    && self.started.load(Ordering::Relaxed) == pass + 1
                {
                    cancel.cancel();
                }
            }
            _ => {}
        }
    }
}

fn watched(
    input: &Path,
    out: &Path,
    assignments: &[String],
    cluster: &[ClusterEntry],
    stop: Option<usize>,
) -> (Result<RunSummary>, Vec<(String, usize)>) {
    let cancel = CancelToken::default();
    let watch = Watch::new(stop.map(|pass| (pass, &cancel)));
    let request = RunRequest {
        inputs: vec![input.to_owned()],
        out: out.to_owned(),
        config: config(assignments),
        fresh: false,
        registries: registries(cluster),
    };
    let result = run(&request, &watch, &cancel);
    (result, watch.names())
}

#[test]
fn a_step_settles_to_the_same_bytes_in_any_tiles() {
    let folder = scratch();
    let input = wires(folder.path());
    let whole = folder.path().join("whole");
    let summary = run_with(
        std::slice::from_ref(&input),
        &whole,
        &with(&["tiling.tile_length=1000"]),
        registries(&[SMALLEST]),
    );
    assert_eq!(summary.expect("a run").objects, 2);
    for (length, tiles, threads) in [("5", 8, "1"), ("5", 8, "4"), ("2", 20, "2"), ("13", 4, "2")] {
        let out = folder.path().join(format!("{length}-{threads}"));
        let list = with(&[&format!("tiling.tile_length={length}"), &format!("run.threads={threads}")]);
        let (result, passes) = watched(&input, &out, &list, &[SMALLEST], None);
        assert_eq!(result.expect("a run").tiles, tiles, "tiles of {length} m");
        assert_same_outputs(&whole, &out, &format!("tiles of {length} m, {threads} threads"));
        let rounds: Vec<usize> = passes.iter().filter(|pass| pass.0 == "spread").map(|pass| pass.1).collect();
        // One round per tile, and one that finds nothing new. All tiles run in the first two rounds, and then
        // only the tiles ahead.
        assert!((tiles..=tiles + 1).contains(&rounds.len()), "{rounds:?} rounds of {tiles} tiles");
        assert_eq!(rounds[0], tiles);
        // The smallest id advances by one tile in every round; the tiles behind it see nothing new.
        assert!((2..).zip(&rounds[2..]).all(|(round, &units)| units + round <= tiles + 2), "{rounds:?}");
    }
}

#[test]
fn a_run_stopped_in_any_round_goes_on_to_the_same_bytes() {
    let folder = scratch();
    let input = wires(folder.path());
    let list = with(&["tiling.tile_length=5", "run.threads=1"]);
    let straight = folder.path().join("straight");
    let (result, passes) = watched(&input, &straight, &list, &[SMALLEST], None);
    result.expect("a run");
    for (number, (name, units)) in passes.iter().enumerate() {
        let out = folder.path().join(format!("{number}"));
        let (result, _) = watched(&input, &out, &list, &[SMALLEST], Some(number));
        match result {
            Err(error) => assert!(matches!(error.cause(), Some(RunError::Interrupted { .. })), "{error}"),
            // The last unit of the run was already in flight.
            Ok(_) => {
                assert_eq!(name, "export");
                continue;
            }
        }
        let seen = status(&out, &registries(&[SMALLEST]), |_| Ok(config(&list))).expect("a status");
        assert!(seen.passes.len() >= number, "{name}: {:?}", seen.passes);
        let (result, again) = watched(&input, &out, &list, &[SMALLEST], None);
        let summary = result.expect("a run");
        assert_eq!(again, passes, "stopped in pass {number}, {name} of {units} units");
        let kept = &summary.passes[..number];
        assert!(
            kept.iter().all(|pass| pass.resumed == pass.units),
            "stopped in {number}: {:?}",
            summary.passes
        );
        assert_same_outputs(&straight, &out, &format!("stopped in pass {number}, {name}"));
    }
}

#[test]
fn a_step_that_does_not_settle_is_an_error_with_both_numbers() {
    let folder = scratch();
    let input = wires(folder.path());
    let list = with(&["tiling.tile_length=5"]);
    let error = run_with(&[input], &folder.path().join("out"), &list, registries(&[IMPATIENT]))
        .expect_err("3 rounds");
    assert_eq!(error.to_string(), "pass spread has not settled after 3 rounds: 7 tiles would run again");
}

/// `status` lists the passes that `run` executes, in the same order and with the same units: for every
/// method, with and without scattering, for every K of an estimate and for every round.
#[test]
fn status_names_the_passes_that_run_executes() {
    let folder = scratch();
    let sweep = shipped("tests/data/tree_road_sweep.laz");
    let (wires, many) = (wires(folder.path()), many_wires(folder.path()));
    let mut all = cluster::REGISTRY.to_vec();
    all.push(SMALLEST);
    let auto = ["cluster.method=dbscan", "dbscan.epsilon=auto"];
    let bare = ["ground.method=none", "noise.enabled=false", "epsilon.k=8", "tiling.tile_length=10"];
    let fields = "dbscan.fields=[\"x\",\"y\",\"z\",\"intensity\"]";
    let points = ["cluster.method=euclidean", "output.files=[\"points\"]"];
    let cases: [(&Path, Vec<String>, &[&str]); 7] = [
        (&sweep, settings(&points), &["cluster", "stitch", "relabel", "export"]),
        (&sweep, settings(&["tiling.tile_length=15"]), &["scatter", "cluster"]),
        (&sweep, settings(&["cluster.method=density-peaks"]), &["voxels", "peaks", "borders"]),
        (&sweep, settings(&["cluster.method=dbscan", "tiling.tile_length=40"]), &["cluster"]),
        (&many, settings(&[&auto[..], &bare].concat()), &["epsilon", "epsilon", "cluster"]),
        (&sweep, settings(&[&auto[..], &[fields]].concat()), &["fields", "epsilon", "cluster"]),
        (&wires, with(&["tiling.tile_length=5"]), &["voxels", "spread", "spread", "spread", "label"]),
    ];
    for (number, (input, list, expected)) in cases.into_iter().enumerate() {
        let out = folder.path().join(number.to_string());
        let (result, executed) = watched(input, &out, &list, &all, None);
        let summary = result.expect("a run");
        let names: Vec<&str> = executed.iter().map(|pass| pass.0.as_str()).collect();
        let mut left = expected.iter();
        let found =
            names.iter().fold(left.next(), |next, name| if next == Some(name) { left.next() } else { next });
        assert_eq!(found, None, "{names:?} has not {expected:?} in this order");
        // Only tables and the page show the measures of the inventory.
        assert_eq!(
            names.contains(&"inventory"),
            !list.iter().any(|setting| setting.contains("output.files"))
        );
        let seen = status(&out, &registries(&all), |_| Ok(config(&list))).expect("a status");
        let listed: Vec<(String, Option<usize>)> =
            seen.passes.iter().map(|pass| (pass.pass.to_owned(), pass.units)).collect();
        let units = |(name, units): &(String, usize)| (name.clone(), (name != "export").then_some(*units));
        assert_eq!(listed, executed.iter().map(units).collect::<Vec<_>>(), "case {number}");
        // The report has the names of `status`, which tell the rounds of a pass apart.
        let titles: Vec<&str> = summary.passes.iter().map(|pass| pass.title.as_str()).collect();
        assert_eq!(titles, seen.passes.iter().map(|pass| pass.title.as_str()).collect::<Vec<_>>());
        assert!(seen.finished && seen.passes.iter().all(|pass| pass.why.is_empty() && pass.stale == 0));
    }
}
