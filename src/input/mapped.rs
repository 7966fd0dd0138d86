//! The bytes of a read-only file, mapped or read.

use std::fs::File;
use std::io::{self, Error, ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use memmap2::{Mmap, MmapOptions};

/// Number of bytes on each side of a range that are released with it. An access also maps pages around the
/// needed one, even pages of ranges that were released before. Without the margin, 160 kB remained resident
/// for every block of 2 MB (Linux 6, a file of 935 MB read block by block: 71 MB resident at the end, growing
/// with the file). If a neighbouring range is still in use, its pages only have to be mapped again.
const RELEASE_MARGIN: u64 = 1 << 20;

/// A read-only file. Any thread may access its ranges.
#[derive(Debug)]
pub(crate) enum ByteSource {
    /// The whole file is mapped. Ranges are used in place.
    Mapped(Mmap),
    /// Ranges are read into a buffer, for file systems with slow mappings or files that may shrink.
    Read {
        /// The file. It is only read at given positions; its cursor is not used.
        file: File,
        /// Size when it was opened.
        len: u64,
    },
}

impl ByteSource {
    /// Opens `path` for reading; an empty file is never mapped.
    ///
    /// # Errors
    /// The error of the system when the file cannot be opened or mapped.
    pub(crate) fn open(path: &Path, mmap: bool) -> io::Result<Self> {
        let file = File::open(path)?;
        let len = file.metadata()?.len();
        if mmap && len > 0 { Ok(Self::Mapped(map(&file)?)) } else { Ok(Self::Read { file, len }) }
    }

    /// Bytes in the file when it was opened.
    pub(crate) fn len(&self) -> u64 {
        match self {
            Self::Mapped(map) => map.len() as u64,
            Self::Read { len, .. } => *len,
        }
    }

    /// The bytes of `range`: in place if mapped, otherwise read into `buffer`, which is overwritten.
    ///
    /// # Errors
    /// `UnexpectedEof` if the range is not inside the file, else the error of the system. No memory is
    /// allocated for a range outside the file.
    pub(crate) fn slice<'a>(&'a self, range: Range<u64>, buffer: &'a mut Vec<u8>) -> io::Result<&'a [u8]> {
        let inside = self.clip(&range)?;
        match self {
            Self::Mapped(map) => Ok(&map[inside]),
            Self::Read { file, .. } => {
                buffer.resize(inside.len(), 0);
                read_exact_at(file, buffer, range.start)?;
                Ok(buffer)
            }
        }
    }

    /// Tells the system that the pages of `range` are not needed for now, to keep resident memory flat. This
    /// is only advice: a range outside the file or a refusal of the system has no effect.
    pub(crate) fn release(&self, range: Range<u64>) {
        let end = range.end.saturating_add(RELEASE_MARGIN).min(self.len());
        let range = range.start.saturating_sub(RELEASE_MARGIN)..end;
        if let (Self::Mapped(map), Ok(inside)) = (self, self.clip(&range))
            && !inside.is_empty()
        {
            drop_pages(map, inside);
        }
    }

    /// Tells the system that `range` will be needed soon. Only advice, like [`ByteSource::release`].
    pub(crate) fn prefetch(&self, range: Range<u64>) {
        if let (Self::Mapped(map), Ok(inside)) = (self, self.clip(&range))
            && !inside.is_empty()
        {
            want_pages(map, inside);
        }
    }

    /// The range as indices, if it is inside the file.
    fn clip(&self, range: &Range<u64>) -> io::Result<Range<usize>> {
        let inside = range.start <= range.end && range.end <= self.len();
        match (inside, usize::try_from(range.start), usize::try_from(range.end)) {
            (true, Ok(start), Ok(end)) => Ok(start..end),
            _ => Err(Error::new(
                ErrorKind::UnexpectedEof,
                format!("bytes {} to {} of a file of {}", range.start, range.end, self.len()),
            )),
        }
    }
}

#[expect(unsafe_code, reason = "a mapping can only be made by an unsafe constructor")]
fn map(file: &File) -> io::Result<Mmap> {
    // SAFETY: the mapping is read-only and is only lent as `&[u8]`. The argument does not cover other
    // processes. If one writes to the file, bytes under a `&[u8]` change; all users copy or decode, and no
    // value from the file is trusted twice without a check. If one truncates the file, an access to the lost
    // pages raises SIGBUS and ends this process. Callers therefore compare size and time at tile boundaries
    // (`InputFile::check_unchanged`) and offer reading instead of mapping (`mmap = false`).
    unsafe { MmapOptions::new().map(file) }
}

#[expect(unsafe_code, reason = "memmap2 lets DONTNEED be given only as unchecked advice")]
fn drop_pages(map: &Mmap, range: Range<usize>) {
    // SAFETY: DONTNEED can discard the content of private or anonymous memory. This is a shared, read-only
    // mapping of a file. Its dropped pages are read from the file again at the next access, so no `&[u8]`
    // changes its value. As above, a file that another process changes is not covered.
    let _only_advice =
        unsafe { map.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, range.start, range.len()) };
}

