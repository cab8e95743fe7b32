//! The library: cartridges, the stacks they print, and the reflectance of each stack.

use protocol::ink::Ink;

use crate::curve::Curve;
use crate::format::Caution;
use crate::lobes::Lobes;
use crate::model::Optics;
use crate::provenance::{Figure, Provenance, Trust};
use crate::rule::{Rule, Severity};
use crate::set::InkSet;
use crate::stack::Stack;
use crate::uncertainty::Uncertainty;

/// A cartridge as it is sold.
#[derive(Clone, Debug, PartialEq)]
pub struct Cartridge {
    /// Its ink; [`Ink`] has the code, barcode and part number.
    pub ink: Ink,
    /// The name on Okidata's box.
    pub okidata: String,
    /// The name on ALPS's box.
    pub alps: String,
    /// The smallest cluster that prints reliably, in dots of 1/600 inch.
    pub minimum_cluster: Figure<u16>,
    /// What a ramp chart said about its dots, if one was read.
    pub dots: Option<Dots>,
    /// Advice for owners.
    pub cautions: Vec<Caution>,
}

/// What a ramp chart said about the dots of an ink. The minimum cluster it gave is that of the cartridge.
#[derive(Clone, Debug, PartialEq)]
pub struct Dots {
    /// How far the ink reaches beyond its dots, in micrometres, if that was measured.
    pub dot_gain_um: Option<f64>,
    /// Who measured.
    pub by: String,
    /// When.
    pub when: String,
    /// With what.
    pub setup: String,
}

/// A stack and its reflectance.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its position in the library, counted from zero.
    pub number: usize,
    /// The layers.
    pub stack: Stack,
    /// Reflectance in 1/sr over the half angle. A modelled curve is sampled at 512 angles of the square-root grid;
    /// [`Entry::curve_at`] evaluates it at other angles without interpolation.
    pub curve: Curve,
    /// The standard deviation of the curve, if it was measured or predicted and its file has one.
    pub uncertainty: Option<Uncertainty>,
    /// The modelled lobes; none if the curve was measured or predicted.
    pub lobes: Option<Lobes>,
    /// The source of the curve.
    pub provenance: Provenance,
}

impl Entry {
    /// The curve at the given angles (radians, ascending): a model is evaluated, a measurement interpolated.
    pub fn curve_at(&self, theta: &[f64]) -> Curve {
        match &self.lobes {
            Some(lobes) => lobes.curve(theta),
            None => Curve::sampled(theta, |t| self.curve.at(t)),
        }
    }
}

/// Cartridges, stacks, curves and rules: built in, or read from a folder by the same code.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    pub(crate) name: String,
    pub(crate) about: String,
    pub(crate) licence: Option<String>,
    pub(crate) optics: Optics,
    pub(crate) cartridges: Vec<Cartridge>,
    pub(crate) rules: Vec<Rule>,
    pub(crate) entries: Vec<Entry>,
    pub(crate) trust: Trust,
}

/// How many curves of a library are of each origin, in words: `57 stacks: 3 measured, 54 modelled`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Origins {
    /// Measured.
    pub measured: usize,
    /// Predicted from measurements.
    pub predicted: usize,
    /// Modelled from the figures of the library.
    pub modelled: usize,
}

impl Origins {
    /// Counts these curves.
    pub fn count<'a>(entries: impl IntoIterator<Item = &'a Entry>) -> Origins {
        let mut counted = Origins::default();
        for entry in entries {
            match &entry.provenance {
                Provenance::Measured { .. } => counted.measured += 1,
                Provenance::Predicted { .. } => counted.predicted += 1,
                Provenance::Modelled { .. } => counted.modelled += 1,
            }
        }
        counted
    }
}

impl std::fmt::Display for Origins {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Origins { measured, predicted, modelled } = self;
        let all = measured + predicted + modelled;
        write!(f, "{all} stack{}: {measured} measured, ", if all == 1 { "" } else { "s" })?;
        if *predicted > 0 {
            write!(f, "{predicted} predicted from measurements, ")?;
        }
        write!(f, "{modelled} modelled")
    }
}

