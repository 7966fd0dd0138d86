//! GeoTIFF keys of a LAS file: the directory, its doubles and its texts. Their meaning is interpreted
//! elsewhere.

use super::vlr;

/// Largest number of directory entries that are read. Real directories have about 20.
const MAX_KEYS: usize = 1024;

/// The keys of the three GeoTIFF records.
#[derive(Debug, Default)]
pub(crate) struct GeoKeys {
    keys: Vec<Key>,
    doubles: Vec<u8>,
    texts: Vec<u8>,
}

#[derive(Debug, Clone, Copy)]
struct Key {
    id: u16,
    /// Record with the value; 0 if the value is in `value` itself.
    record: u16,
    count: u16,
    value: u16,
}

/// Record of the directory.
pub(crate) const DIRECTORY: u16 = 34_735;
/// Record of the doubles.
pub(crate) const DOUBLES: u16 = 34_736;
/// Record of the texts.
pub(crate) const TEXTS: u16 = 34_737;

impl GeoKeys {
    /// The keys of a directory; `None` if the bytes are not a directory, or promise more keys than there are.
    pub(crate) fn parse(directory: &[u8], doubles: Vec<u8>, texts: Vec<u8>) -> Option<Self> {
        let words: Vec<u16> =
            directory.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        let [1, _, _, count, entries @ ..] = words.as_slice() else { return None };
        let count = usize::from(*count);
        if count > MAX_KEYS || entries.len() < count * 4 {
            return None;
        }
        let keys = entries.chunks_exact(4).take(count).map(|entry| Key {
            id: entry[0],
            record: entry[1],
            count: entry[2],
            value: entry[3],
        });
        Some(Self { keys: keys.collect(), doubles, texts })
    }

    /// Whether there is no key at all.
    pub(crate) fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// The value of a key that is a code; 0 (undefined) counts as absent.
    pub(crate) fn code(&self, id: u16) -> Option<u16> {
        self.find(id).filter(|key| key.record == 0 && key.value != 0).map(|key| key.value)
    }

    /// The number of a key.
    pub(crate) fn number(&self, id: u16) -> Option<f64> {
        let key = self.find(id).filter(|key| key.record == DOUBLES)?;
        let start = usize::from(key.value) * 8;
        let bytes = self.doubles.get(start..start + 8)?;
        let mut value = [0; 8];
        value.copy_from_slice(bytes);
        Some(f64::from_le_bytes(value))
    }

    /// The text of a key, without the closing bar.
    pub(crate) fn text(&self, id: u16) -> Option<String> {
        let key = self.find(id).filter(|key| key.record == TEXTS)?;
        let start = usize::from(key.value);
        let bytes = self.texts.get(start..start + usize::from(key.count))?;
        let text = vlr::decode(bytes);
        let text = text.trim_matches(|c: char| c == '|' || c == '\0' || c.is_whitespace());
        (!text.is_empty()).then(|| text.to_owned())
    }

    fn find(&self, id: u16) -> Option<&Key> {
        self.keys.iter().find(|key| key.id == id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_numbers_and_texts_are_found_where_the_directory_says() {
        let words: [u16; 16] = [1, 1, 0, 3, 3072, 0, 1, 25832, 3077, 34736, 1, 1, 1026, 34737, 4, 2];
        let directory: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let doubles: Vec<u8> = [9.0_f64, 0.3048].iter().flat_map(|value| value.to_le_bytes()).collect();
        let keys = GeoKeys::parse(&directory, doubles, b"xxabc|zz".to_vec()).expect("keys");
        assert_eq!(keys.code(3072), Some(25_832));
        assert_eq!(keys.number(3077), Some(0.3048));
        assert_eq!(keys.text(1026).as_deref(), Some("abc"));
        assert_eq!(keys.code(1026), None);
        assert_eq!(keys.number(4099), None);
        assert!(
            GeoKeys::parse(&directory[..24], Vec::new(), Vec::new()).is_none(),
            "three keys promised, two there"
        );
        let outside = GeoKeys::parse(&directory, vec![0; 15], b"xxab".to_vec()).expect("keys");
        assert_eq!((outside.number(3077), outside.text(1026)), (None, None));
    }
}
