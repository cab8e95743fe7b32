//! Frames: portions do not matter, what is damaged is dropped, what was understood can be said again.

use protocol::link::frame::{self, Damage, MAX, Read, Reader};
use protocol::link::message::{ToBridge, ToHost};
use serde::Serialize;
use std::fmt::Debug;

/// The first byte says how large the portions are; the rest are bytes of a cable, and a message's body too.
pub fn check(bytes: &[u8]) {
    let Some((&portion, bytes)) = bytes.split_first() else { return };
    let whole = outcomes(bytes, usize::MAX);
    assert_eq!(outcomes(bytes, 1), whole, "byte by byte");
    assert_eq!(outcomes(bytes, usize::from(portion).max(1)), whole, "in portions of {portion}");
    for message in whole.iter().flatten() {
        said_again(message);
    }
    // Chance does not hit checksums, so the bytes get one.
    let body = &bytes[..bytes.len().min(frame::MAX_MESSAGE)];
    assert_eq!(outcomes(&framed(body), 7), [Ok(body.to_vec())]);
    said_again(body);
}

/// What a reader finds that has seen the end of a frame before.
fn outcomes(bytes: &[u8], portion: usize) -> Vec<Result<Vec<u8>, Damage>> {
    let (mut reader, mut found) = (Reader::new(), Vec::new());
    assert_eq!(reader.read(&[0]), Read::More);
    for mut left in bytes.chunks(portion) {
        loop {
            match reader.read(left) {
                Read::More => break,
                Read::Message(message, rest) => {
                    found.push(Ok(message.to_vec()));
                    left = rest;
                }
                Read::Damaged(damage, rest) => {
                    found.push(Err(damage));
                    left = rest;
                }
            }
        }
    }
    found
}

/// A frame around any bytes, by the document and not by `frame::write`.
pub fn framed(body: &[u8]) -> Vec<u8> {
    let with_sum = [body, &frame::checksum(body).to_le_bytes()].concat();
    let mut coded = vec![0; cobs::max_encoding_length(with_sum.len())];
    let length = cobs::encode(&with_sum, &mut coded);
    coded.truncate(length);
    coded.push(0);
    coded
}

fn said_again(message: &[u8]) {
    if let Ok(message) = frame::decode::<ToBridge<'_>>(message) {
        comes_back(&message, |bytes| {
            frame::decode::<ToBridge<'_>>(bytes).is_ok_and(|again| again == message)
        });
    }
    if let Ok(message) = frame::decode::<ToHost<'_>>(message) {
        comes_back(&message, |bytes| frame::decode::<ToHost<'_>>(bytes).is_ok_and(|again| again == message));
    }
}

fn comes_back(message: &(impl Serialize + Debug), same: impl Fn(&[u8]) -> bool) {
    let mut buffer = [0; MAX];
    // Whatever was in a frame fits one: written anew a number takes no more bytes than before.
    let length = frame::write(message, &mut buffer).expect("a frame");
    let mut reader = Reader::new();
    let Read::Message(bytes, []) = reader.read(&buffer[..length]) else { panic!("{message:?} is no frame") };
    assert!(same(bytes), "{message:?} came back as something else");
}
