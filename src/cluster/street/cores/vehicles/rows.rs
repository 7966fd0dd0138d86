//! Rows of vehicles that touch: where one ends and the next begins. Vehicles side by side are in lanes, see
//! [`super::lanes`], and each lane is cut by itself.
//!
//! The profile of a row is the height of its top along it. Between two vehicles it falls below both roofs. A
//! row that is longer than a car is cut where its profile is lowest, if that is a valley, and both parts are
//! cut in the same way. A bus has no valley. A bonnet or a loading area is not a valley either: its distance
//! from the end is less than the length of the shortest car.
//!
//! A moving vehicle leaves a trail that is longer than any vehicle. Far from the scanner its single outlines
//! are distinct, so the trail has valleys there. An outline has fewer voxels than a standing vehicle, and is
//! not cut off.

use serde::{Deserialize, Serialize};

use super::lanes;
use crate::cluster::street::cores::footprint::{self, Columns, Footprint, centre};
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::spans::{self, Spans};
use crate::model::Lattice;
use crate::spatial::Cell;

/// Length of a component of vehicles from which it may be a row, in metres: a large car.
const ROW_M: f64 = 6.2;
/// Length of the shortest car, in metres.
const SHORTEST_M: f64 = 3.0;
/// The same two lengths for a component that is at most as long as the third: a moving car that two scanner
/// heads saw one after the other. Each head sees it too short, 2.9 to 3.5 m long, because the car approaches
/// or drives away while the head passes it.
const TWICE_M: (f64, f64, f64) = (5.4, 2.6, 7.0);
/// Upper limit of the height of the top, and length above which a vehicle below this limit is the trail of a
/// moving one, in metres. Cars and vans are lower than 2.4 m and at most 6 m long, lorries and buses at most
/// 12 m.
const TRAIL_M: [(f64, f64); 2] = [(2.4, LOW_TRAIL_M), (f64::INFINITY, 13.0)];
/// The smaller of these lengths, in metres.
pub(crate) const LOW_TRAIL_M: f64 = 8.0;
/// Width above which a piece longer than a vehicle is not a moving vehicle but several side by side, in
/// metres.
const WIDEST_M: f64 = 3.0;
/// Number of voxels per metre, as a fraction of the trail's number, below which a piece at the end of a trail
/// is an outline. In eight drives of `synth` with spinning scanners, the dense middles of trails have 50 to
/// 280 voxels per metre. Cars that stand beside the lane have 250 or more, but a car that stands far from the
/// path has as few as an outline.
pub(crate) const OUTLINE: f64 = 0.5;
/// The same for a trail that is longer than any vehicle. Outside its dense middle, it has up to 0.72 of the
/// voxels per metre of the middle. A shorter one may be two standing cars without a valley in between.
const LONG_OUTLINE: f64 = 0.75;
/// Largest height of a valley, as a fraction of the lower of the roofs within the length of the shortest car
/// on both sides.
const VALLEY: f64 = 0.75;

/// Whether a component of vehicles may be a row.
pub(crate) fn may_be_row(spans: &Spans, lattice: Lattice) -> bool {
    spans.narrowest().length > lattice.units(TWICE_M.0)
}

/// Whether a vehicle of this length is a trail. `top` is above ground; both are in lattice units.
pub(crate) fn is_trail(length: i64, top: i32, lattice: Lattice) -> bool {
    let top = lattice.metres(top.into());
    let (_, longest) = TRAIL_M.into_iter().find(|limits| top < limits.0).unwrap_or(TRAIL_M[1]);
    length > lattice.units(longest)
}

/// Where the vehicles of a component are cut from each other.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Row {
    lanes: Vec<Lane>,
    /// The lane of each column of voxels, ascending by columns; empty if there is one lane.
    columns: Vec<(Cell, u32)>,
    /// Edge of a column, in lattice units.
    edge: i64,
}

