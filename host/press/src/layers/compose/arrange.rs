//! The order of the layers: as the user lists it, as numbered names say, or by the ink library's rules.

use inks::Library;
use protocol::ink::Ink;

use super::super::{LayersError, order};
use super::Slot;

/// In which order layers lie on the paper.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Order {
    /// As their numbered names say if all are numbered, otherwise by the ink library's rules.
    #[default]
    Usual,
    /// By the ink library's rules.
    Rules,
    /// As given, first lowest.
    Given,
    /// In this order from the paper up. An ink may stand twice: its layer is laid at both depths.
    Inks(Vec<Ink>),
}

/// The slots from the paper up.
pub(super) fn arranged(
    slots: Vec<Slot>,
    wanted: &Order,
    library: &Library,
) -> Result<Vec<Slot>, LayersError> {
    let numbered = slots.iter().all(|slot| slot.place.is_some());
    let twice = (1..slots.len()).find(|&i| slots[..i].iter().any(|slot| slot.ink == slots[i].ink));
    let mut slots = slots;
    match wanted {
        Order::Given => {}
        Order::Usual if numbered => slots.sort_by_key(|slot| slot.place),
        Order::Usual | Order::Rules => {
            if let Some(twice) = twice {
                return Err(LayersError::Setting {
                    option: "--order",
                    problem: format!(
                        "{} layers are of {}; say at which depth each lies: number the files from the paper up \
                         (01-white.png, 02-black.png, 03-white.png), or use --order given",
                        slots.iter().filter(|slot| slot.ink == slots[twice].ink).count(),
                        slots[twice].ink.name()
                    ),
                });
            }
            let inks: Vec<Ink> = slots.iter().map(|slot| slot.ink).collect();
            let order = order::by_rules(&inks, library);
            slots.sort_by_key(|slot| order.iter().position(|&ink| ink == slot.ink));
        }
        Order::Inks(order) => return in_order(slots, order),
    }
    Ok(slots)
}

/// The slots as listed; an ink listed more often than it has layers is laid there again.
fn in_order(slots: Vec<Slot>, order: &[Ink]) -> Result<Vec<Slot>, LayersError> {
    let wrong = |problem: String| Err(LayersError::Setting { option: "--order", problem });
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
            return wrong(format!("{} has {} layers and is listed {times} times", ink.name(), of_ink.len()));
        }
        let slot = of_ink.get(nth).unwrap_or(last);
        let (from, plane) = (slot.from.clone(), slot.plane.clone());
        arranged.push(Slot { ink, from, place: None, plane, passes: 1 });
    }
    Ok(arranged)
}
