//! Joins voxels to components: by class, within the reach of the class, and low tree voxels by height bands.
//!
//! The distances, in voxels of 0.15 m, are those of the prototype, except for fences.
//! `benches/results/street.md` has their study.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "voxels of a tile fit u32; heights above ground in lattice units fit i32"
)]

use super::arms::SURE_SHARE;
use super::part::{BANDS, NO_BAND, Part};
use super::parts::{Links, Parts};
use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::shares::{BUILDING, FENCE, POLE, SMALL, TREE, VEHICLE, WIRE};
use crate::cluster::street::window::Window;
use crate::model::Lattice;

/// Height above ground of the lowest band of low tree voxels, and height of a band, in metres.
const LOW_M: f64 = 0.15;
const BAND_M: f64 = 0.25;
/// Two voxels of a class are joined if they are at most this many voxels apart in the plane and this many
/// levels apart.
const REACHES: [(u8, i32, i32); 5] =
    [(POLE, 2, 16), (VEHICLE, 2, 2), (FENCE, 3, FENCE_LEVELS), (SMALL, 3, 3), (WIRE, 4, 4)];
const FENCE_LEVELS: i32 = 8;
/// Reach of fence voxels in lines, in voxels in the plane. Few profiles or beams reached such voxels, and the
/// space between the lines was not seen. The second value is the largest number of fence voxels above and
/// below such a voxel, within two levels in its own column and the eight around it. A dense hedge and the
/// bush in front of it stay apart.
const FENCE_LINES_REACH: i32 = 6;
const LINE_STACKED: usize = 3;
/// Largest distance of joined building columns on either axis of the plane, in voxels (0.3 m), whatever their
/// height. `facades` joins high columns that are further apart.
const BUILDING_REACH: i32 = 2;
/// A column is sparse if a column near it has more than this many times as many building voxels.
const SPARSE_WALL: usize = 8;
/// Height in metres below which the top of a low building column lies. Parts of cars and fences look like
/// walls. They would link one facade to the next over the car in front of it.
const LOW_WALL_M: f64 = 1.8;
/// Distance from a low tree voxel within which the canopy is searched, in voxels.
const CANOPY_REACH: i32 = 5;

/// The height band of each low tree voxel.
pub(crate) fn bands(around: &Classified, class: &[u8], lattice: Lattice) -> Vec<u8> {
    let low = lattice.units(LOW_M) as i32;
    let band = lattice.units(BAND_M) as i32;
    let of = |voxel: usize| {
        let above = around.height[voxel] - low;
        if class[voxel] != TREE || above < 0 || above >= band * i32::from(BANDS) {
            return NO_BAND;
        }
        (above / band) as u8
    };
    (0..class.len()).map(of).collect()
}

/// Joins the voxels of each class of [`REACHES`] within the reach of the class, and fence voxels in lines
/// within a longer reach.
pub(crate) fn join_classes(around: &Classified, class: &[u8], links: &mut Links<'_>) {
    let columns = &around.voxels.columns;
    let mut far = Window::new(FENCE_LINES_REACH, FENCE_LEVELS).over(columns);
    let mut upright = Window::new(1, 2).over(columns);
    let mut in_line = vec![false; class.len()];
    for voxel in (0..class.len()).filter(|&voxel| class[voxel] == FENCE) {
        let [i, j, k] = around.voxels.key[voxel];
        let mut stacked = 0;
        upright.visit([i, j], k, |other| {
            stacked += usize::from(class[other] == FENCE && around.voxels.key[other][2] != k);
        });
        in_line[voxel] = stacked <= LINE_STACKED;
    }
    for (of, radius, levels) in REACHES {
        let mut near = Window::new(radius, levels).over(columns);
        for voxel in (0..class.len()).filter(|&voxel| class[voxel] == of && around.voxels.owned[voxel]) {
            let [i, j, k] = around.voxels.key[voxel];
            near.visit([i, j], k, |other| {
                if class[other] == of && other != voxel {
                    links.join(voxel, other);
                }
            });
        }
    }
    for voxel in (0..class.len()).filter(|&voxel| in_line[voxel] && around.voxels.owned[voxel]) {
        let [i, j, k] = around.voxels.key[voxel];
        far.visit([i, j], k, |other| {
            if in_line[other] && other != voxel {
                links.join(voxel, other);
            }
        });
    }
}

