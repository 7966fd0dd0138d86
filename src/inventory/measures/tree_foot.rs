//! Where a tree stands: whether a stem belongs to it, and its place if no stem was found.
//!
//! An apparent stem may be hanging leaves, a post, or the stem of the next tree. Every tree has three
//! candidate places: its lowest part, the middle of its crown, and the foot of the stem that was found, if
//! any. They must agree. Measured on 1,184 trees of the labelled scenes and of five drives of `synth`:
//! `benches/results/attributes.md`, "Where trees stand".

use super::circle::length;

/// Largest distance of the foot of a stem from the middle of the lowest part of its tree, in metres.
const AT_LOWEST_M: f64 = 0.4;
/// Largest width of a lowest part that can be a stem, in metres. A wider one belongs to the crown. Measured
/// on 23 trees of `synth` that had no direction and were not low: it was at most 0.42 m wide, or at least
/// 1.04 m.
const WIDEST_STEM_M: f64 = 0.7;
/// Smallest number of the ten layers above the lowest point of a tree that have points at a narrow lowest
/// part which is the stem. With 1, single points below a crown became stems; with 5, thin stems were lost.
const LEAST_LAYERS: usize = 3;
/// Largest distance of a stem from the middle of the crown, as a share of the radius of the tree, unless it
/// ends in the lowest part. Of 944 stems that were right within 0.2 m, 99 in 100 had at most 0.46.
const OFF_MIDDLE: f64 = 0.5;

/// The candidate places of a tree, in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct TreeFoot {
    /// Middle of its crown, from above.
    pub(super) middle: [f64; 2],
    /// Half of the mean of its extents.
    pub(super) radius_m: f64,
    /// Middle of its lowest part.
    pub(super) lowest: [f64; 2],
    /// Width of its lowest part.
    pub(super) width_m: f64,
    /// Number of the ten lowest layers that have points at its lowest part.
    pub(super) layers: usize,
}

impl TreeFoot {
    /// Whether a stem with this foot belongs to the tree. A stem without a direction may be leaves, because
    /// too few of its circles were seen.
    pub(super) fn has_stem_at(&self, foot: [f64; 2], has_direction: bool) -> bool {
        if apart(foot, self.lowest) <= AT_LOWEST_M {
            return true;
        }
        let stands_on_another = self.stands_on_lowest() && self.layers >= LEAST_LAYERS;
        (has_direction || !stands_on_another) && self.is_near_middle(foot)
    }

    /// Where the tree stands if no stem was found: on a narrow lowest part, else below the middle of its
    /// crown.
    pub(super) fn without_stem(&self) -> [f64; 2] {
        if self.stands_on_lowest() { self.lowest } else { self.middle }
    }

    fn stands_on_lowest(&self) -> bool {
        self.width_m <= WIDEST_STEM_M && self.is_near_middle(self.lowest)
    }

    fn is_near_middle(&self, place: [f64; 2]) -> bool {
        apart(place, self.middle) <= OFF_MIDDLE * self.radius_m
    }
}

fn apart(one: [f64; 2], other: [f64; 2]) -> f64 {
    length([0, 1].map(|k| one[k] - other[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crown of 4 m around (0, 0) on a thin stem at (0.5, 0).
    const TREE: TreeFoot =
        TreeFoot { middle: [0.0; 2], radius_m: 2.0, lowest: [0.5, 0.0], width_m: 0.2, layers: 6 };

    #[test]
    fn a_stem_ends_in_the_lowest_part_of_its_tree() {
        assert!(TREE.has_stem_at([0.5, 0.3], false));
        // Hanging leaves, although they are nearer to the middle. With circles, it is a stem.
        assert!(!TREE.has_stem_at([0.0, 0.3], false));
        assert!(TREE.has_stem_at([0.0, 0.3], true));
        assert!(apart(TREE.without_stem(), [0.5, 0.0]) < 1e-9);
        // A single point below the crown may be anything.
        assert!(TreeFoot { layers: 1, ..TREE }.has_stem_at([0.0, 0.3], false));
    }

    #[test]
    fn a_stem_is_near_the_middle_if_the_lowest_part_is_of_the_crown() {
        let wide = TreeFoot { lowest: [1.2, 0.0], width_m: 2.5, ..TREE };
        assert!(wide.has_stem_at([-0.9, 0.0], false));
        assert!(!wide.has_stem_at([-1.1, 0.0], true), "a post at the edge of the crown");
        assert!(apart(wide.without_stem(), [0.0, 0.0]) < 1e-9);
        // A tree that was cut on one side, as beside a road, stands on a stem at its edge.
        assert!(wide.has_stem_at([1.5, 0.0], false));
    }

    #[test]
    fn what_hangs_far_from_the_middle_is_no_stem() {
        let hanging = TreeFoot { lowest: [1.8, 0.0], ..TREE };
        assert!(apart(hanging.without_stem(), [0.0, 0.0]) < 1e-9);
        assert!(hanging.has_stem_at([0.1, 0.0], false));
    }
}
