//! The program `photoncard`. All its code is in the library of its name: cargo compiles a library while
//! the crates that it calls are still optimised, and a program after them.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    photoncard::main()
}
