//! `chainage synth`: arguments, units, and the progress line. The library generates the drive.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "shares and counts that were checked or are shown only"
)]

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use chainage::run::CancelToken;
use chainage::synth::{Preset, Scanner, Sensor, Settings, Summary, generate};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::exit::Outcome;
use crate::cli::numbers::whole;
use crate::cli::progress::{Quiet, time};
use crate::cli::quantities::{count, length, rate, seconds};
use crate::cli::{exit, interrupt, print};

/// Generate a labelled synthetic drive: a street, a vehicle, and a scanner. Every pulse of the scanner is
/// traced.
///
/// The files in OUT are PRESET_0001.laz ... (LAS 1.4, point format 6, extra bytes gt_instance and gt_class),
/// reference.csv with one row per object, trajectory.csv and scene.json. The same preset, settings and seed
/// give the same bytes, for any number of threads. Memory does not depend on the length.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  chainage synth downtown -o demo --length 500m\n  \
                        chainage synth mixed -o big --points 200M --files-every 60s --seed 7\n  \
                        chainage synth downtown -o sweep --scanner spinning-64 --sweeps 1")]
pub(crate) struct SynthArgs {
    /// Kind of street
    #[arg(value_enum, value_name = "PRESET")]
    preset: PresetArg,

    /// Output folder; must be empty or missing
    #[arg(short, long, value_name = "OUT", value_parser = print::folder())]
    out: PathBuf,

    /// Length of the drive, for example 500m or 5km; with --points or --sweeps, the first limit that is
    /// reached ends the drive [default: 1km; loop: 1500m, at least 1100m]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true, help_heading = "Drive")]
    length: Option<f64>,

    /// Number of points, for example 500k, 2M or 1.5G; the drive ends there (loop: approximately)
    #[arg(long, value_name = "COUNT", value_parser = count, allow_hyphen_values = true, help_heading = "Drive")]
    points: Option<u64>,

    /// Number of rotations of a spinning scanner; the drive ends there
    #[arg(long, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX, 10), help_heading = "Drive")]
    sweeps: Option<u64>,

    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>(0..=u64::MAX, 7), help_heading = "Drive")]
    seed: u64,

    /// Lowest and highest speed in km/h
    #[arg(long, value_name = "LOW-HIGH", default_value = "30-60", value_parser = speeds, allow_hyphen_values = true, help_heading = "Drive")]
    speed: (f64, f64),

    /// Scanner; the options below override its figures
    #[arg(long, value_enum, value_name = "NAME", default_value = "profiler", help_heading = "Scanner")]
    scanner: SensorArg,

    /// Number of profile heads, 1 or 2 [default: 2]
    #[arg(long, value_name = "N", value_parser = whole::<u8>(1..=2, 2), help_heading = "Scanner")]
    heads: Option<u8>,

    /// Pulses per second of one head, all beams together, for example 550kHz or 300k [default: profiler
    /// 550kHz; spinning 289kHz (16), 694kHz (32), 1333kHz (64), 1152kHz (64-wide)]
    #[arg(long, value_name = "RATE", value_parser = rate, allow_hyphen_values = true, help_heading = "Scanner")]
    pulse_rate: Option<f64>,

    /// Profiles or rotations per second of one head; the pulse rate divided by this is the number of pulses
    /// in each [default: profiler 200Hz; spinning 10Hz]
    #[arg(long, value_name = "RATE", value_parser = rate, allow_hyphen_values = true, help_heading = "Scanner")]
    profiles: Option<f64>,

    /// Largest measured range [default: 100m; spinning-64 and 64-wide 120m]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true, help_heading = "Scanner")]
    range: Option<f64>,

    /// Standard deviation of a measured range [default: profiler 5mm; spinning 2cm]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true, help_heading = "Scanner")]
    noise: Option<f64>,

    /// Standard deviation of the registered position of a sweep of a spinning scanner from its true position
    /// [default: 0]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true, help_heading = "Scanner")]
    drift: Option<f64>,

    /// Start a new file after this time, for example 60s or 2min [default: one file]
    #[arg(long, value_name = "TIME", value_parser = seconds, allow_hyphen_values = true, help_heading = "Files")]
    files_every: Option<f64>,

    /// Write LAZ (the default)
    #[arg(long, conflicts_with = "las", help_heading = "Files")]
    laz: bool,

    /// Write LAS: seven times as large as LAZ, about a fifth faster
    #[arg(long, help_heading = "Files")]
    las: bool,

    /// Worker threads; 0: one per core
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<usize>(0..=1_024, 2), help_heading = "Files")]
    threads: usize,

    #[command(flatten)]
    show: Quiet,
}

/// [`Preset`] on the command line.
#[derive(Debug, Clone, Copy)]
struct PresetArg(Preset);

impl ValueEnum for PresetArg {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<PresetArg>> = LazyLock::new(|| Preset::ALL.map(PresetArg).to_vec());
        &ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        let help = match self.0 {
            Preset::Suburb => "houses, gardens, two tree rows, poles in the crowns, overhead wires",
            Preset::Downtown => "facades with shops and balconies, parked cars, signals, passers-by",
            Preset::Avenue => "palms in the median, street trees whose crowns touch, hedges",
            Preset::Highway => "two carriageways, guard rails, gantries, overpasses, slopes",
            Preset::Mixed => "350 m of each of the four above in turn",
            Preset::Loop => "a suburb whose first 300 m are driven again in the other direction",
            Preset::Parkway => "rows of small trees of many shapes close together, hedges, rails, buildings",
            Preset::Lane => "a narrow street between houses, cars that park close to their walls",
            Preset::Forest => "a track through a forest: rows of timber, trees of many kinds, undergrowth",
            Preset::Boulevard => "two dense rows of trees on each side, crowns that grow into each other",
            Preset::Promenade => {
                "small trees with lamps, signals, masts and signs of many kinds between them"
            }
        };
        Some(clap::builder::PossibleValue::new(self.0.name()).help(help))
    }
}

