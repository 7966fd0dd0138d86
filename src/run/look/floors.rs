//! Lower limits of the running time. The copy floor reads every input byte and writes every output byte once,
//! sequentially, without any computation. The codec floor decodes and encodes every LAZ chunk and writes
//! nothing.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::input::{Fields, InputError};
use crate::output::{LabelOptions, LabelledFile, OutputError};
use crate::run::open;

/// Bytes per read and write: large enough that the time of the calls is negligible.
const PIECE: usize = 1 << 20;

/// Seconds to read `inputs` once and to write `output_bytes` to a file in `folder`. The file is removed
/// again. With `durable` it is synced to the disk, like every file that a run writes.
///
/// # Errors
/// When a file cannot be read or written.
pub fn copy_floor(inputs: &[PathBuf], output_bytes: u64, folder: &Path, durable: bool) -> Result<f64> {
    let path = folder.join("copy-floor.part");
    let failed = |source| OutputError::Write { path: path.clone(), source };
    let started = Instant::now();
    let mut piece = vec![0_u8; PIECE];
    let mut out = File::create(&path).map_err(failed)?;
    let mut left = output_bytes;
    for input in inputs {
        let unreadable = |source| InputError::Read { path: input.clone(), source };
        let mut file = File::open(input).map_err(unreadable)?;
        loop {
            let length = file.read(&mut piece).map_err(unreadable)?;
            if length == 0 {
                break;
            }
            let written = usize::try_from(left).unwrap_or(usize::MAX).min(length);
            out.write_all(&piece[..written]).map_err(failed)?;
            left -= written as u64;
        }
    }
    while left > 0 {
        let written = usize::try_from(left).unwrap_or(usize::MAX).min(PIECE);
        out.write_all(&piece[..written]).map_err(failed)?;
        left -= written as u64;
    }
    if durable {
        out.sync_all().map_err(failed)?;
    }
    let seconds = started.elapsed().as_secs_f64();
    fs_err::remove_file(&path).map_err(failed)?;
    Ok(seconds)
}

/// Seconds to decode every chunk of compressed `inputs` and to encode it again with labels of zero, on
/// `threads` threads. `None` if no input is compressed.
///
/// # Errors
/// When a file cannot be read.
pub fn codec_floor(inputs: &[PathBuf], config: &Config, threads: usize) -> Result<Option<f64>> {
    let catalog = open::catalog(inputs, config)?;
    if !catalog.files().iter().any(crate::input::InputFile::is_compressed) {
        return Ok(None);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::bug(format!("no threads: {error}")))?;
    let started = Instant::now();
    for file in catalog.files().iter().filter(|file| file.is_compressed()) {
        let labelled = LabelledFile::plan(file, &LabelOptions::default())?;
        pool.install(|| {
            (0..file.blocks().len()).into_par_iter().try_for_each(|block| -> Result<()> {
                let mut buffer = Vec::new();
                let mut out = Vec::new();
                let records = file.records(block, Fields::All, &mut buffer)?;
                let count = file.blocks()[block].count as usize;
                labelled.label(records, &vec![0; count], &vec![0; count], &[], &mut out);
                std::hint::black_box(labelled.compress(&out)?);
                Ok(())
            })
        })?;
    }
    Ok(Some(started.elapsed().as_secs_f64()))
}

/// The files that the arguments of a command name, and their bytes.
///
/// # Errors
/// When a file cannot be opened.
pub fn files_of(inputs: &[PathBuf], config: &Config) -> Result<Vec<(PathBuf, u64)>> {
    let catalog = open::catalog(inputs, config)?;
    Ok(catalog.files().iter().map(|file| (file.path().to_owned(), file.size_bytes())).collect())
}
