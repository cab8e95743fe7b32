//! What a factored document is known by: SHA-256 over its curves and weights.
//!
//! It is that of the values and not of the files, so a document keeps its fingerprint when it is copied, renamed, or written
//! by another version of the libraries that compress pictures.

use sha2::{Digest, Sha256};

use crate::materials::Factored;

/// The fingerprint of a document, 64 hexadecimal digits.
pub fn fingerprint(document: &Factored) -> String {
    let mut hash = Sha256::new();
    let maps = &document.maps;
    for number in [
        document.space.angles().len(),
        document.space.columns(),
        maps.width(),
        maps.height(),
        maps.channels(),
    ] {
        hash.update((number as u64).to_le_bytes());
    }
    for value in document.bases.rows().flatten() {
        hash.update(value.to_le_bytes());
    }
    let mut bytes = Vec::with_capacity(1 << 16);
    for weights in maps.data().chunks(1 << 15) {
        bytes.clear();
        bytes.extend(weights.iter().flat_map(|weight| weight.to_le_bytes()));
        hash.update(&bytes);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
