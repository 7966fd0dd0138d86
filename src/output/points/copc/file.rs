//! A cloud-optimised point cloud (COPC 1.0, <https://copc.io>): LAZ 1.4 with a chunk for each node of an
//! octree, followed by the table of nodes, so that a viewer reads only what it shows.

use std::io::{Seek, SeekFrom, Write};

use las::raw::Header;
use las::raw::header::{Evlr, LargeFile};
use laz::LazVlr;

use super::octree::NodeKey;
use super::record::CopcFormat;
use super::totals::Totals;
use crate::input::Crs;
use crate::input::decode::LASZIP;
use crate::input::layout::{EXTRA_BYTES, SPEC_USER};
use crate::output::error::OutputError;
use crate::output::points::descriptor::{self, padded};
use crate::output::points::laz_chunk::{
    ChunkExtent, ChunkSize, TABLE_OFFSET_BYTES, chunk_table, compress_chunk, laz_vlr, laz_vlr_data,
};

/// The bytes of several records.
type RecordBytes = Vec<Vec<u8>>;

/// Bytes of a LAS 1.4 header. The info record of COPC must follow it immediately.
const HEADER_BYTES: u16 = 375;
/// User of the records of COPC.
const USER: &str = "copc";
/// Cells of the grid of a node along an axis.
const GRID: f64 = 128.0;
/// Longest payload of a variable length record, in bytes. Longer payloads go into extended records.
const LONGEST_VLR: usize = u16::MAX as usize;

/// The cube of the octree in the units of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WorldCube {
    pub(crate) centre: [f64; 3],
    pub(crate) halfsize: f64,
}

/// Everything about the file except its chunks.
#[derive(Debug)]
pub(crate) struct CopcSchema<'a> {
    pub(crate) format: &'a CopcFormat<'a>,
    pub(crate) crs: &'a Crs,
    pub(crate) cube: WorldCube,
    pub(crate) totals: &'a Totals,
}

/// The compression of the records of a format.
#[derive(Debug)]
pub(crate) struct Compression(LazVlr);

impl Compression {
    /// The compression of the records of a format.
    ///
    /// # Errors
    /// [`OutputError::Compress`].
    pub(crate) fn of(format: &CopcFormat<'_>) -> Result<Self, OutputError> {
        Ok(Self(laz_vlr(format.point_format, format.extra_bytes(), ChunkSize::Variable)?))
    }

    /// The chunk of a node.
    ///
    /// # Errors
    /// [`OutputError::Compress`].
    pub(crate) fn chunk(&self, records: &[u8]) -> Result<Vec<u8>, OutputError> {
        compress_chunk(&self.0, records)
    }
}

