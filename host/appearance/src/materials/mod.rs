//! What the pixels of a document reflect, one by one and never all at once as curves.
//!
//! [`Materials`] is all that factoring and gamut mapping know of a document. It is implemented by a surface
//! for every pixel ([`Surfaces`]), by bases and weight maps ([`Factored`]) and by one material everywhere
//! ([`Uniform`]). [`Reduced`] averages any of them over the cells of a print ([`Cover`]). `Distinct` finds
//! the pixels that are equal, so that each material is computed once. [`Nearest`] is the way back from a
//! curve to a surface, and [`words`] to what people call it.

mod cover;
mod distinct;
mod factored;
mod nearest;
mod pixels;
mod reduced;
mod surface;
mod surfaces;
mod uniform;
mod words;

pub use cover::Cover;
pub(crate) use distinct::Distinct;
pub use factored::Factored;
pub use nearest::{ALPHA, DIELECTRIC, Metallic, Near, Nearest, Widths};
pub use pixels::Materials;
pub use reduced::{Reduced, resolution};
pub use surface::{Coat, Coated, Surface};
pub(crate) use surface::{dielectric, metallic, specular};
pub use surfaces::Surfaces;
pub use uniform::Uniform;
pub(crate) use uniform::check_reflectance;
pub use words::words;
