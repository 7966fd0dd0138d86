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
        assert_eq!(Separator::of("a;b").text(), ';');
    }
}
