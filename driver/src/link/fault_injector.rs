//! A bad line: bytes are damaged, lost, repeated, held back and cut into pieces as a seed decides.

use std::collections::VecDeque;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use photoncard_firmware::sampler::hash;
use photoncard_shared::link::{Port, PortError};

/// What a line does to bytes: the rate of each fault, 0 to 0.1 a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineFaults {
    /// One bit is another.
    pub flips: f64,
    /// The byte is lost.
    pub drops: f64,
    /// The byte comes twice.
    pub repeats: f64,
    /// What comes is held back for some reads; a rate a read.
    pub delays: f64,
    /// What random numbers depend on.
    pub seed: u32,
}

/// A line on which every fault is likelier destroys every frame.
const MOST: f64 = 0.1;

impl FromStr for LineFaults {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut faults = Self::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or_else(|| {
                format!("{part:?} is no fault of a line; use flips=, drops=, repeats=, delays= or seed=")
            })?;
            if name == "seed" {
                faults.seed =
                    value.parse().map_err(|_| format!("{value:?} is no seed; use a whole number"))?;
                continue;
            }
            let rate = match name {
                "flips" => &mut faults.flips,
                "drops" => &mut faults.drops,
                "repeats" => &mut faults.repeats,
                "delays" => &mut faults.delays,
                _ => {
                    return Err(format!(
                        "{name:?} is no fault of a line; use flips, drops, repeats, delays or seed"
                    ));
                }
            };
            let found = value.parse().ok().filter(|rate| (0.0..=MOST).contains(rate));
            *rate =
                found.ok_or_else(|| format!("{value:?} is no rate of {name}; use 0 to {MOST}, as 1e-5"))?;
        }
        Ok(faults)
    }
}

impl fmt::Display for LineFaults {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { flips, drops, repeats, delays, seed } = self;
        write!(f, "flips={flips},drops={drops},repeats={repeats},delays={delays},seed={seed}")
    }
}

/// Makes a port a bad one, in both directions.
pub struct FaultInjector {
    faults: LineFaults,
    random: u32,
    incoming: VecDeque<u8>,
    outgoing: VecDeque<u8>,
    /// Reads for which what comes is still held back.
    held: u32,
}

/// Bytes that move at once at the most.
const PIECE: usize = 600;
/// Reads that a delay lasts at the most.
const LONGEST_DELAY: u32 = 20;

impl FaultInjector {
    /// Faults of the line to card `index`: those of each card are others.
    pub fn new(faults: LineFaults, index: usize) -> Self {
        let random = hash(faults.seed) ^ hash(index as u32 + 1);
        Self { faults, random, incoming: VecDeque::new(), outgoing: VecDeque::new(), held: 0 }
    }

    fn random(&mut self) -> u32 {
        self.random = self.random.wrapping_add(0x9e37_79b9);
        hash(self.random)
    }

    fn happens(&mut self, rate: f64) -> bool {
        rate > 0.0 && f64::from(self.random()) < rate * 4_294_967_296.0
    }

    /// What of some bytes comes out of the line.
    fn pass(&mut self, bytes: &[u8]) -> Vec<u8> {
        let LineFaults { flips, drops, repeats, .. } = self.faults;
        let mut passed = Vec::with_capacity(bytes.len());
        for &byte in bytes {
            if self.happens(drops) {
                continue;
            }
            let byte = if self.happens(flips) { byte ^ 1 << (self.random() % 8) } else { byte };
            passed.push(byte);
            if self.happens(repeats) {
                passed.push(byte);
            }
        }
        passed
    }

    fn piece(&mut self, most: usize) -> usize {
        (1 + self.random() as usize % PIECE).min(most)
    }

