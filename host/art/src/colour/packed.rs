//! Colours of dots as numbers that are compared and looked up.
//!
//! Method: red, green and blue in 24 bits, and a bit for what drew the colour, which decides how it is mixed.

use crate::read::object_type::ObjectType;

/// The colour of a dot: red, green and blue from the top of the lowest 24 bits, [`DRAWN`] and [`LABEL`].
pub(crate) type Key = u32;

/// Text or a drawing has the colour.
pub(crate) const DRAWN: Key = 1 << 24;
/// Text has the colour, and is printed in the nearest solid.
pub(crate) const LABEL: Key = 1 << 26;

pub(crate) const WHITE: Key = 0xff_ff_ff;
pub(crate) const BLACK: Key = 0;

/// The key of a colour. White is white and black is black, whatever drew it.
#[inline(always)]
pub(crate) fn key([r, g, b]: [u8; 3], drawn: bool) -> Key {
    let rgb = u32::from_be_bytes([0, r, g, b]);
    if drawn && rgb != WHITE && rgb != BLACK { rgb | DRAWN } else { rgb }
}

/// The key of what is drawn; `labels` says whether text is a label.
#[inline(always)]
pub(crate) fn of_drawn(kind: ObjectType, rgb: [u8; 3], labels: bool) -> Key {
    let key = key(rgb, kind != ObjectType::Picture);
    if labels && kind == ObjectType::Text { key | LABEL } else { key }
}

#[inline(always)]
pub(crate) fn colour(key: Key) -> [u8; 3] {
    let [_, r, g, b] = key.to_be_bytes();
    [r, g, b]
}
