//! The space above the driven path: which points are in it, and how high above the ground they are.

use std::collections::BTreeMap;

use glam::{DVec3, IVec3};

use super::drive::Drive;
use crate::synth::street::axis::Line;
use crate::synth::street::preset::Plan;

/// Largest distance of a place on the roadway from the path of the vehicle, metres (outputs, section 2).
const HALF: f64 = 3.5;
/// Height over the ground below which the lowest point of a column means that it stands on the roadway and is
/// not above it, metres: for trees, poles and wires, and for everything else.
const LEAST: (f64, f64) = (0.5, 2.0);
/// Class codes of trees, poles and wires.
const HANGING: [u8; 3] = [2, 3, 8];
/// Edge of a column, millimetres.
const COLUMN: i32 = 100;

/// The roadway around a place of the drive.
#[derive(Debug)]
pub(crate) struct Roadway {
    pub(crate) plan: Plan,
    pub(crate) drive: Drive,
    /// The axis of the street within the range of the scanner.
    pub(crate) line: Line,
}

impl Roadway {
    /// Height of a point over the ground, metres, if it is above the roadway. The point is in metres from the
    /// street's origin.
    fn over(&self, point: DVec3) -> Option<f64> {
        let (s, offset) = self.line.nearest(point.truncate())?;
        let mut paths = self.drive.offsets(s).into_iter().flatten();
        let is_above = paths.any(|path| (path - offset).abs() <= HALF);
        is_above.then(|| point.z - self.plan.height(self.line.at(s), s, offset))
    }
}

/// The part of an object that is above the roadway: the smallest height over the ground in every column.
#[derive(Debug, Default)]
pub(crate) struct Above(BTreeMap<[i32; 2], f64>);

impl Above {
    /// Adds a point, in millimetres from the street's origin.
    pub(crate) fn add(&mut self, steps: IVec3, roadway: &Roadway) {
        if let Some(over) = roadway.over(steps.as_dvec3() * 0.001) {
            let lowest = self.0.entry([steps.x, steps.y].map(|v| v.div_euclid(COLUMN))).or_insert(over);
            *lowest = lowest.min(over);
        }
    }

    /// The clearance below an object of this class, metres: the smallest height over the ground among its
    /// columns that do not stand on the roadway.
    pub(crate) fn clearance(&self, class: u8) -> Option<f64> {
        let least = if HANGING.contains(&class) { LEAST.0 } else { LEAST.1 };
        self.0.values().copied().filter(|over| *over >= least).min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::street::axis::{Axis, LEAD};
    use crate::synth::street::preset::Preset;

    #[test]
    fn an_arm_over_the_path_has_a_clearance_and_its_mast_has_none() {
        let plan = Plan::new(Preset::Suburb, 3);
        let mut axis = Axis::new(plan.seed, plan.bends, None);
        axis.near(LEAD, 100.0);
        let drive = Drive::new(plan, axis.end, 2.0, (40.0, 40.0));
        let s = LEAD + 30.0;
        let node = axis.line.at(s);
        let path = drive.offsets(s)[0].unwrap();
        assert_eq!(drive.offsets(s)[1], None, "it does not return");
        let roadway = Roadway { plan, drive, line: axis.line.clone() };
        let mut above = Above::default();
        // The arm is level, from 6 m beside the path to 1 m beside it. The mast is 3.2 m beside the path.
        let steps = |offset: f64, over: f64| {
            let z = plan.height(node, s, offset) + over;
            (node.left(offset).extend(z) * 1_000.0).round().as_ivec3()
        };
        (0..500).for_each(|k| above.add(steps(path - 1.0 - 0.01 * f64::from(k), 5.5), &roadway));
        (0..400).for_each(|k| above.add(steps(path - 3.2, 0.015 * f64::from(k)), &roadway));
        assert!((above.clearance(3).unwrap() - 5.5).abs() < 2e-3, "{:?}", above.clearance(3));
        let mut beside = Above::default();
        beside.add(steps(path + 3.6, 4.0), &roadway);
        beside.add(steps(path + 1.0, 1.9), &roadway);
        assert_eq!(beside.clearance(5), None);
        assert!((beside.clearance(2).unwrap() - 1.9).abs() < 2e-3, "a low branch");
    }
}
