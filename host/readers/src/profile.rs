//! Colour profiles: applied to the colours of a picture, and written for a printer.
//!
//! Method: those of the International Color Consortium, by the crate `moxcms`, with its usual intent. Cost:
//! some nanoseconds a pixel. Limits: 8 bits; profiles of grey and of red, green and blue.
//! Source: ICC.1:2010, 8.3 and 10.10.

use std::io;
use std::path::Path;

use moxcms::{
    ColorProfile, DataColorSpace, Layout, LutDataType, LutStore, LutType, LutWarehouse, Matrix3d,
    ProfileClass, TransformOptions,
};
use observe::Diagnosis;

/// Applies an embedded profile, and returns a note if that changed anything. `grey` marks pixels of a greyscale file.
pub(crate) fn to_srgb(
    name: &Path,
    profile: &[u8],
    grey: bool,
    rgba: &mut [u8],
) -> Result<Option<String>, Diagnosis> {
    let Ok(profile) = ColorProfile::new_from_slice(profile) else {
        return Ok(Some(format!("{}: its colour profile is damaged, so it is read as sRGB", name.display())));
    };
    let of_grey = match profile.color_space {
        DataColorSpace::Rgb => false,
        DataColorSpace::Gray if grey => true,
        other => {
            let problem = format!("its colour profile is for {other:?}, but its pixels are not");
            return Err(Diagnosis::of_file(name, problem).hint("convert the picture to sRGB"));
        }
    };
    let srgb = ColorProfile::new_srgb();
    let bad = |error| {
        Diagnosis::of_file(name, format!("its colour profile cannot be applied ({error})"))
            .hint("convert it to sRGB")
    };
    let layout = if of_grey { Layout::GrayAlpha } else { Layout::Rgba };
    let transform = profile
        .create_transform_8bit(layout, &srgb, Layout::Rgba, TransformOptions::default())
        .map_err(bad)?;
    let mut changed = false;
    let mut line = vec![0; 4 << 12];
    let mut greys = Vec::new();
    for pixels in rgba.chunks_mut(4 << 12) {
        let line = &mut line[..pixels.len()];
        if of_grey {
            greys.clear();
            greys.extend(pixels.as_chunks::<4>().0.iter().flat_map(|&[v, _, _, alpha]| [v, alpha]));
        }
        transform.transform(if of_grey { &greys } else { &*pixels }, line).map_err(bad)?;
        changed |= pixels != line;
        pixels.copy_from_slice(line);
    }
    Ok(changed.then(|| format!("{}: its colour profile was applied", name.display())))
}

/// A table of a profile, of 16 bits between curves.
pub struct Table {
    /// Channels before and after it.
    pub channels: [u8; 2],
    /// Nodes on each axis.
    pub nodes: u8,
    /// Its values, the last axis first.
    pub values: Vec<u16>,
    /// The curve of every channel before it, and after it; both have as many entries.
    pub curves: [Vec<u16>; 2],
}

impl From<Table> for LutWarehouse {
    fn from(Table { channels: [from, to], nodes, values, curves: [before, after] }: Table) -> LutWarehouse {
        let all = |curve: &[u16], channels: u8| LutStore::Store16(curve.repeat(channels.into()));
        LutWarehouse::Lut(LutDataType {
            num_input_channels: from,
            num_output_channels: to,
            num_clut_grid_points: nodes,
            matrix: Matrix3d::IDENTITY,
            num_input_table_entries: before.len() as u16,
            num_output_table_entries: after.len() as u16,
            input_table: all(&before, from),
            clut_table: LutStore::Store16(values),
            output_table: all(&after, to),
            lut_type: LutType::Lut16,
        })
    }
}

/// The bytes of the profile of a printer in CMYK: what Lab its inks are, and which inks are a Lab.
///
/// # Errors
/// Tables that no profile can hold.
pub fn printer(to_lab: Table, from_lab: Table) -> io::Result<Vec<u8>> {
    let mut profile = ColorProfile::default();
    profile.profile_class = ProfileClass::OutputDevice;
    profile.color_space = DataColorSpace::Cmyk;
    profile.pcs = DataColorSpace::Lab;
    profile.white_point = ColorProfile::new_srgb().white_point;
    profile.media_white_point = Some(profile.white_point);
    profile.lut_a_to_b_perceptual = Some(to_lab.into());
    profile.lut_b_to_a_perceptual = Some(from_lab.into());
    let mut bytes = profile.encode().map_err(io::Error::other)?;
    // Version 4 has another black in some intents; for these tables version 2 differs in its number alone.
    bytes[8..12].copy_from_slice(&[2, 0x40, 0, 0]);
    Ok(bytes)
}
