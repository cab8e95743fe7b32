//! What a PNG says of its colours, before it is decoded.
//!
//! Problem: a colour profile is compressed, and a few kilobytes expand to gigabytes. Without a profile the values may follow a
//! power that is not that of sRGB.
//! Method: the profile is expanded piece by piece up to [`MOST_PROFILE`] and thrown away. The power is that of the chunk `gAMA`,
//! which counts only without a profile and without the chunk `sRGB`. Cost: the time to expand the profile once. Limits: the chunk
//! `cHRM` is not read.
//! Source: PNG specification, third edition, sections 11.3.2 and 13.13.

use std::io::{Cursor, Read as _};

use flate2::read::ZlibDecoder;

/// The most bytes of a colour profile: several times the largest of a printing press.
pub const MOST_PROFILE: u64 = 1 << 24;

/// The power of sRGB, as `gAMA` states it for files that are meant to be sRGB.
const USUAL: f64 = 1.0 / 2.2;

/// Powers that differ from it by less are meant to be it.
const ALIKE: f64 = 0.02;

/// Whether the colour profile of a PNG is as large as profiles are; also if it has none.
pub(crate) fn has_plain_profile(bytes: &[u8]) -> bool {
    let Some(mut rest) = bytes.get(8..) else { return true };
    while let Some((head, after)) = rest.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let body = &after[..length.min(after.len())];
        match &head[4..] {
            b"iCCP" => {
                // A name that ends with zero, and the method of compression.
                let Some(name) = body.iter().position(|&byte| byte == 0) else { return true };
                let packed = body.get(name + 2..).unwrap_or_default();
                let mut expanded = ZlibDecoder::new(packed).take(MOST_PROFILE + 1);
                let length = std::io::copy(&mut expanded, &mut std::io::sink());
                return length.map_or(true, |length| length <= MOST_PROFILE);
            }
            b"IDAT" | b"IEND" => return true,
            _ => {}
        }
        rest = after.get(length + 4..).unwrap_or_default();
    }
    true
}

/// The power of light that the values of a PNG are, if it states another than that of sRGB.
pub fn gamma(bytes: &[u8]) -> Option<f64> {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let info = reader.info();
    let stated = f64::from(info.gama_chunk?.into_value());
    let plain = info.srgb.is_none() && info.icc_profile.is_none();
    (plain && stated > 0.0 && (stated - USUAL).abs() > ALIKE).then_some(stated)
}
