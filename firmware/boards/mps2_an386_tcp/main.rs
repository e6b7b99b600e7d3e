//! The card on Arm's MPS2 board with the FPGA image AN386 (Cortex-M4F), reached by TCP over the board's
//! Ethernet controller, as QEMU's machine `mps2-an386` emulates them.
#![no_std]
#![no_main]

#[path = "../common/mod.rs"]
mod common;
#[expect(unsafe_code, reason = "the handler of interrupts")]
mod hardware;
#[expect(unsafe_code, reason = "registers")]
mod lan9118;
#[expect(unsafe_code, reason = "registers, and instructions that no function stands for")]
#[path = "../mps2_an386/processor.rs"]
mod processor;
#[path = "../tcp/mod.rs"]
mod tcp;
