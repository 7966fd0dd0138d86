//! The colours of the classes of objects: one list for the page and for the layers that QGIS opens.

/// Colours that readers with any colour vision can distinguish: the palette of Okabe and Ito, "Color
/// Universal Design" (2008), without black, which a dark page hides. The two blues belong to classes that
/// differ in shape and place. Vermilion is near the colour of the selection on the page, so small objects
/// have it. The greys are for other objects and for objects without a class.
pub(crate) const CLASS_COLOURS: [(u8, [u8; 3]); 9] = [
    (2, [0, 158, 115]),
    (3, [230, 159, 0]),
    (4, [204, 121, 167]),
    (5, [86, 180, 233]),
    (6, [240, 228, 66]),
    (7, [213, 94, 0]),
    (8, [0, 114, 178]),
    (9, [92, 92, 92]),
    (0, [190, 190, 190]),
];

/// Colour of a class. Codes that are not in the list get the colour of objects without a class.
pub(crate) fn class_colour(code: u8) -> [u8; 3] {
    let found = CLASS_COLOURS.iter().find(|(known, _)| *known == code);
    found.or(CLASS_COLOURS.last()).map(|(_, colour)| *colour).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_have_different_colours() {
        for (at, (code, colour)) in CLASS_COLOURS.iter().enumerate() {
            assert!(CLASS_COLOURS[..at].iter().all(|(known, other)| known != code && other != colour));
            assert_eq!(class_colour(*code), *colour);
        }
        assert_eq!(class_colour(200), class_colour(0));
    }
}
