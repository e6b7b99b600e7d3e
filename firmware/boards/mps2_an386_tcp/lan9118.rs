//! Driver of the Ethernet controller LAN9118 (SMSC, "LAN9118", revision 1.5), which is a LAN9220 on the
//! physical board: frames are moved by the processor, word by word. Section 3.12 of the data sheet describes
//! sending, section 3.13 receiving, chapter 5 the registers.
//!
//! After a reset the PHY negotiates rate and duplex by itself; the driver takes full duplex for granted,
//! which any switch offers.

use smoltcp::phy::{self, Device, DeviceCapabilities, Medium};
use smoltcp::time::Instant;

use crate::common::register::Register;
use crate::tcp::Nic;

/// Address of the controller ("AN386", DAI 0386, memory map).
const BASE: usize = 0x4020_0000;

// SAFETY: registers of the controller, by the data sheet.
const RX_DATA: Register<u32> = unsafe { Register::at(BASE) };
const TX_DATA: Register<u32> = unsafe { Register::at(BASE + 0x20) };
const RX_STATUS: Register<u32> = unsafe { Register::at(BASE + 0x40) };
const IRQ_CFG: Register<u32> = unsafe { Register::at(BASE + 0x54) };
const INT_STS: Register<u32> = unsafe { Register::at(BASE + 0x58) };
const INT_EN: Register<u32> = unsafe { Register::at(BASE + 0x5C) };
const BYTE_TEST: Register<u32> = unsafe { Register::at(BASE + 0x64) };
const FIFO_INT: Register<u32> = unsafe { Register::at(BASE + 0x68) };
const TX_CFG: Register<u32> = unsafe { Register::at(BASE + 0x70) };
const HW_CFG: Register<u32> = unsafe { Register::at(BASE + 0x74) };
const RX_FIFO_INF: Register<u32> = unsafe { Register::at(BASE + 0x7C) };
const TX_FIFO_INF: Register<u32> = unsafe { Register::at(BASE + 0x80) };
const FREE_RUN: Register<u32> = unsafe { Register::at(BASE + 0x9C) };
const MAC_CSR_CMD: Register<u32> = unsafe { Register::at(BASE + 0xA4) };
const MAC_CSR_DATA: Register<u32> = unsafe { Register::at(BASE + 0xA8) };
const E2P_CMD: Register<u32> = unsafe { Register::at(BASE + 0xB0) };

/// Value of [`BYTE_TEST`] once the controller is awake.
const BYTE_ORDER: u32 = 0x8765_4321;
/// `HW_CFG`: reset of the controller.
const RESET: u32 = 1;
/// `HW_CFG`: whole frames are sent, and 5 of the 16 KB of FIFOs are for sending. 10,560 bytes are then for
/// received frames.
const STORE_AND_FORWARD: u32 = 1 << 20 | 5 << 16;
/// `TX_CFG`: sends, also if nobody reads how earlier frames were sent.
const TX_ON: u32 = 1 << 2 | 1 << 1;
/// `IRQ_CFG`: the interrupt's pin is enabled, active high, and driven both ways.
const IRQ_PIN: u32 = 1 << 8 | 1 << 4 | 1;
/// `INT_EN`, `INT_STS`: more frames have arrived than [`FIFO_INT`] states, which is 0.
const RECEIVED: u32 = 1 << 3;
/// `E2P_CMD`, `MAC_CSR_CMD`: the command is being carried out.
const IS_BUSY: u32 = 1 << 31;
/// `MAC_CSR_CMD`: reads the register of the MAC.
const MAC_READ: u32 = 1 << 30;
/// Registers of the MAC: control, and the high and low bytes of the address.
const MAC_CR: u32 = 1;
const ADDRESS_HIGH: u32 = 2;
const ADDRESS_LOW: u32 = 3;
/// `MAC_CR`: full duplex, transmitter and receiver on.
const MAC_ON: u32 = 1 << 20 | 1 << 3 | 1 << 2;
/// TX command A: first and last segment of a frame.
const WHOLE_FRAME: u32 = 1 << 13 | 1 << 12;
/// RX status: the frame is damaged.
const IS_DAMAGED: u32 = 1 << 15;

/// Maximum length of a frame without its checksum, bytes.
const FRAME_BYTES: usize = 1514;
/// Length of the checksum, bytes.
const CHECKSUM_BYTES: usize = 4;
/// Room for a frame and its checksum, in whole words.
const BUFFER_BYTES: usize = (FRAME_BYTES + CHECKSUM_BYTES).next_multiple_of(4);
/// Bytes that a frame takes in the FIFO, at most: its commands, and whole words.
const SENDING_BYTES: u32 = BUFFER_BYTES as u32 + 8;

/// Address if the controller has none: one of those that are administered locally.
const LOCAL_ADDRESS: [u8; 6] = [0x02, 0, 0, 0, 0, 1];

/// Reads of a register before the controller counts as dead: far more than a reset takes.
const PATIENCE: u32 = 10_000_000;

/// The controller, with a frame in each direction.
pub(crate) struct Lan9118 {
    received: [u8; BUFFER_BYTES],
    sending: [u8; BUFFER_BYTES],
}

/// Reset or start that did not end.
#[derive(Debug)]
pub(crate) struct NoController;

/// Waits until `is_done`.
fn wait_until(is_done: impl Fn() -> bool) -> Result<(), NoController> {
    (0..PATIENCE).any(|_| is_done()).then_some(()).ok_or(NoController)
}

