//! One input file: its header, blocks and records.

use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::Fields;
use super::chunks::{self, Block};
use super::crs::{Crs, looks_like_degrees};
use super::decode::Coding;
use super::error::{ChunkProblem, InputError};
use super::header::{Header, Scaling};
use super::layout::RecordLayout;
use super::mapped::ByteSource;
use super::options::InputOptions;
use crate::model::{AxisTransform, Lattice, LatticeTransform};

/// One LAS or LAZ file, open for reading from any thread.
#[derive(Debug)]
pub struct InputFile {
    path: PathBuf,
    name: String,
    size: u64,
    modified: SystemTime,
    source: ByteSource,
    header: Header,
    coding: Option<Coding>,
    layout: RecordLayout,
    blocks: Vec<Block>,
    crs: Crs,
    /// One unit of x, y and z in metres.
    units_m: [f64; 3],
    transform: LatticeTransform,
    warnings: Vec<String>,
}

impl InputFile {
    /// Opens and checks a file. Its units are metres, and its transform uses the millimetre lattice, until
    /// the catalog sets others.
    pub(crate) fn open(path: &Path, options: &InputOptions) -> Result<Self, InputError> {
        let read_error = |source| InputError::Read { path: path.to_owned(), source };
        let metadata = std::fs::metadata(path).map_err(read_error)?;
        if metadata.is_dir() {
            return Err(read_error(io::ErrorKind::IsADirectory.into()));
        }
        let modified = metadata.modified().map_err(read_error)?;
        let source = ByteSource::open(path, options.mmap).map_err(read_error)?;
        let mut header = Header::read(path, &source)?;
        let mut warnings = std::mem::take(&mut header.warnings);
        let layout = RecordLayout::read(&header, &source, &mut warnings);
        let coding = if header.compressed { Some(Coding::read(path, &header, &source)?) } else { None };
        let blocks = match &coding {
            Some(coding) => chunks::laz_blocks(path, &header, coding, &source, &mut warnings)?,
            None => chunks::las_blocks(path, &header, &source, &mut warnings)?,
        };
        let crs = Crs::read(&header, &source, &mut warnings);
        let mut file = Self {
            path: path.to_owned(),
            name: path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
            size: source.len(),
            modified,
            source,
            header,
            coding,
            layout,
            blocks,
            crs,
            units_m: [1.0; 3],
            transform: LatticeTransform { axes: [AxisTransform::Integer { factor: 1, shift: 0 }; 3] },
            warnings,
        };
        file.note_counts();
        Ok(file)
    }

    /// The path, as found.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file name without its folder.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Bytes in the file when it was opened.
    #[must_use]
    pub fn size_bytes(&self) -> u64 {
        self.size
    }

    /// Time of the last change when it was opened.
    #[must_use]
    pub fn modified(&self) -> SystemTime {
        self.modified
    }

    /// Points in the file.
    #[must_use]
    pub fn point_count(&self) -> u64 {
        self.blocks.last().map_or(0, |last| last.first_record + u64::from(last.count))
    }

    /// Runs of records that are read at once, in file order, without gaps.
    #[must_use]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Whether the points are compressed (LAZ).
    #[must_use]
    pub fn is_compressed(&self) -> bool {
        self.coding.is_some()
    }

    /// Whether the file is a cloud-optimised point cloud: LAZ with an index and points in spatial order.
    #[must_use]
    pub fn is_copc(&self) -> bool {
        self.header.vlrs.records.iter().any(|record| record.is("copc", 1))
    }

    /// The positions of the fields in a record.
    #[must_use]
    pub fn layout(&self) -> &RecordLayout {
        &self.layout
    }

    /// The transform from record coordinates to the lattice of the run.
    #[must_use]
    pub fn transform(&self) -> &LatticeTransform {
        &self.transform
    }

