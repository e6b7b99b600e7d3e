//! Passes the memory map of a board to the linker when that board's image is built. Without a board's feature
//! it does nothing.

use std::env;
use std::path::{Path, PathBuf};

/// A board: the feature that selects it, its image, the directory of its memory map, and its processor.
struct Board {
    feature: &'static str,
    image: &'static str,
    directory: &'static str,
    architecture: &'static str,
}

const BOARDS: [Board; 4] = [
    Board {
        feature: "CARGO_FEATURE_BOARD_MPS2_AN386",
        image: "mps2-an386",
        directory: "mps2_an386",
        architecture: "arm",
    },
    // Board `mps2-an386` with Ethernet as its link.
    Board {
        feature: "CARGO_FEATURE_BOARD_MPS2_AN386_TCP",
        image: "mps2-an386-tcp",
        directory: "mps2_an386",
        architecture: "arm",
    },
    Board {
        feature: "CARGO_FEATURE_BOARD_STM32H747I_DISCO",
        image: "stm32h747i-disco",
        directory: "stm32h747i_disco",
        architecture: "arm",
    },
    Board {
        feature: "CARGO_FEATURE_BOARD_VIRT_RISCV32",
        image: "virt-riscv32",
        directory: "virt_riscv32",
        architecture: "riscv32",
    },
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let mut chosen = BOARDS.iter().filter(|board| env::var_os(board.feature).is_some());
    let Some(board) = chosen.next() else { return };
    if let Some(other) = chosen.next() {
        println!("cargo::error=an image is of one board: choose {} or {}", board.image, other.image);
        return;
    }
    if env::var("CARGO_CFG_TARGET_ARCH").as_deref() != Ok(board.architecture)
        || env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none")
    {
        println!("cargo::error={} is built for its own target: see docs/bring-up.md", board.image);
        return;
    }
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo tells it"));
    let directory = root.join(Path::new("boards")).join(board.directory);
    println!("cargo::rerun-if-changed={}", directory.join("memory.x").display());
    // The start-up crate's `link.x` includes `memory.x`.
    println!("cargo::rustc-link-search={}", directory.display());
    println!("cargo::rustc-link-arg-bin={}=-Tlink.x", board.image);
}
