//! The two sides of a comparison: their records in order, and where their labels are. The records are matched
//! elsewhere.

use std::sync::{Mutex, PoisonError};

use crate::error::Result;
use crate::eval::error::{EvalError, PointSite, Side};
use crate::eval::matching::dims::{LabelField, WrongLabel};
use crate::eval::matching::labels::Label;
use crate::eval::matching::settings::CompareSettings;
use crate::eval::table::Predicted;
use crate::input::{Catalog, Fields, InputFile, record_xyz};
use crate::model::PointId;

/// A block of a file, with the place of its records in the order of all files of its side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    /// File of the catalog.
    pub(super) file: usize,
    /// Block of the file.
    pub(super) block: usize,
    /// Index of its first record among the records of all files.
    pub(super) first: PointId,
    /// Records.
    pub(super) count: u64,
}

/// The files of one side, with the places `F` of the labels in each.
#[derive(Debug)]
pub(super) struct Files<'a, F> {
    pub(super) catalog: &'a Catalog,
    /// Per file.
    pub(super) fields: Vec<F>,
    /// All blocks in order.
    pub(super) runs: Vec<Run>,
}

/// Where a file of the prediction has its labels.
#[derive(Debug)]
pub(super) struct PredictionFields {
    segment: LabelField,
    class: LabelField,
    /// Class of the object, if it is compared.
    named: Option<LabelField>,
    ground: Vec<u16>,
    noise: Vec<u16>,
}

/// Where a file of the reference has its labels.
#[derive(Debug)]
pub(super) struct ReferenceFields {
    object: LabelField,
    class: Option<LabelField>,
}

impl PredictionFields {
    /// Segment, ground or noise, and class of the object of a record.
    #[inline]
    pub(super) fn read(&self, record: &[u8]) -> Result<(i64, Predicted, u16), WrongLabel> {
        let class = self.class.class(record)?;
        let predicted = if self.ground.contains(&class) {
            Predicted::Ground
        } else if self.noise.contains(&class) {
            Predicted::Noise
        } else {
            Predicted::Other
        };
        let named = self.named.as_ref().map_or(Ok(0), |field| field.class(record))?;
        Ok((self.segment.id(record)?, predicted, named))
    }
}

impl ReferenceFields {
    /// Object and class of a record; class 0 if the reference has no classes.
    #[inline]
    pub(super) fn read(&self, record: &[u8]) -> Result<(i64, u16), WrongLabel> {
        let class = match &self.class {
            Some(field) => field.class(record)?,
            None => 0,
        };
        Ok((self.object.id(record)?, class))
    }
}

/// Reads the label that one side gives a point.
pub(super) trait LabelFields {
    /// The label of a record.
    fn label(&self, record: &[u8]) -> Result<Label, WrongLabel>;
}

impl LabelFields for PredictionFields {
    #[inline]
    fn label(&self, record: &[u8]) -> Result<Label, WrongLabel> {
        self.read(record).map(|(id, predicted, named)| Label { id, class: predicted as u16, named })
    }
}

impl LabelFields for ReferenceFields {
    #[inline]
    fn label(&self, record: &[u8]) -> Result<Label, WrongLabel> {
        self.read(record).map(|(id, class)| Label { id, class, named: 0 })
    }
}

impl<'a> Files<'a, PredictionFields> {
    pub(super) fn prediction(catalog: &'a Catalog, settings: &CompareSettings) -> Result<Self, EvalError> {
        let segment = settings.prediction_dim_in(catalog);
        let named = settings.named_dim_in(catalog);
        let fields = |file: &InputFile| {
            Ok(PredictionFields {
                segment: LabelField::find(file, Side::Prediction, segment)?,
                class: LabelField::find(file, Side::Prediction, "classification")?,
                named: named.map(|name| LabelField::find(file, Side::Prediction, name)).transpose()?,
                ground: settings.ground_classes.clone(),
                noise: settings.noise_classes.clone(),
            })
        };
        Self::new(catalog, fields)
    }
}

impl<'a> Files<'a, ReferenceFields> {
    pub(super) fn reference(catalog: &'a Catalog, settings: &CompareSettings) -> Result<Self, EvalError> {
        let find = |file: &InputFile, name: &str| LabelField::find(file, Side::Reference, name);
        let fields = |file: &InputFile| {
            Ok(ReferenceFields {
                object: find(file, &settings.reference_dim)?,
                class: settings.class_dim.as_ref().map(|name| find(file, name)).transpose()?,
            })
        };
        Self::new(catalog, fields)
    }
}

