//! Commands in documents exist in the program. The documents are README.md and others at the top, docs/*.md,
//! and the README.md of scenes and tests.
//!
//! The info string of a fenced block states its kind:
//!
//! | info string | contents | test |
//! |---|---|---|
//! | `sh` | commands | run, as one script in an empty folder with the scenes; renders are reduced (`prelude.sh`) |
//! | `sh slow` | commands that build, or take minutes | accepted: options and values are parsed, scripts and crates exist |
//! | `sh network` | commands that take files or programs from elsewhere | accepted |
//! | `sh hardware` | commands that need a board | accepted |
//! | `text synopsis` | forms of commands with placeholders | commands and options exist |
//! | another language | no commands | none |
//!
//! Commands, options, values except placeholders, and paths of the repository in inline code must exist.

mod command_tree;
mod markdown;
mod repository;
mod script;

use command_tree::CommandTree;
use markdown::{Document, Piece};

/// Kind of a fenced block, stated by its info string.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Run,
    Accepted,
    Synopsis,
    Other,
}

impl Kind {
    fn of(info: &str) -> Option<Self> {
        match info.split_whitespace().collect::<Vec<_>>()[..] {
            ["sh"] => Some(Self::Run),
            ["sh", "slow" | "network" | "hardware"] => Some(Self::Accepted),
            ["text", "synopsis"] => Some(Self::Synopsis),
            // Commands have one info string, `sh`, so that none is left unchecked.
            ["sh" | "bash" | "shell" | "console" | "zsh", ..] | [] => None,
            [_] => Some(Self::Other),
            [..] => None,
        }
    }
}

/// Defects of a fenced block that are found without running its commands.
fn defects_of_block(tree: &CommandTree, info: &str, text: &str) -> Vec<String> {
    match Kind::of(info) {
        None => vec![format!(
            "a block is ```sh, ```sh slow, ```sh network, ```sh hardware, ```text synopsis, or of another language such as ```text, \
             not ```{info}"
        )],
        Some(Kind::Run | Kind::Accepted) => script::defects(tree, text),
        Some(Kind::Synopsis) => text.lines().flat_map(|line| tree.defects_of_synopsis(line)).collect(),
        Some(Kind::Other) => {
            let hidden = text
                .lines()
                .filter(|line| line.strip_prefix("photoncard ").is_some_and(|line| tree.is_command(line)));
            hidden.map(|line| format!("`{line}` is a command: ```sh or ```text synopsis")).collect()
        }
    }
}

fn defects(tree: &CommandTree, document: &Document) -> Vec<String> {
    let mut defects = Vec::new();
    for (line, piece) in document.pieces() {
        let found = match piece {
            Piece::Block { info, text } => defects_of_block(tree, &info, &text),
            Piece::Code(text) => script::defects_of_inline_code(tree, &text),
            Piece::Link(target) => document.defect_of_link(&target).into_iter().collect(),
        };
        defects.extend(found.into_iter().map(|defect| format!("{}:{line}: {defect}", document.name)));
    }
    defects
}

#[test]
fn documents_name_existing_commands_options_and_files() {
    let tree = CommandTree::new();
    let documents = markdown::documents();
    assert!(documents.len() > 10, "{} documents are not all", documents.len());
    let defects: Vec<_> = documents.iter().flat_map(|document| defects(&tree, document)).collect();
    assert!(defects.is_empty(), "\n{}", defects.join("\n"));
}

/// Cells of the rows of Markdown tables, without surrounding spaces.
fn rows(text: &str) -> Vec<Vec<&str>> {
    let rows = text.lines().filter_map(|line| line.strip_prefix('|')?.strip_suffix('|'));
    rows.map(|row| row.split('|').map(str::trim).collect()).collect()
}

#[test]
fn the_readme_is_short_and_compares_by_the_figures_of_quality() {
    let documents = markdown::documents();
    let text = |name: &str| documents.iter().find(|document| document.name == name).expect(name).text();
    let readme = text("README.md");
    let words = readme.split_whitespace().count();
    assert!(words <= 900, "README.md has {words} words; 900 is the most");
    let measured = rows(text("docs/quality.md"));
    let (_, table) = readme.split_once("| scene | CPU s |").expect("the table");
    let table = rows(table);
    assert!(table.len() > 5, "{table:?}");
    for row in &table[1..] {
        let of_scene = |cells: &&Vec<&str>| cells.len() == 10 && cells[..2] == [row[0], "`good`"];
        let cells = measured.iter().find(of_scene).unwrap_or_else(|| panic!("{row:?}"));
        assert_eq!(row[1..], [cells[2], cells[3], cells[7], cells[8]], "{}", row[0]);
    }
}

