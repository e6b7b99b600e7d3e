//! Value of the option `--environment`.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use photoncard_driver::scene::{BRIGHTEST, Environment};

use crate::failure::Failure;

/// Environment light that `--environment` states.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum EnvironmentOption {
    /// Constant radiance, W/(sr m^2).
    Constant([f32; 3]),
    /// Path of an environment map.
    File(PathBuf),
    /// Environment map that a page has sent.
    Dropped(Arc<DroppedFile>),
}

/// File from a page. It is in no folder.
#[derive(Debug, PartialEq)]
pub(crate) struct DroppedFile {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
}

impl FromStr for EnvironmentOption {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f32>, _> = text.split(',').map(|number| number.trim().parse()).collect();
        let Ok(numbers) = numbers else { return Ok(Self::File(text.into())) };
        match numbers[..] {
            [red, green, blue] if numbers.iter().all(|number| (0.0..=BRIGHTEST).contains(number)) => {
                Ok(Self::Constant([red, green, blue]))
            }
            _ => Err(format!(
                "an environment is a file, or a radiance R,G,B of 0 to {BRIGHTEST:e} each, such as 0.5,0.7,1"
            )),
        }
    }
}

impl EnvironmentOption {
    /// Loads the environment. Returns it with a notice about clamped texels, if there are any.
    pub(crate) fn load(&self) -> Result<(Environment, Option<String>), Failure> {
        match self {
            Self::Constant(radiance) => Ok((Environment::constant((*radiance).into()), None)),
            Self::File(path) => Environment::load_with_notice(path).map_err(Failure::input),
            Self::Dropped(file) => {
                Environment::of_bytes(Path::new(&file.name), &file.bytes).map_err(Failure::input)
            }
        }
    }

    /// Returns whether this is a map, which can be turned.
    pub(crate) fn is_map(&self) -> bool {
        !matches!(self, Self::Constant(_))
    }

    /// Text for the provenance of a picture: `R,G,B`, or the file name of the map.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Constant([red, green, blue]) => format!("{red},{green},{blue}"),
            Self::File(path) => path.file_name().map_or(String::new(), |name| name.to_string_lossy().into()),
            Self::Dropped(file) => file.name.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_numbers_are_a_radiance_and_other_text_is_a_file() {
        let parsed = |text: &str| text.parse::<EnvironmentOption>();
        assert_eq!(parsed("0.5, 1,2e3"), Ok(EnvironmentOption::Constant([0.5, 1.0, 2000.0])));
        assert_eq!(parsed("sky.exr"), Ok(EnvironmentOption::File("sky.exr".into())));
        for text in ["1", "1,2", "1,2,-3", "1,2,nan", "1,2,inf", "1,2,3,4"] {
            assert!(parsed(text).is_err_and(|error| error.contains("R,G,B")), "{text}");
        }
    }
}
