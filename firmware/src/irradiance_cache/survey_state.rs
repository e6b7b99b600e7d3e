//! State of the survey of a block.

/// Progress of a block's survey, level by level of the lattice.
pub(super) struct Survey {
    pub(super) level: u32,
    pub(super) task: Task,
    /// Index of the next item of the task: a cell of the level, counted over all coarsest cells, or a record.
    pub(super) index: usize,
    /// Cell of the hemisphere in which rays are cast.
    pub(super) direction: u8,
    /// Number of lattice points that earlier levels have surveyed; they come first in the cache.
    pub(super) first: usize,
}

/// Tasks of a level, in this order.
#[derive(Clone, Copy)]
pub(super) enum Task {
    /// Records are placed at the corners of the cells.
    Placing,
    /// Rays are cast from the new records, one in each cell of the hemisphere.
    Rays,
    /// Cells that their corner records do not cover are divided.
    Division,
}

impl Survey {
    /// State before the first step.
    pub(super) const BEGIN: Self = Self { level: 0, task: Task::Placing, index: 0, direction: 0, first: 0 };
}
