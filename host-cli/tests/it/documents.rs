//! Help, version, completions and manual pages.

use crate::support::Room;

/// Returns the first long option of each line of `text` that begins with an option, such as `-o, --output`.
fn options(text: &str) -> Vec<&str> {
    let lines = text.lines().map(str::trim_start).filter(|line| line.starts_with('-'));
    lines.filter_map(|line| line.split([' ', ',', '[']).find(|word| word.starts_with("--"))).collect()
}

#[test]
fn short_help_is_a_grouped_part_of_the_long_one() {
    let room = Room::new();
    let [short, long] = ["-h", "--help"].map(|option| room.run(&["render", option]).stdout);
    let all = options(&long);
    assert!(options(&short).iter().all(|option| all.contains(option)), "{short}");
    assert!(2 * options(&short).len() < all.len() + 8 && options(&short).contains(&"--output"), "{short}");
    assert!(short.contains("--help"), "{short}");
    for heading in [
        "Scene",
        "Picture and camera",
        "Photon maps",
        "Rays and samples",
        "Order of the work",
        "Cards",
        "Outputs",
    ] {
        assert!(long.contains(&format!("\n{heading}:\n")), "{heading}: {long}");
    }
    assert!(long.lines().all(|line| line.chars().count() <= 100), "{long}");
}

#[test]
fn the_version_names_what_is_shared_with_cards() {
    let room = Room::new();
    let long = room.run(&["--version"]).stdout;
    let [name, shared, build] = long.lines().collect::<Vec<_>>()[..] else { panic!("{long}") };
    assert_eq!(name, concat!("photoncard ", env!("CARGO_PKG_VERSION")));
    let versions = (photoncard_shared::message::PROTOCOL_VERSION, photoncard_shared::image::LAYOUT_VERSION);
    assert_eq!(shared, format!("protocol {}, card image layout {}", versions.0, versions.1));
    assert!(build.contains(std::env::consts::ARCH) && build.contains("links: serial, tcp"), "{build}");
    assert_eq!(room.run(&["-V"]).stdout, format!("{name}\n"));
}

#[test]
fn every_shell_has_completions_of_every_option() {
    let room = Room::new();
    let help = room.run(&["render", "--help"]).stdout;
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let outcome = room.run(&["completions", shell]);
        assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
        for option in options(&help) {
            assert!(outcome.stdout.contains(option.trim_start_matches('-')), "{shell}: {option}");
        }
    }
    let outcome = room.run(&["completions", "csh"]);
    assert_eq!(outcome.status, Some(2));
    assert!(outcome.stderr.contains("bash"), "{}", outcome.stderr);
}

#[test]
fn every_command_has_a_manual_page_with_its_options() {
    let room = Room::new();
    assert_eq!(room.run(&["man", "share/man1"]).status, Some(0));
    let page = |name: &str| {
        let text = std::fs::read_to_string(room.path("share/man1").join(name)).unwrap();
        text.replace("\\-", "-")
    };
    for name in ["photoncard.1", "photoncard-scene-info.1", "photoncard-card-ping.1", "photoncard-tonemap.1"]
    {
        assert!(page(name).contains(".SH SYNOPSIS"), "{name}");
    }
    let render = page("photoncard-render.1");
    for option in options(&room.run(&["render", "--help"]).stdout) {
        assert!(render.contains(option), "{option}");
    }
    room.write("file", "");
    let outcome = room.run(&["man", "file/below"]);
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains("file/below") && outcome.stderr.contains("choose another folder"),
        "{}",
        outcome.stderr
    );
}
