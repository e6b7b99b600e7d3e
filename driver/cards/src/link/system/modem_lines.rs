//! States of the lines DTR and RTS of a serial port.

use std::fmt;
use std::io;
use std::str::FromStr;

/// States of the lines DTR and RTS of a serial port while it is open.
///
/// By default both are raised: a board with USB CDC may send nothing while DTR is low, and Windows leaves it
/// low. Some boards are held in reset by RTS, or started in their boot loader by DTR: the other line being
/// raised as well is neutral on all known ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModemLines {
    /// State of DTR (Data Terminal Ready). `None` for raised, if the port has the line.
    pub dtr: Option<bool>,
    /// State of RTS (Request To Send). `None` for raised, if the port has the line.
    pub rts: Option<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    Dtr,
    Rts,
}

const FORM: &str =
    "use dtr=on, dtr=off, rts=on or rts=off after a comma, such as serial:/dev/ttyACM0@115200,dtr=on,rts=off";

impl ModemLines {
    /// Sets both lines by calls of `set`. Returns the option that was stated and is not possible, with the
    /// error of its call.
    ///
    /// RTS alone resets boards with the automatic reset of the ESP32, DTR alone does not: DTR is raised before
    /// RTS, and lowered after it. A driver of Windows passes RTS on with the next change of DTR only.
    pub(super) fn set(
        self,
        mut set: impl FnMut(Line, bool) -> io::Result<()>,
    ) -> Result<(), (String, io::Error)> {
        let order = match self.rts {
            Some(false) => &[Line::Rts, Line::Dtr][..],
            _ => &[Line::Dtr, Line::Rts, Line::Dtr],
        };
        for &line in order {
            let stated = self.state(line);
            match (set(line, stated.unwrap_or(true)), stated) {
                (Err(error), Some(is_raised)) => return Err((option(line, is_raised), error)),
                // A pseudo terminal and some adapters have no such lines.
                (Ok(()) | Err(_), _) => {}
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
impl fmt::Display for ModemLines {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for line in [Line::Dtr, Line::Rts] {
            self.state(line).map_or(Ok(()), |state| write!(f, ",{}", option(line, state)))?;
        }
        Ok(())
    }
}

/// Reads options without the first comma.
impl FromStr for ModemLines {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut lines = Self::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let state = match name {
                "dtr" => &mut lines.dtr,
                "rts" => &mut lines.rts,
                _ => return Err(format!("{part:?} is no option of a serial port; {FORM}")),
            };
            let is_raised = match value {
                "on" => true,
                "off" => false,
                _ => return Err(format!("{part:?} is no state of the line {name}; {FORM}")),
            };
            if state.replace(is_raised).is_some() {
                return Err(format!("{name} is stated twice in {text:?}; state it once"));
            }
        }
        Ok(lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: [Option<bool>; 3] = [None, Some(false), Some(true)];

    /// States (DTR, RTS) that a port goes through whose lines are both `from` when it is opened.
    fn states(lines: ModemLines, from: bool) -> Vec<(bool, bool)> {
        let mut states = vec![(from, from)];
        lines
            .set(|line, is_raised| {
                let (dtr, rts) = states[states.len() - 1];
                states.push(if line == Line::Dtr { (is_raised, rts) } else { (dtr, is_raised) });
                Ok(())
            })
            .unwrap();
        states
    }

    /// espressif/esptool issue 137: RTS without DTR holds a board in reset.
    #[test]
    fn lines_come_to_their_states_without_a_reset_on_the_way() {
        for (dtr, rts) in STATES.into_iter().flat_map(|dtr| STATES.map(|rts| (dtr, rts))) {
            for from in [false, true] {
                let states = states(ModemLines { dtr, rts }, from);
                let wanted = (dtr.unwrap_or(true), rts.unwrap_or(true));
                assert_eq!(states.last(), Some(&wanted));
                let is_reset = |state: &(bool, bool)| *state == (false, true);
                assert!(wanted == (false, true) || !states.iter().any(is_reset), "{states:?}");
            }
        }
    }

    #[test]
    fn a_line_that_a_port_lacks_is_an_error_only_if_it_is_stated() {
        let lacking = |lacked: Line| {
            move |line: Line, _: bool| if line == lacked { Err(io::ErrorKind::Other.into()) } else { Ok(()) }
        };
        let stated = ModemLines { dtr: Some(true), rts: None };
        assert!(ModemLines::default().set(lacking(Line::Dtr)).is_ok());
        assert!(stated.set(lacking(Line::Rts)).is_ok());
        assert_eq!(stated.set(lacking(Line::Dtr)).unwrap_err().0, "dtr=on");
        let low = ModemLines { dtr: None, rts: Some(false) };
        assert_eq!(low.set(lacking(Line::Rts)).unwrap_err().0, "rts=off");
    }
}
