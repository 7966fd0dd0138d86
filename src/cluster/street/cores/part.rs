//! Figures of a component of voxels: sums and extremes, so that the figures of its parts in all tiles can be
//! merged.

use serde::{Deserialize, Serialize};

use super::footprint::Footprint;
use crate::cluster::columns::Voxel;
use crate::cluster::street::shares::{self, FENCE, VEHICLE};
use crate::cluster::street::spans::Spans;

/// Number of height bands of low tree voxels.
pub(crate) const BANDS: u8 = 9;
/// The band of all other voxels.
pub(crate) const NO_BAND: u8 = u8::MAX;

/// Figures of a component.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Part {
    pub(crate) class: u8,
    /// Height band, for low tree voxels.
    pub(crate) band: u8,
    /// First voxel in the order (i, j, k).
    pub(crate) first: Voxel,
    pub(crate) voxels: u32,
    /// Lowest and highest height above ground in lattice units.
    pub(crate) height: (i32, i32),
    /// Smallest and largest coordinates of centres, in lattice units.
    pub(crate) min: [i64; 2],
    pub(crate) max: [i64; 2],
    /// Sums of the coordinates of centres.
    pub(crate) sum: [i64; 2],
    /// Neighbours that are trees or buildings, of 26 per voxel, summed over the voxels.
    pub(crate) contact: u32,
    /// Voxels whose class `chained` decided.
    pub(crate) decided: u32,
    /// Voxels that are certainly pole, if the class is pole.
    pub(crate) sure_pole: u32,
    /// Voxels beside a facade, if the class is pole.
    pub(crate) at_facade: u32,
    /// Highest tree voxel around low tree voxels, in lattice units above ground.
    pub(crate) canopy: i32,
    /// Its extent in the plane, if [`shares::spans`] says that the class needs it.
    pub(crate) spans: Option<Box<Spans>>,
    /// Its columns of voxels, for classes that may be cut into several objects (`cuts`).
    pub(crate) footprint: Option<Box<Footprint>>,
}

impl Part {
    pub(crate) fn of_voxel(class: u8, band: u8, first: Voxel, height: i32, centre: [i64; 3]) -> Self {
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
            at_facade: 0,
            canopy: i32::MIN,
            spans: shares::spans(class).then(|| Box::new(Spans::of_place(place))),
            footprint: matches!(class, VEHICLE | FENCE)
                .then(|| Box::new(Footprint::of_voxel([first[0], first[1]], height))),
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
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
        self.at_facade += other.at_facade;
        self.canopy = self.canopy.max(other.canopy);
        if let (Some(spans), Some(other)) = (&mut self.spans, &other.spans) {
            spans.merge(other);
        }
        if let (Some(footprint), Some(other)) = (&mut self.footprint, &other.footprint) {
            footprint.merge(other);
        }
    }

    pub(crate) fn centre(&self) -> [i64; 2] {
        self.sum.map(|sum| sum.div_euclid(i64::from(self.voxels.max(1))))
    }

    /// Longest side of the box in the plane.
    pub(crate) fn extent(&self) -> i64 {
        (self.max[0] - self.min[0]).max(self.max[1] - self.min[1])
    }
}
