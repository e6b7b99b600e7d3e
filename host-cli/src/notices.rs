//! Notices on a scene: what is ignored or missing in it, and what is taken in another way than it is stated.

use std::path::Path;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::Picture;
use photoncard_driver::scene::{Concern, Scene};

use crate::arguments::{FrameOptions, SceneOptions};
use crate::console::say;
use crate::failure::Failure;

/// Maximum number of notices of a kind that are printed, besides their number.
const NAMED: usize = 3;

/// What pictures use of a scene's file.
pub(crate) struct Uses {
    view: bool,
    animations: bool,
    environment: bool,
}

impl Uses {
    /// Uses of a picture, or of `frames`. Its camera is one that can be seen by.
    pub(crate) fn of(options: &SceneOptions, picture: &Picture, frames: Option<&FrameOptions>) -> Self {
        Self {
            view: !picture.states_view(),
            animations: frames.is_some_and(|frames| frames.numbers().is_some()),
            environment: options.environment.is_none(),
        }
    }

    fn uses(&self, concern: Concern) -> bool {
        match concern {
            Concern::View => self.view,
            Concern::OtherCameras => false,
            Concern::Animations => self.animations,
            Concern::Environment => self.environment,
        }
    }
}

/// Prints what is ignored or missing of what is used; with `--strict` it is an error.
///
/// # Errors
/// If anything is ignored or missing, and the options are strict.
pub(crate) fn say_ignored(options: &SceneOptions, scene: &Scene, uses: &Uses) -> Result<(), Failure> {
    let notices = scene.notices_on(|concern| uses.uses(concern));
    let Some(line) = first(&options.path, &notices) else { return Ok(()) };
    if !options.strict {
        say(format_args!("photoncard: ignored or missing: {line}"));
        return Ok(());
    }
    let report = MietteDiagnostic::new(format!("--strict: {}", notices.join("; ")));
    let help = "mend the scene, or render it without --strict, which leaves this out";
    Err(Failure::Input(Report::new(report.with_help(help))))
}

/// Prints what is taken in another way than it is stated.
pub(crate) fn say_remarks(path: &Path, scene: &Scene) {
    let remarks: Vec<_> = scene.remarks.iter().map(String::as_str).collect();
    if let Some(line) = first(path, &remarks) {
        say(format_args!("photoncard: note: {line}"));
    }
}

/// The first sentences, and the number of the others.
fn first(path: &Path, sentences: &[&str]) -> Option<String> {
    let mut said = sentences.get(..NAMED.min(sentences.len()))?.join("; ");
    if said.is_empty() {
        return None;
    }
    if sentences.len() > NAMED {
        let more = sentences.len() - NAMED;
        said += &format!("; and {more} more, see photoncard scene info {}", path.display());
    }
    Some(said)
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::arguments::{Arguments, Command, RenderOptions};

    #[test]
    fn the_first_sentences_are_named_and_the_others_counted() {
        let line = |count: usize| first(Path::new("a.glb"), &["n0", "n1", "n2", "n3", "n4"][..count]);
        assert_eq!(line(0), None);
        assert_eq!(line(3).as_deref(), Some("n0; n1; n2"));
        assert_eq!(line(5).as_deref(), Some("n0; n1; n2; and 2 more, see photoncard scene info a.glb"));
    }

    fn options(line: &str) -> RenderOptions {
        let words = format!("photoncard render a.glb -o a.png --strict {line}");
        let command = Arguments::parse_from(words.split_whitespace()).command;
        let Command::Render(options) = command else { panic!("{words}") };
        *options
    }

    fn refused(line: &str, scene: &Scene) -> Option<String> {
        let options = options(line);
        let uses = Uses::of(&options.scene, &options.settings().picture, Some(&options.frames));
        say_ignored(&options.scene, scene, &uses).err().map(|failure| failure.line())
    }

    #[test]
    fn what_is_ignored_is_an_error_of_a_strict_render() {
        let scene = Scene { notices: vec!["n0".into(); 5], remarks: vec!["r".into()], ..Scene::default() };
        assert_eq!(refused("", &scene).unwrap().matches("n0").count(), 5);
        let lenient = SceneOptions { strict: false, ..options("").scene };
        let uses = Uses::of(&lenient, &Picture::default(), None);
        assert!(say_ignored(&lenient, &scene, &uses).is_ok());
        assert_eq!(refused("", &Scene { notices: Vec::new(), ..scene }), None);
    }

    /// A notice on each concern, in place of which the command line may state another view, play no
    /// animation, or have another sky.
    #[test]
    fn what_the_command_line_states_itself_is_no_error_of_a_strict_render() {
        for (concern, replaced, used) in [
            (Concern::View, "--camera-at 1,2,3 --look-at 0,0,0", Some("--camera-at 1,2,3 --fov 30")),
            (Concern::OtherCameras, "--camera eye", None),
            (Concern::Animations, "", Some("--frames 1-2 -o a.#.exr")),
            (Concern::Environment, "--environment 1,1,1", Some("")),
        ] {
            let scene = Scene {
                notices: vec!["first".into(), "second".into()],
                concerns: vec![(1, concern)],
                ..Scene::default()
            };
            let said = |line: &str| refused(line, &scene).unwrap();
            assert!(said(replaced).contains("first") && !said(replaced).contains("second"), "{concern:?}");
            if let Some(line) = used {
                assert!(said(line).contains("second"), "{concern:?}");
            }
        }
    }
}
