//! Serves the page: its files and web sockets, with a thread for each connection. The number of connections
//! is bounded.
//!
//! A connection is a stranger until its request's head is read. There is a maximum number of strangers:
//! beyond it, each new stranger makes the server close the connection of the oldest. Silent strangers
//! therefore cannot keep pages out, and connections of pages do not count as strangers.

use std::collections::VecDeque;
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::gate::{Gate, Resource};
use super::http::{Head, Refusal, accept_socket, send_file, send_module};
use super::hub::Hub;
use super::lending::Lending;
use super::socket;

/// Maximum number of open connections whose requests the gate has accepted.
const MAX_CONNECTIONS: usize = 16;
/// Maximum number of lent cards.
const MAX_LENT: usize = 64;
/// Maximum number of strangers: connections whose request's head is not read yet.
const MAX_STRANGERS: usize = 16;
/// Pause after a connection could not be accepted, such as for too many open files.
const PAUSE: Duration = Duration::from_millis(100);

/// Server of a view.
pub(super) struct Server {
    gate: Gate,
    hub: Arc<Hub>,
    /// Module and chip of lent cards; `None` if browsers may lend none.
    lending: Option<Lending>,
    connections: Arc<AtomicUsize>,
    lent: Arc<AtomicUsize>,
}

impl Server {
    pub(super) fn new(gate: Gate, hub: Arc<Hub>, lending: Option<Lending>) -> Self {
        Self { gate, hub, lending, connections: Arc::default(), lent: Arc::default() }
    }

    /// Serves connections until the process ends.
    pub(super) fn serve(self: &Arc<Self>, listener: &TcpListener) {
        let strangers = Strangers::default();
        loop {
            let accepted = listener.accept().and_then(|(stream, _)| Ok((strangers.admit(&stream)?, stream)));
            let Ok((stranger, stream)) = accepted else {
                std::thread::sleep(PAUSE);
                continue;
            };
            let server = self.clone();
            let work = move || {
                // An error closes this connection alone.
                let _ = server.answer(stream, stranger);
            };
            let _ = std::thread::Builder::new().name("page".into()).spawn(work);
        }
    }

    fn answer(&self, mut stream: TcpStream, stranger: Stranger) -> std::io::Result<()> {
        stream.set_nodelay(true)?;
        let checked = Head::read(&mut stream).and_then(|head| Ok((self.gate.check(&head)?, head)));
        drop(stranger);
        let (resource, head) = match checked {
            Ok(checked) => checked,
            Err(refusal) => return refusal.send(&mut stream),
        };
        let places = match resource {
            Resource::Card(_) => Place::take(&self.lent, MAX_LENT),
            _ => Place::take(&self.connections, MAX_CONNECTIONS),
        };
        let Some(_place) = places else {
            return Refusal::new(503, "Service Unavailable", "there are too many connections")
                .send(&mut stream);
        };
        match (resource, &self.lending) {
            (Resource::File(file), lending) => {
                let host = head.one("host").unwrap_or_default();
                send_file(&mut stream, file, host, lending.is_some())
            }
            (Resource::Socket(key), _) => {
                accept_socket(&mut stream, &key)?;
                socket::attend(stream, &self.hub)
            }
            (Resource::Card(key), Some(lending)) => {
                accept_socket(&mut stream, &key)?;
                lending.attend(stream, &self.hub)
            }
            (Resource::Module, Some(lending)) => send_module(&mut stream, &lending.module),
            // The gate refuses them where there is no lending.
            (Resource::Card(_) | Resource::Module, None) => Ok(()),
        }
    }
}

/// Connections whose request's head is not read yet, the oldest first.
#[derive(Clone, Default)]
struct Strangers(Arc<Mutex<Waiting>>);

#[derive(Default)]
struct Waiting {
    next: u64,
    streams: VecDeque<(u64, TcpStream)>,
}

impl Strangers {
    /// Adds a connection. If there are more than [`MAX_STRANGERS`], closes the oldest.
    fn admit(&self, stream: &TcpStream) -> std::io::Result<Stranger> {
        let stream = stream.try_clone()?;
        let mut waiting = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let number = waiting.next;
        waiting.next += 1;
        waiting.streams.push_back((number, stream));
        if waiting.streams.len() > MAX_STRANGERS
            && let Some((_, oldest)) = waiting.streams.pop_front()
        {
            // The thread of the connection then reads its end, and ends.
            let _ = oldest.shutdown(Shutdown::Both);
        }
        Ok(Stranger { number, of: self.clone() })
    }
}

/// Guard of a connection's entry among the strangers. The entry is removed when the guard is dropped.
struct Stranger {
    number: u64,
    of: Strangers,
}

impl Drop for Stranger {
    fn drop(&mut self) {
        let mut waiting = self.of.0.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.streams.retain(|(number, _)| *number != self.number);
    }
}

/// Guard that counts one accepted connection. The count decreases when the guard is dropped.
struct Place(Arc<AtomicUsize>);

impl Place {
    /// Takes one of `most` places; `None` if all are taken.
    fn take(connections: &Arc<AtomicUsize>, most: usize) -> Option<Self> {
        let place = Self(connections.clone());
        (connections.fetch_add(1, Ordering::Relaxed) < most).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