impl Library {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// A description in one sentence.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// The licence that its owner gives it under, if there is one.
    pub fn licence(&self) -> Option<&str> {
        self.licence.as_deref()
    }

    /// How many of its curves are measured, predicted and modelled.
    pub fn origins(&self) -> Origins {
        Origins::count(&self.entries)
    }

    /// The stacks; number 0 is the bare substrate.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The entry of a stack.
    pub fn entry(&self, stack: &Stack) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.stack == *stack)
    }

    /// The same library, of which only curves of such an origin may be used. The bare paper may be used whatever its origin: no
    /// print is without it.
    #[must_use]
    pub fn trusting(mut self, trust: Trust) -> Library {
        self.trust = trust;
        self
    }

    /// Which of its curves may be used.
    pub fn trust(&self) -> Trust {
        self.trust
    }

    /// The stacks that need only these inks, whose curves may be used, and that break no rule of severity [`Severity::Error`],
    /// in the order of the library. The substrate is always among them.
    pub fn at_hand(&self, inks: &InkSet) -> Vec<&Entry> {
        let forbidden =
            |stack: &Stack| self.broken_rules(stack).iter().any(|rule| rule.severity == Severity::Error);
        let usable = |entry: &&Entry| {
            inks.contains_all(entry.stack.layers())
                && !forbidden(&entry.stack)
                && (self.trust.includes(&entry.provenance) || entry.stack == Stack::SUBSTRATE)
        };
        self.entries.iter().filter(usable).collect()
    }

    /// Those of some stacks whose curves were neither measured nor predicted from what was. The library need
    /// not list them.
    pub fn modelled<'a>(&self, stacks: impl IntoIterator<Item = &'a Stack>) -> Vec<&'a Stack> {
        let by_whom = |stack: &Stack| self.entry(stack).map(|entry| &entry.provenance);
        let is_modelled = |stack: &&Stack| matches!(by_whom(stack), None | Some(Provenance::Modelled { .. }));
        stacks.into_iter().filter(is_modelled).collect()
    }

    /// The cartridges, in the order of their ink codes.
    pub fn cartridges(&self) -> &[Cartridge] {
        &self.cartridges
    }

    /// The cartridge of an ink.
    pub fn cartridge(&self, ink: Ink) -> Option<&Cartridge> {
        self.cartridges.iter().find(|cartridge| cartridge.ink == ink)
    }

    /// The rules on the order of layers.
    pub fn rules(&self) -> &[Rule] {
        &self.rules
    }

    /// The rules that a stack breaks.
    pub fn broken_rules(&self, stack: &Stack) -> Vec<&Rule> {
        self.rules.iter().filter(|rule| rule.broken_by(stack)).collect()
    }

    /// The minimum cluster of a stack in dots: that of the paper or its most demanding layer.
    pub fn minimum_cluster(&self, stack: &Stack) -> u16 {
        let bare = self.optics.paper.minimum_cluster.get();
        let layers = stack.layers().iter().filter_map(|&ink| self.cartridge(ink));
        layers.map(|cartridge| cartridge.minimum_cluster.get()).fold(bare, u16::max)
    }

    /// The figures behind the modelled curves.
    pub fn optics(&self) -> &Optics {
        &self.optics
    }

    /// The names of the layers on Okidata's boxes, bottom first, such as `metallic silver, cyan, finish`.
    pub fn words(&self, stack: &Stack) -> String {
        if stack.layers().is_empty() {
            return self.optics.paper.name.clone();
        }
        let name =
            |&ink: &Ink| self.cartridge(ink).map_or_else(|| ink.name().into(), |c| c.okidata.to_lowercase());
        stack.layers().iter().map(name).collect::<Vec<String>>().join(", ")
    }
}
