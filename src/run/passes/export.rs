//! Pass `export`: writes the labelled copies, a run of blocks at a time, and samples the points for the
//! report on the way. Its reduction gives the copies their names and chooses the shown points.
//!
//! ```text
//! payload := bytes of the samples (u64) samples chunk*     chunks only of compressed copies
//! chunk   := records (u32) bytes (u64) the chunk
//! ```

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::config::Config;
use crate::error::{Error, Result};
use crate::input::Fields;
use crate::model::{Kind, PointClass, in_u32, record_xyz};
use crate::output::report::{Choice, SamplePoint, Sampler, Sampling};
use crate::output::{LabelledFile, OutputError};
use crate::run::chain::with_section;
use crate::run::drive::Drive;
use crate::run::engine::{Outline, Pass, Payloads};
use crate::run::finish::mark;
use crate::run::passes::copies::{Copies, Labels, Shown};
use crate::run::passes::naming::Naming;
use crate::run::passes::relabel::PointColumns;
use crate::store::{Inputs, PassDir, RunDir, StoreError};
use crate::whole_file::{sync_each, sync_folder};

const NUMBER: u32 = 7;
const NAME: &str = "export";
/// Which points of a unit are sampled. 2: the first point of an object is there once.
const SAMPLE_EPOCH: u32 = 2;
/// What copies keep of their input. 1: `object_class` of other labels, and classes that no run gives.
const COPY_EPOCH: u32 = 1;

/// Maximum number of points of one unit.
pub(crate) const UNIT_POINTS: u64 = 1_000_000;

/// Number of records that are labelled and written at a time to a file without chunks. So few are still in
/// the cache of the processor core when the system copies them while it holds the lock of the file.
const PIECE_RECORDS: u64 = 8_192;

/// The records of one file that one unit writes.
struct Unit {
    file: usize,
    /// Chunks of the output file.
    chunks: Range<usize>,
    points: u64,
}

/// An output file in progress.
struct Target {
    labelled: LabelledFile,
    /// Whether it is written: a section does not copy files without points in it.
    is_copied: bool,
    /// Ranges of records, each of which is written as one piece.
    chunks: Vec<Range<u64>>,
    /// The temporary path of an uncompressed copy until it is complete.
    part: PathBuf,
    /// Whether anything was written to it since the last sync started.
    unsynced: AtomicBool,
}

impl Target {
    /// Length of an uncompressed copy in bytes. That of a compressed one is known at its end.
    fn whole_length(&self) -> Option<u64> {
        let whole = self.labelled.epilogue_offset() + self.labelled.epilogue_len();
        (!self.labelled.is_compressed()).then_some(whole)
    }
}

pub(crate) struct ExportPass<'a> {
    drive: &'a Drive,
    columns: &'a PointColumns,
    kinds: &'a [Kind],
    /// `None` if the page is not written.
    sampling: Option<&'a Sampling>,
    /// Whether labelled copies are written.
    writes: bool,
    shown: Shown<'a>,
    run_dir: &'a RunDir,
    targets: Vec<Target>,
    units: Vec<Unit>,
    outline: Outline,
}

/// The export depends on the values of all points, on the rows of the tables (which are marked as finished
/// together with the copies), and on the settings of the output.
pub(crate) fn outline(relabel: &Outline, inventory: &Outline, config: &Config) -> Outline {
    let depends = Inputs::new()
        .with("pass relabel", relabel.depends.fingerprint())
        .with("pass inventory", inventory.depends.fingerprint())
        .with("sample epoch", SAMPLE_EPOCH)
        .with("copy epoch", COPY_EPOCH);
    Outline::new(NUMBER, NAME, with_section(depends, config, "output"))
}

