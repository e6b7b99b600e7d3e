//! Edits of PNG chunks with correct lengths and checksums, so that decoders read the chunks.

use super::{Random, mutation};

/// Signature of PNG.
pub const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Type and data of a PNG chunk.
pub type Chunk = ([u8; 4], Vec<u8>);

/// Types of chunks that decoders interpret.
const TYPES: [&[u8; 4]; 9] =
    [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"gAMA", b"iCCP", b"acTL", b"fcTL"];

/// Makes one edit of a PNG: of the data of a chunk, or of the list of chunks. Bytes behind the last chunk are
/// lost.
pub fn edit_chunks(file: &mut Vec<u8>, random: &mut Random) {
    let mut chunks = split(file);
    if chunks.is_empty() {
        return;
    }
    let place = random.below(chunks.len());
    match random.below(12) {
        0 => drop(chunks.remove(place)),
        1 => chunks.insert(place, chunks[random.below(chunks.len())].clone()),
        2 => chunks.swap(place, 0),
        3 => chunks[place].0 = **random.pick(&TYPES),
        4 => {
            let length = random.below(800);
            let data = (0..length).map(|_| random.next() as u8).collect();
            chunks.insert(place, (**random.pick(&TYPES), data));
        }
        5 => {
            let length = random.below(800);
            chunks[place].1.resize(length, random.next() as u8);
        }
        _ => mutation::edit_bytes(&mut chunks[place].1, &[], random),
    }
    *file = join(&chunks);
}

/// Corrects the checksums of all chunks, and nothing else.
pub fn mend_checksums(file: &mut [u8]) {
    let mut at = MAGIC.len();
    while let Some(length) = file.get(at..).and_then(|rest| rest.first_chunk::<4>()) {
        let end = at.saturating_add(8).saturating_add(u32::from_be_bytes(*length) as usize);
        let Some(sum) = file.get(at + 4..end).map(checksum) else { return };
        let Some(stored) = file.get_mut(end..end.saturating_add(4)) else { return };
        stored.copy_from_slice(&sum);
        at = end + 4;
    }
}

/// Chunks of a file, as far as it has complete lengths and types.
pub fn split(file: &[u8]) -> Vec<Chunk> {
    let mut rest = file.get(MAGIC.len()..).unwrap_or_default();
    let mut chunks = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk() {
        let Some((kind, after)) = after.split_first_chunk() else { break };
        let length = (u32::from_be_bytes(*length) as usize).min(after.len());
        chunks.push((*kind, after[..length].to_vec()));
        rest = after.get(length + 4..).unwrap_or_default();
    }
    chunks
}

/// A file of chunks, with their checksums.
pub fn join(chunks: &[Chunk]) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    for (kind, data) in chunks {
        let body = [&kind[..], data].concat();
        file.extend((data.len() as u32).to_be_bytes());
        file.extend(&body);
        file.extend(checksum(&body));
    }
    file
}

/// CRC-32 of a chunk's type and data (PNG, annex D).
fn checksum(bytes: &[u8]) -> [u8; 4] {
    let sum = bytes.iter().fold(u32::MAX, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ ((sum & 1) * 0xedb8_8320))
    });
    (!sum).to_be_bytes()
}
