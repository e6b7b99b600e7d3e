//! Simulates a bad line: pseudo-random numbers decide which bytes are damaged, lost, repeated, delayed or
//! split into pieces.
//!
//! The faults of a byte depend on the seed, its direction and its position among all bytes of its direction.
//! They do not depend on time or on the sizes of reads and writes.

use std::collections::VecDeque;
use std::fmt;
use std::str::FromStr;
use std::time::{Duration, Instant};

use photoncard_shared::hash::hash;
use photoncard_shared::link::{Port, PortError};

/// Probabilities of faults per byte of a line, 0 to 0.1 each, and the seed that selects the bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineFaults {
    /// Probability that one bit of a byte is inverted, 0 to 0.1.
    pub flips: f64,
    /// Probability that a byte is lost, 0 to 0.1.
    pub drops: f64,
    /// Probability that a byte arrives twice, 0 to 0.1.
    pub repeats: f64,
    /// Probability that a byte towards the host is delayed, 0 to 0.1. A delay of 1 to 20 ms holds the byte
    /// and all later ones back.
    pub delays: f64,
    /// Seed of the random numbers.
    pub seed: u32,
}

/// Maximum probability of a fault per byte. At a higher one hardly any frame would arrive intact.
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

/// Injector of faults into the bytes that are read from and written to a port.
pub struct FaultInjector {
    faults: LineFaults,
    incoming: Direction,
    outgoing: Direction,
    /// Time until which incoming bytes are held back.
    held: Instant,
}

struct Direction {
    /// Key of the direction's pseudo-random numbers.
    key: u32,
    /// Number of bytes that have entered the line, modulo 2^32.
    position: u32,
    bytes: VecDeque<Passing>,
}

/// Byte in the line, with its faults applied.
#[derive(Clone, Copy)]
struct Passing {
    byte: u8,
    /// Time for which the byte is held back.
    delay: Duration,
}

/// Purpose of a pseudo-random number. Each purpose has its own sequence.
#[derive(Clone, Copy)]
enum Kind {
    Flip,
    Bit,
    Drop,
    Repeat,
    Delay,
    DelayTime,
    Piece,
}

/// Maximum number of bytes per read or write.
const PIECE: usize = 600;
/// Maximum delay, milliseconds.
const LONGEST_DELAY: u32 = 20;

impl Direction {
    fn new(key: u32) -> Self {
        Self { key, position: 0, bytes: VecDeque::new() }
    }

    /// Pseudo-random number for the next byte. The period is 2^32 bytes.
    fn random(&self, kind: Kind) -> u32 {
        hash(hash(self.position) ^ hash(self.key ^ hash(kind as u32 + 1)))
    }

    fn happens(&self, kind: Kind, rate: f64) -> bool {
        f64::from(self.random(kind)) < rate * 4_294_967_296.0
    }

    /// Appends bytes to the line, with their faults applied.
    fn pass(&mut self, bytes: &[u8], faults: &LineFaults) {
        for &byte in bytes {
            let is_delayed = self.happens(Kind::Delay, faults.delays);
            let delay = if is_delayed { 1 + self.random(Kind::DelayTime) % LONGEST_DELAY } else { 0 };
            let is_flipped = self.happens(Kind::Flip, faults.flips);
            let byte = if is_flipped { byte ^ 1 << (self.random(Kind::Bit) % 8) } else { byte };
            let passing = Passing { byte, delay: Duration::from_millis(delay.into()) };
            let copies = usize::from(!self.happens(Kind::Drop, faults.drops))
                * (1 + usize::from(self.happens(Kind::Repeat, faults.repeats)));
            self.bytes.extend(std::iter::repeat_n(passing, copies));
            self.position = self.position.wrapping_add(1);
        }
    }

    /// Pseudo-random number of bytes for the next read or write, at most `most`.
    fn piece(&self, most: usize) -> usize {
        (1 + self.random(Kind::Piece) as usize % PIECE).min(most)
    }
}

impl FaultInjector {
    /// Creates the injector for the line to card `index`. Lines of different cards have different faults.
    pub fn new(faults: LineFaults, index: usize) -> Self {
        let key = hash(faults.seed) ^ hash(index as u32 + 1);
        let [incoming, outgoing] = [1, 2].map(|direction| Direction::new(hash(key ^ hash(direction))));
        Self { faults, incoming, outgoing, held: Instant::now() }
    }

