//! photoncard
