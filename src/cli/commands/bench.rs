//! `chainage bench`: a run at one and at two threads, each in a process of its own, against the floors.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use chainage::config::{Config, ConfigError};
use chainage::run::{codec_floor, copy_floor, files_of};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::cli::commands::demo::{SAMPLE, SAMPLE_NAME};
use crate::cli::drive_args::Settings;
use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::whole;
use crate::cli::print::{self, JsonOutput};
use crate::cli::progress::{Quiet, time};
use crate::cli::{exit, scratch};

#[derive(Debug, clap::Args)]
pub(crate) struct BenchArgs {
    /// LAS or LAZ files, folders or patterns [default: the sample that is part of the program]
    #[arg(value_name = "FILES")]
    files: Vec<PathBuf>,
    /// Number of measurements; the medians are shown
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = whole::<u16>(1..=65_535, 3))]
    rounds: u16,
    /// Folder for the outputs, which are removed afterwards [default: the system's temporary folder]
    #[arg(long, value_name = "FOLDER")]
    scratch: Option<PathBuf>,
    #[command(flatten)]
    show: Quiet,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    settings: Settings,
}

/// Time, memory and output of one run in its own process.
struct Measured {
    seconds: f64,
    passes: Vec<(String, f64)>,
    peak_bytes: f64,
    points: f64,
    output_bytes: u64,
}

impl BenchArgs {
    pub(crate) fn run(&self) -> Outcome {
        let scratch = scratch::folder(self.scratch.as_deref(), "bench")?;
        let report = self.measure(scratch.path())?;
        self.json.show(&report, || page(&report))?;
        Ok(exit::DONE)
    }

    fn measure(&self, scratch: &Path) -> Result<Value, CliError> {
        let mut arguments = self.files.clone();
        if arguments.is_empty() {
            let sample = scratch.join(SAMPLE_NAME);
            std::fs::write(&sample, SAMPLE)
                .map_err(|source| CliError::Write { target: sample.display().to_string(), source })?;
            arguments.push(sample);
        }
        if let Some(threads) = self.settings.threads() {
            let expected = "left out: bench measures one and two threads";
            return Err(chainage::Error::from(ConfigError::value("--threads", threads, expected)).into());
        }
        let config = self.settings.resolve(&[])?;
        let files = files_of(&arguments, &config)?;
        let paths: Vec<PathBuf> = files.iter().map(|file| file.0.clone()).collect();
        let mut floors: Vec<(f64, f64)> = Vec::new();
        let mut runs: [Vec<Measured>; 2] = [Vec::new(), Vec::new()];
        let mut codecs: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        let input_bytes: u64 = files.iter().map(|file| file.1).sum();
        let mut output_bytes = input_bytes;
        let shown = self.shown();
        let begun = Instant::now();
        // An additional round comes first and is not counted: it brings the input into the page cache.
        for round in 0..=self.rounds {
            settle(&paths, output_bytes, scratch)?;
            let floor = copy_floor(&paths, output_bytes, scratch, false)?;
            settle(&paths, output_bytes, scratch)?;
            let durable = copy_floor(&paths, output_bytes, scratch, true)?;
            for (slot, threads) in [1, 2].into_iter().enumerate() {
                let done = 2 * u64::from(round) + slot as u64;
                shown.set_position(done);
                shown.set_message(place(self.rounds, done, begun.elapsed().as_secs_f64()));
                let codec = codec_floor(&paths, &config, threads)?;
                settle(&paths, output_bytes, scratch)?;
                let measured = self.one_run(&paths, scratch, threads)?;
                output_bytes = measured.output_bytes;
                if round > 0 {
                    codecs[slot].extend(codec);
                    runs[slot].push(measured);
                }
            }
            if round > 0 {
                floors.push((floor, durable));
            }
        }
        shown.finish_and_clear();
        Ok(self.report(&config, input_bytes, &floors, &runs, &codecs))
    }

