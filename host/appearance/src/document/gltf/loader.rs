//! The images of a glTF file, wherever they are stored, and the check that they align.
//!
//! Images come from data URIs, from buffers, or from files in the document's folder or below; other paths are errors.

use std::path::{Path, PathBuf};

use base64::Engine;
use files::shelf::inside;
use percent_encoding::percent_decode_str;

use super::root::{Info, Root};
use crate::document::content::ColourSpace;
use crate::document::content::MOST_BYTES;
use crate::document::error::DocumentError;
use crate::document::picture::Picture;
use crate::document::source::Source;
use crate::document::texture::Field;

/// The placement of a map on the surface: offset, rotation, scale, set of coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placement {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    coordinates: u32,
}

impl Placement {
    pub(super) fn of(info: &Info) -> Placement {
        let transform = info.extensions.transform.as_ref();
        Placement {
            offset: transform.map_or([0.0; 2], |t| t.offset),
            rotation: transform.map_or(0.0, |t| t.rotation),
            scale: transform.map_or([1.0; 2], |t| t.scale),
            coordinates: transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
        }
    }

    fn is_plain(&self) -> bool {
        self.offset == [0.0; 2] && self.rotation == 0.0 && self.scale == [1.0; 2]
    }
}

/// Decodes an image: with a word on its alpha if that is not read, or without.
pub(super) type Decode = fn(&[u8], &Path, &mut Source<'_>) -> Result<Picture, DocumentError>;

/// A decoded texture and its name.
pub(super) struct Loaded {
    pub(super) name: String,
    pub(super) picture: Picture,
}

pub(super) struct Loader<'a, 's> {
    pub(super) root: &'a Root,
    pub(super) blob: Option<&'a [u8]>,
    pub(super) path: &'a Path,
    pub(super) source: &'a mut Source<'s>,
    /// The placement of the first map read; the others must share it.
    pub(super) placement: Option<Placement>,
}

impl<'a> Loader<'a, '_> {
    pub(super) fn wrong(&self, field: &str, problem: String) -> DocumentError {
        DocumentError::Field { path: self.path.to_path_buf(), field: field.into(), problem }
    }

    /// The image of a map that must align with the others.
    pub(super) fn load(&mut self, info: &Info, field: &str, decode: Decode) -> Result<Loaded, DocumentError> {
        let placement = Placement::of(info);
        match self.placement {
            None => {
                if !placement.is_plain() {
                    self.source.note(format!(
                        "{}: the texture is printed as it is stored; its texture transform is ignored",
                        self.path.display()
                    ));
                }
                self.placement = Some(placement);
            }
            Some(first) if first != placement => {
                let problem =
                    "its placement on the surface differs from that of the material's other maps, which a flat \
                     print cannot reproduce; bake the maps to one set of coordinates"
                        .into();
                return Err(self.wrong(field, problem));
            }
            Some(_) => {}
        }
        self.texture(info.index, field, decode)
    }

    pub(super) fn texture(
        &mut self,
        index: usize,
        field: &str,
        decode: Decode,
    ) -> Result<Loaded, DocumentError> {
        let Some(texture) = self.root.textures.get(index) else {
            return Err(self.wrong(field, format!("texture {index} does not exist")));
        };
        // WebP pictures come first: the other image is for those who cannot read them, and may be absent.
        let webp = texture.extensions.webp.as_ref().and_then(|webp| webp.source);
        // Where neither is, texture extensions name another image, of a kind that is not read.
        let Some(number) = webp.or(texture.source) else {
            let kinds: Vec<&str> = self
                .root
                .extensions_used
                .iter()
                .map(String::as_str)
                .filter(|name| is_of_images(name))
                .collect();
            let other = if kinds.is_empty() {
                String::new()
            } else {
                format!("; the file uses {}", kinds.join(", "))
            };
            let problem = format!(
                "texture {index} has no image that can be read{other}; export the file with PNG or JPEG textures"
            );
            return Err(self.wrong(field, problem));
        };
        let Some(image) = self.root.images.get(number) else {
            return Err(self.wrong(field, format!("image {number} does not exist")));
        };
        let (name, bytes) = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => self.resource(uri, field, &format!("image {number}"))?,
            (None, Some(view)) => {
                let name = PathBuf::from(format!("{} image {number}", self.path.display()));
                (name, self.view(view, field)?)
            }
            (None, None) => {
                return Err(self.wrong(field, format!("image {number} has neither uri nor bufferView")));
            }
        };
        let picture = decode(&bytes, &name, self.source)?;
        self.source.observer.advance(1);
        let name = name.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Loaded { name, picture })
    }

    /// The bytes a buffer view covers.
    fn view(&mut self, index: usize, field: &str) -> Result<Vec<u8>, DocumentError> {
        let Some(view) = self.root.buffer_views.get(index) else {
            return Err(self.wrong(field, format!("bufferView {index} does not exist")));
        };
        let number = view.buffer;
        let Some(buffer) = self.root.buffers.get(number) else {
            return Err(self.wrong(field, format!("buffer {number} does not exist")));
        };
        let external;
        let data: &[u8] = match &buffer.uri {
            Some(uri) => {
                external = self.resource(uri, field, &format!("buffer {number}"))?.1;
                &external
            }
            None => match self.blob {
                Some(blob) if number == 0 => blob,
                _ => {
                    return Err(self.wrong(
                        field,
                        format!("buffer {number} has no uri, and the file has no data chunk"),
                    ));
                }
            },
        };
        let start = view.byte_offset;
        let end = start.checked_add(view.byte_length).filter(|&end| end <= data.len() as u64);
        let Some(end) = end else {
            let problem = format!(
                "bufferView {index} covers {} bytes from {start}, but buffer {number} has {} bytes",
                view.byte_length,
                data.len()
            );
            return Err(self.wrong(field, problem));
        };
        Ok(data[start as usize..end as usize].to_vec())
    }

    /// The data of a URI: inline data, or a file in the folder of the document or below.
    fn resource(&mut self, uri: &str, field: &str, label: &str) -> Result<(PathBuf, Vec<u8>), DocumentError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded =
                data.split_once(',').filter(|(kind, _)| kind.ends_with(";base64")).map(|(_, data)| data);
            let Some(encoded) = encoded else {
                return Err(self.wrong(field, format!("{label}: expected a base64 data URI")));
            };
            let bytes = base64::engine::general_purpose::STANDARD
                .decode(encoded)
                .map_err(|error| self.wrong(field, format!("{label}: the data URI is damaged: {error}")))?;
            return Ok((PathBuf::from(format!("{} {label}", self.path.display())), bytes));
        }
        // Exporters on Windows write what their system has between folders.
        let file = percent_decode_str(uri).decode_utf8_lossy().replace('\\', "/");
        let Some(path) = inside(self.path.parent().unwrap_or(Path::new("")), &file) else {
            return Err(self
                .wrong(field, format!("{label}: `{uri}` must be a file in the document's folder or below")));
        };
        let bytes = self.source.read(&path, MOST_BYTES)?;
        Ok((path, bytes))
    }

    pub(super) fn colour(
        &mut self,
        info: Option<&Info>,
        factor: [f32; 3],
        space: ColourSpace,
        field: &str,
    ) -> Result<[Field; 3], DocumentError> {
        let Some(info) = info else { return Ok(factor.map(Field::Constant)) };
        let Loaded { name, picture } = self.load(info, field, Picture::decode)?;
        let how = if space == ColourSpace::Srgb { "sRGB" } else { "linear" };
        self.source.note(format!("{name}: {field} read as {how}"));
        if picture.has_foreign_profile() {
            self.source.note(format!("{name}: the colour profile is not applied"));
        }
        Ok(coloured(&picture, factor, space))
    }
}

/// Whether an extension stores the images of textures in another format.
fn is_of_images(extension: &str) -> bool {
    extension.contains("_texture_") && extension != "KHR_texture_transform"
}

pub(super) fn coloured(picture: &Picture, factor: [f32; 3], space: ColourSpace) -> [Field; 3] {
    let [r, g, b] = picture.linear(space.into());
    [Field::Map(r).times(factor[0]), Field::Map(g).times(factor[1]), Field::Map(b).times(factor[2])]
}
