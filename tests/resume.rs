//! Interruptions: killed, truncated, out of space, damaged, changed during the run. The same command resumes
//! and computes only what is necessary. The result equals that of an undisturbed run, byte by byte.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::drive::{assert_same_outputs, outputs, scratch, touch};
use crate::util::las::Shape;
use crate::util::program::{ended, events, finished, run_command, run_to_the_end, shell, wait_until};
use crate::util::street::{Course, Street};
use crate::util::{shipped, skipped};

/// Options that give many small units.
const TILES: [&str; 4] = ["--tile-length", "4", "--memory", "256M"];

fn options<'a>(more: &[&'a str]) -> Vec<&'a str> {
    TILES.iter().copied().chain(more.iter().copied()).collect()
}

/// A street of about 15,000 points.
fn street() -> Street {
    Street { things: 300, patches: 2_000, ..Street::middling(5, Course::Straight) }
}

/// A folder with a street as LAS and as LAZ, and a copy of the shipped sample.
struct Inputs {
    folder: tempfile::TempDir,
}

impl Inputs {
    fn new() -> Self {
        let folder = scratch();
        let points = street().points();
        Shape::default().write(&folder.path().join("street.las"), &points);
        Shape::default().write_in_chunks(&folder.path().join("street.laz"), &points, 500);
        std::fs::copy(shipped("tests/data/tree_road_sweep.laz"), folder.path().join("sweep.laz"))
            .expect("copied");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn list(&self, name: &str) -> Vec<PathBuf> {
        vec![self.path(name)]
    }

    /// The output directory of an undisturbed run.
    fn undisturbed(&self, input: &str, more: &[&str]) -> PathBuf {
        let out = self.path(&format!("undisturbed-{input}"));
        run_to_the_end(&self.list(input), &out, &options(more));
        out
    }
}

#[test]
fn killed_at_random_moments_it_goes_on_to_the_same_bytes() {
    let inputs = Inputs::new();
    let methods = ["euclidean", "density-peaks", "euclidean"];
    for (seed, (input, method)) in
        (0_u64..).zip(["sweep.laz", "street.laz", "street.las"].into_iter().zip(methods))
    {
        let method = ["--method", method];
        let undisturbed = inputs.undisturbed(input, &method);
        let out = inputs.path("killed");
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut cut_short = 0;
        for round in 0..8_u64 {
            let threads = ["1", "2", "4"][random.random_range(0..3_usize)];
            let mut child = run_command(&inputs.list(input), &out, &options(&["--threads", threads]))
                .spawn()
                .expect("starts");
            std::thread::sleep(Duration::from_millis(random.random_range(0..40 + round * 10)));
            // SIGKILL: nothing is flushed, and there is no message.
            child.kill().expect("killed");
            cut_short += u32::from(!child.wait().expect("ended").success());
        }
        run_to_the_end(&inputs.list(input), &out, &options(&method));
        assert_same_outputs(&undisturbed, &out, input);
        assert!(cut_short > 0, "no run of {input} was killed in time");
        std::fs::remove_dir_all(&out).expect("removed");
    }
}

#[test]
fn other_threads_recompute_nothing() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("street.laz", &["--threads", "2"]);
    let before = events(&out);
    let bytes = outputs(&out);
    assert!(finished(&before, "ground") > 15, "{} tiles", finished(&before, "ground"));
    for more in [["--threads", "1"], ["--threads", "4"], ["--memory", "512M"]] {
        // The memory is given twice, and the later value counts. It is meant for the first two only.
        let list =
            if more[0] == "--memory" { vec!["--tile-length", "4", more[0], more[1]] } else { options(&more) };
        run_to_the_end(&inputs.list("street.laz"), &out, &list);
    }
    let after = events(&out);
    let units =
        |list: &[serde_json::Value]| list.iter().filter(|event| event["event"] == "unit-finished").count();
    assert_eq!(units(&after), units(&before), "something was computed again");
    assert!(outputs(&out) == bytes);
}

#[test]
fn a_tile_length_left_to_the_memory_keeps_its_tiles_when_threads_change() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    run_to_the_end(&inputs.list("sweep.laz"), &out, &["--threads", "1", "--memory", "128M"]);
    let before = events(&out).len();
    run_to_the_end(&inputs.list("sweep.laz"), &out, &["--threads", "4", "--memory", "1G"]);
    assert!(events(&out)[before..].iter().all(|event| event["event"] != "unit-finished"));
}

