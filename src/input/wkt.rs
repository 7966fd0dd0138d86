//! A small parser of well-known text: nested brackets, and the units of a coordinate reference system. It
//! does not know names of systems and does not check geodesy.

/// One `KEYWORD[...]` of a well-known text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    /// The keyword in capitals.
    pub(crate) keyword: String,
    values: Vec<Value>,
}

#[derive(Debug, Clone, PartialEq)]
enum Value {
    Text(String),
    Number(f64),
    Word(String),
    Node(Node),
}

/// Largest depth of nested brackets. Real systems have about 8.
const MAX_DEPTH: usize = 64;

impl Node {
    /// Parses a text; `None` if it is not one bracketed expression. Text after the last bracket is ignored,
    /// because writers pad with zeros.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut parser = Parser { rest: text, depth: 0 };
        parser.skip_space();
        let keyword = parser.word()?;
        match parser.value_after(keyword)? {
            Value::Node(node) => Some(node),
            _ => None,
        }
    }

    /// The first child node with one of these keywords.
    pub(crate) fn child(&self, keywords: &[&str]) -> Option<&Self> {
        self.children().find(|node| keywords.contains(&node.keyword.as_str()))
    }

    /// The child nodes.
    pub(crate) fn children(&self) -> impl Iterator<Item = &Self> {
        self.values.iter().filter_map(|value| if let Value::Node(node) = value { Some(node) } else { None })
    }

    /// The first text child: the name of most nodes.
    pub(crate) fn name(&self) -> Option<&str> {
        self.values
            .iter()
            .find_map(|value| if let Value::Text(text) = value { Some(text.as_str()) } else { None })
    }

    /// The first bare word, in capitals, such as the kind of a `CS[...]`.
    pub(crate) fn word(&self) -> Option<&str> {
        self.values
            .iter()
            .find_map(|value| if let Value::Word(word) = value { Some(word.as_str()) } else { None })
    }

    /// The first number, such as the metres of a `UNIT[...]`.
    pub(crate) fn number(&self) -> Option<f64> {
        self.values
            .iter()
            .find_map(|value| if let Value::Number(number) = value { Some(*number) } else { None })
    }

    /// The EPSG code: `AUTHORITY["EPSG","25832"]` or `ID["EPSG",25832]`.
    pub(crate) fn epsg(&self) -> Option<u32> {
        self.child(&["AUTHORITY", "ID"])?.as_code()
    }

    /// The EPSG code of this node, if the node itself is a code.
    fn as_code(&self) -> Option<u32> {
        if !["AUTHORITY", "ID"].contains(&self.keyword.as_str()) || self.name() != Some("EPSG") {
            return None;
        }
        self.values.iter().skip(1).find_map(|value| match value {
            Value::Text(text) => text.trim().parse().ok(),
            Value::Number(number) => number.to_string().parse().ok(),
            Value::Word(_) | Value::Node(_) => None,
        })
    }
}

/// The part of a text that is the first node with this keyword.
pub(crate) fn node_text<'a>(text: &'a str, keyword: &str) -> Option<&'a str> {
    let part = &text[text.find(&format!("{keyword}["))?..];
    let mut parser = Parser { rest: part, depth: 0 };
    parser.value()?;
    Some(&part[..part.len() - parser.rest.len()])
}

/// A text without `,AUTHORITY["EPSG","..."]` or `,ID["EPSG",...]` of these codes. The rest stays as written.
pub(crate) fn without_codes(text: &str, codes: &[u32]) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut from = 0;
    let mut quoted = false;
    for (at, character) in text.char_indices() {
        quoted ^= character == '"';
        if at < from || quoted || character != ',' {
            continue;
        }
        let mut parser = Parser { rest: &text[at + 1..], depth: 0 };
        if let Some(Value::Node(node)) = parser.value()
            && node.as_code().is_some_and(|code| codes.contains(&code))
        {
            kept.push_str(&text[from..at]);
            from = text.len() - parser.rest.len();
        }
    }
    kept.push_str(&text[from..]);
    kept
}

