//! Attribute `base`: where the object stands.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Base;

const fn coordinate(name: &'static str, definition: &'static str) -> Column {
    let column_type = ColumnType::Decimal { places: 3 };
    Column { name, column_type, unit: ColumnUnit::Input, definition }
}

impl Attribute for Base {
    fn columns(&self) -> &'static [Column] {
        const {
            &[
                coordinate(
                    "base_x",
                    "x of the place where the object stands: of a pole or stem, its axis at the ground; of \
                     a tree whose stem was not seen, its narrow lowest part or else the middle of its \
                     crown; of a building, the middle of its front; of a vehicle, the middle of its box; \
                     of others, the middle of the lowest 0.3 m; only the axis of a leaning pole or stem \
                     leads out of the box of the points",
                ),
                coordinate("base_y", "y of that place"),
                coordinate(
                    "base_z",
                    "z of the ground at that place; of a building, z of the ground in front of it, \
                     continued to that place; not above the foot of a stem, nor above most of the lowest \
                     0.3 m, apart from a few points below a gap; z of the lowest point if no ground is \
                     within 10 m",
                ),
            ]
        }
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.extend(object.base().map(Value::Decimal));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, decimals, near, values_of};
    use crate::model::Kind;

    #[test]
    fn without_a_stem_it_is_the_middle_of_the_lowest_part() {
        // Only the two low corners are in the lowest part. Cells are 0.1 m wide.
        assert!(near(&decimals(&Base, &[([1, 3], 250)], METRES), &[1.55, 3.05, 0.25]));
        assert!(near(&decimals(&Base, &[], FEET), &[1.55 / 0.304_8, 3.05 / 0.304_8, 1.0 / 0.304_8]));
        // On a step, both corners have the same height above the ground.
        let step = [([0, 0], 0), ([3, 0], 0), ([3, 6], 3_000)];
        let high = [[50, 50, 200], [3_050, 50, 200], [3_050, 6_050, 3_100]];
        let found = as_decimals(&values_of(&Base, &high, NO_KIND, &step, METRES));
        assert!(near(&found[..2], &[2.05, 2.05]), "{found:?}");
    }

    #[test]
    fn the_base_is_in_the_box_of_the_object() {
        let base = |points: &[[i64; 3]], class: u8| {
            let kind = Kind::new(class, 255);
            let found = as_decimals(&values_of(&Base, points, kind, &[([0, 0], 0)], METRES));
            [found[0].unwrap(), found[1].unwrap()]
        };
        for class in [0, 2, 3, 4, 5, 6, 7, 8] {
            // A cell has a width, and a point has none.
            assert_eq!(base(&[[317, 409, 900]], class).map(f64::to_bits), [0.317, 0.409].map(f64::to_bits));
            assert_eq!(base(&[[317, 409, 900], [321, 409, 904]], class)[1].to_bits(), 0.409_f64.to_bits());
        }
        // A pole that leans by 0.1 m per metre, whose lower half is hidden: its axis leads to its foot.
        let pole: Vec<[i64; 3]> =
            (300..600).map(|k| [500 + k + (k % 7) * 4 - 12, 700 + (k % 5) * 4 - 8, k * 10]).collect();
        let [x, _] = base(&pole, 3);
        assert!((x - 0.5).abs() < 0.02, "{x}");
    }

    #[test]
    fn a_plant_with_leaves_down_to_the_ground_stands_in_their_middle() {
        // Leaves that arch to the ground 1.5 m away. They are dense on the side that the scanner saw.
        let mut leaves = Vec::new();
        for step in 0..600_i64 {
            let (angle, along) = ((step % 40) as f64 * 0.157, step / 40);
            let reach = 100 + 100 * along;
            let side = |value: f64| (value * reach as f64).round();
            #[expect(clippy::cast_possible_truncation, reason = "millimetres of a plant")]
            let [x, y] = [side(angle.cos()) as i64, side(angle.sin()) as i64];
            leaves.push([5_000 + x, 3_000 + y, 1_100 - along * along * 5]);
        }
        leaves.extend((0..90).map(|z| [6_500 + z % 3 * 10, 3_000 + z % 5 * 10, z * 10]));
        let base = |height: i64| {
            let points: Vec<[i64; 3]> = leaves.iter().map(|[x, y, z]| [*x, *y, z * height]).collect();
            let kind = Kind::new(2, 255);
            let found = as_decimals(&values_of(&Base, &points, kind, &[([5, 3], 0)], METRES));
            (found[0].unwrap() - 5.0).hypot(found[1].unwrap() - 3.0)
        };
        assert!(base(1) < 0.02, "{}", base(1));
        // Three times as high, a column that stands by itself is a stem.
        assert!(base(3) > 1.4, "{}", base(3));
    }

    #[test]
    fn single_cells_of_the_ground_or_of_the_object_do_not_move_the_base() {
        // A facade of 20 m along y = 0.05 m on ground at 0.2 m.
        let facade = || (0..4_000_i64).map(|n| [n % 200 * 100 + 50, 50, 220 + n / 200 * 200]);
        let ground: Vec<([i32; 2], i64)> = (0..20).map(|i| ([i, 0], 200)).collect();
        let base = |points: &[[i64; 3]], ground: &[([i32; 2], i64)]| {
            let found = as_decimals(&values_of(&Base, points, NO_KIND, ground, METRES));
            found.into_iter().map(Option::unwrap).collect::<Vec<f64>>()
        };
        let plain: Vec<[i64; 3]> = facade().collect();
        let expected = base(&plain, &ground);
        assert!((expected[0] - 10.0).abs() < 1e-6 && (expected[2] - 0.2).abs() < 1e-6, "{expected:?}");
        // Reflections below the ground at every height, so that no gap separates them from the facade.
        let reflections = (0..30).map(|n| [4_050 + n % 3 * 100, 50, 200 - n * 100]);
        let found = base(&facade().chain(reflections).collect::<Vec<_>>(), &ground);
        assert!((found[0] - 10.0).abs() < 0.1 && (found[2] - 0.2).abs() < 1e-6, "{found:?}");
        // One cell of the ground model is a roof.
        let mut roof = ground.clone();
        roof[15].1 = 2_400;
        let found = base(&plain, &roof);
        assert!((found[0] - 10.0).abs() < 0.1 && (found[2] - 0.2).abs() < 1e-6, "{found:?}");
        // Where the ground model is too high everywhere, the object decides.
        let high: Vec<([i32; 2], i64)> = (0..20).map(|i| ([i, 0], 1_200)).collect();
        assert!((base(&plain, &high)[2] - 0.22).abs() < 1e-6);
    }

    #[test]
    fn a_crown_without_stem_stands_in_its_middle() {
        // A crown of 6 m, 2.5 m above the ground. Its lowest leaves are on the side that the scanner saw.
        let base = |layer: i64| {
            let crown = (0..7_200_i64).map(|n| {
                let (i, j, k) = (n % 60, n / 60 % 60, n / 3_600);
                [2_000 + 100 * i, 1_000 + 100 * j, 2_900 + layer * k + 7 * (i - 30).abs()]
            });
            let low = (0..40).map(|n| [7_000 + n % 8 * 150, 1_500 + n / 8 * 150, 2_500]);
            let points: Vec<[i64; 3]> = crown.chain(low).collect();
            as_decimals(&values_of(&Base, &points, Kind::new(2, 255), &[([5, 3], 0)], METRES))
        };
        // A crown that is lower than wide stands in the middle of its extents.
        assert!(near(&base(3_000), &[(2.0 + 8.05) / 2.0, (1.0 + 6.9) / 2.0, 0.0]), "{:?}", base(3_000));
        let found = base(6_000);
        let off = (found[0].unwrap() - 4.95).hypot(found[1].unwrap() - 3.95);
        assert!(off < 0.1 && found[2] == Some(0.0), "{found:?}");
    }

    #[test]
    fn the_ground_of_a_building_is_that_of_the_street() {
        // A facade along y = 12 m. The axis is y = 5 m. Behind the panes, a floor 0.4 m above the street was
        // classified as ground. One of its cells is a reflection far below.
        let wall = (0..3_000_i64).map(|n| [n % 100 * 100 + 50, 12_050, 20 + n / 100 * 200]);
        let inside =
            (0..6_000_i64).map(|n| [n % 100 * 100 + 50, 12_500 + n / 100 % 20 * 100, 420 + n / 2_000]);
        let points: Vec<[i64; 3]> = wall.chain(inside).collect();
        let street = (0..10).flat_map(|i| (6..12).map(move |j| ([i, j], 0)));
        let floor = (0..10)
            .flat_map(|i| (12..15).map(move |j| ([i, j], if [i, j] == [5, 12] { -7_700 } else { 410 })));
        let ground: Vec<_> = street.chain(floor).collect();
        let kind = Kind::new(5, 255);
        let found = as_decimals(&values_of(&Base, &points, kind, &ground, METRES));
        // The plane through the surrounding cells is partly raised by the floor.
        assert!((found[2].unwrap()).abs() < 0.1 && (found[1].unwrap() - 12.05).abs() < 0.1, "{found:?}");
        // Reflections of the facade deep inside are not its front.
        let reflections = (0..40_i64).map(|n| [4_550 + n % 3 * 100, 14_050, -6_000 + n * 40]);
        let with: Vec<_> = points.iter().copied().chain(reflections).collect();
        let with = as_decimals(&values_of(&Base, &with, kind, &ground, METRES));
        assert!((with[1].unwrap() - 12.05).abs() < 0.1 && with[2].unwrap().abs() < 0.1, "{with:?}");
        // For other objects, the ground is that of the place where they stand.
        let found = as_decimals(&values_of(&Base, &points, NO_KIND, &ground, METRES));
        assert!(found[2].unwrap() > 0.3, "{found:?}");
    }

    #[test]
    fn a_building_stands_at_its_wall_on_the_ground_that_rises_to_it() {
        // Ground rises by 0.1 m per metre from the axis at y = 5 m to the wall at y = 12.05 m. Behind it is a
        // floor 1 m higher. Eaves overhang the street by 0.6 m, 4 m above it.
        let wall = (0..3_000_i64).map(|n| [n % 100 * 100 + 50, 12_050, 705 + n / 100 * 200]);
        let eaves = (0..600_i64).map(|n| [n % 100 * 100 + 50, 11_450 + n / 100 * 100, 4_700]);
        let points: Vec<[i64; 3]> = wall.chain(eaves).collect();
        let rise = (0..10).flat_map(|i| (6..12).map(move |j| ([i, j], 100 * i64::from(j) - 450)));
        let floor = (0..10).flat_map(|i| (12..16).map(move |j| ([i, j], 1_700)));
        let ground: Vec<_> = rise.chain(floor).collect();
        let kind = Kind::new(5, 255);
        let found = as_decimals(&values_of(&Base, &points, kind, &ground, METRES));
        let away = [(0, 5.0), (1, 12.05), (2, 0.7)].map(|(k, expected)| (found[k].unwrap() - expected).abs());
        assert!(away.iter().all(|away| *away < 0.06), "{found:?}");
    }

    #[test]
    fn ground_that_is_a_roof_elsewhere_does_not_lower_a_building() {
        // A wall along y = 12.05 m that begins 0.4 m above the street. Before 3 of its 10 m, the model is a
        // roof 13 m higher. The axis is y = 5 m.
        let wall: Vec<[i64; 3]> =
            (0..6_000_i64).map(|n| [n % 100 * 100 + 50, 12_050, 400 + n / 100 * 250]).collect();
        let street = (0..10).flat_map(|i| (6..12).map(move |j| ([i, j], if i < 7 { 0 } else { 13_000 })));
        let found =
            as_decimals(&values_of(&Base, &wall, Kind::new(5, 255), &street.collect::<Vec<_>>(), METRES));
        assert!(found[2].unwrap().abs() < 0.1, "{found:?}");
    }

    #[test]
    fn a_porch_or_a_door_in_the_middle_is_not_the_front_of_a_building() {
        // A wall along y = 12.05 m. The axis is y = 5 m.
        let wall = |door: bool| {
            (0..4_000_i64)
                .map(|n| [n % 100 * 100 + 50, 12_050, 20 + n / 100 * 200])
                .filter(move |[x, _, _]| !door || !(3_500..6_500).contains(x))
        };
        // A room behind the door, and a porch 1.5 m before the wall.
        let room = (0..900_i64).map(|n| [3_500 + n % 30 * 100, 14_050, 20 + n / 30 * 100]);
        let porch = (0..900_i64).map(|n| [3_500 + n % 30 * 100, 10_550, 20 + n / 30 * 100]);
        let ground: Vec<_> = (0..10).flat_map(|i| (6..12).map(move |j| ([i, j], 0))).collect();
        for points in [wall(true).chain(room).collect::<Vec<_>>(), wall(false).chain(porch).collect()] {
            let found = as_decimals(&values_of(&Base, &points, Kind::new(5, 255), &ground, METRES));
            assert!((found[0].unwrap() - 5.0).abs() < 0.06, "{found:?}");
            assert!((found[1].unwrap() - 12.05).abs() < 0.1 && found[2].unwrap().abs() < 0.06, "{found:?}");
        }
    }

    #[test]
    fn a_vehicle_stands_in_the_middle_of_its_box() {
        // A side of 4 m by 1.5 m that begins at the ground, and a roof of 1.8 m that is visible above it.
        let side = (0..600_i64).map(|n| [1_000 + n % 40 * 100, 3_000, n / 40 * 100]);
        let roof = (0..720_i64).map(|n| [1_000 + n % 40 * 100, 3_000 + n / 40 * 100, 1_500]);
        let points: Vec<[i64; 3]> = side.chain(roof).collect();
        let base = |class: u8| {
            let kind = Kind::new(class, 255);
            as_decimals(&values_of(&Base, &points, kind, &[([2, 3], 0)], METRES))
        };
        assert!(near(&base(4), &[2.95, 3.85, 0.0]), "{:?}", base(4));
        assert!(base(7)[1].unwrap() < 3.1, "another object stands where its lowest part is");
    }

    #[test]
    fn reflections_far_below_a_tree_do_not_hide_its_stem() {
        let stem = (0..2_000_i64).map(|n| {
            let angle = n as f64 * 0.31;
            #[expect(clippy::cast_possible_truncation, reason = "millimetres of a stem")]
            let [x, y] = [angle.cos(), angle.sin()].map(|value| (150.0 * value).round() as i64);
            [5_500 + x, 3_500 + y, 250 + n * 2]
        });
        let crown =
            (0..3_000_i64).map(|n| [4_300 + n * 7 % 2_400, 2_300 + n * 13 % 2_400, 4_300 + n % 20 * 100]);
        let strays = (0..9).map(|n| [5_500 + n * 300, 3_500, -5_000 + n * 100]);
        let points: Vec<[i64; 3]> = stem.chain(crown).chain(strays).collect();
        let kind = Kind::new(2, 255);
        let found = as_decimals(&values_of(&Base, &points, kind, &[([5, 3], 250)], METRES));
        let away = [(0, 5.5), (1, 3.5), (2, 0.25)].map(|(k, expected)| (found[k].unwrap() - expected).abs());
        assert!(away.iter().all(|away| *away < 0.02), "{found:?}");
    }

    #[test]
    fn the_base_of_a_pole_is_its_axis_at_the_ground() {
        // Leaning by 0.1 m per metre towards the east; the ground is at 0.2 m.
        let pole: Vec<[i64; 3]> =
            (30..630).map(|k| [5_000 + k + (k % 7) * 4 - 12, 700 + (k % 5) * 4 - 8, k * 10]).collect();
        let kind = Kind::new(3, 255);
        let found = as_decimals(&values_of(&Base, &pole, kind, &[([5, 0], 200)], METRES));
        let away = [(0, 5.02), (1, 0.7), (2, 0.2)].map(|(k, expected)| (found[k].unwrap() - expected).abs());
        assert!(away[0] < 0.01 && away[1] < 0.01 && away[2] < 1e-9, "{found:?}");
    }
}
