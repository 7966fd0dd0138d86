//! The bytes after the points of a file (extended records, waveforms), as pieces that are copied or replaced.

use std::io::Write;
use std::ops::Range;

use crate::input::mapped::ByteSource;

/// Bytes that are copied at once.
const STEP: u64 = 1 << 20;

/// One piece of the bytes after the points.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Piece {
    /// Bytes of the input.
    Copy(Range<u64>),
    /// Other bytes.
    New(Vec<u8>),
}

/// The bytes after the points of an output file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Tail {
    pieces: Vec<Piece>,
    len: u64,
}

impl Tail {
    /// Adds a range of the input.
    pub(super) fn copy(&mut self, range: Range<u64>) {
        if !range.is_empty() {
            self.len += range.end - range.start;
            self.pieces.push(Piece::Copy(range));
        }
    }

    /// Adds other bytes.
    pub(super) fn add(&mut self, bytes: Vec<u8>) {
        self.len += bytes.len() as u64;
        self.pieces.push(Piece::New(bytes));
    }

    /// Bytes so far.
    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// New position of a byte of the input, from the start of the tail; `None` if it was not copied.
    pub(super) fn position_of(&self, input: u64) -> Option<u64> {
        let mut start = 0;
        for piece in &self.pieces {
            match piece {
                Piece::Copy(range) if range.contains(&input) => return Some(start + input - range.start),
                Piece::Copy(range) => start += range.end - range.start,
                Piece::New(bytes) => start += bytes.len() as u64,
            }
        }
        None
    }

    /// Writes the bytes. Memory does not grow with them.
    ///
    /// # Errors
    /// If reading the input or writing the output fails. The error says which.
    pub(super) fn write(&self, source: &ByteSource, out: &mut impl Write) -> Result<(), TailError> {
        let mut buffer = Vec::new();
        for piece in &self.pieces {
            match piece {
                Piece::New(bytes) => out.write_all(bytes).map_err(TailError::Write)?,
                Piece::Copy(range) => {
                    let mut start = range.start;
                    while start < range.end {
                        let end = range.end.min(start + STEP);
                        let bytes = source.slice(start..end, &mut buffer).map_err(TailError::Read)?;
                        out.write_all(bytes).map_err(TailError::Write)?;
                        source.release(start..end);
                        start = end;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Which side failed.
#[derive(Debug)]
pub(super) enum TailError {
    /// The input could not be read.
    Read(std::io::Error),
    /// The output could not be written.
    Write(std::io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_of_copied_bytes_are_found_and_others_are_not() {
        let mut tail = Tail::default();
        tail.copy(100..110);
        tail.copy(110..110);
        tail.add(vec![0; 7]);
        tail.copy(200..205);
        assert_eq!(tail.len(), 22);
        assert_eq!(tail.position_of(109), Some(9));
        assert_eq!(tail.position_of(200), Some(17));
        assert_eq!(tail.position_of(110), None);
        assert_eq!(tail.position_of(205), None);
    }
}
