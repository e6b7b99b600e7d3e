//! ANSI/IES LM-63, of 1986 to 2019: `.ies` files.

use super::numbers::{Fault, MAX_ANGLES, Numbers};
use super::web::{Kind, Web};

/// Value of a line `TILT=VALUE`, behind which the numbers begin.
pub(super) fn tilt(line: &str) -> Option<&str> {
    let (name, value) = line.split_once('=')?;
    name.trim().eq_ignore_ascii_case("TILT").then_some(value.trim())
}

/// Parses the text of a file. The keywords are not read, and the factors of tilted lamps are not applied.
pub(super) fn parse(text: &str) -> Result<Web, Fault> {
    let mut lines = text.lines();
    let (mut line, mut stated) = (0, None);
    for found in lines.by_ref() {
        line += 1;
        stated = tilt(found);
        if stated.is_some() {
            break;
        }
    }
    let Some(stated) = stated else { return Err(Fault::at(line.max(1), "there is no line TILT=")) };
    let mut numbers = Numbers::new(lines, line);
    if stated.eq_ignore_ascii_case("INCLUDE") {
        numbers.next("the lamp's orientation")?;
        let count = numbers.count("the number of tilts", MAX_ANGLES)?;
        numbers.take("tilt", count)?;
        numbers.take("factor of tilt", count)?;
    }
    numbers.next("the number of lamps")?;
    numbers.next("the lumens of a lamp")?;
    let multiplier = numbers.next("the multiplier of candelas")?;
    let vertical = numbers.count("the number of vertical angles", MAX_ANGLES)?;
    let horizontal = numbers.count("the number of horizontal angles", MAX_ANGLES)?;
    let kind = match numbers.next("the photometric type")? {
        1.0 => Kind::C,
        2.0 => Kind::B,
        3.0 => Kind::A,
        other => return Err(numbers.fault(format!("the photometric type is {other}, not 1, 2 or 3"))),
    };
    numbers.take("size of the luminaire: number", 4)?;
    let ballast = numbers.next("the ballast factor")?;
    // The ballast-lamp photometric factor until 1995; later 1, for future use.
    let factor = multiplier * ballast * numbers.next("the ballast-lamp factor")?;
    numbers.next("the input watts")?;
    if !(factor > 0.0 && factor.is_finite()) {
        return Err(numbers.fault(format!("the product of multiplier and ballast factors is {factor}")));
    }
    let vertical = numbers.take("vertical angle", vertical)?;
    let horizontal = numbers.take("horizontal angle", horizontal)?;
    let at_angles = numbers.fault("");
    let candelas = numbers.intensities(vertical.len() * horizontal.len(), factor)?;
    numbers.check_end()?;
    Web::new(kind, horizontal, vertical, candelas).map_err(|reason| Fault { reason, ..at_angles })
}
