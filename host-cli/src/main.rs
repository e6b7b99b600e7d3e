//! The program `photoncard`. All of its code is in the library crate `photoncard`, for a shorter build: cargo
//! compiles a library while the crates that the library calls are still being optimised, but compiles a
//! program only after them.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    photoncard::main()
}
