//! Replaces the names of settings in the library's errors by flags of the command line.

use photoncard_driver::render::{RenderSettings, Setting};

/// Field of the settings as the library's errors name it, and the two flags that set it.
const CACHES: [&str; 2] = ["`cards.caches`", "--counters or --cache"];

/// Replaces each field of the settings, between backticks, by its flag: `integrator.samples` by `--spp`.
pub(crate) fn with_flags(text: &str) -> String {
    let [caches, flags] = CACHES;
    let options = RenderSettings::default().options().into_iter();
    options.fold(text.replace(caches, flags), |text, Setting { field, option, .. }| {
        text.replace(&format!("`{field}`"), &format!("--{option}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_errors_become_flags() {
        let text =
            "`integrator.samples` 0 is not possible: `a` (`integrator.irradiance_error`, `cards.caches`)";
        let expected = "--spp 0 is not possible: `a` (--ic-error, --counters or --cache)";
        assert_eq!(with_flags(text), expected);
    }
}
