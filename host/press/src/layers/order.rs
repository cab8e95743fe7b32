//! From the paper up: in which order inks are laid.
//!
//! Problem: art says which inks meet, seldom which lies beneath. What may lie on what is knowledge of the ink library.
//! Method: every order of the inks is a stack; the one that breaks the fewest rules is taken, errors counting before
//! warnings before notes, and of equals the customary one (undercoats first, opaque below transparent, clear coat
//! last). Cost: at most 8! orders, some milliseconds; more inks, which no machine holds at once, lie in the customary order.
//! Limits: rules are tried on all inks on top of each other, whether or not they meet on the art.

use inks::{Library, Severity, Stack};
use protocol::ink::Ink;

use crate::sheet::order::customary;

/// The most inks whose orders are all tried.
const MOST_TRIED: usize = 8;

/// The inks from the paper up.
pub(super) fn by_rules(inks: &[Ink], library: &Library) -> Vec<Ink> {
    let mut order = inks.to_vec();
    order.sort_by_key(|&ink| customary(ink));
    order.dedup();
    if order.len() > MOST_TRIED {
        return order;
    }
    let mut best: Option<([usize; 3], Vec<Ink>)> = None;
    // Orders come in ascending distance from the customary one, so the first of equals is the one to keep.
    permutations(&mut Vec::new(), &order, &mut |tried| {
        let stack = Stack::new(tried);
        let broken = library.broken_rules(&stack);
        let count = |severity| broken.iter().filter(|rule| rule.severity == severity).count();
        let cost = [Severity::Error, Severity::Warning, Severity::Note].map(count);
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, tried.to_vec()));
        }
    });
    best.map_or(order, |(_, order)| order)
}

/// Every order of `rest` after `done`, those nearest the given order first.
fn permutations(done: &mut Vec<Ink>, rest: &[Ink], visit: &mut impl FnMut(&[Ink])) {
    if rest.is_empty() {
        return visit(done);
    }
    for at in 0..rest.len() {
        done.push(rest[at]);
        permutations(done, &[&rest[..at], &rest[at + 1..]].concat(), visit);
        done.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Ink::*;

    fn order(inks: &[Ink]) -> Vec<Ink> {
        by_rules(inks, &Library::builtin())
    }

    #[test]
    fn undercoats_lie_beneath_and_coats_on_top() {
        assert_eq!(order(&[Black, White, MetallicGold]), [White, MetallicGold, Black]);
        assert_eq!(order(&[Finish, Cyan, White, Primer, Black]), [Primer, White, Cyan, Black, Finish]);
    }

    #[test]
    fn foil_lies_on_the_process_inks() {
        let inks = order(&[SilverFoil, Black, Yellow, Magenta, Cyan, White]);
        assert_eq!(inks, [White, Cyan, Magenta, Yellow, Black, SilverFoil]);
        assert_eq!(order(&[MetallicSilver, Cyan, GoldFoil]), [MetallicSilver, Cyan, GoldFoil]);
    }

    #[test]
    fn the_owners_rules_decide() {
        let folder = tempfile::tempdir().unwrap();
        let rule = "format = 1\nbased_on = \"built-in\"\n[[rule]]\nname = \"mine\"\nsays = \"white peels under gold\"\n\
                    severity = \"error\"\ncertainty = \"measured\"\nover = \"metallic-gold\"\nunder = \"white\"\n";
        std::fs::write(folder.path().join("library.toml"), rule).unwrap();
        let library = Library::from_dir(folder.path()).unwrap();
        assert_eq!(by_rules(&[White, MetallicGold, Black], &library), [MetallicGold, White, Black]);
    }
}
