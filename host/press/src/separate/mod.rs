//! A sheet as the fewest ordered one-bit passes, and what the rules say of them.
//!
//! Problem: a stack is several layers, a pass is one ink over the whole page, and a page should take few
//! passes.
//! Method: the shortest list of inks in which every stack in use finds its layers in order
//! (`sheet::order`), one plane for each ([`pack`]), the rules on stacks and pages as checks (`rules`).
//! Overlap is wanted: a dot is in as many passes as its stack has layers. [`compose`] is the way back.
//! Cost: one pass over the dots for all planes. Limits: `MOST_PASSES` passes, `MOST_LAYERS` layers.

pub mod files;
mod passes;
mod rules;

use std::collections::HashMap;

use inks::{Rule, Severity, Stack};
use protocol::ink::Ink;
use protocol::paper::Paper;

use observe::Observer;
use sheet::{MOST_PASSES, Plane, Sheet, SheetError, order, pack};

pub(crate) use passes::MOST_LAYERS;
pub use passes::{MOST_CARTRIDGES, Pass, Plan, Planned};
pub use rules::{CARTRIDGES, Check, Keeper, keepers};

/// A sheet ready for the printer's language.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// The paper.
    pub paper: Paper,
    /// The stacks in use, the substrate first.
    pub stacks: Vec<Stack>,
    /// The passes, first printed (lowest) first. None is blank; there are none for a bare sheet.
    pub passes: Vec<Pass>,
    /// The same in numbers.
    pub plan: Plan,
    /// What the rules on stacks and pages say, most severe first.
    pub checks: Vec<Check>,
}

impl Separation {
    /// Takes back what the checks say of stacks without a dot on the copies: marks are cut off. What must
    /// not be printed stays so wherever it is.
    pub(crate) fn spare_marks(&mut self, on_copies: impl Fn(&Stack) -> bool) {
        self.checks.retain_mut(|check| {
            let all = check.stacks.len();
            if check.severity != Severity::Error {
                check.stacks.retain(&on_copies);
            }
            all == 0 || !check.stacks.is_empty()
        });
    }
}

/// Why a sheet cannot be separated, or passes make no sheet.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SeparateError {
    /// A stack is too high.
    #[error("stack `{stack}` has {} layers; at most {MOST_LAYERS} can be printed", stack.layers().len())]
    Layers {
        /// The stack.
        stack: Stack,
    },
    /// More passes than a sheet survives.
    #[error(
        "the sheet needs {passes} passes ({}), at most {MOST_PASSES} are printed; use stacks with fewer layers",
        names(inks)
    )]
    Passes {
        /// How many.
        passes: usize,
        /// The inks in order.
        inks: Vec<Ink>,
    },
    /// A plane is not of the page's size.
    #[error(
        "pass {pass} ({}) has {found_width} x {found_length} dots in {bytes} bytes; {} needs {width} x {length}",
        ink.name(), paper.name()
    )]
    Plane {
        /// Pass, counted from one.
        pass: usize,
        /// Its ink.
        ink: Ink,
        /// Dots across.
        found_width: usize,
        /// Rows.
        found_length: usize,
        /// Bytes of its bits.
        bytes: usize,
        /// The paper.
        paper: Paper,
        /// Dots across the page.
        width: usize,
        /// Rows of the page.
        length: usize,
    },
    /// The inks on a dot are none of the stacks.
    #[error("the passes put `{stack}` on dot ({x}, {y}); none of the sheet's {stacks} stacks is like that")]
    Unknown {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// What is on the dot.
        stack: Stack,
        /// Number of stacks.
        stacks: usize,
    },
    /// The stacks do not make a sheet.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

fn names(inks: &[Ink]) -> String {
    inks.iter().map(|ink| ink.name()).collect::<Vec<_>>().join(", ")
}

/// What the rules on stacks and pages say of a sheet that is printed in these passes, most severe first.
pub fn check(sheet: &Sheet, passes: &[Planned], rules: &[Rule]) -> Vec<Check> {
    let plan = Plan { passes: passes.to_vec(), cartridges: Vec::new(), fewest: false };
    rules::check(sheet, &sheet.census(), &plan, rules)
}

