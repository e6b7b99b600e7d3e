//! The card on Arm's MPS2 board with the FPGA image AN386 (Cortex-M4F), as QEMU's machine `mps2-an386`
//! emulates it.
#![no_std]
#![no_main]

#[path = "../common/mod.rs"]
mod common;
#[expect(unsafe_code, reason = "registers, and the handler of interrupts")]
mod hardware;
#[expect(unsafe_code, reason = "registers, and instructions that no function stands for")]
mod processor;
