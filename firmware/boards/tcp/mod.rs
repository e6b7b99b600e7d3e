//! A board's Ethernet controller as a port: the card listens on a TCP port, and serves one host after
//! another.
//!
//! The host's commands wait in the controller and in the socket while a tile is rendered. The receive window
//! is what the controller has room for, so that a host overruns neither.

use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::time::Duration;

use photoncard_shared::handover::Handover;
use photoncard_shared::link::{Port, PortError};
use smoltcp::iface::{Config, Interface, PollResult, SocketHandle, SocketSet, SocketStorage};
use smoltcp::phy::Device;
use smoltcp::socket::tcp::{Socket, SocketBuffer, State};
use smoltcp::time::{self, Instant};
use smoltcp::wire::{EthernetAddress, IpCidr, Ipv4Address};

use crate::common::board::Deadline;
use crate::common::once::Once;
use crate::common::{Board, semihosting};

/// Ethernet controller, as a device of `smoltcp`.
pub(crate) trait Nic: Device {
    /// Returns the controller's address.
    fn address(&self) -> [u8; 6];

    /// Returns a number that differs between starts.
    fn seed(&self) -> u32;

    /// Returns whether a received frame waits in the controller.
    fn has_frame(&self) -> bool;

    /// Enables the interrupt of received frames, which ends [`Board::sleep`].
    fn listen(&self);
}

/// Place of a card in a network.
pub(crate) struct Network {
    /// Address of the card.
    pub(crate) address: [u8; 4],
    /// Number of leading bits that all addresses of the network have in common.
    pub(crate) prefix: u8,
    /// Address by which other networks are reached.
    pub(crate) gateway: [u8; 4],
    /// TCP port on which the card listens.
    pub(crate) port: u16,
}

/// Receive window, bytes: six full segments, whose frames fit the controller's 10,560 bytes.
const RECEIVE_BYTES: usize = 8192;
/// Bytes that wait to be sent, or to be acknowledged.
const SEND_BYTES: usize = 4096;
/// Maximum number of frames that are received, and of frames that are sent, before the card goes on.
const FRAMES_AT_ONCE: usize = 16;
/// Time within which a host must send its first whole frame.
const FIRST_FRAME: i64 = 10_000;
/// Interval of the probes of a silent host, and the time after which it counts as gone.
const KEEP_ALIVE: time::Duration = time::Duration::from_secs(10);
const TIMEOUT: time::Duration = time::Duration::from_secs(60);

struct Buffers {
    received: [u8; RECEIVE_BYTES],
    sending: [u8; SEND_BYTES],
    /// Written by [`TcpPort::new`], as an empty storage is not of zeros, and would take flash.
    sockets: MaybeUninit<[SocketStorage<'static>; 1]>,
}

/// On-chip memory of the port, bytes.
pub(crate) const STATIC_BYTES: usize = size_of::<Buffers>();

static BUFFERS: Once<Buffers> = Once::new(Buffers {
    received: [0; RECEIVE_BYTES],
    sending: [0; SEND_BYTES],
    sockets: MaybeUninit::uninit(),
});

/// Port that serves one host after another. To the card it never closes.
///
/// A second host is refused, as no socket listens. A connection that has sent no whole frame within 10 s is
/// closed; after its first frame a host may be silent as long as it answers probes.
pub(crate) struct TcpPort<B, D: 'static> {
    nic: &'static mut D,
    interface: Interface,
    sockets: SocketSet<'static>,
    socket: SocketHandle,
    port: u16,
    handover: Handover,
    /// Time of the last look at the clock, milliseconds since the start.
    now: i64,
    /// Last time at which no host was connected.
    alone: i64,
    /// True if the socket may have something to send.
    is_due: bool,
    board: PhantomData<B>,
}

impl<B: Board, D: Nic> TcpPort<B, D> {
    /// Creates the port of a board; `None` if it was created before.
    pub(crate) fn new(nic: &'static mut D, network: &Network) -> Option<Self> {
        let Buffers { received, sending, sockets } = BUFFERS.take()?;
        let mut config = Config::new(EthernetAddress(nic.address()).into());
        config.random_seed = nic.seed().into();
        let mut interface = Interface::new(config, nic, Instant::ZERO);
        let address = IpCidr::new(Ipv4Address::from(network.address).into(), network.prefix);
        // Both tables have room for one.
        interface.update_ip_addrs(|addresses| _ = addresses.push(address));
        let _ = interface.routes_mut().add_default_ipv4_route(network.gateway.into());
        let mut socket =
            Socket::new(SocketBuffer::new(&mut received[..]), SocketBuffer::new(&mut sending[..]));
        // A host waits for the reply to a small frame.
        socket.set_nagle_enabled(false);
        socket.set_ack_delay(None);
        socket.set_keep_alive(Some(KEEP_ALIVE));
        socket.set_timeout(Some(TIMEOUT));
        let mut sockets = SocketSet::new(&mut sockets.write([SocketStorage::EMPTY])[..]);
        let socket = sockets.add(socket);
        semihosting::print(format_args!("listening on {}, port {}\n", address, network.port));
        let mut port = Self {
            nic,
            interface,
            sockets,
            socket,
            port: network.port,
            handover: Handover::new(),
            now: 0,
            alone: 0,
            is_due: true,
            board: PhantomData,
        };
        port.socket().listen(network.port).ok()?;
        Some(port)
    }

