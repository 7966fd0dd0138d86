//! `chainage train` on small synthetic drives: the same bytes however the drive is cut, and what it refuses.

use std::path::{Path, PathBuf};
use std::process::Output;

use chainage::run::{StreetModel, read_model};

use crate::util::las::{Point, Shape};
use crate::util::program::{ended, program};

/// A short labelled drive.
fn labelled(folder: &Path) -> PathBuf {
    synth(folder.join("drive"), &["downtown", "--length", "40m", "--pulse-rate", "25kHz", "--las"])
}

/// The same drive with its last record first.
fn reversed(drive: &Path, folder: &Path) -> PathBuf {
    let other = folder.join("reversed").join(drive.file_name().expect("a name"));
    std::fs::create_dir_all(&other).expect("a folder");
    let mut bytes = std::fs::read(drive.join("downtown_0001.las")).expect("the points");
    let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four")) as usize;
    let record_len = usize::from(u16::from_le_bytes([bytes[105], bytes[106]]));
    let count = usize::try_from(u64::from_le_bytes(bytes[247..255].try_into().expect("eight")));
    let end = start + count.expect("few") * record_len;
    let records: Vec<u8> = bytes[start..end].chunks(record_len).rev().flatten().copied().collect();
    bytes[start..end].copy_from_slice(&records);
    std::fs::write(other.join("downtown_0001.las"), bytes).expect("written");
    other
}

/// Sweeps of a spinning scanner. It sees far crowns and facades in pieces.
fn sweeps(folder: &Path) -> PathBuf {
    synth(folder.join("sweeps"), &["downtown", "--scanner", "spinning-64-wide", "--sweeps", "4"])
}

fn synth(drive: PathBuf, options: &[&str]) -> PathBuf {
    let made =
        program().arg("synth").args(options).args(["--seed", "3", "-o"]).arg(&drive).output().expect("runs");
    assert_eq!(ended(&made).0, 0, "{made:?}");
    drive
}

fn train(drive: &Path, model: &Path, options: &[&str]) -> Output {
    program()
        .args(["train", "--rounds", "4", "--samples", "100", "--progress", "none"])
        .arg(drive)
        .arg("-o")
        .arg(model)
        .arg("--scratch")
        .arg(model.with_extension("scratch"))
        .args(options)
        .output()
        .expect("runs")
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn tiles_and_threads_change_no_byte_and_the_model_scores_its_drive() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = labelled(folder.path());
    let card = folder.path().join("card.md");
    let mut models = Vec::new();
    for (number, options) in [
        &["--thin", "0.4", "--card", card.to_str().expect("text")][..],
        &["--thin", "0.4", "--tile-length", "7", "--threads", "3"],
        &["--seed", "1"],
        &[],
    ]
    .into_iter()
    .enumerate()
    {
        let path = folder.path().join(format!("{number}.model"));
        let output = train(&drive, &path, options);
        assert_eq!(ended(&output).0, 0, "{output:?}");
        let left = path.with_extension("scratch").read_dir().expect("the folder").count();
        assert_eq!(left, 0, "the state is removed");
        models.push(std::fs::read(path).expect("a model"));
    }
    assert!(models[0] == models[1], "tiles or threads change the model");
    let path = folder.path().join("reversed.model");
    let output = train(&reversed(&drive, folder.path()), &path, &["--thin", "0.4"]);
    assert_eq!(ended(&output).0, 0, "{output:?}");
    assert!(models[0] == std::fs::read(path).expect("a model"), "the order of records changes the model");
    assert!(models[2] != models[3] && models[0] != models[3], "seed and thinned copies change nothing");
    let StreetModel { shapes, context, objects, wholes } =
        read_model(&folder.path().join("0.model")).expect("a model");
    assert!(objects.is_none() && wholes.is_none());
    for (model, most) in [(shapes, 100), (context, 400)] {
        let sources = &model.about().trained_on;
        assert_eq!(sources.len(), 2);
        assert_eq!(sources[1].name, "drive, 0.4 of the points");
        assert!(sources.iter().all(|source| source.samples.iter().all(|&count| count <= most)));
        assert!(sources[0].samples[1] > 0 && sources[0].samples[4] > 0, "{sources:?}");
    }
    let card = std::fs::read_to_string(card).expect("a card");
    assert!(card.contains("| drive, 0.4 of the points |") && card.contains("| fence or hedge |"), "{card}");

    let score = |options: &[&str]| {
        let model = folder.path().join("0.model");
        let output =
            program().args(["train", "--model"]).arg(model).arg("--test").arg(&drive).args(options).output();
        let output = output.expect("runs");
        assert_eq!(ended(&output).0, 0, "{output:?}");
        String::from_utf8(output.stdout).expect("text")
    };
    let whole = score(&[]);
    assert!(whole.contains("voxels of drive"), "{whole}");
    assert_eq!(whole, score(&["--tile-length", "10"]));
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn a_second_call_adds_the_models_of_objects_whatever_the_tiles() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = labelled(folder.path());
    let voxels = folder.path().join("voxels.model");
    assert_eq!(ended(&train(&drive, &voxels, &[])).0, 0);
    let sweeps = sweeps(folder.path());
    let onto = ["--onto", voxels.to_str().expect("text"), "--thin", "0.5"];
    let mut models = Vec::new();
    for (number, options) in [&[][..], &["--tile-length", "7", "--threads", "3"]].into_iter().enumerate() {
        let path = folder.path().join(format!("{number}.model"));
        let output = train(&sweeps, &path, &[&onto, options].concat());
        let (code, text) = ended(&output);
        assert_eq!(code, 0, "{text}");
        let text = String::from_utf8(output.stdout).expect("text");
        assert!(text.contains("objects that were held out"), "{text}");
        assert!(text.contains("objects and pieces that were held out"), "{text}");
        models.push(std::fs::read(path).expect("a model"));
    }
    assert!(models[0] == models[1], "tiles or threads change the model");
    let before = read_model(&voxels).expect("a model");
    let model = read_model(&folder.path().join("0.model")).expect("a model");
    assert_eq!(model.shapes.checksum(), before.shapes.checksum());
    assert_eq!(model.context.checksum(), before.context.checksum());
    let objects = model.objects.as_ref().expect("a model of objects");
    let samples = &objects.about().samples;
    // Samples of both copies of the drive, without the held-out ones: trees and buildings among others.
    assert!(samples.iter().sum::<u64>() > 10 && samples[1] > 0 && samples[4] > 0, "{samples:?}");
    let wholes = model.wholes.as_ref().expect("a model of pieces");
    let counts = &wholes.about().samples;
    assert!(counts[0] > 10 && counts[1..].iter().sum::<u64>() > 2, "{counts:?}");
    assert_eq!(wholes.about().trained_on.len(), 2);
    assert_ne!(model.checksum(), before.checksum());

    // With denser points, all objects are whole, so there is nothing to distinguish.
    let names = folder.path().join("names.model");
    let denser =
        synth(folder.path().join("denser"), &["downtown", "--length", "40m", "--pulse-rate", "120kHz"]);
    assert_eq!(ended(&train(&denser, &names, &onto[..2])).0, 0);
    let names = read_model(&names).expect("a model");
    assert!(names.objects.is_some() && names.wholes.is_none());
}

