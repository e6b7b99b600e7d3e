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
    use clap::CommandFactory;

    use super::*;
    use crate::arguments::Arguments;

    #[test]
    fn fields_of_errors_become_flags() {
        let text =
            "`integrator.samples` 0 is not possible: `a` (`integrator.irradiance_error`, `cards.caches`)";
        let expected = "--spp 0 is not possible: `a` (--ic-error, --counters or --cache)";
        assert_eq!(with_flags(text), expected);
    }

    #[test]
    fn every_setting_has_an_option_of_a_render() {
        let command = Arguments::command();
        let render = command.find_subcommand("render").unwrap();
        for Setting { field, option, .. } in RenderSettings::default().options() {
            let is_it = |argument: &clap::Arg| argument.get_long() == Some(option);
            assert!(render.get_arguments().any(is_it), "{field} is stated by no option --{option}");
        }
    }
}
