//! Tests that stuffing and checksums agree with independent implementations.

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::{Checksum, ImageChecksum, checksum, image_checksum};
use photoncard_shared::stuffing::{max_stuffed_bytes, stuff, unstuff};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

/// Bytes with runs of non-zero bytes shorter and longer than a piece of 254.
fn plain() -> impl Strategy<Value = Vec<u8>> {
    let run = (0_u8..4, prop_oneof![0_usize..4, 252_usize..258, 505_usize..512]);
    let runs = vec(run, 0..6).prop_map(|runs| runs.iter().flat_map(|&(b, n)| vec![b; n]).collect());
    prop_oneof![runs, vec(any::<u8>(), 0..600), vec(0_u8..2, 0..600)]
}

/// Splits bytes into two parts at any position.
fn cut(bytes: &[u8], at: Index) -> [&[u8]; 2] {
    bytes.split_at(at.index(bytes.len() + 1)).into()
}

fn stuffed(parts: [&[u8]; 2]) -> Vec<u8> {
    let mut wire = heapless::Vec::<u8, 4096>::new();
    assert!(stuff(&parts, &mut wire));
    wire.to_vec()
}

proptest! {
    #[test]
    fn stuffing_agrees_with_the_cobs_crate(plain in plain(), at: Index) {
        let mut expected = vec![0; cobs::max_encoding_length(plain.len())];
        let length = cobs::encode(&plain, &mut expected);
        expected.truncate(length);
        let mut wire = stuffed(cut(&plain, at));
        prop_assert_eq!(&wire, &expected);
        prop_assert!(wire.len() <= max_stuffed_bytes(plain.len()) && !wire.contains(&0));
        prop_assert_eq!(unstuff(&mut wire), Some(&mut plain.clone()[..]));
    }

    #[test]
    fn invalid_cobs_is_refused(wire in vec(prop_oneof![1_u8..8, 1_u8..=255], 1..600)) {
        let mut expected = wire.clone();
        let length = cobs::decode_in_place(&mut expected).ok();
        let mut unstuffed = wire.clone();
        let unstuffed = unstuff(&mut unstuffed).map(|plain| plain.to_vec());
        prop_assert_eq!(unstuffed, length.map(|length| expected[..length].to_vec()));
    }

    #[test]
    fn stuffing_without_room_is_refused(plain in plain(), at: Index) {
        let mut wire = heapless::Vec::<u8, 300>::new();
        let fits = 6 + stuffed(cut(&plain, at)).len() <= 300;
        let before = b"before";
        prop_assert!(wire.extend_from_slice(before).is_ok());
        prop_assert_eq!(stuff(&cut(&plain, at), &mut wire), fits);
        prop_assert!(fits || wire == before[..]);
    }

    #[test]
    fn unstuffing_arbitrary_bytes_does_not_panic(mut wire in vec(any::<u8>(), 0..600)) {
        let _ = unstuff(&mut wire);
    }

    #[test]
    fn the_image_checksum_agrees_with_the_crc_crate(bytes in vec(any::<u8>(), 0..10 * LINE_BYTES), cut in 0_usize..10) {
        let lines: Vec<Line> = bytes.as_chunks().0.iter().map(|&line| Line(line)).collect();
        let whole = &bytes[..lines.len() * LINE_BYTES];
        let expected = crc::Crc::<u64>::new(&crc::CRC_64_XZ).checksum(whole);
        prop_assert_eq!(image_checksum(&lines), expected);
        let mut sum = ImageChecksum::default();
        let (first, rest) = lines.split_at(cut.min(lines.len()));
        sum.update(first);
        sum.update(rest);
        prop_assert_eq!(sum.value(), expected);
    }

    #[test]
    fn the_frame_checksum_agrees_with_the_crc_crate(bytes in vec(any::<u8>(), 0..600), cuts in vec(1_usize..40, 1..40)) {
        let expected = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&bytes);
        prop_assert_eq!(checksum(&bytes), expected);
        let (mut sum, mut rest) = (Checksum::default(), &bytes[..]);
        for cut in cuts {
            let (piece, behind) = rest.split_at(cut.min(rest.len()));
            sum.update(piece);
            rest = behind;
        }
        sum.update(rest);
        prop_assert_eq!(sum.value(), expected);
    }
}

/// The frame checksum cannot detect an error that is a multiple of its own polynomial.
#[test]
fn the_image_checksum_detects_an_error_that_the_frame_checksum_misses() {
    // The polynomial of CRC-32C has 33 bits. The lowest bit of a byte, the first on the link, is the highest
    // coefficient.
    let multiple = 1 | u64::from(0x82f6_3b78_u32) << 1;
    let (sound, mut damaged) = (Line([0x5a; LINE_BYTES]), Line([0x5a; LINE_BYTES]));
    for (byte, error) in damaged.0[50..].iter_mut().zip(multiple.to_le_bytes()) {
        *byte ^= error;
    }
    assert_ne!(sound, damaged);
    assert_eq!(checksum(&sound.0), checksum(&damaged.0));
    assert_ne!(image_checksum(&[sound]), image_checksum(&[damaged]));
}
