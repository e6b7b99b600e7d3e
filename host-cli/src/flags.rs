//! Flags of the command line in place of the fields that errors of the library name.

use photoncard_driver::render::{RenderSettings, Setting};

/// Field that two options state.
const CACHES: [&str; 2] = ["`cards.caches`", "--counters or --cache"];

/// Text with the flag in place of each field between backticks: `--spp` for `integrator.samples`.
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
