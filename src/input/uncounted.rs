//! Points beyond the count in the header. A recorder that crashed leaves the count of its last update, or
//! zero.

use std::io;
use std::ops::Range;

use super::header::Header;
use super::mapped::ByteSource;

/// Bytes that are compared with zero at once.
const PROBE: u64 = 1 << 16;

/// Number of whole records after the `count` records that the header promises. Zeros at the end do not count,
/// because some writers reserve or align space. Few bytes are read, however long the file is.
///
/// # Errors
/// Those of the system.
pub(super) fn records(header: &Header, source: &ByteSource, count: u64) -> io::Result<u64> {
    let record_len = u64::from(header.record_len);
    let start = header.points_start + count * record_len;
    let whole = limit(header, source.len(), start).saturating_sub(start) / record_len;
    let used = bytes(source, &(start..start + whole * record_len))?;
    Ok(used.div_ceil(record_len))
}

/// The end of the bytes from `start` on that may be points: where the header places something else, or the
/// end of the file.
pub(super) fn limit(header: &Header, size: u64, start: u64) -> u64 {
    let named = [header.tail_start, header.evlr_start, header.waveform_start].into_iter().flatten();
    named.filter(|at| *at >= start).fold(size, u64::min)
}

/// Number of bytes of a range before its final zeros, found by bisection in steps of [`PROBE`]. If zeros
/// before other bytes fill a whole step, they may therefore count as final zeros.
///
/// # Errors
/// Those of the system.
pub(super) fn bytes(source: &ByteSource, range: &Range<u64>) -> io::Result<u64> {
    let mut buffer = Vec::new();
    // Bytes of a step before its final zeros.
    let mut used = |step: u64| {
        let start = range.start + step * PROBE;
        let bytes = source.slice(start..range.end.min(start + PROBE), &mut buffer)?;
        Ok::<u64, io::Error>(bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last as u64 + 1))
    };
    // All steps below `low` have bytes other than zero; the step `high` and all after it do not.
    let (mut low, mut high) = (0, (range.end - range.start).div_ceil(PROBE));
    while low < high {
        let middle = low.midpoint(high);
        if used(middle)? > 0 {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    match low.checked_sub(1) {
        Some(last) => Ok(last * PROBE + used(last)?),
        None => Ok(0),
    }
}

/// The warning about records that are not read.
pub(super) fn warning(count: u64, further: u64) -> String {
    let records = if further == 1 { "record" } else { "records" };
    format!(
        "the header promises {count} points, but {further} more {records} follow them ({} in all): they are not \
         read. If they are points, export the file again, or correct the count (LAStools: `lasinfo -i FILE \
         -set_number_of_point_records {}`)",
        count + further,
        count + further
    )
}

/// The warning about compressed points that are not read.
pub(super) fn warning_of_chunks(count: u64, bytes: u64) -> String {
    format!(
        "the header promises {count} points, but {bytes} more bytes follow their chunks: they are not read. If they \
         are points, export the file again"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(content: &[u8]) -> u64 {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("bytes");
        std::fs::write(&path, content).expect("written");
        let found = [true, false].map(|mmap| {
            let source = ByteSource::open(&path, mmap).expect("opens");
            bytes(&source, &(1..source.len())).expect("readable")
        });
        assert_eq!(found[0], found[1]);
        found[0]
    }

    #[test]
    fn final_zeros_are_no_content() {
        let step = usize::try_from(PROBE).expect("small");
        for length in [0, 1, 7, step - 1, step, step + 1, 5 * step + 3] {
            for zeros in [0, 1, step - 1, step, 9 * step + 11] {
                let mut content = vec![1];
                content.extend(vec![2; length]);
                content.extend(vec![0; zeros]);
                assert_eq!(used(&content), length as u64, "{length} bytes, then {zeros} zeros");
            }
        }
    }
}
