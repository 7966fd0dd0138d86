//! Hoover's classes of detection at a tolerance T (Wang et al. 2019, section 4.1, doi:10.3390/s19010172;
//! Hoover et al. 1996, doi:10.1109/34.506791).
//!
//! The classes are tried in this order, and the first that applies counts:
//! * *correct*: a segment and the object overlap by at least T of both;
//! * *over*: two or more segments that each lie at least T in the object cover at least T of it together;
//! * *under*: a segment covers at least T of the object and of another one;
//! * *missed*: none of these.
//!
//! *Noise* is a segment without an object: it takes part in no correct detection and in no over- or
//! under-segmentation that counts (Hoover et al.). Sizes count all points, including the ground points of a
//! segment.
//!
//! At T > 0.5 a correct pair is unique. At T = 0.5 two objects can each be exactly half of one segment, and
//! two segments can each contain exactly half of one object. Then the pair is ambiguous. It is not correct,
//! and the next classes are tried for the object.

use std::fmt;
use std::str::FromStr;

use crate::config::ConfigError;
use crate::eval::metrics::overlaps::{Object, Overlap, Scene, Segment};

/// A tolerance of overlap, 0.5 to 1 in steps of 0.0001. It is an exact fraction, so that 80 of 100 points are
/// 0.8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tolerance {
    parts: u64,
}

impl Tolerance {
    /// Parts of the unit.
    const UNIT: u64 = 10_000;

    /// The tolerance nearest to `share`.
    ///
    /// # Errors
    /// [`ConfigError::Value`] when it is not within 0.5 and 1.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.5 to 1 was checked")]
    pub fn new(share: f64) -> Result<Self, ConfigError> {
        if (0.5..=1.0).contains(&share) {
            Ok(Self { parts: (share * Self::UNIT as f64).round() as u64 })
        } else {
            Err(ConfigError::value("hoover", share, "a share of overlap from 0.5 to 1"))
        }
    }

    /// Whether `part` is at least this share of `whole`.
    #[must_use]
    pub fn met(self, part: u64, whole: u64) -> bool {
        u128::from(part) * u128::from(Self::UNIT) >= u128::from(whole) * u128::from(self.parts)
    }

    /// The share.
    #[must_use]
    pub fn share(self) -> f64 {
        self.parts as f64 / Self::UNIT as f64
    }
}

impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{:.4}", self.share());
        let short = text.trim_end_matches('0');
        // At least two decimals: 0.80, 0.50, but 0.7525.
        f.write_str(if short.len() < 4 { &text[..4] } else { short })
    }
}

impl FromStr for Tolerance {
    type Err = ConfigError;

    fn from_str(text: &str) -> Result<Self, ConfigError> {
        let refused = || ConfigError::value("hoover", text, "a share of overlap from 0.5 to 1");
        text.trim().parse().map_err(|_| refused()).and_then(Self::new)
    }
}

/// Outcome of one object at one tolerance. Segments and objects are given by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detection {
    /// One segment and the object overlap.
    Correct {
        /// The segment.
        segment: usize,
    },
    /// Several segments together are the object.
    Over {
        /// Number of segments.
        segments: usize,
    },
    /// One segment covers this object and others.
    Under {
        /// The segment.
        segment: usize,
        /// Number of objects it covers, this one included.
        objects: usize,
    },
    /// None of these.
    Missed,
}

impl Detection {
    /// One word for tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Correct { .. } => "correct",
            Self::Over { .. } => "over",
            Self::Under { .. } => "under",
            Self::Missed => "missed",
        }
    }
}

/// The classes of all objects, and the segments that are noise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hoover {
    /// The tolerance.
    pub tolerance: Tolerance,
    /// Per object of the scene.
    pub objects: Vec<Detection>,
    /// Per segment of the scene: whether it is part of no detection.
    pub noise: Vec<bool>,
}

/// Judges every object and segment of the scene at a tolerance.
#[must_use]
pub fn judge(scene: &Scene, tolerance: Tolerance) -> Hoover {
    let mut noise = vec![true; scene.segments.len()];
    let rules = Rules { scene, tolerance, covered: covered(scene, tolerance) };
    let objects: Vec<Detection> = (0..scene.objects.len()).map(|index| rules.detect(index)).collect();
    for (object, detection) in scene.objects.iter().zip(&objects) {
        match *detection {
            Detection::Correct { segment } | Detection::Under { segment, .. } => noise[segment] = false,
            Detection::Over { .. } => rules.parts(object).for_each(|part| noise[part.index] = false),
            Detection::Missed => {}
        }
    }
    Hoover { tolerance, objects, noise }
}

struct Rules<'a> {
    scene: &'a Scene,
    tolerance: Tolerance,
    /// Per segment: number of objects of which it covers at least T.
    covered: Vec<usize>,
}

fn covered(scene: &Scene, tolerance: Tolerance) -> Vec<usize> {
    let covers = |overlap: &&Overlap| tolerance.met(overlap.points, scene.objects[overlap.index].points);
    scene.segments.iter().map(|segment| segment.overlaps.iter().filter(covers).count()).collect()
}

