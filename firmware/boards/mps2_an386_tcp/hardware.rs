//! The board with its Ethernet controller as the link (Arm, "AN386", DAI 0386).

use cortex_m_rt::exception;
use photoncard_shared::link::Port;

use crate::common::once::Once;
use crate::common::{Board, semihosting};
use crate::lan9118::{self, Lan9118};
use crate::processor;
use crate::tcp::{self, Network, TcpPort};

/// Number of the Ethernet controller's interrupt.
const ETHERNET: i16 = 13;

/// Addresses of QEMU's network for its user (QEMU, "Network emulation"), in which the card has the address
/// that ports of the machine are forwarded to.
const NETWORK: Network = Network { address: [10, 0, 2, 15], prefix: 24, gateway: [10, 0, 2, 2], port: 7000 };

static CONTROLLER: Once<Lan9118> = Once::new(Lan9118::new());

/// Arm's MPS2 board with the FPGA image AN386, on a network.
pub(crate) struct Mps2An386Tcp;

pub(crate) type ThisBoard = Mps2An386Tcp;

impl Board for Mps2An386Tcp {
    const NAME: &'static str = "mps2-an386-tcp";
    const LINK_BYTES: usize = Lan9118::STATIC_BYTES + tcp::STATIC_BYTES;

    fn start() {
        processor::start_clock();
        if lan9118::start().is_err() {
            semihosting::fail(format_args!("the Ethernet controller does not answer\n"));
        }
        processor::enable_interrupt(ETHERNET);
    }

    fn port() -> impl Port {
        let port = CONTROLLER.take().and_then(|nic| TcpPort::<Self, _>::new(nic, &NETWORK));
        let Some(port) = port else { semihosting::fail(format_args!("the network is already in use\n")) };
        port
    }

    fn milliseconds() -> u32 {
        processor::milliseconds()
    }

    fn masked<R>(work: impl FnOnce() -> R) -> R {
        processor::masked(work)
    }

    fn sleep() {
        processor::sleep();
    }
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    match number {
        ETHERNET => lan9118::silence(),
        _ => semihosting::fail(format_args!("interrupt {number}, which nobody asked for\n")),
    }
}