#[test]
fn a_drive_without_classes_and_a_file_that_is_no_model_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let plain = folder.path().join("plain.las");
    Shape::default().write(&plain, &[Point::at([0, 0, 0]), Point::at([1_000, 0, 0])]);
    let (code, text) = ended(&train(&plain, &folder.path().join("m"), &[]));
    assert!(code == 4 && text.contains("gt_class"), "{code}: {text}");
    let output =
        program().args(["train", "--model"]).arg(&plain).arg("--test").arg(&plain).output().expect("runs");
    let (code, text) = ended(&output);
    assert!(code == 4 && text.contains("is not a model of chainage"), "{code}: {text}");
}

#[test]
fn a_run_takes_a_model_and_refuses_a_damaged_one_and_a_method_that_has_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = labelled(folder.path());
    let model = folder.path().join("my.model");
    assert_eq!(ended(&train(&drive, &model, &[])).0, 0);
    let run = |out: &str, options: &[&str]| {
        let mut run = program();
        run.arg("run").arg(&drive).arg("-o").arg(folder.path().join(out)).args(["--progress", "none"]);
        ended(&run.args(["--outputs", "csv"]).args(options).output().expect("runs"))
    };
    let path = model.to_str().expect("text");
    assert_eq!(run("flag", &["--model", path]).0, 0);
    assert_eq!(run("setting", &["--set", &format!("street.model={path:?}")]).0, 0);
    assert_eq!(run("built-in", &[]).0, 0);
    let table = |out: &str| std::fs::read(folder.path().join(out).join("objects.csv")).expect("a table");
    assert!(table("flag") == table("setting"), "the flag is the setting");
    assert!(table("flag") != table("built-in"), "four rounds of trees find what all rounds find");

    let (code, text) = run("other", &["--model", path, "--method", "euclidean"]);
    assert!(code == 3 && text.contains("--model") && text.contains("method euclidean"), "{code}: {text}");
    let mut bytes = std::fs::read(&model).expect("a model");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&model, bytes).expect("written");
    let (code, text) = run("damaged", &["--model", path]);
    assert!(code == 4 && text.contains("my.model") && text.contains("damaged"), "{code}: {text}");
    assert!(!folder.path().join("damaged/objects.csv").exists());
}

/// Ctrl-C while trees grow: learning ends after the round, and nothing is left.
#[test]
#[cfg(unix)]
#[ignore = "long; scripts/check.sh runs it"]
fn an_interrupted_training_ends_and_says_that_it_begins_anew() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().expect("a folder");
    let drive = labelled(folder.path());
    let model = folder.path().join("model");
    let scratch = folder.path().join("scratch");
    let mut child = program()
        .args(["train", "--rounds", "1000", "--progress", "plain"])
        .arg(&drive)
        .arg("-o")
        .arg(&model)
        .arg("--scratch")
        .arg(&scratch)
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.starts_with("learn shapes")), "it learns");
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(sent.success());
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().expect("ends").code(), Some(130), "{rest:?}");
    let has = |text: &str| rest.iter().any(|line| line.contains(text));
    assert!(
        has("error: interrupted in pass learn shapes")
            && has("hint: the same command starts from the beginning"),
        "{rest:?}"
    );
    assert!(!model.exists() && scratch.read_dir().expect("the folder").next().is_none());
}
