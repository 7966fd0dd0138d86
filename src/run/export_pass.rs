//! Pass `export`: the labelled copies, a run of blocks at a time; and its reduction, which gives them their names.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};
use crate::input::Fields;
use crate::model::{PointClass, RecordView};
use crate::output::{LabelledFile, OutputError};
use crate::run::drive::Drive;
use crate::run::engine::Pass;
use crate::spatial::{PackedCells, PackedCursor};
use crate::store::{PassDir, RunDir, StoreError};
use crate::whole_file::publish;

/// Points of one unit at most.
const UNIT_POINTS: u64 = 1_000_000;

/// Records that are labelled and written at a time to a file without chunks: what was just labelled is still in the
/// core's own cache when the system copies it, with the lock of the file held.
const PIECE_RECORDS: u64 = 8_192;

/// Records of one file that one unit writes.
struct Unit {
    file: usize,
    /// Chunks of the output file.
    chunks: Range<usize>,
    points: u64,
}

/// One output file that is being written.
struct Target {
    labelled: LabelledFile,
    /// Record ranges that are written as one piece each.
    chunks: Vec<Range<u64>>,
    /// Where an uncompressed file grows until it is complete.
    part: PathBuf,
    /// Whether anything was written to it since the last sync began.
    unsynced: AtomicBool,
}

pub(crate) struct ExportPass<'a> {
    drive: &'a Drive,
    owners: &'a PackedCells,
    /// Object id of label 1, 2, ... of each tile.
    ids: &'a [Vec<u32>],
    targets: Vec<Target>,
    units: Vec<Unit>,
}

impl<'a> ExportPass<'a> {
    pub(crate) fn new(
        drive: &'a Drive,
        owners: &'a PackedCells,
        ids: &'a [Vec<u32>],
        labelled: Vec<LabelledFile>,
        run_dir: &RunDir,
    ) -> Result<Self> {
        let folder = run_dir.path("export");
        fs_err::create_dir_all(&folder).map_err(StoreError::io("create", &folder))?;
        let mut pass = Self { drive, owners, ids, targets: Vec::new(), units: Vec::new() };
        for (file, labelled) in labelled.into_iter().enumerate() {
            let chunks = labelled.chunks().to_vec();
            let mut start = 0;
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
            let part = folder.join(format!("{file:05}.part"));
            pass.targets.push(Target { labelled, chunks, part, unsynced: AtomicBool::new(false) });
        }
        Ok(pass)
    }

    /// Labels and classes of the records of a range, ready to be written.
    fn labels(
        &self,
        file: usize,
        records: &Range<u64>,
        view: &RecordView<'_>,
        desk: &mut Desk<'_>,
    ) -> Result<()> {
        let count = usize::try_from(length(records)).unwrap_or(0);
        let Desk { owners, labels, classes, .. } = desk;
        labels.resize(count, 0);
        classes.resize(count, 0);
        let (label_column, class_column) = (&self.drive.labels[file], &self.drive.classes[file]);
        label_column.read(records.start, labels).map_err(StoreError::io("read", label_column.path()))?;
        class_column.read(records.start, classes).map_err(StoreError::io("read", class_column.path()))?;
        let transform = self.drive.file(file).transform();
        for ((label, class), xyz) in labels.iter_mut().zip(&*classes).zip(view.xyz()) {
            if *class != PointClass::Object.code() {
                // Left from an earlier run in which this point was no ground.
                *label = 0;
            }
            if *label == 0 {
                continue;
            }
            let [x, y, _] = transform.apply(xyz);
            let owner = self.drive.grid.cell(x, y).map_or(0, |cell| owners.get(cell));
            let id = (owner as usize)
                .checked_sub(1)
                .and_then(|tile| self.ids.get(tile))
                .and_then(|ids| ids.get(*label as usize - 1));
            *label = *id.ok_or_else(|| Error::bug(format!("label {label} of tile {owner} has no object")))?;
        }
        Ok(())
    }

