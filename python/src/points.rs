//! Points as a LAS file, and the labels of its copy. So points in arrays go through the same steps as a
//! drive, and give the same partition.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use chainage::Result;
use chainage::config::{CLUSTER_ID, LengthUnit, SURFACE_ID};
use chainage::input::{Catalog, Fields, InputOptions};

/// Bytes of the header of LAS 1.4, and of a record of point format 6.
const HEADER_LEN: u16 = 375;
const RECORD_LEN: u16 = 30;

/// How coordinates are stored: as whole steps from an offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Steps {
    pub(crate) scale: [f64; 3],
    pub(crate) offset: [f64; 3],
}

impl Steps {
    /// A coordinate as a number of steps. `None` if it does not fit.
    fn step(&self, value: f64, axis: usize) -> Option<i32> {
        let steps = ((value - self.offset[axis]) / self.scale[axis]).round();
        #[expect(clippy::cast_possible_truncation, reason = "checked to be in the range")]
        (steps.abs() <= f64::from(i32::MAX)).then_some(steps as i32)
    }
}

/// A coordinate that does not fit: its row and axis.
#[derive(Debug)]
pub(crate) struct TooFar {
    pub(crate) row: usize,
    pub(crate) axis: usize,
}

/// Writes points to a LAS file. The inner result names a coordinate that does not fit.
pub(crate) fn write(path: &Path, points: &[[f64; 3]], steps: &Steps) -> io::Result<Result<(), TooFar>> {
    let mut records = Vec::with_capacity(points.len() * usize::from(RECORD_LEN));
    let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for (row, point) in points.iter().enumerate() {
        for axis in 0..3 {
            let Some(step) = steps.step(point[axis], axis) else { return Ok(Err(TooFar { row, axis })) };
            records.extend(step.to_le_bytes());
            let stored = f64::from(step) * steps.scale[axis] + steps.offset[axis];
            ends[axis] = [ends[axis][0].min(stored), ends[axis][1].max(stored)];
        }
        // Intensity, the first of one return, no class, time 0.
        records.extend([0, 0, 0x11, 0, 0, 0, 0, 0, 0, 0]);
        records.extend(0_f64.to_le_bytes());
    }
    let mut header = b"LASF".to_vec();
    header.extend([0; 20]);
    header.extend([1, 4]);
    header.extend(padded("chainage"));
    header.extend(padded("chainage"));
    header.extend([1, 0, 0xe9, 0x07]);
    header.extend(HEADER_LEN.to_le_bytes());
    header.extend(u32::from(HEADER_LEN).to_le_bytes());
    header.extend([0; 4]);
    header.push(6);
    header.extend(RECORD_LEN.to_le_bytes());
    header.extend([0; 24]);
    steps.scale.iter().chain(&steps.offset).for_each(|value| header.extend(value.to_le_bytes()));
    ends.iter().for_each(|[low, high]| {
        header.extend(high.to_le_bytes());
        header.extend(low.to_le_bytes());
    });
    header.extend([0; 20]);
    let count = points.len() as u64;
    header.extend(count.to_le_bytes());
    header.extend(count.to_le_bytes());
    header.extend([0; 14 * 8]);
    debug_assert_eq!(header.len(), usize::from(HEADER_LEN));
    let mut to = BufWriter::new(File::create(path)?);
    to.write_all(&header)?;
    to.write_all(&records)?;
    to.flush()?;
    Ok(Ok(()))
}

fn padded(text: &str) -> [u8; 32] {
    let mut bytes = [0; 32];
    bytes[..text.len()].copy_from_slice(text.as_bytes());
    bytes
}

/// Labels of points, in their order.
#[derive(Debug, Default)]
pub(crate) struct Labels {
    /// Objects, 0 for none.
    pub(crate) objects: Vec<u32>,
    /// LAS classes of the points.
    pub(crate) classes: Vec<u8>,
    /// Classes of their objects, if the method classifies.
    pub(crate) kinds: Option<Vec<u8>>,
}

/// The labels of a labelled copy.
pub(crate) fn labels(path: PathBuf) -> Result<Labels> {
    // The unit does not matter here, but degrees are looked for unless it is given.
    let catalog = Catalog::open(&[path], &InputOptions { mmap: false, unit: LengthUnit::Metre })?;
    let mut labels = Labels::default();
    for file in catalog.files() {
        let layout = file.layout();
        let missing = || chainage::Error::bug("the labelled copy has neither cluster_id nor surface_id");
        let of_objects = layout.dimension(CLUSTER_ID).or_else(|| layout.dimension(SURFACE_ID));
        let object = of_objects.ok_or_else(missing)?.offset;
        let kind = layout.dimension("object_class").map(|dimension| dimension.offset);
        let mut kinds = Vec::new();
        let mut buffer = Vec::new();
        for block in 0..file.blocks().len() {
            for record in file.records(block, Fields::All, &mut buffer)?.chunks_exact(layout.record_len) {
                let id = record[object..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
                labels.objects.push(id);
                labels.classes.push(record[layout.classification] & layout.classification_mask);
                kinds.extend(kind.map(|at| record[at]));
            }
        }
        labels.kinds = kind.map(|_| kinds);
    }
    Ok(labels)
}
