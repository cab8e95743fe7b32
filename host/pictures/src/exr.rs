//! OpenEXR files, which name their channels freely.
//!
//! Limits: `R`, `G`, `B`; `Y`; or a single channel of any name, none of them subsampled; the first layer.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers};

/// The values of a picture, interleaved, rows from the top.
pub struct Floats {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Values of a pixel: 1, or red, green and blue.
    pub channels: usize,
    /// The values.
    pub values: Vec<f32>,
}

fn damaged(error: exr::error::Error) -> String {
    format!("cannot decode the image: {error}")
}

/// Width, height and number of channels of each layer.
///
/// # Errors
/// What is wrong with the file.
pub fn exr_sizes(bytes: &[u8]) -> Result<Vec<(usize, usize, usize)>, String> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    let size = |header: &exr::meta::header::Header| {
        (header.layer_size.width(), header.layer_size.height(), header.channels.list.len())
    };
    Ok(meta.headers.iter().map(size).collect())
}

/// Decodes a file; its sizes are the caller's to check ([`exr_sizes`]).
///
/// # Errors
/// What is wrong with the file.
pub fn exr(bytes: &[u8]) -> Result<Floats, String> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let list = &layer.channel_data.list;
    let named = |name: &str| list.iter().find(|channel| channel.name.eq(name));
    let chosen = match (named("R"), named("G"), named("B"), named("Y")) {
        (Some(r), Some(g), Some(b), _) => vec![r, g, b],
        (_, _, _, Some(y)) => vec![y],
        _ if list.len() == 1 => vec![&list[0]],
        _ => {
            let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
            return Err(format!("expected the channels R, G, B or Y, found {}", names.join(", ")));
        }
    };
    let channels = chosen.len();
    let mut values = vec![0.0; width * height * channels];
    for (c, channel) in chosen.into_iter().enumerate() {
        if channel.sample_data.len() != width * height {
            return Err(format!("channel {} is subsampled, which is not supported", channel.name));
        }
        for (pixel, value) in values.chunks_exact_mut(channels).zip(channel.sample_data.values_as_f32()) {
            pixel[c] = value;
        }
    }
    Ok(Floats { width, height, channels, values })
}
