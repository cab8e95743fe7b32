//! What ribbon costs.
//!
//! Problem: owners know what they paid for a cartridge, and want to know what a sheet costs.
//! Method: ribbon costs its share of a cartridge, if it is known how much ribbon a cartridge gives. Limits: an estimate, as the
//! ribbon is; amounts in different currencies are not added.

use std::fmt;

use serde::Serialize;

/// An amount of money.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// How much.
    pub amount: f64,
    /// Of what, as the owner writes it.
    pub currency: String,
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} {}", self.amount, self.currency)
    }
}

/// What an owner paid for a cartridge.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Price {
    /// Name of its ink.
    pub ink: String,
    /// A whole cartridge.
    pub cartridge: Cost,
    /// How much ribbon one gives in millimetres, if that is known.
    pub ribbon_mm: Option<f64>,
}

impl Price {
    /// What so many millimetres of ribbon cost; `None` if it is not known how much a cartridge gives.
    #[must_use]
    pub fn of(&self, ribbon_mm: f64) -> Option<Cost> {
        let whole = self.ribbon_mm.filter(|&mm| mm > 0.0)?;
        let Cost { amount, currency } = &self.cartridge;
        Some(Cost { amount: amount * ribbon_mm / whole, currency: currency.clone() })
    }
}

/// A sum for each currency, in the order in which they first come.
pub(super) fn sums<'a>(costs: impl Iterator<Item = &'a Cost>) -> Vec<Cost> {
    let mut sums: Vec<Cost> = Vec::new();
    for cost in costs {
        match sums.iter_mut().find(|sum| sum.currency == cost.currency) {
            Some(sum) => sum.amount += cost.amount,
            None => sums.push(cost.clone()),
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ribbon_costs_its_share_and_currencies_stay_apart() {
        let price = |amount, currency: &str, ribbon_mm| Price {
            ink: "white".into(),
            cartridge: Cost { amount, currency: currency.into() },
            ribbon_mm,
        };
        let (euros, yen) = (price(12.0, "EUR", Some(6000.0)), price(900.0, "JPY", Some(3000.0)));
        let costs = [euros.of(500.0), yen.of(10.0), euros.of(1000.0)].map(Option::unwrap);
        let said: Vec<String> = sums(costs.iter()).iter().map(Cost::to_string).collect();
        assert_eq!(said, ["3.00 EUR", "3.00 JPY"]);
        assert_eq!(price(12.0, "EUR", None).of(500.0), None);
        assert_eq!(price(12.0, "EUR", Some(0.0)).of(500.0), None);
    }
}
