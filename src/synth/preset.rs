//! What the presets are made of: tables of widths, spacings and shares, and which table holds where along the street.

use std::fmt;

use super::axis::Terrain;
use super::axis::{CELL, LEAD};
use super::ground::{Section, Station};
use super::random::Random;

/// A kind of street.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// Houses with gardens, two tree rows, lamp posts and overhead wires between the crowns.
    Suburb,
    /// Facades with shops and balconies, parked cars, signals, passers-by.
    Downtown,
    /// Palms in the median, dense street trees whose crowns touch, hedges, lawns.
    Avenue,
    /// Two carriageways with guard rails, gantries, overpasses and slopes.
    Highway,
    /// Stretches of the others, each some hundred metres long.
    Mixed,
    /// A suburban drive that comes back over its first 300 m in the other direction.
    Loop,
}

impl Preset {
    /// All of them, in the order in which help lists them.
    pub const ALL: [Self; 6] =
        [Self::Suburb, Self::Downtown, Self::Avenue, Self::Highway, Self::Mixed, Self::Loop];

    /// Name on the command line and in file names.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Suburb => "suburb",
            Self::Downtown => "downtown",
            Self::Avenue => "avenue",
            Self::Highway => "highway",
            Self::Mixed => "mixed",
            Self::Loop => "loop",
        }
    }

    pub(super) fn terrain(self) -> Terrain {
        match self {
            Self::Suburb | Self::Mixed | Self::Loop => Terrain { bends: (0.45, 560.0), hills: (5.0, 800.0) },
            Self::Downtown => Terrain { bends: (0.18, 900.0), hills: (2.0, 900.0) },
            Self::Avenue => Terrain { bends: (0.22, 800.0), hills: (3.0, 900.0) },
            Self::Highway => Terrain { bends: (0.5, 2_400.0), hills: (10.0, 1_800.0) },
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A row of things along both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Kinds to choose from.
    pub(super) kinds: &'static [&'static str],
    /// Distance from the reference line outwards, metres.
    pub(super) out: f64,
    /// Line the row follows.
    pub(super) line: Line,
    /// Distance along the axis, metres, and how much of it is random.
    pub(super) every: f64,
    pub(super) jitter: f64,
    /// Share of the places that are taken.
    pub(super) share: f32,
}

/// A line of the cross-section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Line {
    /// The axis; a row there stands once, not on both sides.
    Axis,
    /// The middle between lanes and kerb, where cars are parked.
    Parking,
    Kerb,
    Walk,
}

/// Buildings along both sides; a lot is a whole fraction of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Buildings {
    pub(super) lots_per_cell: usize,
    pub(super) share: f32,
    pub(super) setback: (f32, f32),
    pub(super) floors: (u32, u32),
    /// Share of a lot's length that the front takes.
    pub(super) front: (f32, f32),
    pub(super) depth: f32,
    pub(super) house: bool,
}

/// One kind of street, all in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub(super) section: Section,
    pub(super) paved: bool,
    pub(super) buildings: Option<Buildings>,
    pub(super) rows: &'static [Row],
    pub(super) wires: bool,
    /// Share of cells with a zebra crossing and signals on a gantry.
    pub(super) crossing: f32,
    /// Share of cells with an overpass or gantry of signs.
    pub(super) overpass: f32,
    pub(super) bridge_every: Option<f64>,
}

const fn row(
    kinds: &'static [&'static str],
    line: Line,
    out: f64,
    every: f64,
    jitter: f64,
    share: f32,
) -> Row {
    Row { kinds, out, line, every, jitter, share }
}

const CARS: &[&str] = &["car_sedan", "car_hatch", "car_wagon", "car_suv", "car_van"];
const PEOPLE: &[&str] = &["person_walking", "person_standing"];
const STREET_TREES: &[&str] = &["tree_round", "tree_vase", "tree_beech", "tree_columnar", "tree_apple"];
const DENSE_TREES: &[&str] =
    &["tree_round", "tree_round", "tree_vase", "tree_vase", "tree_beech", "tree_birch"];

