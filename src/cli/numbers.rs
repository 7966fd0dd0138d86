//! Numbers on the command line. Messages about invalid ones say what is accepted, and give an example.

use std::ops::RangeInclusive;

use clap::builder::{StringValueParser, TypedValueParser};

/// A parser of a whole number in a range.
pub(crate) fn whole<T>(range: RangeInclusive<u64>, example: u64) -> impl TypedValueParser<Value = T>
where
    T: TryFrom<u64> + Clone + Send + Sync + 'static,
{
    StringValueParser::new().try_map(move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.and_then(|number| T::try_from(number).ok()).ok_or_else(|| {
            let accepted = match (range.start(), range.end()) {
                (least, &u64::MAX) => format!("{least} or more"),
                (least, most) => format!("from {least} to {most}"),
            };
            format!("must be a whole number, {accepted}, for example {example}")
        })
    })
}

/// A parser of a number, with or without a fraction.
pub(crate) fn real(example: &'static str) -> impl TypedValueParser<Value = f64> {
    StringValueParser::new().try_map(move |text| {
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("must be a number, for example {example}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(
        parser: impl TypedValueParser<Value = impl Clone + Send + Sync + 'static>,
        text: &str,
    ) -> String {
        let command = clap::Command::new("x").arg(clap::Arg::new("n").long("n").value_parser(parser));
        let error = command.try_get_matches_from(["x".to_owned(), format!("--n={text}")]).unwrap_err();
        error.to_string().lines().next().unwrap_or_default().to_owned()
    }

    #[test]
    fn numbers_are_explained_by_an_example() {
        let port = "must be a whole number, from 0 to 65535, for example 8080";
        for text in ["abc", "-3", "99999", "1.5", ""] {
            let said = refused(whole::<u16>(0..=65_535, 8_080), text);
            assert!(said.ends_with(port), "{said}");
        }
        let seed = refused(whole::<u64>(0..=u64::MAX, 7), "x");
        assert!(seed.ends_with("must be a whole number, 0 or more, for example 7"), "{seed}");
        let rate = refused(real("0.1"), "fast");
        assert!(rate.ends_with("must be a number, for example 0.1"), "{rate}");
    }
}