#[test]
fn a_changed_distance_redoes_clusters_and_files_and_nothing_before() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("street.las", &[]);
    let first = outputs(&out);
    let before = events(&out).len();
    run_to_the_end(&inputs.list("street.las"), &out, &options(&["--set", "euclidean.max_gap_m=0.5"]));
    let after = &events(&out)[before..];
    let counts = ["survey", "ground", "cluster", "export"].map(|pass| finished(after, pass));
    assert_eq!(counts[..2], [0, 0], "survey and ground were computed again");
    assert!(counts[2] > 15 && counts[3] > 0, "{counts:?}");
    assert!(outputs(&out) != first, "another distance gives the same objects");
    let direct = inputs.path("direct");
    run_to_the_end(&inputs.list("street.las"), &direct, &options(&["--set", "euclidean.max_gap_m=0.5"]));
    assert_same_outputs(&direct, &out, "changed distance");
    // Then back to the first settings.
    run_to_the_end(&inputs.list("street.las"), &out, &options(&[]));
    assert!(outputs(&out) == first);
}

/// All methods write their labels to the same place. The labels of one method must not count as finished work
/// of another.
#[test]
fn another_method_and_back_again_gives_the_first_result() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let methods: Vec<&str> = chainage::cluster::REGISTRY.iter().map(|entry| entry.name).collect();
    let direct: Vec<PathBuf> = methods.iter().map(|name| inputs.path(&format!("direct-{name}"))).collect();
    for (name, direct) in methods.iter().zip(&direct) {
        run_to_the_end(&inputs.list("street.las"), direct, &options(&["--method", name]));
    }
    for round in 0..2 {
        for (name, direct) in methods.iter().zip(&direct) {
            run_to_the_end(&inputs.list("street.las"), &out, &options(&["--method", name]));
            assert_same_outputs(direct, &out, &format!("{name}, round {round}"));
        }
    }
}

/// Overwrites bytes in the middle of a file. The file gets a new time, or keeps the old one.
fn overwrite(path: &Path, at: u64, bytes: &[u8], keep_time: bool) {
    use std::os::unix::fs::FileExt;
    let file = std::fs::File::options().read(true).write(true).open(path).expect("the file");
    let time = file.metadata().expect("facts").modified().expect("a time");
    file.write_all_at(bytes, at).expect("written");
    let later = time + Duration::from_secs(3);
    file.set_modified(if keep_time { time } else { later }).expect("a time");
}

fn refused(inputs: &[PathBuf], out: &Path, more: &[&str], code: i32, texts: &[&str]) {
    let output = run_command(inputs, out, &options(more)).output().expect("starts");
    let (found, errors) = ended(&output);
    assert_eq!(found, code, "{errors}");
    for text in texts {
        assert!(errors.contains(text), "{text:?} is not in:\n{errors}");
    }
}

#[test]
fn another_input_is_refused_and_a_touched_one_is_not() {
    let inputs = Inputs::new();
    for name in ["street.las", "street.laz"] {
        let path = inputs.path(name);
        let out = inputs.undisturbed(name, &[]);
        let bytes = outputs(&out);
        touch(&path);
        let before = events(&out).len();
        run_to_the_end(&inputs.list(name), &out, &options(&[]));
        assert_eq!(finished(&events(&out)[before..], "ground"), 0, "a touched {name} was computed again");
        assert!(outputs(&out) == bytes);
    }
    let out = inputs.path("undisturbed-street.las");
    // Another coordinate, same size: x of record 1,000.
    overwrite(&inputs.path("street.las"), 375 + 1_000 * 30, &77_i32.to_le_bytes(), false);
    refused(&inputs.list("street.las"), &out, &[], 6, &["the points of street.las have changed", "--fresh"]);
    // Another name, more files, another size.
    std::fs::copy(inputs.path("street.las"), inputs.path("other.las")).expect("copied");
    refused(&inputs.list("other.las"), &out, &[], 6, &["file street.las before, other.las now"]);
    let two = vec![inputs.path("street.las"), inputs.path("other.las")];
    refused(&two, &out, &[], 6, &["number of files: 1 before, 2 now"]);
    let mut longer = std::fs::read(inputs.path("street.las")).expect("read");
    longer.extend([0; 100]);
    std::fs::write(inputs.path("street.las"), longer).expect("written");
    refused(&inputs.list("street.las"), &out, &[], 6, &["bytes and", "before, now", "now"]);
    run_to_the_end(&inputs.list("street.las"), &out, &options(&["--fresh"]));
}

