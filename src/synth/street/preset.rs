//! The presets, and which of their tables (`presets.toml`) applies at which place of the street.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::axis::{CELL, LEAD, cell_at};
use super::section::Section;
use crate::synth::random::{Waves, sequence};
use crate::synth::scan::scanner::{Scanner, Sensor};
use crate::synth::shipped::shipped;

/// A kind of street.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Houses with gardens, two tree rows, lamp posts and overhead wires between the crowns.
    Suburb,
    /// Facades with shops and balconies, parked cars, signals, passers-by.
    Downtown,
    /// Palms in the median, street trees whose crowns touch, hedges, lawns.
    Avenue,
    /// Two carriageways with guard rails, gantries, overpasses and slopes.
    Highway,
    /// Stretches of the four above in turn, each some hundred metres long.
    Mixed,
    /// A suburban drive that returns over its first 300 m in the other direction.
    Loop,
    /// Rows of small trees of many shapes close together, hedges, rails, high buildings behind lawns.
    Parkway,
    /// A narrow street between houses, with cars that park close to their walls.
    Lane,
    /// A track through a forest: planted rows of timber, then trees of many kinds with undergrowth.
    Forest,
    /// Two rows of street trees on each side whose crowns grow into each other, with palms, hedges and lamps
    /// between them.
    Boulevard,
    /// Small trees of many shapes with lamps, signals, masts and signs of many kinds between them.
    Promenade,
}

impl Preset {
    /// All presets, in the order in which help lists them.
    pub const ALL: [Self; 11] = [
        Self::Suburb,
        Self::Downtown,
        Self::Avenue,
        Self::Highway,
        Self::Mixed,
        Self::Loop,
        Self::Parkway,
        Self::Lane,
        Self::Forest,
        Self::Boulevard,
        Self::Promenade,
    ];

    /// Name on the command line and in file names.
    #[must_use]
    pub fn name(self) -> &'static str {
        [
            "suburb",
            "downtown",
            "avenue",
            "highway",
            "mixed",
            "loop",
            "parkway",
            "lane",
            "forest",
            "boulevard",
            "promenade",
        ][self as usize]
    }
}

/// Properties of all things of a kind. The kind is the part of a name before the underscore.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Kind {
    /// Class code, as in the labelled scenes.
    pub(crate) class: u8,
    /// Distance kept from other things, metres: from its middle, or from the line along its span. `None` for
    /// things that hang, because others stand below them, and for buildings, which keep their distance by
    /// their lots.
    pub(crate) radius: Option<f64>,
    /// Range of the angle by which models are turned from facing away from the road, degrees.
    pub(crate) turn: (f64, f64),
    /// Relative variation of the width and the height of models.
    pub(crate) varies: f32,
    /// Span along the street, metres: the thing leads from one end of the span to the other in plan and
    /// height. 0 if it stands level.
    pub(crate) span: f64,
    /// Whether it must not stand on a bridge.
    pub(crate) rooted: bool,
}

/// A row of things along the street.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    /// Names to choose from.
    pub(crate) names: Vec<String>,
    /// The line of the cross-section along which it stands, as shares of the section's widths.
    #[serde(default)]
    at: Section,
    /// Distance from there outwards, metres.
    out: f64,
    /// Metres along the axis: the distance between the places, where they start, and the largest random
    /// shift.
    pub(crate) every: f64,
    #[serde(default)]
    pub(crate) from: f64,
    #[serde(default)]
    pub(crate) jitter: f64,
    /// Share of the places that are taken.
    pub(crate) share: f64,
    /// Number of successive places that are either all taken or all empty.
    pub(crate) together: Option<u64>,
    /// If these places form one object: share of its pieces that may be missing at its end. At least an
    /// opening is missing.
    pub(crate) joined: Option<f64>,
    /// Whether it stands on the left only.
    #[serde(default)]
    pub(crate) once: bool,
    /// Whether it stands on bridges only.
    #[serde(default)]
    pub(crate) bridge: bool,
    /// For buildings: how they stand on their lots.
    pub(crate) lot: Option<Lot>,
}

