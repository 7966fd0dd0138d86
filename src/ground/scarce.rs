//! Is ground missing although points lie low? Then the filter does not suit the drive, and the run says so.

use serde::{Deserialize, Serialize};

use super::{opening, upward_growing};
use crate::model::{PointClass, TileCloud};
use crate::spatial::{CellGrid, CellMap};

/// Points at most this far above the lowest of their cell lie low, in metres.
const LOW_M: f64 = 0.3;

/// Share of ground among the points that lie low, below which ground is scarce. Chosen by the study in
/// benches/results/ground.md: filters that suit a scene reach 0.64 or more, even in a forest and in a single
/// sweep. Filters that do not suit it reach 0.43 or less, on a steep street and where the ground is missing.
const SCARCE: f64 = 0.5;

/// Points that lie low in their cell, and how many of them are ground. Counts of tiles add up, because a cell
/// belongs to one tile.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LowPoints {
    /// Points that lie low and are not noise.
    pub low: u64,
    /// Those of them that are ground.
    pub ground: u64,
}

impl LowPoints {
    /// Counts the points of a cloud that `counted` accepts, by cells of `grid`. Noise is left out.
    #[must_use]
    pub fn count(
        cloud: &TileCloud,
        classes: &[PointClass],
        grid: &CellGrid,
        counted: impl Fn(usize) -> bool,
    ) -> Self {
        let points = || (0..cloud.len()).filter(|&point| counted(point) && !classes[point].is_noise());
        let cell = |point: usize| {
            let [x, y, _] = cloud.lattice_point(point);
            [x, y].map(|value| i32::try_from(grid.index(value)).unwrap_or(i32::MAX))
        };
        // Cells of the map begin at 0, so they keep the depth below the largest value.
        let depth = |point: usize| u32::MAX - cloud.z[point].unsigned_abs();
        let mut deepest = CellMap::<u32>::default();
        for point in points() {
            let slot = deepest.entry(cell(point));
            *slot = depth(point).max(*slot);
        }
        let low_units = cloud.lattice.units(LOW_M);
        let mut counts = Self::default();
        let mut deepest = deepest.cursor();
        for point in points() {
            if i64::from(deepest.get(cell(point)) - depth(point)) <= low_units {
                counts.low += 1;
                counts.ground += u64::from(classes[point] == PointClass::Ground);
            }
        }
        counts
    }

    /// The warning of a run if ground is scarce after the filter `method`. Two filters miss ground for
    /// different reasons; if the scan has hardly any ground, neither helps. The text names these cases.
    #[must_use]
    pub fn warning(self, method: &str) -> Option<String> {
        let share = self.ground as f64 / self.low.max(1) as f64;
        let [opening, growing] = [opening::NAME, upward_growing::NAME];
        let other = match method {
            opening::NAME => format!("on a steep street --ground {growing} finds more"),
            upward_growing::NAME => format!("on most drives --ground {opening} finds more"),
            _ => format!("on most drives --ground {opening} finds more, and {growing} on a steep street"),
        };
        (self.low > 0 && share < SCARCE).then(|| {
            format!(
                "{method} found little ground: {:.1} % of the lowest points are ground; {other}; \
                 where the scan has hardly any ground, as in a dense forest, all filters find little",
                100.0 * share
            )
        })
    }
}

impl std::ops::AddAssign for LowPoints {
    fn add_assign(&mut self, other: Self) {
        self.low += other.low;
        self.ground += other.ground;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Lattice;
    use PointClass::{Ground, LowNoise, Object};

    #[test]
    fn low_points_are_those_near_the_lowest_of_their_cell() {
        // Two cells of 1 m, one below zero; noise does not make a cell deep.
        let points =
            [[0, 0, 0], [500, 500, 300], [999, 0, 301], [0, 0, -5_000], [-1, 0, 2_000], [-1, 0, 2_100]];
        let classes = [Ground, Object, Ground, LowNoise, Object, Ground];
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let grid = CellGrid::new(1_000);
        let mut counts = LowPoints::count(&cloud, &classes, &grid, |_| true);
        assert_eq!(counts, LowPoints { low: 4, ground: 2 });
        let some = LowPoints::count(&cloud, &classes, &grid, |point| point != 0);
        assert_eq!(some, LowPoints { low: 4, ground: 2 }, "0.301 m is low once 0 m is not counted");
        counts += some;
        assert_eq!(counts, LowPoints { low: 8, ground: 4 });
    }

    #[test]
    fn ground_below_half_of_the_lowest_points_is_scarce() {
        let share = |ground, method| LowPoints { low: 1_000, ground }.warning(method);
        assert_eq!(share(500, "opening"), None);
        let said = share(499, "opening").unwrap();
        assert_eq!(
            said,
            "opening found little ground: 49.9 % of the lowest points are ground; on a steep street --ground \
             upward-growing finds more; where the scan has hardly any ground, as in a dense forest, all filters \
             find little"
        );
        assert!(share(0, "upward-growing").unwrap().contains("on most drives --ground opening finds more;"));
        assert!(
            share(0, "voxel-column").unwrap().contains("--ground opening finds more, and upward-growing")
        );
        assert_eq!(LowPoints::default().warning("opening"), None, "a drive without points");
    }
}