impl Row {
    /// The row in a component; `None` if it is one vehicle.
    pub(crate) fn of(spans: &Spans, footprint: &Footprint, lattice: Lattice) -> Option<Self> {
        if !may_be_row(spans, lattice) {
            return None;
        }
        let edge = lattice.units(EDGE_M);
        let is_wide = spans.narrowest().width > lattice.units(WIDEST_M);
        let Some(lanes) = is_wide.then(|| lanes::of(footprint.columns(), lattice)).flatten() else {
            let lane = Lane::of(spans, footprint.columns(), lattice);
            return (!lane.cuts.is_empty()).then(|| Self { lanes: vec![lane], columns: Vec::new(), edge });
        };
        let mut columns: Vec<(Cell, u32)> =
            (0..).zip(&lanes).flat_map(|(lane, columns)| columns.keys().map(move |&at| (at, lane))).collect();
        columns.sort_unstable();
        let lane = |columns: &Columns| {
            let places = columns.keys().map(|&column| Spans::of_place(centre(column, edge)));
            let spans = places.reduce(|mut whole, place| {
                whole.merge(&place);
                whole
            })?;
            Some(Lane::of(&spans, columns, lattice))
        };
        Some(Self { lanes: lanes.iter().filter_map(lane).collect(), columns, edge })
    }

    /// Number of vehicles in the row.
    pub(crate) fn count(&self) -> usize {
        self.lanes.iter().map(Lane::count).sum()
    }

    /// Whether one of its vehicles is a trail.
    pub(crate) fn has_trail(&self) -> bool {
        self.lanes.iter().any(|lane| lane.has_trail)
    }

    /// Number of the vehicle at a place. A piece that was united with the row is in the nearest lane.
    pub(crate) fn vehicle(&self, place: [i64; 2]) -> usize {
        let column = footprint::column(place, self.edge);
        let lane = match self.columns.binary_search_by_key(&column, |&(column, _)| column) {
            Ok(at) => self.columns[at].1 as usize,
            Err(_) => {
                let beside = |&lane: &usize| (self.lanes[lane].beside(place), lane);
                (0..self.lanes.len()).min_by_key(beside).unwrap_or(0)
            }
        };
        let before: usize = self.lanes[..lane].iter().map(Lane::count).sum();
        before + self.lanes[lane].vehicle(place)
    }
}

/// Where the vehicles of a lane are cut from each other.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Lane {
    /// Number of the direction along the lane.
    along: usize,
    /// Positions along the lane at which the next vehicle begins, ascending.
    cuts: Vec<i64>,
    /// Whether one of its vehicles is a trail.
    has_trail: bool,
    /// Number of the direction across the lane, and the extent of the lane in this direction.
    across: usize,
    sides: (i64, i64),
}

impl Lane {
    /// The cuts of a lane. `spans` are the spans of its columns.
    fn of(spans: &Spans, columns_of_lane: &Columns, lattice: Lattice) -> Self {
        let narrowest = spans.narrowest();
        let (along, across) = (narrowest.along(), narrowest.across());
        let edge = lattice.units(EDGE_M);
        let step = spans::SCALE_UNITS * edge;
        let start = spans.from(along);
        let bin = |columns: Vec<(i64, Cell)>| {
            columns.iter().fold(Bin::default(), |mut bin, (position, column)| {
                let (top, count) = columns_of_lane[column];
                bin.add(top, count, *position);
                bin
            })
        };
        let profile = Profile(footprint::along(columns_of_lane, spans, edge).into_iter().map(bin).collect());
        let bins = |metres: f64| usize::try_from(lattice.units(metres) / edge).unwrap_or(usize::MAX);
        let mut cuts = Vec::new();
        let (row, shortest) =
            if profile.0.len() <= bins(TWICE_M.2) { (TWICE_M.0, TWICE_M.1) } else { (ROW_M, SHORTEST_M) };
        profile.cut(0, profile.0.len(), (bins(row), bins(shortest)), &mut cuts);
        cuts.sort_unstable();
        #[expect(clippy::cast_possible_wrap, reason = "bins of a row of vehicles")]
        let outline = |vehicle: &Vehicle| {
            let length = vehicle.bins as i64 * edge;
            let is_trail = is_trail(length, vehicle.top, lattice) && vehicle.width <= lattice.units(WIDEST_M);
            let is_longer = is_trail && length > lattice.units(TRAIL_M[1].1);
            is_trail.then_some(if is_longer { LONG_OUTLINE } else { OUTLINE })
        };
        let cuts = profile.around_trails(&cuts, outline);
        let has_trail = profile.vehicles(&cuts).iter().any(|vehicle| outline(vehicle).is_some());
        #[expect(clippy::cast_possible_wrap, reason = "bins of a row of vehicles")]
        let cuts: Vec<i64> = cuts.into_iter().map(|bin| start + bin as i64 * step).collect();
        Self { along, cuts, has_trail, across, sides: (spans.from(across), spans.to(across)) }
    }

