//! The order of inks from the paper up.
//!
//! Problem: art shows which inks meet, but seldom which lies beneath. The ink library knows which ink may lie on which.
//! Method: every order of the inks is a stack. The best one breaks the fewest rules: errors are compared first, then
//! warnings, then notes. Ties go to the order nearest the customary one (undercoats first, opaque below transparent, clear
//! coat last). Cost: at most 8! orders, some milliseconds. More than eight inks, which no printer holds at once, take the
//! customary order. Limits: rules are tested on a stack of all inks, whether or not they meet in the art.

use inks::{Library, Severity, Stack};
use protocol::ink::Ink;

use sheet::order::customary;

/// The most inks of which every order is tried: eight have 40,320 orders, which take no time, nine would have
/// nine times as many.
const MOST_TRIED: usize = 8;

/// The inks from the paper up.
pub(crate) fn by_rules(inks: &[Ink], library: &Library) -> Vec<Ink> {
    let mut order = inks.to_vec();
    order.sort_by_key(|&ink| customary(ink));
    order.dedup();
    if order.len() > MOST_TRIED {
        return order;
    }
    let mut best: Option<([usize; 3], Vec<Ink>)> = None;
    // Orders nearer to the customary one come first, so the first of equals is kept.
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

/// Visits every order of `rest` after `done`, starting with those nearest to the given order.
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
    use files::shelf::Disk;

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
        let library = Library::open(&Disk, folder.path()).unwrap();
        assert_eq!(by_rules(&[White, MetallicGold, Black], &library), [MetallicGold, White, Black]);
    }
}