    /// Reads from a port as [`Port::read`] does.
    ///
    /// # Errors
    /// As the port's.
    pub fn read(
        &mut self,
        port: &mut dyn Port,
        buffer: &mut [u8],
        wait: Duration,
    ) -> Result<usize, PortError> {
        if self.held == 0 && self.happens(self.faults.delays) {
            self.held = 1 + self.random() % LONGEST_DELAY;
        }
        if self.incoming.is_empty() {
            let mut bytes = [0; PIECE];
            let count = port.read(&mut bytes, wait)?;
            let passed = self.pass(&bytes[..count]);
            self.incoming.extend(passed);
        }
        if self.held > 0 {
            self.held -= 1;
            return Ok(0);
        }
        let count = self.piece(buffer.len()).min(self.incoming.len());
        for (target, byte) in buffer.iter_mut().zip(self.incoming.drain(..count)) {
            *target = byte;
        }
        Ok(count)
    }

    /// Writes to a port as [`Port::write`] does.
    ///
    /// # Errors
    /// As the port's.
    pub fn write(&mut self, port: &mut dyn Port, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let mut taken = 0;
        if self.outgoing.is_empty() {
            taken = self.piece(bytes.len());
            let passed = self.pass(&bytes[..taken]);
            self.outgoing.extend(passed);
        }
        let sent = port.write(self.outgoing.make_contiguous(), wait)?;
        self.outgoing.drain(..sent);
        Ok(taken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::loopback;

    const SOON: Duration = Duration::from_millis(1);

    fn through(faults: LineFaults, bytes: &[u8]) -> Vec<u8> {
        let (mut near, mut far) = loopback(1 << 20);
        let mut injector = FaultInjector::new(faults, 0);
        let mut sent = 0;
        while sent < bytes.len() {
            sent += injector.write(&mut near, &bytes[sent..], SOON).unwrap();
        }
        let mut buffer = vec![0; 1 << 20];
        let count = far.read(&mut buffer, SOON).unwrap();
        buffer.truncate(count);
        buffer
    }

    #[test]
    fn a_good_line_changes_nothing_and_a_bad_one_as_much_as_it_says() {
        let bytes: Vec<u8> = (0..200_000_u32).map(|index| hash(index) as u8).collect();
        assert!(through(LineFaults::default(), &bytes) == bytes);
        let lost = through("drops=0.01".parse().unwrap(), &bytes).len();
        assert!((197_700..198_300).contains(&lost), "{lost}");
        let repeated = through("repeats=0.01,seed=5".parse().unwrap(), &bytes).len();
        assert!((201_700..202_300).contains(&repeated), "{repeated}");
        let flipped = through("flips=0.01".parse().unwrap(), &bytes);
        let bits: u32 = flipped.iter().zip(&bytes).map(|(a, b)| (a ^ b).count_ones()).sum();
        assert!((1_700..2_300).contains(&bits), "{bits}");
    }

    #[test]
    fn a_delay_holds_bytes_back_and_loses_none() {
        let (mut near, mut far) = loopback(100);
        let mut injector = FaultInjector::new("delays=0.1,seed=1".parse().unwrap(), 3);
        let (mut next, mut empty) = (0, 0);
        for byte in 0..200_u8 {
            near.write(&[byte], SOON).unwrap();
            let mut buffer = [0; 8];
            let count = injector.read(&mut far, &mut buffer, Duration::ZERO).unwrap();
            empty += u32::from(count == 0);
            for &found in &buffer[..count] {
                assert_eq!(found, next);
                next += 1;
            }
        }
        assert!(empty > 20 && next > 20, "{empty} {next}");
    }

    #[test]
    fn faults_are_told_in_words() {
        let faults: LineFaults = "flips=1e-5,drops=0.1,seed=7".parse().unwrap();
        assert_eq!(faults, LineFaults { flips: 1e-5, drops: 0.1, seed: 7, ..LineFaults::default() });
        assert_eq!(faults.to_string().parse(), Ok(faults));
        for text in ["", "flips", "flips=2", "flips=-1", "flips=nan", "seed=x", "cuts=0"] {
            assert!(text.parse::<LineFaults>().unwrap_err().contains("use "), "{text}");
        }
    }
}
