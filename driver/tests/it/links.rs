//! Links: a card's port for consecutive hosts, and the addresses that it can listen on.
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use photoncard_driver::link::{HostPort, ListenAddress, Listener, SerialOptions, connect_tcp, open_serial};
use photoncard_shared::link::{Port, PortError};

const SOON: Duration = Duration::from_millis(20);
const PATIENCE: Duration = Duration::from_secs(10);

/// A card's port on a Unix socket.
fn card(folder: &Path) -> (HostPort, PathBuf, Arc<AtomicBool>) {
    let path = folder.join("card");
    let listener = Listener::new(&ListenAddress::Unix { path: path.clone() }).unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    (HostPort::new(listener, stop.clone(), |_| {}), path, stop)
}

/// Next bytes that the card reads.
fn heard(card: &mut HostPort) -> Vec<u8> {
    let mut buffer = [0; 64];
    let count = card.read(&mut buffer, PATIENCE).unwrap();
    buffer[..count].to_vec()
}

/// Writes all of `bytes` into a port.
fn say(port: &mut impl Port, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        bytes = &bytes[port.write(bytes, PATIENCE).unwrap()..];
    }
}

#[test]
fn a_link_is_cut_between_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (mut card, path, _) = card(folder.path());
    say(&mut card, b"nobody hears\0");
    let mut first = UnixStream::connect(&path).unwrap();
    assert_eq!(heard(&mut card), b"\0");
    say(&mut card, b"not before the host has spoken\0 nor a part");
    first.write_all(b"hello\0 half a fra").unwrap();
    assert_eq!(heard(&mut card), b"hello\0 half a fra");
    say(&mut card, b" of a frame\0answer\0 half an ans");
    let mut answer = [0; 19];
    first.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"answer\0 half an ans");
    drop(first);
    assert_eq!(heard(&mut card), b"");
    let mut second = UnixStream::connect(&path).unwrap();
    assert_eq!(heard(&mut card), b"\0");
    second.write_all(b"hello\0").unwrap();
    assert_eq!(heard(&mut card), b"hello\0");
    say(&mut card, b"wer\0whole\0");
    let mut answer = [0; 6];
    second.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"whole\0");
}

#[test]
fn a_second_host_is_refused_and_the_first_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (mut card, path, stop) = card(folder.path());
    let mut first = UnixStream::connect(&path).unwrap();
    assert_eq!(heard(&mut card), b"\0");
    let mut second = UnixStream::connect(&path).unwrap();
    for _ in 0..2 {
        assert_eq!(card.read(&mut [0; 8], SOON), Ok(0));
    }
    assert_eq!(second.read(&mut [0; 8]).unwrap(), 0);
    first.write_all(b"a").unwrap();
    assert_eq!(heard(&mut card), b"a");
    stop.store(true, Ordering::Relaxed);
    assert_eq!(card.read(&mut [0; 8], SOON), Err(PortError::Closed));
    drop(card);
    assert!(!path.exists());
}

#[test]
fn a_host_that_comes_after_the_last_is_gone_is_never_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (mut card, path, _) = card(folder.path());
    let mut last = UnixStream::connect(&path).unwrap();
    assert_eq!(heard(&mut card), b"\0");
    for _ in 0..20 {
        last.write_all(b"bye").unwrap();
        drop(last);
        last = UnixStream::connect(&path).unwrap();
        assert_eq!(heard(&mut card), b"bye");
        assert_eq!(heard(&mut card), b"");
        assert_eq!(heard(&mut card), b"\0");
    }
}