    fn count(&self) -> usize {
        self.cuts.len() + 1
    }

    fn vehicle(&self, place: [i64; 2]) -> usize {
        let position = spans::position(place, self.along);
        self.cuts.partition_point(|&cut| cut <= position)
    }

    /// How far beside the lane a place is, as [`spans::position`] measures; zero within.
    fn beside(&self, place: [i64; 2]) -> i64 {
        let position = spans::position(place, self.across);
        (self.sides.0 - position).max(position - self.sides.1).max(0)
    }
}

/// The content of one step along a row. A step is as long as a voxel.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    /// Height of its top above ground, in lattice units.
    top: i32,
    voxels: u32,
    /// Smallest and largest position across the row, as [`spans::position`] gives it.
    sides: Option<(i64, i64)>,
}

impl Bin {
    fn add(&mut self, top: i32, voxels: u32, across: i64) {
        let (from, to) = self.sides.unwrap_or((across, across));
        *self = Self {
            top: self.top.max(top),
            voxels: self.voxels + voxels,
            sides: Some((from.min(across), to.max(across))),
        };
    }

    /// The width across the row, in lattice units.
    fn width(&self) -> i64 {
        self.sides.map_or(0, |(from, to)| (to - from) / spans::SCALE_UNITS)
    }
}

/// The steps along a row.
struct Profile(Vec<Bin>);

impl Profile {
    /// Adds the bins from `from` to `to` at which vehicles are cut: the lowest valley, and the valleys on
    /// both sides of it. Of two equally low bins, the one with fewer voxels wins, then the first one.
    fn cut(&self, from: usize, to: usize, (row, shortest): (usize, usize), cuts: &mut Vec<usize>) {
        if to - from <= row {
            return;
        }
        let roof = |range: std::ops::Range<usize>| self.0[range].iter().map(|bin| bin.top).max().unwrap_or(0);
        let valley = |&bin: &usize| {
            let roofs = roof(bin - shortest..bin).min(roof(bin + 1..(bin + 1 + shortest).min(to)));
            f64::from(self.0[bin].top) <= VALLEY * f64::from(roofs)
        };
        let lowest = (from + shortest..to - shortest).filter(valley).min_by_key(|&bin| self.order(bin));
        if let Some(bin) = lowest {
            cuts.push(bin);
            self.cut(from, bin, (row, shortest), cuts);
            self.cut(bin, to, (row, shortest), cuts);
        }
    }

    /// The key by which bins are ordered for cutting.
    fn order(&self, bin: usize) -> (i32, u32, usize) {
        (self.0[bin].top, self.0[bin].voxels, bin)
    }

    /// The vehicles between ascending cuts.
    fn vehicles(&self, cuts: &[usize]) -> Vec<Vehicle> {
        let ends: Vec<usize> = [0].into_iter().chain(cuts.iter().copied()).chain([self.0.len()]).collect();
        let vehicle = |ends: &[usize]| {
            let bins = &self.0[ends[0]..ends[1]];
            let mut widths: Vec<i64> = bins.iter().map(Bin::width).collect();
            widths.sort_unstable();
            Vehicle {
                bins: bins.len(),
                top: bins.iter().map(|bin| bin.top).max().unwrap_or(0),
                voxels: bins.iter().map(|bin| u64::from(bin.voxels)).sum(),
                width: widths.get(widths.len() / 2).copied().unwrap_or(0),
            }
        };
        ends.windows(2).map(vehicle).collect()
    }

