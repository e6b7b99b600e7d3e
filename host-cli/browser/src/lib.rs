//! photoncard in a browser: one WebAssembly module, which is a view's host in one worker and a card in each
//! of others.
//!
//! The module is called by `page/host.js` and `page/chip.js`. Bytes come in the buffer that `buffer` gives;
//! they leave by the imported functions. Files and the clock are those of WASI (`page/wasi.js`).
#![cfg(target_family = "wasm")]
#![expect(unsafe_code, reason = "functions that a page calls, and that it offers")]

mod card;
mod host;
mod workers;

use std::cell::RefCell;

thread_local! {
    /// Bytes of the next call.
    static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

unsafe extern "C" {
    /// Functions that run before all others, by the linker.
    fn __wasm_call_ctors();
}

/// Begins the instance, before all other calls.
#[unsafe(no_mangle)]
extern "C" fn _initialize() {
    // SAFETY: a page calls this once. Without the call the linker would put one into every function.
    unsafe { __wasm_call_ctors() }
}

/// Returns the address of a buffer of `length` bytes, into which the caller writes the bytes of its next
/// call.
#[unsafe(no_mangle)]
extern "C" fn buffer(length: usize) -> *mut u8 {
    BUFFER.with_borrow_mut(|buffer| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_mut_ptr()
    })
}

/// Takes the bytes of the buffer.
fn received() -> Vec<u8> {
    BUFFER.take()
}

/// Takes the text of the buffer. The page encodes texts as UTF-8.
fn received_text() -> String {
    String::from_utf8_lossy(&received()).into_owned()
}
