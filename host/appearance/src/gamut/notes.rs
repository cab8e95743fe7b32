//! What a mapping says of its choices.

use observe::Observer;

use super::fitting::basis::Bases;
use super::result::report::Worth;

/// Says by how much the gloss of all bases was reduced.
pub(super) fn say_gloss(bases: &Bases, observer: &dyn Observer) {
    if let Some(factor) = bases.gloss_scale {
        observer.note(&format!(
            "the gloss of all materials is reduced to {:.0} %, so that the glossiest ones still differ in \
             print",
            100.0 * factor
        ));
    }
}

/// A share in words.
fn percent(share: f64) -> String {
    match 100.0 * share {
        small if small < 0.1 => format!("{small:.2} %"),
        small if small < 1.0 => format!("{small:.1} %"),
        large => format!("{large:.0} %"),
    }
}

/// Which cartridges were left out because they bring nothing to any material.
pub(super) fn spared_in_words(spared: &[Worth]) -> Option<String> {
    let names: Vec<&str> = spared.iter().map(|spared| spared.ink.name()).collect();
    let most = spared.iter().map(|spared| spared.without - spared.with).reduce(f64::max)?;
    Some(format!(
        "left out, because no material gains by them: {} (at most {:.4}, where 0.01 is barely visible)",
        names.join(", "),
        most.max(0.0)
    ))
}

/// Which were left out for the number of cartridges, and which material pays.
pub(super) fn in_words(given_up: &[Worth], most: usize) -> Option<String> {
    let each = given_up.iter().map(|Worth { ink, material, share, with, without, hue }| {
        let share = percent(*share);
        let hue = if *hue >= 0.005 {
            format!("; {} of the sheet lose their hue", percent(*hue))
        } else {
            String::new()
        };
        format!(
            "{} (the {material}, {share} of the sheet, pays: {with:.3} with it, {without:.3} without{hue})",
            ink.name()
        )
    });
    let each: Vec<String> = each.collect();
    let listed = match each.split_last()? {
        (last, []) => format!("{last} is"),
        (last, others) => format!("{} and {last} are", others.join(", ")),
    };
    Some(format!("{listed} left out to use at most {most} cartridges"))
}
