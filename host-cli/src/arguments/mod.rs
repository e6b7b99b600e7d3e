//! Command-line arguments of all commands.

mod autonomy;
mod bake;
mod cards;
mod choice;
mod distance;
mod farm;
mod files;
mod frames;
mod host;
mod integrator;
mod lights;
#[cfg(feature = "study")]
mod machine;
mod measure;
mod merge;
mod mix;
mod outputs;
mod page;
mod photons;
mod picture;
mod prepare;
mod prepared;
mod progress;
mod render;
mod samples;
mod scene;
mod schedule;
mod sensors;
#[cfg(feature = "study")]
mod study;
#[cfg(feature = "study")]
mod study_output;
mod suggestions;
#[cfg(feature = "study")]
mod sweep;
mod tone;
mod tonemap;
mod view;
mod without_effect;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::{Args, CommandFactory as _, Parser, Subcommand};
use clap_complete::Shell;
use photoncard_driver::link::ListenAddress;
use photoncard_driver::printable::printable;
use photoncard_driver::render::CardAddress;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::PROTOCOL_VERSION;

pub(crate) use self::autonomy::AutonomyOptions;
pub(crate) use self::bake::BakeOptions;
use self::cards::{ChipOption, memory_size};
pub(crate) use self::farm::{Engine, FarmCommand, FarmOptions};
pub(crate) use self::files::{PictureFormat, PictureOutput, TextOutput};
pub(crate) use self::frames::{FrameOptions, last_numbered, numbered};
pub(crate) use self::host::HostOptions;
pub(crate) use self::lights::LightOptions;
pub(crate) use self::measure::{MeasureOptions, PointOptions, UnitOptions};
pub(crate) use self::merge::MergeOptions;
pub(crate) use self::mix::MixOptions;
pub(crate) use self::outputs::OutputOptions;
pub(crate) use self::page::PageOptions;
pub(crate) use self::prepare::PrepareOptions;
pub(crate) use self::prepared::Step;
pub(crate) use self::progress::ProgressForm;
pub(crate) use self::render::{RenderOptions, Unfitted};
pub(crate) use self::scene::SceneOptions;
#[cfg(feature = "study")]
pub(crate) use self::study::{StudyArguments, StudyCommand, StudyMergeArguments};
#[cfg(feature = "study")]
pub(crate) use self::study_output::StudyOutput;
#[cfg(feature = "study")]
pub(crate) use self::sweep::{CACHE, CHIP, SweepArguments};
pub(crate) use self::tonemap::TonemapOptions;
pub(crate) use self::view::ViewOptions;

/// Global illumination by photon mapping on small rendering chips.
#[derive(Parser)]
#[command(version, long_version = VERSION.as_str(), about, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Text of `--version`: the versions of the program, of the protocol and of the card image's memory layout;
/// the operating system and architecture; and the kinds of links to cards in this build.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let links = if cfg!(unix) { "serial, tcp, unix, pty" } else { "serial, tcp" };
    format!(
        "{}\nprotocol {PROTOCOL_VERSION}, card image layout {LAYOUT_VERSION}\n{} {}, links: {links}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH,
    )
});

impl Command {
    /// Returns the form in which the command reports progress and failure.
    pub(crate) fn progress(&self) -> ProgressForm {
        match self {
            Self::Render(options) => options.host.progress,
            Self::Prepare(options) => options.host.progress,
            Self::Measure(options) => options.host.progress,
            Self::Bake(options) => options.host.progress,
            Self::Merge(options) => options.progress,
            Self::View(options) => options.host.progress,
            _ => ProgressForm::Text,
        }
    }
}

impl Arguments {
    /// Parses the arguments of the process. If they are invalid, prints a message with unprintable characters
    /// escaped, and ends the process.
    pub(crate) fn parse_printably() -> Self {
        let given = of_scene_alone(std::env::args_os().collect());
        Self::try_parse_from(&given).unwrap_or_else(|error| {
            let escaped = given.iter().map(|argument| printable(&argument.to_string_lossy()).into_owned());
            let escaped: Vec<_> = escaped.collect();
            let error = Self::try_parse_from(&escaped).err().unwrap_or(error);
            let error = suggestions::with_suggestion(prepared::with_remedy(error), Self::command(), &escaped);
            if error.use_stderr() && progress::state_json(&escaped) {
                progress::say_json(&error);
                std::process::exit(error.exit_code());
            }
            error.exit()
        })
    }
}

