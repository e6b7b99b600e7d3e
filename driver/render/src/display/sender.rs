//! Sends packets to a display server on a separate thread.

use std::error::Error;
use std::io::{self, ErrorKind, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::{Duration, Instant};

use photoncard_picture::film::{Film, Window};
use photoncard_picture::layer::Channel;
use photoncard_picture::sink::{FinishedTile, TileSink};
use photoncard_picture::viewer::Viewer;
use photoncard_shared::message::Tile;

use super::packet::{create_image, update_image};
use super::queue::{PacketQueue, SharedQueue};
use super::{DisplayAddress, DisplayError};

/// Time limit of a connection attempt.
const CONNECT_WAIT: Duration = Duration::from_secs(2);
/// Time limit of a write, and interval at which the thread checks whether the display was closed.
const WRITE_WAIT: Duration = Duration::from_millis(100);
/// Maximum number of bytes in the queue: five million RGB pixels.
const MAX_WAITING: usize = 64 << 20;
/// Maximum time without progress of sending, after the picture is complete, before the display is given up.
const PATIENCE: Duration = Duration::from_secs(2);
/// Maximum time to send the remaining packets after the picture is complete.
const MAX_AT_END: Duration = Duration::from_secs(20);

/// Settings of a display: the server, and the name of the image there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisplaySettings {
    /// Address of the display server.
    pub address: DisplayAddress,
    /// Name of the image on the server. An image with the same name is replaced.
    pub image: String,
}

/// Connection to a display server that shows the crop window of a film.
///
/// Dropping the display ends its thread, even if packets are still to be sent.
pub struct Display {
    settings: DisplaySettings,
    window: Window,
    channels: Vec<Channel>,
    queue: Arc<SharedQueue>,
    most_waiting: usize,
}

impl Display {
    /// Begins to show the crop window `window` with the channels `channels`. Does not wait for the server:
    /// [`Viewer::failure`] reports errors.
    pub fn open(settings: &DisplaySettings, window: Window, channels: &[Channel]) -> Self {
        Self::with_room_for(MAX_WAITING, settings, window, channels)
    }

    /// Opens a display as [`Self::open`] does, with a queue of at most `most_waiting` bytes.
    pub(super) fn with_room_for(
        most_waiting: usize,
        settings: &DisplaySettings,
        window: Window,
        channels: &[Channel],
    ) -> Self {
        let queue = Arc::new(SharedQueue::default());
        let display = Self {
            settings: settings.clone(),
            window,
            channels: channels.to_vec(),
            queue: queue.clone(),
            most_waiting,
        };
        let size = [window.width(), window.height()];
        queue.lock().push(create_image(&settings.image, size, &display.names()));
        let address = settings.address.clone();
        let work = move || send_packets(&address, &queue);
        // The thread is not joined: a look-up of a name may take any time.
        let begun = std::thread::Builder::new().name("display".into()).spawn(work);
        if let Err(source) = begun {
            display.fail(DisplayError::Connect { address: settings.address.clone(), source });
        }
        display
    }

    fn names(&self) -> Vec<&'static str> {
        self.channels.iter().map(|channel| channel.name).collect()
    }

    pub(super) fn packet(&self, finished: &FinishedTile) -> Vec<u8> {
        let pixels = finished.pixels().map(|(_, pixel)| pixel);
        let values =
            pixels.flat_map(|pixel| self.channels.iter().map(move |channel| (channel.value)(&pixel)));
        let tile = finished.tile();
        let [x, y] = [tile.x.saturating_sub(self.window.x0), tile.y.saturating_sub(self.window.y0)];
        let shown = Tile { x, y, ..*tile };
        update_image(&self.settings.image, &shown, &self.names(), values)
    }

    /// Ends the display because the server is too slow. The error states the number of unsent packets plus
    /// `missed`, the number of further tiles that were not queued.
    fn give_up(&self, missed: usize) {
        let packets = self.queue.lock().left() + missed;
        self.fail(DisplayError::Slow { address: self.settings.address.clone(), packets });
    }

    fn fail(&self, error: DisplayError) {
        self.queue.change(|queue| queue.fail(error));
    }
}

