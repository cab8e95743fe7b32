//! Mirrors that no ink reaches print as metal, and not as black.

use std::sync::Mutex;

use super::*;
use crate::brdf::reflectances;
use crate::gamut::balls::{Balls, Light};

const SIDE: usize = 16;

/// Lights that choose nothing: three lamps, a bright floor in the dark, and light from behind the viewer.
const OTHERS: [Light; 3] = [
    |l| {
        let lamp = |at: f64| 40.0 * (((l[0] - at).powi(2) + (l[1] - 0.6).powi(2)) / -0.01).exp();
        [0.03 + lamp(-0.6) + lamp(0.0) + lamp(0.6); 3]
    },
    |l| [0.02 + if l[1] < -0.3 { 1.0 } else { 0.0 }; 3],
    |l| [1.2, 1.0, 0.8].map(|c| c * (0.1 + 2.0 * l[2].max(0.0).powi(6))),
];

fn silver(alpha: f32) -> Surface {
    surface([0.0; 3], [0.96, 0.95, 0.91], alpha)
}

/// Smooth silver above, matt red below.
fn silver_and_red() -> Field {
    let red = surface([0.5, 0.04, 0.03], [0.04; 3], 0.5);
    let surfaces = (0..SIDE * SIDE).map(|pixel| if pixel < SIDE * SIDE / 2 { silver(0.025) } else { red });
    Field { space: space(), width: SIDE, surfaces: surfaces.collect() }
}

#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl observe::Observer for Notes {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn end(&self) {}
    fn note(&self, words: &str) {
        self.0.lock().unwrap().push(words.into());
    }
}

fn mapped(document: &Field, inks: &str, intent: Intent) -> (Mapped, Vec<String>) {
    let printable = Printable::combined(&Library::builtin(), &inks.parse().unwrap(), &document.space);
    let settings = GamutSettings { intent, ..GamutSettings::default() };
    let notes = Notes::default();
    let bases = || -> Result<_, GamutError> { panic!("no bases are needed") };
    let mapped = crate::gamut::map(document, bases, &printable, &settings, &notes).unwrap();
    (mapped, notes.0.into_inner().unwrap())
}

/// Inks as most owners have them.
const USUAL: &str = "C,M,Y,K,MS,MG,F";

#[test]
fn smooth_silver_is_silver_without_foil() {
    let document = silver_and_red();
    let red = |mapped: &Mapped| mapped.report.materials[1].weights.clone();
    let (dark, _) = mapped(&document, USUAL, Intent::Clamp);
    let before = &dark.report.materials[0];
    for intent in [Intent::Auto, Intent::Shine] {
        let (bright, notes) = mapped(&document, USUAL, intent);
        assert_eq!(bright.report.intent, Intent::Shine);
        let said: Vec<&String> = notes.iter().filter(|note| note.contains("no ink is as sharp")).collect();
        assert!(
            said.len() == 1
                && said[0].starts_with("silver: ")
                && said[0].contains(" of the light) and not as "),
            "{notes:?}"
        );
        let after = &bright.report.materials[0];
        let albedo = |row: &[f64]| document.space.albedo(row)[1];
        let light = albedo(&after.printed) / albedo(&after.target);
        let bare: Stack = "MS".parse().unwrap();
        let silver: f64 = after.weights.iter().filter(|(stack, _)| *stack == bare).map(|(_, w)| w).sum();
        assert!(light > 1.0 / 3.0 && silver >= 0.5, "{light:.3} of the light, {:?}", after.weights);
        // Nearer under all of them but small lamps in the dark, where a mirror is mostly black, too.
        let balls = Balls::under(&document.space, &OTHERS, 24);
        let apart = |material: &MaterialReport| balls.apart(&material.target, &material.printed);
        assert!(apart(after) < 0.8 * apart(before), "{} {}", apart(after), apart(before));
        for ((stack, with), (other, without)) in red(&bright).iter().zip(red(&dark)) {
            assert!(*stack == other && (with - without).abs() < 1e-9, "red has nothing to do with it");
        }
    }
}

#[test]
fn nothing_changes_where_inks_are_as_sharp() {
    for (document, inks) in [
        (
            Field { surfaces: vec![surface([0.5, 0.04, 0.03], [0.04; 3], 0.5)], width: 1, space: space() },
            USUAL,
        ),
        (Field { surfaces: vec![silver(0.3)], width: 1, space: space() }, "P,SF"),
    ] {
        let (plain, _) = mapped(&document, inks, Intent::Clamp);
        let (asked, notes) = mapped(&document, inks, Intent::Shine);
        assert!(notes.iter().any(|note| note.contains("changes nothing")), "{notes:?}");
        assert_eq!((asked.mix, asked.report), (plain.mix, plain.report));
    }
}

/// Silver that gets duller from one side to the other has no seam, and what is sharper is hardly darker.
#[test]
fn shine_fades_smoothly() {
    let alpha = |i: usize| 0.02 * 20f32.powf(i as f32 / 255.0);
    let document =
        Field { surfaces: (0..256).map(|i| silver(alpha(i))).collect(), width: 256, space: space() };
    let (mapped, _) = mapped(&document, USUAL, Intent::Shine);
    let stacks = reflectances(&mapped.mix.stacks, &Library::builtin(), &document.space);
    let mut shares = vec![0.0; stacks.len()];
    let mut light = |pixel: usize| -> f64 {
        mapped.mix.shares(pixel, &mut shares);
        shares.iter().enumerate().map(|(k, share)| share * document.space.albedo(stacks.row(k))[1]).sum()
    };
    let light: Vec<f64> = (0..256).map(&mut light).collect();
    assert!(light[0] / document.space.albedo(&mapped.report.materials[0].target)[1] > 1.0 / 3.0);
    for pair in light.windows(2) {
        assert!((-0.05..0.1).contains(&(pair[1] / pair[0] - 1.0)), "{light:.3?}");
    }
}
