//! Falsified output of a card, as by bad memory or altered firmware.

use photoncard_firmware::sampler::hash;
use photoncard_shared::frame::{Frame, FrameReader, MAX_FRAME, MAX_PAYLOAD, write_frame};
use photoncard_shared::message::{self, PIXEL_BYTES, Reply};

use crate::line::Random;

/// Falsification of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Lie {
    /// An impossible value of one number in a pixel's record.
    Impossible { number: usize, value: f32 },
    /// Red multiplied by a factor.
    Brighter(f32),
}

impl Lie {
    /// Falsification that the pixel itself reveals.
    pub(crate) fn impossible(random: &mut Random) -> Self {
        const LIES: [(usize, f32); 10] = [
            (0, f32::NAN),
            (1, f32::INFINITY),
            (2, -1e-6),
            (3, 1.000_001),
            (4, -0.5),
            (5, f32::NAN),
            (6, 1.001),
            (8, f32::NEG_INFINITY),
            (9, f32::NAN),
            (9, -1.0),
        ];
        let (number, value) = LIES[random.below(LIES.len())];
        Self::Impossible { number, value }
    }

    fn apply(self, pixel: &mut [u8]) {
        let word = |number: usize| 4 * number..4 * number + 4;
        let (number, value) = match self {
            Self::Impossible { number, value } => (number, value),
            Self::Brighter(factor) => {
                let red = f32::from_le_bytes(pixel[word(0)].try_into().unwrap());
                // A factor would not change a black pixel.
                (0, (red + 1e-3) * factor)
            }
        };
        pixel[word(number)].copy_from_slice(&value.to_le_bytes());
    }
}

/// Filter of a card's output, which parses its frames and forwards them.
pub(crate) struct Voice {
    reader: FrameReader,
    /// Falsification, and the share of tiles concerned: one of this number.
    pub(crate) lie: Option<(Lie, u32)>,
    /// Bytes of whole frames to be sent.
    pub(crate) said: Vec<u8>,
    /// Tiles reported as done, the oldest first.
    pub(crate) done: Vec<u32>,
}

impl Voice {
    pub(crate) fn new() -> Self {
        Self { reader: FrameReader::new(), lie: None, said: Vec::new(), done: Vec::new() }
    }

    /// Falsification of a tile, if any.
    fn lies_about(&self, tile: u32) -> Option<Lie> {
        self.lie.filter(|(_, one_of)| hash(tile).is_multiple_of(*one_of)).map(|(lie, _)| lie)
    }

    /// Processes bytes that the card sends.
    pub(crate) fn hear(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (taken, frame) = self.reader.read(bytes);
            bytes = &bytes[taken..];
            let Some(Ok(Frame { header, payload })) = frame else { continue };
            let mut payload = payload.to_vec();
            let mut altered = vec![0; MAX_PAYLOAD];
            match message::decode::<Reply>(&payload) {
                Some(Reply::TileDone { tile, .. }) => self.done.push(tile),
                Some(Reply::Pixels { tile, first, data }) => {
                    if let Some(lie) = self.lies_about(tile) {
                        let mut data = data.to_vec();
                        lie.apply(&mut data[..PIXEL_BYTES]);
                        let reply = Reply::Pixels { tile, first, data: &data };
                        let length = message::encode(&reply, &mut altered).unwrap();
                        altered.truncate(length);
                        payload = altered;
                    }
                }
                _ => {}
            }
            let mut wire = heapless::Vec::<u8, MAX_FRAME>::new();
            write_frame(&header, &payload, &mut wire);
            self.said.extend(wire);
        }
    }
}
