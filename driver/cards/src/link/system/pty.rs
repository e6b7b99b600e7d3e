//! Card's end of a pseudo terminal, which hosts open as a serial port.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::ffi::OsStringExt;
use std::path::PathBuf;
use std::time::Duration;

use rustix::event::PollFlags;
use rustix::fs::{Mode, OFlags};
use rustix::io::FdFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{self, OptionalActions};

use super::StreamPort;
use super::stream::wait_for;

/// Pseudo terminal that waits for hosts to open it.
pub(super) struct Pty {
    controller: File,
}

impl Pty {
    /// Opens a pseudo terminal in raw mode. Returns it with its path.
    pub(super) fn open() -> io::Result<(Self, PathBuf)> {
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        rustix::io::fcntl_setfd(&controller, FdFlags::CLOEXEC)?;
        grantpt(&controller)?;
        unlockpt(&controller)?;
        let path = PathBuf::from(OsString::from_vec(ptsname(&controller, Vec::new())?.into_bytes()));
        let flags = rustix::fs::fcntl_getfl(&controller)?;
        rustix::fs::fcntl_setfl(&controller, flags | OFlags::NONBLOCK)?;
        // The hang-up state, which shows that no host has the terminal open, is reported only after the
        // terminal was opened once.
        let terminal =
            rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut settings = termios::tcgetattr(&terminal)?;
        settings.make_raw();
        termios::tcsetattr(&terminal, OptionalActions::Now, &settings)?;
        Ok((Self { controller: File::from(controller) }, path))
    }

    /// Returns a port to the host that has the terminal open; `None` if no host has it open.
    pub(super) fn accept(&mut self) -> io::Result<Option<StreamPort<File>>> {
        if !wait_for(&self.controller, PollFlags::IN, Duration::ZERO).contains(PollFlags::HUP) {
            return Ok(Some(StreamPort::new(self.controller.try_clone()?)));
        }
        // Drops the bytes of a host that is gone; at their end the read fails.
        let mut buffer = [0; 512];
        while self.controller.read(&mut buffer).is_ok_and(|count| count > 0) {}
        Ok(None)
    }
}