/// The offset of x is in the header: the records are the same, but the points lie elsewhere.
#[test]
fn another_header_is_refused() {
    const X_OFFSET: u64 = 155;
    let inputs = Inputs::new();
    for name in ["street.las", "street.laz"] {
        let out = inputs.undisturbed(name, &[]);
        let bytes = outputs(&out);
        overwrite(&inputs.path(name), X_OFFSET, &1_000_f64.to_le_bytes(), false);
        let text = format!("the header of {name} is another one than before");
        refused(&inputs.list(name), &out, &[], 6, &[&text, "--fresh"]);
        assert!(outputs(&out) == bytes, "the outputs of the other {name} changed");
    }
}

/// Bytes of the header of LAS 1.4.
const HEADER_BYTES: usize = 375;

/// A compressed file is changed, refused, and restored with its old time. The data unpacked from the wrong
/// file must not be used.
#[test]
fn a_refused_input_leaves_no_trace_in_the_state() {
    let inputs = Inputs::new();
    let path = inputs.path("street.laz");
    let mut points = street().points();
    let right = Shape::default().compressed(&points, 500);
    points[2_000].mm[0] += 50_000;
    points[2_001].mm[1] -= 50_000;
    let mut wrong = Shape::default().compressed(&points, 500);
    // Another header would be refused for a different reason.
    wrong[..HEADER_BYTES].copy_from_slice(&right[..HEADER_BYTES]);
    // Both get the same size, which is possible because a file may have any bytes after its points.
    let size = right.len().max(wrong.len());
    let time = std::time::SystemTime::now() - Duration::from_secs(100);
    let put = |bytes: &[u8], since: u64| {
        let mut bytes = bytes.to_vec();
        bytes.resize(size, 0);
        std::fs::write(&path, bytes).expect("written");
        let file = std::fs::File::options().write(true).open(&path).expect("the file");
        file.set_modified(time + Duration::from_secs(since)).expect("a time");
    };
    put(&right, 0);
    // Tiles are so long that they read the unpacked positions instead of points grouped by tile.
    let long = ["--tile-length", "30"];
    let out = inputs.path("out");
    run_to_the_end(&inputs.list("street.laz"), &out, &long);
    assert_eq!(finished(&events(&out), "scatter"), 0);
    put(&wrong, 50);
    let output = run_command(&inputs.list("street.laz"), &out, &long).output().expect("starts");
    let (code, errors) = ended(&output);
    assert!(code == 6 && errors.contains("the points of street.laz have changed"), "{code}: {errors}");
    put(&right, 0);
    let more = [long[0], long[1], "--set", "noise.min_component_points=6"];
    run_to_the_end(&inputs.list("street.laz"), &out, &more);
    let direct = inputs.path("direct");
    run_to_the_end(&inputs.list("street.laz"), &direct, &more);
    assert_same_outputs(&direct, &out, "after a refused input");
}

#[test]
fn a_locked_directory_is_refused_and_says_who_holds_it() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("sweep.laz", &[]);
    let lock =
        std::fs::File::options().read(true).write(true).open(out.join(".chainage/lock")).expect("the lock");
    lock.lock().expect("free");
    refused(
        &inputs.list("sweep.laz"),
        &out,
        &[],
        7,
        &["is in use by process", "hint: wait for the other run"],
    );
    lock.unlock().expect("held");
    run_to_the_end(&inputs.list("sweep.laz"), &out, &options(&[]));
}

/// Every unit file of a pass.
fn unit_files(out: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for pass in std::fs::read_dir(out.join(".chainage")).expect("the state") {
        let pass = pass.expect("an entry").path();
        if pass.is_dir() && pass.to_string_lossy().contains("/pass-") {
            let entries =
                std::fs::read_dir(pass).expect("readable").map(|entry| entry.expect("an entry").path());
            files.extend(entries.filter(|path| path.extension().is_some_and(|extension| extension == "bin")));
        }
    }
    files.sort();
    files
}

