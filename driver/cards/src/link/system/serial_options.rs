//! Options of a serial port's address: states of the lines DTR and RTS, and the wait for an unplugged board.

use std::fmt;
use std::io;
use std::str::FromStr;
use std::time::Duration;

/// Options of a serial port.
///
/// By default DTR and RTS are raised while the port is open: a board with USB CDC may send nothing while DTR
/// is low, and Windows leaves it low. Boards that one of the lines alone resets, or starts in a boot loader,
/// run while both are raised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SerialOptions {
    /// State of DTR (Data Terminal Ready). `None` for raised, if the port has the line.
    pub dtr: Option<bool>,
    /// State of RTS (Request To Send). `None` for raised, if the port has the line.
    pub rts: Option<bool>,
    /// Time in seconds for which a render without any other card waits for the card to come back after a
    /// loss. `None` for 30 s.
    pub wait: Option<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    Dtr,
    Rts,
}

/// Default of [`SerialOptions::wait`]: the time to find a cable.
const WAIT: u32 = 30;
/// Maximum of [`SerialOptions::wait`]: a week.
const MAX_WAIT: u32 = 7 * 24 * 3600;

const FORM: &str =
    "use dtr=on|off, rts=on|off or wait=SECONDS after a comma, such as serial:/dev/ttyACM0@115200,rts=off";

impl SerialOptions {
    /// Time for which a render without any other card waits for the card to come back after a loss.
    pub(super) fn wait(self) -> Duration {
        Duration::from_secs(self.wait.unwrap_or(WAIT).into())
    }

    /// Sets both lines by calls of `set`. Returns the option that was stated and is not possible, with the
    /// error of its call.
    ///
    /// RTS alone resets boards with the automatic reset of the ESP32, DTR alone does not: DTR is raised
    /// before RTS, and lowered after it. A driver of Windows passes RTS on with the next change of DTR only.
    pub(super) fn set_lines(
        self,
        mut set: impl FnMut(Line, bool) -> io::Result<()>,
    ) -> Result<(), (String, io::Error)> {
        let order = match self.rts {
            Some(false) => &[Line::Rts, Line::Dtr][..],
            _ => &[Line::Dtr, Line::Rts, Line::Dtr],
        };
        for &line in order {
            let stated = self.state(line);
            // A pseudo terminal and some adapters have no such lines.
            if let (Err(error), Some(is_raised)) = (set(line, stated.unwrap_or(true)), stated) {
                return Err((option(line, is_raised), error));
            }
        }
        Ok(())
    }

    fn state(self, line: Line) -> Option<bool> {
        match line {
            Line::Dtr => self.dtr,
            Line::Rts => self.rts,
        }
    }
}

fn option(line: Line, is_raised: bool) -> String {
    let name = match line {
        Line::Dtr => "dtr",
        Line::Rts => "rts",
    };
    format!("{name}={}", if is_raised { "on" } else { "off" })
}

/// Options of a serial port's address, each after a comma.
impl fmt::Display for SerialOptions {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for line in [Line::Dtr, Line::Rts] {
            self.state(line).map_or(Ok(()), |state| write!(f, ",{}", option(line, state)))?;
        }
        self.wait.map_or(Ok(()), |seconds| write!(f, ",wait={seconds}"))
    }
}

/// Reads options without the first comma.
impl FromStr for SerialOptions {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut options = Self::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let is_repeated = match name {
                "dtr" => options.dtr.replace(state(part, value)?).is_some(),
                "rts" => options.rts.replace(state(part, value)?).is_some(),
                "wait" => options.wait.replace(seconds(part, value)?).is_some(),
                _ => return Err(format!("{part:?} is no option of a serial port; {FORM}")),
            };
            if is_repeated {
                return Err(format!("{name} is stated twice in {text:?}; state it once"));
            }
        }
        Ok(options)
    }
}

fn state(part: &str, value: &str) -> Result<bool, String> {
    match value {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(format!("{part:?} states neither on nor off; {FORM}")),
    }
}

fn seconds(part: &str, value: &str) -> Result<u32, String> {
    let seconds = value.parse().ok().filter(|&seconds| seconds <= MAX_WAIT);
    seconds.ok_or_else(|| format!("{part:?} has no number of seconds from 0 to {MAX_WAIT}; {FORM}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: [Option<bool>; 3] = [None, Some(false), Some(true)];

    /// States (DTR, RTS) that a port goes through whose lines are both `from` when it is opened.
    fn states(lines: SerialOptions, from: bool) -> Vec<(bool, bool)> {
        let mut states = vec![(from, from)];
        lines
            .set_lines(|line, is_raised| {
                let (dtr, rts) = states[states.len() - 1];
                states.push(if line == Line::Dtr { (is_raised, rts) } else { (dtr, is_raised) });
                Ok(())
            })
            .unwrap();
        states
    }

    /// espressif/esptool issue 137: RTS without DTR holds a board in reset. esp-rs/espflash pull 554: Windows
    /// passes RTS on with the next change of DTR.
    #[test]
    fn lines_come_to_their_states_without_a_reset_on_the_way() {
        for (dtr, rts) in STATES.into_iter().flat_map(|dtr| STATES.map(|rts| (dtr, rts))) {
            for from in [false, true] {
                let states = states(SerialOptions { dtr, rts, wait: None }, from);
                let wanted = (dtr.unwrap_or(true), rts.unwrap_or(true));
                assert_eq!(states.last(), Some(&wanted));
                assert!(is_dtr_last(SerialOptions { dtr, rts, wait: None }));
                let is_reset = |state: &(bool, bool)| *state == (false, true);
                assert!(wanted == (false, true) || !states.iter().any(is_reset), "{states:?}");
            }
        }
    }

    fn is_dtr_last(options: SerialOptions) -> bool {
        let mut last = Line::Rts;
        let set = options.set_lines(|line, _| {
            last = line;
            Ok(())
        });
        set.is_ok() && last == Line::Dtr
    }

    #[test]
    fn a_line_that_a_port_lacks_is_an_error_only_if_it_is_stated() {
        let lacking = |lacked: Line| {
            move |line: Line, _: bool| if line == lacked { Err(io::ErrorKind::Other.into()) } else { Ok(()) }
        };
        let stated = SerialOptions { dtr: Some(true), ..SerialOptions::default() };
        assert!(SerialOptions::default().set_lines(lacking(Line::Dtr)).is_ok());
        assert!(stated.set_lines(lacking(Line::Rts)).is_ok());
        assert_eq!(stated.set_lines(lacking(Line::Dtr)).unwrap_err().0, "dtr=on");
        let low = SerialOptions { rts: Some(false), ..SerialOptions::default() };
        assert_eq!(low.set_lines(lacking(Line::Rts)).unwrap_err().0, "rts=off");
    }
}