impl<'a> ExportPass<'a> {
    pub(crate) fn of(
        drive: &'a Drive,
        columns: &'a PointColumns,
        kinds: &'a [Kind],
        sampling: Option<&'a Sampling>,
        copies: Copies<'a>,
        run_dir: &'a RunDir,
        outline: Outline,
    ) -> Self {
        let folder = run_dir.path("export");
        let Copies { labelled, processed, writes, shown } = copies;
        let mut pass = Self {
            drive,
            columns,
            kinds,
            sampling,
            writes,
            shown,
            run_dir,
            targets: Vec::new(),
            units: Vec::new(),
            outline,
        };
        let labelled = labelled.into_iter().filter(|_| writes || sampling.is_some());
        for (file, labelled) in labelled.enumerate() {
            let chunks = labelled.chunks().to_vec();
            let is_copied = processed[file];
            let mut start = if is_copied { 0 } else { chunks.len() };
            while start < chunks.len() {
                let mut end = start;
                let mut points = 0;
                while end < chunks.len() && (end == start || points + length(&chunks[end]) <= UNIT_POINTS) {
                    points += length(&chunks[end]);
                    end += 1;
                }
                pass.units.push(Unit { file, chunks: start..end, points });
                start = end;
            }
            // The name contains the fingerprint, so that a late worker from before a change of settings
            // writes to another file.
            let part = folder.join(format!("{file:05}-{}.part", pass.outline.depends.fingerprint()));
            pass.targets.push(Target { labelled, is_copied, chunks, part, unsynced: AtomicBool::new(false) });
        }
        pass
    }

    /// The files that are written, with their numbers.
    fn copied(&self) -> impl Iterator<Item = (usize, &Target)> {
        self.targets.iter().enumerate().filter(|(_, target)| target.is_copied)
    }

    /// Puts the labelled records of a range into the buffers.
    fn label(&self, file: usize, records: &Range<u64>, desk: &mut Desk<'_>) -> Result<()> {
        let input = self.drive.file(file);
        let stride = input.layout().record_len;
        desk.out.clear();
        let first = input
            .blocks()
            .partition_point(|block| block.first_record + u64::from(block.count) <= records.start);
        for (block, run) in input.blocks().iter().enumerate().skip(first) {
            if run.first_record >= records.end {
                break;
            }
            let from = records.start.max(run.first_record);
            let to = records.end.min(run.first_record + u64::from(run.count));
            let at = |record: u64| usize::try_from(record - run.first_record).unwrap_or(0) * stride;
            // A file without chunks is one block: it stays decoded in the buffers while its pieces are
            // written.
            let mut decoded = std::mem::take(&mut desk.decoded);
            let kept = desk.block == Some(block) && !input.is_in_place();
            let all = if kept { &decoded[..] } else { input.records(block, Fields::All, &mut decoded)? };
            desk.block = Some(block);
            let bytes = &all[at(from)..at(to)];
            desk.labels.read(file, from, usize::try_from(to - from).unwrap_or(0))?;
            self.sample(file, from, bytes, desk);
            if self.writes {
                let labelled = &self.targets[file].labelled;
                let Labels { objects, classes, kinds, .. } = &desk.labels;
                labelled.label(bytes, objects, classes, kinds, &mut desk.out);
            }
            desk.decoded = decoded;
            if to == run.first_record + u64::from(run.count) {
                input.release(block);
            }
        }
        Ok(())
    }

    /// Passes the records from number `first` on to the sampler. Their labels are in the buffers.
    fn sample(&self, file: usize, first: u64, records: &[u8], desk: &mut Desk<'_>) {
        let Some(sampler) = &mut desk.sampler else { return };
        let input = self.drive.file(file);
        let intensity = input.layout().intensity;
        let numbers = (self.drive.catalog.first_id(file) + first).number()..;
        let labels = desk.labels.objects.iter().zip(&desk.labels.classes);
        for ((number, record), (&object, &class)) in
            numbers.zip(records.chunks_exact(input.layout().record_len)).zip(labels)
        {
            let place = input.transform().apply(record_xyz(record));
            // Of a section, its points and all points of its objects are shown.
            if object == 0 && !self.shown.contains(place) {
                continue;
            }
            let intensity = u16::from_le_bytes([record[intensity], record[intensity + 1]]);
            sampler.add(number, place, PointClass::from_code(class).unwrap_or_default(), object, intensity);
        }
    }