/// Height above ground in lattice units from which a building column is not a low wall.
pub(crate) fn low_wall(lattice: Lattice) -> i32 {
    lattice.units(LOW_WALL_M) as i32
}

/// Joins the columns with building voxels that are near each other in the plane.
///
/// A sparse column may be a reflection between two houses. It joins the nearest dense column, and no second
/// one. Where no column nearby has many more voxels, the scan itself is sparse, and the columns join each
/// other.
pub(crate) fn join_buildings(around: &Classified, class: &[u8], links: &mut Links<'_>) {
    let columns = &around.voxels.columns;
    let window = Window::square(BUILDING_REACH);
    let mut finder = columns.finder();
    let buildings = |column: usize| columns.voxels(column).filter(|&voxel| class[voxel] == BUILDING);
    let cells = columns.cells();
    let voxels: Vec<usize> = (0..cells.len()).map(|column| buildings(column).count()).collect();
    let mut is_dense = vec![true; cells.len()];
    for (column, &[i, j]) in cells.iter().enumerate().filter(|&(column, _)| voxels[column] > 0) {
        let near = window.steps().iter().filter_map(|&[di, dj]| finder.number([i + di, j + dj]));
        let most = near.map(|other| voxels[other]).max().unwrap_or(0);
        is_dense[column] = voxels[column] * SPARSE_WALL >= most;
    }
    // The dense column that a sparse one joins.
    let mut joins: Vec<Option<usize>> = vec![None; cells.len()];
    for (column, &[i, j]) in cells.iter().enumerate() {
        if is_dense[column] {
            continue;
        }
        let near = window.steps().iter().filter_map(|&[di, dj]| {
            let other =
                finder.number([i + di, j + dj]).filter(|&other| voxels[other] > 0 && is_dense[other])?;
            Some((di * di + dj * dj, di, dj, other))
        });
        joins[column] = near.min().map(|(.., other)| other);
    }
    for (column, &[i, j]) in cells.iter().enumerate() {
        let Some(voxel) = buildings(column).next().filter(|&voxel| around.voxels.owned[voxel]) else {
            continue;
        };
        for other in buildings(column) {
            links.join(voxel, other);
        }
        for [di, dj] in window.steps() {
            let Some(other) = finder.number([i + di, j + dj]) else { continue };
            let may_join = match (is_dense[column], is_dense[other]) {
                (true, true) => true,
                (true, false) => joins[other] == Some(column),
                (false, true) => joins[column] == Some(other),
                (false, false) => joins[column].is_none() && joins[other].is_none(),
            };
            if let Some(other) = buildings(other).next().filter(|_| may_join) {
                links.join(voxel, other);
            }
        }
    }
}

/// Joins low tree voxels of the same band, and returns voxels of adjacent bands that touch, the lower first.
pub(crate) fn join_bands(around: &Classified, band: &[u8], links: &mut Links<'_>) -> Vec<(usize, usize)> {
    let mut near = Window::new(2, 2).over(&around.voxels.columns);
    let mut rising = Vec::new();
    for voxel in (0..band.len()).filter(|&voxel| band[voxel] != NO_BAND && around.voxels.owned[voxel]) {
        let [i, j, k] = around.voxels.key[voxel];
        near.visit([i, j], k, |other| {
            if other == voxel || band[other] == NO_BAND {
                return;
            }
            if band[other] == band[voxel] {
                links.join(voxel, other);
            } else if band[other].abs_diff(band[voxel]) == 1 {
                links.touch(voxel, other);
                let low_first = band[voxel] < band[other];
                rising.push(if low_first { (voxel, other) } else { (other, voxel) });
            }
        });
    }
    rising
}