fn read_mac(register: u32) -> Result<u32, NoController> {
    MAC_CSR_CMD.write(IS_BUSY | MAC_READ | register);
    wait_until(|| MAC_CSR_CMD.read() & IS_BUSY == 0)?;
    Ok(MAC_CSR_DATA.read())
}

fn write_mac(register: u32, value: u32) -> Result<(), NoController> {
    MAC_CSR_DATA.write(value);
    MAC_CSR_CMD.write(IS_BUSY | register);
    wait_until(|| MAC_CSR_CMD.read() & IS_BUSY == 0)
}

/// Resets the controller, and starts it without interrupts.
pub(crate) fn start() -> Result<(), NoController> {
    wait_until(|| BYTE_TEST.read() == BYTE_ORDER)?;
    HW_CFG.write(RESET);
    wait_until(|| HW_CFG.read() & RESET == 0)?;
    // The controller loads its address from the EEPROM.
    wait_until(|| E2P_CMD.read() & IS_BUSY == 0)?;
    HW_CFG.write(STORE_AND_FORWARD);
    INT_EN.write(0);
    INT_STS.write(u32::MAX);
    FIFO_INT.write(0);
    IRQ_CFG.write(IRQ_PIN);
    TX_CFG.write(TX_ON);
    write_mac(MAC_CR, MAC_ON)
}

/// Disables the interrupt of received frames, until [`Nic::listen`] enables it. The handler calls it, because
/// frames stay in the controller, whose interrupt stays pending.
pub(crate) fn silence() {
    INT_EN.write(0);
}

impl Lan9118 {
    /// On-chip memory of the frames, bytes.
    pub(crate) const STATIC_BYTES: usize = size_of::<Self>();

    pub(crate) const fn new() -> Self {
        Self { received: [0; BUFFER_BYTES], sending: [0; BUFFER_BYTES] }
    }

    fn has_room() -> bool {
        TX_FIFO_INF.read() & 0xFFFF >= SENDING_BYTES
    }

    /// Takes the oldest received frame from the controller, and returns its length without the checksum;
    /// `None` if it is damaged or too long.
    fn take_frame(&mut self) -> Option<usize> {
        let status = RX_STATUS.read();
        let bytes = (status >> 16 & 0x3FFF) as usize;
        let mut targets = self.received.as_chunks_mut().0.iter_mut();
        for _ in 0..bytes.div_ceil(4) {
            let word = RX_DATA.read();
            if let Some(target) = targets.next() {
                *target = word.to_le_bytes();
            }
        }
        let length = bytes.saturating_sub(CHECKSUM_BYTES);
        (status & IS_DAMAGED == 0 && length <= FRAME_BYTES).then_some(length)
    }
}

impl Nic for Lan9118 {
    fn address(&self) -> [u8; 6] {
        let (Ok(low), Ok(high)) = (read_mac(ADDRESS_LOW), read_mac(ADDRESS_HIGH)) else {
            return LOCAL_ADDRESS;
        };
        let ([a, b, c, d], [e, f, ..]) = (low.to_le_bytes(), high.to_le_bytes());
        // A group's address, as that of all ones without an EEPROM, is not one of a controller.
        if a & 1 == 0 && [a, b, c, d, e, f] != [0; 6] {
            return [a, b, c, d, e, f];
        }
        let [a, b, c, d, e, f] = LOCAL_ADDRESS;
        // A controller that does not answer now receives nothing either.
        let _ = write_mac(ADDRESS_LOW, u32::from_le_bytes([a, b, c, d]));
        let _ = write_mac(ADDRESS_HIGH, u32::from_le_bytes([e, f, 0, 0]));
        LOCAL_ADDRESS
    }

    fn seed(&self) -> u32 {
        FREE_RUN.read()
    }

    fn has_frame(&self) -> bool {
        RX_FIFO_INF.read() >> 16 & 0xFF != 0
    }

    fn listen(&self) {
        INT_STS.write(RECEIVED);
        INT_EN.write(RECEIVED);
    }
}

/// Received frame.
pub(crate) struct Received<'a>(&'a [u8]);

impl phy::RxToken for Received<'_> {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, read: F) -> R {
        read(self.0)
    }
}

/// Room of a frame to be sent, which the controller has room for.
pub(crate) struct Sending<'a>(&'a mut [u8; BUFFER_BYTES]);

impl phy::TxToken for Sending<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, write: F) -> R {
        let length = length.min(FRAME_BYTES);
        let result = write(self.0.get_mut(..length).unwrap_or(&mut []));
        TX_DATA.write(WHOLE_FRAME | length as u32);
        TX_DATA.write(length as u32);
        for &word in self.0.as_chunks().0.iter().take(length.div_ceil(4)) {
            TX_DATA.write(u32::from_le_bytes(word));
        }
        result
    }
}

impl Device for Lan9118 {
    type RxToken<'a> = Received<'a>;
    type TxToken<'a> = Sending<'a>;

    fn receive(&mut self, _: Instant) -> Option<(Received<'_>, Sending<'_>)> {
        if !self.has_frame() || !Self::has_room() {
            return None;
        }
        let length = self.take_frame()?;
        Some((Received(self.received.get(..length)?), Sending(&mut self.sending)))
    }

    fn transmit(&mut self, _: Instant) -> Option<Sending<'_>> {
        Self::has_room().then_some(Sending(&mut self.sending))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = FRAME_BYTES;
        capabilities
    }
}
