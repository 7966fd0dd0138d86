//! The arguments that `info`, `plan` and `run` share: a drive and its settings.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use chainage::config::Config;

/// A drive.
#[derive(Debug, clap::Args)]
pub(crate) struct Inputs {
    /// LAS or LAZ files, folders (their *.las and *.laz), or patterns like 'drive/*.laz'
    #[arg(required = true, value_name = "FILES")]
    pub(crate) files: Vec<PathBuf>,
}

/// Settings, from the coarsest to the finest: configuration file, --set, flags of their own.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings")]
pub(crate) struct Settings {
    /// Configuration file; needs to hold only what differs from `chainage config`
    #[arg(short = 'c', long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Set any key, for example --set euclidean.d_t=0.4; may be repeated
    #[arg(long = "set", value_name = "SECTION.KEY=VALUE")]
    pub(crate) assignments: Vec<String>,
    /// Clustering method [default: euclidean]
    #[arg(long, value_name = "NAME")]
    pub(crate) method: Option<String>,
    /// Ground filter [default: voxel-column]
    #[arg(long, value_name = "NAME")]
    pub(crate) ground: Option<String>,
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Memory for the points in flight, for example 800M or 4G [default: half of what is free]
    #[arg(long, value_name = "SIZE", value_parser = mebibytes)]
    pub(crate) memory: Option<u64>,
    /// Length of a tile in metres of chainage [default: as long as the memory allows]
    #[arg(long, value_name = "METRES")]
    pub(crate) tile_length: Option<f64>,
    /// Trajectory as CSV with the columns gps_time,x,y,z [default: from GPS time, else the principal axis]
    #[arg(long, value_name = "FILE")]
    pub(crate) trajectory: Option<PathBuf>,
    /// Read files instead of mapping them: for network drives that may lose files during the run
    #[arg(long)]
    pub(crate) no_mmap: bool,
}

impl Settings {
    /// The configuration: defaults, file, --set, flags.
    pub(crate) fn resolve(&self, extra: &[(&str, String)]) -> chainage::Result<Config> {
        self.resolve_over(self.config.as_deref(), extra)
    }

    /// The settings as arguments of another call of the program, without the flags named in `but`.
    pub(crate) fn as_arguments(&self, but: &[&str]) -> Vec<OsString> {
        let mut arguments = Vec::new();
        let mut add = |flag: &str, value: Option<OsString>| {
            if let (Some(value), false) = (value, but.contains(&flag)) {
                arguments.push(OsString::from(format!("--{flag}")));
                arguments.push(value);
            }
        };
        let text = |value: &Option<String>| value.as_ref().map(OsString::from);
        add("config", self.config.clone().map(PathBuf::into_os_string));
        for assignment in &self.assignments {
            add("set", Some(assignment.into()));
        }
        add("method", text(&self.method));
        add("ground", text(&self.ground));
        add("threads", self.threads.map(|count| count.to_string().into()));
        add("memory", self.memory.map(|mib| format!("{mib}M").into()));
        add("tile-length", self.tile_length.map(|metres| metres.to_string().into()));
        add("trajectory", self.trajectory.clone().map(PathBuf::into_os_string));
        if self.no_mmap {
            arguments.push("--no-mmap".into());
        }
        arguments
    }

    /// The configuration with another file.
    pub(crate) fn resolve_over(
        &self,
        file: Option<&Path>,
        extra: &[(&str, String)],
    ) -> chainage::Result<Config> {
        let mut assignments = self.assignments.clone();
        let mut set = |key: &str, value: Option<String>| {
            assignments.extend(value.map(|value| format!("{key}={value}")));
        };
        let quoted = |path: &PathBuf| format!("{:?}", path.display().to_string());
        set("cluster.method", self.method.clone().map(|name| format!("{name:?}")));
        set("ground.method", self.ground.clone().map(|name| format!("{name:?}")));
        set("run.threads", self.threads.map(|count| count.to_string()));
        set("run.memory_mib", self.memory.map(|mib| mib.to_string()));
        set("tiling.tile_length", self.tile_length.map(|metres| metres.to_string()));
        set("axis.trajectory", self.trajectory.as_ref().map(quoted));
        set("input.mmap", self.no_mmap.then(|| "false".to_owned()));
        for (key, value) in extra {
            set(key, Some(value.clone()));
        }
        Ok(Config::resolve(file, &assignments)?)
    }
}

/// A size like 800M, 4G or 512 (MiB) in MiB.
fn mebibytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = text[digits.len()..].to_ascii_uppercase();
    let factor = match unit.as_str() {
        "" | "M" | "MB" | "MIB" => 1.0,
        "G" | "GB" | "GIB" => 1024.0,
        _ => return Err(format!("{text} is not a size like 800M or 4G")),
    };
    let number: f64 = digits.parse().map_err(|_| format!("{text} is not a size like 800M or 4G"))?;
    let mib = number * factor;
    if !(16.0..=1e9).contains(&mib) {
        return Err(format!("{text} is {mib} MiB, at least 16 MiB are needed"));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
    let whole = mib as u64;
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_in_mebibytes() {
        for (text, mib) in [("800M", 800), ("4G", 4096), ("0.5GiB", 512), ("64", 64)] {
            assert_eq!(mebibytes(text), Ok(mib), "{text}");
        }
        for text in ["4T", "1M", "lots", "-3G"] {
            assert!(mebibytes(text).is_err(), "{text}");
        }
    }
}
