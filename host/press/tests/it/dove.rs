//! The sample that is hard for the paper's own settings: a rare green twig beside silver and much blue.

use std::borrow::Cow;

use appearance::brdf::reflectances;
use appearance::document;
use appearance::factor::{FactorSettings, Method, factor};
use appearance::gamut::{GamutError, GamutSettings, Intent, Printable, map};
use appearance::materials::{Materials, Reduced};
use inks::{InkSet, Library};
use observe::Silent;

/// Half angle at which bodies are seen, beside every highlight.
const ASIDE: f64 = 1.0;

#[test]
fn a_rare_green_twig_prints_green_with_the_papers_settings() {
    let document = document::open("sample:dove", &Default::default(), &Silent).unwrap();
    let reduced = Reduced::new(document.materials(), (320, 240));
    let settings = FactorSettings { method: Method::Sacls, seed: 1, ..FactorSettings::default() };
    let factored = factor(&reduced, &settings, &Silent).unwrap().factored;
    let (library, space) = (Library::builtin(), reduced.space());
    let printable = Printable::combined(&library, &InkSet::default(), space);
    let settings = GamutSettings { intent: Intent::Basis, light: 0.0, seed: 1, ..GamutSettings::default() };
    let bases = || Ok::<_, GamutError>(Cow::Borrowed(&factored));
    let mix = map(&reduced, bases, &printable, &settings, &Silent).unwrap().mix;
    let curves = reflectances(&mix.stacks, &library, space);
    let looks: Vec<[f64; 3]> = curves.rows().map(|row| space.curve(row).at(ASIDE)).collect();
    let (mut twig, mut green) = (0, 0);
    let (mut row, mut shares) = (vec![0.0f32; space.columns()], vec![0.0; looks.len()]);
    for pixel in 0..320 * 240 {
        reduced.reflectance(pixel, &mut row);
        let wide: Vec<f64> = row.iter().map(|&f| f64::from(f)).collect();
        let [r, g, b] = space.curve(&wide).at(ASIDE);
        if g > 1.3 * r && g > 1.3 * b {
            twig += 1;
            mix.shares(pixel, &mut shares);
            let mean = |c: usize| shares.iter().zip(&looks).map(|(s, look)| s * look[c]).sum::<f64>();
            green += usize::from(mean(1) > mean(0) && mean(1) > mean(2));
        }
    }
    assert!(twig > 300, "the twig has {twig} pixels");
    assert!(green * 10 > twig * 8, "{green} of {twig} pixels of the twig print green");
}
