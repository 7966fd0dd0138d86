//! The voxels of a tile as a graph: its vertices are the voxels of the tile, and the voxels of other tiles to
//! which an edge leads. The step `edges` stores it once, and every round of growth reads nothing else of the
//! tile.
//!
//! A round changes few values. So the graph is not decoded: a vertex is read in place from the payload.
#![expect(
    clippy::cast_possible_truncation,
    reason = "voxels of a tile fit u32; a tile is shorter than 2^31 lattice units"
)]

use serde::{Deserialize, Serialize};

use crate::cluster::TileWindow;
use crate::cluster::street::classes::classified::Shares;
use crate::cluster::street::cores::stage_cores::{Core, Cored};
use crate::cluster::street::settings::{CLASSES, STEP_EDGES};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::TileId;

/// Sections of the payload: the [`Head`], each [`Vertex`] in turn, and the neighbours of all vertices.
const SECTION_HEAD: usize = 0;
const SECTION_VERTICES: usize = 1;
const SECTION_NEIGHBOURS: usize = 2;

/// The part that a round decodes as a whole.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Head {
    /// Number of the voxels of the tile.
    own: u32,
    /// The other vertices, each with its tile and its number there, ascending.
    outside: Vec<(TileId, u32)>,
    /// Voxels of the tile that have an edge to another tile, ascending.
    at_border: Vec<u32>,
    /// The cores of the vertices.
    cores: Vec<Core>,
    /// Origin of the centres of the vertices, in lattice units.
    start: [i64; 3],
}

/// A vertex in the payload.
struct Vertex {
    /// Centre relative to the start, in lattice units.
    centre: [i32; 3],
    shares: Shares,
    /// Label of the core, or 0.
    label: u32,
    /// Where its neighbours end. They begin where the neighbours of the previous vertex end.
    end: u32,
}

impl Vertex {
    const BYTES: usize = 3 * 4 + CLASSES + 4 + 4;

    fn write(&self, to: &mut Vec<u8>) {
        self.centre.iter().for_each(|value| to.extend(value.to_le_bytes()));
        to.extend(self.shares);
        to.extend(self.label.to_le_bytes());
        to.extend(self.end.to_le_bytes());
    }

    fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let mut shares = [0; CLASSES];
        shares.copy_from_slice(&bytes[12..12 + CLASSES]);
        Self {
            centre: [0, 4, 8].map(|at| i32::from_le_bytes(word(at))),
            shares,
            label: u32::from_le_bytes(word(12 + CLASSES)),
            end: u32::from_le_bytes(word(16 + CLASSES)),
        }
    }
}

/// Writes ascending numbers as their differences, 7 bits in a byte, the lowest first. The last byte of a
/// difference has its highest bit clear. The first number is stored relative to `from`, with the sign in the
/// lowest bit.
fn write_numbers(numbers: &[u32], from: u32, to: &mut Vec<u8>) {
    let mut last = None;
    for &number in numbers {
        let mut step = match last {
            Some(last) => number - last,
            None if number >= from => (number - from) << 1,
            None => (from - number) << 1 | 1,
        };
        while step >= 0x80 {
            to.push(step as u8 | 0x80);
            step >>= 7;
        }
        to.push(step as u8);
        last = Some(number);
    }
}

/// The numbers in `bytes`.
fn read_numbers(bytes: &[u8], from: u32) -> impl Iterator<Item = u32> + '_ {
    let mut bytes = bytes.iter();
    let mut last = None;
    std::iter::from_fn(move || {
        let mut byte = *bytes.next()?;
        let mut step = u32::from(byte & 0x7f);
        let mut shift = 7;
        while byte & 0x80 != 0 {
            byte = *bytes.next()?;
            step |= u32::from(byte & 0x7f) << shift;
            shift += 7;
        }
        let number = match last {
            Some(last) => last + step,
            None if step & 1 == 0 => from + (step >> 1),
            None => from - (step >> 1),
        };
        last = Some(number);
        Some(number)
    })
}

/// The vertices of a graph: the voxels of a tile in their order, and then the voxels of other tiles.
#[derive(Debug, Default)]
struct Vertices {
    own: u32,
    outside: Vec<(TileId, u32)>,
    centre: Vec<[i64; 3]>,
    shares: Vec<Shares>,
    label: Vec<u32>,
    cores: Vec<Core>,
}

