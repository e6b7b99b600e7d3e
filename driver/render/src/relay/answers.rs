//! One answer to the relay's host from the answers of all cards.

use photoncard_firmware::self_test::arithmetic::compute_bytes;
use photoncard_shared::message::{FrameParameters, OPERAND_BYTES};

/// Command whose answers of all cards are awaited.
#[derive(Clone, Debug)]
pub(super) enum Question {
    /// Checksums of chunks from this one on.
    Checksums(u32),
    /// The check of the card image.
    Image,
    /// The frame that the cards are to accept.
    Frame(FrameParameters),
    /// Operands of the arithmetic self-test.
    Compute(Vec<u8>),
}

/// Returns the checksums on which all cards agree. A chunk on which they do not has a checksum that none of
/// them has, so that the host sends its lines.
pub(super) fn agreed_checksums(answers: &[Vec<u8>]) -> Vec<u8> {
    let Some((first, others)) = answers.split_first() else { return Vec::new() };
    let mut agreed = Vec::with_capacity(first.len());
    for (chunk, checksum) in first.as_chunks::<8>().0.iter().enumerate() {
        let of_chunk = |answer: &Vec<u8>| answer.as_chunks::<8>().0.get(chunk).copied();
        let is_agreed = others.iter().all(|other| of_chunk(other) == Some(*checksum));
        let all = || answers.iter().filter_map(of_chunk).map(u64::from_le_bytes);
        let other = || (0..).find(|&sum| all().all(|of_card| of_card != sum)).unwrap_or(0);
        agreed.extend(if is_agreed { *checksum } else { other().to_le_bytes() });
    }
    agreed
}

/// Right results for operands of the arithmetic self-test.
pub(super) fn right_results(operands: &[u8]) -> Vec<u8> {
    operands.as_chunks::<OPERAND_BYTES>().0.iter().flat_map(compute_bytes).collect()
}

/// Returns the results of all cards: of each word the first wrong one, or else the right one.
pub(super) fn worst_results(right: &[u8], answers: &[Vec<u8>]) -> Vec<u8> {
    let mut worst = Vec::with_capacity(right.len());
    for (index, word) in right.as_chunks::<4>().0.iter().enumerate() {
        let of_word = |answer: &Vec<u8>| answer.as_chunks::<4>().0.get(index).copied();
        let wrong = answers.iter().filter_map(of_word).find(|found| found != word);
        worst.extend(wrong.unwrap_or(*word));
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_is_stated_if_all_cards_have_it_and_no_card_has_another() {
        let of = |sums: [u64; 3]| sums.map(u64::to_le_bytes).concat();
        let answers = [of([7, 1, 9]), of([7, 0, 9]), of([7, 1, 8])];
        assert_eq!(agreed_checksums(&answers), of([7, 2, 0]));
        assert_eq!(agreed_checksums(&answers[..1]), answers[0]);
    }

    #[test]
    fn a_wrong_word_of_any_card_is_stated() {
        let right = right_results(&[0; OPERAND_BYTES]);
        let mut wrong = right.clone();
        wrong[9] ^= 1;
        for answers in [[right.clone(), wrong.clone()], [wrong.clone(), right.clone()]] {
            assert_eq!(worst_results(&right, &answers), wrong);
        }
        assert_eq!(worst_results(&right, std::slice::from_ref(&right)), right);
    }
}
