//! What sends packets to a display server, on a thread of its own.

use std::io::{self, ErrorKind, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::{Duration, Instant};

use photoncard_shared::message::Tile;

use super::packet::{create_image, update_image};
use super::state::{SharedState, State};
use super::{DisplayAddress, DisplayError};
use crate::film::{Film, FilmPixel, Window};
use crate::layer::Channel;
use crate::sink::{FinishedTile, TileSink};

/// How long a connection may take to be made.
const CONNECT_WAIT: Duration = Duration::from_secs(2);
/// How long a write may wait before its thread looks around.
const WRITE_WAIT: Duration = Duration::from_millis(100);
/// Bytes of packets that may wait: those of five million pixels.
const MOST_WAITING: usize = 64 << 20;
/// How long a display may take no byte when the picture is complete.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long it may take in all, from then on.
const MOST_AT_END: Duration = Duration::from_secs(20);

/// Where a picture is to be shown, and as what.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisplaySettings {
    /// The display server.
    pub address: DisplayAddress,
    /// The image's name there; one of the same name is replaced.
    pub image: String,
}

/// A picture on a display server. It is the crop window of a film.
///
/// Dropping it ends its thread, whatever is still to be sent.
pub struct Display {
    settings: DisplaySettings,
    window: Window,
    channels: Vec<Channel>,
    state: Arc<SharedState>,
    most_waiting: usize,
}

impl Display {
    /// Begins to show the crop window `window` with some channels. What goes wrong is told by [`Self::failure`].
    pub fn open(settings: &DisplaySettings, window: Window, channels: &[Channel]) -> Self {
        Self::with_room_for(MOST_WAITING, settings, window, channels)
    }

    /// The same, with at most so many bytes waiting.
    pub(super) fn with_room_for(
        most_waiting: usize,
        settings: &DisplaySettings,
        window: Window,
        channels: &[Channel],
    ) -> Self {
        let state = Arc::new(SharedState::default());
        let display = Self {
            settings: settings.clone(),
            window,
            channels: channels.to_vec(),
            state: state.clone(),
            most_waiting,
        };
        let size = [window.width(), window.height()];
        state.lock().push(create_image(&settings.image, size, &display.names()));
        let address = settings.address.clone();
        let work = move || send_packets(&address, &state);
        // Nobody waits for it: to look up a name may take any time.
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
        let pixels = finished.pixels().map(|(_, record)| FilmPixel::from(record));
        let values =
            pixels.flat_map(|pixel| self.channels.iter().map(move |channel| (channel.value)(&pixel)));
        let tile = finished.tile();
        let [x, y] = [tile.x.saturating_sub(self.window.x0), tile.y.saturating_sub(self.window.y0)];
        let shown = Tile { x, y, ..*tile };
        update_image(&self.settings.image, &shown, &self.names(), values)
    }

    /// What went wrong, if that was not told before. Nothing is shown from then on.
    pub fn failure(&self) -> Option<DisplayError> {
        self.state.lock().take_failure()
    }

    /// Shows what found no room before, and waits until all is sent: for some seconds at the most, and for fewer if the display
    /// takes nothing.
    pub fn finish(&self, film: &Film) {
        let missed = std::mem::take(&mut self.state.lock().missed);
        let mut watch = Watch::new();
        for finished in missed.iter().filter_map(|tile| film.finished(tile)) {
            let packet = self.packet(&finished);
            let has_room = |state: &State| state.has_room(packet.len(), self.most_waiting);
            if !watch.wait_until(&self.state, |state| !state.is_open() || has_room(state)) {
                return self.give_up(missed.len());
            }
            self.state.change(|state| {
                if state.is_open() {
                    state.push(packet);
                }
            });
        }
        if !watch.wait_until(&self.state, |state| !state.is_open() || state.is_empty()) {
            self.give_up(0);
        }
    }

    /// The display takes nothing more: it lacks what waits, and `missed` tiles or fewer.
    fn give_up(&self, missed: usize) {
        let packets = self.state.lock().left() + missed;
        self.fail(DisplayError::Slow { address: self.settings.address.clone(), packets });
    }

    fn fail(&self, error: DisplayError) {
        self.state.change(|state| state.fail(error));
    }
}

impl TileSink for Display {
    /// Shows a tile, now or, if too much waits to be sent, when the picture is [finished](Display::finish).
    fn put(&self, tile: &FinishedTile) {
        if !self.state.lock().is_open() {
            return;
        }
        let packet = self.packet(tile);
        self.state.change(|state| {
            if state.has_room(packet.len(), self.most_waiting) {
                state.push(packet);
            } else {
                state.missed.push(*tile.tile());
            }
        });
    }

    /// What is shown stays until the tile is put again.
    fn revoke(&self, _: &Tile) {}
}

impl Drop for Display {
    fn drop(&mut self) {
        self.state.change(|state| state.is_closed = true);
    }
}

/// Looks whether a display still takes bytes.
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

    /// Waits until the state is as `is_ready` says. Returns whether it is; not if the display takes too long.
    fn wait_until(&mut self, state: &SharedState, is_ready: impl Fn(&State) -> bool) -> bool {
        while !state.wait_until(WRITE_WAIT, &is_ready) {
            let sent = state.lock().sent;
            if sent != self.sent {
                self.sent = sent;
                self.moved = Instant::now();
            }
            if self.moved.elapsed() >= PATIENCE || self.begun.elapsed() >= MOST_AT_END {
                return false;
            }
        }
        true
    }
}

/// Connects, and sends what there is to send until the display is closed or fails.
fn send_packets(address: &DisplayAddress, state: &SharedState) {
    let result = match connect(address) {
        Ok(mut stream) => send_all(&mut stream, state)
            .map_err(|source| DisplayError::Gone { address: address.clone(), source }),
        Err(source) => Err(DisplayError::Connect { address: address.clone(), source }),
    };
    if let Err(error) = result {
        state.change(|state| state.fail(error));
    }
}

fn connect(address: &DisplayAddress) -> io::Result<TcpStream> {
    let mut last = io::Error::other("the host's name has no address");
    for address in (address.host.as_str(), address.port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_WAIT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(WRITE_WAIT))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn send_all(stream: &mut TcpStream, state: &SharedState) -> io::Result<()> {
    while let Some(packet) = state.next() {
        let mut rest = packet.as_slice();
        while !rest.is_empty() {
            let count = match stream.write(rest) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => count,
                Err(error) if is_passing(&error) => 0,
                Err(error) => return Err(error),
            };
            rest = &rest[count..];
            if !state.advance(count, rest.is_empty()) {
                return Ok(());
            }
        }
    }
    Ok(())
}

/// Whether a write did nothing and may be tried again.
fn is_passing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