/// Inserts `view --open` before the first argument if this is a glTF file.
fn of_scene_alone(mut given: Vec<OsString>) -> Vec<OsString> {
    let is_scene = |word: &OsString| {
        let ending = Path::new(word).extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        matches!(ending.as_deref(), Some("gltf" | "glb"))
    };
    if given.get(1).is_some_and(is_scene) {
        given.splice(1..1, ["view".into(), "--open".into()]);
    }
    given
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Render a glTF scene to a picture, EXR or PNG
    Render(Box<RenderOptions>),
    /// Prepare a scene: write its card image, with photon map and settings, for photoncard render --prepared
    Prepare(Box<PrepareOptions>),
    /// Measure irradiance and illuminance at points, direct and indirect, with standard errors
    Measure(Box<MeasureOptions>),
    /// Print the daylight autonomy: the share of points with enough light in enough hours, by a table an hour
    Autonomy(AutonomyOptions),
    /// Bake lightmaps: write a glb of the scene whose textures hold its light, for viewers without lights
    #[command(mut_arg("spp", |spp| spp.default_value("4")))]
    #[command(mut_arg("gather_rays", |rays| rays.default_value("48")))]
    Bake(Box<BakeOptions>),
    /// Merge the parts of a picture, which renders with --part have written, to an EXR or a PNG
    Merge(MergeOptions),
    /// Print a render job for the engine of a render farm: preparation, parts, merge
    #[command(subcommand)]
    Farm(FarmCommand),
    /// Walk through a scene: a page in the browser shows the scene while it is rendered
    #[command(mut_arg("size", |size| {
        let help = "Width and height of the picture, pixels [default: those of the page's window]";
        size.help(help).long_help(help)
    }))]
    View(Box<ViewOptions>),
    /// Write a page that renders in the browser, without a server: files for any web host
    Page(PageOptions),
    /// Mix the light groups of a picture anew, without a render
    Mix(MixOptions),
    /// Tone-map an EXR picture to a PNG, as a render does
    Tonemap(TonemapOptions),
    /// Print information on a scene
    #[command(subcommand)]
    Scene(SceneCommand),
    /// Query or test a card, or list serial ports
    #[command(subcommand)]
    Card(CardCommand),
    /// Serve an emulated card, or many cards as one, to other processes, until interrupted
    Emulate(EmulateOptions),
    /// Compare a picture with a reference
    Diff(DiffOptions),
    /// Print the completion script for a shell: source it, or save it where the shell looks for completions
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Write a manual page for each command, for the program man
    Man {
        /// Folder for the pages; it is made if it is missing
        folder: PathBuf,
    },
    /// Measure how memory traffic and time depend on orders, caches, techniques and chips
    #[cfg(feature = "study")]
    Study(StudyArguments),
    /// Measure how memory traffic and time depend on orders, caches, techniques and chips: this program was
    /// built without this command
    #[cfg(not(feature = "study"))]
    Study {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
        words: Vec<OsString>,
    },
}

#[derive(Subcommand)]
pub(crate) enum SceneCommand {
    /// Print the contents of a scene, and those that are ignored
    Info {
        /// A glTF 2.0 file, .gltf or .glb
        scene: PathBuf,
        /// Print the contents as JSON
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        lights: LightOptions,
    },
}

#[derive(Subcommand)]
pub(crate) enum CardCommand {
    /// List the serial ports of this machine: path, USB name, serial number, and the address for --card
    List,
    /// Print the limits of a card
    Info {
        #[arg(long, default_value_t, help = format!("The card: {}", CardAddress::forms()))]
        card: CardAddress,
    },
    /// Greet a card repeatedly, and print the time until each answer
    Ping {
        #[arg(long, default_value_t, help = format!("The card: {}", CardAddress::forms()))]
        card: CardAddress,
        /// Number of greetings
        #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..))]
        count: u16,
    },
    /// Test the arithmetic and the whole memory of a card, which overwrites its scene; exit status 1 if a
    /// test fails
    Selftest {
        #[arg(long, default_value_t, help = format!("The card: {}", CardAddress::forms()))]
        card: CardAddress,
        /// Print no progress
        #[arg(long)]
        quiet: bool,
    },
}

#[derive(Args)]
pub(crate) struct EmulateOptions {
    /// Address to listen on: pty, tcp:PORT on this machine alone, tcp:ADDRESS:PORT or unix:PATH; port 0 for
    /// any free port
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) listen: ListenAddress,
    #[command(flatten)]
    pub(crate) card: ChipOption,
    /// Memory of each emulated card, in bytes or with the suffix K, M or G [default: that of its kind]
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) card_memory: Option<u64>,
    #[arg(
        long = "relay",
        value_name = "CARD",
        conflicts_with = "model",
        help_heading = "Cards",
        help = format!(
            "Appear as one card, and be the host of this card, which may itself be a relay: {}; may be repeated",
            CardAddress::forms()
        )
    )]
    pub(crate) relay: Vec<CardAddress>,
}