    /// The ascending cuts without those within a trail. An outline belongs to the trail that it adjoins.
    /// Between two trails, only the lowest cut remains. `outline` gives [`OUTLINE`] or [`LONG_OUTLINE`] for a
    /// trail, and otherwise `None`.
    fn around_trails(&self, cuts: &[usize], outline: impl Fn(&Vehicle) -> Option<f64>) -> Vec<usize> {
        let vehicles = self.vehicles(cuts);
        let limits = vehicles.iter().filter_map(|vehicle| Some(outline(vehicle)? * vehicle.density()));
        let limit = limits.fold(0.0, f64::max);
        let kind = |vehicle: &Vehicle| {
            if outline(vehicle).is_some() {
                Kind::Trail
            } else if vehicle.density() < limit {
                Kind::Outline
            } else {
                Kind::Stands
            }
        };
        let kinds: Vec<Kind> = vehicles.iter().map(kind).collect();
        let is_trail = |&number: &usize| kinds[number] == Kind::Trail;
        let moves = |&number: &usize| kinds[number] != Kind::Stands;
        let stays = |&cut: &usize| {
            if !moves(&cut) || !moves(&(cut + 1)) {
                return true;
            }
            let before = (0..=cut).rev().take_while(moves).find(is_trail);
            let after = (cut + 1..kinds.len()).take_while(moves).find(is_trail);
            match (before, after) {
                (None, None) => true,
                (Some(one), Some(other)) => {
                    cuts[one..other].iter().min_by_key(|&&bin| self.order(bin)) == Some(&cuts[cut])
                }
                _ => false,
            }
        };
        (0..cuts.len()).filter(stays).map(|cut| cuts[cut]).collect()
    }
}

/// The vehicle between two cuts.
struct Vehicle {
    /// Its length in bins.
    bins: usize,
    /// Height of its top above ground, in lattice units.
    top: i32,
    voxels: u64,
    /// Median of the widths of its bins, in lattice units.
    width: i64,
}

