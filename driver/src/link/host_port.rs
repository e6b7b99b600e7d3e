//! A card's port on which hosts come and go.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use photoncard_shared::frame::FrameReader;
use photoncard_shared::link::{Port, PortError};

use super::Listener;

/// The card's end of the links of one host after another.
///
/// To the card this is one link that never closes: what it says while no host listens is lost, as on a cable that is
/// pulled out. Between two hosts the link is cut at the end of a frame in both directions. A host hears nothing before it
/// has spoken. Hosts that come while another is served are refused: their link is closed at once. Who is on a socket and has
/// sent no whole frame for some seconds is no host, and is dropped; a host may be silent after its first one, as it packs a scene.
pub struct HostPort {
    listener: Listener,
    stop: Arc<AtomicBool>,
    host: Option<Host>,
    /// A host that has come while there is one. It is refused as soon as that one is known to be still there.
    next: Option<Box<dyn Port + Send>>,
    /// When the host and those that wait were looked at last.
    looked: Instant,
    /// Whether the card's last byte was not the end of a frame.
    in_frame: bool,
    /// Takes what there is to tell of hosts.
    say: fn(fmt::Arguments),
}

struct Host {
    port: Box<dyn Port + Send>,
    since: Instant,
    /// Looks for its first whole frame, until that has come.
    first_frame: Option<FrameReader>,
    has_spoken: bool,
    /// Whether the card's present frame began before the host had spoken.
    skips_frame: bool,
}

/// A card at work looks at its port after every little step: a system call each time would slow it down.
const LOOK_INTERVAL: Duration = Duration::from_micros(200);
/// How long a host's first whole frame may take.
const FIRST_FRAME: Duration = Duration::from_secs(10);
/// The byte between two frames.
const FRAME_END: u8 = 0;

impl HostPort {
    /// A port for the hosts that come to a listener, until `stop` is set. `say` is told of those that are dropped.
    pub fn new(listener: Listener, stop: Arc<AtomicBool>, say: fn(fmt::Arguments)) -> Self {
        Self { listener, stop, host: None, next: None, looked: Instant::now(), in_frame: false, say }
    }

    fn check_stop(&self) -> Result<(), PortError> {
        if self.stop.load(Ordering::Relaxed) { Err(PortError::Closed) } else { Ok(()) }
    }

    /// Notes where in a frame the card's bytes end that were sent or dropped.
    fn pass(&mut self, bytes: &[u8]) {
        if let Some(&last) = bytes.last() {
            self.in_frame = last != FRAME_END;
        }
    }

    /// Looks for hosts that have come meanwhile. What one link says arrives before what happens after it on another: a host
    /// that was seen before the present one was found silent, but not gone, has come too early.
    fn look_for_others(&mut self, is_silent: bool) {
        if is_silent {
            self.next = None;
        }
        if self.next.is_none() {
            self.next = self.listener.accept_other();
        }
    }

    /// Takes the next host. The frame that the last one may have left half sent ends here.
    fn welcome(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let Some(byte) = buffer.first_mut() else { return 0 };
        let Some(port) = self.next.take().or_else(|| self.listener.accept(wait)) else { return 0 };
        // A terminal that is dropped is open still, and keeps nobody out.
        let first_frame = self.listener.is_socket().then(FrameReader::new);
        self.host =
            Some(Host { port, since: Instant::now(), first_frame, has_spoken: false, skips_frame: false });
        *byte = FRAME_END;
        1
    }
}

impl Host {
    /// Whether it has sent no whole frame yet, with what it sends now.
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
            (self.say)(format_args!("photoncard: who has sent nothing of a host for {seconds} s is dropped"));
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