    /// Whether the finished copy of a file has its name.
    fn is_named(&self, naming: &Naming<'_>, file: usize) -> bool {
        let target = &self.targets[file];
        naming.has(file, &self.run_dir.out().join(target.labelled.name()), &target.part)
    }

    /// Whether the temporary file of a copy is no longer needed. A unit can be lost after the copy has its
    /// name. The units of an uncompressed copy do not contain its records, so all of its records are then
    /// written again.
    fn is_complete(&self, naming: &Naming<'_>, file: usize, dir: &PassDir) -> Result<bool> {
        if !self.is_named(naming, file) {
            return Ok(false);
        }
        if self.targets[file].labelled.is_compressed() {
            return Ok(true);
        }
        let units = self.units.iter().enumerate().filter(|(_, unit)| unit.file == file);
        Ok(dir.not_done_now(&units.map(|(unit, _)| unit).collect::<Vec<_>>())?.is_empty())
    }

    /// The points that the report shows, chosen from the samples of all units.
    fn shown_points(&self, payloads: &Payloads) -> Result<Vec<SamplePoint>> {
        let Some(sampling) = self.sampling else { return Ok(Vec::new()) };
        let mut choice = Choice::new(sampling.budget());
        for unit in 0..self.units.len() {
            let reader = payloads.reader(unit)?;
            let length = reader.read(0..LENGTH)?;
            let length = u64::from_le_bytes(length.try_into().map_err(|_| broken())?);
            let bytes = reader.read(LENGTH..LENGTH + length)?;
            let samples = bytemuck::try_cast_slice::<u8, SamplePoint>(&bytes).map(<[SamplePoint]>::to_vec);
            // Bytes from a file are not aligned in general.
            choice.add(&samples.unwrap_or_else(|_| bytemuck::pod_collect_to_vec(&bytes)));
        }
        Ok(choice.finish())
    }

    /// The compressed chunks of a file in order, one unit at a time.
    fn chunks<'b>(
        &'b self,
        file: usize,
        dir: &'b PassDir,
    ) -> impl Iterator<Item = Result<(u32, Vec<u8>)>> + 'b {
        let units = self.units.iter().enumerate().filter(move |(_, unit)| unit.file == file);
        units.flat_map(|(unit, _)| {
            match dir.payload(unit).map_err(Error::from).and_then(|bytes| chunks_of(&bytes)) {
                Ok(chunks) => chunks.into_iter().map(Ok).collect::<Vec<_>>(),
                Err(error) => vec![Err(error)],
            }
        })
    }
}

/// Buffers of one worker. They are reused from chunk to chunk, because the system would have to zero new ones
/// every time.
struct Desk<'a> {
    labels: Labels<'a>,
    /// The block whose records are in `decoded`.
    block: Option<usize>,
    decoded: Vec<u8>,
    /// Labelled records.
    out: Vec<u8>,
    sampler: Option<Sampler<'a>>,
}

/// Bytes of the length of the samples in a payload.
const LENGTH: u64 = size_of::<u64>() as u64;

/// Appends a compressed chunk to a payload.
fn pack(payload: &mut Vec<u8>, records: u32, chunk: &[u8]) {
    payload.extend_from_slice(&records.to_le_bytes());
    payload.extend_from_slice(&(chunk.len() as u64).to_le_bytes());
    payload.extend_from_slice(chunk);
}

/// The chunks of a payload.
fn chunks_of(payload: &[u8]) -> Result<Vec<(u32, Vec<u8>)>> {
    let (samples, rest) = payload.split_first_chunk::<8>().ok_or_else(broken)?;
    let samples = usize::try_from(u64::from_le_bytes(*samples)).map_err(|_| broken())?;
    unpack(rest.get(samples..).ok_or_else(broken)?)
}

fn broken() -> Error {
    Error::bug("a payload of the export does not decode".to_owned())
}

