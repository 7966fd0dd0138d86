//! A block of uncompressed point records: the bytes and their layout.

/// Uncompressed records of one block, and their layout.
#[derive(Debug, Clone, Copy)]
pub struct RecordView<'a> {
    /// The records, one after the other.
    pub bytes: &'a [u8],
    /// Bytes per record; x, y and z are its first twelve.
    pub stride: usize,
    /// Offset of the GPS time in a record, if the format has one.
    pub gps_time: Option<usize>,
    /// Where a record says that it is withheld. `None` if no record of the block is.
    pub withheld: Option<FlagPlace>,
}

/// A bit of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlagPlace {
    /// Offset of its byte in the record.
    pub offset: usize,
    /// The byte with only this bit.
    pub mask: u8,
}

impl FlagPlace {
    /// Whether the bit of a record is set.
    #[inline]
    #[must_use]
    pub fn is_set(self, record: &[u8]) -> bool {
        record[self.offset] & self.mask != 0
    }
}

impl<'a> RecordView<'a> {
    /// The record coordinates of every record.
    pub fn xyz(&self) -> impl Iterator<Item = [i32; 3]> + 'a {
        self.bytes.chunks_exact(self.stride).map(record_xyz)
    }

    /// The GPS time of a record in seconds, if the format has one.
    #[inline]
    #[must_use]
    pub fn time(&self, record: &[u8]) -> Option<f64> {
        let bytes = record.get(self.gps_time?..)?.first_chunk()?;
        Some(f64::from_le_bytes(*bytes))
    }

    /// Whether a record of the block is withheld.
    #[inline]
    #[must_use]
    pub fn is_withheld(&self, record: &[u8]) -> bool {
        self.withheld.is_some_and(|flag| flag.is_set(record))
    }
}

/// The coordinates of a record: its first twelve bytes in every point format.
#[inline]
#[must_use]
pub fn record_xyz(record: &[u8]) -> [i32; 3] {
    let at = |k: usize| i32::from_le_bytes([record[k], record[k + 1], record[k + 2], record[k + 3]]);
    [at(0), at(4), at(8)]
}