    fn socket(&mut self) -> &mut Socket<'static> {
        self.sockets.get_mut(self.socket)
    }

    /// Returns whether the host has closed the connection, or lost it.
    fn is_left(&mut self) -> bool {
        !matches!(self.socket().state(), State::Listen | State::SynReceived | State::Established)
    }

    /// Moves frames between the controller and the socket. Once a host has left, frames stay in the
    /// controller until the card has read the host's last bytes: the next host may be among them.
    fn poll(&mut self) {
        self.look_at_clock();
        let now = Instant::from_millis(self.now);
        for _ in 0..FRAMES_AT_ONCE {
            if self.is_left() || !self.nic.has_frame() {
                break;
            }
            self.interface.poll_ingress_single(now, self.nic, &mut self.sockets);
            self.is_due = true;
        }
        if core::mem::take(&mut self.is_due) {
            self.send_frames(now);
        }
    }

    /// Advances the time, at whose change the socket may have to repeat something.
    fn look_at_clock(&mut self) {
        let passed = B::milliseconds().wrapping_sub(self.now as u32);
        self.now = self.now.saturating_add(passed.into());
        self.is_due |= passed > 0;
    }

    fn send_frames(&mut self, now: Instant) {
        for _ in 0..FRAMES_AT_ONCE {
            if self.interface.poll_egress(now, self.nic, &mut self.sockets) == PollResult::None {
                return;
            }
        }
        self.is_due = true;
    }

    /// Receives bytes, welcomes the next host, or takes leave of the present one.
    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        if self.socket().is_listening() {
            self.alone = self.now;
            return 0;
        }
        let is_connecting = self.socket().state() == State::SynReceived;
        if !is_connecting && !self.handover.has_host() {
            return self.welcome(buffer);
        }
        let count = self.socket().recv_slice(buffer).unwrap_or(0);
        self.handover.received(buffer.get(..count).unwrap_or(&[]));
        // Bytes that were taken widen the window.
        self.is_due |= count > 0;
        let is_late = !self.handover.is_proven() && self.now - self.alone > FIRST_FRAME;
        if is_late || count == 0 && self.is_left() {
            self.hang_up();
        }
        count
    }

    fn welcome(&mut self, buffer: &mut [u8]) -> usize {
        let Some(first) = buffer.first_mut() else { return 0 };
        *first = self.handover.welcome();
        1
    }

    /// Closes the connection, and listens for the next host.
    fn hang_up(&mut self) {
        self.handover.leave();
        // The next host's time begins: its first frame may wait in the controller.
        self.alone = self.now;
        self.socket().abort();
        // The host, if it is there, is told before the socket forgets it.
        self.send_frames(Instant::from_millis(self.now));
        let port = self.port;
        if let Err(error) = self.socket().listen(port) {
            semihosting::fail(format_args!("the socket cannot listen: {error:?}\n"));
        }
    }

    /// Takes bytes of the card, as many as there is room for.
    fn take(&mut self, bytes: &[u8]) -> usize {
        let unwanted = self.handover.drop_unwanted(bytes);
        if unwanted > 0 {
            return unwanted;
        }
        if self.is_left() {
            self.handover.sent(bytes);
            return bytes.len();
        }
        let count = self.socket().send_slice(bytes).unwrap_or(0);
        self.handover.sent(bytes.get(..count).unwrap_or(&[]));
        self.is_due |= count > 0;
        count
    }

    /// Sleeps until a frame arrives or a millisecond has passed.
    fn sleep(&self) {
        B::masked(|| {
            self.nic.listen();
            if !self.nic.has_frame() {
                B::sleep();
            }
        });
    }
}

impl<B: Board, D: Nic> Port for TcpPort<B, D> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        let deadline = Deadline::<B>::new(wait);
        loop {
            self.poll();
            let count = self.receive(buffer);
            if count > 0 || deadline.is_over() {
                return Ok(count);
            }
            self.sleep();
        }
    }

    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError> {
        let deadline = Deadline::<B>::new(wait);
        loop {
            let count = self.take(bytes);
            self.poll();
            if count > 0 || deadline.is_over() {
                return Ok(count);
            }
            self.sleep();
        }
    }
}
