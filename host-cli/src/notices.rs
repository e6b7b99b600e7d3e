//! Notices about contents of a scene that are ignored, missing, or interpreted otherwise than the file
//! states.

use std::path::Path;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::Picture;
use photoncard_driver::scene::{Concern, Scene};
use serde_json::json;

use crate::arguments::{FrameOptions, SceneOptions};
use crate::console::{is_json, say, say_json};
use crate::failure::Failure;

/// Maximum number of sentences in one message. Further sentences are only counted.
const NAMED: usize = 3;

/// Flags of the contents of a scene file that pictures use: its view (camera) and its environment unless
/// options replace them, its animations if frames are requested.
pub(crate) struct Uses {
    view: bool,
    animations: bool,
    environment: bool,
}

impl Uses {
    /// Returns the contents that a render of `picture`, or of the frames that `frames` states, uses.
    pub(crate) fn of(options: &SceneOptions, picture: &Picture, frames: Option<&FrameOptions>) -> Self {
        Self {
            view: !picture.states_view(),
            animations: frames.is_some_and(|frames| frames.numbers().is_some()),
            environment: !options.states_environment(),
        }
    }

    /// Returns the contents that a measurement uses, which has no camera.
    pub(crate) fn without_view(options: &SceneOptions) -> Self {
        Self { view: false, animations: false, environment: !options.states_environment() }
    }

    fn uses(&self, concern: Concern) -> bool {
        match concern {
            Concern::View => self.view,
            Concern::Animations => self.animations,
            Concern::Environment => self.environment,
        }
    }
}

/// Prints a notice about contents of the scene that are ignored or missing and that the pictures would use.
///
/// # Errors
/// If there is such a notice and `--strict` is given.
pub(crate) fn say_ignored(options: &SceneOptions, scene: &Scene, uses: &Uses) -> Result<(), Failure> {
    let notices = scene.notices_on(|concern| uses.uses(concern));
    let Some(line) = first(&options.path, &notices) else { return Ok(()) };
    if !options.strict {
        if is_json() {
            say_json(&json!({ "kind": "ignored", "message": line, "items": notices }));
        } else {
            say(format_args!("photoncard: ignored or missing: {line}"));
        }
        return Ok(());
    }
    let report = MietteDiagnostic::new(format!("--strict: {}", notices.join("; ")));
    let help = "mend the scene, or render it without --strict, which leaves this out";
    Err(Failure::Input(Report::new(report.with_help(help))))
}

/// Prints remarks about contents that are interpreted otherwise than the file states.
pub(crate) fn say_remarks(path: &Path, scene: &Scene) {
    let remarks: Vec<_> = scene.remarks.iter().map(String::as_str).collect();
    let Some(line) = first(path, &remarks) else { return };
    if is_json() {
        say_json(&json!({ "kind": "note", "message": line, "items": remarks }));
    } else {
        say(format_args!("photoncard: note: {line}"));
    }
}

/// Text of the first [`NAMED`] sentences, with the number of the others; `None` without sentences.
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
    use photoncard_driver::scene::SceneContents;

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
    fn strict_renders_refuse_ignored_contents() {
        let scene = Scene::from(SceneContents {
            notices: vec!["n0".into(); 5],
            remarks: vec!["r".into()],
            ..SceneContents::default()
        });
        assert_eq!(refused("", &scene).unwrap().matches("n0").count(), 5);
        let lenient = SceneOptions { strict: false, ..options("").scene };
        let uses = Uses::of(&lenient, &Picture::default(), None);
        assert!(say_ignored(&lenient, &scene, &uses).is_ok());
        assert_eq!(refused("", &scene.with(|scene| scene.notices.clear())), None);
    }

    /// A case has contents of a scene, options that replace them and, if there are any, options that use
    /// them.
    #[test]
    fn strict_renders_accept_contents_that_the_command_line_replaces() {
        for (concern, replaced, used) in [
            (Concern::View, "--camera-at 1,2,3 --look-at 0,0,0", Some("--camera-at 1,2,3 --fov 30")),
            (Concern::Animations, "", Some("--frames 1-2 -o a.#.exr")),
            (Concern::Environment, "--environment 1,1,1", Some("")),
        ] {
            let scene = Scene::from(SceneContents {
                notices: vec!["first".into(), "second".into()],
                concerns: vec![(1, concern)],
                ..SceneContents::default()
            });
            let said = |line: &str| refused(line, &scene).unwrap();
            assert!(said(replaced).contains("first") && !said(replaced).contains("second"), "{concern:?}");
            if let Some(line) = used {
                assert!(said(line).contains("second"), "{concern:?}");
            }
        }
    }
}
