//! The card on ST's board STM32H747I-DISCO. It runs on the larger of the chip's two processors (Cortex-M7).
#![no_std]
#![no_main]

#[path = "../common/mod.rs"]
mod common;
#[expect(unsafe_code, reason = "registers, and the region of external memory")]
mod hardware;
mod sdram;