impl Vehicle {
    /// Voxels per bin.
    #[expect(clippy::cast_precision_loss, reason = "a row of vehicles")]
    fn density(&self) -> f64 {
        self.voxels as f64 / self.bins as f64
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A vehicle that stands.
    Stands,
    /// The dense middle of a trail.
    Trail,
    /// An outline at the end of a trail.
    Outline,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[expect(clippy::cast_possible_truncation, reason = "a length in voxels")]
    fn voxels(metres: f64) -> i32 {
        (metres / EDGE_M) as i32
    }

    /// A row of boxes with bonnets, each with its length and the height of its roof in metres, 0.2 m apart,
    /// along x.
    fn row(vehicles: &[(f64, f64)]) -> (Spans, Footprint) {
        let lattice = Lattice::MILLIMETRE;
        let edge = lattice.units(EDGE_M);
        let mut whole: Option<(Spans, Footprint)> = None;
        let mut start = 0.0;
        for &(length, roof) in vehicles {
            let steps = voxels(length);
            for (step, j) in (0..steps).flat_map(|step| (0..12).map(move |j| (step, j))) {
                let i = voxels(start) + step;
                let end = f64::from(step.min(steps - 1 - step)) * EDGE_M;
                let top = i32::try_from(lattice.units(if end < 0.8 { 0.6 * roof } else { roof })).unwrap();
                let place = [i, j].map(|index| i64::from(index) * edge + edge / 2);
                let one = (Spans::of_place(place), Footprint::of_voxel([i, j], top));
                match &mut whole {
                    Some((spans, footprint)) => {
                        spans.merge(&one.0);
                        footprint.merge(&one.1);
                    }
                    None => whole = Some(one),
                }
            }
            start += length + 0.2;
        }
        whole.unwrap()
    }

    fn found(vehicles: &[(f64, f64)]) -> Option<Row> {
        let (spans, footprint) = row(vehicles);
        Row::of(&spans, &footprint, Lattice::MILLIMETRE)
    }

    #[test]
    fn a_row_is_cut_between_its_vehicles() {
        let row = found(&[(4.5, 1.5), (5.1, 2.0), (3.9, 1.4)]).unwrap();
        assert_eq!(row.count(), 3);
        let at = |metres: f64| row.vehicle([Lattice::MILLIMETRE.units(metres), 800]);
        assert_eq!([0.1, 4.4, 4.9, 9.6, 10.1, 13.0].map(at), [0, 0, 1, 1, 2, 2]);
    }

    #[test]
    fn a_car_that_two_heads_saw_one_after_the_other_is_two() {
        let row = found(&[(2.9, 1.5), (3.2, 1.5)]).unwrap();
        let at = |metres: f64| row.vehicle([Lattice::MILLIMETRE.units(metres), 800]);
        assert_eq!([0.1, 2.7, 3.3, 6.0].map(at), [0, 0, 1, 1]);
        // Two halves of a small car are not cars.
        assert_eq!(found(&[(2.5, 1.5), (2.6, 1.5)]), None);
    }

    #[test]
    fn one_vehicle_is_not_cut_however_long_it_is() {
        assert_eq!(found(&[(5.9, 2.0)]), None);
        assert_eq!(found(&[(5.0, 1.5)]), None);
        assert_eq!(found(&[(7.0, 2.6)]), None);
        assert_eq!(found(&[(18.0, 3.2)]), None);
    }

    #[test]
    fn a_trail_keeps_its_outlines_and_two_trails_are_two() {
        // Vehicles, each with its length in bins and its voxels in each bin but the first. Returns the
        // profile and the cuts between the vehicles.
        let profile = |vehicles: &[(usize, u32)]| {
            let bins = vehicles.iter().flat_map(|&(length, voxels)| {
                (0..length).map(move |bin| Bin {
                    top: if bin == 0 { 500 } else { 1500 },
                    voxels: if bin == 0 { 1 } else { voxels },
                    sides: None,
                })
            });
            let ends = vehicles.iter().scan(0, |end, vehicle| {
                *end += vehicle.0;
                Some(*end)
            });
            (Profile(bins.collect()), ends.take(vehicles.len() - 1).collect::<Vec<usize>>())
        };
        let kept = |vehicles: &[(usize, u32)]| {
            let (profile, cuts) = profile(vehicles);
            profile.around_trails(&cuts, |vehicle| (vehicle.bins > 90).then_some(OUTLINE))
        };
        assert_eq!(kept(&[(30, 5), (30, 5), (200, 20), (30, 8)]), [0; 0], "outlines of a trail");
        assert_eq!(kept(&[(30, 5), (30, 18), (200, 20), (30, 19)]), [30, 60, 260], "cars that stand");
        assert_eq!(kept(&[(30, 5), (30, 19), (30, 5)]), [30, 60], "no trail");
        let (mut two, cuts) = profile(&[(100, 20), (30, 5), (30, 5), (150, 20)]);
        two.0[130].top = 200;
        assert_eq!(
            two.around_trails(&cuts, |vehicle| (vehicle.bins > 90).then_some(OUTLINE)),
            [130],
            "two trails"
        );
    }

    #[test]
    fn a_trail_is_longer_than_vehicles_of_its_height() {
        let moves = |length_m: f64, top_m: f64| {
            let [length, top] = [length_m, top_m].map(|metres| Lattice::MILLIMETRE.units(metres));
            is_trail(length, i32::try_from(top).unwrap(), Lattice::MILLIMETRE)
        };
        assert!(!moves(5.2, 1.5) && moves(8.1, 1.5), "a car");
        assert!(!moves(12.0, 3.1) && moves(13.1, 3.1), "a bus");
        let with_trail = found(&[(4.5, 1.5), (10.0, 1.5)]).map(|row| row.has_trail());
        let with_lorry = found(&[(4.5, 1.5), (10.0, 3.0)]).map(|row| row.has_trail());
        assert_eq!((with_trail, with_lorry), (Some(true), Some(false)));
    }

    #[test]
    fn cars_side_by_side_are_no_trail() {
        // 10 m of cars without a valley, in one row or in two side by side, and then a car with half as many
        // voxels.
        let row = |rows: i32| {
            let lattice = Lattice::MILLIMETRE;
            let edge = lattice.units(EDGE_M);
            let columns = (0..voxels(10.0))
                .flat_map(|i| (0..12 * rows).map(move |j| (i, j)))
                .chain((voxels(10.3)..voxels(14.5)).flat_map(|i| (0..5 * rows).map(move |j| (i, j))));
            let column = |(i, j): (i32, i32)| {
                let place = [i, j].map(|index| i64::from(index) * edge + edge / 2);
                (Spans::of_place(place), Footprint::of_voxel([i, j], 1_500))
            };
            let mut columns = columns.map(column);
            let first = columns.next().unwrap();
            let (spans, footprint) = columns.fold(first, |mut whole, one| {
                whole.0.merge(&one.0);
                whole.1.merge(&one.1);
                whole
            });
            Row::of(&spans, &footprint, lattice)
        };
        assert_eq!(row(1), None, "a trail with an outline");
        assert_eq!(row(2).map(|row| (row.count(), row.has_trail())), Some((2, false)));
    }

    #[test]
    fn a_bus_behind_a_car_stays_whole() {
        let row = found(&[(4.5, 1.5), (12.0, 3.0)]).unwrap();
        assert_eq!(row.count(), 2);
    }
}
