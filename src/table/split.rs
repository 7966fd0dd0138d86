//! The fields of one line, and their separator.

/// The separator between the fields of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    /// Exactly this character.
    Character(char),
    /// Any number of blanks and tabs.
    Blanks,
}

impl Separator {
    /// The separator of a line: a comma, semicolon or tab, in this order, if the line has one outside quotes,
    /// or else blanks. If a quote is not closed, quotes are ignored.
    pub(super) fn of(line: &str) -> Self {
        let mut quoted = false;
        let bare: String = line
            .chars()
            .filter(|&c| {
                quoted ^= c == '"';
                !quoted
            })
            .collect();
        let searched = if quoted { line } else { &bare };
        [',', ';', '\t'].into_iter().find(|&c| searched.contains(c)).map_or(Self::Blanks, Self::Character)
    }

    /// The text that separates two fields in the output.
    pub(super) fn text(self) -> char {
        match self {
            Self::Character(separator) => separator,
            Self::Blanks => ' ',
        }
    }
}

/// Whether the commas of a line stand inside numbers, and something else separates its fields: a semicolon, a
/// tab, or blanks where all fields are numbers. Spreadsheets write such tables where the comma is the decimal
/// separator. Taken for separators, its commas would cut every number in two.
pub(super) fn has_decimal_commas(line: &str) -> bool {
    let is_decimal = |fields: &[String]| {
        let mut commas = fields.iter().filter(|field| field.contains(','));
        fields.len() > 1 && commas.clone().next().is_some() && commas.all(|field| is_decimal_comma(field))
    };
    let by_character =
        |separator| fields(line, Separator::Character(separator)).is_some_and(|fields| is_decimal(&fields));
    let by_blanks = || {
        let fields: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        is_decimal(&fields) && fields.iter().all(|field| field.replace(',', ".").parse::<f64>().is_ok())
    };
    by_character(';') || by_character('\t') || by_blanks()
}

/// Whether a field is a number with a comma between two of its digits, which is not a number with a point.
pub(super) fn is_decimal_comma(field: &str) -> bool {
    let Some((whole, fraction)) = field.split_once(',') else { return false };
    whole.ends_with(|c: char| c.is_ascii_digit())
        && fraction.starts_with(|c: char| c.is_ascii_digit())
        && format!("{whole}.{fraction}").parse::<f64>().is_ok()
}

/// The fields of a line, without quotes (RFC 4180: "" inside quotes is a quote); `None` if a quote is not
/// closed.
pub(super) fn fields(line: &str, separator: Separator) -> Option<Vec<String>> {
    let character = match separator {
        Separator::Blanks => return Some(line.split_whitespace().map(str::to_owned).collect()),
        Separator::Character(character) => character,
    };
    let mut list = Vec::new();
    let mut field = String::new();
    let mut quoted = false;
    let mut rest = line.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '"' if quoted && rest.peek() == Some(&'"') => {
                field.push('"');
                rest.next();
            }
            '"' if quoted || field.trim().is_empty() => quoted = !quoted,
            c if c == character && !quoted => list.push(std::mem::take(&mut field)),
            c => field.push(c),
        }
    }
    list.push(field);
    (!quoted).then(|| list.iter().map(|field| field.trim().to_owned()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_separator_is_found_and_fields_are_split_at_it() {
        for (line, expected) in [
            ("1,2.5, 3 ", vec!["1", "2.5", "3"]),
            ("1;2,5;3", vec!["1;2", "5;3"]),
            ("1\t\t3", vec!["1", "", "3"]),
            ("  1   2 3", vec!["1", "2", "3"]),
            ("\"a, b\",2", vec!["a, b", "2"]),
            ("\"say \"\"so\"\"\",2,", vec!["say \"so\"", "2", ""]),
            ("\"a,b\" c", vec!["\"a,b\"", "c"]),
            ("5' 3\",2", vec!["5' 3\"", "2"]),
        ] {
            let found = fields(line, Separator::of(line));
            assert_eq!(found, Some(expected.into_iter().map(str::to_owned).collect()), "{line}");
        }
        assert_eq!(fields("1,\"2", Separator::Character(',')), None);
    }

    #[test]
    fn decimal_commas_are_told_from_separators() {
        for line in ["10,017;20,041;1,017", "7;1,5;tree", "1,5\t2", "-1,5 2,5e3", "\"1,5\";\"2,5\""] {
            assert!(has_decimal_commas(line), "{line}");
        }
        for line in [
            "1,2,3",
            "1, 2, 3",
            "1,2 ,3",
            "1;2;3",
            "1.5;2.5",
            "12,7 Elm Street",
            "x, m;y, m",
            "1,2,3;4",
            "1,2,\"a;b\"",
            "1,2",
        ] {
            assert!(!has_decimal_commas(line), "{line}");
        }
    }

    #[test]
    fn a_separator_has_its_text() {
        assert_eq!(Separator::of("a;b").text(), ';');
    }
}