#[test]
fn damaged_unit_files_are_noticed_and_computed_again() {
    let inputs = Inputs::new();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    for name in ["sweep.laz", "street.las"] {
        let out = inputs.undisturbed(name, &[]);
        let bytes = outputs(&out);
        for damage in ["cut", "flipped", "emptied", "removed"] {
            let files = unit_files(&out);
            assert!(files.len() > 15, "{} unit files", files.len());
            for path in &files {
                let mut content = std::fs::read(path).expect("read");
                let at = random.random_range(0..content.len());
                match damage {
                    "cut" => content.truncate(at),
                    "flipped" => content[at] ^= 1 << random.random_range(0..8),
                    "emptied" => content.clear(),
                    _ => {
                        std::fs::remove_file(path).expect("removed");
                        continue;
                    }
                }
                std::fs::write(path, content).expect("written");
            }
            std::fs::remove_file(out.join("objects.csv")).expect("removed");
            let before = events(&out).len();
            run_to_the_end(&inputs.list(name), &out, &options(&[]));
            let after = &events(&out)[before..];
            let again: usize = ["survey", "scatter", "ground", "cluster", "stitch", "relabel", "inventory"]
                .iter()
                .map(|pass| finished(after, pass))
                .sum();
            assert_eq!(again, files.len(), "{damage}");
            let refusals = after.iter().filter(|event| event["event"] == "refused").count();
            assert_eq!(refusals, if damage == "removed" { 0 } else { files.len() }, "{damage}");
            assert!(outputs(&out) == bytes, "{name} after unit files were {damage}");
        }
    }
}

/// The vertices of the axis nearest to cells are stored to save time. Without them, or with damaged ones,
/// they are found again, and no unit is computed again.
#[test]
fn lost_vertices_of_cells_are_found_again() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("street.las", &[]);
    let bytes = outputs(&out);
    let path = out.join(".chainage/strips/unit-000000.bin");
    let right = std::fs::read(&path).expect("stored");
    let mut flipped = right.clone();
    flipped[right.len() / 2] ^= 1;
    for damaged in [Some(flipped), Some(right[..right.len() / 2].to_vec()), Some(Vec::new()), None] {
        match damaged {
            Some(bytes) => std::fs::write(&path, bytes).expect("written"),
            None => std::fs::remove_file(&path).expect("removed"),
        }
        std::fs::remove_file(out.join("objects.csv")).expect("removed");
        let before = events(&out).len();
        run_to_the_end(&inputs.list("street.las"), &out, &options(&[]));
        assert!(outputs(&out) == bytes);
        assert_eq!(finished(&events(&out)[before..], "ground"), 0, "the tiles have changed");
        assert!(std::fs::read(&path).expect("stored again") == right);
    }
}

/// The copy is lost after its unit is done and before it gets its name (a folder has this name). Then the
/// same with a copy that another call started with other settings.
#[test]
fn a_lost_half_written_copy_is_written_again() {
    let inputs = Inputs::new();
    let undisturbed = inputs.undisturbed("street.las", &[]);
    let out = inputs.path("out");
    let state = out.join(".chainage");
    let copy = out.join("street.las");
    run_to_the_end(&inputs.list("street.las"), &out, &options(&["--set", "euclidean.max_gap_m=0.4"]));
    for other in [None, Some("output.original_classification=true"), Some("euclidean.max_gap_m=0.7")] {
        std::fs::remove_file(&copy).expect("removed");
        std::fs::create_dir_all(&copy).expect("a folder in the way");
        refused(&inputs.list("street.las"), &out, &[], 5, &["cannot write", "street.las"]);
        assert!(state.join("pass-07-export/unit-000000.bin").exists(), "the unit was done");
        match other {
            None => {
                assert!(
                    shell(&format!("rm {}/export/00000-*.part", state.display())),
                    "there is no half a copy"
                );
            }
            Some(other) => refused(
                &inputs.list("street.las"),
                &out,
                &["--set", other],
                5,
                &["cannot write", "street.las"],
            ),
        }
        std::fs::remove_dir(&copy).expect("removed");
        run_to_the_end(&inputs.list("street.las"), &out, &options(&[]));
        assert_same_outputs(&undisturbed, &out, &format!("after {other:?}"));
    }
}

