//! What people call a material: "glossy red", "matt black", "silver".
//!
//! Method: the nearest surface ([`Nearest`]) says whether it is a metal (its highlight is the body's, and
//! above any dielectric's), and its colour; gloss is the word of ISO 2813 ([`inks::gloss::word`]). Colours
//! are named by hue, chroma and lightness of CIELAB.
//! Cost: 2 ms. Limits: one colour and one gloss a material; names are coarse on purpose.

use inks::gloss::{Geometry, of_curve, word};
use palette::{FromColor as _, Lch, LinSrgb, white_point::D65};

use super::nearest::Nearest;
use crate::brdf::Space;

/// Chroma of CIELAB below which a colour has no name but its lightness. Source: three times what is just seen beside grey.
const GREY: f32 = 8.0;
/// Reflectance at normal incidence that no dielectric has: that of diamond, index 2.42.
const DIAMOND: f64 = 0.17;
/// Where names begin, by hue of CIELAB in degrees; each has another for its dark colours, from a lightness
/// down.
const HUES: [(f32, &str, &str, f32); 9] = [
    (0.0, "pink", "red", 60.0),
    (15.0, "red", "red", 0.0),
    (45.0, "orange", "brown", 55.0),
    (80.0, "yellow", "olive", 60.0),
    (110.0, "green", "green", 0.0),
    (175.0, "teal", "teal", 0.0),
    (240.0, "blue", "blue", 0.0),
    (310.0, "violet", "violet", 0.0),
    (340.0, "pink", "red", 60.0),
];

/// What a row (1/sr) of a half-angle space is called.
pub fn words(space: &Space, row: &[f64]) -> String {
    let nearest = Nearest::to(space, row);
    let metallic = nearest.metallic();
    let is_metal = metallic.metallic > 0.5 && nearest.f0.iter().any(|&f| f > DIAMOND);
    let [r, g, b] = if is_metal { metallic.base } else { nearest.diffuse }.map(|v| v.clamp(0.0, 1.0) as f32);
    let Lch { l, chroma, hue, .. } = Lch::<D65>::from_color(LinSrgb::new(r, g, b));
    let hue = hue.into_positive_degrees();
    let (_, pale, dark, from) = *HUES.iter().rfind(|(begins, ..)| *begins <= hue).unwrap_or(&HUES[0]);
    let colour = match () {
        () if chroma >= GREY => {
            if l < from {
                dark
            } else {
                pale
            }
        }
        () if l < 25.0 => "black",
        () if l < 85.0 => "grey",
        () => "white",
    };
    let gloss = word(of_curve([Geometry::SIXTY], &space.curve(row))[0]);
    match colour {
        _ if !is_metal => format!("{gloss} {colour}"),
        "white" | "grey" => "silver".into(),
        "yellow" | "olive" => "gold".into(),
        "orange" | "brown" => "copper".into(),
        "black" => "dark metal".into(),
        other => format!("{other} metal"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::surface::Surface;
    use super::*;

    #[test]
    fn materials_have_the_names_that_people_give_them() {
        let space = Space::half_angle(32);
        for (diffuse, f0, alpha, name) in [
            ([0.4, 0.01, 0.01], [0.06; 3], 0.02, "glossy red"),
            ([0.003; 3], [0.04; 3], 0.6, "matt black"),
            ([0.8; 3], [0.04; 3], 0.1, "satin white"),
            ([0.01, 0.02, 0.2], [0.06; 3], 0.02, "glossy blue"),
            ([0.1, 0.04, 0.015], [0.04; 3], 0.6, "matt brown"),
            ([0.0; 3], [0.97, 0.96, 0.91], 0.2, "silver"),
            ([0.0; 3], [1.0, 0.77, 0.34], 0.2, "gold"),
            ([0.0; 3], [0.95, 0.64, 0.54], 0.2, "copper"),
        ] {
            let surface = Surface { diffuse, f0, alpha };
            let found = words(&space, &space.row(&surface.curve(space.angles())));
            assert_eq!(found, name, "{surface:?}");
        }
    }
}
