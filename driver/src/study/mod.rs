//! Studies: what the architecture would do at sizes and speeds that no run here has.

pub mod cost_model;
pub mod load_balance;
