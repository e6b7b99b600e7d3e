//! Link within the process: two bounded queues of bytes. The queues fill up more readily than those of
//! hardware, so that flow control is tested.
//!
//! A card writes a frame of some hundred bytes at a time, and a wake-up per frame would take longer than the
//! host's work on it. A [patient](LoopbackPort::patient) port therefore wakes its reader once for many
//! frames.

use std::collections::VecDeque;
use std::io::Read;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use photoncard_shared::link::{Port, PortError};

/// Time for which a patient port may leave its reader asleep after a write. The first call to the port after
/// this time wakes the reader.
const PATIENCE: Duration = Duration::from_micros(500);

#[derive(Default)]
struct Direction {
    queue: Mutex<ByteQueue>,
    changed: Condvar,
}

/// Bytes in transit.
#[derive(Default)]
struct ByteQueue {
    bytes: VecDeque<u8>,
    closed: bool,
}

impl Direction {
    fn lock(&self) -> MutexGuard<'_, ByteQueue> {
        // A poisoned lock is taken over: a panic leaves no byte incomplete.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until `ready` holds, the link is closed or `wait` is over.
    fn wait(&self, wait: Duration, ready: impl Fn(&ByteQueue) -> bool) -> MutexGuard<'_, ByteQueue> {
        let queue = self.lock();
        if wait.is_zero() || ready(&queue) || queue.closed {
            return queue;
        }
        let waiting = |queue: &mut ByteQueue| !ready(queue) && !queue.closed;
        self.changed.wait_timeout_while(queue, wait, waiting).unwrap_or_else(PoisonError::into_inner).0
    }

    fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }
}

/// One end of a loopback link. Dropping it closes the link for the other end.
pub struct LoopbackPort {
    incoming: Arc<Direction>,
    outgoing: Arc<Direction>,
    capacity: usize,
    /// Number of bytes in transit at which a write wakes the reader.
    wakes_at: usize,
    /// Time of the first write since the reader was last woken; `None` if there was none.
    written: Option<Instant>,
}

/// Creates a link and returns its two ends. Each direction holds `capacity` bytes, at least one.
pub fn loopback(capacity: usize) -> (LoopbackPort, LoopbackPort) {
    let capacity = capacity.max(1);
    let (a, b) = (Arc::<Direction>::default(), Arc::<Direction>::default());
    let port = |incoming: &Arc<Direction>, outgoing: &Arc<Direction>| LoopbackPort {
        incoming: incoming.clone(),
        outgoing: outgoing.clone(),
        capacity,
        wakes_at: 0,
        written: None,
    };
    (port(&a, &b), port(&b, &a))
}

impl LoopbackPort {
    /// Delays wake-ups of the reader until `wakes_at` bytes are in transit, a write has waited for 500 µs, or
    /// this port waits for bytes itself. Only calls to this port wake the reader, so the port's owner must
    /// keep calling it while it has work, and before it waits.
    #[must_use]
    pub fn patient(mut self, wakes_at: usize) -> Self {
        self.wakes_at = wakes_at.min(self.capacity);
        self
    }

    /// Second handle of this end, so that one thread reads while another writes. Dropping either closes the
    /// link.
    #[must_use]
    pub fn twin(&self) -> Self {
        let Self { incoming, outgoing, capacity, wakes_at, .. } = self;
        let (incoming, outgoing) = (incoming.clone(), outgoing.clone());
        Self { incoming, outgoing, capacity: *capacity, wakes_at: *wakes_at, written: None }
    }

    /// Wakes the reader of pending writes if `is_due`, or if they have waited for [`PATIENCE`].
    fn wake(&mut self, is_due: bool) {
        if self.written.is_some_and(|written| is_due || written.elapsed() >= PATIENCE) {
            self.written = None;
            self.outgoing.changed.notify_all();
        }
    }
}

impl Port for LoopbackPort {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        self.wake(!wait.is_zero());
        let mut queue = self.incoming.wait(wait, |queue| !queue.bytes.is_empty());
        // Reading from a queue in memory does not fail.
        let count = queue.bytes.read(buffer).unwrap_or(0);
        if count == 0 {
            return if queue.closed { Err(PortError::Closed) } else { Ok(0) };
        }
        self.incoming.changed.notify_all();
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let capacity = self.capacity;
        let mut queue = self.outgoing.wait(wait, |queue| queue.bytes.len() < capacity);
        if queue.closed {
            return Err(PortError::Closed);
        }
        let count = bytes.len().min(capacity - queue.bytes.len());
        queue.bytes.extend(&bytes[..count]);
        let is_due = queue.bytes.len() >= self.wakes_at;
        drop(queue);
        self.written.get_or_insert_with(Instant::now);
        self.wake(is_due);
        Ok(count)
    }
}

impl Drop for LoopbackPort {
    fn drop(&mut self) {
        self.incoming.close();
        self.outgoing.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOON: Duration = Duration::from_millis(1);

    #[test]
    fn bytes_arrive_in_order_and_a_full_queue_blocks() {
        let (mut host, mut card) = loopback(4);
        assert_eq!(host.write(&[1, 2, 3, 4, 5, 6], SOON), Ok(4));
        assert_eq!(host.write(&[5], SOON), Ok(0));
        let mut buffer = [0; 3];
        assert_eq!(card.read(&mut buffer, SOON), Ok(3));
        assert_eq!(buffer, [1, 2, 3]);
        assert_eq!(host.write(&[5, 6], SOON), Ok(2));
        assert_eq!(host.read(&mut buffer, SOON), Ok(0));
    }

    #[test]
    fn a_patient_writer_wakes_the_reader_before_it_waits() {
        let (mut host, card) = loopback(64);
        let mut card = card.patient(16);
        std::thread::scope(|scope| {
            let reader = scope.spawn(move || {
                let mut buffer = [0; 8];
                // A reader that nobody wakes waits until the limit of the test is over.
                let count = host.read(&mut buffer, Duration::from_secs(100_000)).unwrap();
                buffer[..count].to_vec()
            });
            card.write(&[1, 2], SOON).unwrap();
            card.write(&[3], SOON).unwrap();
            let waiting = card.read(&mut [0; 1], Duration::from_secs(1));
            let bytes = reader.join().unwrap();
            assert!([1, 2, 3].starts_with(&bytes) && !bytes.is_empty());
            assert!(matches!(waiting, Ok(0) | Err(PortError::Closed)));
        });
    }

    #[test]
    fn bytes_sent_before_the_end_still_arrive() {
        let (mut host, mut card) = loopback(4);
        card.write(&[7], SOON).unwrap();
        drop(card);
        let mut buffer = [0; 3];
        assert_eq!(host.read(&mut buffer, SOON), Ok(1));
        assert_eq!(host.read(&mut buffer, SOON), Err(PortError::Closed));
        assert_eq!(host.write(&[1], SOON), Err(PortError::Closed));
    }
}
