//! A stack: the layers of ink on one dot, bottom to top. The empty stack is the bare substrate.

use std::fmt;
use std::str::FromStr;

use protocol::ink::Ink;
use serde::{Deserialize, Serialize};

/// Layers of ink on one dot, bottom to top. Text form: short names joined by `+`, such as `MS+C+F`; the bare substrate is
/// `substrate`. Long names are accepted too.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Stack(Vec<Ink>);

/// Why a text is not a stack.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StackError {
    /// A layer is not a known ink.
    #[error("`{layer}` in the stack `{stack}` is not an ink; the inks are {}", known())]
    UnknownInk {
        /// The whole text.
        stack: String,
        /// The layer.
        layer: String,
    },
}

fn known() -> String {
    Ink::ALL.map(|ink| format!("{} ({})", ink.short(), ink.name())).join(", ")
}

impl Stack {
    /// The bare substrate.
    pub const SUBSTRATE: Stack = Stack(Vec::new());

    /// A stack with these layers, bottom to top.
    pub fn new(layers: impl Into<Vec<Ink>>) -> Stack {
        Stack(layers.into())
    }

    /// The layers, bottom to top.
    pub fn layers(&self) -> &[Ink] {
        &self.0
    }
}

impl fmt::Display for Stack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.pad("substrate");
        }
        f.pad(&self.0.iter().map(|ink| ink.short()).collect::<Vec<_>>().join("+"))
    }
}

impl FromStr for Stack {
    type Err = StackError;

    fn from_str(text: &str) -> Result<Stack, StackError> {
        if text.trim().eq_ignore_ascii_case("substrate") {
            return Ok(Stack::SUBSTRATE);
        }
        text.split('+')
            .map(|layer| {
                let layer = layer.trim();
                crate::names::ink(layer)
                    .ok_or_else(|| StackError::UnknownInk { stack: text.into(), layer: layer.into() })
            })
            .collect::<Result<Vec<_>, _>>()
            .map(Stack)
    }
}

impl TryFrom<String> for Stack {
    type Error = StackError;

    fn try_from(text: String) -> Result<Stack, StackError> {
        text.parse()
    }
}

impl From<Stack> for String {
    fn from(stack: Stack) -> String {
        stack.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stacks_and_their_texts_correspond() {
        for text in ["substrate", "MS+C+F", "P+SF", "K"] {
            assert_eq!(text.parse::<Stack>().unwrap().to_string(), text);
        }
        let long: Stack = "metallic-silver + cyan".parse().unwrap();
        assert_eq!(long.layers(), [Ink::MetallicSilver, Ink::Cyan]);
        assert!("MS+tin".parse::<Stack>().unwrap_err().to_string().contains("`tin`"));
    }
}
