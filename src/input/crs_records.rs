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

/// The well-known text of a file. A text that is too long gives a warning.
pub(super) fn wkt_text(header: &Header, source: &ByteSource, warnings: &mut Vec<String>) -> Option<String> {
    // The record of the user liblas has the same text: writers that use that library added both.
    let record = [PROJECTION_USER, "liblas"].iter().find_map(|user| {
        header.records().find(|record| record.is(user, WKT) && !record.payload.is_empty())
    })?;
    let Some(bytes) = record.read(source, MAX_WKT) else {
        warnings.push("the well-known text of the coordinate system is too long and is ignored".into());
        return None;
    };
    let text = vlr::decode(&bytes);
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    (!text.is_empty()).then(|| text.to_owned())
}

/// The GeoTIFF keys of a file, if there are any. Unreadable keys give a warning.
pub(super) fn geo_keys(header: &Header, source: &ByteSource, warnings: &mut Vec<String>) -> Option<GeoKeys> {
    let payload = |record: u16| {
        let record = header.records().find(|candidate| candidate.is(PROJECTION_USER, record))?;
        record.read(source, u64::from(u16::MAX))
    };
    let directory = payload(DIRECTORY)?;
    let keys =
        GeoKeys::parse(&directory, payload(DOUBLES).unwrap_or_default(), payload(TEXTS).unwrap_or_default());
    if keys.is_none() {
        warnings.push("the GeoTIFF keys of the coordinate system cannot be read and are ignored".into());
    }
    keys.filter(|keys| !keys.is_empty())
}
