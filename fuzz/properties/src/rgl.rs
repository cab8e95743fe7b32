//! The printer's language: what is parsed is written alike, more bytes change no verdict, packing is undone.

use protocol::packbits;
use protocol::rgl::encode::encode_into;
use protocol::rgl::{Order, Step, parse};

/// A stream of commands; the bytes are also taken for a row, packed and not.
pub fn check(bytes: &[u8]) {
    let (mut order, mut at) = (Order::new(), 0);
    let mut out = vec![0; bytes.len() + 16];
    while at < bytes.len() {
        let left = &bytes[at..];
        match parse(left) {
            Ok(Step::Command(command, length)) => {
                assert_eq!(encode_into(&command, &mut out), Ok(length));
                assert_eq!(out[..length], left[..length], "{command:?}");
                assert_eq!(parse(&left[..length]), Ok(Step::Command(command, length)));
                for cut in 0..length.min(12) {
                    let Ok(Step::More(needed)) = parse(&left[..cut]) else {
                        panic!("{command:?}, {cut} bytes")
                    };
                    assert!(cut < needed && needed <= length, "{command:?}, {cut} bytes: {needed} needed");
                }
                if order.accept(&command).is_err() {
                    // The reader stops here; the parser has to bear what follows all the same.
                    order = Order::new();
                }
                at += length;
            }
            Ok(Step::More(needed)) => {
                assert!(needed > left.len());
                break;
            }
            Err(refusal) => {
                assert!(refusal.at <= left.len());
                at += 1;
            }
        }
    }
    row(bytes);
}

fn row(bytes: &[u8]) {
    let row = &bytes[..bytes.len().min(1235)];
    let mut packed = [0; 1300];
    if let Some(length) = packbits::pack_into(row, &mut packed) {
        let mut unpacked = [0; 1235];
        assert_eq!(packbits::unpack_into(&packed[..length], &mut unpacked), Ok(row.len()));
        assert_eq!(unpacked[..row.len()], *row);
    }
    let mut unpacked = [0; 1235];
    let measured = packbits::measure(row);
    if let Ok(length) = packbits::unpack_into(row, &mut unpacked) {
        let last = unpacked[..length].last().copied().unwrap_or(0);
        assert_eq!(measured, Ok((length, last)));
    }
}
