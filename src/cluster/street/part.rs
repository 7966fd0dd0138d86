//! Figures of a component of voxels: sums and extremes, so that the figures of its parts in all tiles add up.

use serde::{Deserialize, Serialize};

use super::rows::Footprint;
use super::shares::{self, VEHICLE};
use super::spans::Spans;
use crate::cluster::columns::Voxel;

/// Number of bands of height of low tree voxels.
pub(super) const BANDS: u8 = 9;
/// The band of all other voxels.
pub(super) const NO_BAND: u8 = u8::MAX;

/// Figures of a component.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Part {
    pub(super) class: u8,
    /// Band of height of low tree voxels.
    pub(super) band: u8,
    /// First voxel in the order (i, j, k).
    pub(super) first: Voxel,
    pub(super) voxels: u32,
    /// Lowest and highest height above ground in lattice units.
    pub(super) height: (i32, i32),
    /// Smallest and largest coordinates of centres, in lattice units.
    pub(super) min: [i64; 2],
    pub(super) max: [i64; 2],
    /// Sums of the coordinates of centres.
    pub(super) sum: [i64; 2],
    /// Neighbours (of 26) that are trees or buildings.
    pub(super) contact: u32,
    /// Voxels whose class a chain decided.
    pub(super) decided: u32,
    /// Voxels that are certainly of a pole, if the class is that of poles.
    pub(super) sure_pole: u32,
    /// Voxels with a vehicle above, below or beside them, if the class is another.
    pub(super) in_vehicle: u32,
    /// Voxels beside a facade, if the class is not that of buildings.
    pub(super) at_facade: u32,
    /// Highest tree voxel around low tree voxels, in lattice units above ground.
    pub(super) canopy: i32,
    /// How far it reaches in the plane, where [`shares::spans`] says that it counts.
    pub(super) spans: Option<Box<Spans>>,
    /// Where it stands, for vehicles that may be a row.
    pub(super) footprint: Option<Box<Footprint>>,
}

impl Part {
    pub(super) fn of_voxel(class: u8, band: u8, first: Voxel, height: i32, centre: [i64; 3]) -> Self {
        let place = [centre[0], centre[1]];
        Self {
            class,
            band,
            first,
            voxels: 1,
            height: (height, height),
            min: place,
            max: place,
            sum: place,
            contact: 0,
            decided: 0,
            sure_pole: 0,
            in_vehicle: 0,
            at_facade: 0,
            canopy: i32::MIN,
            spans: shares::spans(class).then(|| Box::new(Spans::of_place(place))),
            footprint: (class == VEHICLE)
                .then(|| Box::new(Footprint::of_voxel([first[0], first[1]], height))),
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.first = self.first.min(other.first);
        self.voxels += other.voxels;
        self.height = (self.height.0.min(other.height.0), self.height.1.max(other.height.1));
        for axis in 0..2 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
            self.sum[axis] += other.sum[axis];
        }
        self.contact += other.contact;
        self.decided += other.decided;
        self.sure_pole += other.sure_pole;
        self.in_vehicle += other.in_vehicle;
        self.at_facade += other.at_facade;
        self.canopy = self.canopy.max(other.canopy);
        if let (Some(spans), Some(other)) = (&mut self.spans, &other.spans) {
            spans.merge(other);
        }
        if let (Some(footprint), Some(other)) = (&mut self.footprint, &other.footprint) {
            footprint.merge(other);
        }
    }

    pub(super) fn centre(&self) -> [i64; 2] {
        self.sum.map(|sum| sum.div_euclid(i64::from(self.voxels.max(1))))
    }

    /// Longest side of the box in the plane.
    pub(super) fn extent(&self) -> i64 {
        (self.max[0] - self.min[0]).max(self.max[1] - self.min[1])
    }
}