fn want_pages(map: &Mmap, range: Range<usize>) {
    let _only_advice = map.advise_range(memmap2::Advice::WillNeed, range.start, range.len());
}

fn read_exact_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

/// A cursor over a range of a [`ByteSource`], for decoders that need a stream.
#[derive(Debug)]
pub(crate) struct RangeReader<'a> {
    source: &'a ByteSource,
    range: Range<u64>,
    position: u64,
    buffer: Vec<u8>,
}

impl<'a> RangeReader<'a> {
    /// A stream of the bytes of `range`.
    pub(crate) fn new(source: &'a ByteSource, range: Range<u64>) -> Self {
        Self { source, position: range.start, range, buffer: Vec::new() }
    }
}

impl Read for RangeReader<'_> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let left = self.range.end.saturating_sub(self.position);
        let count = left.min(target.len() as u64);
        let bytes = self.source.slice(self.position..self.position + count, &mut self.buffer)?;
        target[..bytes.len()].copy_from_slice(bytes);
        self.position += count;
        Ok(bytes.len())
    }
}

impl Seek for RangeReader<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let target = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::Current(delta) => self.position.checked_add_signed(delta),
            SeekFrom::End(delta) => self.range.end.checked_add_signed(delta),
        };
        self.position = target.ok_or_else(|| Error::from(ErrorKind::InvalidInput))?;
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_mapped_and_a_read_file_give_the_same_bytes_and_the_same_refusals() {
        let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
        let content: Vec<u8> =
            (0..10_000_u32).map(|value| u8::try_from(value % 251).expect("small")).collect();
        file.write_all(&content).expect("written");
        for mmap in [true, false] {
            let source = ByteSource::open(file.path(), mmap).expect("opens");
            assert_eq!(source.len(), 10_000);
            assert_eq!(matches!(source, ByteSource::Mapped(_)), mmap);
            let mut buffer = Vec::new();
            for indices in [0_usize..0, 0..10_000, 4_095..4_097, 9_999..10_000, 10_000..10_000] {
                let range = indices.start as u64..indices.end as u64;
                source.prefetch(range.clone());
                let expected = &content[indices];
                assert_eq!(source.slice(range.clone(), &mut buffer).expect("inside"), expected);
                source.release(range.clone());
                assert_eq!(source.slice(range, &mut buffer).expect("inside"), expected, "after release");
            }
            for range in [0..10_001, 10_001..10_001, u64::MAX - 1..u64::MAX] {
                let error = source.slice(range.clone(), &mut buffer).expect_err("outside");
                assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{range:?}");
                source.release(range.clone());
                source.prefetch(range);
            }
        }
    }

    #[test]
    fn an_empty_file_is_opened_without_a_mapping() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let source = ByteSource::open(file.path(), true).expect("opens");
        assert_eq!(source.len(), 0);
        assert!(source.slice(0..0, &mut Vec::new()).expect("empty").is_empty());
    }

    #[test]
    fn a_stream_ends_at_the_end_of_its_range() {
        let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
        file.write_all(b"0123456789").expect("written");
        let source = ByteSource::open(file.path(), false).expect("opens");
        let mut reader = RangeReader::new(&source, 2..8);
        let mut text = String::new();
        reader.read_to_string(&mut text).expect("text");
        assert_eq!(text, "234567");
        assert_eq!(reader.seek(SeekFrom::End(-2)).expect("inside"), 6);
        text.clear();
        reader.read_to_string(&mut text).expect("text");
        assert_eq!(text, "67");
    }
}
