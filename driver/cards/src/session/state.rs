//! States of a session.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The hello is sent.
    Greeting,
    /// The card has answered the greeting, and has no job.
    Ready,
    /// Checksums of the card's chunks are requested.
    Comparing,
    /// Lines of the image are being sent.
    Loading,
    /// All lines are sent.
    Accepting,
    /// Parameters of the frame are sent.
    Framing,
    /// The card has image and frame, and accepts tiles.
    Rendering,
    /// A part of the self-test is requested.
    Testing,
}
