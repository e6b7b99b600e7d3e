//! The card image: its header and its lines.

use std::ops::Range;

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::{Header, Section, SectionKind};
use photoncard_shared::layout::{BvhNode, NodeBox, WideNode};

/// Card image.
#[derive(Clone)]
pub struct CardImage {
    /// Header, as encoded in the first lines.
    pub(super) header: Header,
    pub(super) lines: Vec<Line>,
}

impl AsRef<[Line]> for CardImage {
    fn as_ref(&self) -> &[Line] {
        &self.lines
    }
}

impl CardImage {
    /// All lines, the header's first.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Bytes of the image.
    pub fn bytes(&self) -> u64 {
        self.lines.len() as u64 * LINE_BYTES as u64
    }

    /// The image as a chip sees it.
    pub fn view(&self) -> (SceneImage, Lines<'_>) {
        (SceneImage { header: self.header }, Lines(&self.lines))
    }

    /// The lines of a section.
    pub(crate) fn section(&self, kind: SectionKind) -> &[Line] {
        &self.lines[self.range(kind)]
    }

    /// The lines of a section, mutable.
    pub(crate) fn section_mut(&mut self, kind: SectionKind) -> &mut [Line] {
        let range = self.range(kind);
        &mut self.lines[range]
    }

    /// Indices of a section's lines.
    fn range(&self, kind: SectionKind) -> Range<usize> {
        let Section { first_line, records } = self.header.section(kind);
        let first = first_line as usize;
        first..first + records.div_ceil(kind.records_per_line()) as usize
    }

    /// Bounding box of the scene, enlarged by the rounding of the root's 8-bit grid; `None` without triangles.
    pub(super) fn bounds(&self) -> Option<NodeBox> {
        let Line(root) = self.section(SectionKind::Nodes).first()?;
        let children = 0..WideNode(root).children() as usize;
        children.filter_map(|child| BvhNode(root).bounds(child)).reduce(NodeBox::union)
    }

    /// Diagonal of the scene's bounding box, metres; 1 without triangles.
    pub fn diagonal(&self) -> f32 {
        self.bounds().map_or(1.0, |NodeBox { lower, upper }| Vec3::from(upper).distance(Vec3::from(lower)))
    }
}
