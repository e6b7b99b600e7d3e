//! EULUMDAT (Stockmar 1990): `.ldt` files. Each value has a line of its own.

use super::numbers::{Fault, MAX_ANGLES, Numbers};
use super::web::{Kind, Web};

/// Lines of the heading that hold what is read, counted from 1.
const SYMMETRY: usize = 3;
const PLANES: usize = 4;
const ANGLES: usize = 6;
const FACTOR: usize = 24;
const LAMP_SETS: usize = 26;
/// Lines of a set of lamps, the second to the line of the flux among them, and of the direct ratios.
const LAMP_SET: usize = 6;
const FLUX: usize = 3;
const DIRECT_RATIOS: usize = 10;
const MAX_LAMP_SETS: usize = 20;

/// Parses the text of a file. Intensities are those of the first set of lamps.
pub(super) fn parse(text: &str) -> Result<Web, Fault> {
    // Numbers have a point or, in files of some programs, a comma.
    let lines: Vec<String> = text.lines().map(|line| line.trim().replace(',', ".")).collect();
    let number = |line: usize, name: &str| {
        let word =
            lines.get(line - 1).ok_or_else(|| Fault::at(lines.len().max(1), "the file ends too early"));
        Numbers::new(std::iter::once(word?.as_str()), line - 1).next(name)
    };
    let count = |line: usize, name: &str, most: usize| {
        let value = number(line, name)?;
        let is_count = value.fract() == 0.0 && (1.0..=most as f64).contains(&value);
        if is_count { Ok(value as usize) } else { Err(Fault::at(line, format!("{name} is {value}"))) }
    };
    let planes = count(PLANES, "the number of C planes", MAX_ANGLES)?;
    let angles = count(ANGLES, "the number of angles in a plane", MAX_ANGLES)?;
    let sets = count(LAMP_SETS, "the number of sets of lamps", MAX_LAMP_SETS)?;
    let flux = number(LAMP_SETS + FLUX, "the flux of the lamps")?;
    let conversion = number(FACTOR, "the conversion factor")?;
    for (line, name, value) in
        [(FACTOR, "the conversion factor", conversion), (LAMP_SETS + FLUX, "the flux", flux)]
    {
        if value <= 0.0 {
            return Err(Fault::at(line, format!("{name} is {value}")));
        }
    }
    let factor = conversion * flux / 1000.0;
    let symmetry = number(SYMMETRY, "the symmetry")?;
    let (first, given) = match symmetry {
        0.0 => (0, planes),
        1.0 => (0, 1),
        2.0 => (0, planes / 2 + 1),
        3.0 => (3 * planes / 4, planes / 2 + 1),
        4.0 => (0, planes / 4 + 1),
        other => return Err(Fault::at(SYMMETRY, format!("the symmetry is {other}, not 0 to 4"))),
    };
    let before = LAMP_SETS + sets * LAMP_SET + DIRECT_RATIOS;
    let mut numbers = Numbers::new(lines.iter().skip(before).map(String::as_str), before);
    let all = numbers.take("angle of plane", planes)?;
    let vertical = numbers.take("angle in a plane", angles)?;
    let at_angles = numbers.fault("");
    let mut horizontal: Vec<f64> = (0..given).map(|plane| all[(first + plane) % planes]).collect();
    let mut candelas = numbers.intensities(given * angles, factor)?;
    numbers.check_end()?;
    if symmetry == 3.0 {
        // Planes from 270 over 0 to 90 degrees: by the symmetry those from 270 down to 90.
        horizontal.iter_mut().for_each(|angle| *angle = (180.0 - *angle).rem_euclid(360.0));
        horizontal.reverse();
        candelas = candelas.chunks(angles).rev().flatten().copied().collect();
    }
    Web::new(Kind::C, horizontal, vertical, candelas).map_err(|reason| Fault { reason, ..at_angles })
}
