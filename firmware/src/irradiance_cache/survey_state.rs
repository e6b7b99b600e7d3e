//! The state of the survey of a block.

/// Progress of the survey.
pub(super) struct Survey {
    pub(super) level: u32,
    pub(super) task: Task,
    /// Index of the next piece of the task: a cell of the level, of all coarsest cells; or a record.
    pub(super) index: usize,
    /// The cell of the hemisphere.
    pub(super) direction: u8,
    /// Records before this one are surveyed.
    pub(super) first: usize,
}

/// The tasks of a level, in this order.
#[derive(Clone, Copy)]
pub(super) enum Task {
    /// Records are placed at the cells' corners.
    Placing,
    /// Rays are cast around the new records, one in each cell of the hemisphere.
    Rays,
    /// Cells are divided.
    Division,
}

impl Survey {
    /// Before the first step.
    pub(super) const BEGIN: Self = Self { level: 0, task: Task::Placing, index: 0, direction: 0, first: 0 };
}
