//! Columns in which an object stands, and rooms. A foot is ground only if ground was seen there or beside it.
//! A patch enclosed by walls is a room, and not ground.
//!
//! Both rules need the surface of the ground in every column, but do not depend on how it was found. A column
//! is *clear* where nothing stands on its surface.
//!
//! * *Foot.* The lowest points of a facade, a trunk or a hedge lie on the surface even where the ground below
//!   was not seen. They are ground if the object alone does not explain the number of points there, or if a
//!   clear column nearby has the same height.
//! * *Room.* The floor behind a window is as flat as a road. Clear columns that touch and differ by less than
//!   a step are a patch. A patch is a room if it is short, if walls are a large part of the border that was
//!   seen, and if there are enough wall columns for its size. Columns without points do not count in the
//!   border, because only parts of a room and its border are seen through a window. So single columns between
//!   a wall and unseen columns are rooms, too. The size counts because of a lawn around a post, where nothing
//!   but the post was seen beside the lawn.
//!
//! Both decisions are exact over tiles. A patch that extends farther than `room` from one of its columns is
//! not a room, so nothing beyond matters.
#![expect(clippy::cast_possible_truncation, reason = "numbers of columns fit u32, see VoxelIndex")]

use super::lowest::NONE;
use crate::spatial::{DisjointSets, VoxelIndex};

/// Number of columns to each side in which clear ground is searched (chosen: 0.9 m by default).
pub(super) const FOOT_REACH: i64 = 3;

/// Share of walls in the border of a patch above which it can be a room (chosen by the study in
/// benches/results/ground.md).
const WALLS: f64 = 0.25;

/// Number of wall columns beside a patch above which it can be a room, as a share of the circumference of its
/// box (chosen: a wall along one side of a square is 0.25, and a post in a lawn of 3 m is 0.025; by the same
/// study).
const ENCLOSED: f64 = 0.1;

/// What stands on the surface of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// It has no surface.
    Unseen,
    /// Nothing stands there.
    Clear,
    /// An object stands there. `wall`: it is as high as a wall. `ground`: ground was seen at its foot.
    Standing { wall: bool, ground: bool },
}

/// Limits of the rules, in lattice units and columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Neighbouring columns of a patch differ by less than this.
    pub(super) step: u32,
    /// A foot differs from the clear ground beside it by at most this.
    pub(super) close: u32,
    /// A patch that is longer than this many columns along an axis is not a room.
    pub(super) room: u32,
}

/// A set of clear columns that touch.
#[derive(Debug, Clone, Copy)]
struct Patch {
    low: [u32; 2],
    high: [u32; 2],
    /// Pairs of a column of the patch and a column beside it. `walls` counts the pairs with a wall.
    border: u32,
    walls: u32,
    /// Wall columns beside it, each counted once.
    wall_columns: u32,
}

impl Patch {
    const EMPTY: Self = Self { low: [u32::MAX; 2], high: [0; 2], border: 0, walls: 0, wall_columns: 0 };

    fn add(&mut self, column: [u32; 2]) {
        for axis in [0, 1] {
            self.low[axis] = self.low[axis].min(column[axis]);
            self.high[axis] = self.high[axis].max(column[axis]);
        }
    }

    fn is_room(&self, room: u32) -> bool {
        let sides = [0, 1].map(|axis| self.high[axis] - self.low[axis] + 1);
        let circumference = f64::from(2 * (sides[0] + sides[1]));
        sides.iter().all(|&side| side <= room)
            && f64::from(self.walls) > WALLS * f64::from(self.border)
            && f64::from(self.wall_columns) > ENCLOSED * circumference
    }
}