    /// The progress bar of all runs, shown only on a terminal.
    fn shown(&self) -> ProgressBar {
        if !self.show.shows() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(2 * (u64::from(self.rounds) + 1));
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}") {
            bar.set_style(style);
        }
        bar.set_message(place(self.rounds, 0, 0.0));
        bar.enable_steady_tick(Duration::from_millis(250));
        bar
    }

    fn one_run(&self, paths: &[PathBuf], scratch: &Path, threads: usize) -> Result<Measured, CliError> {
        let out = scratch.join("out");
        let failed = |source| CliError::Write { target: out.display().to_string(), source };
        let program = std::env::current_exe().map_err(failed)?;
        let mut command = Command::new(program);
        command.arg("run").args(paths).arg("-o").arg(&out).args(["--json", "--progress", "none"]);
        command.arg("--threads").arg(threads.to_string());
        command.args(self.settings.as_arguments(&["threads"]));
        let output = command.output().map_err(failed)?;
        if !output.status.success() {
            return Err(failure(&output));
        }
        let summary: Value = serde_json::from_slice(&output.stdout)
            .map_err(|error| chainage::Error::bug(error.to_string()))?;
        let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        let passes = summary["passes"].as_array().map_or_else(Vec::new, |passes| {
            passes
                .iter()
                .map(|pass| (pass["pass"].as_str().unwrap_or("").to_owned(), number(&pass["seconds"])))
                .collect()
        });
        let mut output_bytes = 0;
        for entry in std::fs::read_dir(&out).map_err(failed)? {
            let facts = entry.and_then(|entry| entry.metadata()).map_err(failed)?;
            output_bytes += if facts.is_file() { facts.len() } else { 0 };
        }
        std::fs::remove_dir_all(&out).map_err(failed)?;
        Ok(Measured {
            seconds: number(&summary["seconds"]),
            passes,
            peak_bytes: number(&summary["peak_resident_bytes"]),
            points: number(&summary["points"]),
            output_bytes,
        })
    }

    fn report(
        &self,
        config: &Config,
        input_bytes: u64,
        floors: &[(f64, f64)],
        runs: &[Vec<Measured>; 2],
        codecs: &[Vec<f64>; 2],
    ) -> Value {
        let floor = median(floors.iter().map(|floor| floor.0));
        let durable = median(floors.iter().map(|floor| floor.1));
        let configurations: Vec<Value> = runs
            .iter()
            .enumerate()
            .map(|(slot, runs)| {
                let seconds = median(runs.iter().map(|run| run.seconds));
                let points = runs.first().map_or(0.0, |run| run.points);
                let passes: Vec<Value> = runs.first().map_or_else(Vec::new, |first| {
                    (0..first.passes.len())
                        .map(|pass| {
                            let seconds = median(runs.iter().map(|run| run.passes[pass].1));
                            json!({ "pass": first.passes[pass].0, "seconds": seconds, "ns_per_point": seconds / points * 1e9 })
                        })
                        .collect()
                });
                let codec = (!codecs[slot].is_empty()).then(|| median(codecs[slot].iter().copied()));
                json!({
                    "threads": slot + 1,
                    "seconds": seconds,
                    "seconds_min": runs.iter().map(|run| run.seconds).fold(f64::INFINITY, f64::min),
                    "seconds_max": runs.iter().map(|run| run.seconds).fold(0.0, f64::max),
                    "points_per_second": points / seconds,
                    "times_copy_floor": seconds / floor,
                    "times_durable_copy_floor": seconds / durable,
                    "codec_floor_seconds": codec,
                    "times_codec_floor": codec.map(|codec| seconds / codec),
                    "peak_resident_bytes": median(runs.iter().map(|run| run.peak_bytes)),
                    "passes": passes,
                })
            })
            .collect();
        let pairs = runs[0].iter().zip(&runs[1]).map(|(one, two)| one.seconds / two.seconds);
        json!({
            "program": format!("chainage {}", env!("CARGO_PKG_VERSION")),
            "cores": std::thread::available_parallelism().map_or(0, usize::from),
            "rounds": self.rounds,
            "method": config.cluster.method,
            "input_bytes": input_bytes,
            "output_bytes": runs[0].first().map_or(0, |run| run.output_bytes),
            "copy_floor_seconds": floor,
            "durable_copy_floor_seconds": durable,
            "speed_up_of_two_threads": median(pairs),
            "runs": configurations,
        })
    }
}