/// The copy has its name, but the run ends before its last file has. Then a unit is lost, or the copy is
/// truncated.
#[test]
fn a_copy_that_has_its_name_is_whole_or_written_again() {
    let inputs = Inputs::new();
    for name in ["street.las", "street.laz"] {
        let undisturbed = inputs.undisturbed(name, &[]);
        let out = inputs.path("out");
        for harm in ["lost", "cut off"] {
            run_to_the_end(&inputs.list(name), &out, &options(&["--set", "euclidean.max_gap_m=0.4"]));
            let report = out.join("report.json");
            std::fs::remove_file(&report).expect("removed");
            std::fs::create_dir_all(report.join("in the way")).expect("a folder in the way");
            refused(&inputs.list(name), &out, &[], 5, &["report.json"]);
            let part = format!("{}/.chainage/export/00000-*.part", out.display());
            assert!(!shell(&format!("ls {part}")), "the copy has its name");
            match harm {
                "lost" => {
                    let unit = out.join(".chainage/pass-07-export/unit-000000.bin");
                    std::fs::remove_file(unit).expect("a unit");
                }
                _ => std::fs::File::options()
                    .write(true)
                    .open(out.join(name))
                    .and_then(|copy| copy.set_len(1_000))
                    .expect("cut off"),
            }
            std::fs::remove_dir_all(&report).expect("removed");
            run_to_the_end(&inputs.list(name), &out, &options(&[]));
            assert_same_outputs(&undisturbed, &out, &format!("{name}, {harm}"));
        }
        std::fs::remove_dir_all(&out).expect("removed");
    }
}

/// Starting over after a finished run does not endanger foreign files.
#[test]
fn fresh_starts_over_in_the_same_directory() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("street.laz", &[]);
    let bytes = outputs(&out);
    let before = events(&out).len();
    run_to_the_end(&inputs.list("street.laz"), &out, &options(&["--fresh"]));
    assert!(before > 0 && finished(&events(&out), "ground") > 15, "nothing was computed again");
    assert!(outputs(&out) == bytes);
}

/// A request is refused before the earlier run is discarded.
#[test]
fn fresh_gives_nothing_up_for_a_request_that_is_refused() {
    let inputs = Inputs::new();
    let list = inputs.list("street.las");
    let out = inputs.undisturbed("street.las", &[]);
    let bytes = outputs(&out);
    let cloud = out.join("drive.copc.laz");
    std::fs::write(&cloud, b"mine").expect("written");
    for (more, code, text) in [
        (["--set", "output.files=[\"bogus\"]"], 3, "output.files = \"bogus\""),
        (
            ["--set", "output.dimension=object_class"],
            3,
            "must be a name other than original_classification and",
        ),
        (["--set", "output.files=[\"points\",\"copc\"]"], 5, "drive.copc.laz would be overwritten"),
    ] {
        refused(&list, &out, &["--fresh", more[0], more[1]], code, &[text]);
    }
    std::fs::remove_file(&cloud).expect("removed");
    let before = events(&out).len();
    run_to_the_end(&list, &out, &options(&[]));
    assert_eq!(finished(&events(&out)[before..], "ground"), 0, "the state of the earlier run was lost");
    assert!(outputs(&out) == bytes);
    // If there was no run before, there must not seem to be one afterwards.
    let new = inputs.path("new");
    refused(&list, &new, &["--set", "output.files=[\"bogus\"]"], 3, &["output.files = \"bogus\""]);
    assert!(!new.exists(), "a folder for a run that was refused");
}

/// Copies in another format would be scored and shown together with the copies of this call.
#[test]
fn outputs_of_an_earlier_call_are_removed_and_named() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("street.laz", &["--output-format", "las"]);
    assert!(out.join("street.las").exists() && out.join("objects.csv").exists());
    let more = ["--outputs", "points", "--set", "noise.min_component_points=6"];
    let output = run_command(&inputs.list("street.laz"), &out, &options(&more)).output().expect("starts");
    let (code, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
    for name in ["street.las", "objects.csv", "report.html"] {
        let text = format!("removed {name}: an earlier call wrote it, and this one does not");
        assert!(errors.contains(&text) && !out.join(name).exists(), "{text:?} is not in:\n{errors}");
    }
    assert!(out.join("street.laz").exists());
    assert!(errors.contains("removed objects.geojson"), "{errors}");
}

