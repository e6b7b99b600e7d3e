//! A part of a picture as the output of a render, and the command that makes another one.

use std::path::{Path, PathBuf};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::parts::{Part, PartHead};

use crate::arguments::{PictureFormat, PictureOutput};
use crate::failure::Failure;
use crate::shell;

/// Checks that a part is written exactly if one is rendered.
pub(super) fn check(part: Option<Part>, pictures: &[PictureOutput]) -> Result<(), Failure> {
    let are_parts = pictures.iter().any(|picture| picture.format == PictureFormat::Part);
    match part {
        Some(part) if pictures.len() > 1 || !are_parts => Err(refusal(
            format!("the part {part} of a picture is written to one file OUT.part"),
            "give -o a name that ends in .part; photoncard merge writes the picture of all parts",
        )),
        None if are_parts => Err(needless()),
        _ => Ok(()),
    }
}

/// Error of a part's file without a part.
pub(crate) fn needless() -> Failure {
    refusal(
        "a file OUT.part is a part of a picture".to_owned(),
        "give --part K/N to photoncard render, or -o a name that ends in .exr or .png",
    )
}

fn refusal(text: String, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Arguments of this process without the part and its file.
pub(super) fn arguments() -> Vec<String> {
    let given = std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned());
    without_part(given)
}

fn without_part(mut given: impl Iterator<Item = String>) -> Vec<String> {
    let mut kept = Vec::new();
    while let Some(argument) = given.next() {
        match &*argument {
            "--part" | "-o" | "--output" => drop(given.next()),
            _ if ["--part=", "--output=", "-o"].iter().any(|option| argument.starts_with(option)) => {}
            _ => kept.push(argument),
        }
    }
    kept
}

/// Command that makes another part, by the head and the path of one that is there.
pub(crate) fn command(head: &PartHead, path: &Path, part: Part) -> String {
    let name = name_of(path, head.part, part).to_string_lossy().into_owned();
    let own = ["--part".to_owned(), part.to_string(), "-o".to_owned(), name];
    shell::command(head.command.iter().cloned().chain(own))
}

/// Path of another part: the last number of the name that is the part's is replaced, with the zeros before it; without one the number
/// goes before the ending.
fn name_of(path: &Path, part: Part, other: Part) -> PathBuf {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut pieces: Vec<String> = Vec::new();
    for character in name.chars() {
        let is_digit = character.is_ascii_digit();
        match pieces.last_mut().filter(|piece| piece.ends_with(|c: char| c.is_ascii_digit()) == is_digit) {
            Some(piece) => piece.push(character),
            None => pieces.push(character.into()),
        }
    }
    let is_part = |piece: &&mut String| piece.parse() == Ok(part.number());
    match pieces.iter_mut().rev().find(is_part) {
        Some(number) => *number = format!("{:0width$}", other.number(), width = number.len()),
        None => pieces.push(format!(".{}", other.number())),
    }
    path.with_file_name(pieces.concat() + ".part")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_of_a_part_is_that_of_another_with_other_names() {
        let given = "render a.gltf --part 1/8 --spp 4 -o a.part --output=b -oc --quiet".split(' ');
        let kept = without_part(given.map(str::to_owned));
        assert_eq!(kept, ["render", "a.gltf", "--spp", "4", "--quiet"]);
        let [part, other] = [3, 12].map(|number| Part::new(number, 16).unwrap());
        for (name, expected) in [
            ("a.3.part", "a.12.part"),
            ("d/frame 0003.003.part", "d/frame 0003.012.part"),
            ("3/a.part", "3/a.12.part"),
            ("a.33.part", "a.33.12.part"),
            ("part3of16.part", "part12of16.part"),
        ] {
            assert_eq!(name_of(Path::new(name), part, other), Path::new(expected));
        }
    }
}
