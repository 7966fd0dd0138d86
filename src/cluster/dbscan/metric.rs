//! `dbscan` on x, y and z in metres.

use super::core_points;
use super::settings::{DbscanConfig, DbscanVariant, NAME};
use crate::cluster::linking::single_link;
use crate::model::{AlgorithmError, TileCloud};

/// Labels the points of a tile. The tile owns the points where `core` is true. `epsilon` is in metres.
pub(super) fn label(
    config: &DbscanConfig,
    epsilon: f64,
    cloud: &TileCloud,
    core: &[bool],
    labels: &mut [u32],
) -> Result<u32, AlgorithmError> {
    let reach = cloud.lattice.units(epsilon);
    match config.variant {
        DbscanVariant::Size => single_link(NAME, cloud, reach, labels),
        DbscanVariant::Core => {
            let least = u32::try_from(config.min_points).unwrap_or(u32::MAX);
            core_points::cluster(NAME, cloud, core, reach, least, labels)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::{Clusterer, Dbscan};
    use crate::model::Lattice;

    fn core(min_points: u64, points: &[[i64; 3]], own: &[bool]) -> (Vec<u32>, u32) {
        let config = DbscanConfig {
            variant: DbscanVariant::Core,
            epsilon: 0.1.into(),
            min_points,
            ..DbscanConfig::default()
        };
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut labels = vec![u32::MAX; points.len()];
        let clusters = Dbscan::new(&config).unwrap().cluster_tile(&cloud, own, &mut labels).unwrap();
        (labels, clusters)
    }

    fn line(places: &[i64]) -> Vec<[i64; 3]> {
        places.iter().map(|&x| [x, 0, 0]).collect()
    }

    #[test]
    fn border_points_join_the_nearest_core_point_and_noise_nothing() {
        // Two groups of five core points, 200 apart. The point at 140 is 100 from 240 (id 0) and from 40 (id
        // 9), which is the first by x. The point at 139 is within 100 of 40 only.
        let places = [240, 260, 280, 300, 320, -40, -20, 0, 20, 40, 140, 139, 900];
        let (labels, clusters) = core(5, &line(&places), &[true; 13]);
        assert_eq!((labels, clusters), (vec![1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 0], 2));
    }

    #[test]
    fn border_points_of_other_tiles_have_no_label() {
        let places = [0, 50, 100, 150];
        // Three neighbours within 100: 50 and 100 are core points (they have four), 0 and 150 have three.
        assert_eq!(core(4, &line(&places), &[true; 4]).0, [1, 1, 1, 1]);
        assert_eq!(core(4, &line(&places), &[true, true, false, false]).0, [1, 1, 1, 0]);
    }

    #[test]
    fn core_reaches_twice_as_far() {
        for (variant, metres) in [(DbscanVariant::Size, 0.3), (DbscanVariant::Core, 0.6)] {
            let method = Dbscan::new(&DbscanConfig { variant, ..DbscanConfig::default() }).unwrap();
            assert!((method.reach(Lattice::MILLIMETRE).metres() - metres).abs() < 1e-12);
        }
    }
}
