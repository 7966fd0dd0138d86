//! Sums and maxima over windows of a raster: summed-area tables, running maxima, and moments over discs by
//! prefix sums of rows. All values are integers, so every sum is exact.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "positions in a raster of about a hundred cells per edge"
)]

/// Sums over rectangles of `N` values per cell.
#[derive(Debug, Default)]
pub(crate) struct Sums<const N: usize> {
    width: usize,
    height: usize,
    /// Sum over all cells with smaller row and smaller column, `(height + 1) x (width + 1)`.
    sums: Vec<[u32; N]>,
}

impl<const N: usize> Sums<N> {
    /// Takes the values of `height` rows of `width` cells.
    pub(crate) fn fill(&mut self, height: usize, width: usize, value: impl Fn(usize, usize) -> [u32; N]) {
        self.width = width;
        self.height = height;
        self.sums.clear();
        self.sums.resize((height + 1) * (width + 1), [0; N]);
        for row in 0..height {
            let (above, here) = self.sums[row * (width + 1)..].split_at_mut(width + 1);
            let mut sum = [0; N];
            for column in 0..width {
                let value = value(row, column);
                for lane in 0..N {
                    sum[lane] += value[lane];
                    here[column + 1][lane] = above[column + 1][lane] + sum[lane];
                }
            }
        }
    }

    /// The sum over the cells at most `reach` rows and columns away. Cells outside of the raster are 0.
    #[inline]
    pub(crate) fn window(&self, row: i32, column: i32, reach: i32) -> [u32; N] {
        let clip = |value: i32, end: usize| value.clamp(0, end as i32) as usize;
        let top = clip(row - reach, self.height) * (self.width + 1);
        let bottom = clip(row + reach + 1, self.height) * (self.width + 1);
        let left = clip(column - reach, self.width);
        let right = clip(column + reach + 1, self.width);
        let mut sum = [0; N];
        for (lane, sum) in sum.iter_mut().enumerate() {
            let later = self.sums[bottom + right][lane] - self.sums[bottom + left][lane];
            *sum = later - (self.sums[top + right][lane] - self.sums[top + left][lane]);
        }
        sum
    }
}

/// The maximum over the cells `by` rows or columns before and after each cell, and over the cell itself if
/// `itself`. Cells outside of the raster do not count.
pub(crate) fn spread(values: &[i32], side: usize, by: usize, itself: bool) -> Vec<i32> {
    let mut rows = vec![i32::MIN; values.len()];
    for (out, row) in rows.chunks_exact_mut(side).zip(values.chunks_exact(side)) {
        if itself {
            out.copy_from_slice(row);
        }
        out[by..].iter_mut().zip(row).for_each(|(out, &value)| *out = value.max(*out));
        out[..side - by].iter_mut().zip(&row[by..]).for_each(|(out, &value)| *out = value.max(*out));
    }
    let mut both = if itself { rows.clone() } else { vec![i32::MIN; values.len()] };
    let by = by * side;
    both[by..].iter_mut().zip(&rows).for_each(|(out, &value)| *out = value.max(*out));
    let end = values.len() - by;
    both[..end].iter_mut().zip(&rows[by..]).for_each(|(out, &value)| *out = value.max(*out));
    both
}

/// Weights of a raster, summed along its rows.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    side: usize,
    /// Sums of weight, weight times column and weight times squared column over the cells before each one.
    sums: Vec<[i64; 3]>,
}

impl Rows {
    /// Takes a square raster of weights.
    pub(crate) fn fill(&mut self, side: usize, weights: impl Fn(usize) -> u32) {
        self.side = side;
        self.sums.clear();
        for row in 0..side {
            let mut sums = [0; 3];
            self.sums.push(sums);
            for column in 0..side {
                let weight = i64::from(weights(row * side + column));
                let place = column as i64;
                sums[0] += weight;
                sums[1] += weight * place;
                sums[2] += weight * place * place;
                self.sums.push(sums);
            }
        }
    }

    /// The moments of the weights in the disc of `half_widths` around a cell. The first half width belongs to
    /// the row of the cell, the others to the rows on both sides. The disc lies within the raster.
    pub(crate) fn disc(&self, row: usize, column: usize, half_widths: &[usize]) -> Plane {
        let mut plane = Plane::default();
        let c = column as i64;
        for (step, &half) in half_widths.iter().enumerate() {
            let both = [row + step, row.wrapping_sub(step)];
            for (&at, side) in both.iter().zip([1, -1]).take(1 + usize::from(step > 0)) {
                let start = at * (self.side + 1) + column - half;
                let from = self.sums[start];
                let to = self.sums[start + 2 * half + 1];
                let weight = to[0] - from[0];
                let first = to[1] - from[1];
                let y = first - c * weight;
                let x = side * step as i64;
                plane.n += weight;
                plane.x += x * weight;
                plane.y += y;
                plane.xx += x * x * weight;
                plane.xy += x * y;
                plane.yy += to[2] - from[2] - 2 * c * first + c * c * weight;
            }
        }
        plane
    }
}

/// Half widths of the rows of a disc of `radius` cells, from its middle row outwards.
pub(crate) fn half_widths(radius: usize) -> Vec<usize> {
    (0..=radius).map(|step| (radius * radius - step * step).isqrt()).collect()
}

