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
                common(&inked.collect::<Vec<_>>(), if those.is_some() { 1 } else { 2 }, [ALIKE, COMMON])
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
fn common(stacks: &[&Factor], least: usize, [alike, common]: [f64; 2]) -> Option<[f64; 3]> {
    if stacks.len() < least || !stacks.iter().any(|factor| factor.differs) {
        return None;
    }
    let whole: f64 = stacks.iter().map(|factor| factor.share).sum();
    let mean: [f64; 3] =
        std::array::from_fn(|c| stacks.iter().map(|f| f.share * f.factor[c]).sum::<f64>() / whole.max(1e-12));
    let is_alike = |factor: &&Factor| {
        (0..3).all(|c| {
            let (off, error) = ((factor.factor[c] - mean[c]).abs(), factor.standard_error[c]);
            off < (alike * (mean[c] - 1.0).abs()).max(2.0 * error)
        })
    };
    let differs = mean.iter().any(|factor| (factor - 1.0).abs() > common);
    (differs && stacks.iter().all(is_alike)).then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figures of stacks that differ by these factors, told as a camera tells them.
    fn stacks(factors: &[f64]) -> Vec<Factor> {
        let figure = |factor: &f64| Factor {
            stack: "MS".into(),
            factor: [*factor; 3],
            standard_error: [0.002; 3],
            share: 0.2,
            differs: (factor - 1.0).abs() > 0.01,
        };
        factors.iter().map(figure).collect()
    }

    /// Paper that is darker makes everything on it brighter by one factor; inks that are off are off by factors of their own. Neither answer
    /// changes if the two choices move by a fifth.
    #[test]
    fn paper_is_told_from_inks_whatever_the_choices_are() {
        for rules in [ALIKE * 0.8, ALIKE, ALIKE * 1.2]
            .into_iter()
            .flat_map(|alike| [COMMON * 0.8, COMMON, COMMON * 1.2].map(|common| [alike, common]))
        {
            let answer = |factors: &[f64]| {
                let stacks = stacks(factors);
                common(&stacks.iter().collect::<Vec<_>>(), 2, rules).map(|mean| mean[1])
            };
            for paper in [0.85, 0.93, 1.1] {
                // Within a tenth of the difference, which is what other inks than the library's add.
                let by = |k: f64| 1.0 + (1.0 / paper - 1.0) * k;
                let found = answer(&[by(0.9), by(1.0), by(1.1)]).expect("the paper");
                assert!((found * paper - 1.0).abs() < 0.01, "{paper}: {found}");
                // One ink is off, and the others are not; or each is by something else.
                assert_eq!(answer(&[by(1.0), 1.0, 1.0]), None);
                assert_eq!(answer(&[by(1.0), by(0.4), by(-0.3)]), None);
            }
            // Nothing that is worth a word.
            assert_eq!(answer(&[1.011, 1.012, 1.013]), None);
            assert_eq!(answer(&[1.2]), None);
        }
    }
}
