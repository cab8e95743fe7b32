//! The order of the layers: as listed in the settings, as numbered in their names, or by the ink library's rules.

use inks::Library;
use observe::Diagnosis;
use protocol::ink::Ink;

use super::separation::Separation;
use crate::dots::order;

/// The order of layers from the paper up.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Order {
    /// By the numbers in the layers' names if all have one, otherwise by the ink library's rules.
    #[default]
    Default,
    /// By the ink library's rules.
    Rules,
    /// In the order of the files or layers, the first lowest.
    Given,
    /// In this order. An ink may be listed twice: its layer is printed at both depths.
    Inks(Vec<Ink>),
}

/// The separations from the paper up.
pub(super) fn arranged(
    separations: Vec<Separation>,
    wanted: &Order,
    library: &Library,
) -> Result<Vec<Separation>, Diagnosis> {
    let numbered = separations.iter().all(|separation| separation.place.is_some());
    let twice = (1..separations.len())
        .find(|&i| separations[..i].iter().any(|separation| separation.ink == separations[i].ink));
    let mut separations = separations;
    match wanted {
        Order::Given => {}
        Order::Default if numbered => separations.sort_by_key(|separation| separation.place),
        Order::Default | Order::Rules => {
            if let Some(twice) = twice {
                let same = separations.iter().filter(|separation| separation.ink == separations[twice].ink);
                let same: Vec<&str> = same.map(|separation| separation.from.as_str()).collect();
                let problem = format!(
                    "{} layers are {} ({})",
                    same.len(),
                    separations[twice].ink.name(),
                    same.join(", ")
                );
                let remedy = "merge them, number the names of all layers from the paper up (01-white, 02-black, 03-white), or \
                              keep the given order";
                return Err(Diagnosis::of_setting("order", problem).hint(remedy).set("order", "given"));
            }
            let inks: Vec<Ink> = separations.iter().map(|separation| separation.ink).collect();
            let order = order::by_rules(&inks, library);
            separations.sort_by_key(|separation| order.iter().position(|&ink| ink == separation.ink));
        }
        Order::Inks(order) => return in_order(separations, order),
    }
    Ok(separations)
}

/// The separations as listed. If an ink is listed more often than it has layers, its last layer is repeated.
fn in_order(separations: Vec<Separation>, order: &[Ink]) -> Result<Vec<Separation>, Diagnosis> {
    let wrong = |problem: String| Err(Diagnosis::of_setting("order", problem));
    if let Some(separation) = separations.iter().find(|separation| !order.contains(&separation.ink)) {
        return wrong(format!("{} ({}) is not in the list", separation.ink.name(), separation.from));
    }
    let mut arranged: Vec<Separation> = Vec::new();
    for (at, &ink) in order.iter().enumerate() {
        let of_ink: Vec<&Separation> =
            separations.iter().filter(|separation| separation.ink == ink).collect();
        let nth = order[..at].iter().filter(|&&before| before == ink).count();
        let times = order.iter().filter(|&&listed| listed == ink).count();
        let Some(last) = of_ink.last() else {
            return wrong(format!("the art has no {}", ink.name()));
        };
        if of_ink.len() > times {
            return wrong(format!("{} has {} layers but is listed {times} times", ink.name(), of_ink.len()));
        }
        let separation = of_ink.get(nth).unwrap_or(last);
        let (from, plane) = (separation.from.clone(), separation.plane.clone());
        arranged.push(Separation { ink, from, place: None, plane, passes: 1 });
    }
    Ok(arranged)
}
