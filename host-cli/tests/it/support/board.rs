//! Serial port of a board: a pseudo terminal at a name of the room, behind which a thread moves bytes between
//! the host and an emulated card on a Unix socket.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use photoncard_driver::link::{HostPort, ListenAddress, Listener};
use photoncard_shared::link::Port;

use super::Room;

/// Address of every board.
pub(crate) const BOARD: &str = "serial:board";
/// Name of the socket of every board's card.
const CARD: &str = "card";
const SOON: Duration = Duration::from_millis(1);

/// Direction of bytes on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    ToCard,
    ToHost,
}

/// Change of bytes on their way.
pub(crate) type Change = Box<dyn FnMut(Way, Vec<u8>) -> Vec<u8> + Send>;

/// Board at [`BOARD`], as long as it is plugged in. Its card is an emulated one, which listens at
/// `unix:card` in the room.
pub(crate) struct Board {
    path: PathBuf,
    is_out: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Board {
    /// Plugs a board in whose line is good.
    pub(crate) fn plug(room: &Room) -> Self {
        Self::plug_on(room, Box::new(|_, bytes| bytes))
    }

    /// Plugs a board in whose line changes bytes.
    pub(crate) fn plug_on(room: &Room, change: Change) -> Self {
        let listener = Listener::new(&ListenAddress::Pty).unwrap();
        let path = room.path("board");
        let device = listener.card_address().strip_prefix("serial:").unwrap();
        std::os::unix::fs::symlink(device, &path).unwrap();
        let is_out = Arc::new(AtomicBool::new(false));
        let port = HostPort::new(listener, is_out.clone(), |_| {});
        let line = Line { port, card: None, socket: room.path(CARD), change };
        let (name, ends) = (std::thread::Builder::new().name("board".into()), is_out.clone());
        let thread = name.spawn(move || line.serve(&ends)).unwrap();
        Self { path, is_out, thread: Some(thread) }
    }

    /// Unplugs the board. The card at the socket keeps its memory.
    pub(crate) fn unplug(self) {}
}

impl Drop for Board {
    fn drop(&mut self) {
        self.is_out.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
        let _ = std::fs::remove_file(&self.path);
    }
}

struct Line {
    port: HostPort,
    /// Connection to the card; `None` before the host's first byte.
    card: Option<UnixStream>,
    socket: PathBuf,
    change: Change,
}

impl Line {
    fn serve(mut self, is_out: &AtomicBool) {
        let mut buffer = [0; 4096];
        while !is_out.load(Ordering::Relaxed) {
            // The port fails once the board is out.
            let count = self.port.read(&mut buffer, SOON).unwrap_or(0);
            if count > 0 {
                let bytes = (self.change)(Way::ToCard, buffer[..count].to_vec());
                self.card.get_or_insert_with(|| connected(&self.socket)).write_all(&bytes).unwrap();
            }
            let Some(card) = &mut self.card else { continue };
            let count = match card.read(&mut buffer) {
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => 0,
                Err(error) => panic!("{error}"),
            };
            // An empty change lets a line say more than its card does.
            let bytes = (self.change)(Way::ToHost, buffer[..count].to_vec());
            self.say(&bytes, is_out);
        }
    }

    fn say(&mut self, mut bytes: &[u8], is_out: &AtomicBool) {
        while !bytes.is_empty() && !is_out.load(Ordering::Relaxed) {
            bytes = &bytes[self.port.write(bytes, SOON).unwrap_or(bytes.len())..];
        }
    }
}

fn connected(socket: &Path) -> UnixStream {
    let stream = UnixStream::connect(socket).unwrap();
    stream.set_read_timeout(Some(SOON)).unwrap();
    stream
}
