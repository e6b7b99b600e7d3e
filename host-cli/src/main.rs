//! The `photoncard` command.
fn main() {}
