//! Link within the process: two bounded queues of bytes. They fill up more readily than hardware, which tests flow control.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use photoncard_shared::link::{Port, PortError};

/// One direction of the link.
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
        // A thread that panicked holding the lock has left whole bytes.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until `ready`, the link is closed or the time is over.
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
}

/// Creates a link and returns its two ends. Each direction holds `capacity` bytes, at least one.
pub fn loopback(capacity: usize) -> (LoopbackPort, LoopbackPort) {
    let capacity = capacity.max(1);
    let (a, b) = (Arc::<Direction>::default(), Arc::<Direction>::default());
    let first = LoopbackPort { incoming: a.clone(), outgoing: b.clone(), capacity };
    (first, LoopbackPort { incoming: b, outgoing: a, capacity })
}

impl Port for LoopbackPort {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        let mut queue = self.incoming.wait(wait, |queue| !queue.bytes.is_empty());
        let count = buffer.len().min(queue.bytes.len());
        if count == 0 {
            return if queue.closed { Err(PortError::Closed) } else { Ok(0) };
        }
        for (target, byte) in buffer.iter_mut().zip(queue.bytes.drain(..count)) {
            *target = byte;
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
        self.outgoing.changed.notify_all();
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
    fn bytes_come_in_order_and_the_queue_pushes_back() {
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
    fn what_was_sent_before_the_end_still_comes() {
        let (mut host, mut card) = loopback(4);
        card.write(&[7], SOON).unwrap();
        drop(card);
        let mut buffer = [0; 3];
        assert_eq!(host.read(&mut buffer, SOON), Ok(1));
        assert_eq!(host.read(&mut buffer, SOON), Err(PortError::Closed));
        assert_eq!(host.write(&[1], SOON), Err(PortError::Closed));
    }
}
