//! Main loop of a card on devices with the traits of `embedded-io-async`.

use core::cell::RefCell;
use core::fmt;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use embedded_io_async::{Read, Write};
use heapless::Deque;

use crate::card::Card;
use crate::kind::ChipKind;
use crate::memory::CardMemory;

/// Capacity of the buffer of received bytes.
const RECEIVED: usize = 512;
/// Maximum number of bytes of one read.
const READ: usize = 64;

/// End of a session over asynchronous devices: errors of the reader and of the writer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ServeError<R, W> {
    /// The other end is gone: the regular end of a session.
    Closed,
    /// The reader failed.
    Read(R),
    /// The writer failed.
    Write(W),
}

impl<R: fmt::Display, W: fmt::Display> fmt::Display for ServeError<R, W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed => f.write_str("the other end of the link is gone"),
            Self::Read(error) => write!(f, "the link cannot be read: {error}"),
            Self::Write(error) => write!(f, "the link cannot be written: {error}"),
        }
    }
}

impl<R: fmt::Debug + fmt::Display, W: fmt::Debug + fmt::Display> core::error::Error for ServeError<R, W> {}

/// Bytes that the reader has received and the card has not.
type Received = RefCell<Deque<u8, RECEIVED>>;

/// Serves a card on asynchronous devices until one of them fails. Reads go on while the card computes and
/// writes: none is cancelled. Between two pieces of work the task yields to others of its executor. Bytes
/// that were received and not yet passed to the card are lost at the end, and if the future is dropped: the
/// protocol repeats them.
///
/// # Errors
/// The end of the session; [`ServeError::Closed`] is the regular one.
pub async fn serve_async<K: ChipKind, M: CardMemory, R: Read, W: Write>(
    card: &mut Card<K, M>,
    reader: &mut R,
    writer: &mut W,
) -> ServeError<R::Error, W::Error> {
    let received = Received::default();
    let mut receiving = pin!(receive(&received, reader));
    let mut working = pin!(work(&received, card, writer));
    // Bytes that have just been received are worked on in the same call.
    let end = poll_fn(|context| match receiving.as_mut().poll(context) {
        Poll::Ready(end) => Poll::Ready(end),
        Poll::Pending => working.as_mut().poll(context),
    })
    .await;
    // A device that fails at once, such as a disabled endpoint of USB, does not starve other tasks.
    yield_now().await;
    end
}

async fn receive<R: Read, E>(received: &Received, reader: &mut R) -> ServeError<R::Error, E> {
    let mut buffer = [0; READ];
    loop {
        // The card yields after it has taken bytes, so that this is asked again.
        until(|| RECEIVED - received.borrow().len() >= READ).await;
        let count = match reader.read(&mut buffer).await {
            Ok(0) => return ServeError::Closed,
            Ok(count) => count,
            Err(error) => return ServeError::Read(error),
        };
        received.borrow_mut().extend(buffer.iter().take(count).copied());
    }
}

async fn work<K: ChipKind, M: CardMemory, W: Write, E>(
    received: &Received,
    card: &mut Card<K, M>,
    writer: &mut W,
) -> ServeError<E, W::Error> {
    loop {
        let is_fed = feed(received, card);
        if !is_fed {
            card.acknowledge();
        }
        if !card.outgoing().is_empty() {
            match writer.write(card.outgoing()).await {
                Ok(0) => return ServeError::Closed,
                Ok(count) => card.sent(count),
                Err(error) => return ServeError::Write(error),
            }
        } else if card.is_busy() {
            card.work();
            yield_now().await;
        } else if is_fed {
            yield_now().await;
        } else {
            if let Err(error) = writer.flush().await {
                return ServeError::Write(error);
            }
            until(|| !received.borrow().is_empty()).await;
        }
    }
}

/// Feeds the received bytes to the card. Returns false if there are none.
fn feed<K: ChipKind, M: CardMemory>(received: &Received, card: &mut Card<K, M>) -> bool {
    let mut received = received.borrow_mut();
    let (front, back) = received.as_slices();
    let is_fed = !front.is_empty();
    card.feed(front);
    card.feed(back);
    received.clear();
    is_fed
}

/// Waits until `is_met` returns true. It is asked whenever the task is polled.
async fn until(is_met: impl Fn() -> bool) {
    poll_fn(|_| if is_met() { Poll::Ready(()) } else { Poll::Pending }).await;
}

/// Lets other tasks of the executor run.
async fn yield_now() {
    let mut has_yielded = false;
    poll_fn(|context| {
        if core::mem::replace(&mut has_yielded, true) {
            return Poll::Ready(());
        }
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
}
