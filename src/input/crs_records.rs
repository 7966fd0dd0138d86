//! The records of a file that describe its coordinate system: well-known text and GeoTIFF keys.

use super::geokeys::{DIRECTORY, DOUBLES, GeoKeys, TEXTS};
use super::header::Header;
use super::mapped::ByteSource;
use super::vlr;

/// User id of the records of the coordinate reference system.
const PROJECTION_USER: &str = "LASF_Projection";
/// Record id of the system as well-known text.
const WKT: u16 = 2112;
/// Length limit of well-known text.
const MAX_WKT: u64 = 1 << 20;

/// A record that cannot be read.
pub(super) struct Unreadable;

/// The well-known text of a file, if it has one.
pub(super) fn wkt_text(header: &Header, source: &ByteSource) -> Result<Option<String>, Unreadable> {
    // The record of the user liblas has the same text: writers that use that library added both.
    let record = [PROJECTION_USER, "liblas"]
        .iter()
        .find_map(|user| header.records().find(|record| record.is(user, WKT) && !record.payload.is_empty()));
    let Some(record) = record else { return Ok(None) };
    let bytes = record.read(source, MAX_WKT).ok_or(Unreadable)?;
    let text = vlr::decode(&bytes);
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    Ok((!text.is_empty()).then(|| text.to_owned()))
}

/// The GeoTIFF keys of a file, if there are any.
pub(super) fn geo_keys(header: &Header, source: &ByteSource) -> Result<Option<GeoKeys>, Unreadable> {
    let payload = |record: u16| {
        let record = header.records().find(|candidate| candidate.is(PROJECTION_USER, record))?;
        Some(record.read(source, u64::from(u16::MAX)))
    };
    let Some(directory) = payload(DIRECTORY) else { return Ok(None) };
    let [doubles, texts] = [DOUBLES, TEXTS].map(|record| payload(record).flatten().unwrap_or_default());
    let keys = GeoKeys::parse(&directory.ok_or(Unreadable)?, doubles, texts).ok_or(Unreadable)?;
    Ok(Some(keys).filter(|keys| !keys.is_empty()))
}
