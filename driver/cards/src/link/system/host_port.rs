//! Port of a card that serves hosts one after another.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use photoncard_shared::handover::Handover;
use photoncard_shared::link::{Port, PortError};

use super::Listener;

/// Card's end of the links to consecutive hosts.
///
/// To the card this is one link that never closes: see [`Handover`]. While one host is served, the connection
/// of a second is closed at once. A socket connection that has sent no whole frame within 10 s is closed.
/// After its first frame a host may be silent, because packing a scene takes time.
pub struct HostPort {
    listener: Listener,
    stop: Arc<AtomicBool>,
    host: Option<Host>,
    /// Second host that has connected. It is refused once the present host is known to be still connected.
    next: Option<Box<dyn Port + Send>>,
    /// Time of the last poll of the host and of the listener.
    looked: Instant,
    handover: Handover,
    /// Receives messages about hosts.
    say: fn(fmt::Arguments),
}

struct Host {
    port: Box<dyn Port + Send>,
    since: Instant,
}

/// Minimum time between two polls. A busy card reads its port after every short step, and a system call at
/// each would slow it down.
const LOOK_INTERVAL: Duration = Duration::from_micros(200);
/// Time within which a host must send its first whole frame.
const FIRST_FRAME: Duration = Duration::from_secs(10);

impl HostPort {
    /// Creates a port for the hosts that connect to `listener`, until `stop` is set. `say` receives messages
    /// about closed connections.
    pub fn new(listener: Listener, stop: Arc<AtomicBool>, say: fn(fmt::Arguments)) -> Self {
        Self {
            listener,
            stop,
            host: None,
            next: None,
            looked: Instant::now(),
            handover: Handover::new(),
            say,
        }
    }

    /// Closes the connection to the present host. A host on a pseudo terminal is only left unheard until its
    /// next bytes.
    pub fn hang_up(&mut self) {
        self.host = None;
        self.handover.leave();
    }

    fn check_stop(&self) -> Result<(), PortError> {
        if self.stop.load(Ordering::Relaxed) { Err(PortError::Closed) } else { Ok(()) }
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

    /// Accepts the next host. Puts what the card is to receive first into `buffer`, and returns its length.
    fn welcome(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let Some(byte) = buffer.first_mut() else { return 0 };
        let Some(port) = self.next.take().or_else(|| self.listener.accept(wait)) else { return 0 };
        self.host = Some(Host { port, since: Instant::now() });
        *byte = self.handover.welcome();
        1
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
            self.hang_up();
            return Ok(0);
        };
        self.handover.received(&buffer[..count]);
        // A pseudo terminal has no connection to close.
        let is_timed = self.listener.is_socket() && !self.handover.is_proven();
        if is_timed && host.since.elapsed() > FIRST_FRAME {
            let seconds = FIRST_FRAME.as_secs();
            (self.say)(format_args!(
                "photoncard: closed a connection that sent no valid frame for {seconds} s"
            ));
            self.hang_up();
            return Ok(0);
        }
        self.look_for_others(count == 0);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        self.check_stop()?;
        let unwanted = self.handover.drop_unwanted(bytes);
        let Some(host) = self.host.as_mut().filter(|_| unwanted == 0) else { return Ok(unwanted) };
        let Ok(count) = host.port.write(bytes, wait) else {
            self.hang_up();
            return Ok(0);
        };
        self.handover.sent(&bytes[..count]);
        if count == 0 {
            self.look_for_others(true);
        }
        Ok(count)
    }
}
