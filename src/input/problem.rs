//! What is wrong inside a compressed or cloud-optimised file: the second half of the text of an error.

/// The problem with the table of compressed chunks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkTableProblem {
    /// The position of the table is outside the file.
    #[error("should be at byte {offset}, but the file has {size} bytes")]
    Outside {
        /// Its stated position.
        offset: u64,
        /// Bytes in the file.
        size: u64,
    },
    /// An unknown version of the table.
    #[error("has version {version}; only version 0 is known")]
    Version {
        /// Version as written.
        version: u32,
    },
    /// More chunks than the compressed bytes can hold.
    #[error("lists {chunks} chunks, but {bytes} compressed bytes have room for at most {limit}")]
    TooMany {
        /// Chunks listed.
        chunks: u64,
        /// Bytes of compressed points.
        bytes: u64,
        /// Chunks of the smallest possible size in these bytes.
        limit: u64,
    },
    /// The table itself cannot be decoded.
    #[error("cannot be decoded: {cause}")]
    Damaged {
        /// Message of the decoder.
        cause: String,
    },
    /// The chunks are larger than the space for them.
    #[error("says that chunk {chunk} ends at byte {end}, but the compressed points end at byte {limit}")]
    Overrun {
        /// Index of the chunk.
        chunk: usize,
        /// End of the chunk according to the table.
        end: u64,
        /// End of the compressed points.
        limit: u64,
    },
    /// The chunks do not add up to the number of points in the header.
    #[error("has {present} points, but the header promises {promised}")]
    Points {
        /// Points according to the header.
        promised: u64,
        /// Points (or their largest possible number) according to the table.
        present: u64,
    },
    /// There is no table, and the chunks cannot be found without it.
    #[error("is missing, and the chunks cannot be found without it ({found} of {promised} points found)")]
    Missing {
        /// Points according to the header.
        promised: u64,
        /// Points found by walking over the chunks.
        found: u64,
    },
    /// A chunk that exceeds the limits of the coder or of this program.
    #[error(
        "says that chunk {chunk} has {points} points in {bytes} bytes, but at most {limit} points can be read from it"
    )]
    Dense {
        /// Index of the chunk.
        chunk: usize,
        /// Points of the chunk.
        points: u64,
        /// Compressed bytes of the chunk.
        bytes: u64,
        /// Largest number of points in that many bytes, or within the decoding limit.
        limit: u64,
    },
}

/// The problem with the tree of a cloud-optimised point cloud.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CopcProblem {
    /// The record that describes the tree is missing.
    #[error("it is not a cloud-optimised point cloud")]
    NotCopc,
    /// A point format that such a file cannot have.
    #[error("its point format is {point_format}, but a cloud-optimised point cloud has 6, 7 or 8")]
    Format {
        /// The format.
        point_format: u8,
    },
    /// The records have no dimension with the object of a point.
    #[error("its points have no dimension of 32 bits with their object; chainage did not write it")]
    NoObjects,
    /// The cube of the tree has no size.
    #[error("its cube has half an edge of {halfsize} and a spacing of {spacing}")]
    Cube {
        /// Half of the edge.
        halfsize: f64,
        /// Distance between points of the root.
        spacing: f64,
    },
    /// A page of the table of nodes is not inside the file, or has no whole entries.
    #[error(
        "a page of its table of nodes has {bytes} bytes from byte {at}, the file has {size}, an entry has 32"
    )]
    Page {
        /// First byte.
        at: u64,
        /// Bytes.
        bytes: u64,
        /// Bytes of the file.
        size: u64,
    },
    /// A page of the table of nodes that two other pages refer to. The references may form a circle.
    #[error("the page of its table of nodes at byte {at} is referred to twice")]
    PageTwice {
        /// First byte.
        at: u64,
    },
    /// The table of nodes is too long.
    #[error("its table of nodes has {entries} entries or more, the limit is {limit}")]
    TooMany {
        /// Entries.
        entries: u64,
        /// The limit.
        limit: u64,
    },
    /// A node whose position does not exist.
    #[error("its table has a node at {at:?} of level {level}, which does not exist")]
    Key {
        /// The level.
        level: i32,
        /// The position.
        at: [i32; 3],
    },
    /// A node whose points are not inside the file, or are too many for their bytes.
    #[error(
        "its node {key:?} has {points} points in {bytes} bytes from byte {at}; the file has {size} bytes"
    )]
    Node {
        /// Level and position.
        key: [u32; 4],
        /// Points as written.
        points: i32,
        /// First byte.
        at: u64,
        /// Bytes as written.
        bytes: i32,
        /// Bytes of the file.
        size: u64,
    },
    /// A node that is in the table twice.
    #[error("its node {key:?} is in the table twice")]
    Twice {
        /// Level and position.
        key: [u32; 4],
    },
    /// A node without its parent. No reader would find it.
    #[error("its node {key:?} is in the table without the node above it")]
    Orphan {
        /// Level and position.
        key: [u32; 4],
    },
    /// The nodes do not have the number of points that the header promises.
    #[error("its nodes have {present} points, but the header promises {promised}")]
    Points {
        /// Points of all nodes.
        present: u64,
        /// Points according to the header.
        promised: u64,
    },
    /// The points of a node cannot be decoded.
    #[error("its node {key:?} cannot be decoded: {problem}")]
    Damaged {
        /// Level and position.
        key: [u32; 4],
        /// The problem.
        problem: ChunkProblem,
    },
    /// The table of nodes could not be read.
    #[error("its table of nodes cannot be read ({cause})")]
    Unreadable {
        /// Message of the system.
        cause: String,
    },
}

/// Why a chunk cannot be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkProblem {
    /// Its layers are larger than the chunk.
    #[error("its layers need {promised} bytes, but the chunk has {present}")]
    Layers {
        /// Bytes of the layers, by their own sizes.
        promised: u64,
        /// Bytes in the chunk.
        present: u64,
    },
    /// The number of points in the chunk differs from the number in the header and the table.
    #[error("it says that it has {present} points, but the header and the table promise {promised}")]
    Points {
        /// Points by header and table of chunks.
        promised: u32,
        /// Points by the chunk's own count.
        present: u32,
    },
    /// Bytes are left after its last point.
    #[error(
        "the {promised} points that the header and the table promise take {used} of its {present} bytes, so it has \
         more points or is damaged"
    )]
    Longer {
        /// Points by header and table of chunks.
        promised: u32,
        /// Bytes of these points.
        used: u64,
        /// Bytes in the chunk.
        present: u64,
    },
    /// The bytes are not valid code, or they end too early.
    #[error("damaged data ({cause})")]
    Damaged {
        /// Message of the decoder.
        cause: String,
    },
    /// The bytes could not be read.
    #[error("reading failed ({cause})")]
    Unreadable {
        /// Message of the system.
        cause: String,
    },
}
