//! WebSocket of a page, with a reading and a writing thread. Both threads write whole WebSocket frames, under
//! a lock: the reading thread answers pings.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

use super::hub::Hub;
use super::pages::Outgoing;
use super::state::PageNumber;

/// Maximum size of a page's message, bytes.
const MAX_MESSAGE: usize = 64 << 10;
/// Time without a message to a page after which the page is pinged.
pub(super) const PING: Duration = Duration::from_secs(10);
/// Time without a byte from a page after which it counts as gone: pages answer pings.
const SILENCE: Duration = Duration::from_secs(40);
/// Time without progress of a write after which the page counts as gone.
const STALLED: Duration = Duration::from_secs(20);

/// Serves a page until its connection ends.
pub(super) fn attend(stream: TcpStream, hub: &Arc<Hub>) -> std::io::Result<()> {
    let pipe = Pipe::of(stream)?;
    let writing = pipe.clone();
    let page = hub.change(|view, _| view.connect());
    let is_open = AtomicBool::new(true);
    std::thread::scope(|scope| {
        let writer = || {
            // Any error ends the writer; the shutdown ends the reader.
            let _ = write(writing, page, hub, &is_open);
            pipe.end();
        };
        let spawned = std::thread::Builder::new().name("page writer".into()).spawn_scoped(scope, writer);
        if spawned.is_ok() {
            let _ = read(pipe.clone(), page, hub);
        }
        is_open.store(false, Ordering::Relaxed);
        pipe.end();
        hub.change(|view, _| view.disconnect(page));
    });
    Ok(())
}

fn read(pipe: Pipe, page: PageNumber, hub: &Hub) -> Result<(), Error> {
    let mut socket = WebSocket::from_raw_socket(pipe, Role::Server, Some(config(MAX_MESSAGE)));
    while !hub.is_over() {
        let stays = match socket.read()? {
            Message::Text(text) => hub.receive(page, &text),
            Message::Binary(bytes) => hub.receive_bytes(page, &bytes),
            _ => true,
        };
        if !stays {
            socket.close(None)?;
            socket.flush()?;
            break;
        }
    }
    Ok(())
}

fn write(pipe: Pipe, page: PageNumber, hub: &Hub, is_open: &AtomicBool) -> Result<(), Error> {
    let mut socket = WebSocket::from_raw_socket(pipe, Role::Server, None);
    while is_open.load(Ordering::Relaxed) && !hub.is_over() {
        socket.send(match hub.next_message(page, PING) {
            None => Message::Ping(tungstenite::Bytes::new()),
            Some(Ok(text)) => Message::text(text),
            Some(Err(Outgoing::Tile(patch, shown))) => Message::binary(patch.message(shown)),
            Some(Err(Outgoing::File(message))) => Message::binary(message),
            Some(Err(_)) => continue,
        })?;
    }
    Ok(())
}

/// Settings of a WebSocket that accepts messages of up to `largest` bytes.
pub(super) fn config(largest: usize) -> WebSocketConfig {
    WebSocketConfig::default()
        .max_message_size(Some(largest))
        .max_frame_size(Some(largest))
        .read_buffer_size(largest.min(MAX_MESSAGE))
}

/// Stream that two threads share. A lock keeps the bytes of each write together.
#[derive(Clone)]
pub(super) struct Pipe {
    stream: Arc<TcpStream>,
    lock: Arc<Mutex<()>>,
}

impl Pipe {
    /// Shares a stream. Reads and writes of a page that is gone end with an error.
    pub(super) fn of(stream: TcpStream) -> std::io::Result<Self> {
        stream.set_read_timeout(Some(SILENCE))?;
        stream.set_write_timeout(Some(STALLED))?;
        Ok(Self { stream: Arc::new(stream), lock: Arc::default() })
    }

    /// Ends the stream for both threads.
    pub(super) fn end(&self) {
        // The other end may have ended it already.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

impl Read for Pipe {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        (&*self.stream).read(buffer)
    }
}

impl Write for Pipe {
    /// Writes all bytes: tungstenite passes whole frames.
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let _whole = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        (&*self.stream).write_all(bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        (&*self.stream).flush()
    }
}