/// [`Sensor`] on the command line.
#[derive(Debug, Clone, Copy)]
struct SensorArg(Sensor);

impl ValueEnum for SensorArg {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<SensorArg>> = LazyLock::new(|| Sensor::ALL.map(SensorArg).to_vec());
        &ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        let help = match self.0 {
            Sensor::Profiler => "two profile heads of a survey vehicle",
            Sensor::Spinning16 => "16 beams from -15 to 15 degrees, 10 rotations per second",
            Sensor::Spinning32 => "32 beams from -30.7 to 10.7 degrees",
            Sensor::Spinning64 => "64 beams from -24.8 to 2 degrees: nothing high above the sensor",
            Sensor::Spinning64Wide => "64 beams from -25 to 15 degrees, most of them near the horizon",
        };
        Some(clap::builder::PossibleValue::new(self.0.name()).help(help))
    }
}

impl SynthArgs {
    /// Writes the drive; 0 when it is complete.
    pub(crate) fn run(&self) -> Outcome {
        let settings = self.settings();
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        let bar = if self.show.shows() { ProgressBar::new(1_000) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %{msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        let start = Instant::now();
        let mut show = |progress: Summary| {
            let elapsed = start.elapsed().as_secs_f64();
            let rate = progress.points as f64 / elapsed;
            let driven = settings.length_m.map_or(0.0, |length| progress.length_m / length);
            let share =
                settings.points.map_or(driven, |points| driven.max(progress.points as f64 / points as f64));
            bar.set_position((share * 1_000.0) as u64);
            let points = progress.points as f64 / 1e6;
            let driven = progress.length_m / 1_000.0;
            let mut text = format!(", {driven:.2} km, {points:.1} M points, {:.2} M points/s", rate / 1e6);
            if share > 0.0 {
                text.push_str(&format!(", {} left", time(elapsed * (1.0 - share).max(0.0) / share)));
            }
            bar.set_message(text);
            if cancel.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let summary = generate(&settings, &self.out, &mut show);
        bar.finish_and_clear();
        let summary = summary?;
        let seconds = start.elapsed().as_secs_f64();
        print::text(&format!(
            "{}: {} in {}, {}, {}, {seconds:.1} s, {:.2} M points/s\n",
            self.out.display(),
            print::counted(summary.points, "point"),
            print::counted(summary.files.into(), "file"),
            print::counted(summary.objects, "object"),
            driven(summary.length_m),
            summary.points as f64 / seconds / 1e6
        ))?;
        Ok(exit::DONE)
    }

    fn settings(&self) -> Settings {
        let mut settings = Settings::new(self.preset.0);
        if self.length.is_some() || self.points.is_some() || self.sweeps.is_some() {
            (settings.length_m, settings.points, settings.sweeps) = (self.length, self.points, self.sweeps);
        }
        settings.seed = self.seed;
        settings.speed_kmh = self.speed;
        let ready = Scanner::of(self.scanner.0);
        settings.scanner = Scanner {
            heads: self.heads.unwrap_or(ready.heads),
            pulse_rate_hz: self.pulse_rate.unwrap_or(ready.pulse_rate_hz),
            profiles_hz: self.profiles.unwrap_or(ready.profiles_hz),
            range_m: self.range.unwrap_or(ready.range_m),
            noise_m: self.noise.unwrap_or(ready.noise_m),
            drift_m: self.drift.unwrap_or(ready.drift_m),
            ..ready
        };
        settings.files_every_s = self.files_every;
        settings.compressed = self.laz || !self.las;
        settings.threads = self.threads;
        settings
    }
}

/// The driven length, in metres if it is short.
fn driven(metres: f64) -> String {
    if metres < 100.0 { format!("{metres:.1} m") } else { format!("{:.3} km", metres / 1_000.0) }
}

fn speeds(text: &str) -> Result<(f64, f64), String> {
    let numbers = text.trim_end_matches("km/h");
    let (low, high) = numbers.split_once('-').unwrap_or((numbers, numbers));
    let number = |part: &str| {
        part.trim().parse::<f64>().map_err(|_| "must be LOW-HIGH in km/h, for example 30-60".to_owned())
    };
    let (low, high) = (number(low)?, number(high)?);
    if high < low {
        return Err(format!("must ascend from the lowest to the highest speed: write {high}-{low}"));
    }
    Ok((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_of_speeds_has_a_unit() {
        assert_eq!(speeds("30-60km/h"), Ok((30.0, 60.0)));
        for text in ["fast", "-3", "30-60 mph"] {
            assert!(speeds(text).unwrap_err().contains("for example 30-60"), "{text}");
        }
        assert_eq!(
            speeds("60-30"),
            Err("must ascend from the lowest to the highest speed: write 30-60".to_owned())
        );
        assert_eq!((driven(0.42), driven(1_000.0)), ("0.4 m".to_owned(), "1.000 km".to_owned()));
    }
}
