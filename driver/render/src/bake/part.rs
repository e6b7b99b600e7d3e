//! Parts of a bake: the light of a range of sensors in a file.
//!
//! ```text
//! photoncard bake 1\n
//! { part, sensors, identity as JSON }\n
//! CRC-32C of all bytes before: u32
//! irradiance of each sensor of the part, red, green, blue: f64, W/m^2
//! CRC-32C of the light, which begins with that of the heading: u32
//! ```

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use photoncard_picture::heading::{Heading, HeadingFault, Kind};
use photoncard_picture::output::{OutputError, PendingFile};
use photoncard_shared::checksum::Checksum;
use serde::{Deserialize, Serialize};

use super::error::BakeError;
use crate::parts::Part;

const KIND: Kind = Kind { name: "photoncard bake", version: 1 };
/// Size of the light of a sensor, bytes.
const RECORD: usize = 24;

/// Irradiance of a sensor, W/m^2.
pub type Light = [f64; 3];

/// Head of a part's file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    part: String,
    sensors: u32,
    identity: String,
}

/// Number of sensors and identity, equal in all parts of a bake.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Whole {
    /// Number of sensors of all parts.
    pub sensors: u32,
    /// Checksum of scene, settings and sensors.
    pub identity: String,
}

/// Writes a part, whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, part: Part, whole: &Whole, light: &[Light]) -> Result<(), BakeError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let head = Head { part: part.to_string(), sensors: whole.sensors, identity: whole.identity.clone() };
    let (mut bytes, heading) = KIND.heading(&head).map_err(|error| failed(error.into()))?;
    let first = bytes.len();
    bytes.extend(light.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    let sum = checksum(heading, bytes.get(first..).unwrap_or_default());
    bytes.extend(sum.to_le_bytes());
    let mut file = PendingFile::create(path)?;
    file.write_all(&bytes).map_err(failed)?;
    Ok(file.commit()?)
}

fn checksum(heading: u32, light: &[u8]) -> u32 {
    let mut sum = Checksum::default();
    sum.update(&heading.to_le_bytes());
    sum.update(light);
    sum.value()
}

/// Reads the parts of a bake, and returns the light of all sensors.
///
/// # Errors
/// If a file is damaged or of another bake, or parts are missing or differ.
pub fn read(paths: &[PathBuf], whole: &Whole) -> Result<Vec<Light>, BakeError> {
    let mut light: Vec<Option<Light>> = vec![None; whole.sensors as usize];
    let mut first: Option<Part> = None;
    let mut found = Vec::new();
    for path in paths {
        let refused =
            |fault: &str, remedy| BakeError::Part { path: path.clone(), fault: fault.into(), remedy };
        let (part, of_part) = read_part(path, whole)?;
        let count = first.get_or_insert(part).count();
        if count != part.count() {
            let fault = format!("it is one of {} parts, and the first file of {count}", part.count());
            return Err(refused(&fault, "give the parts of one division"));
        }
        let [start, end] = part.range(whole.sensors.into()).map(|number| number as usize);
        for (known, new) in light.get_mut(start..end).into_iter().flatten().zip(of_part) {
            if known.replace(new).is_some_and(|known| known != new) {
                let fault = format!("another file is part {part} too, with other light: a card was wrong");
                return Err(refused(&fault, "bake this part once more"));
            }
        }
        found.push(part);
    }
    let count = first.map_or(1, Part::count);
    let missing: Vec<Part> = Part::all(count).filter(|part| !found.contains(part)).collect();
    if !missing.is_empty() {
        return Err(BakeError::Missing { count, missing });
    }
    Ok(light.into_iter().flatten().collect())
}

