//! Cards that browsers lend: each is a WebSocket, whose bytes are those of the links to a worker of the
//! browser's page.

use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use photoncard_driver::emulator::Emulated;
use photoncard_driver::link::{LentCard, LoopbackPort};
use photoncard_driver::render::card_ping;
use photoncard_shared::link::Port;
use tungstenite::protocol::Role;
use tungstenite::{Error, Message, WebSocket};

use super::cards::of_lent;
use super::hub::Hub;
use super::socket::{PING, Pipe, config};

/// Maximum size of a message of a card, bytes.
const MAX_MESSAGE: usize = 4 << 20;
/// Interval of checks whether the page is gone.
const LOOK: Duration = Duration::from_millis(100);
/// Maximum pause before a lost card is greeted.
const MAX_PAUSE: Duration = Duration::from_secs(30);
/// Bytes of a message to a card.
const BLOCK: usize = 16 << 10;

/// WebAssembly module and chip of the cards that browsers lend.
pub(super) struct Lending {
    /// WebAssembly module with the card.
    pub(super) module: Vec<u8>,
    /// Chip of the cards, as JSON.
    chip: String,
    lent: AtomicUsize,
}

impl Lending {
    pub(super) fn new(module: Vec<u8>, chip: &Emulated) -> serde_json::Result<Self> {
        Ok(Self { module, chip: serde_json::to_string(chip)?, lent: AtomicUsize::new(0) })
    }

    /// Adds the card at the other end of a WebSocket to those of a view, until the connection ends.
    pub(super) fn attend(&self, stream: TcpStream, hub: &Hub) -> std::io::Result<()> {
        let number = self.lent.fetch_add(1, Ordering::Relaxed) + 1;
        let (card, links) = LentCard::lend(&format!("browser {number} at {}", stream.peer_addr()?.ip()));
        let owner = Owner { pipe: Pipe::of(stream)?, link: Mutex::new(None), is_open: AtomicBool::new(true) };
        let (owner, chip) = (&owner, self.chip.as_str());
        let writer = move || {
            let _ = owner.write(&links, chip);
        };
        std::thread::scope(|scope| {
            // The thread that ends first ends the others by the end of the pipe.
            let spawn = |work: Box<dyn FnOnce() + Send>| {
                let work = move || {
                    work();
                    owner.end();
                };
                std::thread::Builder::new().name("lent card".into()).spawn_scoped(scope, work)
            };
            if spawn(Box::new(writer)).is_ok() && spawn(Box::new(|| owner.greet(&card, hub))).is_ok() {
                let _ = owner.read(hub);
            }
            owner.end();
            owner.change_link(None);
        });
        hub.change(|view, _| view.return_card(&card));
        Ok(())
    }
}

/// Owner of a lent card: carries the bytes of one link after another.
struct Owner {
    pipe: Pipe,
    /// Present link, for the thread that reads from the page.
    link: Mutex<Option<LoopbackPort>>,
    is_open: AtomicBool,
}

impl Owner {
    fn change_link(&self, link: Option<LoopbackPort>) {
        *self.link.lock().unwrap_or_else(PoisonError::into_inner) = link;
    }

    fn is_open(&self) -> bool {
        self.is_open.load(Ordering::Relaxed)
    }

    /// Ends all work for the card.
    fn end(&self) {
        self.is_open.store(false, Ordering::Relaxed);
        self.pipe.end();
    }

    /// Adds the card to the view whenever it answers: at first, and after a loss. A card that is lost again
    /// without a tile waits longer each time.
    fn greet(&self, card: &LentCard, hub: &Hub) {
        let (mut pause, mut seen) = (LOOK, 0);
        while self.is_open() && !hub.is_over() {
            let tiles = hub.look(|view| view.cards.tiles_of(card));
            match tiles {
                Some(tiles) if tiles > seen => (pause, seen) = (LOOK, tiles),
                Some(_) => {}
                None => {
                    std::thread::sleep(pause);
                    pause = MAX_PAUSE.min(2 * pause);
                    if card_ping(&of_lent(card), 1).is_ok() && self.is_open() {
                        hub.borrow_card(card);
                    }
                }
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Sends the bytes of hosts to the page; the chip before those of each link.
    fn write(&self, links: &Receiver<LoopbackPort>, chip: &str) -> Result<(), Error> {
        let mut socket = WebSocket::from_raw_socket(self.pipe.clone(), Role::Server, None);
        let mut last = Instant::now();
        let mut link: Option<LoopbackPort> = None;
        let mut block = [0; BLOCK];
        while self.is_open() {
            let message = match &mut link {
                None => match links.recv_timeout(LOOK) {
                    Ok(opened) => {
                        self.change_link(Some(opened.twin()));
                        link = Some(opened);
                        Some(Message::text(chip))
                    }
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                },
                Some(open) => match open.read(&mut block, LOOK) {
                    Ok(0) => None,
                    Ok(count) => Some(Message::binary(block[..count].to_vec())),
                    Err(_) => {
                        link = None;
                        self.change_link(None);
                        None
                    }
                },
            };
            let message = match message {
                None if last.elapsed() < PING => continue,
                message => message.unwrap_or(Message::Ping(tungstenite::Bytes::new())),
            };
            socket.send(message)?;
            last = Instant::now();
        }
        Ok(())
    }

    /// Passes the bytes of the page to the present host.
    fn read(&self, hub: &Hub) -> Result<(), Error> {
        let mut socket =
            WebSocket::from_raw_socket(self.pipe.clone(), Role::Server, Some(config(MAX_MESSAGE)));
        while !hub.is_over() {
            if let Message::Binary(bytes) = socket.read()? {
                self.give(&bytes);
            }
        }
        Ok(())
    }

    /// Writes to the present link, until it is closed. Bytes for a link that is closed are lost.
    fn give(&self, mut bytes: &[u8]) {
        let mut link = self.link.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(link) = link.as_mut() else { return };
        while let Ok(count) = link.write(bytes, LOOK)
            && count < bytes.len()
        {
            bytes = &bytes[count..];
        }
    }
}
