//! Gloss of a document's materials and of their print, in the units of a gloss meter and in words.
//!
//! Problem: owners know 20, 60 and 85 degree readings, and nobody reads gloss from a distance d.
//! Method: [`inks::gloss::of_curve`] reads the curves of target and print. Words follow ISO 2813, which
//! measures at 85 degrees below 10 units at 60 degrees and at 20 degrees above 70. A target whose peak is
//! below that of every stack at hand is matter than any ink.
//! Cost: about 1 ms for each curve: one split, and 4096 evaluations a reading. Limits: those of
//! [`inks::gloss::of_curve`]; two lobes over each other read up to 1.3 units less at 85 degrees.

use appearance::brdf::Space;
use appearance::gamut::{MaterialReport, Printable};
use inks::gloss::{Geometry, of_curve, word};
use serde::Serialize;

const GEOMETRIES: [Geometry; 3] = [Geometry::TWENTY, Geometry::SIXTY, Geometry::EIGHTY_FIVE];
/// Gloss of a material before and after mapping.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gloss {
    /// Units at 20, 60 and 85 degrees of the target.
    pub target: [f64; 3],
    /// Those of the print.
    pub printed: [f64; 3],
    /// Whether the peak of the target is below that of every stack at hand.
    pub matter_than_any_ink: bool,
}

/// The lowest reflectance (1/sr) of a stack in its highlight, a mean of the channels.
pub fn lowest_peak(printable: &Printable) -> f64 {
    printable.curves.rows().map(peak).fold(f64::INFINITY, f64::min)
}

fn peak(row: &[f64]) -> f64 {
    row.iter().take(3).sum::<f64>() / 3.0
}

impl Gloss {
    /// Of a material, among stacks with this [lowest peak](lowest_peak).
    pub fn of(space: &Space, material: &MaterialReport, lowest: f64) -> Gloss {
        let read = |row: &[f64]| of_curve(GEOMETRIES, &space.curve(row));
        Gloss {
            target: read(&material.target),
            printed: read(&material.printed),
            matter_than_any_ink: peak(&material.target) < lowest,
        }
    }
}

/// Three readings and their word.
pub fn in_words(units: [f64; 3]) -> String {
    let [a, b, c] =
        units.map(|units| if units < 9.95 { format!("{units:.1}") } else { format!("{units:.0}") });
    format!("{a}, {b}, {c} ({})", word(units[1]))
}

/// What there is to say of all materials, each with its share of the document: that of most of it, the
/// glossiest, and what no ink can print.
pub fn sentences(materials: &[(f64, Gloss)]) -> Vec<String> {
    let most = materials.iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let glossiest = materials.iter().max_by(|a, b| a.1.target[1].total_cmp(&b.1.target[1]));
    let (Some(most), Some(glossiest)) = (most, glossiest) else { return Vec::new() };
    let pair = |gloss: &Gloss| format!("{}, in print {}", in_words(gloss.target), in_words(gloss.printed));
    let mut said = format!("gloss units at 20, 60 and 85 degrees: most of the document {}", pair(&most.1));
    if word(glossiest.1.target[1]) != word(most.1.target[1]) || glossiest.1.target[1] > 1.5 * most.1.target[1]
    {
        said.push_str(&format!("; the glossiest of it {}", pair(&glossiest.1)));
    }
    let mut said = vec![said];
    let matt: f64 =
        materials.iter().filter(|(_, gloss)| gloss.matter_than_any_ink).map(|(share, _)| share).sum();
    if matt >= 0.005 {
        said.push(format!(
            "{:.0} % of the document is matter than any ink: a matt spray would bring it",
            100.0 * matt
        ));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::{InkSet, Library};
    use protocol::ink::Ink;

    fn material(space: &Space, target: Vec<f64>, printed: Vec<f64>) -> MaterialReport {
        let distance = space.distance(&target, &printed);
        MaterialReport {
            share: 0.5,
            target,
            printed,
            distance,
            unscaled_distance: distance,
            light: 0.0,
            weights: Vec::new(),
            gap: 0.0,
            convex: true,
            starts: 1,
            agreeing: 1,
            pruning_cost: 0.0,
        }
    }

    /// Black felt reflects less in its highlight than any stack; the same as a lobe does not.
    #[test]
    fn what_is_matter_than_any_ink_is_said() {
        let space = Space::half_angle(32);
        let printable = Printable::combined(&Library::builtin(), &InkSet::of(Ink::ALL), &space);
        let lowest = lowest_peak(&printable);
        assert!(printable.curves.rows().all(|row| row[0] + row[1] + row[2] >= 3.0 * lowest));
        let felt = vec![0.9 * lowest; space.columns()];
        let grey = vec![1.1 * lowest; space.columns()];
        let [felt, grey] =
            [felt, grey].map(|row| Gloss::of(&space, &material(&space, row.clone(), row), lowest));
        assert!(felt.matter_than_any_ink && !grey.matter_than_any_ink);
        let said = sentences(&[(0.25, felt), (0.75, grey)]);
        assert!(said[1].starts_with("25 % of the document is matter than any ink: a matt spray"), "{said:?}");
        assert_eq!(sentences(&[(1.0, grey)]).len(), 1);
        assert!(sentences(&[]).is_empty());
    }

    /// Readings are those of the lobes behind the curves, on the grid of documents.
    #[test]
    fn units_are_those_of_the_lobes() {
        let space = Space::half_angle(32);
        let library = Library::builtin();
        for stack in ["K", "C+F", "MS", "P+SF", "substrate"] {
            let lobes = library.optics().lobes(&stack.parse().unwrap()).unwrap();
            let row: Vec<f64> = space.angles().iter().flat_map(|&t| lobes.at(t)).collect();
            let gloss = Gloss::of(&space, &material(&space, row.clone(), row), 0.0);
            assert_eq!(gloss.target, gloss.printed);
            for (geometry, found) in GEOMETRIES.into_iter().zip(gloss.target) {
                let expected = inks::gloss::reading(geometry, &lobes);
                assert!(
                    (found - expected).abs() < 0.1 * expected + 1.3,
                    "{stack} {geometry:?}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn words_follow_the_reading_at_60_degrees() {
        for (at, said) in [(9.9, "matt"), (10.0, "satin"), (69.9, "satin"), (70.0, "glossy")] {
            assert_eq!(word(at), said);
        }
        assert_eq!(in_words([1.25, 9.94, 45.4]), "1.2, 9.9, 45 (matt)");
    }
}
