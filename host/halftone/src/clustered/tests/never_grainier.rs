//! The search never makes dots grainier.

use super::*;
use crate::contrast_sensitivity::{Tangent, error_planes};
use appearance::brdf::{Space, reflectances};

const SIDE: usize = 512;

/// Error seen from 0.3 m of a mixture on a square page; `shares` at (u, v) from 0 to 1 is what it asks for.
fn seen(
    names: &[&str],
    minimum: &[u16],
    pixels: usize,
    shares: impl Fn(f64, f64) -> Vec<f64>,
    method: Method,
) -> f64 {
    let mut mix = plain(pixels, pixels, names.len(), |x, y| {
        let at = |i: usize| (i as f64 + 0.5) / pixels as f64;
        shares(at(x), at(y))
    });
    mix.stacks = names.iter().map(|name| name.parse().unwrap()).collect();
    let space = Space::half_angle(32);
    let table = reflectances(&mix.stacks, &Library::builtin(), &space);
    let tangent = Tangent::of_mix(&mix, &space, &table);
    let settings = Settings { method, minimum: minimum.to_vec(), reflectance: Some(table) };
    let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
    let place = |i: usize| (i as f64 + 0.5) / SIDE as f64;
    let asked: Vec<f32> = (0..SIDE * SIDE)
        .flat_map(|dot| shares(place(dot % SIDE), place(dot / SIDE)))
        .map(|share| share as f32)
        .collect();
    errors_seen(&error_planes(sheet.index(), &asked, &tangent), &Eye::new(SIDE, SIDE, &[0.3]))[0]
}

/// Shares of the stacks at a place, which is 0 to 1 across and down.
type Tones<'a> = &'a dyn Fn(f64, f64) -> Vec<f64>;

/// The search does not see less than the cells that it starts from, with rare stacks far from all others beside those in use, with
/// shadings and with texture.
#[test]
fn the_search_is_never_grainier() {
    let names = ["substrate", "SF", "MM+C+K", "P+SF", "MM", "MS", "MS+C+F", "K"];
    let rare = |_: f64, _: f64| vec![0.04, 0.28, 0.25, 0.20, 0.01, 0.01, 0.01, 0.20];
    let shading =
        |u: f64, v: f64| vec![0.04, 0.6 * (1.0 - u), 0.6 * u, 0.2 * v, 0.01, 0.01, 0.01, 0.33 - 0.2 * v];
    let texture = |u: f64, v: f64| {
        let n = noise(3, (u * 128.0) as usize, (v * 128.0) as usize, 1);
        vec![0.04, 0.6 * (1.0 - n), 0.6 * n, 0.2 * v, 0.01, 0.01, 0.01, 0.33 - 0.2 * v]
    };
    let kinds: [(&str, Tones<'_>); 3] = [("flat", &rare), ("shading", &shading), ("texture", &texture)];
    for (kind, shares) in kinds {
        let minimum = [8, 16, 8, 16, 8, 8, 8, 8];
        let at = |method| seen(&names, &minimum, 128, shares, method);
        let (cells, best) = (at(Method::Cells), at(Method::Best));
        assert!(best <= cells, "{kind}: {best} {cells}");
    }
}
