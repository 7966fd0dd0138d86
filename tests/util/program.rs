//! The program itself: calling it, killing it, and reading its log.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The program, without progress bars.
pub(crate) fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_chainage"))
}

/// `chainage run` of these files with these options, silent. If the options name no method or no ground
/// filter, the fastest one is used, because most tests are about the engine.
pub(crate) fn run_command(inputs: &[PathBuf], out: &Path, options: &[&str]) -> Command {
    let mut command = program();
    command.arg("run").args(inputs).arg("-o").arg(out).args(["--progress", "none"]).args(options);
    for (option, setting, value) in
        [("--method", "cluster.method", "euclidean"), ("--ground", "ground.method", "voxel-column")]
    {
        let names = |word: &&str| ["--preset", "-c", option].contains(word) || word.starts_with(setting);
        if !options.iter().any(names) {
            command.args([option, value]);
        }
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The exit code, and the text on standard error.
pub(crate) fn ended(output: &Output) -> (i32, String) {
    (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Runs to the end and expects success.
pub(crate) fn run_to_the_end(inputs: &[PathBuf], out: &Path, options: &[&str]) {
    let output = run_command(inputs, out, options).output().expect("the program starts");
    let (code, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
}

/// Runs a shell command, and returns whether it succeeded.
pub(crate) fn shell(text: &str) -> bool {
    let outcome = Command::new("sh").args(["-c", text]).stderr(Stdio::null()).status();
    outcome.is_ok_and(|status| status.success())
}

/// The lines of the log of events.
pub(crate) fn events(out: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(out.join(".chainage/events.jsonl")).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// Finished units of a pass among events.
pub(crate) fn finished(events: &[serde_json::Value], pass: &str) -> usize {
    let is = |event: &&serde_json::Value| event["event"] == "unit-finished" && event["pass"] == pass;
    events.iter().filter(is).count()
}

/// Waits until `reached`, or reports that this did not happen.
pub(crate) fn wait_until(what: &str, reached: impl Fn() -> bool) {
    let began = Instant::now();
    while !reached() {
        assert!(began.elapsed() < Duration::from_secs(60), "waited a minute for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}