static SUBURB: Layout = Layout {
    section: Section {
        median: 0.0,
        lanes: 3.3,
        kerb: 5.5,
        verge: 7.4,
        walk: 9.2,
        kerb_height: 0.12,
        slopes: 1.2,
        lane: 3.3,
    },
    paved: false,
    buildings: Some(Buildings {
        lots_per_cell: 2,
        share: 0.85,
        setback: (5.0, 8.0),
        floors: (1, 3),
        front: (0.40, 0.62),
        depth: 9.0,
        house: true,
    }),
    rows: &[
        row(&["lamp"], Line::Kerb, 0.8, 32.0, 3.0, 1.0),
        row(STREET_TREES, Line::Kerb, 1.1, 9.0, 1.5, 0.9),
        row(&["hedge", "hedge", "fence", "fence", "wall"], Line::Walk, 0.5, 25.0, 0.0, 0.8),
        row(STREET_TREES, Line::Walk, 3.6, 21.0, 9.0, 0.7),
        row(&["bush"], Line::Walk, 2.2, 8.0, 6.0, 0.5),
        row(CARS, Line::Parking, 0.0, 5.2, 0.15, 0.25),
        row(&["sign"], Line::Kerb, 0.45, 45.0, 20.0, 0.8),
        row(&["hydrant", "box", "bin"], Line::Kerb, 0.7, 40.0, 30.0, 0.7),
        row(PEOPLE, Line::Walk, -0.9, 24.0, 20.0, 0.5),
    ],
    wires: true,
    crossing: 0.1,
    overpass: 0.0,
    bridge_every: Some(900.0),
};

static DOWNTOWN: Layout = Layout {
    section: Section {
        median: 0.0,
        lanes: 6.4,
        kerb: 8.7,
        verge: 10.0,
        walk: 13.0,
        kerb_height: 0.14,
        slopes: 0.0,
        lane: 3.2,
    },
    paved: true,
    buildings: Some(Buildings {
        lots_per_cell: 1,
        share: 0.93,
        setback: (0.1, 1.5),
        floors: (4, 9),
        front: (0.78, 0.98),
        depth: 16.0,
        house: false,
    }),
    rows: &[
        row(&["lamp"], Line::Kerb, 0.6, 26.0, 1.0, 1.0),
        row(STREET_TREES, Line::Kerb, 0.9, 8.5, 1.0, 0.72),
        row(CARS, Line::Parking, 0.0, 5.1, 0.1, 0.3),
        row(&["sign"], Line::Kerb, 0.4, 24.0, 10.0, 0.9),
        row(&["bollard"], Line::Kerb, 0.35, 9.0, 6.0, 0.5),
        row(&["bench", "bin", "box", "hydrant"], Line::Kerb, 1.7, 14.0, 8.0, 0.6),
        row(&["hedge", "bush", "bush"], Line::Kerb, 2.0, 30.0, 8.0, 0.4),
        row(PEOPLE, Line::Walk, -1.3, 11.0, 9.0, 0.5),
    ],
    wires: false,
    crossing: 0.35,
    overpass: 0.0,
    bridge_every: None,
};

static AVENUE: Layout = Layout {
    section: Section {
        median: 2.0,
        lanes: 8.6,
        kerb: 10.1,
        verge: 12.9,
        walk: 15.7,
        kerb_height: 0.14,
        slopes: 1.0,
        lane: 3.3,
    },
    paved: false,
    buildings: Some(Buildings {
        lots_per_cell: 1,
        share: 0.35,
        setback: (16.0, 24.0),
        floors: (3, 6),
        front: (0.5, 0.8),
        depth: 14.0,
        house: false,
    }),
    rows: &[
        row(&["lamp"], Line::Kerb, 0.7, 24.0, 0.8, 1.0),
        row(DENSE_TREES, Line::Kerb, 1.4, 5.6, 0.8, 0.97),
        row(&["tree_sago", "tree_sago", "tree_palm"], Line::Axis, 0.0, 4.2, 0.8, 0.85),
        row(DENSE_TREES, Line::Walk, 2.4, 7.5, 3.0, 0.85),
        row(&["hedge"], Line::Walk, 0.6, 25.0, 0.0, 0.75),
        row(&["bush"], Line::Walk, 6.0, 9.0, 8.0, 0.6),
        row(&["sign"], Line::Kerb, 0.4, 30.0, 12.0, 0.9),
        row(&["bench", "bin"], Line::Kerb, 3.2, 22.0, 12.0, 0.7),
        row(PEOPLE, Line::Walk, 5.0, 26.0, 24.0, 0.5),
        row(PEOPLE, Line::Kerb, 3.4, 15.0, 12.0, 0.6),
    ],
    wires: false,
    crossing: 0.15,
    overpass: 0.0,
    bridge_every: None,
};