struct Parser<'a> {
    rest: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn skip_space(&mut self) {
        self.rest = self.rest.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}');
    }

    fn eat(&mut self, any: &[char]) -> Option<char> {
        self.skip_space();
        let first = self.rest.chars().next().filter(|c| any.contains(c))?;
        self.rest = &self.rest[first.len_utf8()..];
        Some(first)
    }

    /// A keyword or number: everything up to a bracket, comma or space.
    fn word(&mut self) -> Option<String> {
        let end = self.rest.find(|c: char| "[]()\",".contains(c) || c.is_whitespace() || c == '\0');
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        (!word.is_empty()).then(|| word.to_ascii_uppercase())
    }

    /// A text in quotes. A doubled quote is one quote.
    fn text(&mut self) -> Option<String> {
        let mut text = String::new();
        loop {
            let end = self.rest.find('"')?;
            text.push_str(&self.rest[..end]);
            self.rest = &self.rest[end + 1..];
            match self.rest.strip_prefix('"') {
                Some(rest) => {
                    text.push('"');
                    self.rest = rest;
                }
                None => return Some(text),
            }
        }
    }

    fn value(&mut self) -> Option<Value> {
        if self.eat(&['"']).is_some() {
            return self.text().map(Value::Text);
        }
        self.skip_space();
        let word = self.word()?;
        if let Ok(number) = word.parse() {
            return Some(Value::Number(number));
        }
        self.value_after(word)
    }

    /// A node, if a bracket follows the word, else the word.
    fn value_after(&mut self, keyword: String) -> Option<Value> {
        if self.eat(&['[', '(']).is_none() {
            return Some(Value::Word(keyword));
        }
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return None;
        }
        let mut values = Vec::new();
        loop {
            if self.eat(&[']', ')']).is_some() {
                break;
            }
            values.push(self.value()?);
            match self.eat(&[',', ']', ')'])? {
                ',' => {}
                _ => break,
            }
        }
        self.depth -= 1;
        Some(Value::Node(Node { keyword, values }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_brackets_quotes_and_codes_are_read() {
        let node = Node::parse(
            " PROJCS[\"a \"\"b\"\" [c]\", GEOGCS[\"g\", AUTHORITY[\"EPSG\",\"4258\"]], \
             UNIT(\"metre\", 1 ,AUTHORITY[\"EPSG\",\"9001\"]), AUTHORITY[\"EPSG\",\"25832\"]]\0\0",
        )
        .expect("parses");
        assert_eq!(node.keyword, "PROJCS");
        assert_eq!(node.name(), Some("a \"b\" [c]"));
        assert_eq!(node.epsg(), Some(25_832));
        assert_eq!(node.child(&["UNIT"]).and_then(Node::number), Some(1.0));
        assert_eq!(node.child(&["GEOGCS"]).and_then(Node::epsg), Some(4_258));
        let second = Node::parse("PROJCRS[\"x\",CS[Cartesian,2],ID[\"EPSG\",3857]]").expect("parses");
        assert_eq!(second.child(&["CS"]).and_then(Node::word), Some("CARTESIAN"));
        assert_eq!(second.epsg(), Some(3_857));
    }

    #[test]
    fn codes_are_taken_out_of_a_text() {
        let text =
            "P[\"a,ID[\"\"EPSG\"\",7]\",G[\"g\",ID[\"EPSG\",5]] , AUTHORITY(\"EPSG\", \"7\"),U[\"m\",1]]\0";
        assert_eq!(
            without_codes(text, &[7]),
            "P[\"a,ID[\"\"EPSG\"\",7]\",G[\"g\",ID[\"EPSG\",5]] ,U[\"m\",1]]\0"
        );
        assert_eq!(without_codes(text, &[5, 7]), "P[\"a,ID[\"\"EPSG\"\",7]\",G[\"g\"] ,U[\"m\",1]]\0");
        assert_eq!(without_codes(text, &[6]), text);
        assert_eq!(without_codes("P[\"x\",ID[\"EPSG\",7,CITATION[\"c\"]]]", &[7]), "P[\"x\"]");
        assert_eq!(without_codes("P[\"x\",ID[\"EPSG\",7", &[7]), "P[\"x\",ID[\"EPSG\",7");
    }

    #[test]
    fn parts_of_a_text_are_found_by_their_keywords() {
        let text = "COMPD_CS[\"c]\",P[\"p\",U[\"m]\",1]] , VERT_CS[\"v\",U[\"m\",1]]]\0";
        assert_eq!(node_text(text, "P"), Some("P[\"p\",U[\"m]\",1]]"));
        assert_eq!(node_text(text, "VERT_CS"), Some("VERT_CS[\"v\",U[\"m\",1]]"));
        assert_eq!(node_text(text, "COMPD_CS"), text.strip_suffix('\0'));
        assert_eq!(node_text(text, "PROJCS"), None);
        assert_eq!(node_text("P[\"p\"", "P"), None);
    }

    #[test]
    fn what_is_not_well_known_text_is_refused() {
        let deep = "A[".repeat(100_000);
        for text in ["", "PROJCS", "PROJCS[", "PROJCS[\"a", "[\"a\"]", "{}", "PROJCS[\"a\",]x[", &deep] {
            let parsed = Node::parse(text);
            assert!(parsed.is_none() || text == "PROJCS[\"a\",]x[", "{parsed:?}");
        }
    }

    #[test]
    fn every_prefix_of_a_text_is_parsed_without_a_panic() {
        let text = "COMPD_CS[\"ä\",PROJCS[\"b\",UNIT[\"US survey foot\",0.3048006]],VERT_CS[\"c\"]]";
        for end in (0..text.len()).filter(|end| text.is_char_boundary(*end)) {
            assert!(Node::parse(&text[..end]).is_none(), "{end}");
        }
    }
}
