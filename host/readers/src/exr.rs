//! OpenEXR files, which name their channels freely.
//!
//! Method: the channels are `R`, `G`, `B` or `Y`, alone or behind the name of a layer (`ViewLayer.Combined.R`), or a single channel
//! of any name, with `A` of the same layer as alpha. Channels without a layer come first; several layers with colours are an error. The primaries of the colours are
//! returned as the header states them. Limits: no subsampled channels, no whole numbers (they identify objects and
//! are no values); the first part.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::prelude::{AnyChannel, FlatSamples, ReadChannels, ReadLayers};

use crate::fault::Fault;

/// The chromaticities (x, y) of red, green, blue and white.
pub type Primaries = [[f32; 2]; 4];

/// The values of a picture, interleaved, rows from the top.
#[derive(Debug)]
pub(crate) struct Floats {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Values of a pixel: grey or red, green and blue; then alpha, if 2 or 4.
    pub channels: usize,
    /// The values.
    pub values: Vec<f32>,
    /// The colours that the values are amounts of, if the file states them.
    pub primaries: Option<Primaries>,
}

fn damaged(error: exr::error::Error) -> Fault {
    Fault::Damaged(error.to_string())
}

/// Width and height, and the number of channels, of the part that has the most values.
///
/// # Errors
/// A damaged file.
pub(crate) fn largest(bytes: &[u8]) -> Result<((u32, u32), usize), Fault> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    let size = |header: &exr::meta::header::Header| {
        let (width, height) = (side(header.layer_size.width()), side(header.layer_size.height()));
        ((width, height), header.channels.list.len())
    };
    let values = |&((width, height), channels): &((u32, u32), usize)| {
        u128::from(width) * u128::from(height) * channels as u128
    };
    let largest = meta.headers.iter().map(size).max_by_key(values);
    largest.ok_or_else(|| Fault::Damaged("it has no part".into()))
}

/// Decodes a file; its size is the caller's to check ([`largest`]).
///
/// # Errors
/// A damaged file, or channels of which none is a picture.
pub(crate) fn exr(bytes: &[u8]) -> Result<Floats, Fault> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let primaries = image
        .attributes
        .chromaticities
        .map(|c| [c.red, c.green, c.blue, c.white].map(|exr::math::Vec2(x, y)| [x, y]));
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let chosen = choose(&layer.channel_data.list)?;
    let channels = chosen.len();
    let mut values = vec![0.0; width * height * channels];
    for (c, channel) in chosen.into_iter().enumerate() {
        if channel.sample_data.len() != width * height {
            let problem = format!("channel {} is subsampled, which is not supported", channel.name);
            return Err(Fault::Kind(problem));
        }
        if matches!(channel.sample_data, FlatSamples::U32(_)) {
            return Err(Fault::Kind(format!(
                "channel {} holds whole numbers (UINT), which identify things; save it as half or float, 0 to 1",
                channel.name
            )));
        }
        for (pixel, value) in values.chunks_exact_mut(channels).zip(channel.sample_data.values_as_f32()) {
            pixel[c] = value;
        }
    }
    Ok(Floats { width, height, channels, values, primaries })
}