/// Whether the points at the surface of each column are ground.
pub(super) fn has_ground(index: &VoxelIndex, surface: &[u32], kinds: &[Kind], limits: Limits) -> Vec<bool> {
    let mut ground = clear_ground(index, surface, kinds, limits);
    let clear = ground.clone();
    for di in 0..=FOOT_REACH {
        let first = if di == 0 { 1 } else { -FOOT_REACH };
        for dj in first..=FOOT_REACH {
            index.column_pairs([di, dj], |one, other| {
                let same_height = surface[one].abs_diff(surface[other]) <= limits.close;
                for (foot, beside) in [(one, other), (other, one)] {
                    if same_height && clear[beside] && kinds[foot] != Kind::Clear {
                        ground[foot] |= kinds[foot] != Kind::Unseen;
                    }
                }
            });
        }
    }
    for (ground, kind) in ground.iter_mut().zip(kinds) {
        *ground |= matches!(kind, Kind::Standing { ground: true, .. });
    }
    ground
}

/// Whether each column is clear and not part of a room.
fn clear_ground(index: &VoxelIndex, surface: &[u32], kinds: &[Kind], limits: Limits) -> Vec<bool> {
    const BESIDE: [[i64; 2]; 4] = [[0, 1], [1, -1], [1, 0], [1, 1]];
    let is_clear = |column: usize| kinds[column] == Kind::Clear;
    let mut sets = DisjointSets::new(kinds.len() as u32);
    for offset in BESIDE {
        index.column_pairs(offset, |one, other| {
            if is_clear(one) && is_clear(other) && surface[one].abs_diff(surface[other]) < limits.step {
                sets.union(one as u32, other as u32);
            }
        });
    }
    let patch_of: Vec<u32> = (0..kinds.len()).map(|column| sets.find(column as u32)).collect();
    let mut patches = vec![Patch::EMPTY; kinds.len()];
    for (&patch, &column) in patch_of.iter().zip(index.columns()) {
        patches[patch as usize].add(column);
    }
    let mut walls = Vec::new();
    for offset in BESIDE {
        index.column_pairs(offset, |one, other| {
            for (inside, beside) in [(one, other), (other, one)] {
                if patch_of[one] != patch_of[other] && is_clear(inside) {
                    patches[patch_of[inside] as usize].border += 1;
                    if matches!(kinds[beside], Kind::Standing { wall: true, .. }) {
                        walls.push((patch_of[inside], beside as u32));
                    }
                }
            }
        });
    }
    walls.sort_unstable();
    for (place, &(patch, _)) in walls.iter().enumerate() {
        let patch = &mut patches[patch as usize];
        patch.walls += 1;
        let is_new = place == 0 || walls[place - 1] != walls[place];
        patch.wall_columns += u32::from(is_new);
    }
    let is_ground =
        |column: usize| is_clear(column) && !patches[patch_of[column] as usize].is_room(limits.room);
    debug_assert!(
        (0..kinds.len()).all(|column| (surface[column] == NONE) == (kinds[column] == Kind::Unseen))
    );
    (0..kinds.len()).map(is_ground).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Lattice, TileCloud};
    use Kind::{Clear, Unseen};

    const WALL: Kind = Kind::Standing { wall: true, ground: false };
    const HEDGE: Kind = Kind::Standing { wall: false, ground: false };
    const LIMITS: Limits = Limits { step: 300, close: 60, room: 5 };

    /// Columns of edge 10 in rows of text: `.` clear, `#` wall, `h` hedge, `?` unseen, ` ` nothing. Text: `.`
    /// and `h` with ground, `o` without. `height` gives the surface at (row, place).
    fn ground(rows: &[&str], limits: Limits, height: impl Fn(u32, u32) -> u32) -> Vec<String> {
        let at = |row: usize, place: usize| rows[row].as_bytes()[place];
        let places = || (0..rows.len()).flat_map(|row| (0..rows[row].len()).map(move |place| (row, place)));
        let points: Vec<[i64; 3]> = places()
            .filter(|&(row, place)| at(row, place) != b' ')
            .map(|(row, place)| [10 * i64::try_from(row).unwrap(), 10 * i64::try_from(place).unwrap(), 0])
            .collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let index = VoxelIndex::build("test", &cloud, 10).unwrap();
        let kind = |letter| match letter {
            b'.' => Clear,
            b'#' => WALL,
            b'h' => HEDGE,
            _ => Unseen,
        };
        let columns = || index.columns().iter().map(|&[i, j]| (i, j));
        let kinds: Vec<Kind> = columns().map(|(i, j)| kind(at(i as usize, j as usize))).collect();
        let surface: Vec<u32> = columns()
            .zip(&kinds)
            .map(|((i, j), &kind)| if kind == Unseen { NONE } else { height(i, j) })
            .collect();
        let found = has_ground(&index, &surface, &kinds, limits);
        let mut text = vec![String::new(); rows.len()];
        for (row, place) in places() {
            let column = columns().position(|(i, j)| (i as usize, j as usize) == (row, place));
            text[row].push(column.map_or(' ', |column| if found[column] { '.' } else { 'o' }));
        }
        text
    }

    #[test]
    fn patches_that_walls_enclose_are_rooms_unless_they_are_long() {
        let room = ["######", "#....#", "#....#", "######"];
        assert_eq!(ground(&room, LIMITS, |_, _| 0), ["oooooo"; 4]);
        // Longer than the limit: a yard. Its walls stand on ground.
        let yard = ["########", "#......#", "#......#", "########"];
        assert_eq!(ground(&yard, LIMITS, |_, _| 0), ["........"; 4]);
        // Hedges are not walls. A single wall column is not a quarter of the border.
        let garden = ["hhhhhh", "h....h", "h....h", "hhhhhh"];
        assert_eq!(ground(&garden, LIMITS, |_, _| 0), ["......"; 4]);
        assert_eq!(ground(&["h..h", "h..h", "hh#h"], LIMITS, |_, _| 0), ["...."; 3]);
        assert_eq!(ground(&room, Limits { room: 0, ..LIMITS }, |_, _| 0), ["......"; 4]);
    }

    #[test]
    fn a_patch_with_few_walls_for_its_size_is_no_room() {
        // Nothing was seen around it, so the post is the whole border of the lawn.
        let lawn = [".....", ".....", "..#..", ".....", "....."];
        assert_eq!(ground(&lawn, LIMITS, |_, _| 0), ["....."; 5]);
        // A column between a wall and nothing, and a floor with a wall along one side, are rooms.
        assert_eq!(ground(&[".#"], LIMITS, |_, _| 0), ["oo"]);
        assert_eq!(ground(&["####", "....", "...."], LIMITS, |_, _| 0), ["oooo"; 3]);
    }

    #[test]
    fn a_step_separates_a_room_from_the_street() {
        // The wall between room and street was only partly seen: the floor joins the street unless it is a
        // step higher.
        let front = ["######", "#....#", "#....#", "#.##.#", "......", "......"];
        let floor = |height: u32| move |row: u32, _: u32| if row < 4 { height } else { 0 };
        assert_eq!(ground(&front, LIMITS, floor(299)), ["......"; 6]);
        let above = ground(&front, LIMITS, floor(300));
        assert_eq!(above[..4], ["oooooo"; 4]);
        assert_eq!(above[4..], ["......"; 2]);
    }

    #[test]
    fn a_foot_is_ground_where_clear_ground_beside_it_is_as_high() {
        let row = |height: u32| {
            ground(&["....hhhhh"], LIMITS, move |_, place| if place < 4 { 100 } else { height })
        };
        assert_eq!(row(160), [".......oo"], "three columns away");
        assert_eq!(row(40), [".......oo"]);
        assert_eq!(row(161), ["....ooooo"]);
        assert_eq!(row(39), ["....ooooo"]);
        assert_eq!(ground(&[".?h"], LIMITS, |_, _| 0), [".o."], "a column without a surface has no ground");
    }

    #[test]
    fn a_foot_on_ground_that_was_seen_is_ground_anywhere() {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[0; 3], [500, 0, 0]]);
        let index = VoxelIndex::build("test", &cloud, 10).unwrap();
        let kinds = [HEDGE, Kind::Standing { wall: true, ground: true }];
        assert_eq!(has_ground(&index, &[0, 0], &kinds, LIMITS), [false, true]);
    }
}
