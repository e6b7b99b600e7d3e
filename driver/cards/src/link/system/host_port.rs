//! Port of a card that serves hosts one after another.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use photoncard_shared::frame::FrameReader;
use photoncard_shared::link::{Port, PortError};

use super::Listener;

/// Card's end of the links to consecutive hosts.
///
/// To the card this is one link that never closes. Output is lost while no host is connected, as on an
/// unplugged cable. Between two hosts the link is cut at the end of a frame in both directions. A host
/// receives nothing before it has sent a byte. While one host is served, the connection of a second is closed
/// at once. A socket connection that has sent no whole frame within 10 s is closed. After its first frame a
/// host may be silent, because packing a scene takes time.
pub struct HostPort {
    listener: Listener,
    stop: Arc<AtomicBool>,
    host: Option<Host>,
    /// Second host that has connected. It is refused once the present host is known to be still connected.
    next: Option<Box<dyn Port + Send>>,
    /// Time of the last poll of the host and of the listener.
    looked: Instant,
    /// True if the last byte that the card sent was not the end of a frame.
    in_frame: bool,
    /// Receives messages about hosts.
    say: fn(fmt::Arguments),
}

struct Host {
    port: Box<dyn Port + Send>,
    since: Instant,
    /// Parser of the first whole frame; `None` once it has arrived.
    first_frame: Option<FrameReader>,
    has_spoken: bool,
    /// True while the card sends the rest of a frame that it began before the host's first byte.
    skips_frame: bool,
}

/// Minimum time between two polls. A busy card reads its port after every short step, and a system call at
/// each would slow it down.
const LOOK_INTERVAL: Duration = Duration::from_micros(200);
/// Time within which a host must send its first whole frame.
const FIRST_FRAME: Duration = Duration::from_secs(10);
const FRAME_END: u8 = 0;

impl HostPort {
    /// Creates a port for the hosts that connect to `listener`, until `stop` is set. `say` receives messages
    /// about closed connections.
    pub fn new(listener: Listener, stop: Arc<AtomicBool>, say: fn(fmt::Arguments)) -> Self {
        Self { listener, stop, host: None, next: None, looked: Instant::now(), in_frame: false, say }
    }

    /// Closes the connection to the present host. A host on a pseudo terminal is only left unheard until its
    /// next bytes.
    pub fn hang_up(&mut self) {
        self.host = None;
    }

    fn check_stop(&self) -> Result<(), PortError> {
        if self.stop.load(Ordering::Relaxed) { Err(PortError::Closed) } else { Ok(()) }
    }

    /// Records whether the card's sent or dropped bytes end within a frame.
    fn pass(&mut self, bytes: &[u8]) {
        if let Some(&last) = bytes.last() {
            self.in_frame = last != FRAME_END;
        }
    }

    /// Accepts a second host. If the present host `is_silent` but still connected, first refuses a second
    /// host that was accepted earlier.
    fn look_for_others(&mut self, is_silent: bool) {
        // A host that was accepted earlier did not wait for the end of the present host's connection.
        if is_silent {
            self.next = None;
        }
        if self.next.is_none() {
            self.next = self.listener.accept_other();
        }
    }

    /// Accepts the next host. Puts the end of a frame into `buffer`, because the previous host may have left
    /// a frame unfinished. Returns the number of bytes in `buffer`.
    fn welcome(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let Some(byte) = buffer.first_mut() else { return 0 };
        let Some(port) = self.next.take().or_else(|| self.listener.accept(wait)) else { return 0 };
        // A pseudo terminal has no connection to close: there is no time limit.
        let first_frame = self.listener.is_socket().then(FrameReader::new);
        self.host =
            Some(Host { port, since: Instant::now(), first_frame, has_spoken: false, skips_frame: false });
        *byte = FRAME_END;
        1
    }
}

impl Host {
    /// Parses the bytes received now. Returns true while no whole, valid frame has arrived.
    fn is_none_yet(&mut self, mut bytes: &[u8]) -> bool {
        while let Some(reader) = self.first_frame.as_mut().filter(|_| !bytes.is_empty()) {
            let (taken, frame) = reader.read(bytes);
            bytes = &bytes[taken..];
            if matches!(frame, Some(Ok(_))) {
                self.first_frame = None;
            }
        }
        self.first_frame.is_some()
    }
}

impl Port for HostPort {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        self.check_stop()?;
        if wait.is_zero() && self.looked.elapsed() < LOOK_INTERVAL {
            return Ok(0);
        }
        self.looked = Instant::now();
        let Some(host) = &mut self.host else { return Ok(self.welcome(buffer, wait)) };
        let Ok(count) = host.port.read(buffer, wait) else {
            self.host = None;
            return Ok(0);
        };
        if count > 0 && !host.has_spoken {
            host.has_spoken = true;
            host.skips_frame = self.in_frame;
        }
        if host.is_none_yet(&buffer[..count]) && host.since.elapsed() > FIRST_FRAME {
            let seconds = FIRST_FRAME.as_secs();
            (self.say)(format_args!(
                "photoncard: closed a connection that sent no valid frame for {seconds} s"
            ));
            self.host = None;
            return Ok(0);
        }
        self.look_for_others(count == 0);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.check_stop()?;
        let Some(host) = self.host.as_mut().filter(|host| host.has_spoken) else {
            self.pass(bytes);
            return Ok(bytes.len());
        };
        if host.skips_frame {
            let end = bytes.iter().position(|&byte| byte == FRAME_END);
            host.skips_frame = end.is_none();
            let skipped = &bytes[..end.map_or(bytes.len(), |end| end + 1)];
            self.pass(skipped);
            return Ok(skipped.len());
        }
        let Ok(count) = host.port.write(bytes, wait) else {
            self.host = None;
            return Ok(0);
        };
        self.pass(&bytes[..count]);
        if count == 0 {
            self.look_for_others(true);
        }
        Ok(count)
    }
}