/// The channels that hold the picture.
fn choose(list: &[AnyChannel<FlatSamples>]) -> Result<Vec<&AnyChannel<FlatSamples>>, Fault> {
    let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
    let split = |name: &str| {
        name.rfind('.').map_or((String::new(), name.to_owned()), |dot| {
            (name[..dot].to_owned(), name[dot + 1..].to_owned())
        })
    };
    let parts: Vec<(String, String)> = names.iter().map(|name| split(name)).collect();
    for kind in [&["R", "G", "B"][..], &["Y"]] {
        let within = |layer: &str| -> Option<Vec<usize>> {
            let at = |kind: &str| parts.iter().position(|(l, name)| l == layer && name == kind);
            let colours: Option<Vec<usize>> = kind.iter().map(|kind| at(kind)).collect();
            Some(colours?.into_iter().chain(at("A")).collect())
        };
        let mut layers: Vec<&str> = parts.iter().map(|(layer, _)| layer.as_str()).collect();
        layers.sort_unstable();
        layers.dedup();
        let found: Vec<(&str, Vec<usize>)> =
            layers.into_iter().filter_map(|layer| Some((layer, within(layer)?))).collect();
        match &found[..] {
            [] => {}
            // No layer sorts before all names.
            [("", places), ..] | [(_, places)] => return Ok(places.iter().map(|&i| &list[i]).collect()),
            several => {
                let layers: Vec<&str> = several.iter().map(|(layer, _)| *layer).collect();
                return Err(Fault::Kind(format!(
                    "several layers hold a picture ({}); save one of them",
                    layers.join(", ")
                )));
            }
        }
    }
    match list {
        [one] => Ok(vec![one]),
        _ => Err(Fault::Kind(format!("expected the channels R, G, B or Y, found {}", names.join(", ")))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::*;

    fn written(channels: &[(&str, FlatSamples)], red: Option<f32>) -> Vec<u8> {
        let list: SmallVec<[AnyChannel<FlatSamples>; 4]> =
            channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone())).collect();
        let mut image = Image::from_channels((2, 1), AnyChannels::sort(list));
        image.attributes.chromaticities = red.map(|x| attribute::Chromaticities {
            red: Vec2(x, 0.25),
            green: Vec2(0.125, 0.75),
            blue: Vec2(0.125, 0.0625),
            white: Vec2(0.3125, 0.375),
        });
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn floats(a: f32, b: f32) -> FlatSamples {
        FlatSamples::F32(vec![a, b])
    }

    #[test]
    fn colours_are_found_behind_the_name_of_a_layer() {
        let layered = |layer: &str| {
            ["B", "G", "R"]
                .iter()
                .enumerate()
                .map(|(i, c)| (format!("{layer}{c}"), floats(i as f32, 9.0)))
                .collect()
        };
        let all = |lists: &[Vec<(String, FlatSamples)>]| {
            let list: Vec<(&str, FlatSamples)> =
                lists.iter().flatten().map(|(name, samples)| (&name[..], samples.clone())).collect();
            exr(&written(&list, None))
        };
        let combined: Vec<(String, FlatSamples)> = layered("ViewLayer.Combined.");
        let depth = vec![("ViewLayer.Depth.Z".to_owned(), floats(5.0, 5.0))];
        let found = all(&[combined.clone(), depth.clone()]).unwrap();
        assert_eq!((found.channels, &found.values[..3]), (3, &[2.0, 1.0, 0.0][..]));
        // Channels without a layer are the picture.
        let plain: Vec<(String, FlatSamples)> =
            ["R", "G", "B"].map(|c| (c.to_owned(), floats(7.0, 7.0))).to_vec();
        assert_eq!(all(&[combined.clone(), plain]).unwrap().values[0], 7.0);
        let error = all(&[combined, layered("ViewLayer.DiffCol.")]).unwrap_err().to_string();
        assert!(error.contains("ViewLayer.Combined, ViewLayer.DiffCol"), "{error}");
        let error = all(&[depth, vec![("V".into(), floats(0.0, 0.0))]]).unwrap_err().to_string();
        assert!(error.contains("V, ViewLayer.Depth.Z") || error.contains("ViewLayer.Depth.Z, V"), "{error}");
    }

    #[test]
    fn alpha_of_the_same_layer_comes_last() {
        let plain = [("A", floats(0.4, 0.4)), ("Y", floats(1.0, 2.0))];
        let found = exr(&written(&plain, None)).unwrap();
        assert_eq!((found.channels, &found.values[..]), (2, &[1.0, 0.4, 2.0, 0.4][..]));
        let elsewhere = [("mask.A", floats(0.4, 0.4)), ("Y", floats(1.0, 2.0))];
        assert_eq!(exr(&written(&elsewhere, None)).unwrap().channels, 1);
    }

    #[test]
    fn whole_numbers_are_refused_and_primaries_returned() {
        let error = exr(&written(&[("Y", FlatSamples::U32(vec![1, 2]))], None)).unwrap_err().to_string();
        assert!(error.contains("channel Y holds whole numbers"), "{error}");
        let found = exr(&written(&[("Y", floats(0.5, 1.0))], Some(0.625))).unwrap();
        assert_eq!(found.primaries, Some([[0.625, 0.25], [0.125, 0.75], [0.125, 0.0625], [0.3125, 0.375]]));
        assert_eq!(exr(&written(&[("Y", floats(0.5, 1.0))], None)).unwrap().primaries, None);
    }
}
