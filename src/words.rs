//! Wording that several messages share: counts with their nouns, and the known name that a mistyped name
//! resembles.

/// A count with separators and its noun, in the plural unless the count is one.
///
/// ```
/// use chainage::words::counted;
///
/// assert_eq!(counted(1, "tile"), "1 tile");
/// assert_eq!(counted(71_841, "point"), "71,841 points");
/// ```
#[must_use]
pub fn counted(number: u64, noun: &str) -> String {
    format!("{} {noun}{}", separated(number), if number == 1 { "" } else { "s" })
}

/// A count with separators: 1,234,567.
#[must_use]
pub fn separated(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A share in per cent, as the command line and the page show it: with one decimal, or with two digits below
/// one per cent, so that a small share is not nothing. `percent` in `run.js` has the same rule.
///
/// ```
/// use chainage::words::percent;
///
/// assert_eq!(percent(1, 3), "33.3 %");
/// assert_eq!(percent(163, 100_000), "0.16 %");
/// assert_eq!(percent(4, 10_000), "0.04 %");
/// assert_eq!(percent(0, 9), "0 %");
/// ```
#[must_use]
pub fn percent(part: u64, all: u64) -> String {
    let share = 100.0 * part as f64 / all.max(1) as f64;
    if part == 0 {
        return "0 %".to_owned();
    }
    // Steps to the second digit, counted without a logarithm, which differs between machines.
    let (mut steps_per_percent, mut first_digits) = (10.0, share);
    while first_digits < 1.0 {
        first_digits *= 10.0;
        steps_per_percent *= 10.0;
    }
    let rounded = (share * steps_per_percent).round() / steps_per_percent;
    if share < 1.0 { format!("{rounded} %") } else { format!("{rounded:.1} %") }
}

/// A number with `places` decimals, or with an exponent from 1e15 on, because nobody reads hundreds of
/// digits.
///
/// ```
/// use chainage::words::decimal;
///
/// assert_eq!(decimal(12.345, 2), "12.35");
/// assert_eq!(decimal(1e300, 2), "1e300");
/// ```
#[must_use]
pub fn decimal(number: f64, places: usize) -> String {
    if number.abs() < 1e15 { format!("{number:.places$}") } else { format!("{number:e}") }
}

/// A value as given, or with an exponent if it is a number of more than 24 characters.
///
/// ```
/// use chainage::words::shortened;
///
/// assert_eq!(shortened("18446744073709551615".into()), "18446744073709551615");
/// assert_eq!(shortened(format!("1{}", "0".repeat(300))), "1e300");
/// ```
#[must_use]
pub fn shortened(value: String) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.len() > 24 && number.is_finite() => format!("{number:e}"),
        _ => value,
    }
}

/// The known name that is most similar to a mistyped one, if any is similar.
///
/// Similar means: at most a third of the letters must be inserted, removed, replaced or swapped with their
/// neighbour.
///
/// ```
/// use chainage::words::similar;
///
/// let known = ["euclidean.max_gap_m", "euclidean.min_points", "dbscan.epsilon"];
/// assert_eq!(similar("euclidian.max_gap_m", known), Some("euclidean.max_gap_m"));
/// assert_eq!(similar("colour", known), None);
/// ```
#[must_use]
pub fn similar<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let most = (typed.chars().count() / 3).max(1);
    let near = known.into_iter().map(|name| (edits(typed, name), name)).filter(|(edits, _)| *edits <= most);
    near.min_by_key(|(edits, _)| *edits).map(|(_, name)| name)
}

/// The number of edits from one text to the other: optimal string alignment (Damerau 1964, "A technique for
/// computer detection and correction of spelling errors", doi:10.1145/363958.363994).
fn edits(one: &str, other: &str) -> usize {
    let one: Vec<char> = one.chars().collect();
    let other: Vec<char> = other.chars().collect();
    let mut rows = vec![(0..=other.len()).collect::<Vec<usize>>()];
    for i in 1..=one.len() {
        let mut row = vec![i];
        for j in 1..=other.len() {
            let differ = usize::from(one[i - 1] != other[j - 1]);
            let mut fewest = (rows[i - 1][j] + 1).min(row[j - 1] + 1).min(rows[i - 1][j - 1] + differ);
            if i > 1 && j > 1 && one[i - 1] == other[j - 2] && one[i - 2] == other[j - 1] {
                fewest = fewest.min(rows[i - 2][j - 2] + 1);
            }
            row.push(fewest);
        }
        rows.push(row);
    }
    rows[one.len()][other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_separators() {
        let texts = [0, 999, 1_000, 1_234_567].map(separated);
        assert_eq!(texts.join(" "), "0 999 1,000 1,234,567");
        assert_eq!([0, 1, 2].map(|count| counted(count, "file")).join(", "), "0 files, 1 file, 2 files");
    }

    #[test]
    fn letters_are_inserted_removed_replaced_and_swapped() {
        for (one, other, expected) in [
            ("", "abc", 3),
            ("tile", "tile", 0),
            ("tlie", "tile", 1),
            ("tiles", "tile", 1),
            ("kitten", "sitting", 3),
        ] {
            assert_eq!(edits(one, other), expected, "{one} {other}");
            assert_eq!(edits(other, one), expected, "{other} {one}");
        }
        assert_eq!(similar("dbscna", ["euclidean", "dbscan"]), Some("dbscan"));
        assert_eq!(similar("x", ["euclidean", "dbscan"]), None);
    }
}
