use proptest::prelude::{Just, ProptestConfig, any, prop_oneof, proptest};
use proptest::strategy::Strategy;

use super::*;

fn layout(mode: Mode, filter: Filter, count: usize, stride: usize) -> Layout {
    Layout { count, stride, mode, filter }
}

/// Decodes the example in the extension's text: a group of 4-bit differences in the first lane of sixteen
/// elements of four bytes.
#[test]
fn the_example_of_the_specification_is_decoded() {
    let group = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
    let differences = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0_i8];
    let mut stream = vec![0xa0, 2];
    stream.extend(group);
    // Three lanes without differences, and the baseline at the end of the tail.
    stream.extend([0, 0, 0]);
    stream.extend([0; 28]);
    stream.extend([100, 7, 8, 9]);
    let decoded = decode(&stream, &layout(Mode::Attributes, Filter::None, 16, 4)).unwrap();
    let mut first = 100_u8;
    for (element, difference) in decoded.chunks(4).zip(differences) {
        first = first.wrapping_add_signed(difference);
        assert_eq!(element, [first, 7, 8, 9]);
    }
}

#[test]
fn integers_of_variable_length_are_those_of_the_specification() {
    // Zigzag codes on the first baseline: `4 d` for a difference `d >= 0`, `-4 d - 2` for `d < 0`.
    let stream = [0xd1, 0x04, 0x84, 0x08, 0x06, 0, 0, 0, 0];
    let indices = decode(&stream, &layout(Mode::Indices, Filter::None, 3, 2)).unwrap();
    assert_eq!(indices, [1, 0, 2, 1, 0, 1]);
}

#[test]
fn layouts_that_the_extension_does_not_allow_are_refused() {
    let refused = [
        layout(Mode::Attributes, Filter::None, 1, 3),
        layout(Mode::Attributes, Filter::None, 1, 0),
        layout(Mode::Attributes, Filter::None, 1, 260),
        layout(Mode::Attributes, Filter::Octahedral, 1, 12),
        layout(Mode::Attributes, Filter::Quaternion, 1, 4),
        layout(Mode::Attributes, Filter::Color, 1, 12),
        layout(Mode::Triangles, Filter::None, 4, 2),
        layout(Mode::Triangles, Filter::Exponential, 3, 4),
        layout(Mode::Indices, Filter::None, 1, 8),
    ];
    for layout in refused {
        assert!(matches!(layout.bytes(), Err(Fault::Invalid(_))), "{layout:?}");
    }
}

#[test]
fn sizes_that_no_stream_of_the_length_has_are_refused() {
    for count in [1 << 20, usize::MAX / 4, usize::MAX] {
        let Err(Fault::Invalid(reason)) =
            decode(&[0xa1; 100], &layout(Mode::Attributes, Filter::None, count, 4))
        else {
            panic!("{count} elements were decoded")
        };
        assert!(reason.contains("do not fit into a stream of 100"), "{reason}");
    }
}

/// Decodes a stream whose control bytes each say that 256 elements are equal.
#[test]
fn the_stream_of_maximum_expansion_is_decoded() {
    const BLOCKS: usize = 100;
    let stream = [&[0xa1][..], &[0xaa; BLOCKS], &[0; 19], &[1, 2, 3, 4, 0]].concat();
    let decoded = decode(&stream, &layout(Mode::Attributes, Filter::None, 256 * BLOCKS, 4)).unwrap();
    assert!(decoded.as_chunks().0.iter().all(|element| *element == [1, 2, 3, 4]));
}

#[test]
fn octahedra_quaternions_and_exponents_become_numbers() {
    let mut vectors = [0, 0, 127, 5, 127, 0, 127, 6, 0, 0, 0, 7];
    filter::apply(Filter::Octahedral, 4, &mut vectors);
    assert_eq!(vectors[..8], [0, 0, 127, 5, 127, 0, 0, 6]);
    let mut floats = [3_i32, (2 << 24) | 3, (-1 << 24) | 0xff_fffd].map(i32::to_le_bytes).concat();
    filter::apply(Filter::Exponential, 4, &mut floats);
    assert_eq!(floats, [3.0_f32, 12.0, -1.5].map(f32::to_le_bytes).concat());
    // The largest component is the third; the others are 0.
    let mut quaternion = [0_i16, 0, 0, 0x7ffe].map(i16::to_le_bytes).concat();
    filter::apply(Filter::Quaternion, 8, &mut quaternion);
    assert_eq!(quaternion, [0_i16, 0, 32_767, 0].map(i16::to_le_bytes).concat());
    let mut white = [127, 0, 0, 127];
    filter::apply(Filter::Color, 4, &mut white);
    assert_eq!(white, [255; 4]);
}

fn modes() -> impl Strategy<Value = (Mode, u8)> {
    prop_oneof![
        Just((Mode::Attributes, 0xa0)),
        Just((Mode::Attributes, 0xa1)),
        Just((Mode::Triangles, 0xe1)),
        Just((Mode::Indices, 0xd1)),
    ]
}

fn filters() -> impl Strategy<Value = Filter> {
    prop_oneof![
        Just(Filter::None),
        Just(Filter::Octahedral),
        Just(Filter::Quaternion),
        Just(Filter::Exponential),
        Just(Filter::Color),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_stream_panics(
        (mode, header) in modes(),
        filter in filters(),
        count in 0_usize..600,
        words in 1_usize..6,
        rest in proptest::collection::vec(any::<u8>(), 0..800),
    ) {
        let stream = [&[header][..], &rest].concat();
        let stride = if mode == Mode::Attributes { 4 * words } else { 2 * (words % 2 + 1) };
        let filter = if mode == Mode::Attributes { filter } else { Filter::None };
        let layout = layout(mode, filter, count / 3 * 3, stride);
        if let Ok(decoded) = decode(&stream, &layout) {
            assert_eq!(decoded.len() as u64, layout.bytes().unwrap());
        }
    }
}
