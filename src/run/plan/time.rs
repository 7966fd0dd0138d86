//! The time that a run will probably take, from what its methods cost per point and from the speed of the
//! survey, which says how fast this machine reads these files.

use std::ops::RangeInclusive;

/// Processor time of the survey per point of LAS and of LAZ (mostly decoding), in microseconds, on the
/// machine of `benches/results` while other programs used it as well.
const SURVEY_LAS: f64 = 0.2;
const SURVEY_LAZ: f64 = 2.2;
/// Processor time per point of joining labels, measuring objects, copying records and sampling the page, in
/// microseconds.
const AFTER_OBJECTS: f64 = 2.0;
/// Processor time per point of encoding a compressed copy, in microseconds.
const ENCODING: f64 = 2.5;
/// Smallest number of points whose survey says anything about the machine. A shorter survey mostly waits for
/// threads and files.
const TELLING_POINTS: u64 = 200_000;
/// Factors by which other processors and disks differ from that machine. A slower survey waited for
/// something.
const FACTORS: RangeInclusive<f64> = 0.1..=20.0;
/// Factors between which a run may differ from its estimate. Chosen without a study of many machines.
const LOW: f64 = 0.6;
const HIGH: f64 = 1.7;

/// The work of a run, which determines its time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Work {
    /// Records of the drive, and records of its compressed files.
    pub(crate) records: u64,
    pub(crate) compressed: u64,
    /// Seconds of the survey.
    pub(crate) survey_s: f64,
    pub(crate) threads: usize,
    /// Points that the tiles read for the ground filter and for the method, halos included, and what these
    /// cost in microseconds per point.
    pub(crate) ground: (u64, f64),
    pub(crate) method: (u64, f64),
    /// Points that are labelled and copied, and how many of them are in compressed copies.
    pub(crate) copied: u64,
    pub(crate) copied_compressed: u64,
}

impl Work {
    /// Smallest and largest number of seconds to expect.
    pub(crate) fn seconds(&self) -> RangeInclusive<f64> {
        let threads = self.threads.max(1) as f64;
        let plain = self.records.saturating_sub(self.compressed);
        let usual = plain as f64 * SURVEY_LAS + self.compressed as f64 * SURVEY_LAZ;
        let factor = match self.records {
            ..TELLING_POINTS => 1.0,
            _ => (self.survey_s * 1e6 * threads / usual).clamp(*FACTORS.start(), *FACTORS.end()),
        };
        let decoded = self.copied_compressed as f64 * (SURVEY_LAZ + ENCODING);
        let passes =
            [self.ground, self.method].iter().map(|(points, cost)| *points as f64 * cost).sum::<f64>();
        let after = self.copied as f64 * AFTER_OBJECTS + decoded;
        let expected = self.survey_s + factor * (passes + after) / 1e6 / threads;
        expected * LOW..=expected * HIGH
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoding_halos_and_the_speed_of_the_survey_count() {
        let las = Work {
            records: 10_000_000,
            compressed: 0,
            survey_s: 1.0,
            threads: 2,
            ground: (10_000_000, 1.0),
            method: (10_000_000, 1.0),
            copied: 10_000_000,
            copied_compressed: 0,
        };
        // 1 s of survey, as on the reference machine; 2 us per point for the passes and 2 us after them, on
        // two threads.
        let expected = |work: Work| (work.seconds().start() / LOW, work.seconds().end() / HIGH);
        let about = |work: Work, seconds: f64| {
            let (low, high) = expected(work);
            assert!((low - seconds).abs() < 1e-9 && (high - seconds).abs() < 1e-9, "{low} {high} {seconds}");
        };
        about(las, 1.0 + 20.0);
        about(Work { survey_s: 2.0, ..las }, 2.0 + 40.0);
        about(Work { threads: 1, survey_s: 2.0, ..las }, 2.0 + 40.0);
        about(Work { ground: (30_000_000, 1.0), ..las }, 1.0 + 30.0);
        let laz = Work { compressed: las.records, copied_compressed: las.records, survey_s: 11.0, ..las };
        about(laz, 11.0 + 20.0 + 23.5);
        // A tiny drive is surveyed in the time that a thread takes to start.
        let tiny = Work { records: 1_000, ground: (1_000, 1.0), method: (0, 0.0), copied: 0, ..las };
        about(tiny, 1.0 + 0.0005);
    }
}
