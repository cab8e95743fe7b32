//! The order of the layers: as listed in the settings, as numbered in their names, or by the ink library's rules.

use inks::Library;
use observe::Diagnosis;
use protocol::ink::Ink;

use super::super::order;
use super::slot::Slot;

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

/// The slots from the paper up.
pub(super) fn arranged(slots: Vec<Slot>, wanted: &Order, library: &Library) -> Result<Vec<Slot>, Diagnosis> {
    let numbered = slots.iter().all(|slot| slot.place.is_some());
    let twice = (1..slots.len()).find(|&i| slots[..i].iter().any(|slot| slot.ink == slots[i].ink));
    let mut slots = slots;
    match wanted {
        Order::Given => {}
        Order::Default if numbered => slots.sort_by_key(|slot| slot.place),
        Order::Default | Order::Rules => {
            if let Some(twice) = twice {
                let same = slots.iter().filter(|slot| slot.ink == slots[twice].ink);
                let same: Vec<&str> = same.map(|slot| slot.from.as_str()).collect();
                let problem =
                    format!("{} layers are {} ({})", same.len(), slots[twice].ink.name(), same.join(", "));
                let remedy = "merge them, number the names of all layers from the paper up (01-white, 02-black, 03-white), or \
                              keep the given order";
                return Err(Diagnosis::of_setting("order", problem).hint(remedy).set("order", "given"));
            }
            let inks: Vec<Ink> = slots.iter().map(|slot| slot.ink).collect();
            let order = order::by_rules(&inks, library);
            slots.sort_by_key(|slot| order.iter().position(|&ink| ink == slot.ink));
        }
        Order::Inks(order) => return in_order(slots, order),
    }
    Ok(slots)
}

/// The slots as listed. If an ink is listed more often than it has layers, its last layer is repeated.
fn in_order(slots: Vec<Slot>, order: &[Ink]) -> Result<Vec<Slot>, Diagnosis> {
    let wrong = |problem: String| Err(Diagnosis::of_setting("order", problem));
    if let Some(slot) = slots.iter().find(|slot| !order.contains(&slot.ink)) {
        return wrong(format!("{} ({}) is not in the list", slot.ink.name(), slot.from));
    }
    let mut arranged: Vec<Slot> = Vec::new();
    for (at, &ink) in order.iter().enumerate() {
        let of_ink: Vec<&Slot> = slots.iter().filter(|slot| slot.ink == ink).collect();
        let nth = order[..at].iter().filter(|&&before| before == ink).count();
        let times = order.iter().filter(|&&listed| listed == ink).count();
        let Some(last) = of_ink.last() else {
            return wrong(format!("the art has no {}", ink.name()));
        };
        if of_ink.len() > times {
            return wrong(format!("{} has {} layers but is listed {times} times", ink.name(), of_ink.len()));
        }
        let slot = of_ink.get(nth).unwrap_or(last);
        let (from, plane) = (slot.from.clone(), slot.plane.clone());
        arranged.push(Slot { ink, from, place: None, plane, passes: 1 });
    }
    Ok(arranged)
}
