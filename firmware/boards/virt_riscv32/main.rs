//! The card on QEMU's machine `virt` with a 32-bit RISC-V processor.
#![no_std]
#![no_main]

#[path = "../common/mod.rs"]
mod common;
#[expect(unsafe_code, reason = "registers, and instructions that no function stands for")]
mod hardware;
