//! A card.

use std::cell::RefCell;
use std::time::Duration;

use photoncard_driver::emulator::PolledCard;

#[link(wasm_import_module = "photoncard")]
unsafe extern "C" {
    /// Sends bytes to the host.
    safe fn send_to_host(bytes: *const u8, length: usize);
}

/// Time of one call of [`serve_card`]: messages of the host wait for it.
const SLICE: Duration = Duration::from_millis(8);

thread_local! {
    static CARD: RefCell<Option<PolledCard>> = const { RefCell::new(None) };
}

/// Makes this instance a card with the chip that the JSON in the buffer states. Returns 0, or 1 if it states
/// none.
#[unsafe(no_mangle)]
extern "C" fn open_card() -> u32 {
    let chip = serde_json::from_slice(&crate::received()).ok();
    CARD.set(chip.map(PolledCard::new));
    u32::from(CARD.with_borrow(Option::is_none))
}

/// Takes the bytes in the buffer from the host, works for some milliseconds, and sends bytes to the host.
/// Returns 1 if it is to be called again at once, 0 if the card waits for its host.
#[unsafe(no_mangle)]
extern "C" fn serve_card() -> u32 {
    let received = crate::received();
    let mut sent = Vec::new();
    let is_busy = CARD
        .with_borrow_mut(|card| card.as_mut().is_some_and(|card| card.go_on(&received, SLICE, &mut sent)));
    if !sent.is_empty() {
        send_to_host(sent.as_ptr(), sent.len());
    }
    u32::from(is_busy)
}
