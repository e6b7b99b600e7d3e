//! The host of a view.

use std::cell::RefCell;
use std::sync::Arc;

use photoncard::page::{Message, PageView};

use crate::workers::{PageWorkers, have_moved};
use crate::{received, received_text};

#[link(wasm_import_module = "photoncard")]
unsafe extern "C" {
    /// Sends a text to the page.
    safe fn tell_text(text: *const u8, length: usize);
    /// Sends bytes to the page.
    safe fn tell_bytes(bytes: *const u8, length: usize);
}

/// Maximum number of turns in one call of [`go_on`].
const TURNS: usize = 64;

thread_local! {
    static VIEW: RefCell<Option<PageView>> = const { RefCell::new(None) };
}

/// Opens the instance's one view. The buffer has the arguments of `photoncard view` as a JSON array of
/// strings. Returns 0, or 1 if the view cannot begin: then the reason is told as a text.
#[unsafe(no_mangle)]
extern "C" fn open_view() -> u32 {
    let arguments: Vec<String> = serde_json::from_str(&received_text()).unwrap_or_default();
    match PageView::open(arguments, Arc::new(PageWorkers)) {
        Ok(view) => {
            VIEW.set(Some(view));
            0
        }
        Err(reason) => {
            tell_text(reason.as_ptr(), reason.len());
            1
        }
    }
}

/// Takes a JSON message of the page.
#[unsafe(no_mangle)]
extern "C" fn receive_text() {
    let text = received_text();
    with_view(|view| view.receive(&text));
}

/// Takes bytes of a file that the page has announced.
#[unsafe(no_mangle)]
extern "C" fn receive_bytes() {
    let bytes = received();
    with_view(|view| view.receive_bytes(&bytes));
}

/// Renders until the view waits, and tells the page what is new. Returns 1 if it is to be called again at
/// once, 0 if it waits for a message or some milliseconds.
#[unsafe(no_mangle)]
extern "C" fn go_on() -> u32 {
    with_view(|view| {
        let mut has_moved = true;
        for _ in 0..TURNS {
            view.go_on();
            has_moved = have_moved();
            if !has_moved {
                break;
            }
        }
        while let Some(message) = view.next_message() {
            match message {
                Message::Text(text) => tell_text(text.as_ptr(), text.len()),
                Message::Binary(bytes) => tell_bytes(bytes.as_ptr(), bytes.len()),
            }
        }
        u32::from(has_moved)
    })
    .unwrap_or(0)
}

fn with_view<T>(act: impl FnOnce(&mut PageView) -> T) -> Option<T> {
    VIEW.with_borrow_mut(|view| view.as_mut().map(act))
}
