//! Setting `output.classification`: whether the LAS class of a point changes, and the codes of classes of
//! objects.

use serde::{Deserialize, Serialize};

/// Classes of objects by the words of settings, with the codes of `object_class`. Hedges and bushes have the
/// same code as fences, walls and guard rails, and a name of their own.
const CLASSES: [(&str, u8); 9] = [
    ("tree", 2),
    ("pole", 3),
    ("vehicle", 4),
    ("building", 5),
    ("fence", 6),
    (HEDGE, 6),
    ("small", 7),
    ("wire", 8),
    ("other", 9),
];

/// The word of hedges and bushes.
const HEDGE: &str = "hedge";

/// Whether the LAS classes of the records change.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum ClassificationChoice {
    /// All classes stay.
    Keep,
    /// Ground, noise and classes of objects are written, other classes stay.
    Set(LasCodes),
}

/// LAS codes that a user has chosen for classes of objects, by the words of the classes. The other classes
/// have the codes of ASPRS, if there are any.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LasCodes(Vec<(String, u8)>);

impl LasCodes {
    /// The LAS code that was chosen for a class of objects. For class 6, it applies to fences, walls and
    /// guard rails.
    #[must_use]
    pub fn of(&self, class: u8) -> Option<u8> {
        CLASSES.iter().find(|(_, known)| *known == class).and_then(|(word, _)| self.of_word(word))
    }

    /// The LAS code that was chosen for hedges and bushes.
    #[must_use]
    pub fn of_hedges(&self) -> Option<u8> {
        self.of_word(HEDGE)
    }

    fn of_word(&self, word: &str) -> Option<u8> {
        self.0.iter().find(|(known, _)| known == word).map(|(_, code)| *code)
    }

    /// The largest code, with the word of its class.
    #[must_use]
    pub fn largest(&self) -> Option<(&'static str, u8)> {
        let (class, code) = self.0.iter().max_by_key(|(_, code)| *code)?;
        CLASSES.iter().find(|(word, _)| word == class).map(|(word, _)| (*word, *code))
    }

    /// Whether no code was chosen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds one item of the list, as in `pole=64`. `None` if it is not accepted.
    fn item(&mut self, item: &str) -> Option<()> {
        let (word, code) = item.split_once('=')?;
        let (word, _) = CLASSES.iter().find(|(known, _)| *known == word.trim())?;
        let code = code.trim().parse().ok()?;
        // If a class were given twice, it would be open which code counts.
        self.of_word(word).is_none().then(|| self.0.push(((*word).to_owned(), code)))
    }
}

impl TryFrom<String> for ClassificationChoice {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        match text.trim() {
            "keep" => return Ok(Self::Keep),
            "set" => return Ok(Self::Set(LasCodes::default())),
            _ => (),
        }
        let mut codes = LasCodes::default();
        match text.split(',').try_for_each(|item| codes.item(item)) {
            Some(()) => Ok(Self::Set(codes)),
            None => {
                let words = CLASSES.map(|(word, _)| word).join(", ");
                Err(format!(
                    "expected set, keep, or LAS codes from 0 to 255, each class once, as in pole=64,vehicle=65 \
                     (classes: {words})"
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ClassificationChoice, String> {
        text.to_owned().try_into()
    }

    #[test]
    fn codes_are_read_class_by_class_and_nothing_else_is() {
        let Ok(ClassificationChoice::Set(codes)) = read("pole=64, vehicle = 65,fence=66") else {
            panic!("these are codes");
        };
        assert_eq!([2, 3, 4, 6].map(|class| codes.of(class)), [None, Some(64), Some(65), Some(66)]);
        assert_eq!(codes.of_hedges(), None);
        assert_eq!(codes.largest(), Some(("fence", 66)));
        let Ok(ClassificationChoice::Set(codes)) = read("hedge=67") else { panic!("this is a code") };
        assert_eq!((codes.of(6), codes.of_hedges()), (None, Some(67)));
        assert_eq!(read("keep"), Ok(ClassificationChoice::Keep));
        assert_eq!(read("set"), Ok(ClassificationChoice::Set(LasCodes::default())));
        for wrong in [
            "",
            "no",
            "pole",
            "pole=",
            "pole=256",
            "pole=-1",
            "lamp=64",
            "pole=64,",
            "pole=1,pole=2",
            "hedge=1,hedge=2",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_codes_are_those_of_the_classes_of_eval() {
        let classes = crate::eval::ClassTable::default();
        for (word, code) in CLASSES {
            assert!(classes.name(code.into()).contains(word), "{word} {code}");
        }
    }
}