#[test]
fn a_setting_of_another_method_is_told_to_have_no_effect() {
    let inputs = Inputs::new();
    let more = ["--set", "dbscan.epsilon=1", "--set", "euclidean.min_points=12", "--outputs", "csv,ply"];
    let out = inputs.path("out");
    let output = run_command(&inputs.list("street.las"), &out, &options(&more)).output().expect("starts");
    let (code, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
    assert!(errors.contains("dbscan.epsilon = 1"), "{errors}");
    assert!(errors.contains("has no effect: the methods are"), "{errors}");
    assert!(!errors.contains("euclidean.min_points"), "{errors}");
    assert!(errors.contains("the output ply needs surfaces, and euclidean finds none"), "{errors}");
}

/// The files of the export are as large as the drive.
#[test]
fn what_only_unfinished_outputs_need_does_not_outlive_a_kill_after_the_mark() {
    let inputs = Inputs::new();
    let out = inputs.undisturbed("street.las", &[]);
    let bytes = outputs(&out);
    let left = out.join(".chainage/export");
    assert!(!left.exists());
    std::fs::create_dir(&left).expect("a folder");
    std::fs::write(left.join("street.las.part"), [0; 1_000]).expect("written");
    run_to_the_end(&inputs.list("street.las"), &out, &options(&[]));
    assert!(!left.exists() && outputs(&out) == bytes);
}

/// A limit of file sizes simulates a full disk. The signal that comes with it is ignored.
#[test]
fn a_run_that_cannot_write_on_says_so_and_resumes() {
    let inputs = Inputs::new();
    let more = ["--output-format", "las", "--threads", "2"];
    let undisturbed = inputs.undisturbed("sweep.laz", &more);
    let out = inputs.path("limited");
    // In 512-byte blocks: the positions do not fit. Then the columns fit, but not the labelled copy (2.4 MB).
    for blocks in [100, 1_000, 3_000] {
        let command = run_command(&inputs.list("sweep.laz"), &out, &options(&more));
        let limited = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
        let output = Command::new("sh")
            .args(["-c", &limited])
            .arg(command.get_program())
            .args(command.get_args())
            .output()
            .expect("a shell");
        let (code, errors) = ended(&output);
        assert_eq!(code, 5, "{blocks} blocks: {errors}");
        assert!(errors.contains("error: cannot ") && errors.contains("caused by: "), "{errors}");
        assert!(!out.join("sweep.las").exists(), "a copy that is not complete has its name");
    }
    run_to_the_end(&inputs.list("sweep.laz"), &out, &options(&more));
    assert_same_outputs(&undisturbed, &out, "after the limit");
}

/// A small file system in memory, if the system allows one.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(path: PathBuf, kib: u32) -> Option<Self> {
        std::fs::create_dir_all(&path).expect("a folder");
        let mounted = shell(&format!("mount -t tmpfs -o size={kib}k tmpfs '{}'", path.display()));
        mounted.then_some(Self(path))
    }

    fn resize(&self, kib: u32) {
        assert!(shell(&format!("mount -o remount,size={kib}k '{}'", self.0.display())), "resized");
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        shell(&format!("umount '{}'", self.0.display()));
    }
}

#[test]
fn a_full_disk_ends_the_run_with_a_hint_and_room_lets_it_resume() {
    let inputs = Inputs::new();
    let Some(disk) = SmallDisk::mount(inputs.path("disk"), 800) else {
        return skipped("a full disk (no right to mount a small file system)");
    };
    let more = ["--output-format", "las"];
    let undisturbed = inputs.undisturbed("sweep.laz", &more);
    let out = disk.0.join("out");
    for kib in [800, 1_300, 2_600] {
        disk.resize(kib);
        let output = run_command(&inputs.list("sweep.laz"), &out, &options(&more)).output().expect("starts");
        let (code, errors) = ended(&output);
        assert_eq!(code, 5, "{kib} KiB: {errors}");
        assert!(errors.contains("hint: free some space and type the same command again"), "{errors}");
    }
    disk.resize(64 << 10);
    let before = events(&out);
    run_to_the_end(&inputs.list("sweep.laz"), &out, &options(&more));
    let after = &events(&out)[before.len()..];
    assert_eq!(finished(after, "ground"), 0, "the ground had been done");
    assert_same_outputs(&undisturbed, &out, "after the disk was full");
}