    /// The coordinate reference system.
    #[must_use]
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// Whether no record names a system, and the coordinates look like degrees.
    pub(crate) fn seems_geographic(&self) -> bool {
        !self.crs.is_known() && looks_like_degrees(self.header.scaling.scale, self.header.extent)
    }

    /// One unit of x, y and z in metres, the same for all files of a drive.
    #[must_use]
    pub fn units_m(&self) -> [f64; 3] {
        self.units_m
    }

    /// Sets the units of the drive. The transform follows with [`Self::set_lattice`].
    pub(crate) fn set_units(&mut self, units_m: [f64; 3]) {
        self.units_m = units_m;
    }

    /// Minimum and maximum of x, y and z from the header, in units of the file. They are not checked.
    #[must_use]
    pub fn header_extent(&self) -> [[f64; 3]; 2] {
        self.header.extent
    }

    /// LAS version as (major, minor).
    #[must_use]
    pub fn version(&self) -> (u8, u8) {
        self.header.version
    }

    /// Problems of the file that do not prevent processing.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The uncompressed records of a block, one after the other (`layout().record_len` bytes each).
    ///
    /// The bytes of a mapped LAS file are returned in place. Otherwise the records are read or decoded into
    /// `buffer`, which is overwritten. Any thread may read any block.
    ///
    /// # Errors
    /// [`InputError::Chunk`] when the block is damaged or cannot be read.
    ///
    /// # Panics
    /// When there is no such block.
    pub fn records<'a>(
        &'a self,
        block: usize,
        fields: Fields,
        buffer: &'a mut Vec<u8>,
    ) -> Result<&'a [u8], InputError> {
        let run = &self.blocks[block];
        let failed = |problem| InputError::Chunk {
            path: self.path.clone(),
            chunk: block,
            first: run.first_record,
            last: run.first_record + u64::from(run.count) - 1,
            problem,
        };
        let unreadable = |error: io::Error| failed(ChunkProblem::Unreadable { cause: error.to_string() });
        let Some(coding) = &self.coding else {
            return self.source.slice(run.bytes.clone(), buffer).map_err(unreadable);
        };
        let mut compressed = Vec::new();
        let bytes = self.source.slice(run.bytes.clone(), &mut compressed).map_err(unreadable)?;
        coding.decode(bytes, run.count, fields, buffer).map_err(failed)?;
        Ok(buffer)
    }

    /// Lets the system reclaim the memory of a block. It can be read again at any time.
    ///
    /// # Panics
    /// When there is no such block.
    pub fn release(&self, block: usize) {
        self.source.release(self.blocks[block].bytes.clone());
    }

    /// Announces to the system that a block will be read soon.
    ///
    /// # Panics
    /// When there is no such block.
    pub fn prefetch(&self, block: usize) {
        self.source.prefetch(self.blocks[block].bytes.clone());
    }

    /// Checks that size and time of the file are unchanged since it was opened.
    ///
    /// If a mapped file is truncated, the next access ends the process, and no check can prevent that.
    /// Frequent checks make it unlikely. `InputOptions::mmap = false` makes it impossible.
    ///
    /// # Errors
    /// [`InputError::Changed`], or [`InputError::Read`] when the file is gone.
    pub fn check_unchanged(&self) -> Result<(), InputError> {
        let read_error = |source| InputError::Read { path: self.path.clone(), source };
        let now: Metadata = std::fs::metadata(&self.path).map_err(read_error)?;
        let modified = now.modified().map_err(read_error)?;
        if now.len() == self.size && modified == self.modified {
            return Ok(());
        }
        Err(InputError::Changed {
            path: self.path.clone(),
            before: state(self.size, self.modified),
            now: state(now.len(), modified),
        })
    }

    /// Header, for the writers of labelled copies.
    pub(crate) fn header(&self) -> &Header {
        &self.header
    }

    /// Bytes, for the writers of labelled copies.
    pub(crate) fn source(&self) -> &ByteSource {
        &self.source
    }

    /// Whether records are used in place, in a mapped file without compression.
    pub(crate) fn is_in_place(&self) -> bool {
        self.coding.is_none() && matches!(self.source, ByteSource::Mapped(_))
    }

    /// A digest of everything before the points (scale, offset, coordinate reference system) and of the
    /// records after them. If a record after the points is longer than a mebibyte, as waveforms are, only its
    /// header counts.
    ///
    /// # Errors
    /// [`InputError::Read`].
    pub(crate) fn header_digest(&self) -> Result<u64, InputError> {
        let failed = |source| InputError::Read { path: self.path.clone(), source };
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        let mut buffer = Vec::new();
        let mut add = |range: std::ops::Range<u64>| {
            hasher.update(self.source.slice(range, &mut buffer).map_err(failed)?);
            Ok::<(), InputError>(())
        };
        add(0..self.header.points_start)?;
        for record in &self.header.evlrs.records {
            let payload = record.payload.clone();
            let is_short = payload.end - payload.start <= LONG_RECORD;
            add(record.start..if is_short { payload.end } else { payload.start })?;
        }
        Ok(hasher.digest())
    }

    /// The coding of the points, for the writers of labelled copies.
    pub(crate) fn coding(&self) -> Option<&Coding> {
        self.coding.as_ref()
    }

    /// The finest step of the coordinates in metres.
    pub(crate) fn finest_scale_m(&self) -> f64 {
        let Scaling { scale, .. } = self.header.scaling;
        (0..3).map(|axis| scale[axis] * self.units_m[axis]).fold(f64::INFINITY, f64::min)
    }

    /// Sets the transform to the lattice of the run.
    ///
    /// # Errors
    /// [`InputError::HeaderField`] when coordinates could leave the range of the lattice.
    pub(crate) fn set_lattice(&mut self, lattice: Lattice) -> Result<(), InputError> {
        let Scaling { scale, offset } = self.header.scaling;
        for axis in 0..3 {
            let unit = self.units_m[axis];
            let field = |field: [&'static str; 3], value: f64, expected: String| InputError::HeaderField {
                path: self.path.clone(),
                field: field[axis],
                value: format!("{value:e}"),
                expected,
            };
            let scale_m = scale[axis] * unit;
            if !(MIN_SCALE_M..=MAX_SCALE_M).contains(&scale_m) {
                let expected = format!("{MIN_SCALE_M:e} m to {MAX_SCALE_M:e} m");
                return Err(field(["x scale", "y scale", "z scale"], scale[axis], expected));
            }
            let limit_m = lattice.metres(LatticeTransform::LIMIT_UNITS);
            let reach_m = offset[axis].abs() * unit + scale_m * 2_f64.powi(31);
            if reach_m >= limit_m {
                let expected = format!("such that coordinates stay below {limit_m:e} m");
                return Err(field(["x offset", "y offset", "z offset"], offset[axis], expected));
            }
            self.transform.axes[axis] = AxisTransform::new(scale[axis], offset[axis], unit, lattice);
        }
        Ok(())
    }

    fn note_counts(&mut self) {
        if let [first, second] = self.header.counts[..] {
            self.warnings.push(format!(
                "the header has two point counts, {first} (1.4) and {second} (legacy); the file has {} points",
                self.point_count()
            ));
        }
        if self.blocks.is_empty() {
            self.warnings.push("there are no points".into());
        }
    }
}

/// Longest payload of a record after the points that is digested as a whole, in bytes.
const LONG_RECORD: u64 = 1 << 20;
/// Finest accepted step of coordinates. Files of survey scanners have 1e-3 to 1e-6 m.
const MIN_SCALE_M: f64 = 1e-9;
/// Coarsest accepted step of coordinates.
const MAX_SCALE_M: f64 = 1e3;

/// A readable form of size and time. The time is in seconds, the precision of the comparison.
fn state(size: u64, modified: SystemTime) -> String {
    let seconds = modified.duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |age| age.as_secs_f64());
    format!("{size} bytes, changed at {seconds:.3} s")
}
