//! The server of a page: its files, and its sockets. Each connection has a thread of its own, and there are few.

use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use super::gate::{Gate, Resource};
use super::http::{Head, Refusal, accept_socket, send_file};
use super::hub::Hub;
use super::socket;

/// Maximum number of connections.
const MAX_CONNECTIONS: usize = 16;
/// Pause after an error of accepting a connection, as when the process has too many files open.
const PAUSE: Duration = Duration::from_millis(100);

/// Serves connections until the process ends.
pub(super) fn serve(listener: &TcpListener, gate: &Arc<Gate>, hub: &Arc<Hub>) {
    let connections = Arc::new(AtomicUsize::new(0));
    loop {
        let Ok((stream, _)) = listener.accept() else {
            std::thread::sleep(PAUSE);
            continue;
        };
        // The count falls when its thread ends, or if none can be started.
        let place = Place::take(&connections);
        let (gate, hub) = (gate.clone(), hub.clone());
        let work = move || {
            // A connection that fails is closed, and no concern of others.
            let _ = answer(stream, place.as_ref(), &gate, &hub);
        };
        let _ = std::thread::Builder::new().name("page".into()).spawn(work);
    }
}

/// One of the connections that there may be.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(connections: &Arc<AtomicUsize>) -> Option<Self> {
        let place = Self(connections.clone());
        (connections.fetch_add(1, Ordering::Relaxed) < MAX_CONNECTIONS).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

fn answer(mut stream: TcpStream, place: Option<&Place>, gate: &Gate, hub: &Arc<Hub>) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    if place.is_none() {
        return Refusal::new(503, "Service Unavailable", "there are too many connections").send(&mut stream);
    }
    let checked = Head::read(&mut stream).and_then(|head| Ok((gate.check(&head)?, head)));
    match checked {
        Err(refusal) => refusal.send(&mut stream),
        Ok((Resource::File(file), head)) => {
            send_file(&mut stream, file, head.one("host").unwrap_or_default())
        }
        Ok((Resource::Socket(key), _)) => {
            accept_socket(&mut stream, &key)?;
            socket::attend(stream, hub)
        }
    }
}