#[test]
fn ctrl_c_ends_with_130_and_the_same_command_resumes() {
    let inputs = Inputs::new();
    let more = ["--threads", "1", "--tile-length", "1", "--set", "tiling.cell=0.5"];
    let run = |out: &Path| {
        let mut command = run_command(&inputs.list("sweep.laz"), out, &more);
        command.spawn().expect("starts")
    };
    let out = inputs.path("interrupted");
    let child = run(&out);
    wait_until("a tile of the ground pass", || finished(&events(&out), "ground") > 0);
    assert!(shell(&format!("kill -INT {}", child.id())));
    let (code, errors) = ended(&child.wait_with_output().expect("ended"));
    assert_eq!(code, 130, "{errors}");
    assert!(
        errors.contains("error: interrupted with ") && errors.contains("hint: the same command resumes"),
        "{errors}"
    );
    let done = finished(&events(&out), "ground");
    let undisturbed = inputs.path("undisturbed");
    run_to_the_end(&inputs.list("sweep.laz"), &undisturbed, &more);
    run_to_the_end(&inputs.list("sweep.laz"), &out, &more);
    let all = finished(&events(&undisturbed), "ground");
    assert!(done < all, "all {all} tiles were done before the signal came");
    assert_eq!(finished(&events(&out), "ground"), all, "tiles were done twice, or not at all");
    assert_same_outputs(&undisturbed, &out, "after Ctrl-C");
}

/// A shell that executes `before` and then starts the program.
fn in_shell(before: &str, inputs: &[PathBuf], out: &Path, more: &[&str]) -> Command {
    let run = run_command(inputs, out, more);
    let mut command = Command::new("sh");
    command.args(["-c", &format!("{before}; exec \"$@\""), "sh"]).arg(run.get_program()).args(run.get_args());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// `nohup` makes the program ignore the end of the session.
#[cfg(target_os = "linux")]
#[test]
fn the_end_of_the_session_is_ignored_below_nohup() {
    let inputs = Inputs::new();
    let more = ["--threads", "1", "--tile-length", "1", "--set", "tiling.cell=0.5"];
    let out = inputs.path("hung-up");
    let child = in_shell("trap '' HUP", &inputs.list("sweep.laz"), &out, &more).spawn().expect("starts");
    wait_until("a tile of the ground pass", || finished(&events(&out), "ground") > 0);
    assert!(shell(&format!("kill -HUP {}", child.id())));
    let (code, errors) = ended(&child.wait_with_output().expect("ended"));
    assert_eq!(code, 0, "{errors}");
}

#[test]
fn a_file_above_the_limit_of_its_size_is_an_error_with_its_path() {
    let inputs = Inputs::new();
    let undisturbed = inputs.undisturbed("street.las", &[]);
    let out = inputs.path("limited");
    let output = in_shell("ulimit -f 10", &inputs.list("street.las"), &out, &options(&[])).output();
    let (code, errors) = ended(&output.expect("starts"));
    assert_eq!(code, 5, "{errors}");
    assert!(errors.contains("cannot write") && errors.contains("limited/"), "{errors}");
    run_to_the_end(&inputs.list("street.las"), &out, &options(&[]));
    assert_same_outputs(&undisturbed, &out, "after the limit");
}

#[test]
fn nothing_foreign_is_overwritten_and_no_input_is_at_risk() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    std::fs::create_dir(&out).expect("a folder");
    std::fs::write(out.join("sweep.laz"), b"mine").expect("written");
    refused(
        &inputs.list("sweep.laz"),
        &out,
        &[],
        5,
        &["out/sweep.laz would be overwritten", "hint: choose another output"],
    );
    assert_eq!(std::fs::read(out.join("sweep.laz")).expect("still there"), b"mine");
    let linked = inputs.path("linked");
    std::fs::create_dir(&linked).expect("a folder");
    std::os::unix::fs::symlink("/nowhere", linked.join("objects.csv")).expect("a link");
    refused(&inputs.list("sweep.laz"), &linked, &[], 5, &["linked/objects.csv would be overwritten"]);
    assert!(linked.join("objects.csv").is_symlink());
    for table in ["objects.csv", "objects.geojson", "report.json", "report.html"] {
        let out = inputs.path(&format!("out-{table}"));
        std::fs::create_dir(&out).expect("a folder");
        std::fs::write(out.join(table), b"mine").expect("written");
        refused(&inputs.list("sweep.laz"), &out, &[], 5, &[table, "would be overwritten"]);
        assert_eq!(std::fs::read(out.join(table)).expect("still there"), b"mine");
    }
    refused(&inputs.list("sweep.laz"), inputs.folder.path(), &[], 5, &["sweep.laz would be overwritten"]);
    assert!(!inputs.path(".chainage").exists(), "state was begun beside the input");
    // A link to the folder of the input counts as this folder.
    std::os::unix::fs::symlink(inputs.folder.path(), inputs.path("link")).expect("a link");
    refused(&inputs.list("sweep.laz"), &inputs.path("link"), &[], 5, &["would be overwritten"]);
}

