//! Attribute `height`: how far above the ground the object begins and ends.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::measures::crest_m;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Height;

impl Attribute for Height {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "height_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "height of the highest point above the ground at the base; a few points above \
                             a gap do not count, nor do the highest 1 in 200 points of a wire; of a fence, \
                             hedge or wall longer than 4 m, the height above the ground below it that nine \
                             tenths of it do not exceed, if that is less; empty if no ground is within 10 \
                             m",
            },
            Column {
                name: "base_above_ground_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "height of the lowest point above `ground_z`; a few points below a gap do not \
                             count, unless a tree or pole can have them as its stem, nor do points more than 1 \
                             m below the ground; empty if `ground_z` is empty",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let highest_m = object.site.lattice.metres(object.ends.top);
        let over_base_m = object.foot.ground_m.map(|ground_m| highest_m - ground_m);
        let Object { part, measures, frames, .. } = object;
        let crest_m = crest_m(part, object.ends.top, object.kind, measures, frames, object.site);
        // Where the ground beside a fence is lower, as at a terrace, the ground below its cells can be too
        // low. Then the height over the ground at the base is the smaller one.
        let crest_m =
            crest_m.map(|crest_m| over_base_m.map_or(crest_m, |over_base_m| crest_m.min(over_base_m)));
        values.push(crest_m.or(over_base_m).into());
        values.push(object.above_ground_m(object.ends.bottom).into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, as_decimals, decimals, near, values_of};
    use crate::model::Kind;

    #[test]
    fn heights_are_metres_whatever_the_units_of_the_input() {
        let ground = [([1, 3], 250)];
        for units_m in [METRES, FEET] {
            assert!(near(&decimals(&Height, &ground, units_m), &[3.798, 0.75]));
        }
        // A lowest point below the mean of the ground.
        assert!(near(&decimals(&Height, &[([1, 3], 1_100)], METRES), &[2.948, -0.1]));
    }

    #[test]
    fn a_few_points_beyond_a_gap_do_not_count() {
        let post = (0..300).map(|k| [1_000 + k % 7, 3_000, 250 + k * 10]);
        let strays = [[1_000, 3_000, 6_000], [1_010, 3_000, -1_500]];
        let points: Vec<[i64; 3]> = post.chain(strays).collect();
        for class in [0, 3] {
            let kind = Kind::new(class, 255);
            let found = as_decimals(&values_of(&Height, &points, kind, &[([1, 3], 250)], METRES));
            assert!(near(&found, &[2.99, 0.0]), "{found:?}");
        }
    }

    #[test]
    fn the_height_of_a_long_hedge_is_that_of_most_of_it_over_the_ground_below_it() {
        // 10 m on a slope of 10 %, 1.4 m high, with leaves above a twentieth of it.
        let cells = (-3..14).flat_map(|x| (-2..3).map(move |y| [x, y]));
        let ground: Vec<([i32; 2], i64)> = cells.map(|cell| (cell, 50 + 100 * i64::from(cell[0]))).collect();
        let over = |x: i64, z: i64| [x, 500, x / 10 + z];
        let hedge = (0..1_000).flat_map(|x| (0..8).map(move |z| over(10 * x, 200 * z)));
        let leaves = (950..1_000).flat_map(|x| (8..14).map(move |z| over(10 * x, 200 * z)));
        let points: Vec<[i64; 3]> = hedge.chain(leaves).collect();
        let height_m = |class, points: &[[i64; 3]]| {
            let values = values_of(&Height, points, Kind::new(class, 255), &ground, METRES);
            as_decimals(&values)[0].unwrap()
        };
        assert!((height_m(6, &points) - 1.4).abs() < 0.03, "{}", height_m(6, &points));
        assert!(height_m(2, &points) > 2.5, "a tree ends at its highest point");
        let bush: Vec<[i64; 3]> = points.iter().copied().filter(|point| point[0] > 6_500).collect();
        assert!(height_m(6, &bush) > 2.5, "so does a bush: {}", height_m(6, &bush));
    }

    #[test]
    fn without_ground_nearby_the_values_are_missing() {
        assert_eq!(decimals(&Height, &[], FEET), [None, None]);
    }
}