impl CopcSchema<'_> {
    /// Writes the file. `chunks` are the chunks of the nodes with points, by ascending key: key, number of
    /// points, bytes.
    ///
    /// # Errors
    /// Errors of the chunks, [`OutputError::Compress`], and a failure to write as `failed` converts it.
    pub(crate) fn write<E: From<OutputError>>(
        &self,
        chunks: impl Iterator<Item = Result<(NodeKey, u32, Vec<u8>), E>>,
        out: &mut (impl Write + Seek),
        failed: impl Fn(std::io::Error) -> OutputError,
    ) -> Result<(), E> {
        let Compression(laz) = Compression::of(self.format)?;
        let (records, extended) = self.records(&laz)?;
        let data_at = u64::from(HEADER_BYTES) + records.iter().map(|record| record.len() as u64).sum::<u64>();
        // Header and first records are written again once the positions are known.
        let start = |header: &Header, info: &[u8], out: &mut dyn Write| -> std::io::Result<()> {
            header.write_to(&mut *out).map_err(std::io::Error::other)?;
            out.write_all(&descriptor::vlr(USER, 1, "COPC info", info))?;
            records[1..].iter().try_for_each(|record| out.write_all(record))
        };
        let mut header = self.header(data_at, records.len());
        start(&header, &self.info(0, 0), out).map_err(&failed)?;
        out.write_all(&0_u64.to_le_bytes()).map_err(&failed)?;

        let mut position = data_at + TABLE_OFFSET_BYTES;
        let mut extents = Vec::new();
        let mut entries: Vec<Entry> = Vec::new();
        for one in chunks {
            let (key, points, bytes) = one?;
            out.write_all(&bytes).map_err(&failed)?;
            extents.push(ChunkExtent { records: points.into(), bytes: bytes.len() as u64 });
            entries.push(Entry { key, at: position, bytes: bytes.len(), points });
            position += bytes.len() as u64;
        }
        let table_at = position;
        let table = chunk_table(&laz, &extents)?;
        out.write_all(&table).map_err(&failed)?;
        let evlr_at = table_at + table.len() as u64;

        let hierarchy = hierarchy(&entries);
        let head = evlr_head(USER, 1000, "COPC hierarchy", hierarchy.len());
        let hierarchy_at = evlr_at + head.len() as u64;
        for part in [&head, &hierarchy].into_iter().chain(&extended) {
            out.write_all(part).map_err(&failed)?;
        }
        let count = 1 + u32::from(!extended.is_empty());
        header.evlr = Some(Evlr { start_of_first_evlr: evlr_at, number_of_evlrs: count });
        out.seek(SeekFrom::Start(0)).map_err(&failed)?;
        start(&header, &self.info(hierarchy_at, hierarchy.len() as u64), out).map_err(&failed)?;
        out.write_all(&table_at.to_le_bytes()).map_err(&failed)?;
        out.seek(SeekFrom::End(0)).map_err(&failed)?;
        Ok(out.flush().map_err(&failed)?)
    }

    /// The variable length records, and an extended one if the coordinate system is too long for them.
    fn records(&self, laz: &LazVlr) -> Result<(RecordBytes, RecordBytes), OutputError> {
        let extra: Vec<u8> = self
            .format
            .extra
            .iter()
            .flat_map(|(name, kind, description)| descriptor::integer(name, *kind, description))
            .collect();
        let mut records = vec![
            descriptor::vlr(USER, 1, "COPC info", &self.info(0, 0)),
            descriptor::vlr(LASZIP.0, LASZIP.1, LazVlr::DESCRIPTION, &laz_vlr_data(laz)?),
            descriptor::vlr(SPEC_USER, EXTRA_BYTES, "Extra Bytes Record", &extra),
        ];
        let mut extended = Vec::new();
        if let Some(wkt) = self.crs.text() {
            let text = [wkt.as_bytes(), &[0]].concat();
            let (user, number, what) = ("LASF_Projection", 2112, "OGC Coordinate System WKT");
            if text.len() <= LONGEST_VLR {
                records.push(descriptor::vlr(user, number, what, &text));
            } else {
                extended.extend([evlr_head(user, number, what, text.len()), text]);
            }
        }
        Ok((records, extended))
    }

    /// The info record of COPC.
    fn info(&self, hierarchy_at: u64, hierarchy_bytes: u64) -> Vec<u8> {
        let WorldCube { centre, halfsize } = self.cube;
        let (first, last) = self.totals.time.unwrap_or_default();
        let mut bytes = Vec::with_capacity(160);
        for value in [centre[0], centre[1], centre[2], halfsize, 2.0 * halfsize / GRID] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(hierarchy_at.to_le_bytes());
        bytes.extend(hierarchy_bytes.to_le_bytes());
        bytes.extend(first.to_le_bytes());
        bytes.extend(last.to_le_bytes());
        bytes.resize(160, 0);
        bytes
    }

    fn header(&self, data_at: u64, records: usize) -> Header {
        let CopcFormat { scale, offset, .. } = self.format;
        let Totals { records: points, by_return, low, high, .. } = *self.totals;
        let world = |axis: usize, value: i32| f64::from(value) * scale[axis] + offset[axis];
        Header {
            // Bit 0: adjusted standard time. Bit 4: the coordinate system is WKT, as formats 6 to 8 require.
            global_encoding: u16::from(self.format.standard_time) | 1 << 4,
            version: las::Version::new(1, 4),
            system_identifier: padded("chainage"),
            generating_software: padded(concat!("chainage ", env!("CARGO_PKG_VERSION"))),
            header_size: HEADER_BYTES,
            offset_to_point_data: u32::try_from(data_at).unwrap_or(u32::MAX),
            number_of_variable_length_records: u32::try_from(records).unwrap_or(u32::MAX),
            point_data_record_format: self.format.point_format | 0x80,
            point_data_record_length: u16::try_from(self.format.record_len()).unwrap_or(u16::MAX),
            x_scale_factor: scale[0],
            y_scale_factor: scale[1],
            z_scale_factor: scale[2],
            x_offset: offset[0],
            y_offset: offset[1],
            z_offset: offset[2],
            min_x: world(0, low[0]),
            min_y: world(1, low[1]),
            min_z: world(2, low[2]),
            max_x: world(0, high[0]),
            max_y: world(1, high[1]),
            max_z: world(2, high[2]),
            large_file: Some(LargeFile {
                number_of_point_records: points,
                number_of_points_by_return: by_return,
            }),
            evlr: Some(Evlr::default()),
            ..Header::default()
        }
    }
}

/// A node with its chunk.
#[derive(Debug, Clone, Copy)]
struct Entry {
    key: NodeKey,
    at: u64,
    bytes: usize,
    points: u32,
}

/// The table of nodes as one page. It contains nodes without points if a node below them has points, because
/// readers descend from the root.
fn hierarchy(entries: &[Entry]) -> Vec<u8> {
    let mut all: std::collections::BTreeMap<NodeKey, Entry> =
        entries.iter().map(|entry| (entry.key, *entry)).collect();
    for entry in entries {
        let mut above = entry.key.parent();
        while let Some(key) = above.filter(|key| !all.contains_key(key)) {
            all.insert(key, Entry { key, at: 0, bytes: 0, points: 0 });
            above = key.parent();
        }
    }
    let mut bytes = Vec::with_capacity(all.len() * 32);
    for Entry { key, at, bytes: length, points } in all.into_values() {
        bytes.extend(key.level.to_le_bytes());
        key.at.iter().for_each(|at| bytes.extend(at.to_le_bytes()));
        bytes.extend(at.to_le_bytes());
        bytes.extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
        bytes.extend(points.to_le_bytes());
    }
    bytes
}

/// The header of an extended variable length record (LAS 1.4 R15, table 5).
fn evlr_head(user: &str, record: u16, description: &str, length: usize) -> Vec<u8> {
    let mut bytes = vec![0, 0];
    bytes.extend(padded::<16>(user));
    bytes.extend(record.to_le_bytes());
    bytes.extend((length as u64).to_le_bytes());
    bytes.extend(padded::<32>(description));
    bytes
}
