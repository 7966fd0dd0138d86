//! Payloads of units as bytes. The checksum of the unit file has excluded damage, so a payload that cannot be
//! decoded is a bug.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// The bytes of a payload.
pub(crate) fn encode<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    postcard::to_stdvec(value).map_err(|error| Error::bug(format!("a payload does not encode: {error}")))
}

/// The payload in `bytes`.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    postcard::from_bytes(bytes).map_err(|error| Error::bug(format!("a payload does not decode: {error}")))
}