/// Compressed chunks, one after the other.
fn unpack(mut payload: &[u8]) -> Result<Vec<(u32, Vec<u8>)>> {
    let mut chunks = Vec::new();
    while !payload.is_empty() {
        let (records, rest) = payload.split_first_chunk::<4>().ok_or_else(broken)?;
        let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(broken)?;
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let (chunk, rest) = rest.split_at_checked(length).ok_or_else(broken)?;
        chunks.push((u32::from_le_bytes(*records), chunk.to_vec()));
        payload = rest;
    }
    Ok(chunks)
}

fn length(records: &Range<u64>) -> u64 {
    records.end - records.start
}

/// Opens the temporary file of a copy, which `prepare` has created.
fn open_part(target: &Target) -> Result<File, OutputError> {
    open_to_write(&target.part).map_err(|source| OutputError::Write { path: target.part.clone(), source })
}

/// Opens a file for writing only. Then a network file system sends just the written bytes, and never
/// whole pages with old bytes of other writers.
fn open_to_write(path: &Path) -> io::Result<File> {
    File::options().write(true).open(path)
}

/// The result of the pass.
pub(crate) struct Exported {
    /// Names of the labelled copies.
    pub(crate) names: Vec<String>,
    /// The points that the report shows, best first.
    pub(crate) points: Vec<SamplePoint>,
}