fn read_part(path: &Path, whole: &Whole) -> Result<(Part, Vec<Light>), BakeError> {
    const AGAIN: &str = "copy it again, or bake the part again";
    let unreadable = |source: io::Error| BakeError::Unreadable { path: path.to_owned(), source };
    let refused =
        |fault: &str, remedy| BakeError::Part { path: path.to_owned(), fault: fault.into(), remedy };
    let most = u64::from(whole.sensors) * RECORD as u64 + (1 << 12);
    let found = fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() || found.len() > most {
        return Err(refused(
            "it is no part of this bake",
            "give files that `photoncard bake --part K/N` wrote",
        ));
    }
    let bytes = fs::read(path).map_err(unreadable)?;
    let Heading { head, bytes: length, checksum: heading }: Heading<Head> =
        KIND.read(&mut bytes.as_slice()).map_err(|fault| match fault {
            HeadingFault::Foreign => {
                refused("it is no part of a bake", "give files that `photoncard bake --part K/N` wrote")
            }
            HeadingFault::Version(version) => {
                refused(&format!("it is of version {version}"), "put together with the program that baked it")
            }
            HeadingFault::Damaged(fault) => refused(fault, AGAIN),
            HeadingFault::Unreadable(source) => unreadable(source),
        })?;
    let own = Whole { sensors: head.sensors, identity: head.identity };
    if own != *whole {
        let fault = "it is of another bake: scene, settings or the program differ";
        return Err(refused(fault, "give --merge the options with which the parts were baked"));
    }
    let damaged = || refused("its light has another checksum or length", AGAIN);
    let part: Part = head.part.parse().map_err(|_| damaged())?;
    let [start, end] = part.range(whole.sensors.into());
    let records = (end - start) as usize * RECORD;
    let rest = bytes.get(length as usize..).ok_or_else(damaged)?;
    let (light, sum) = rest.split_at_checked(records).ok_or_else(damaged)?;
    if sum != checksum(heading, light).to_le_bytes() {
        return Err(damaged());
    }
    let number = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
    let numbers: Vec<f64> = light.as_chunks::<8>().0.iter().map(number).collect();
    if !numbers.iter().all(|number| (0.0..=f64::from(f32::MAX)).contains(number)) {
        return Err(damaged());
    }
    Ok((part, numbers.as_chunks::<3>().0.to_vec()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn whole(sensors: u32) -> Whole {
        Whole { sensors, identity: "12345678".to_owned() }
    }

    fn written(folder: &Path, count: u32, sensors: u32) -> Vec<PathBuf> {
        let parts = Part::all(count).map(|part| {
            let [start, end] = part.range(sensors.into());
            let light: Vec<Light> = (start..end).map(|number| [number as f64; 3]).collect();
            let path = folder.join(format!("{}.part", part.number()));
            write(&path, part, &whole(sensors), &light).unwrap();
            path
        });
        parts.collect()
    }

    #[test]
    fn parts_in_any_order_have_the_light_of_all_sensors() {
        let folder = tempfile::tempdir().unwrap();
        for (count, sensors) in [(1, 5), (3, 10), (4, 2)] {
            let mut paths = written(folder.path(), count, sensors);
            paths.reverse();
            let light = read(&paths, &whole(sensors)).unwrap();
            let expected: Vec<Light> = (0..sensors).map(|number| [f64::from(number); 3]).collect();
            assert_eq!(light, expected);
        }
    }

    #[test]
    fn missing_parts_and_parts_of_other_bakes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let paths = written(folder.path(), 3, 10);
        let missing = read(&paths[..2], &whole(10)).unwrap_err().to_string();
        assert!(missing.contains("3/3"), "{missing}");
        let other = Whole { identity: "other".to_owned(), ..whole(10) };
        assert!(read(&paths, &other).unwrap_err().to_string().contains("another bake"));
        assert!(read(&paths, &whole(11)).is_err());
    }

    proptest! {
        #[test]
        fn a_damaged_part_is_refused(place in any::<prop::sample::Index>(), flip in 1_u8.., cut in any::<bool>()) {
            let folder = tempfile::tempdir().unwrap();
            let paths = written(folder.path(), 1, 4);
            let mut bytes = fs::read(&paths[0]).unwrap();
            let place = place.index(bytes.len());
            if cut { bytes.truncate(place) } else { bytes[place] ^= flip }
            fs::write(&paths[0], bytes).unwrap();
            prop_assert!(read(&paths, &whole(4)).is_err());
        }
    }
}
