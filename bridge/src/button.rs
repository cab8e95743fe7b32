//! The button: short and long presses, from a contact that bounces.
//!
//! A short press counts when the button is released, so that it is none if it becomes a long one; a long press counts while the
//! button is still down, so that the person sees by the lamp when to let go. What they mean is decided in
//! [`Engine::press`](crate::engine::Engine::press).

/// How long the contact has to stay as it is to be believed, in ms.
const BOUNCE_MS: u32 = 30;

/// How long a long press is, in ms.
pub const LONG_MS: u32 = 3000;

/// A press.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Press {
    /// Pressed and released: start, hold, or go on.
    Short,
    /// Held down for [`LONG_MS`]: cancel.
    Long,
}

/// The button.
#[derive(Default)]
pub struct Button {
    /// The contact as it was last seen, and since when.
    contact: bool,
    since_ms: u32,
    /// Since when the button is down, and whether that has become a long press.
    down: Option<(u32, bool)>,
}

impl Button {
    /// A button that is not pressed.
    pub const fn new() -> Self {
        Button { contact: false, since_ms: 0, down: None }
    }

    /// Looks at the contact, by a clock in ms that may wrap. To be called every 10 ms or so.
    pub fn look(&mut self, closed: bool, now_ms: u32) -> Option<Press> {
        if closed != self.contact {
            (self.contact, self.since_ms) = (closed, now_ms);
        }
        if now_ms.wrapping_sub(self.since_ms) < BOUNCE_MS {
            return None;
        }
        match (self.contact, self.down) {
            (true, None) => {
                self.down = Some((self.since_ms, false));
                None
            }
            (true, Some((since, false))) if now_ms.wrapping_sub(since) >= LONG_MS => {
                self.down = Some((since, true));
                Some(Press::Long)
            }
            (true, Some(_)) | (false, None) => None,
            (false, Some((_, long))) => {
                self.down = None;
                (!long).then_some(Press::Short)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn a_button_that_is_held_down_from_the_start_counts_once() {
        let mut button = Button::new();
        let presses: Vec<Press> = (0..400).filter_map(|step| button.look(true, step * 20)).collect();
        assert_eq!(presses, [Press::Long]);
    }

    proptest! {
        /// Bounces of less than 30 ms on either edge change nothing; the length of the press decides.
        #[test]
        fn presses_are_told_by_their_length(
            presses in prop::collection::vec((100u32..6000, 100u32..1000, 0u32..28, 0u32..28), 1..8),
            begin in any::<u32>(),
        ) {
            prop_assume!(presses.iter().all(|press| press.0.abs_diff(LONG_MS) > 100));
            let (mut button, mut now, mut seen) = (Button::new(), begin, Vec::new());
            let mut look = |closed: bool, ms: u32| {
                for _ in 0..ms {
                    now = now.wrapping_add(1);
                    seen.extend(button.look(closed, now));
                }
            };
            look(false, 50);
            for &(down, up, bounce, rebound) in &presses {
                look(true, bounce / 2);
                look(false, bounce / 2);
                look(true, down);
                look(false, rebound / 2);
                look(true, rebound / 2);
                look(false, up);
            }
            let expected: Vec<Press> = presses
                .iter()
                .map(|press| if press.0 > LONG_MS { Press::Long } else { Press::Short })
                .collect();
            prop_assert_eq!(seen, expected);
        }
    }
}