#[test]
fn outputs_that_were_removed_or_cut_are_written_again() {
    let inputs = Inputs::new();
    for name in ["sweep.laz", "street.las"] {
        let out = inputs.undisturbed(name, &[]);
        let bytes = outputs(&out);
        for (file, _) in &bytes {
            std::fs::remove_file(out.join(file)).expect("removed");
            run_to_the_end(&inputs.list(name), &out, &options(&[]));
            assert!(outputs(&out) == bytes, "{file} was removed");
            std::fs::File::options()
                .write(true)
                .open(out.join(file))
                .expect("the file")
                .set_len(2)
                .expect("cut");
            run_to_the_end(&inputs.list(name), &out, &options(&[]));
            assert!(outputs(&out) == bytes, "{file} was cut");
        }
        // The report contains times, and is written last. A run that is killed before that is not finished.
        let report = || -> serde_json::Value {
            serde_json::from_slice(&std::fs::read(out.join("report.json")).expect("the report"))
                .expect("JSON")
        };
        let objects = report()["result"]["objects"].clone();
        std::fs::remove_file(out.join("report.json")).expect("removed");
        run_to_the_end(&inputs.list(name), &out, &options(&[]));
        assert_eq!((&report()["result"]["objects"], outputs(&out) == bytes), (&objects, true));
    }
}

/// A street whose records are in a random order, so that each block has records of all tiles.
fn shuffled_street(path: &Path) {
    let mut points = street().points();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for last in (1..points.len()).rev() {
        points.swap(last, random.random_range(0..=last));
    }
    Shape::default().write(path, &points);
}

#[test]
fn a_drive_with_more_tiles_than_a_process_may_open_files_is_finished() {
    let folder = scratch();
    let path = folder.path().join("street.las");
    shuffled_street(&path);
    let out = folder.path().join("out");
    let limited = |files: u32| {
        let run = run_command(std::slice::from_ref(&path), &out, &["--tile-length", "1", "--threads", "2"]);
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -n {files}; exec \"$@\""), "sh"]);
        let output = shell.arg(run.get_program()).args(run.get_args()).output().expect("starts");
        ended(&output)
    };
    let (code, errors) = limited(8);
    assert!(code != 0 && errors.contains("hint: raise the hard limit of open files"), "{code} {errors}");
    let (code, errors) = limited(48);
    assert_eq!(code, 0, "{errors}");
    let tiles = finished(&events(&out), "ground");
    assert!(tiles > 48, "{tiles} tiles");
}

/// A setting of another method changes no output, so the second call finds all of them complete.
#[test]
fn the_report_has_the_settings_of_the_last_call_although_nothing_was_to_do() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let list = inputs.list("street.las");
    let method = ["--method", "euclidean"];
    run_to_the_end(&list, &out, &options(&[&method[..], &["--set", "street.min_points=33"]].concat()));
    let page = || std::fs::read_to_string(out.join("report.html")).expect("a page");
    let settings = || {
        let report = std::fs::read(out.join("report.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        (report["configuration"]["street"]["min_points"].clone(), report["result"]["seconds"].clone())
    };
    let before = settings();
    assert_eq!(before.0, 33);
    assert!(page().contains("\"min_points\":33"), "the page has the settings");
    let all = outputs(&out);
    for _ in 0..2 {
        run_to_the_end(&list, &out, &options(&method));
        assert_eq!(settings(), (20.into(), before.1.clone()));
        assert!(!page().contains("\"min_points\":33"), "the page has those of the call before");
    }
    assert!(outputs(&out) == all, "other outputs have changed");
    let log = events(&out);
    assert_eq!(finished(&log, "export"), 1, "the copy was written again");
}