impl Row {
    /// Distance from the axis, metres.
    pub(crate) fn out(&self, section: &Section) -> f64 {
        along(&self.at, self.out, section)
    }
}

/// A lane in which things move along the street. It is on one side of the street: traffic keeps to the right.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Lane {
    /// Names to choose from.
    pub(crate) names: Vec<String>,
    /// The line along which they move, as for rows.
    at: Section,
    #[serde(default)]
    out: f64,
    /// Distance between the places along the axis, metres, and the largest random shift.
    pub(crate) every: f64,
    pub(crate) jitter: f64,
    /// Share of the places that are taken.
    pub(crate) share: f64,
    /// Range from which the speed of the lane is drawn; negative if against the direction of the drive.
    pub(crate) speed_kmh: (f64, f64),
}

impl Lane {
    /// Distance from the axis, metres.
    pub(crate) fn out(&self, section: &Section) -> f64 {
        along(&self.at, self.out, section)
    }
}

/// Distance of a line from the axis: shares of the widths of a section, and metres.
fn along(at: &Section, out: f64, section: &Section) -> f64 {
    out + at.widths().iter().zip(section.widths()).map(|(share, width)| share * width).sum::<f64>()
}

/// How buildings stand in the middle of their lots. A lot is as long as the places of its row are apart.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Lot {
    /// Largest distance of a front behind its row, metres.
    pub(crate) setback: f64,
    /// Share of a lot's length that the front takes.
    pub(crate) front: (f64, f64),
    pub(crate) depth: f64,
}

/// One kind of street, all in metres.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Layout {
    /// Amplitude and wavelength of the bends (radians; metres) and of the hills (metres).
    bends: (f64, f64),
    hills: (f64, f64),
    pub(crate) section: Section,
    /// Whether everything beside the road is paved, too.
    pub(crate) paved: bool,
    pub(crate) rows: Vec<Row>,
    #[serde(default)]
    traffic: Vec<Lane>,
    bridge_every: Option<f64>,
}

/// The tables of `presets.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tables {
    scanners: BTreeMap<Sensor, Scanner>,
    kinds: BTreeMap<String, Kind>,
    streets: BTreeMap<Preset, Layout>,
}

pub(crate) static TABLES: LazyLock<Tables> = LazyLock::new(|| shipped(include_str!("presets.toml")));

// This is here, because the module of the scanner does not use the tables.
impl Scanner {
    /// The ready-made scanner.
    #[must_use]
    pub fn of(sensor: Sensor) -> Self {
        TABLES.scanners[&sensor].clone()
    }
}

impl Default for Scanner {
    fn default() -> Self {
        Self::of(Sensor::Profiler)
    }
}

/// Properties of all things of a kind.
pub(crate) fn kind(name: &str) -> &'static Kind {
    &TABLES.kinds[name.split('_').next().unwrap_or(name)]
}

/// Number of successive cells with one layout in the `mixed` preset: 350 m.
const STRETCH: usize = 7;
/// Half of the length of the dip under a bridge, and its depth, metres.
const DIP: (f64, f64) = (32.0, 5.5);

/// The kind of street at every chainage; a pure function of preset and seed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plan {
    preset: Preset,
    pub(crate) seed: u64,
    pub(crate) bends: (f64, f64),
    /// Height of the land before anything was built on it.
    pub(crate) land: Waves<3>,
    /// Amplitude of the slopes beside the street, as a share of the section's amplitude.
    pub(crate) slopes: Waves<2>,
    /// The road is wet where this is above a limit.
    pub(crate) wet: Waves<3>,
}

impl Plan {
    pub(crate) fn new(preset: Preset, seed: u64) -> Self {
        // If streets change, the land is that of a suburb.
        let land = if matches!(preset, Preset::Mixed | Preset::Loop) { Preset::Suburb } else { preset };
        let Layout { bends, hills: (height, length), .. } = TABLES.streets[&land];
        let mut random = sequence(seed, 3, 0);
        let hills = [(1.0, 1.0), (0.35, 0.43), (0.1, 0.15)].map(|(a, l)| (a * height, l * length));
        let land = Waves::new(hills, &mut random);
        let slopes = Waves::new([(1.0, 290.0), (0.5, 120.0)], &mut random);
        let wet = Waves::new([(1.0, 7.0), (1.0, 4.3), (1.0, 31.0)], &mut random);
        Self { preset, seed, bends, land, slopes, wet }
    }