impl Vertices {
    /// The payload of a graph with these edges, each once.
    fn encode(self, edges: Vec<(u32, u32)>) -> Result<Vec<u8>> {
        let Self { own, outside, centre, shares, label, cores } = self;
        let mut end = vec![0_u32; centre.len() + 1];
        for &(one, other) in &edges {
            end[one as usize + 1] += 1;
            end[other as usize + 1] += 1;
        }
        for vertex in 0..centre.len() {
            end[vertex + 1] += end[vertex];
        }
        // end[v] moves from the begin of the neighbours of v to their end.
        let mut to = vec![0_u32; 2 * edges.len()];
        for (one, other) in edges.into_iter().flat_map(|(one, other)| [(one, other), (other, one)]) {
            let at = &mut end[one as usize];
            to[*at as usize] = other;
            *at += 1;
        }
        let start = centre.first().copied().unwrap_or_default();
        let mut head = Head { own, outside, at_border: Vec::new(), cores, start };
        let mut table = Vec::with_capacity(centre.len() * Vertex::BYTES);
        let mut neighbours = Vec::with_capacity(2 * to.len());
        let mut from = 0;
        for (number, centre) in centre.iter().enumerate() {
            let of_vertex = &mut to[from..end[number] as usize];
            from = end[number] as usize;
            of_vertex.sort_unstable();
            let vertex = number as u32;
            if vertex < own && of_vertex.last().is_some_and(|&last| last >= own) {
                head.at_border.push(vertex);
            }
            write_numbers(of_vertex, vertex, &mut neighbours);
            let centre = [0, 1, 2].map(|axis| (centre[axis] - start[axis]) as i32);
            let end = neighbours.len() as u32;
            Vertex { centre, shares: shares[number], label: label[number], end }.write(&mut table);
        }
        Ok(codec::pack(&[codec::encode(&head)?, table, neighbours]))
    }
}

/// The payload of a tile. `edges` are pairs of voxel numbers in `cored`, each once. At least one voxel of a
/// pair belongs to the tile.
pub(crate) fn encode(cored: &Cored, mut edges: Vec<(u32, u32)>) -> Result<Vec<u8>> {
    let voxels = &cored.around.voxels;
    let owned = |voxel: u32| voxels.owned[voxel as usize];
    let mut outside: Vec<(TileId, u32, u32)> = edges
        .iter()
        .flat_map(|&(one, other)| [one, other])
        .filter(|&voxel| !owned(voxel))
        .map(|voxel| (voxels.origin[voxel as usize].0, voxels.origin[voxel as usize].1, voxel))
        .collect();
    outside.sort_unstable();
    outside.dedup();
    let mut numbers: Vec<u32> = (0..voxels.len() as u32).filter(|&voxel| owned(voxel)).collect();
    let own = numbers.len() as u32;
    numbers.extend(outside.iter().map(|entry| entry.2));
    let mut vertex_of = vec![0; voxels.len()];
    for (vertex, &voxel) in (0_u32..).zip(&numbers) {
        vertex_of[voxel as usize] = vertex;
    }
    for (one, other) in &mut edges {
        (*one, *other) = (vertex_of[*one as usize], vertex_of[*other as usize]);
    }
    drop(vertex_of);
    let label: Vec<u32> = numbers.iter().map(|&voxel| cored.label[voxel as usize]).collect();
    let vertices = Vertices {
        own,
        outside: outside.into_iter().map(|(tile, number, _)| (tile, number)).collect(),
        centre: numbers.iter().map(|&voxel| voxels.centre[voxel as usize]).collect(),
        shares: numbers.iter().map(|&voxel| cored.around.shares[voxel as usize]).collect(),
        cores: cored.cores_of(label.clone()),
        label,
    };
    vertices.encode(edges)
}

/// The graph of a tile. The vertices that are voxels of the tile come first, in the order in which the tile
/// stores them.
#[derive(Debug)]
pub(crate) struct Graph {
    head: Head,
    payload: Vec<u8>,
    /// Where the vertices and the neighbours begin in the payload.
    vertices: usize,
    neighbours: usize,
    /// Number of vertices.
    count: usize,
}

impl Graph {
    /// Loads the graph of a tile.
    pub(crate) fn load(tile: &dyn TileWindow) -> Result<Self> {
        let payload = tile.payload(STEP_EDGES, tile.tile())?;
        let graph = Self::of_payload(payload)?;
        graph.ok_or_else(|| Error::bug(format!("the graph of tile {} does not decode", tile.tile().number())))
    }

