//! Replaces the names of settings in the library's errors by flags of the command line.

use photoncard_driver::render::{RenderSettings, Setting};

/// Names in the library's errors that `RenderSettings::options` does not list, with the flags that replace
/// them.
const OTHERS: [[&str; 2]; 3] = [
    ["`cards.caches`", "--counters or --cache"],
    ["`CardAddress::with_memory`", "--card-memory"],
    ["`LoadSettings::texture_limit`", "--texture-limit"],
];

/// Replaces each name of a setting in backticks by the flag that states the setting, such as
/// `integrator.samples` by `--spp`.
pub(crate) fn with_flags(text: &str) -> String {
    let text = OTHERS.iter().fold(text.to_owned(), |text, [name, flags]| text.replace(name, flags));
    let options = RenderSettings::default().options().into_iter();
    options.fold(text, |text, Setting { field, option, .. }| {
        text.replace(&format!("`{field}`"), &format!("--{option}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_errors_become_flags() {
        let text = "`integrator.samples` 0 is not possible: `a` (`integrator.irradiance_error`, `cards.caches`, `CardAddress::with_memory`)";
        let expected = "--spp 0 is not possible: `a` (--ic-error, --counters or --cache, --card-memory)";
        assert_eq!(with_flags(text), expected);
    }
}