impl<'a, F> Files<'a, F> {
    fn new(
        catalog: &'a Catalog,
        fields: impl Fn(&InputFile) -> Result<F, EvalError>,
    ) -> Result<Self, EvalError> {
        let mut runs = Vec::new();
        for (file, opened) in catalog.files().iter().enumerate() {
            runs.extend(opened.blocks().iter().enumerate().map(|(block, run)| Run {
                file,
                block,
                first: catalog.first_id(file) + run.first_record,
                count: run.count.into(),
            }));
        }
        Ok(Self { catalog, fields: catalog.files().iter().map(fields).collect::<Result<_, _>>()?, runs })
    }

    /// The file of a run.
    pub(super) fn file(&self, run: &Run) -> &'a InputFile {
        &self.catalog.files()[run.file]
    }

    /// The error for a wrong label in the record with this index among all files.
    pub(super) fn wrong(&self, run: &Run, index: PointId, label: WrongLabel) -> EvalError {
        label.at(self.file(run).path(), index - self.catalog.first_id(run.file))
    }

    /// Whether every file has a GPS time.
    pub(super) fn has_time(&self) -> bool {
        self.catalog.files().iter().all(|file| file.layout().gps_time.is_some())
    }

    /// The run that contains the record with this index.
    fn run_of(&self, index: PointId) -> &Run {
        &self.runs[self.runs.partition_point(|run| run.first + run.count <= index)]
    }

    /// The point with this index, for a message.
    ///
    /// # Errors
    /// When its block cannot be read.
    pub(super) fn site(&self, index: PointId, with_time: bool) -> Result<PointSite> {
        let run = self.run_of(index);
        let file = self.file(run);
        let mut reader = BlockReader::default();
        let len = file.layout().record_len;
        #[expect(clippy::cast_possible_truncation, reason = "below the number of records of a block, a u32")]
        let at = (index - run.first) as usize * len;
        let record = &reader.records(file, run)?[at..at + len];
        let lattice = self.catalog.lattice();
        Ok(PointSite {
            path: file.path().to_owned(),
            record: index - self.catalog.first_id(run.file),
            at_m: file.transform().apply(record_xyz(record)).map(|units| lattice.metres(units)),
            gps_time: file
                .layout()
                .gps_time
                .filter(|_| with_time)
                .map(|at| f64::from_bits(time_bits(record, at))),
        })
    }
}

/// The GPS time of a record, which starts at byte `at`.
#[inline]
pub(super) fn time_bits(record: &[u8], at: usize) -> u64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&record[at..at + 8]);
    u64::from_le_bytes(bytes)
}

/// Reads blocks one after the other and keeps the last one.
#[derive(Debug, Default)]
pub(super) struct BlockReader {
    buffer: Vec<u8>,
    held: Option<(usize, usize)>,
}

impl BlockReader {
    /// The records of a run of `file`.
    ///
    /// # Errors
    /// When the block cannot be read.
    pub(super) fn records<'b>(&'b mut self, file: &'b InputFile, run: &Run) -> Result<&'b [u8]> {
        if file.is_in_place() {
            return Ok(file.records(run.block, Fields::All, &mut self.buffer)?);
        }
        let wanted = Some((run.file, run.block));
        if self.held != wanted {
            self.held = None;
            file.records(run.block, Fields::All, &mut self.buffer)?;
            self.held = wanted;
        }
        Ok(&self.buffer)
    }
}

/// Readers for the left and the right side.
pub(super) type Readers = [BlockReader; 2];

/// Readers that no thread uses at the moment. Their buffers are as large as blocks. If they were allocated
/// again and again, the allocator would keep memory that never becomes free.
#[derive(Debug, Default)]
pub(super) struct Idle(Mutex<Vec<Readers>>);

impl Idle {
    /// Lends readers to `work`.
    pub(super) fn lend<T>(&self, work: impl FnOnce(&mut Readers) -> T) -> T {
        let idle = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut readers = idle().pop().unwrap_or_default();
        let result = work(&mut readers);
        idle().push(readers);
        result
    }
}