impl Rules<'_> {
    fn detect(&self, index: usize) -> Detection {
        let object = &self.scene.objects[index];
        if let Some(segment) = self.only_partner(object) {
            return Detection::Correct { segment };
        }
        let (segments, covered) =
            self.parts(object).fold((0, 0), |(count, points), part| (count + 1, points + part.points));
        if segments >= 2 && self.tolerance.met(covered, object.points) {
            return Detection::Over { segments };
        }
        let under = object
            .overlaps
            .iter()
            .take_while(|overlap| self.tolerance.met(overlap.points, object.points))
            .map(|overlap| (overlap.index, self.covered[overlap.index]))
            .find(|&(_, objects)| objects >= 2);
        match under {
            Some((segment, objects)) => Detection::Under { segment, objects },
            None => Detection::Missed,
        }
    }

    /// The one segment that overlaps the object by at least T of both. `None` if it overlaps another object
    /// in this way as well, or if another segment overlaps this object in this way.
    fn only_partner(&self, object: &Object) -> Option<usize> {
        let segment_of = |overlap: &Overlap| &self.scene.segments[overlap.index];
        // T is at least a half, so only the two largest overlaps on either side can reach T of both.
        let mut partners =
            object.overlaps.iter().take(2).filter(|part| self.mutual(part.points, object, segment_of(part)));
        let partner = partners.next().filter(|_| partners.next().is_none())?;
        let segment = segment_of(partner);
        let rivals = segment.overlaps.iter().take(2).filter(|other| {
            let rival = &self.scene.objects[other.index];
            self.mutual(other.points, rival, segment)
        });
        (rivals.count() == 1).then_some(partner.index)
    }

    fn mutual(&self, points: u64, object: &Object, segment: &Segment) -> bool {
        self.tolerance.met(points, object.points) && self.tolerance.met(points, segment.points)
    }

    /// The segments that lie in the object.
    fn parts<'o>(&'o self, object: &'o Object) -> impl Iterator<Item = &'o Overlap> {
        let inside =
            |part: &&Overlap| self.tolerance.met(part.points, self.scene.segments[part.index].points);
        object.overlaps.iter().filter(inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::metrics::overlaps::tests::scene_of;

    fn words(parts: &[(i64, i64, u64)], share: f64) -> (Vec<&'static str>, Vec<bool>) {
        let hoover = judge(&scene_of(parts, |_| 2), Tolerance::new(share).unwrap());
        (hoover.objects.iter().map(|detection| detection.word()).collect(), hoover.noise)
    }

    #[test]
    fn hand_made_cases() {
        for (what, share, parts, objects, noise) in [
            ("perfect", 0.8, vec![(1, 1, 50), (2, 2, 50)], vec!["correct"; 2], vec![false; 2]),
            ("swapped", 0.8, vec![(1, 2, 50), (2, 1, 50)], vec!["correct"; 2], vec![false; 2]),
            ("empty", 0.8, vec![(1, 0, 50), (2, 0, 50)], vec!["missed"; 2], vec![]),
            ("split", 0.8, vec![(1, 1, 60), (1, 2, 40)], vec!["over"], vec![false; 2]),
            ("split at 0.5", 0.5, vec![(1, 1, 60), (1, 2, 40)], vec!["correct"], vec![false, true]),
            ("halves at 0.5", 0.5, vec![(1, 1, 50), (1, 2, 50)], vec!["over"], vec![false; 2]),
            ("merged", 0.8, vec![(1, 1, 50), (2, 1, 50)], vec!["under"; 2], vec![false]),
            ("merged equals at 0.5", 0.5, vec![(1, 1, 50), (2, 1, 50)], vec!["under"; 2], vec![false]),
            ("merged at 0.5", 0.5, vec![(1, 1, 60), (2, 1, 40)], vec!["correct", "under"], vec![false]),
            // 80 of 100 is 0.8 of the object; 79 is not. One segment alone is not an over-segmentation.
            ("80 of 100", 0.8, vec![(1, 1, 80), (1, 0, 20)], vec!["correct"], vec![false]),
            ("79 of 100", 0.8, vec![(1, 1, 79), (1, 0, 21)], vec!["missed"], vec![true]),
            // 100 / 125 = 0.8 of the segment lies in the object, then 100 / 126.
            ("25 of ground", 0.8, vec![(1, 1, 100), (0, 1, 25)], vec!["correct"], vec![false]),
            ("26 of ground", 0.8, vec![(1, 1, 100), (0, 1, 26)], vec!["missed"], vec![true]),
            ("segment elsewhere", 0.8, vec![(1, 1, 50), (0, 2, 50)], vec!["correct"], vec![false, true]),
            // Three parts. Only 0.5 of one lies in the object; the other two cover 0.7 and 0.8.
            (
                "parts 0.7",
                0.8,
                vec![(1, 1, 40), (1, 2, 30), (1, 3, 30), (0, 3, 30)],
                vec!["missed"],
                vec![true; 3],
            ),
            (
                "parts 0.8",
                0.8,
                vec![(1, 1, 40), (1, 2, 40), (1, 3, 20), (0, 3, 20)],
                vec!["over"],
                vec![false, false, true],
            ),
        ] {
            assert_eq!(words(&parts, share), (objects, noise), "{what}");
        }
    }

    #[test]
    fn tolerances_are_exact_and_bounded() {
        let tolerance: Tolerance = "0.8".parse().unwrap();
        assert!(tolerance.met(28, 35) && !tolerance.met(27, 34));
        assert_eq!([tolerance.to_string(), Tolerance::new(0.7525).unwrap().to_string()], ["0.80", "0.7525"]);
        for text in ["0.49", "1.01", "NaN", "x", ""] {
            assert!(text.parse::<Tolerance>().is_err(), "{text}");
        }
    }
}
