//! Part of a picture as the output of a render, and the commands that render the other parts.

use std::path::{Path, PathBuf};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::parts::{Part, PartHead};

use crate::arguments::{PictureFormat, PictureOutput};
use crate::failure::Failure;
use crate::picture_files::needless_part;
use crate::shell;

/// Checks that a render with `--part` has one output, a part file, and that any other render has no part
/// file.
pub(super) fn check(part: Option<Part>, pictures: &[PictureOutput]) -> Result<(), Failure> {
    let are_parts = pictures.iter().any(|picture| picture.format == PictureFormat::Part);
    match part {
        Some(part) if pictures.len() > 1 || !are_parts => Err(refusal(
            format!("the part {part} of a picture is written to one file OUT.part"),
            "give -o a name that ends in .part; photoncard merge writes the picture of all parts",
        )),
        None if are_parts => Err(needless_part()),
        _ => Ok(()),
    }
}

fn refusal(text: String, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Arguments of this process, without the program's name.
pub(super) fn arguments() -> Vec<String> {
    std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned()).collect()
}

/// Returns the command that renders `part`, from the arguments in the header of another part of the picture.
pub(crate) fn command(head: &PartHead, part: Part) -> String {
    shell::command(with_part(head, part))
}

/// Returns the arguments in a part's header, changed to render `part`: of the header's frame alone, if it has
/// one.
fn with_part(head: &PartHead, part: Part) -> Vec<String> {
    let frame = head.settings.get("frame").map(ToString::to_string);
    let changed = |option: &str, value: &str| match option {
        "--part" => part.to_string(),
        "--frames" => frame.clone().unwrap_or(value.to_owned()),
        _ => name_of(Path::new(value), head.part, part).to_string_lossy().into_owned(),
    };
    let mut words = Vec::new();
    let mut given = head.command.iter();
    while let Some(word) = given.next() {
        let whole = ["--part=", "--frames=", "--output=", "-o"];
        let option = whole.into_iter().find(|option| word.starts_with(option) && word.len() > option.len());
        words.push(match option {
            Some(option) => {
                format!("{option}{}", changed(option.trim_end_matches('='), &word[option.len()..]))
            }
            None => word.clone(),
        });
        if ["--part", "--frames", "--output", "-o"].contains(&&**word) {
            words.extend(given.next().map(|value| changed(word, value)));
        }
    }
    words
}

/// Path of the file of part `other`, derived from that of `part`. In the name, the last number that equals
/// `part` is replaced, with as many digits. Without such a number, `other` is inserted before the suffix.
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
    use photoncard_driver::film::{Film, SumFormat, Window};
    use photoncard_driver::layer::Layers;

    use super::*;

    #[test]
    fn the_command_of_a_part_differs_from_that_of_another_by_names() {
        let film = Film::new(1, 1, Window::full(1, 1), SumFormat::ONE).unwrap();
        let head = |frame: Option<u32>, line: &str| {
            let settings = frame.map(|frame| ("frame".to_owned(), frame.into())).into_iter().collect();
            let command = line.split(' ').map(str::to_owned).collect();
            PartHead::new(Part::new(1, 8).unwrap(), &film, settings, &Layers::default(), None, command)
        };
        for (frame, given, expected) in [
            (
                None,
                "render a.gltf --part 1/8 --spp 4 -o a.1.part -q",
                "render a.gltf --part 2/8 --spp 4 -o a.2.part -q",
            ),
            (None, "render --output=1.part --part=1/8", "render --output=2.part --part=2/8"),
            (Some(7), "render --frames 1-9 -o##.1.part", "render --frames 7 -o##.2.part"),
        ] {
            let words = with_part(&head(frame, given), Part::new(2, 8).unwrap());
            assert_eq!(words.join(" "), expected);
        }
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