    fn of_payload(payload: Vec<u8>) -> Result<Option<Self>> {
        let head: Head = codec::decode(codec::section(&payload, SECTION_HEAD)?)?;
        let vertices = codec::section_in(&payload, SECTION_VERTICES)?;
        let neighbours = codec::section_in(&payload, SECTION_NEIGHBOURS)?;
        let count = vertices.len() / Vertex::BYTES;
        let graph = Self { head, payload, vertices: vertices.start, neighbours: neighbours.start, count };
        let end = count.checked_sub(1).map_or(0, |last| graph.vertex(last).end as usize);
        let whole = end == neighbours.len();
        Ok(Some(graph).filter(|graph| whole && graph.own() + graph.head.outside.len() == count))
    }

    /// Number of vertices.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Number of vertices that are voxels of the tile.
    pub(crate) fn own(&self) -> usize {
        self.head.own as usize
    }

    /// The other vertices, each with its tile and its number there, ascending.
    pub(crate) fn outside(&self) -> &[(TileId, u32)] {
        &self.head.outside
    }

    /// Voxels of the tile that have an edge to another tile, ascending. Other tiles see their values.
    pub(crate) fn at_border(&self) -> &[u32] {
        &self.head.at_border
    }

    /// The cores of the labels of the vertices.
    pub(crate) fn cores(&self) -> &[Core] {
        &self.head.cores
    }

    fn vertex(&self, number: usize) -> Vertex {
        let (vertices, _) = self.payload[self.vertices..].as_chunks();
        Vertex::read(&vertices[number])
    }

    /// Centre of a vertex relative to [`Self::start`], in lattice units.
    pub(crate) fn centre(&self, vertex: usize) -> [i32; 3] {
        self.vertex(vertex).centre
    }

    /// The origin of the centres, in lattice units.
    pub(crate) fn start(&self) -> [i64; 3] {
        self.head.start
    }

    /// Probabilities of the classes of a vertex.
    pub(crate) fn shares(&self, vertex: usize) -> Shares {
        self.vertex(vertex).shares
    }

    /// Label of the core of a vertex, or 0.
    pub(crate) fn label(&self, vertex: usize) -> u32 {
        self.vertex(vertex).label
    }

    /// Vertices to which a vertex has edges, ascending. An edge leads both ways. Edges between vertices of
    /// other tiles are not included.
    pub(crate) fn neighbours(&self, vertex: usize) -> impl Iterator<Item = usize> + '_ {
        let from = vertex.checked_sub(1).map_or(0, |before| self.vertex(before).end as usize);
        let bytes = &self.payload[self.neighbours + from..self.neighbours + self.vertex(vertex).end as usize];
        read_numbers(bytes, vertex as u32).map(|number| number as usize)
    }
}

#[cfg(test)]
impl Graph {
    /// A graph with these vertices, labels and edges. The first `own` vertices belong to the tile. `shares`
    /// has an entry for each vertex, or one for all.
    pub(crate) fn of(
        own: u32,
        centre: &[[i64; 3]],
        shares: &[Shares],
        label: &[u32],
        edges: &[(u32, u32)],
    ) -> Self {
        let outside = (own..centre.len() as u32).map(|number| (TileId::new(1), number)).collect();
        let (centre, label) = (centre.to_vec(), label.to_vec());
        let shares = (0..centre.len()).map(|vertex| shares[vertex % shares.len()]).collect();
        let vertices = Vertices { own, outside, centre, shares, label, cores: Vec::new() };
        Self::of_payload(vertices.encode(edges.to_vec()).unwrap()).unwrap().unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ascending_numbers_return_from_their_bytes() {
        for numbers in
            [vec![], vec![0], vec![7, 8, 135, 263, 2_000_000], vec![100, 101], vec![1 << 30, (1 << 30) + 1]]
        {
            for from in [0, 7, 100, 101, 1 << 29] {
                let mut bytes = Vec::new();
                write_numbers(&numbers, from, &mut bytes);
                assert_eq!(read_numbers(&bytes, from).collect::<Vec<_>>(), numbers);
            }
        }
    }

    #[test]
    fn a_vertex_returns_from_its_bytes() {
        let vertex = Vertex {
            centre: [-1, 70_000, i32::MIN],
            shares: [1, 2, 3, 4, 5, 6, 7, 227],
            label: 9,
            end: 1 << 31,
        };
        let mut bytes = Vec::new();
        vertex.write(&mut bytes);
        let read = Vertex::read(bytes.first_chunk().unwrap());
        assert_eq!(
            (read.centre, read.shares, read.label, read.end),
            (vertex.centre, vertex.shares, 9, 1 << 31)
        );
    }
}