/// Separates a sheet into passes. Only stacks that occur on a dot count. `rules` are the ink library's
/// rules on the order of layers ([`inks::Library::rules`]).
///
/// More than [`MOST_CARTRIDGES`] inks are planned, with a check that forbids to send them.
///
/// # Errors
/// More than `MOST_PASSES` passes or `MOST_LAYERS` layers.
pub fn separate(sheet: &Sheet, rules: &[Rule], observer: &dyn Observer) -> Result<Separation, SeparateError> {
    observer.begin("separate", 2);
    let census = sheet.census();
    let used: Vec<(usize, &Stack)> =
        sheet.stacks().iter().enumerate().filter(|(q, _)| census[*q] > 0 || *q == 0).collect();
    if let Some((_, stack)) = used.iter().find(|(_, stack)| stack.layers().len() > MOST_LAYERS) {
        return Err(SeparateError::Layers { stack: (*stack).clone() });
    }
    let order::Order { inks, shortest } =
        order::order(&used.iter().map(|(_, stack)| stack.layers()).collect::<Vec<_>>());
    if inks.len() > MOST_PASSES {
        return Err(SeparateError::Passes { passes: inks.len(), inks });
    }
    observer.advance(1);

    let (mut passes_of, mut dots) = ([0u16; 256], vec![0; inks.len()]);
    for (q, stack) in &used {
        // The order serves every stack in use.
        for pass in order::embed(stack.layers(), &inks).unwrap_or_default() {
            passes_of[*q] |= 1 << pass;
            dots[pass] += census[*q];
        }
    }
    let planned = inks.iter().zip(dots).map(|(&ink, dots)| Planned { ink, dots }).collect();
    let mut cartridges: Vec<Ink> = Vec::new();
    for &ink in &inks {
        if !cartridges.contains(&ink) {
            cartridges.push(ink);
        }
    }
    let plan = Plan { passes: planned, cartridges, fewest: shortest };
    let (planes, checks) = rayon::join(
        || pack::pack(sheet.width(), sheet.index(), &passes_of, inks.len()),
        || rules::check(sheet, &census, &plan, rules),
    );
    observer.advance(1);
    observer.end();
    Ok(Separation {
        paper: sheet.paper(),
        stacks: used.into_iter().map(|(_, stack)| stack.clone()).collect(),
        passes: inks.into_iter().zip(planes).map(|(ink, plane)| Pass { ink, plane }).collect(),
        plan,
        checks,
    })
}

/// The passes that print these stacks: their inks, first printed first, and for each stack the bits of its
/// passes.
pub fn passes(stacks: &[Stack]) -> (Vec<Ink>, Vec<u16>) {
    let inks = order::order(&stacks.iter().map(Stack::layers).collect::<Vec<_>>()).inks;
    let bits = |stack: &Stack| {
        let passes = order::embed(stack.layers(), &inks).unwrap_or_default();
        passes.into_iter().filter(|&pass| pass < 16).fold(0, |bits, pass| bits | 1 << pass)
    };
    let bits = stacks.iter().map(bits).collect();
    (inks, bits)
}

