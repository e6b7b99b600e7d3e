//! How far a session is.

/// How far a session is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Hello is sent.
    Greeting,
    /// The card is known and has nothing to do.
    Ready,
    /// It is asked which chunks it has.
    Comparing,
    /// Lines are still to be sent.
    Loading,
    /// All lines are sent.
    Accepting,
    /// The frame's parameters are sent.
    Framing,
    /// Image and frame are there: tiles may come.
    Rendering,
}