#[test]
fn terminals_carry_every_byte() {
    let listener = Listener::new(&ListenAddress::Pty).unwrap();
    let path = listener.card_address().strip_prefix("serial:").unwrap().to_owned();
    let mut card = HostPort::new(listener, Arc::default(), |_| {});
    for _ in 0..2 {
        assert_eq!(card.read(&mut [0; 8], SOON), Ok(0));
        let mut host = open_serial(path.as_ref(), 9600, SerialOptions::default()).unwrap();
        let refusal = open_serial(path.as_ref(), 9600, SerialOptions::default()).err().unwrap();
        assert!(refusal.to_string().contains("the device is busy"), "{refusal}");
        assert_eq!(heard(&mut card), b"\0");
        assert_eq!(heard(&mut card), b"\0", "the host ends what another may have left");
        let bytes: Vec<u8> = (0..=255).rev().collect();
        assert_eq!(host.write(&bytes, PATIENCE), Ok(256));
        let mut received = Vec::new();
        while received.len() < 256 {
            received.extend(heard(&mut card));
        }
        assert_eq!(received, bytes);
        say(&mut card, &bytes);
        let mut received = Vec::new();
        while received.len() < 256 {
            let mut buffer = [0; 64];
            let count = host.read(&mut buffer, PATIENCE).unwrap();
            assert!(count > 0);
            received.extend_from_slice(&buffer[..count]);
        }
        assert_eq!(received, bytes);
        drop(host);
        assert_eq!(card.read(&mut [0; 8], SOON), Ok(0));
    }
}

/// A write that exceeds the line's capacity returns the number of bytes written; on a full line it is 0.
#[test]
fn a_full_serial_line_holds_nobody() {
    let listener = Listener::new(&ListenAddress::Pty).unwrap();
    let path = listener.card_address().strip_prefix("serial:").unwrap().to_owned();
    let mut host = open_serial(path.as_ref(), 921_600, SerialOptions::default()).unwrap();
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let mut sent = 0;
        while let count @ 1.. = host.write(&[1; 1 << 16], SOON).unwrap() {
            sent += count;
        }
        assert_eq!(host.write(&[1; 8], Duration::ZERO), Ok(0));
        assert_eq!(host.read(&mut [0; 8], SOON), Ok(0));
        sender.send((host, sent)).unwrap();
    });
    let (mut host, sent) = receiver.recv_timeout(PATIENCE).expect("no write blocks");
    let mut card = HostPort::new(listener, Arc::default(), |_| {});
    assert_eq!(heard(&mut card), b"\0");
    // The preceding byte ends a frame that another host may have left unfinished.
    let mut received = 0;
    while received < sent + 1 {
        received += heard(&mut card).len();
    }
    drop(card);
    assert_eq!(host.read(&mut [0; 8], PATIENCE), Err(PortError::Closed));
    assert_eq!(host.write(&[1; 8], PATIENCE), Err(PortError::Closed));
}

#[test]
fn a_port_waits_no_longer_than_it_is_told() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let mut port = connect_tcp("127.0.0.1", listener.local_addr().unwrap().port()).unwrap();
    let (other, _): (TcpStream, _) = listener.accept().unwrap();
    assert_eq!(port.read(&mut [0; 8], Duration::ZERO), Ok(0));
    assert_eq!(port.read(&mut [0; 8], SOON), Ok(0));
    // Writes until the system's buffers are full.
    while port.write(&[0; 1 << 16], SOON).unwrap() > 0 {}
    assert_eq!(port.write(&[0; 8], Duration::ZERO), Ok(0));
    drop(other);
    let mut result = Ok(0);
    while result == Ok(0) {
        result = port.read(&mut [0; 8], SOON);
    }
    assert_eq!(result, Err(PortError::Closed));
}

#[test]
fn addresses_to_listen_on_are_read() {
    let tcp = |host: &str, port| Ok(ListenAddress::Tcp { host: host.into(), port });
    assert_eq!("pty".parse(), Ok(ListenAddress::Pty));
    assert_eq!("unix:a:b".parse(), Ok(ListenAddress::Unix { path: "a:b".into() }));
    for text in ["tcp", "tcp:", "tcp:0", "tcp::", "tcp::0"] {
        assert_eq!(text.parse(), tcp("127.0.0.1", 0), "{text}");
    }
    assert_eq!("tcp:7000".parse(), tcp("127.0.0.1", 7000));
    assert_eq!("tcp:0.0.0.0:7000".parse(), tcp("0.0.0.0", 7000));
    assert_eq!("tcp:[::1]:7000".parse(), tcp("::1", 7000));
    for text in ["", "pty:1", "unix", "unix:", "serial:/dev/ttyS0", "tcp:65536", "tcp:host:port", "tcp:::1:5"]
    {
        assert!(text.parse::<ListenAddress>().is_err(), "{text}");
    }
}
