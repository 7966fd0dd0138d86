//! Files of a drive with the same points: a scan that was given twice, under two names. It doubles all
//! densities. Only files whose headers have the same count, box, scale and offset are compared, by the
//! positions of some of their records, so a usual drive costs nothing.

use std::collections::BTreeMap;

use super::Fields;
use super::error::InputError;
use super::file::InputFile;
use crate::model::record_xyz;
use crate::words::counted;

/// Number of consecutive records that are compared at the beginning, in the middle and at the end of a file.
const SAMPLE: u64 = 1_000;
/// Largest number of files whose records are compared. Decoding three chunks of LAZ takes some 0.05 s.
const MOST_READ: usize = 64;
/// Largest number of pairs that are named.
const NAMED: usize = 5;

/// What equal files have in common before a record is read: number of points, box, scales and offsets.
type Facts = (u64, [u64; 12]);

fn facts(file: &InputFile) -> Facts {
    let [low, high] = file.header_extent();
    let scaling = file.header().scaling;
    let mut values = [low, high, scaling.scale, scaling.offset].into_iter().flatten();
    (file.point_count(), std::array::from_fn(|_| values.next().unwrap_or(0.0).to_bits()))
}

/// Warns about files that have the same points.
pub(super) fn note_twins(files: &[InputFile], warnings: &mut Vec<String>) {
    let mut alike: BTreeMap<Facts, Vec<&InputFile>> = BTreeMap::new();
    for file in files.iter().filter(|file| file.point_count() > 0) {
        alike.entry(facts(file)).or_default().push(file);
    }
    let alike: Vec<Vec<&InputFile>> = alike.into_values().filter(|group| group.len() > 1).collect();
    let mut pairs = Vec::new();
    let mut left = MOST_READ;
    let mut unread = 0;
    for group in alike {
        let mut known: BTreeMap<u64, &InputFile> = BTreeMap::new();
        for file in group {
            if left == 0 {
                unread += 1;
                continue;
            }
            left -= 1;
            // A file that cannot be read ends the command when its records are needed.
            let Ok(digest) = digest(file) else { continue };
            match known.get(&digest) {
                Some(first) => pairs.push((first.path(), file.path())),
                None => drop(known.insert(digest, file)),
            }
        }
    }
    pairs.sort_unstable();
    for (first, second) in pairs.iter().take(NAMED) {
        warnings.push(format!(
            "{} and {} have the same points, as far as they were compared: each counts twice, and densities double; leave \
             one of the files out",
            first.display(),
            second.display()
        ));
    }
    let more = pairs.len().saturating_sub(NAMED);
    if more > 0 {
        warnings.push(format!("{} have the points of another file", counted(more as u64, "more file")));
    }
    if unread > 0 {
        let files = counted(unread, "more file");
        warnings.push(format!("{files} may have the points of another file: count and box are equal"));
    }
}

/// XXH3 of the positions of the sampled records.
fn digest(file: &InputFile) -> Result<u64, InputError> {
    let count = file.point_count();
    let last = count.saturating_sub(SAMPLE);
    let mut hasher = xxhash_rust::xxh3::Xxh3::new();
    let mut buffer = Vec::new();
    for first in [0, last / 2, last] {
        let end = (first + SAMPLE).min(count);
        let blocks = file.blocks();
        let from = blocks.partition_point(|block| block.first_record + u64::from(block.count) <= first);
        for (number, block) in blocks.iter().enumerate().skip(from) {
            if block.first_record >= end {
                break;
            }
            let range = first.max(block.first_record)..end.min(block.first_record + u64::from(block.count));
            let bytes = file.records(number, Fields::Geometry, &mut buffer)?;
            let stride = file.layout().record_len;
            let index = |record: u64| usize::try_from(record - block.first_record).unwrap_or(usize::MAX);
            for record in bytes.chunks_exact(stride).take(index(range.end)).skip(index(range.start)) {
                record_xyz(record).iter().for_each(|value| hasher.update(&value.to_le_bytes()));
            }
            file.release(number);
        }
    }
    Ok(hasher.digest())
}
