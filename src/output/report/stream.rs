//! The points of a cloud-optimised file for the page: the table of nodes as JSON, and the points of each node
//! as the bytes that `cloud.rs` describes.

use std::path::Path;

use serde_json::json;

use super::cloud::coded;
use super::sample::{GROUND, LOOSE};
use crate::input::copc::{CopcFile, Key};
use crate::input::{CopcProblem, InputError, record_xyz};

/// LAS class of ground points, and the LAS classes of noise, which the page does not show (LAS 1.4 R15, table
/// 17).
const GROUND_CLASS: u8 = 2;
const NOISE_CLASSES: [u8; 2] = [7, 18];
/// Data types of the dimensions with the object and with its class: u32 and u8 (LAS 1.4 R15, table 25).
const OBJECT_TYPE: u8 = 5;
const CLASS_TYPE: u8 = 1;
/// Number of planes after the places: intensity and class.
const MORE_PLANES: usize = 3;

/// Whether the run has found the points of these LAS classes. Otherwise the classes are those of its input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// Whether points of the class of ground are ground.
    pub ground: bool,
    /// Whether points of a class of noise are noise.
    pub noise: bool,
}

/// A cloud-optimised file of a run, open for reading from any thread.
#[derive(Debug)]
pub struct PointStream {
    file: CopcFile,
    /// Where the object is in a record.
    object: usize,
    /// Where its class is.
    class: Option<usize>,
    found: Found,
}

impl PointStream {
    /// Opens a file, and checks its table of nodes.
    ///
    /// # Errors
    /// [`InputError`] if it is damaged or chainage did not write it.
    pub fn open(path: &Path, found: Found) -> Result<Self, InputError> {
        let file = CopcFile::open(path)?;
        // The writer puts the object first, and its class second.
        let column = |at: usize, kind: u8| {
            file.layout().dimensions.get(at).filter(|found| found.data_type == kind).map(|found| found.offset)
        };
        let (object, class) = (column(0, OBJECT_TYPE), column(1, CLASS_TYPE));
        let Some(object) = object else {
            return Err(InputError::Copc { path: path.to_owned(), problem: CopcProblem::NoObjects });
        };
        Ok(Self { file, object, class, found })
    }

    /// The cube, scale and offset in units of the file, and all nodes, five numbers each: level, position,
    /// and number of points. Each node comes after its parent.
    #[must_use]
    pub fn tree(&self) -> String {
        let (cube, scaling) = (self.file.cube(), self.file.scaling());
        let nodes: Vec<u32> = self
            .file
            .nodes()
            .iter()
            .flat_map(|([level, x, y, z], node)| [*level, *x, *y, *z, node.points])
            .collect();
        let tree = json!({
            "origin": cube.origin,
            "side": cube.side,
            "spacing": cube.spacing,
            "scale": scaling.scale,
            "offset": scaling.offset,
            "nodes": nodes,
        });
        tree.to_string()
    }

    /// The points of a node; `None` if there is no such node. Noise and withheld points are left out.
    ///
    /// # Errors
    /// [`InputError`] if its points cannot be read or decoded.
    pub fn node(&self, key: Key) -> Result<Option<Vec<u8>>, InputError> {
        let Some(node) = self.file.nodes().get(&key) else { return Ok(None) };
        let mut records = Vec::new();
        self.file.records(key, node, &mut records)?;
        let layout = self.file.layout();
        let mut shown: Vec<Shown> = records
            .chunks_exact(layout.record_len)
            .filter(|record| !layout.withheld.is_set(record))
            .filter_map(|record| self.shown(record, layout.intensity, layout.classification))
            .collect();
        // Keys ascend in the bytes. The order within a key is that of the file.
        shown.sort_by_key(|point| point.key);
        let mut bytes = coded(shown.iter().map(|point| (point.key, point.place)), MORE_PLANES);
        let more = bytes.len() - MORE_PLANES * shown.len();
        let (low, rest) = bytes[more..].split_at_mut(shown.len());
        let (high, class) = rest.split_at_mut(shown.len());
        for (at, point) in shown.iter().enumerate() {
            [low[at], high[at]] = point.intensity;
            class[at] = point.class;
        }
        Ok(Some(bytes))
    }

    /// The point that the page shows for a record, if any.
    fn shown(&self, record: &[u8], intensity: usize, classification: usize) -> Option<Shown> {
        let object = std::array::from_fn(|byte| record[self.object + byte]);
        let key = match (u32::from_le_bytes(object), record[classification]) {
            (0, class) if self.found.noise && NOISE_CLASSES.contains(&class) => return None,
            (0, GROUND_CLASS) if self.found.ground => GROUND,
            (object, _) => object.saturating_add(LOOSE),
        };
        Some(Shown {
            key,
            place: record_xyz(record),
            intensity: [record[intensity], record[intensity + 1]],
            class: self.class.map_or(0, |at| record[at]),
        })
    }
}

/// A point as the page shows it.
struct Shown {
    key: u32,
    place: [i32; 3],
    intensity: [u8; 2],
    class: u8,
}
