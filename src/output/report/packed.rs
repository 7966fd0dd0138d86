//! Bytes as text inside a page: compressed by deflate (RFC 1951), coded in base64 (RFC 4648); JSON that
//! cannot end its element; and the digest by which a page names its own script.

use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::core::{
    CompressorOxide, TDEFLFlush, TDEFLStatus, compress_to_output, create_comp_flags_from_zip_params,
};
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Effort of the compression from 0 to 10. 6 is the usual compromise of zlib; 9 saves 1 % in three times the
/// time.
const EFFORT: u8 = 6;

/// Compressed bytes, whose length as text is known before they become text.
pub(super) struct Compressed {
    bytes: Vec<u8>,
    len: usize,
}

impl Compressed {
    /// Compresses bytes.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let bytes = miniz_oxide::deflate::compress_to_vec(bytes, EFFORT);
        Self { len: bytes.len(), bytes }
    }

    /// Length of the text.
    pub(super) fn text_len(&self) -> usize {
        text_len(self.len)
    }

    /// The text. After a [`Compressor`], it is complete only if it is not longer than allowed.
    pub(super) fn text(&self) -> String {
        STANDARD.encode(&self.bytes)
    }
}

/// Length of the text of this many bytes.
fn text_len(bytes: usize) -> usize {
    bytes.div_ceil(3) * 4
}

/// Compresses what is written to it, to the same bytes as in one piece. If the text would be too long, the
/// bytes are only counted.
pub(super) struct Compressor {
    state: Box<CompressorOxide>,
    found: Compressed,
    most: usize,
}

impl Compressor {
    /// An empty compressor. `most` is the largest length of the text.
    pub(super) fn new(most: usize) -> Self {
        let flags = create_comp_flags_from_zip_params(EFFORT.into(), 0, 0);
        let found = Compressed { bytes: Vec::new(), len: 0 };
        Self { state: Box::new(CompressorOxide::new(flags)), found, most }
    }

    fn add(&mut self, bytes: &[u8], flush: TDEFLFlush, expected: TDEFLStatus) -> io::Result<()> {
        let Self { state, found, most } = self;
        let (status, taken) = compress_to_output(state, bytes, flush, |compressed| {
            found.len += compressed.len();
            if text_len(found.len) <= *most {
                found.bytes.extend_from_slice(compressed);
            } else {
                found.bytes = Vec::new();
            }
            true
        });
        match status == expected && taken == bytes.len() {
            true => Ok(()),
            false => Err(io::Error::other(format!("the compression ended with {status:?}"))),
        }
    }

    /// The compressed form of everything that was written.
    pub(super) fn finish(mut self) -> io::Result<Compressed> {
        self.add(&[], TDEFLFlush::Finish, TDEFLStatus::Done)?;
        Ok(self.found)
    }
}

impl Write for Compressor {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.add(bytes, TDEFLFlush::None, TDEFLStatus::Okay)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// JSON for a script element. No text in it can end the element, because `<` is escaped.
pub(super) fn json(value: &impl Serialize) -> serde_json::Result<String> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

/// The source of an inline script or style as a Content-Security-Policy names it.
pub(super) fn source_of(text: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_bytes_come_back() {
        let bytes = b"abcabcabc<>".repeat(50);
        let compressed = Compressed::of(&bytes);
        let text = compressed.text();
        assert_eq!(text.len(), compressed.text_len());
        assert!(
            text.len() < bytes.len() && text.chars().all(|c| c.is_ascii_alphanumeric() || "+/=".contains(c))
        );
        let inflated = miniz_oxide::inflate::decompress_to_vec(&STANDARD.decode(text).unwrap()).unwrap();
        assert_eq!(inflated, bytes);
    }

    #[test]
    fn in_pieces_the_compressed_bytes_are_the_same() {
        // Numbers with few and with many repetitions, over several windows of the compression (32 KiB).
        let bytes: Vec<u8> = (0..60_000_u64)
            .flat_map(|at| format!("{},", at.wrapping_mul(0x9e37_79b9) >> (at / 4_000)).into_bytes())
            .collect();
        let whole = Compressed::of(&bytes);
        for size in [1, 7, 300, 4_096, 100_000, usize::MAX] {
            let mut compressor = Compressor::new(whole.text_len());
            bytes.chunks(size).for_each(|piece| compressor.write_all(piece).unwrap());
            let found = compressor.finish().unwrap();
            assert!(found.bytes == whole.bytes, "pieces of {size} bytes");
            assert_eq!((found.len, found.text_len()), (whole.len, whole.text_len()));
        }
        let mut short = Compressor::new(whole.text_len() - 1);
        short.write_all(&bytes).unwrap();
        let short = short.finish().unwrap();
        assert_eq!((short.text_len(), short.bytes.capacity()), (whole.text_len(), 0));
    }

    #[test]
    fn no_text_ends_the_element() {
        let text = json(&["</script><!--<script>", "\u{2028} \"quoted\""]).unwrap();
        assert!(!text.contains('<'), "{text}");
        let back: Vec<String> = serde_json::from_str(&text).unwrap();
        assert_eq!(back, ["</script><!--<script>", "\u{2028} \"quoted\""]);
    }

    /// The example of the W3C recommendation Content Security Policy Level 3, section 8.4.
    #[test]
    fn scripts_are_named_by_their_digest() {
        let source = source_of("alert('Hello, world.');");
        assert_eq!(source, "'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='");
    }
}