static HIGHWAY: Layout = Layout {
    section: Section {
        median: 1.6,
        lanes: 9.1,
        kerb: 11.6,
        verge: 12.4,
        walk: 12.5,
        kerb_height: 0.0,
        slopes: 4.0,
        lane: 3.75,
    },
    paved: false,
    buildings: None,
    rows: &[
        row(&["rail"], Line::Axis, 0.0, 25.0, 0.0, 1.0),
        row(&["rail", "rail", "rail", "wall"], Line::Kerb, 0.6, 25.0, 0.0, 0.8),
        row(&["lamp_double"], Line::Axis, 0.9, 40.0, 0.0, 0.5),
        row(&["tree_conifer", "tree_beech", "tree_birch"], Line::Walk, 9.0, 8.0, 6.0, 0.6),
        row(&["tree_round", "tree_conifer"], Line::Walk, 17.0, 9.0, 7.0, 0.6),
        row(&["bush"], Line::Walk, 4.5, 7.0, 6.0, 0.5),
        row(&["sign"], Line::Kerb, 1.3, 50.0, 30.0, 0.7),
        row(&["bollard"], Line::Kerb, 0.25, 50.0, 0.0, 1.0),
        row(&["car_van", "car_sedan"], Line::Parking, 0.0, 120.0, 90.0, 0.25),
    ],
    wires: false,
    crossing: 0.0,
    overpass: 0.12,
    bridge_every: Some(700.0),
};

/// Cells in a row with one layout in the `mixed` preset: 350 m.
const STRETCH: usize = 7;
/// Half length of the dip under a bridge, metres, and its depth.
const DIP: (f64, f64) = (32.0, 5.5);

/// Which street there is at which chainage; a pure function of preset and seed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    pub(super) preset: Preset,
    pub(super) seed: u64,
}

impl Plan {
    /// The layout of a cell.
    pub(super) fn layout(&self, cell: usize) -> &'static Layout {
        match self.preset {
            Preset::Suburb | Preset::Loop => &SUBURB,
            Preset::Downtown => &DOWNTOWN,
            Preset::Avenue => &AVENUE,
            Preset::Highway => &HIGHWAY,
            Preset::Mixed => {
                let stretch = cell / STRETCH;
                // Every street of four stretches has each layout once, in an order of its own.
                let mut order = [&SUBURB, &DOWNTOWN, &AVENUE, &HIGHWAY];
                let mut random = Random::new(self.seed, 3, (stretch / 4) as u64);
                for last in (1..4).rev() {
                    order.swap(last, (random.next() % (last as u64 + 1)) as usize);
                }
                order[stretch % 4]
            }
        }
    }

    /// The section at chainage `s`: that of the cell, blended from that of the cell before it over the first half.
    fn section(&self, s: f64) -> Section {
        let cell = (s / CELL).max(0.0) as usize;
        let here = self.layout(cell).section;
        let before = self.layout(cell.saturating_sub(1)).section;
        before.between(&here, ((s - cell as f64 * CELL) / (CELL * 0.5)).clamp(0.0, 1.0))
    }

    /// Everything that shapes the ground at chainage `s`.
    pub(super) fn station(&self, s: f64) -> Station {
        let section = self.section(s);
        let dip = self.bridge(s).map_or(0.0, |off| DIP.1 * (1.0 - (off / DIP.0).powi(2)).max(0.0));
        let wave = |length: f64, phase: f64| (s / length + phase).sin();
        let phase = (self.seed % 1_000) as f64;
        let slope = |turn: f64| section.slopes * (wave(46.0, phase + turn) + 0.5 * wave(19.0, turn * 3.0));
        Station { section, dip, slopes: [slope(0.0), slope(2.1)] }
    }

    /// Distance along the axis to the middle of a bridge, if `s` is over its dip.
    pub(super) fn bridge(&self, s: f64) -> Option<f64> {
        let every = self.layout((s / CELL).max(0.0) as usize).bridge_every?;
        // The first bridge stands well within the drive.
        let off = (s - LEAD - every * 0.4 + every * 0.5).rem_euclid(every) - every * 0.5;
        (off.abs() < DIP.0).then_some(off)
    }
}
