//! What a card says, as it says it or altered: lies that a card's memory or its maker may tell.

use photoncard_firmware::sampler::hash;
use photoncard_shared::frame::{Frame, FrameReader, MAX_FRAME, MAX_PAYLOAD, write_frame};
use photoncard_shared::message::{self, PIXEL_BYTES, Reply};

use crate::line::Random;

/// A lie about a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Lie {
    /// A number of a pixel's record has a value that is not possible.
    Impossible { number: usize, value: f32 },
    /// Red is brighter by a factor.
    Brighter(f32),
}

impl Lie {
    /// A lie that shows in the pixel itself.
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
                // A dark pixel would be as dark.
                (0, (red + 1e-3) * factor)
            }
        };
        pixel[word(number)].copy_from_slice(&value.to_le_bytes());
    }
}

/// A card's voice: reads the frames that it sends, and sends them on.
pub(crate) struct Voice {
    reader: FrameReader,
    /// What it lies, and about which share of the tiles: one of so many.
    pub(crate) lie: Option<(Lie, u32)>,
    /// Bytes of whole frames that are to be sent.
    pub(crate) said: Vec<u8>,
    /// Tiles that it has said to be done, from the oldest.
    pub(crate) done: Vec<u32>,
}

impl Voice {
    pub(crate) fn new() -> Self {
        Self { reader: FrameReader::new(), lie: None, said: Vec::new(), done: Vec::new() }
    }

    /// Whether it lies about a tile.
    fn lies_about(&self, tile: u32) -> Option<Lie> {
        self.lie.filter(|(_, one_of)| hash(tile).is_multiple_of(*one_of)).map(|(lie, _)| lie)
    }

    /// Takes what the card sends.
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
