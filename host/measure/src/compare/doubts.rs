//! Whether it is the paper that differs, and not the inks.
//!
//! Problem: the bare paper sets exposure and white balance, as the library says it is. Paper that is darker makes whatever hides it look brighter, and
//! inks that let it through as predicted; one metal that is brighter looks the same. Method: stacks that hide the paper, or all stacks, that differ alike in
//! most photographs. Limits: what it was cannot be told without a card, so it is said and not corrected.

use inks::Stack;
use protocol::ink::Kind;

use super::comparison::PhotoFigures;
use super::figures::Factor;

/// Stacks differ alike if they do within this part of what they differ by.
const ALIKE: f64 = 0.3;
/// The least common difference that is worth a word.
const COMMON: f64 = 0.02;

/// What to think of the paper.
pub(super) fn of_paper(photos: &[PhotoFigures]) -> Option<String> {
    let hides = |stack: &Stack| {
        stack.layers().iter().any(|ink| matches!(ink.kind(), Kind::Metallic | Kind::Foil | Kind::White))
    };
    for (which, those) in
        [("all stacks", None), ("the stacks that hide the paper", Some(&hides as &dyn Fn(&Stack) -> bool))]
    {
        let mut found: Vec<[f64; 3]> = photos
            .iter()
            .filter_map(|photo| {
                let inked = photo.stacks.iter().filter(|factor| {
                    factor.stack.parse::<Stack>().is_ok_and(|stack| {
                        !stack.layers().is_empty() && those.is_none_or(|those| those(&stack))
                    })
                });
                common(&inked.collect::<Vec<_>>(), if those.is_some() { 1 } else { 2 })
            })
            .collect();
        if !found.is_empty() && 2 * found.len() > photos.len() {
            found.sort_by(|a, b| a[1].total_cmp(&b[1]));
            let by = found[found.len() / 2].map(|factor| 100.0 * (factor - 1.0));
            return Some(format!(
                "{which} differ alike (by {:+.0}, {:+.0}, {:+.0} % in red, green and blue), as if not they but the paper were other than the \
                 library says, for the paper is the white; lay a grey card beside the sheet and give white = \"card\"",
                by[0], by[1], by[2]
            ));
        }
    }
    None
}

/// The factor that these stacks have in common, if there are as many and they differ alike.
fn common(stacks: &[&Factor], least: usize) -> Option<[f64; 3]> {
    if stacks.len() < least || !stacks.iter().any(|factor| factor.differs) {
        return None;
    }
    let whole: f64 = stacks.iter().map(|factor| factor.share).sum();
    let mean: [f64; 3] =
        std::array::from_fn(|c| stacks.iter().map(|f| f.share * f.factor[c]).sum::<f64>() / whole.max(1e-12));
    let alike = |factor: &&Factor| {
        (0..3).all(|c| {
            let (off, error) = ((factor.factor[c] - mean[c]).abs(), factor.standard_error[c]);
            off < (ALIKE * (mean[c] - 1.0).abs()).max(2.0 * error)
        })
    };
    let differs = mean.iter().any(|factor| (factor - 1.0).abs() > COMMON);
    (differs && stacks.iter().all(alike)).then_some(mean)
}
