//! What went over a link.

use photoncard_shared::transport::LineStatistics;

/// Bytes that went over a link, and what was repaired on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkBytes {
    /// Image lines and pixels.
    pub payload: u64,
    /// All bytes in both directions.
    pub wire: u64,
    /// What the host's end has seen of the line.
    pub line: LineStatistics,
    /// Times that the card was greeted again.
    pub resets: u64,
}

impl LinkBytes {
    /// Adds those of another link.
    pub fn add(&mut self, other: &Self) {
        self.payload += other.payload;
        self.wire += other.wire;
        self.line.damaged += other.line.damaged;
        self.line.repeated += other.line.repeated;
        self.line.duplicates += other.line.duplicates;
        self.line.probes += other.line.probes;
        self.resets += other.resets;
    }
}
