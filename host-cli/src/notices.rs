//! Notices on a scene: what is ignored or missing in it, and what is taken in another way than it is stated.

use std::path::Path;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::scene::Scene;

use crate::console::say;
use crate::failure::Failure;

/// Maximum number of notices of a kind that are printed, besides their number.
const NAMED: usize = 3;

/// Prints what is ignored or missing; with `is_strict` it is an error.
///
/// # Errors
/// If anything is ignored or missing, and `is_strict` is true.
pub(crate) fn say_ignored(path: &Path, scene: &Scene, is_strict: bool) -> Result<(), Failure> {
    let Some(line) = first(path, &scene.notices) else { return Ok(()) };
    if !is_strict {
        say(format_args!("photoncard: ignored: {line}"));
        return Ok(());
    }
    let report = MietteDiagnostic::new(format!("--strict: {}", scene.notices.join("; ")));
    let help = "mend the scene, or render it without --strict, which leaves this out";
    Err(Failure::Input(Report::new(report.with_help(help))))
}

/// Prints what is taken in another way than it is stated.
pub(crate) fn say_remarks(path: &Path, scene: &Scene) {
    if let Some(line) = first(path, &scene.remarks) {
        say(format_args!("photoncard: note: {line}"));
    }
}

/// The first sentences, and the number of the others.
fn first(path: &Path, sentences: &[String]) -> Option<String> {
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
    use super::*;

    #[test]
    fn the_first_sentences_are_named_and_the_others_counted() {
        let line = |count: usize| {
            let sentences: Vec<String> = (0..count).map(|index| format!("n{index}")).collect();
            first(Path::new("a.glb"), &sentences)
        };
        assert_eq!(line(0), None);
        assert_eq!(line(3).as_deref(), Some("n0; n1; n2"));
        assert_eq!(line(5).as_deref(), Some("n0; n1; n2; and 2 more, see photoncard scene info a.glb"));
    }

    #[test]
    fn what_is_ignored_is_an_error_of_a_strict_render() {
        let scene = Scene { notices: vec!["n0".into(); 5], remarks: vec!["r".into()], ..Scene::default() };
        let Err(failure) = say_ignored(Path::new("a.glb"), &scene, true) else { panic!("no error") };
        assert_eq!(failure.line().matches("n0").count(), 5);
        assert!(say_ignored(Path::new("a.glb"), &scene, false).is_ok());
        assert!(say_ignored(Path::new("a.glb"), &Scene { notices: Vec::new(), ..scene }, true).is_ok());
    }
}