    /// The lanes of moving traffic. If streets change, the lanes are those of a suburb, because traffic
    /// continues from one street to the next. A loop has none: the vehicle drives in both lanes of its stem.
    pub(crate) fn traffic(&self) -> &'static [Lane] {
        match self.preset {
            Preset::Loop => &[],
            Preset::Mixed => &TABLES.streets[&Preset::Suburb].traffic,
            other => &TABLES.streets[&other].traffic,
        }
    }

    /// The layout of a cell.
    pub(crate) fn layout(&self, cell: usize) -> &'static Layout {
        let street = match self.preset {
            // The first four in turn. The seed chooses the first one.
            Preset::Mixed => Preset::ALL[(cell / STRETCH + (self.seed % 4) as usize) % 4],
            Preset::Loop => Preset::Suburb,
            other => other,
        };
        &TABLES.streets[&street]
    }

    /// The cross-section at chainage `s`: the one of the cell. In the first half of the cell, it is blended
    /// from the one of the previous cell.
    pub(crate) fn section(&self, s: f64) -> Section {
        let cell = cell_at(s);
        let [before, here] = [cell.saturating_sub(1), cell].map(|cell| &self.layout(cell).section);
        before.between(here, ((s / CELL - cell as f64) * 2.0).clamp(0.0, 1.0))
    }

    /// How far the land beside the pavement is below the pavement at chainage `s`, metres: 0 except near
    /// bridges.
    pub(crate) fn dip(&self, s: f64) -> f64 {
        // The first bridge stands well within the drive. In a loop it stands within the stem, which is driven
        // twice.
        let off = |every: f64| (s - LEAD + every * 0.3).rem_euclid(every) - every * 0.5;
        let off = self.layout(cell_at(s)).bridge_every.map_or(f64::INFINITY, off);
        DIP.1 * (1.0 - (off / DIP.0).powi(2)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::things;

    #[test]
    fn whatever_rows_name_has_models_and_is_of_a_kind() {
        let models = things::models(1);
        let rows = TABLES.streets.values().flat_map(|layout| &layout.rows).flat_map(|row| &row.names);
        let lanes = TABLES.streets.values().flat_map(|layout| &layout.traffic).flat_map(|lane| &lane.names);
        for name in rows.chain(lanes) {
            assert!(models.contains_key(name), "there is no model of {name}");
            assert!(kind(name).class > 1, "{name} is noise or ground");
        }
    }

    #[test]
    fn the_rates_of_the_default_are_those_of_the_data_sheet() {
        let scanner = Scanner::default();
        assert_eq!(scanner.pulses(), 2_750);
        assert!((scanner.time(2_750, 0) - 0.005).abs() < 1e-12);
    }

    #[test]
    fn every_sensor_has_as_many_beams_as_its_name_says_and_rotates_ten_times_a_second() {
        for (sensor, beams) in Sensor::ALL.into_iter().zip([1, 16, 32, 64, 64]) {
            let scanner = Scanner::of(sensor);
            assert_eq!(scanner.beams(), beams, "{sensor:?}");
            assert!(
                beams == 1 || !scanner.pulses().is_multiple_of(beams),
                "{sensor:?}: columns shift from sweep to sweep"
            );
            let elevations =
                scanner.spinning.as_ref().map(|spinning| spinning.elevations()).unwrap_or_default();
            assert!(elevations.windows(2).all(|pair| pair[0] < pair[1]), "{sensor:?}: {elevations:?}");
            assert!(beams == 1 || (scanner.time(scanner.pulses(), 0) - 0.1).abs() < 1e-4, "{sensor:?}");
        }
    }
}