impl Pass for ExportPass<'_> {
    type Global = Exported;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.units.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.units[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        let unit = &self.units[unit];
        // Records as read, as labelled, and (if compressed) as a payload.
        let sampler = self.sampling.map_or(0, Sampling::unit_bytes);
        unit.points * (self.drive.file(unit.file).layout().record_len as u64 * 3 + 16) + sampler
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let unit = &self.units[unit];
        let target = &self.targets[unit.file];
        self.drive.file(unit.file).check_unchanged()?;
        let mut desk = Desk {
            labels: Labels::of(self.columns, self.kinds),
            block: None,
            decoded: Vec::new(),
            out: Vec::new(),
            sampler: self.sampling.map(Sampler::new),
        };
        let mut chunks = Vec::new();
        let writes_records = self.writes && !target.labelled.is_compressed();
        let part = writes_records.then(|| open_part(target)).transpose()?;
        for chunk in &target.chunks[unit.chunks.clone()] {
            if !self.writes {
                self.label(unit.file, chunk, &mut desk)?;
                continue;
            }
            let Some(part) = &part else {
                self.label(unit.file, chunk, &mut desk)?;
                let count = in_u32(length(chunk), "records of a chunk");
                pack(&mut chunks, count, &target.labelled.compress(&desk.out)?);
                continue;
            };
            let mut piece = chunk.start..chunk.start;
            while piece.end < chunk.end {
                piece = piece.end..chunk.end.min(piece.end + PIECE_RECORDS);
                self.label(unit.file, &piece, &mut desk)?;
                part.write_all_at(&desk.out, target.labelled.record_offset(piece.start))
                    .map_err(|source| OutputError::Write { path: target.part.clone(), source })?;
            }
        }
        target.unsynced.store(part.is_some(), Ordering::Release);
        let samples = desk.sampler.map(Sampler::finish).unwrap_or_default();
        let samples: &[u8] = bytemuck::cast_slice(&samples);
        let mut payload = (samples.len() as u64).to_le_bytes().to_vec();
        payload.extend_from_slice(samples);
        payload.append(&mut chunks);
        Ok(payload)
    }

    fn sync(&self) -> Result<()> {
        let written = |target: &&Target| target.unsynced.swap(false, Ordering::Acquire);
        let targets: Vec<&Target> = self.targets.iter().filter(written).collect();
        let sync = |target: &&Target| open_to_write(&target.part)?.sync_data();
        let mut result = Ok(());
        for (target, synced) in targets.iter().zip(sync_each(&targets, sync)) {
            if let Err(source) = synced {
                target.unsynced.store(true, Ordering::Release);
                result = Err(OutputError::Write { path: target.part.clone(), source }.into());
            }
        }
        result
    }

    /// Makes sure that the bytes of finished units exist. If the temporary file of a copy was lost, or was
    /// started for other values, its units are invalidated and the copy is started again.
    fn prepare(&self, dir: &PassDir) -> Result<()> {
        let run_dir = self.run_dir;
        mark::withdraw(run_dir, dir)?;
        if !self.writes {
            return Ok(());
        }
        let folder = run_dir.path("export");
        fs_err::create_dir_all(&folder).map_err(StoreError::io("create", &folder))?;
        let ours: BTreeSet<&Path> = self.targets.iter().map(|target| &*target.part).collect();
        for entry in fs_err::read_dir(&folder).map_err(StoreError::io("read", &folder))? {
            let path = entry.map_err(StoreError::io("read", &folder))?.path();
            if path.extension().is_some_and(|ending| ending == "part") && !ours.contains(&*path) {
                fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
            }
        }
        let naming = Naming::read(run_dir, dir)?;
        let mut begun = None;
        for (file, target) in self.copied() {
            // A file of another length is one whose beginning was interrupted.
            let length = fs_err::metadata(&target.part).map(|facts| facts.len()).ok();
            let whole = length.is_some() && target.whole_length().is_none_or(|whole| length == Some(whole));
            if whole || self.is_complete(&naming, file, dir)? {
                continue;
            }
            for (unit, _) in self.units.iter().enumerate().filter(|(_, unit)| unit.file == file) {
                // Chunks of a compressed copy are in the units themselves, whose fingerprints decide whether
                // they fit.
                if !target.labelled.is_compressed() {
                    dir.invalidate(unit)?;
                }
            }
            if let Err(source) = std::fs::remove_file(&target.part)
                && source.kind() != io::ErrorKind::NotFound
            {
                return Err(OutputError::Write { path: target.part.clone(), source }.into());
            }
            let failed = |source| OutputError::Write { path: target.part.clone(), source };
            let part = File::create(&target.part).map_err(failed)?;
            // The file gets its full length at once, so that each unit is the only writer of its range of
            // bytes.
            if let Some(whole) = target.whole_length() {
                part.set_len(whole).map_err(failed)?;
            }
            begun = Some(target);
        }
        // The names are durable before units count that wrote to these files.
        if let Some(target) = begun {
            sync_folder(&target.part).map_err(StoreError::io("sync", &folder))?;
        }
        Ok(())
    }

    /// Gives every labelled copy its final name after all units are done. It may be interrupted and called
    /// again.
    fn reduce(&self, payloads: &Payloads) -> Result<Exported> {
        let points = self.shown_points(payloads)?;
        if !self.writes {
            return Ok(Exported { names: Vec::new(), points });
        }
        let dir = payloads.dir()?;
        let run_dir = self.run_dir;
        let mut naming = Naming::read(run_dir, dir)?;
        for (file, target) in self.copied() {
            let path = run_dir.out().join(target.labelled.name());
            let failed = |source| OutputError::Write { path: path.clone(), source };
            if self.is_named(&naming, file) {
                continue;
            }
            let part = open_part(target)?;
            let input = self.drive.file(file);
            let mut writer = BufWriter::with_capacity(1 << 20, &part);
            if target.labelled.is_compressed() {
                target.labelled.assemble_laz(input, self.chunks(file, dir), &mut writer)?;
            } else {
                writer.write_all(target.labelled.prologue()).map_err(failed)?;
                let end = target.labelled.epilogue_offset();
                writer.seek(SeekFrom::Start(end)).map_err(failed)?;
                target.labelled.write_epilogue(input, &mut writer)?;
            }
            writer.flush().map_err(failed)?;
            drop(writer);
            naming.add(file, part, &target.part, path)?;
        }
        naming.finish()?;
        let names = self.copied().map(|(_, target)| target.labelled.name().to_owned()).collect();
        Ok(Exported { names, points })
    }
}
