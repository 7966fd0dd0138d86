//! Quantities on the command line: a number and a unit.

/// Reads a number with one of the units, and applies the factor of the unit. `what` is the kind of quantity
/// with an article.
fn quantity(what: &str, example: &str, text: &str, units: &[(&str, f64)]) -> Result<f64, String> {
    let text = text.trim();
    let end = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let names =
        || units.iter().map(|(name, _)| *name).filter(|name| !name.is_empty()).collect::<Vec<_>>().join(", ");
    let factor = units.iter().find(|(name, _)| *name == unit.trim()).map(|(_, factor)| *factor);
    let number =
        number.parse::<f64>().map_err(|_| format!("must be {what}, 0 or more, for example {example}"))?;
    let unknown = || format!("unknown unit '{}', known: {}; for example {example}", unit.trim(), names());
    factor.map(|factor| number * factor).ok_or_else(unknown)
}

/// Reads a length in metres.
pub(crate) fn length(text: &str) -> Result<f64, String> {
    quantity("a length", "500m", text, &[("m", 1.0), ("km", 1e3), ("cm", 0.01), ("mm", 0.001), ("", 1.0)])
}

/// Reads a time in seconds.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    quantity("a time", "60s", text, &[("s", 1.0), ("min", 60.0), ("h", 3_600.0), ("", 1.0)])
}

/// Reads a rate per second.
pub(crate) fn rate(text: &str) -> Result<f64, String> {
    quantity(
        "a rate",
        "550kHz",
        text,
        &[("Hz", 1.0), ("kHz", 1e3), ("k", 1e3), ("MHz", 1e6), ("M", 1e6), ("", 1.0)],
    )
}

/// Reads a count like 500k, 2M or 1234.
pub(crate) fn count(text: &str) -> Result<u64, String> {
    let refused = || format!("{text} is not a count like 1234, 500k or 2M");
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match &text[digits.len()..] {
        "" => 1.0,
        "k" | "K" => 1e3,
        "m" | "M" => 1e6,
        "g" | "G" => 1e9,
        _ => return Err(refused()),
    };
    let number = digits.parse::<f64>().map_err(|_| refused())? * factor;
    if !(0.0..=1e15).contains(&number) {
        return Err(refused());
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
    let whole = number.round() as u64;
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_units() {
        assert_eq!(length("5km"), Ok(5_000.0));
        assert_eq!(length("500m"), Ok(500.0));
        assert_eq!(seconds("2min"), Ok(120.0));
        assert_eq!(rate("550kHz"), Ok(550_000.0));
        assert_eq!(
            length("5 miles"),
            Err("unknown unit 'miles', known: m, km, cm, mm; for example 500m".into())
        );
        for text in ["abc", "-3", "-3m", ""] {
            assert_eq!(length(text), Err("must be a length, 0 or more, for example 500m".into()), "{text}");
        }
    }

    #[test]
    fn counts_may_have_a_unit() {
        for (text, expected) in
            [("0", 0), ("1234", 1_234), ("500k", 500_000), ("2M", 2_000_000), ("1.5m", 1_500_000)]
        {
            assert_eq!(count(text), Ok(expected), "{text}");
        }
        for text in ["", "M", "-1", "2T", "many"] {
            assert!(count(text).is_err(), "{text}");
        }
    }
}