impl TileSink for Display {
    /// Queues a tile to be shown. If the queue is full, `Viewer::finish` sends the tile later.
    fn put(&self, tile: &FinishedTile) {
        if !self.queue.lock().is_open() {
            return;
        }
        let packet = self.packet(tile);
        self.queue.change(|queue| {
            if queue.has_room(packet.len(), self.most_waiting) {
                queue.push(packet);
            } else {
                queue.missed.push(*tile.tile());
            }
        });
    }

    /// Does nothing. The pixels stay visible until the tile is stored again.
    fn revoke(&self, _: &Tile) {}
}

impl Viewer for Display {
    fn failure(&self) -> Option<Box<dyn Error>> {
        self.queue.lock().take_failure().map(Into::into)
    }

    /// Sends the tiles that were not queued before, and waits until all packets are sent. Gives up after 20
    /// seconds, or after 2 without progress.
    fn finish(&self, film: &Film) {
        let missed = std::mem::take(&mut self.queue.lock().missed);
        let mut watch = Watch::new();
        for finished in missed.iter().filter_map(|tile| film.finished(tile)) {
            let packet = self.packet(&finished);
            let has_room = |queue: &PacketQueue| queue.has_room(packet.len(), self.most_waiting);
            if !watch.wait_until(&self.queue, |queue| !queue.is_open() || has_room(queue)) {
                return self.give_up(missed.len());
            }
            self.queue.change(|queue| {
                if queue.is_open() {
                    queue.push(packet);
                }
            });
        }
        if !watch.wait_until(&self.queue, |queue| !queue.is_open() || queue.is_empty()) {
            self.give_up(0);
        }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        self.queue.change(|queue| queue.is_closed = true);
    }
}

/// Watchdog that detects a display that takes too long to finish.
struct Watch {
    begun: Instant,
    moved: Instant,
    sent: u64,
}

impl Watch {
    fn new() -> Self {
        let now = Instant::now();
        Self { begun: now, moved: now, sent: 0 }
    }

    /// Waits until `is_ready` returns true. Returns false after `MAX_AT_END` in all, or `PATIENCE` without
    /// progress.
    fn wait_until(&mut self, queue: &SharedQueue, is_ready: impl Fn(&PacketQueue) -> bool) -> bool {
        while !queue.wait_until(WRITE_WAIT, &is_ready) {
            let sent = queue.lock().sent;
            if sent != self.sent {
                self.sent = sent;
                self.moved = Instant::now();
            }
            if self.moved.elapsed() >= PATIENCE || self.begun.elapsed() >= MAX_AT_END {
                return false;
            }
        }
        true
    }
}

/// Connects, and sends packets until the display is closed or fails.
fn send_packets(address: &DisplayAddress, queue: &SharedQueue) {
    let result = match connect(address) {
        Ok(mut stream) => send_all(&mut *stream, queue)
            .map_err(|source| DisplayError::Gone { address: address.clone(), source }),
        Err(source) => Err(DisplayError::Connect { address: address.clone(), source }),
    };
    if let Err(error) = result {
        queue.change(|queue| queue.fail(error));
    }
}

fn connect(address: &DisplayAddress) -> io::Result<Box<dyn Write>> {
    let (host, port) = match address {
        DisplayAddress::Server { host, port } => (host.as_str(), *port),
        DisplayAddress::StandardOutput => return Ok(Box::new(io::stdout())),
    };
    let mut last = io::Error::other("the host's name has no address");
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_WAIT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(WRITE_WAIT))?;
                return Ok(Box::new(stream));
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn send_all(stream: &mut dyn Write, queue: &SharedQueue) -> io::Result<()> {
    while let Some(packet) = queue.next() {
        let mut rest = packet.as_slice();
        while !rest.is_empty() {
            let count = match stream.write(rest) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => count,
                Err(error) if is_passing(&error) => 0,
                Err(error) => return Err(error),
            };
            rest = &rest[count..];
            // Standard output keeps bytes back until a line ends.
            if rest.is_empty() {
                stream.flush()?;
            }
            if !queue.advance(count, rest.is_empty()) {
                return Ok(());
            }
        }
    }
    Ok(())
}

/// Returns whether a failed write can be tried again.
fn is_passing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
