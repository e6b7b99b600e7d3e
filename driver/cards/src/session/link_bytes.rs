//! Counts of bytes and repairs on a link.

use photoncard_shared::transport::LineStatistics;

/// Bytes that passed a link, and repairs on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkBytes {
    /// Bytes of image lines.
    pub image: u64,
    /// Bytes of image lines and pixels.
    pub payload: u64,
    /// All bytes in both directions.
    pub wire: u64,
    /// Frames that the host repeated, and frames that it received damaged or repeated.
    pub line: LineStatistics,
    /// Number of times that the card was greeted again.
    pub resets: u64,
}

impl LinkBytes {
    /// Adds the counts of another link.
    pub fn add(&mut self, other: &Self) {
        self.image += other.image;
        self.payload += other.payload;
        self.wire += other.wire;
        self.line.damaged += other.line.damaged;
        self.line.repeated += other.line.repeated;
        self.line.duplicates += other.line.duplicates;
        self.line.probes += other.line.probes;
        self.resets += other.resets;
    }

    /// Difference to earlier counts of the same link.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            image: self.image - earlier.image,
            payload: self.payload - earlier.payload,
            wire: self.wire - earlier.wire,
            line: LineStatistics {
                damaged: self.line.damaged - earlier.line.damaged,
                repeated: self.line.repeated - earlier.line.repeated,
                duplicates: self.line.duplicates - earlier.line.duplicates,
                probes: self.line.probes - earlier.line.probes,
            },
            resets: self.resets - earlier.resets,
        }
    }
}
