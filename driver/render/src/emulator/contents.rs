//! Contents of the lines that a chip reads: the boxes, triangles and photons among which it searches.
//!
//! A chip tests everything in a line that it reads. The counts of the contents are therefore the numbers of
//! steps of the chip's units. There is one exception: searches of the caustic map skip boxes whose classes of
//! normals cannot match, but these boxes are counted. The cost model ([`crate::cost_model`]) multiplies the
//! counts by the operations per step.

use std::ops::Range;

use photoncard_firmware::memory::{CardMemory, MemoryPort, Stage, Work};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::layout::{BvhLeaf, PhotonLeaf, WideNode};
use photoncard_shared::message::Fault;
use serde::{Deserialize, Serialize};

/// Counts of the contents of lines that a chip read for tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contents {
    /// Number of nodes of the bounding volume hierarchy.
    pub nodes: u64,
    /// Number of boxes in nodes of the bounding volume hierarchy.
    pub boxes: u64,
    /// Number of leaves of the hierarchy. A leaf that is read again for one triangle is not counted.
    pub leaves: u64,
    /// Number of vertices in leaves of the hierarchy.
    pub vertices: u64,
    /// Number of triangles in leaves of the hierarchy.
    pub triangles: u64,
    /// Number of material records.
    pub materials: u64,
    /// Number of light records: nodes of the light tree, and emitters.
    pub lights: u64,
    /// Number of inner nodes of the hierarchies over photons and irradiance points.
    pub photon_nodes: u64,
    /// Number of boxes in inner nodes of the hierarchies over photons and irradiance points.
    pub photon_boxes: u64,
    /// Number of leaves of photons and irradiance points.
    pub photon_leaves: u64,
    /// Number of photons and irradiance points in leaves.
    pub photons: u64,
    /// Number of photons of Jensen's kd-tree, each of which is a node.
    pub tree_photons: u64,
}

impl Contents {
    /// Counts that are all zero.
    pub const ZERO: Self = Self {
        nodes: 0,
        boxes: 0,
        leaves: 0,
        vertices: 0,
        triangles: 0,
        materials: 0,
        lights: 0,
        photon_nodes: 0,
        photon_boxes: 0,
        photon_leaves: 0,
        photons: 0,
        tree_photons: 0,
    };

    /// Adds the counts of another chip.
    pub fn add(&mut self, other: &Self) {
        self.nodes += other.nodes;
        self.boxes += other.boxes;
        self.leaves += other.leaves;
        self.vertices += other.vertices;
        self.triangles += other.triangles;
        self.materials += other.materials;
        self.lights += other.lights;
        self.photon_nodes += other.photon_nodes;
        self.photon_boxes += other.photon_boxes;
        self.photon_leaves += other.photon_leaves;
        self.photons += other.photons;
        self.tree_photons += other.tree_photons;
    }

    /// Counts the contents of a line that the chip has read. `used` is the range of bytes that it uses.
    fn count(&mut self, structure: Structure, line: &[u8; LINE_BYTES], used: &Range<u32>) {
        match structure {
            Structure::Nodes => {
                self.nodes += 1;
                self.boxes += u64::from(WideNode(line).children());
            }
            Structure::Triangles if *used == BvhLeaf::OF_TRIANGLE => {}
            Structure::Triangles => {
                self.leaves += 1;
                self.vertices += u64::from(BvhLeaf(line).vertices());
                self.triangles += u64::from(BvhLeaf(line).triangles());
            }
            Structure::Materials => self.materials += 1,
            Structure::Emitters => self.lights += 1,
            Structure::PhotonNodes | Structure::CausticNodes | Structure::IrradianceNodes => {
                self.photon_nodes += 1;
                self.photon_boxes += u64::from(WideNode(line).children());
            }
            // A leaf is read as a whole, a node of the kd-tree as one record of a line.
            Structure::Photons if used.len() < LINE_BYTES => self.tree_photons += 1,
            Structure::Photons | Structure::CausticPhotons | Structure::IrradiancePoints => {
                self.photon_leaves += 1;
                self.photons += u64::from(PhotonLeaf::read(line).photons());
            }
            Structure::Header
            | Structure::Attributes
            | Structure::Textures
            | Structure::IrradianceRecords
            | Structure::Waiting => {}
        }
    }
}

/// Memory that counts the contents of the lines read for tiles.
pub struct Inspected<M> {
    memory: M,
    stage: Stage,
    contents: Contents,
}

impl<M> Inspected<M> {
    /// Wraps `memory` and counts the contents of its lines.
    pub fn new(memory: M) -> Self {
        Self { memory, stage: Stage::Begin, contents: Contents::ZERO }
    }

    /// Contents counted so far.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// The wrapped memory.
    pub fn below(&self) -> &M {
        &self.memory
    }

    /// The wrapped memory, mutable.
    pub fn below_mut(&mut self) -> &mut M {
        &mut self.memory
    }
}

impl<M: MemoryPort> MemoryPort for Inspected<M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        let line = self.memory.read(structure, address, used.clone())?;
        if self.stage != Stage::Begin {
            self.contents.count(structure, &line.0, &used);
        }
        Ok(line)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(structure, first, lines)
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.memory.begin_tile();
    }

    fn begin_work(&mut self, work: Work) {
        self.memory.begin_work(work);
    }
}

impl<M: CardMemory> CardMemory for Inspected<M> {
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.memory.known_checksum(lines)
    }
}