#[derive(Args)]
pub(crate) struct DiffOptions {
    /// The reference picture
    pub(crate) reference: PathBuf,
    /// The picture to compare
    pub(crate) image: PathBuf,
    /// Side of the blocks whose means are compared, pixels
    #[arg(long, default_value_t = 16, allow_negative_numbers = true)]
    pub(crate) block: usize,
    /// Leave out blocks in which the reference exceeds this radiance: those that see an emitter
    #[arg(long, value_name = "RADIANCE", allow_negative_numbers = true)]
    pub(crate) exclude_above: Option<f32>,
}

#[cfg(test)]
mod tests {
    use photoncard_driver::render::{RenderSettings, Setting};

    use super::*;

    #[test]
    fn a_scene_without_a_command_is_viewed() {
        for (line, expected) in [
            ("photoncard a.glb", "photoncard view --open a.glb"),
            ("photoncard b/a.GLTF --quality draft", "photoncard view --open b/a.GLTF --quality draft"),
            ("photoncard render a.glb", "photoncard render a.glb"),
            ("photoncard a.png", "photoncard a.png"),
            ("photoncard", "photoncard"),
        ] {
            let words = of_scene_alone(line.split(' ').map(OsString::from).collect());
            assert_eq!(words.join(" ".as_ref()), expected);
        }
    }

    fn said(line: &str) -> String {
        let words: Vec<_> = line.split(' ').map(str::to_owned).collect();
        let error = Arguments::try_parse_from(&words).err();
        let suggested = |error| suggestions::with_suggestion(error, Arguments::command(), &words);
        error.map(suggested).map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn options_of_other_renderers_are_answered_with_their_equivalent() {
        for (line, part) in [
            ("photoncard render a.glb --samples 64", "--spp"),
            ("photoncard render a.glb --samples=64", "--spp"),
            ("photoncard render a.glb --width 640", "--size"),
            ("photoncard render a.glb --oidn", "--denoise"),
            ("photoncard render a.glb --gpu", "--card"),
            ("photoncard view a.glb --cores 4", "emulated:N"),
            ("photoncard tonemap a.exr --threads 4 -o b.png", "of photoncard render"),
            ("photoncard prepare a.glb --jobs 4 -o b.card", "--threads N"),
            ("photoncard view a.glb --output a.png", "--help"),
            ("photoncard render a.glb --film-transparent", "render --transparent"),
            ("photoncard render a.glb a.png", "-o a.png"),
        ] {
            let text = said(line);
            assert!(text.contains("unexpected argument") && text.contains(part), "{line}: {text}");
            assert!(!text.contains("a similar argument exists"), "{line}: {text}");
        }
        // Options of this program that are near are still suggested.
        assert!(said("photoncard render a.glb --qualty draft").contains("--quality"));
        assert!(said("photoncard render a.glb b.glb").contains("unexpected argument"));
    }

    /// Command of this name, built so that it knows all its options.
    fn named(name: &str) -> clap::Command {
        let mut command = Arguments::command();
        command.build();
        let words = name.split(' ');
        words.fold(command, |command, word| command.find_subcommand(word).expect(name).clone())
    }

    /// Returns whether `command`, or each of its subcommands, takes `option`: `-o` or `--name`.
    fn takes(command: &clap::Command, option: &str) -> bool {
        let is_it = |argument: &clap::Arg| match option.strip_prefix("--") {
            Some(long) => argument.get_long() == Some(long),
            None => argument.get_short().is_some_and(|short| option == format!("-{short}")),
        };
        let mut others = command.get_subcommands().filter(|command| command.get_name() != "help").peekable();
        command.get_arguments().any(is_it)
            || others.peek().is_some() && others.all(|other| takes(other, option))
    }

    #[test]
    fn remedies_state_options_that_their_commands_have() {
        let mut count = 0;
        for suggestions::Word { remedy, commands, .. } in &suggestions::OF_OTHERS {
            let words = remedy.split([' ', ':', ';', ',']).filter(|word| word.starts_with('-'));
            for (option, command) in
                words.flat_map(|option| suggestions::built(commands).map(move |command| (option, command)))
            {
                assert!(takes(&named(command), option), "{command} has no {option}");
                count += 1;
            }
        }
        assert!(count > 40 && !takes(&named("tonemap"), "--card"));
    }

    #[test]
    fn every_setting_of_a_render_has_an_option() {
        let render = named("render");
        for Setting { field, option, .. } in RenderSettings::default().options() {
            assert!(takes(&render, &format!("--{option}")), "no --{option} states {field}");
        }
    }

    #[test]
    fn the_path_of_a_command_is_found_among_its_arguments() {
        let words = ["photoncard", "card", "--out", "a", "selftest", "b.glb"].map(str::to_owned);
        assert_eq!(suggestions::command_of(Arguments::command(), &words), "card selftest");
        assert_eq!(suggestions::command_of(Arguments::command(), &words[..1]), "");
    }
}
