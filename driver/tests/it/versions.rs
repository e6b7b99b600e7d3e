//! Versions: the host's error names the required version, even if it cannot decode the rest of a hello.

use std::time::Duration;

use photoncard_driver::session::{Session, SessionError};
use photoncard_shared::message::PROTOCOL_VERSION;
use photoncard_shared::transport::Transport;

/// Error of a session whose hello is answered by `answer`.
fn greeted_with(answer: &[u8]) -> SessionError {
    let mut session = Session::new(1, Duration::ZERO);
    let mut card = Transport::card();
    session.prepare();
    let hello = session.outgoing().to_vec();
    card.receive(&hello);
    assert!(card.take().is_some());
    assert!(card.send(|bytes| {
        bytes.get_mut(..answer.len())?.copy_from_slice(answer);
        Some(answer.len())
    }));
    let answer = card.outgoing().to_vec();
    session.receive(&answer, Duration::ZERO).expect_err("it is another version's")
}

#[test]
fn a_hello_of_another_version_is_told_by_its_number() {
    for rest in [&[][..], &[1, 2, 3], &[0xff; 200]] {
        let error = greeted_with(&[&[0, 0xac, 2, 7], rest].concat());
        assert!(matches!(error, SessionError::Protocol { card: 300, host: PROTOCOL_VERSION }), "{error}");
        let error = greeted_with(&[&[0, PROTOCOL_VERSION as u8, 0], rest].concat());
        assert!(matches!(error, SessionError::Layout { card: 0, .. }), "{error}");
    }
}

#[test]
fn what_has_no_versions_is_no_reply() {
    for answer in [&[][..], &[0], &[0, 0x80], &[9, 1, 1]] {
        assert!(matches!(greeted_with(answer), SessionError::Unexpected(_)), "{answer:?}");
    }
}