/// The figures of the components, over the voxels of the tile. `decided` says whether `chained` decided the
/// class of a voxel.
pub(crate) fn figures(
    around: &Classified,
    class: &[u8],
    band: &[u8],
    decided: &dyn Fn(usize) -> bool,
    parts: &Parts,
) -> Vec<Option<Part>> {
    let columns = &around.voxels.columns;
    let mut finder = columns.finder();
    let mut touching = Window::new(1, 1).over(columns);
    let mut facade = Window::new(3, 1).over(columns);
    let canopy = canopies(around, class);
    let below_canopy = Window::new(CANOPY_REACH, 0);
    let mut figures: Vec<Option<Part>> = vec![None; parts.border.count as usize];
    for voxel in (0..class.len()).filter(|&voxel| around.voxels.owned[voxel]) {
        let Some(figure) = figures.get_mut(parts.of[voxel] as usize) else { continue };
        let key @ [i, j, k] = around.voxels.key[voxel];
        let mut one =
            Part::of_voxel(class[voxel], band[voxel], key, around.height[voxel], around.voxels.centre[voxel]);
        one.decided = u32::from(decided(voxel));
        if class[voxel] == POLE {
            one.sure_pole = u32::from(around.shares[voxel][usize::from(POLE)] >= SURE_SHARE);
        }
        if matches!(class[voxel], POLE | FENCE | SMALL | VEHICLE) {
            touching.visit([i, j], k, |other| {
                one.contact += u32::from(matches!(class[other], TREE | BUILDING));
            });
        }
        if class[voxel] == POLE {
            facade.visit([i, j], k, |other| {
                one.at_facade |= u32::from(class[other] == BUILDING);
            });
        }
        if band[voxel] != NO_BAND {
            for [di, dj] in below_canopy.steps() {
                if let Some(column) = finder.number([i + di, j + dj]) {
                    one.canopy = one.canopy.max(canopy[column]);
                }
            }
        }
        match figure {
            Some(figure) => figure.merge(&one),
            None => *figure = Some(one),
        }
    }
    figures
}

/// The height above ground of the highest tree voxel of each column, in lattice units.
fn canopies(around: &Classified, class: &[u8]) -> Vec<i32> {
    let columns = &around.voxels.columns;
    let highest = |column: usize| {
        let trees = columns.voxels(column).filter(|&voxel| class[voxel] == TREE);
        trees.map(|voxel| around.height[voxel]).max().unwrap_or(i32::MIN)
    };
    (0..columns.cells().len()).map(highest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::voxels::stored::Voxels;

    /// The number of building components in a row of adjacent columns with these numbers of voxels of 0.15 m.
    fn components(row: &[usize]) -> u32 {
        let levels =
            |column: usize| (0..i64::try_from(row[column]).unwrap()).map(move |level| (column, level));
        let point = |(column, level): (usize, i64)| {
            [i64::try_from(column).unwrap(), 0, level].map(|at| 150 * at + 75)
        };
        let points: Vec<[i64; 3]> = (0..row.len()).flat_map(levels).map(point).collect();
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &points);
        let count = voxels.len();
        let around = Classified { voxels, height: vec![0; count], shares: vec![[0; 8]; count] };
        let mut links = Links::new(&around.voxels);
        join_buildings(&around, &vec![BUILDING; count], &mut links);
        links.finish(&around.voxels, |_| true).border.count
    }

    #[test]
    fn reflections_between_two_houses_join_none_to_the_other() {
        assert_eq!(components(&[20, 20, 0, 20, 20]), 1, "0.3 m apart");
        assert_eq!(components(&[20, 20, 0, 0, 20, 20]), 2, "0.45 m apart");
        assert_eq!(components(&[20, 20, 0, 1, 0, 20, 20]), 2);
        assert_eq!(components(&[20, 20, 0, 2, 1, 0, 20, 20]), 2);
        assert_eq!(components(&[20, 20, 0, 3, 0, 20, 20]), 1, "three voxels are no reflection");
    }

    #[test]
    fn a_wall_of_which_little_is_seen_is_one() {
        assert_eq!(components(&[1, 0, 2, 0, 1, 1, 0, 3, 0, 1]), 1);
    }
}
