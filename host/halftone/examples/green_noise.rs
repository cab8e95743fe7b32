//! Makes the table of green noise for a minimum cluster and writes its ranks to standard output, two bytes each:
//! `cargo run -p foilpress-halftone --example green_noise 4 > host/halftone/src/green_noise/4.bin`.

use std::io::Write;

#[expect(clippy::disallowed_methods, reason = "the table is bytes, and goes into a file")]
fn main() -> std::io::Result<()> {
    let minimum = std::env::args().nth(1).and_then(|text| text.parse().ok());
    let minimum = minimum.unwrap_or(halftone::green_noise::USUAL);
    let ranks = halftone::green_noise::Table::ranks(minimum);
    let bytes: Vec<u8> = ranks.into_iter().flat_map(u16::to_le_bytes).collect();
    std::io::stdout().lock().write_all(&bytes)
}
