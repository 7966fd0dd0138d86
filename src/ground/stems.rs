//! Stems, where nothing else was seen near the ground.
//!
//! Under a canopy the scanner may see stems and crowns, but no ground: undergrowth hides it, or its points
//! have been removed. Then nearly all columns have their low in a crown. A quantile of the lows lies in the
//! crowns, too, and the feet of the stems lie below it, as multipath lies below a road. Two properties
//! distinguish them:
//!
//! * A stem is occupied without a gap from its low upwards. Between a road and a reflection or stray return
//!   below it, there is a gap.
//! * Many columns have their low on a road. The lows of crowns are at all heights.
//!
//! So the feet of stems that begin below the quantile determine the floor if these stem columns are at least
//! half as many as the columns with their low at the quantile.

use crate::spatial::VoxelIndex;

/// Smallest number of stem columns (chosen: a thick stem or two thin ones).
const FEWEST: usize = 3;

/// Smallest ratio of their number to that of the columns with their low at the quantile.
/// `benches/results/ground.md` has how often this happens.
const SHARE: f64 = 0.5;

/// Whether each column is a stem: its voxels are occupied without a gap from the lowest one up to `height`
/// lattice units above.
pub(super) fn columns(index: &VoxelIndex, height: i64) -> Vec<bool> {
    let edge = i64::from(index.grid().edge);
    let is_stem = |column: usize| {
        let voxels = &index.heights()[index.column_voxels(column)];
        let run = voxels.chunk_by(|below, above| above - below == 1).next().unwrap_or_default();
        i64::try_from(run.len()).unwrap_or(i64::MAX).saturating_mul(edge) >= height
    };
    (0..index.columns().len()).map(is_stem).collect()
}

/// The foot of the lowest of the `stems`, if they show that `level`, a quantile of `lows`, is not the ground.
/// `stems` has the lows of the stem columns. Lows that are not more than `depth` below `level` are removed.
/// `depth` is how far ground may lie from the level.
pub(super) fn feet(level: u32, lows: &[u32], stems: &mut Vec<u32>, depth: u32) -> Option<u32> {
    stems.retain(|&low| low < level.saturating_sub(depth));
    if stems.len() < FEWEST {
        return None;
    }
    let at_level = lows.iter().filter(|low| low.abs_diff(level) <= depth).count();
    if (stems.len() as f64) < SHARE * at_level as f64 { None } else { stems.iter().copied().min() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Lattice, TileCloud};

    #[test]
    fn a_stem_has_no_gap_above_its_low() {
        let column = |i: i64, levels: &[i64]| levels.iter().map(|k| [i * 10, 0, k * 10]).collect::<Vec<_>>();
        let points = [column(0, &[3, 4, 5, 6]), column(1, &[0, 4, 5, 6, 7]), column(2, &[3, 4, 5])].concat();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let index = VoxelIndex::build("test", &cloud, 10).unwrap();
        assert_eq!(columns(&index, 40), [true, false, false]);
        assert_eq!(columns(&index, 30), [true, false, true]);
    }

    #[test]
    fn stems_count_where_few_columns_are_at_the_level() {
        let found = |level, lows: &[u32], stems: &[u32]| feet(level, lows, &mut stems.to_vec(), 30);
        let stems = [102, 100, 101];
        let at_level = |count| [&stems[..], &vec![530; count], &[900; 9]].concat();
        assert_eq!(found(500, &at_level(6), &stems), Some(100));
        assert_eq!(found(500, &at_level(7), &stems), None, "a road");
        assert_eq!(found(500, &at_level(6), &stems[1..]), None, "two columns");
        assert_eq!(found(500, &at_level(6), &[102, 101, 470]), None, "one of them is on the level");
        assert_eq!(found(500, &at_level(6), &[102, 101, 469]), Some(101));
    }
}
