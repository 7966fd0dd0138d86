//! The file of a model.
//!
//! ```text
//! file     := magic version length content checksum
//! magic    := "CHNGTREE"    8 bytes
//! version  := u32           VERSION; raised when the bytes change meaning
//! length   := u64           bytes of content
//! content  := postcard
//! checksum := u64           XXH3 of everything before it
//! ```
//! Numbers are little-endian.

use xxhash_rust::xxh3::xxh3_64;

use super::content::Content;
use super::error::BoostingError;
use crate::codec;
use crate::error::Result;

/// Version of the format.
const VERSION: u32 = 1;
const MAGIC: &[u8; 8] = b"CHNGTREE";
const HEADER_LEN: usize = 8 + 4 + 8;
const FOOTER_LEN: usize = 8;

/// The bytes of a model, and their checksum.
pub(super) fn encode(content: &Content) -> Result<(Vec<u8>, u64)> {
    let payload = codec::encode(content)?;
    let mut bytes = Vec::with_capacity(HEADER_LEN + payload.len() + FOOTER_LEN);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&(payload.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&payload);
    let checksum = xxh3_64(&bytes);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    Ok((bytes, checksum))
}

/// The model in the bytes of `origin`, and their checksum.
pub(super) fn decode(origin: &str, bytes: &[u8]) -> Result<(Content, u64), BoostingError> {
    let damaged = |what: &str| BoostingError::Damaged { origin: origin.to_owned(), what: what.to_owned() };
    if !bytes.starts_with(MAGIC) {
        return Err(BoostingError::Foreign { origin: origin.to_owned() });
    }
    let word = |at: usize| bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word));
    match word(MAGIC.len()) {
        Some(VERSION) => {}
        Some(found) => {
            return Err(BoostingError::Version { origin: origin.to_owned(), found, known: VERSION });
        }
        None => return Err(damaged("it is cut")),
    }
    let Some((before, checksum)) = bytes.split_last_chunk::<FOOTER_LEN>() else {
        return Err(damaged("it is cut"));
    };
    let Some((header, payload)) = before.split_at_checked(HEADER_LEN) else {
        return Err(damaged("it is cut"));
    };
    if header[HEADER_LEN - 8..] != (payload.len() as u64).to_le_bytes() {
        return Err(damaged("its length is not the one that it states"));
    }
    let checksum = u64::from_le_bytes(*checksum);
    if checksum != xxh3_64(before) {
        return Err(damaged("its checksum does not match"));
    }
    let content = codec::decode(payload).map_err(|_| damaged("its content has another form"))?;
    Ok((content, checksum))
}

/// The bytes of the model at the start of `bytes`, and the bytes after it.
pub(super) fn split<'a>(origin: &str, bytes: &'a [u8]) -> Result<(&'a [u8], &'a [u8]), BoostingError> {
    if !bytes.starts_with(MAGIC) {
        return Err(BoostingError::Foreign { origin: origin.to_owned() });
    }
    let stated =
        bytes.get(HEADER_LEN - 8..).and_then(<[u8]>::first_chunk).map(|word| u64::from_le_bytes(*word));
    let end = stated.and_then(|length| usize::try_from(length).ok()?.checked_add(HEADER_LEN + FOOTER_LEN));
    end.and_then(|end| bytes.split_at_checked(end))
        .ok_or_else(|| BoostingError::Damaged { origin: origin.to_owned(), what: "it is cut".to_owned() })
}

#[cfg(test)]
mod tests {
    use crate::boosting::{Model, Samples, Settings, TrainedOn, learn};
    use crate::error::Failure;

    fn model() -> Model {
        let mut samples = Samples::new(&["a", "b"], &["low", "high"]);
        for row in 0..200_u8 {
            samples.push(&[f32::from(row % 10), f32::from(row % 3)], u8::from(row % 10 > 4)).unwrap();
        }
        let settings = Settings { rounds: 3, leaves: 4, leaf_samples: 5, ..Settings::default() };
        let sources = vec![TrainedOn { name: "one.laz".to_owned(), samples: vec![100, 100] }];
        learn(&samples, &settings, &|_| Ok(())).unwrap().trained_on(sources).unwrap()
    }

    #[test]
    fn a_model_is_read_back_whole() {
        let model = model();
        let bytes = model.encode().unwrap();
        let read = Model::decode("m.bin", &bytes).unwrap();
        assert_eq!(read.encode().unwrap(), bytes);
        assert_eq!((read.checksum(), read.about()), (model.checksum(), model.about()));
        assert_eq!(read.about().trained_on[0].name, "one.laz");
        let rows = [0.0, 0.0, 9.0, 1.0];
        assert_eq!(read.shares::<2>(&rows).unwrap(), model.shares::<2>(&rows).unwrap());
        assert!(read.shares::<3>(&rows).is_err() && read.shares::<2>(&rows[1..]).is_err());
    }

    #[test]
    fn one_of_two_models_in_a_row_is_found() {
        let bytes = model().encode().unwrap();
        let mut both = bytes.clone();
        both.extend_from_slice(b"more");
        assert_eq!(Model::split("m.bin", &both).unwrap(), (&bytes[..], &b"more"[..]));
        assert_eq!(Model::split("m.bin", &bytes).unwrap().1, b"");
        for length in 0..bytes.len() {
            Model::split("m.bin", &bytes[..length]).unwrap_err();
        }
    }

    #[test]
    fn what_is_cut_changed_foreign_or_newer_is_refused_with_the_reason() {
        let bytes = model().encode().unwrap();
        for length in 0..bytes.len() {
            Model::decode("m.bin", &bytes[..length]).unwrap_err();
        }
        for position in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[position] ^= 0x04;
            Model::decode("m.bin", &changed).unwrap_err();
        }
        let says = |bytes: &[u8]| {
            let error = Model::decode("m.bin", bytes).unwrap_err();
            format!("{error}; {}", error.hint().unwrap())
        };
        assert!(
            says(b"LASF").contains("m.bin is not a model of chainage; name a file that chainage train wrote")
        );
        assert!(says(&bytes[..50]).contains("m.bin is damaged"));
        let mut newer = bytes;
        newer[8] = 9;
        assert!(says(&newer).contains("version 9 of the model format; this program reads version 1"));
    }

    #[test]
    fn a_model_of_other_features_is_refused_with_the_first_difference() {
        let model = model();
        model.check("m.bin", &["a", "b"], &["low", "high"]).unwrap();
        for (features, classes, says) in [
            (&["a"][..], &["low", "high"][..], "it has 2 features, expected 1"),
            (&["a", "c"], &["low", "high"], "number 2 of its features is b, expected c"),
            (&["a", "b"], &["low", "tall"], "number 2 of its classes is high, expected tall"),
        ] {
            let error = model.check("m.bin", features, classes).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