/// The failure of a run, as the run has reported it.
fn failure(run: &Output) -> CliError {
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    match run.status.code().and_then(|code| u8::try_from(code).ok()) {
        Some(code) => CliError::Run { code, text: said },
        // A signal, for example of a system without memory.
        None => CliError::Run {
            code: exit::BUG,
            text: format!("{said}error: the run ended with {}\n", run.status),
        },
    }
}

/// Which run is measured, and the time that is left, when `done` runs took `seconds`.
fn place(rounds: u16, done: u64, seconds: f64) -> String {
    let (round, threads) = (done / 2, print::counted(done % 2 + 1, "thread"));
    let mut text = match round {
        0 => format!("warm-up, {threads}"),
        _ => format!("round {round} of {rounds}, {threads}"),
    };
    if done > 0 {
        let runs = 2 * (u64::from(rounds) + 1);
        text.push_str(&format!(", {} left", time(seconds / done as f64 * (runs - done) as f64)));
    }
    text
}

/// Brings the machine into the same state before each measurement: nothing is left to be written back, and
/// the same amount of memory as the output takes was in use just before. A virtual machine gives unused
/// memory back to its host and pays for every page that it needs again: the same copy took 1.1 or 3.0 s.
fn settle(paths: &[PathBuf], output_bytes: u64, scratch: &Path) -> Result<(), CliError> {
    // Without `sync`, the figures only vary more.
    let _ = Command::new("sync").status();
    copy_floor(paths, output_bytes, scratch, false)?;
    let _ = Command::new("sync").status();
    Ok(())
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        length if length % 2 == 1 => sorted[length / 2],
        length => f64::midpoint(sorted[length / 2 - 1], sorted[length / 2]),
    }
}

fn page(report: &Value) -> String {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let mut text = format!(
        "  copy floor {:.3} s, {:.3} s with the output synced to disk ({:.1} MB in, {:.1} MB out), medians of {}\n",
        number(&report["copy_floor_seconds"]),
        number(&report["durable_copy_floor_seconds"]),
        number(&report["input_bytes"]) / 1e6,
        number(&report["output_bytes"]) / 1e6,
        print::counted(report["rounds"].as_u64().unwrap_or_default(), "round")
    );
    for run in report["runs"].as_array().into_iter().flatten() {
        text.push_str(&format!(
            "\n  {}: {:.2} s ({:.2} to {:.2}), {:.2} M points/s, {:.1} x copy floor ({:.1} x synced), peak {:.0} MiB\n",
            print::counted(run["threads"].as_u64().unwrap_or(0), "thread"),
            number(&run["seconds"]),
            number(&run["seconds_min"]),
            number(&run["seconds_max"]),
            number(&run["points_per_second"]) / 1e6,
            number(&run["times_copy_floor"]),
            number(&run["times_durable_copy_floor"]),
            number(&run["peak_resident_bytes"]) / f64::from(1 << 20)
        ));
        if let Some(times) = run["times_codec_floor"].as_f64() {
            text.push_str(&format!(
                "    {times:.2} x decoding and encoding alone ({:.2} s)\n",
                number(&run["codec_floor_seconds"])
            ));
        }
        for pass in run["passes"].as_array().into_iter().flatten() {
            text.push_str(&format!(
                "    {:<8} {:>8.3} s {:>7.1} ns/point\n",
                pass["pass"].as_str().unwrap_or(""),
                number(&pass["seconds"]),
                number(&pass["ns_per_point"])
            ));
        }
    }
    text.push_str(&format!(
        "\n  two threads are {:.2} times as fast as one\n",
        number(&report["speed_up_of_two_threads"])
    ));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_names_the_round_and_the_threads() {
        assert_eq!(place(3, 0, 0.0), "warm-up, 1 thread");
        assert_eq!(place(3, 1, 10.0), "warm-up, 2 threads, 70 s left");
        assert_eq!(place(3, 2, 20.0), "round 1 of 3, 1 thread, 60 s left");
        assert_eq!(place(3, 7, 70.0), "round 3 of 3, 2 threads, 10 s left");
    }
}
