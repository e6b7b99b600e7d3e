//! Studies: renders of the same scenes with one thing changed, kept and reported, and what they say of chips that no run
//! here has.

pub mod cost_model;
pub mod load_balance;
pub mod report;
pub mod store;
