//! The box of least area around an object in the plane.
//!
//! One side of it lies on an edge of the convex hull (Freeman and Shapira, Communications of the ACM 18,
//! 409-413, 1975, doi:10.1145/360881.360919), so every edge is tried.

/// A rectangle by its sides and the direction of the longer one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rectangle {
    /// Longer side.
    pub(crate) length: f64,
    /// Shorter side.
    pub(crate) width: f64,
    /// Direction of the longer side in degrees clockwise from north (the y axis), from 0 up to 180. `None`
    /// for a point.
    pub(crate) azimuth_deg: Option<f64>,
    /// Its middle.
    pub(crate) middle: [f64; 2],
}

/// The box of least area around a convex hull, in the units of the hull.
pub(crate) fn least_area(hull: &[[i64; 2]]) -> Rectangle {
    let middle = hull.first().map_or([0.0; 2], |point| point.map(|value| value as f64));
    let mut best = Rectangle { length: 0.0, width: 0.0, azimuth_deg: None, middle };
    let mut least = f64::INFINITY;
    for (number, from) in hull.iter().enumerate() {
        let to = hull[(number + 1) % hull.len()];
        // Differences are exact, because differences of lattice coordinates are below 2^51.
        let along = [(to[0] - from[0]) as f64, (to[1] - from[1]) as f64];
        let side = along[0].hypot(along[1]);
        if side <= 0.0 {
            continue;
        }
        let along = along.map(|value| value / side);
        let across = [-along[1], along[0]];
        let ends = [along, across].map(|way| ends(hull, from, way));
        let [a, b] = ends.map(|[least, most]| most - least);
        // Rounding must not decide between equal boxes, for example those on opposite sides.
        if a * b < least * (1.0 - 1e-12) {
            least = a * b;
            let (length, width, direction) = if a >= b { (a, b, along) } else { (b, a, across) };
            let [u, v] = ends.map(|[least, most]| f64::midpoint(least, most));
            let middle = [0, 1].map(|k| from[k] as f64 + u * along[k] + v * across[k]);
            best = Rectangle { length, width, azimuth_deg: Some(azimuth_deg(direction)), middle };
        }
        if hull.len() == 2 {
            break;
        }
    }
    best
}

/// Where a hull begins and ends along a direction of length 1, measured from `origin`.
fn ends(hull: &[[i64; 2]], origin: &[i64; 2], along: [f64; 2]) -> [f64; 2] {
    let at = |p: &[i64; 2]| (p[0] - origin[0]) as f64 * along[0] + (p[1] - origin[1]) as f64 * along[1];
    let least = hull.iter().map(at).fold(f64::INFINITY, f64::min);
    [least, hull.iter().map(at).fold(f64::NEG_INFINITY, f64::max)]
}

/// Extent of a hull along a direction of length 1.
fn extent(hull: &[[i64; 2]], origin: &[i64; 2], along: [f64; 2]) -> f64 {
    let [least, most] = ends(hull, origin, along);
    most - least
}

/// A direction without sign, in degrees clockwise from north, from 0 up to 180.
fn azimuth_deg(direction: [f64; 2]) -> f64 {
    let degrees = direction[0].atan2(direction[1]).to_degrees().rem_euclid(180.0);
    // A tiny negative angle gives 180.
    if degrees >= 180.0 { 0.0 } else { degrees }
}

/// The longest extent of a hull and the extent across it, in the units of the hull.
pub(crate) fn longest_and_across(hull: &[[i64; 2]]) -> [f64; 2] {
    let mut longest = (0.0, [1.0, 0.0]);
    for (number, a) in hull.iter().enumerate() {
        for b in &hull[number + 1..] {
            let d = [(b[0] - a[0]) as f64, (b[1] - a[1]) as f64];
            let length = d[0].hypot(d[1]);
            if length > longest.0 {
                longest = (length, d.map(|value| value / length));
            }
        }
    }
    let (length, along) = longest;
    let across = hull.first().map_or(0.0, |first| extent(hull, first, [-along[1], along[0]]));
    [length, across]
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "lengths of tests")]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::model::convex_hull;

    #[test]
    fn boxes_have_sides_and_directions() {
        let found = least_area(&[[0, 0], [4, 0], [4, 2], [0, 2]]);
        assert_eq!((found.length, found.width, found.azimuth_deg), (4.0, 2.0, Some(90.0)));
        let is_at = |found: [f64; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9)
        };
        assert!(is_at(found.middle, [2.0, 1.0]));
        let turned = least_area(&[[0, 0], [300, 400], [220, 460], [-80, 60]]);
        assert!((turned.length - 500.0).abs() < 1e-9 && (turned.width - 100.0).abs() < 1e-9, "{turned:?}");
        assert!((turned.azimuth_deg.unwrap() - 36.869_897_645_844).abs() < 1e-9, "{turned:?}");
        assert!(is_at(turned.middle, [110.0, 230.0]));
        let point = Rectangle { length: 0.0, width: 0.0, azimuth_deg: None, middle: [7.0; 2] };
        assert_eq!(least_area(&[[7, 7]]), point);
        let line = least_area(&[[0, 0], [0, 9]]);
        assert_eq!((line.length, line.width, line.azimuth_deg), (9.0, 0.0, Some(0.0)));
    }

    #[test]
    fn the_extent_across_is_that_at_a_right_angle_to_the_longest() {
        let doubled = |hull: &[[i64; 2]]| longest_and_across(hull).map(|value| (2.0 * value).round() as i64);
        assert_eq!(doubled(&[[0, 0], [10, 0], [4, 3], [5, -2]]), [20, 10]);
        assert_eq!(doubled(&[[3, 3]]), [0, 0]);
    }

    proptest! {
        /// No direction, in steps of a tenth of a degree, has a smaller box.
        #[test]
        fn no_box_is_smaller(points in prop::collection::vec([-500..500_i64, -500..500_i64], 3..40)) {
            let hull = convex_hull(&mut points.clone());
            let found = least_area(&hull);
            prop_assert!(found.length >= found.width);
            for step in 0..900_i32 {
                let (sin, cos) = (f64::from(step) * 0.1).to_radians().sin_cos();
                let area = extent(&hull, &hull[0], [cos, sin]) * extent(&hull, &hull[0], [-sin, cos]);
                prop_assert!(found.length * found.width <= area * (1.0 + 1e-9) + 1e-9);
            }
        }
    }
}