/// Moments of weights in the plane, relative to a cell, in cells.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Plane {
    pub(crate) n: i64,
    pub(crate) x: i64,
    pub(crate) y: i64,
    pub(crate) xx: i64,
    pub(crate) xy: i64,
    pub(crate) yy: i64,
}

impl Plane {
    /// Elongation (l1 - l2) / l1, standard deviations l2 and l1 along the axes, and distance of the cell to
    /// the line through the mean along the larger axis. Lengths are in cells.
    pub(crate) fn features(&self) -> [f32; 4] {
        if self.n == 0 {
            return [0.0; 4];
        }
        let n = self.n as f64;
        let x = self.x as f64 / n;
        let y = self.y as f64 / n;
        // n^2 times the covariance is an exact integer.
        let entry = |product: i64, sums: i64| (self.n * product - sums) as f64 / (n * n);
        let a = entry(self.xx, self.x * self.x);
        let b = entry(self.xy, self.x * self.y);
        let d = entry(self.yy, self.y * self.y);
        let middle = (a + d) / 2.0;
        let half = (a - d) / 2.0;
        let root = (half * half + b * b).sqrt();
        let l1 = (middle + root).max(0.0).sqrt();
        let l2 = (middle - root).max(0.0).sqrt();
        // cos 2t = half / root and sin 2t = b / root, where t is the direction of the larger axis.
        let cosine2 = if root > 0.0 { half / root } else { 1.0 };
        let cosine = ((1.0 + cosine2) / 2.0).max(0.0).sqrt();
        let sine = ((1.0 - cosine2) / 2.0).max(0.0).sqrt();
        let sine = if b < 0.0 { -sine } else { sine };
        let offset = (cosine * y - sine * x).abs();
        [((l1 - l2) / l1.max(1e-6)) as f32, l2 as f32, l1 as f32, offset as f32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that look random.
    fn value(place: usize) -> u32 {
        let mixed = (place as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
        if mixed.is_multiple_of(3) { (mixed % 97) as u32 } else { 0 }
    }

    #[test]
    fn windows_sum_what_is_inside() {
        let (height, width) = (9, 13);
        let mut sums = Sums::<2>::default();
        sums.fill(height, width, |row, column| [value(row * width + column), 1]);
        for (row, column, reach) in [(0, 0, 1), (4, 6, 2), (8, 12, 5), (-2, 3, 3), (4, 20, 4), (30, 30, 2)] {
            let mut expected = [0, 0];
            for r in 0..height {
                for c in 0..width {
                    if (r as i32 - row).abs() <= reach && (c as i32 - column).abs() <= reach {
                        expected[0] += value(r * width + c);
                        expected[1] += 1;
                    }
                }
            }
            assert_eq!(sums.window(row, column, reach), expected, "{row} {column} {reach}");
        }
    }

    #[test]
    fn maxima_of_windows_come_from_smaller_windows() {
        let side = 40;
        let values: Vec<i32> = (0..side * side).map(|place| value(place) as i32).collect();
        let three = spread(&values, side, 1, true);
        let two = spread(&three, side, 1, false);
        let five = spread(&two, side, 3, true);
        let ten = spread(&five, side, 5, false);
        for (tops, reach) in [(&two, 2), (&five, 5), (&ten, 10)] {
            for row in 10..30 {
                for column in 10..30 {
                    let rows = row - reach..=row + reach;
                    let expected = rows
                        .flat_map(|r| (column - reach..=column + reach).map(move |c| r * side + c))
                        .map(|place| values[place])
                        .max();
                    assert_eq!(Some(tops[row * side + column]), expected);
                }
            }
        }
    }

    #[test]
    fn moments_of_discs_are_those_of_their_cells() {
        let side = 30;
        let mut rows = Rows::default();
        rows.fill(side, value);
        for (row, column, radius) in [(12, 12, 12), (15, 9, 5), (17, 21, 8)] {
            let mut expected = Plane::default();
            for r in 0..side {
                for c in 0..side {
                    let x = r as i64 - row as i64;
                    let y = c as i64 - column as i64;
                    let weight = i64::from(value(r * side + c));
                    if x * x + y * y <= (radius * radius) as i64 {
                        expected.n += weight;
                        expected.x += weight * x;
                        expected.y += weight * y;
                        expected.xx += weight * x * x;
                        expected.xy += weight * x * y;
                        expected.yy += weight * y * y;
                    }
                }
            }
            assert_eq!(rows.disc(row, column, &half_widths(radius)), expected);
        }
    }

    #[test]
    fn a_row_of_columns_is_elongated_along_itself() {
        // Three columns on a diagonal through (1, 0): the cell lies 0.5 sqrt(2) away from their line.
        let mut plane = Plane::default();
        for [x, y] in [[0, -1], [1, 0], [2, 1]] {
            plane.n += 1;
            plane.x += x;
            plane.y += y;
            plane.xx += x * x;
            plane.xy += x * y;
            plane.yy += y * y;
        }
        let [linear, minor, major, offset] = plane.features();
        assert!((linear - 1.0).abs() < 1e-3 && minor < 1e-3, "{linear} {minor}");
        assert!((major - (4.0_f32 / 3.0).sqrt()).abs() < 1e-6);
        assert!((offset - 0.5_f32.sqrt()).abs() < 1e-6);
    }
}