    /// Reads from a port as [`Port::read`] does, with the line's faults.
    ///
    /// # Errors
    /// As for the port.
    pub fn read(
        &mut self,
        port: &mut dyn Port,
        buffer: &mut [u8],
        wait: Duration,
    ) -> Result<usize, PortError> {
        // The caller may not write again for long, so pending outgoing bytes are sent here. The read below
        // reports a closed port as well.
        let _ = self.flush(port, Duration::ZERO);
        if self.incoming.bytes.is_empty() {
            let mut bytes = [0; PIECE];
            let most = self.incoming.piece(PIECE);
            let count = port.read(&mut bytes[..most], wait)?;
            self.incoming.pass(&bytes[..count], &self.faults);
        }
        let left = self.held.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            std::thread::sleep(left.min(wait));
        }
        Ok(self.release(buffer))
    }

    /// Copies to `buffer` the incoming bytes that are no longer held back. Returns their number.
    fn release(&mut self, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        while let (Some(target), Some(next)) = (buffer.get_mut(count), self.incoming.bytes.front_mut()) {
            let now = Instant::now();
            if !next.delay.is_zero() {
                self.held = self.held.max(now) + std::mem::take(&mut next.delay);
            }
            if self.held > now {
                break;
            }
            *target = next.byte;
            self.incoming.bytes.pop_front();
            count += 1;
        }
        count
    }

    /// Writes to a port as [`Port::write`] does, with the line's faults.
    ///
    /// # Errors
    /// As for the port.
    pub fn write(&mut self, port: &mut dyn Port, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let mut taken = 0;
        if self.outgoing.bytes.is_empty() {
            taken = self.outgoing.piece(bytes.len());
            self.outgoing.pass(&bytes[..taken], &self.faults);
        }
        self.flush(port, wait)?;
        Ok(taken)
    }

    /// Writes the pending outgoing bytes to the port.
    fn flush(&mut self, port: &mut dyn Port, wait: Duration) -> Result<(), PortError> {
        if self.outgoing.bytes.is_empty() {
            return Ok(());
        }
        let bytes: Vec<u8> = self.outgoing.bytes.iter().map(|passing| passing.byte).collect();
        let sent = port.write(&bytes, wait)?;
        self.outgoing.bytes.drain(..sent);
        Ok(())
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
    fn faults_occur_at_their_rates_and_none_without_them() {
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
    fn faults_depend_on_the_position_of_the_byte_alone() {
        let faults: LineFaults = "flips=0.05,drops=0.05,repeats=0.05,delays=0.001,seed=3".parse().unwrap();
        let bytes: Vec<u8> = (0..10_000_u32).map(|index| hash(index) as u8).collect();
        let read = |step: usize, answers: usize| {
            let (mut near, mut far) = loopback(1 << 20);
            let mut injector = FaultInjector::new(faults, 0);
            let mut passed = Vec::<u8>::new();
            for piece in bytes.chunks(step) {
                far.write(piece, SOON).unwrap();
                // Traffic in the other direction has no influence.
                injector.write(&mut near, &bytes[..answers], SOON).unwrap();
                let mut buffer = [0; 700];
                let count = injector.read(&mut near, &mut buffer, Duration::ZERO).unwrap();
                passed.extend(&buffer[..count]);
            }
            drop(far);
            let mut buffer = [0; 700];
            // The link reports its end after all bytes have arrived.
            while let Ok(count) = injector.read(&mut near, &mut buffer, SOON) {
                passed.extend(&buffer[..count]);
            }
            passed
        };
        let expected = read(10_000, 0);
        assert!(expected != bytes);
        assert!(read(1, 3) == expected && read(77, 0) == expected);
        let written = through(faults, &bytes);
        assert!(written != expected, "both directions have the same faults");
    }

    #[test]
    fn a_delay_holds_bytes_back_and_loses_none() {
        let (mut near, mut far) = loopback(1000);
        let mut injector = FaultInjector::new("delays=0.1,seed=1".parse().unwrap(), 3);
        let bytes: Vec<u8> = (0..200).collect();
        near.write(&bytes, SOON).unwrap();
        let (mut passed, mut reads) = (Vec::<u8>::new(), 0);
        let begin = Instant::now();
        while passed.len() < bytes.len() {
            let mut buffer = [0; 300];
            let count = injector.read(&mut far, &mut buffer, Duration::from_secs(1)).unwrap();
            passed.extend(&buffer[..count]);
            reads += 1;
        }
        assert!(passed == bytes);
        // About twenty delays of ten milliseconds, and no reads without bytes.
        assert!(begin.elapsed() > Duration::from_millis(60), "{:?}", begin.elapsed());
        assert!((5..100).contains(&reads), "{reads}");
    }

    #[test]
    fn accepted_bytes_move_on_while_the_host_only_reads() {
        let (mut near, mut far) = loopback(4);
        let mut injector = FaultInjector::new(LineFaults::default(), 0);
        let taken = injector.write(&mut near, b"twelve bytes", SOON).unwrap();
        let mut passed = Vec::<u8>::new();
        for _ in 0..taken {
            let mut buffer = [0; 8];
            let count = far.read(&mut buffer, SOON).unwrap();
            passed.extend(&buffer[..count]);
            assert_eq!(injector.read(&mut near, &mut buffer, Duration::ZERO), Ok(0));
        }
        assert!(taken > 4 && passed == b"twelve bytes"[..taken]);
    }

    #[test]
    fn fault_rates_are_parsed_and_formatted() {
        let faults: LineFaults = "flips=1e-5,drops=0.1,seed=7".parse().unwrap();
        assert_eq!(faults, LineFaults { flips: 1e-5, drops: 0.1, seed: 7, ..LineFaults::default() });
        assert_eq!(faults.to_string().parse(), Ok(faults));
        for text in ["", "flips", "flips=2", "flips=-1", "flips=nan", "seed=x", "cuts=0"] {
            assert!(text.parse::<LineFaults>().unwrap_err().contains("use "), "{text}");
        }
    }
}
