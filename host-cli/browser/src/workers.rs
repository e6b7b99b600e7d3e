//! Links to the cards in other workers: queues of bytes, which the page moves.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use photoncard_driver::emulator::Emulated;
use photoncard_driver::render::ChipWorkers;
use photoncard_shared::link::{Port, PortError};

#[link(wasm_import_module = "photoncard")]
unsafe extern "C" {
    /// Starts card `index` with the chip that the JSON states.
    safe fn start_card(index: usize, chip: *const u8, length: usize);
    /// Sends bytes to card `index`.
    safe fn send_to_card(index: usize, bytes: *const u8, length: usize);
    /// Ends card `index`.
    safe fn end_card(index: usize);
}

/// Bytes that have arrived from a card, and its state.
#[derive(Default)]
struct Inbox {
    bytes: VecDeque<u8>,
    is_lost: bool,
}

thread_local! {
    static INBOXES: RefCell<Vec<Inbox>> = const { RefCell::new(Vec::new()) };
    /// True if bytes were moved since the last call of [`have_moved`].
    static HAVE_MOVED: Cell<bool> = const { Cell::new(false) };
}

/// Changes the inbox of a card.
fn change<T>(index: usize, act: impl FnOnce(&mut Inbox) -> T) -> T {
    INBOXES.with_borrow_mut(|inboxes| {
        if inboxes.len() <= index {
            inboxes.resize_with(index + 1, Inbox::default);
        }
        act(&mut inboxes[index])
    })
}

/// Returns whether a link has moved bytes since the last call.
pub(crate) fn have_moved() -> bool {
    HAVE_MOVED.take()
}

/// Takes bytes from card `index`.
#[unsafe(no_mangle)]
extern "C" fn receive_from_card(index: usize) {
    let bytes = crate::received();
    change(index, |inbox| inbox.bytes.extend(bytes));
}

/// Records that card `index` has ended.
#[unsafe(no_mangle)]
extern "C" fn lose_card(index: usize) {
    change(index, |inbox| inbox.is_lost = true);
}

/// Workers of the page.
pub(crate) struct PageWorkers;

impl ChipWorkers for PageWorkers {
    fn start(&self, index: usize, chip: Emulated) -> io::Result<Box<dyn Port + Send>> {
        let chip = serde_json::to_vec(&chip)?;
        change(index, |inbox| *inbox = Inbox::default());
        start_card(index, chip.as_ptr(), chip.len());
        Ok(Box::new(WorkerPort { index }))
    }
}

/// Host's end of the link to a worker.
struct WorkerPort {
    index: usize,
}

impl Port for WorkerPort {
    fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, PortError> {
        let read = change(self.index, |inbox| {
            let count = buffer.len().min(inbox.bytes.len());
            for (place, byte) in buffer.iter_mut().zip(inbox.bytes.drain(..count)) {
                *place = byte;
            }
            if count == 0 && inbox.is_lost { Err(PortError::Closed) } else { Ok(count) }
        })?;
        if read > 0 {
            HAVE_MOVED.set(true);
        }
        Ok(read)
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<usize, PortError> {
        if change(self.index, |inbox| inbox.is_lost) {
            return Err(PortError::Closed);
        }
        send_to_card(self.index, bytes.as_ptr(), bytes.len());
        HAVE_MOVED.set(true);
        Ok(bytes.len())
    }
}

impl Drop for WorkerPort {
    fn drop(&mut self) {
        end_card(self.index);
    }
}