#[test]
fn commands_of_documents_succeed() {
    let mut number = 0;
    for document in markdown::documents() {
        for (line, piece) in document.pieces() {
            let Piece::Block { info, text } = piece else { continue };
            if Kind::of(&info) == Some(Kind::Run) {
                script::run(&text)
                    .unwrap_or_else(|said| panic!("{}:{line}: {said}\nof\n{text}", document.name));
                number += 1;
            }
        }
    }
    assert!(number >= 3, "{number} blocks are not all");
}

#[test]
fn defects_of_a_document_are_found() {
    let tree = CommandTree::new();
    for (text, defect) in [
        ("```\nphotoncard render\n```", "not ```"),
        ("```bash\nphotoncard render\n```", "not ```bash"),
        ("```sh quick\nphotoncard render\n```", "not ```sh quick"),
        ("```text\nphotoncard card list\n```", "```text synopsis"),
        ("```sh slow\nphotoncard render a.gltf --preview b.png\n```", "--preview"),
        ("```sh slow\nphotoncard render a.gltf \\\n    --spp many\n```", "many"),
        ("```sh slow\nphotoncard rander a.gltf\n```", "rander"),
        ("```sh\nphotoncard study everything --out a\n```", "everything"),
        ("```sh hardware\ntests/absent.sh\n```", "tests/absent.sh"),
        ("```sh slow\ntests/Cargo.toml\n```", "not executable"),
        ("```sh slow\ncargo test -p photoncard-tests --test absent\n```", "absent"),
        ("```sh slow\ncargo run -p photoncard-absent\n```", "photoncard-absent"),
        ("```sh slow\ncargo run --release -p photoncard -- render a.gltf --preview\n```", "--preview"),
        ("```sh network\nunheard-of install photoncard\n```", "unheard-of"),
        ("```sh network\npython tests/absent.py\n```", "tests/absent.py"),
        ("```text synopsis\nphotoncard render SCENE [--preview OUT.png]\n```", "--preview"),
        ("```text synopsis\nphotoncard paint SCENE  makes a picture\n```", "paint"),
        ("```text synopsis\nphotoncard tonemap IN.exr  as `--preview` did\n```", "--preview"),
        ("By `--preview OUT.png`.", "--preview"),
        ("By `--order sort|best`.", "best"),
        ("By `photoncard render --preview`.", "--preview"),
        ("By `photoncard scene show`.", "scene show"),
        ("By `render --out DIR`.", "--out"),
        ("By `cargo test -p photoncard-tests --test absent`.", "absent"),
        ("By `tests/peers/absent.sh [SCENE ..]`.", "tests/peers/absent.sh"),
        ("See `driver/src/absent.rs`.", "driver/src/absent.rs"),
        ("See [there](docs/absent.md).", "docs/absent.md"),
    ] {
        let found = defects(&tree, &Document::new("README.md", text));
        assert!(found.len() == 1 && found[0].contains(defect), "{text}: {found:?}");
    }
    let sound = "```sh slow\nexport A=1\n# Slowly.\ncargo run --release -p photoncard -- render scenes/room.glb -o a.exr --spp 2 &\n```\n\
                 `--order naive|sort`, `--fov DEGREES`, `-o`, `tests/ci.sh`, `driver/src/NAME.rs`, [a page](docs/glossary.md)";
    assert_eq!(defects(&tree, &Document::new("README.md", sound)), Vec::<String>::new());
}

#[test]
fn a_command_that_fails_is_found() {
    let failing = script::run("photoncard render scenes/absent.gltf -o a.exr\ntrue").unwrap_err();
    assert!(failing.contains("absent.gltf"), "{failing}");
    let failing = script::run("photoncard render scenes/furnace.gltf -o a.exr\ncmp a.exr b.exr").unwrap_err();
    assert!(failing.contains("b.exr"), "{failing}");
}
