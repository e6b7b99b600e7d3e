//! Studies: many renders of the same scenes with one thing changed, kept and reported.

pub mod report;
pub mod store;
