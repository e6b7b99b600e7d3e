//! Mutated PNG files, by which decoders are fuzzed.

use photoncard_tests::fuzz::Random;
use photoncard_tests::fuzz::png::{edit_chunks, join, mend_checksums, split};

const FILE: &[u8] = include_bytes!("../../../driver/scene/tests/it/images/palette.png");

#[test]
fn a_file_is_its_chunks() {
    let chunks = split(FILE);
    let types: Vec<_> = chunks.iter().map(|(kind, _)| kind).collect();
    assert_eq!(types, [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"]);
    assert_eq!(join(&chunks), FILE);
    let mut damaged = FILE.to_vec();
    damaged[30] ^= 1;
    mend_checksums(&mut damaged);
    assert_eq!(damaged, FILE);
}

/// Checks that edits include palettes whose length is no multiple of three, for which a decoder has panicked.
#[test]
fn palettes_of_odd_lengths_are_reached() {
    let odd = |number| {
        let mut file = FILE.to_vec();
        edit_chunks(&mut file, &mut Random::new("palettes", 0, number));
        split(&file).iter().any(|(kind, data)| kind == b"PLTE" && data.len() % 3 != 0)
    };
    assert!((0..1000).filter(|number| odd(*number)).count() > 10);
}