    /// Puts the labelled records of a range on the desk.
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
            // A file without chunks is one block: it stays decoded on the desk while its pieces are written.
            let mut decoded = std::mem::take(&mut desk.decoded);
            let kept = desk.block == Some(block) && input.is_compressed();
            let all = if kept { &decoded[..] } else { input.records(block, Fields::All, &mut decoded)? };
            desk.block = Some(block);
            let bytes = &all[at(from)..at(to)];
            let view = RecordView { bytes, stride, gps_time: None };
            self.labels(file, &(from..to), &view, desk)?;
            self.targets[file].labelled.label(bytes, &desk.labels, &desk.classes, &mut desk.out);
            desk.decoded = decoded;
            if to == run.first_record + u64::from(run.count) {
                input.release(block);
            }
        }
        Ok(())
    }

    /// Sees to it that finished units have their bytes: units of a copy whose half-written file was lost, or was begun
    /// for something else since, are taken back, and the file is begun anew.
    pub(crate) fn begin(&self, dir: &PassDir, run_dir: &RunDir) -> Result<()> {
        let fingerprint = dir.fingerprint().to_string();
        for (file, target) in self.targets.iter().enumerate() {
            let record = format!("export/{file:05}.begun.json");
            let begun = run_dir.read_json::<String>(&record)?.is_some_and(|stored| stored == fingerprint);
            if self.is_named(file, dir, run_dir)? || (begun && target.part.exists()) {
                continue;
            }
            for (unit, _) in self.units.iter().enumerate().filter(|(_, unit)| unit.file == file) {
                // Chunks of a compressed copy are in the units themselves, and fit or do not by their fingerprint.
                if !target.labelled.is_compressed() {
                    dir.invalidate(unit)?;
                }
            }
            if let Err(source) = std::fs::remove_file(&target.part)
                && source.kind() != std::io::ErrorKind::NotFound
            {
                return Err(OutputError::Write { path: target.part.clone(), source }.into());
            }
            run_dir.write_json(&record, &fingerprint)?;
            open_part(target)?;
        }
        Ok(())
    }

    /// Whether the finished copy of a file has its name: the intent to name it is on disk before it is named, so a
    /// missing part then means that it was.
    fn is_named(&self, file: usize, dir: &PassDir, run_dir: &RunDir) -> Result<bool> {
        let target = &self.targets[file];
        let meant = run_dir.read_json::<String>(&intent(file))?;
        let path = run_dir.out().join(target.labelled.name());
        Ok(meant.is_some_and(|stored| stored == dir.fingerprint().to_string())
            && path.exists()
            && !target.part.exists())
    }

    /// Gives every labelled copy its final name, now that all units are done. May be interrupted and called again.
    pub(crate) fn reduce(&self, dir: &PassDir, run_dir: &RunDir) -> Result<()> {
        for (file, target) in self.targets.iter().enumerate() {
            let path = run_dir.out().join(target.labelled.name());
            let failed = |source| OutputError::Write { path: path.clone(), source };
            if self.is_named(file, dir, run_dir)? {
                continue;
            }
            let part = open_part(target)?;
            let input = self.drive.file(file);
            let mut writer = BufWriter::with_capacity(1 << 20, &part);
            if target.labelled.is_compressed() {
                target.labelled.assemble_laz(input, self.payloads(file, dir), &mut writer)?;
            } else {
                writer.write_all(target.labelled.prologue()).map_err(failed)?;
                let end = target.labelled.epilogue_offset();
                writer.seek(SeekFrom::Start(end)).map_err(failed)?;
                target.labelled.write_epilogue(input, &mut writer)?;
            }
            writer.flush().map_err(failed)?;
            drop(writer);
            if !target.labelled.is_compressed() {
                let end = target.labelled.epilogue_offset() + target.labelled.epilogue_len();
                part.set_len(end).map_err(failed)?;
            }
            part.sync_all().map_err(failed)?;
            run_dir.write_json(&intent(file), &dir.fingerprint().to_string())?;
            publish(&target.part, &path).map_err(failed)?;
        }
        Ok(())
    }

    /// The compressed chunks of a file in order, a unit at a time.
    fn payloads<'b>(
        &'b self,
        file: usize,
        dir: &'b PassDir,
    ) -> impl Iterator<Item = Result<(u32, Vec<u8>)>> + 'b {
        let units = self.units.iter().enumerate().filter(move |(_, unit)| unit.file == file);
        units.flat_map(|(unit, _)| {
            match dir.payload(unit).map_err(Error::from).and_then(|bytes| unpack(&bytes)) {
                Ok(chunks) => chunks.into_iter().map(Ok).collect::<Vec<_>>(),
                Err(error) => vec![Err(error)],
            }
        })
    }

    /// Names of the labelled copies.
    pub(crate) fn names(&self) -> Vec<String> {
        self.targets.iter().map(|target| target.labelled.name().to_owned()).collect()
    }
}