/// The sheet that passes print: each dot has the inks of the passes that have it, lowest first. `stacks`
/// are the stacks to expect, numbered as the sheet will number them.
///
/// # Errors
/// Planes of another size than the paper, more than `MOST_PASSES`, a dot with inks that are no
/// stack.
pub fn compose(paper: Paper, passes: &[Pass], stacks: &[Stack]) -> Result<Sheet, SeparateError> {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    if passes.len() > MOST_PASSES {
        let inks = passes.iter().map(|pass| pass.ink).collect();
        return Err(SeparateError::Passes { passes: passes.len(), inks });
    }
    let stride = width.div_ceil(8);
    for (i, pass) in passes.iter().enumerate() {
        let plane = &pass.plane;
        if (plane.width, plane.length, plane.stride, plane.bits.len())
            != (width, length, stride, stride * length)
        {
            return Err(SeparateError::Plane {
                pass: i + 1,
                ink: pass.ink,
                found_width: plane.width,
                found_length: plane.length,
                bytes: plane.bits.len(),
                paper,
                width,
                length,
            });
        }
    }
    sheet::check_stacks(stacks)?;
    let numbers: HashMap<&[Ink], u16> =
        stacks.iter().zip(0..).map(|(stack, q)| (stack.layers(), q)).collect();
    let layers = |mask: usize| -> Vec<Ink> {
        passes.iter().enumerate().filter(|(p, _)| mask >> p & 1 == 1).map(|(_, pass)| pass.ink).collect()
    };
    let stack_of: Vec<u16> = (0..1 << passes.len())
        .map(|mask| numbers.get(layers(mask).as_slice()).copied().unwrap_or(pack::NONE))
        .collect();
    let planes: Vec<&Plane> = passes.iter().map(|pass| &pass.plane).collect();
    match pack::unpack(&planes, width, length, &stack_of) {
        Ok(index) => Ok(Sheet::new(paper, stacks.to_vec(), index)?),
        Err((dot, mask)) => {
            let stack = Stack::new(layers(mask));
            Err(SeparateError::Unknown { x: dot % width, y: dot / width, stack, stacks: stacks.len() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use proptest::prelude::*;

    /// A sheet of random dots over random stacks of at most four inks, or of five given ones.
    fn sheets() -> impl Strategy<Value = Sheet> {
        let stack = prop::collection::vec(0usize..4, 1..4);
        (1u16..60, 1u16..150, prop::collection::vec(stack, 0..12), any::<u32>()).prop_map(
            |(width, length, stacks, seed)| {
                let inks = [Ink::MetallicSilver, Ink::Cyan, Ink::Primer, Ink::Finish];
                let mut all = vec![Stack::SUBSTRATE];
                for stack in stacks {
                    let stack = Stack::new(stack.into_iter().map(|i| inks[i]).collect::<Vec<_>>());
                    if !all.contains(&stack) {
                        all.push(stack);
                    }
                }
                let random = |i: usize| ((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 7) as usize;
                let dots = usize::from(width) * usize::from(length);
                let index = (0..dots).map(|i| (random(i) % all.len()) as u8).collect();
                Sheet::new(Paper::Custom { width, length }, all, index).unwrap()
            },
        )
    }

    proptest! {
        #[test]
        fn passes_rebuild_the_sheet_dot_for_dot(sheet in sheets()) {
            let separation = separate(&sheet, &[], &Silent).unwrap();
            let again = compose(sheet.paper(), &separation.passes, sheet.stacks()).unwrap();
            prop_assert_eq!(again, sheet);
        }

        #[test]
        fn the_plan_counts_the_dots_of_the_planes(sheet in sheets()) {
            let separation = separate(&sheet, &[], &Silent).unwrap();
            prop_assert_eq!(separation.plan.passes.len(), separation.passes.len());
            for (planned, pass) in separation.plan.passes.iter().zip(&separation.passes) {
                prop_assert_eq!((planned.ink, planned.dots), (pass.ink, pass.plane.dots()));
                prop_assert!(planned.dots > 0);
            }
        }

        #[test]
        fn saved_passes_come_back_bit_by_bit(sheet in sheets()) {
            let separation = separate(&sheet, &[], &Silent).unwrap();
            let folder = tempfile::tempdir().unwrap();
            files::save(&separation, (600, 600), folder.path()).unwrap();
            let saved = files::load(folder.path()).unwrap();
            prop_assert_eq!((&saved.passes, &saved.stacks), (&separation.passes, &separation.stacks));
            prop_assert_eq!(saved.paper, sheet.paper());
        }
    }

    fn page(stacks: &[&str]) -> Sheet {
        let stacks: Vec<Stack> = stacks.iter().map(|text| text.parse().unwrap()).collect();
        let index = (0..20 * 20).map(|dot| (dot % stacks.len()) as u8).collect();
        Sheet::new(Paper::Custom { width: 20, length: 20 }, stacks, index).unwrap()
    }

    #[test]
    fn stacks_without_a_dot_cost_no_pass() {
        let stacks = ["substrate", "C", "MS+K"].map(|text| text.parse().unwrap()).to_vec();
        let sheet = Sheet::new(Paper::Custom { width: 2, length: 1 }, stacks, vec![0, 1]).unwrap();
        let separation = separate(&sheet, &[], &Silent).unwrap();
        assert_eq!(separation.plan.cartridges, [Ink::Cyan]);
        assert_eq!(separation.stacks.len(), 2);
        let bare = Sheet::new(sheet.paper(), sheet.stacks().to_vec(), vec![0, 0]).unwrap();
        assert!(separate(&bare, &[], &Silent).unwrap().passes.is_empty());
        assert_eq!(compose(bare.paper(), &[], bare.stacks()).unwrap(), bare);
    }

    #[test]
    fn an_ink_at_two_depths_takes_two_passes_of_one_cartridge() {
        let plan = separate(&page(&["substrate", "K+P+F+P+W"]), &[], &Silent).unwrap().plan;
        assert_eq!(plan.passes.len(), 5);
        assert_eq!(plan.cartridges, [Ink::Black, Ink::Primer, Ink::Finish, Ink::White]);
    }

    #[test]
    fn more_than_the_machine_holds_is_planned_and_must_not_be_printed() {
        let inks = ["substrate", "K", "C", "M", "Y", "MG", "MM", "MC", "MS"];
        let seven = separate(&page(&inks[..8]), &[], &Silent).unwrap();
        assert!(seven.checks.iter().all(|check| check.severity != Severity::Error));
        let separation = separate(&page(&inks), &[], &Silent).unwrap();
        assert_eq!((separation.passes.len(), separation.plan.cartridges.len()), (8, 8));
        let check = &separation.checks[0];
        assert_eq!((check.rule.as_str(), check.severity), ("cartridges", Severity::Error));
        assert!(check.text.contains("8 cartridges") && check.text.contains("holds 7"), "{check}");
    }

    #[test]
    fn more_layers_or_passes_than_a_sheet_takes_are_refused() {
        let high = format!("C{}", "+C".repeat(16));
        assert!(matches!(
            separate(&page(&["substrate", &high]), &[], &Silent),
            Err(SeparateError::Layers { .. })
        ));
        let (cyan_first, black_first) = (["C+K"; 8].join("+"), ["K+C"; 8].join("+"));
        let error = separate(&page(&["substrate", &cyan_first, &black_first]), &[], &Silent).unwrap_err();
        assert!(matches!(error, SeparateError::Passes { passes: 17, .. }), "{error}");
    }

    #[test]
    fn passes_that_make_no_sheet_are_refused_where_it_happens() {
        let sheet = page(&["substrate", "C", "MS+C"]);
        let separation = separate(&sheet, &[], &Silent).unwrap();
        let paper = sheet.paper();
        let mut passes = separation.passes.clone();
        passes[0].plane.bits[3] |= 0x80;
        let fewer = [Stack::SUBSTRATE, "C".parse().unwrap()];
        let error = compose(paper, &separation.passes, &fewer).unwrap_err().to_string();
        assert!(error.contains("`MS+C` on dot (2, 0)"), "{error}");
        // Dot 0 of row 1 is number 20, stack C; with a bit more of the first pass it is MS+C.
        assert_eq!(compose(paper, &passes, sheet.stacks()).unwrap().index()[20], 2);
        passes[1].plane.length = 19;
        let error = compose(paper, &passes, sheet.stacks()).unwrap_err().to_string();
        assert!(error.contains("pass 2 (cyan) has 20 x 19"), "{error}");
        let many = vec![separation.passes[0].clone(); 17];
        assert!(matches!(
            compose(paper, &many, sheet.stacks()),
            Err(SeparateError::Passes { passes: 17, .. })
        ));
    }

    #[test]
    fn a_changed_folder_is_refused_with_file_and_field() {
        let folder = tempfile::tempdir().unwrap();
        let separation = separate(&page(&["substrate", "C", "MS+C"]), &[], &Silent).unwrap();
        files::save(&separation, (600, 600), folder.path()).unwrap();
        let path = folder.path().join(files::PASSES.text);
        let good = std::fs::read_to_string(&path).unwrap();
        for (from, to, words) in [
            ("format = 1", "format = 2", "format: 2"),
            ("\"cyan\"", "\"tin\"", "pass 2, ink: `tin`"),
            ("02-cyan.png", "../02-cyan.png", "expected `02-cyan.png`"),
            ("dots = 133", "dots = 134", "the picture was changed"),
            ("dots = 133", "dots = 133\ninks = 2", "inks"),
            ("width = 20", "width = 21", "expected 21 x 20 dots, One bits"),
        ] {
            assert!(good.contains(from), "{good}");
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            let error = files::load(folder.path()).unwrap_err().to_string();
            assert!(error.contains(words), "{words}: {error}");
        }
        std::fs::write(&path, &good).unwrap();
        std::fs::remove_file(folder.path().join("02-cyan.png")).unwrap();
        assert!(files::load(folder.path()).unwrap_err().to_string().contains("02-cyan.png"));
    }
}