/// Buffers of one worker, kept from chunk to chunk: fresh ones would have to be zeroed by the system every time.
struct Desk<'a> {
    owners: PackedCursor<'a>,
    labels: Vec<u32>,
    classes: Vec<u8>,
    /// Block whose records are in `decoded`.
    block: Option<usize>,
    decoded: Vec<u8>,
    /// Labelled records.
    out: Vec<u8>,
}

impl<'a> Desk<'a> {
    fn new(owners: PackedCursor<'a>) -> Self {
        let (labels, classes, decoded, out) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { owners, labels, classes, block: None, decoded, out }
    }
}

/// Appends a compressed chunk to a payload: records (u32), bytes (u64), the chunk.
fn pack(payload: &mut Vec<u8>, records: u32, chunk: &[u8]) {
    payload.extend_from_slice(&records.to_le_bytes());
    payload.extend_from_slice(&(chunk.len() as u64).to_le_bytes());
    payload.extend_from_slice(chunk);
}

/// The chunks of a payload.
fn unpack(mut payload: &[u8]) -> Result<Vec<(u32, Vec<u8>)>> {
    let broken = || Error::bug("a payload of the export does not decode".to_owned());
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

/// Record of the intent to give the copy of a file its name.
fn intent(file: usize) -> String {
    format!("export/{file:05}.json")
}

fn length(records: &Range<u64>) -> u64 {
    records.end - records.start
}

fn open_part(target: &Target) -> Result<File, OutputError> {
    File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&target.part)
        .map_err(|source| OutputError::Write { path: target.part.clone(), source })
}

impl Pass for ExportPass<'_> {
    fn name(&self) -> &'static str {
        "export"
    }

    fn units(&self) -> usize {
        self.units.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.units[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        let unit = &self.units[unit];
        // Records as read, as labelled, and (compressed) as a payload.
        unit.points * (self.drive.file(unit.file).layout().record_len as u64 * 3 + 16)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let unit = &self.units[unit];
        let target = &self.targets[unit.file];
        self.drive.file(unit.file).check_unchanged()?;
        let mut desk = Desk::new(self.owners.cursor());
        let mut payload = Vec::new();
        let part = (!target.labelled.is_compressed()).then(|| open_part(target)).transpose()?;
        for chunk in &target.chunks[unit.chunks.clone()] {
            let Some(part) = &part else {
                self.label(unit.file, chunk, &mut desk)?;
                let count = u32::try_from(length(chunk)).unwrap_or(u32::MAX);
                pack(&mut payload, count, &target.labelled.compress(&desk.out)?);
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
        Ok(payload)
    }

    fn sync(&self) -> Result<()> {
        for target in self.targets.iter().filter(|target| target.unsynced.swap(false, Ordering::Acquire)) {
            open_part(target)?
                .sync_data()
                .map_err(|source| OutputError::Write { path: target.part.clone(), source })?;
        }
        Ok(())
    }
}
