//! The order of the steps: choose cartridges, choose the intent, map the pixels, the bases or both.

use maths::Maths;
use std::borrow::Cow;

use inks::{InkSet, Stack};
use observe::Observer;
use protocol::ink::Ink;

use super::candidates::{Candidates, Printable};
use super::error::GamutError;
use super::fitting::basis::Bases;
use super::fitting::clamp::Clamped;
use super::fitting::gloss::FEW_MERGED;
use super::fitting::{basis, blend, clamp, local, spatial_average};
use super::notes::{in_words, say_gloss, spared_in_words};
use super::result::assemble;
use super::result::report::{GamutReport, Judged, Mapped, PixelReport, Worth};
use super::sample;
use super::selection::cartridges::{Cartridges, Precision};
use super::selection::fitted::{Service, Targets};
use super::selection::{cartridges, sharp, stacks};
use super::settings::{GamutSettings, Gloss, Intent};
use super::things::Things;
use crate::brdf::{Space, Table};
use crate::materials::{Factored, Materials, words};
use crate::solve::MixtureError;
use crate::weights::{ONE, WeightMaps};

/// Pixels that the intent is chosen by and pairs are drawn from.
const SAMPLE: usize = 1024;
/// Pixels that cartridges are chosen by.
const CARTRIDGE_SAMPLE: usize = 256;
/// The automatic choice blends if at most this share of the pairs that clamping merges are still merged: a
/// fifth fewer (decisions/clamp-and-seven-cartridges.md).
const HELPS: f64 = 0.8;

/// The part of an equal share that every basis has at least where cartridges and stacks are chosen.
const LEAST_SHARE: f64 = 0.25;

/// The most materials that are shown of a document without bases, and the root mean square distance to them
/// at which nothing more is shown: hardly visible.
const SHOWN: (usize, f64) = (6, 0.015);
/// The share of a document from which a material counts by itself. Source: 4 mm² of an A4 sheet, which is 2
/// mm across, the end of what a viewer looks at on purpose.
const COUNTS: f64 = 7e-5;

/// Maps a document to the printer's gamut. `factored` gives its bases and weight maps, and is called only
/// if the intent uses them. The result depends on the input and the settings alone, not on the number of
/// threads.
///
/// # Errors
/// Those of `factored`, and of the mapping.
pub fn map<'a, E: From<GamutError>>(
    pixels: &dyn Materials,
    factored: impl FnOnce() -> Result<Cow<'a, Factored>, E>,
    printable: &Printable,
    settings: &GamutSettings,
    observer: &dyn Observer,
) -> Result<Mapped, E> {
    let document = Pixels::new(pixels, printable, settings)?;
    match settings.intent {
        Intent::Clamp | Intent::Contrast | Intent::Shine => {
            document.fitted(&document.choose(None, observer)?, observer)
        }
        Intent::Auto => {
            let chosen = document.choose(None, observer)?;
            if document.clamping_keeps(&chosen)? {
                return Ok(document.fitted(&chosen, observer)?);
            }
            let bases = factored()?;
            check_bases(&bases, pixels)?;
            document.blended_if_that_helps(&chosen, &bases, observer)
        }
        Intent::Basis | Intent::Blend => {
            let bases = factored()?;
            check_bases(&bases, pixels)?;
            let chosen = document.choose(Some(&bases), observer)?;
            match settings.intent {
                Intent::Basis => document.by_bases(&chosen, &bases, observer),
                _ => document.blended(&chosen, &bases, document.blend(&chosen, &bases, observer)?, observer),
            }
        }
    }
    .map_err(E::from)
}

/// [`map`] with [`Intent::Clamp`], which needs no bases.
///
/// # Errors
/// Those of the mapping.
pub fn clamped(
    pixels: &dyn Materials,
    printable: &Printable,
    settings: &GamutSettings,
    observer: &dyn Observer,
) -> Result<Mapped, GamutError> {
    let settings = GamutSettings { intent: Intent::Clamp, ..settings.clone() };
    let document = Pixels::new(pixels, printable, &settings)?;
    document.fitted(&document.choose(None, observer)?, observer)
}

/// How much nearer inks come to a document with others beside them: root mean squares of the objective over
/// what cartridges are chosen by ([`Judged`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// With the inks at hand.
    pub before: f64,
    /// With the others, too.
    pub after: f64,
    /// Those of the others that the best cartridges include.
    pub inks: Vec<Ink>,
}

/// What the stacks of `more` would bring, under the same limit of cartridges, to what a mapping with
/// `settings` judged its cartridges by ([`Mapped::judged`]); `None` if no material would gain by them.
///
/// # Errors
/// Those of the mapping.
pub fn gain(
    judged: &Judged,
    at_hand: &Printable,
    more: &Printable,
    space: &Space,
    settings: &GamutSettings,
) -> Result<Option<Gain>, GamutError> {
    check_stacks(more)?;
    let all = Candidates::wanted(space, more, settings).map_err(in_target("the stacks"))?;
    let rows = judged.rows.rows().enumerate();
    let rows = rows.map(|(i, row)| {
        let mut target = all.free.target(row).map_err(in_target(format!("material {i}")))?;
        target.light = judged.light[i];
        Ok::<_, GamutError>(target)
    });
    let targets = Targets {
        rows: rows.collect::<Result<_, _>>()?,
        importance: judged.importance.clone(),
        counted: judged.counted.clone(),
    };
    let best =
        cartridges::choose(&all, &targets, settings.most_cartridges, Precision::PRINT, &observe::Silent)?;
    let (best, _) = cartridges::needed(&all, &targets, best, settings.most_cartridges)?;
    let used = InkSet::of(best.stacks.iter().flat_map(|&k| all.inks[k].iter()));
    let known = InkSet::of(at_hand.stacks.iter().flat_map(|stack| stack.layers().iter().copied()));
    // Those that are needed serve some material, so there is a gain if one of them is new.
    let inks: Vec<Ink> = used.iter().filter(|&ink| !known.contains(ink)).collect();
    let gain = Gain { before: judged.objective, after: best.fitted.loss.sqrt(), inks };
    Ok((!gain.inks.is_empty() && gain.after < gain.before).then_some(gain))
}

/// The best cartridges for a document.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The cartridges, each with what it does, those that are missed most first.
    pub chosen: Vec<Worth>,
    /// Inks at hand that would serve beside them.
    pub given_up: Vec<Worth>,
    /// The root mean square of the objective over a sample of the document's pixels, with all inks at hand.
    pub all: f64,
    /// The same with the cartridges chosen.
    pub distance: f64,
    /// The number of pixels in the sample.
    pub pixels: usize,
}

/// Chooses the cartridges whose mixtures come nearest to a document: exactly for a sample of its pixels,
/// while a mapping takes the first set within 0.1 %.
///
/// # Errors
/// Those of the mapping.
pub fn choose(
    pixels: &dyn Materials,
    printable: &Printable,
    settings: &GamutSettings,
    observer: &dyn Observer,
) -> Result<Choice, GamutError> {
    let intent = if settings.intent.uses_bases() { Intent::Clamp } else { settings.intent };
    let settings = GamutSettings { intent, ..settings.clone() };
    let document = Pixels::new(pixels, printable, &settings)?;
    let (targets, rows) = document.targets(None)?;
    let all = &document.all;
    let best = cartridges::choose(all, &targets, settings.most_cartridges, Precision::EXACT, observer)?;
    let (best, _) = cartridges::needed(all, &targets, best, settings.most_cartridges)?;
    let space = pixels.space();
    Ok(Choice {
        chosen: named(space, &rows, &targets, &cartridges::worth(all, &targets, &best)?),
        given_up: named(space, &rows, &targets, &best.given_up),
        all: best.all,
        distance: best.fitted.loss.sqrt(),
        pixels: targets.rows.len() - targets.counted.len(),
    })
}

/// The pixels of a document, a sample of them, and the stacks.
struct Pixels<'a> {
    pixels: &'a dyn Materials,
    settings: &'a GamutSettings,
    all: Candidates,
    sampled: Vec<usize>,
    sample: Table,
    things: Things,
    /// What is done about materials that are sharper than the inks.
    shine: Vec<String>,
}

/// The stacks that were chosen, and the cartridges that were not.
struct Chosen {
    candidates: Candidates,
    given_up: Vec<Worth>,
    judged: Judged,
}

/// Clamped pixels and mapped bases, and the weight of the former at each pixel.
struct Blend {
    bases: Bases,
    clamped: Clamped,
    s: Vec<f32>,
}

impl<'a> Pixels<'a> {
    fn new(
        pixels: &'a dyn Materials,
        printable: &Printable,
        settings: &'a GamutSettings,
    ) -> Result<Self, GamutError> {
        check_stacks(printable)?;
        let mut all =
            Candidates::wanted(pixels.space(), printable, settings).map_err(in_target("the stacks"))?;
        let sampled = sample::pixels(pixels.width() * pixels.height(), SAMPLE, settings.seed);
        let sample = sample::rows(pixels, &sampled);
        let things = Things::find(pixels);
        let shine =
            shine(pixels.space(), &things, &mut all, settings).map_err(in_target("a sharp material"))?;
        Ok(Pixels { pixels, settings, all, sampled, sample, things, shine })
    }

    /// What cartridges and stacks are chosen by: sampled pixels, each material that counts, and the bases,
    /// whichever the intent maps.
    fn targets(&self, bases: Option<&Factored>) -> Result<(Targets, Table), GamutError> {
        let mut rows = Table::new(self.pixels.space().columns());
        let mut targets = Targets { rows: Vec::new(), importance: Vec::new(), counted: Vec::new() };
        let mut add = |row: &[f64], importance: f64, counts: Option<f64>, what: String| {
            rows.push(row);
            targets.rows.push(self.all.target(row).map_err(in_target(what))?);
            targets.importance.push(importance);
            targets.counted.extend(counts.map(|share| (targets.rows.len() - 1, share)));
            Ok::<_, GamutError>(())
        };
        if let Some(bases) = bases {
            let shares = bases.shares();
            for (i, (row, share)) in bases.bases.rows().zip(&shares).enumerate() {
                // A twig is seen as well as the sky around it: no basis counts less than a part of an equal
                // share.
                let importance = share.max(LEAST_SHARE / shares.len() as f64);
                add(row, importance, Some(*share).filter(|share| *share >= COUNTS), format!("basis {i}"))?;
            }
        }
        if self.settings.intent != Intent::Basis {
            // A fresh draw: every n-th pixel of the larger sample would favour some columns of the picture.
            let total = self.pixels.width() * self.pixels.height();
            let few = sample::pixels(total, CARTRIDGE_SAMPLE, self.settings.seed ^ 1);
            for (row, pixel) in sample::rows(self.pixels, &few).rows().zip(&few) {
                add(row, 1.0 / few.len() as f64, None, format!("pixel {pixel}"))?;
            }
            // Each as much as a pixel, so that none is missed by the draw.
            let counted = self.things.rows.rows().zip(&self.things.shares).enumerate();
            for (i, (row, &share)) in counted.take_while(|(i, (_, share))| *i == 0 || **share >= COUNTS) {
                add(row, 1.0 / few.len() as f64, Some(share), format!("material {i}"))?;
            }
        }
        Ok((targets, rows))
    }

    fn cartridges(
        &self,
        (targets, rows): (&Targets, &Table),
        observer: &dyn Observer,
    ) -> Result<(Cartridges, Vec<Worth>), GamutError> {
        let most = self.settings.most_cartridges;
        let cartridges = cartridges::choose(&self.all, targets, most, Precision::PRINT, observer)?;
        let (cartridges, spared) = cartridges::needed(&self.all, targets, cartridges, most)?;
        let named = |services: &[(Ink, Service)]| named(self.pixels.space(), rows, targets, services);
        let given_up = named(&cartridges.given_up);
        for words in spared_in_words(&named(&spared)).into_iter().chain(in_words(&given_up, most)) {
            observer.note(&words);
        }
        Ok((cartridges, given_up))
    }

    /// Chooses cartridges, and the stacks that they print.
    fn choose(&self, bases: Option<&Factored>, observer: &dyn Observer) -> Result<Chosen, GamutError> {
        self.shine.iter().for_each(|words| observer.note(words));
        let (targets, rows) = self.targets(bases)?;
        let (cartridges, given_up) = self.cartridges((&targets, &rows), observer)?;
        let stacks =
            stacks::choose(&self.all, &cartridges.stacks, &targets).map_err(in_target("choosing stacks"))?;
        let candidates = self.all.subset(&stacks);
        check_number(&candidates.stacks)?;
        let light = targets.rows.iter().map(|target| target.light).collect();
        let Targets { importance, counted, .. } = targets;
        let judged = Judged { rows, light, importance, counted, objective: cartridges.fitted.loss.sqrt() };
        Ok(Chosen { candidates, given_up, judged })
    }

    /// Whether clamping keeps most pairs of sampled materials apart.
    fn clamping_keeps(&self, chosen: &Chosen) -> Result<bool, GamutError> {
        let clamped = clamp::rows(&chosen.candidates, &self.sample)?;
        Ok(self.merged(&clamped) <= FEW_MERGED)
    }

    /// The share of pairs of sampled pixels that are merged if these rows are what is printed there.
    fn merged(&self, printed: &Table) -> f64 {
        sample::merged_share(self.pixels.space(), &self.sample, printed, self.settings.seed)
    }

    /// Fits each pixel, without bases.
    fn fitted(&self, chosen: &Chosen, observer: &dyn Observer) -> Result<Mapped, GamutError> {
        let clamped = clamp::map(&chosen.candidates, self.pixels, observer)?;
        self.without_bases(chosen, clamped, None, observer)
    }

    /// What becomes of clamped pixels without bases.
    fn without_bases(
        &self,
        chosen: &Chosen,
        mut clamped: Clamped,
        not_blended: Option<f64>,
        observer: &dyn Observer,
    ) -> Result<Mapped, GamutError> {
        let Chosen { candidates, given_up, .. } = chosen;
        let space = self.pixels.space();
        let (rows, shares) = self.things.typical(space, SHOWN.0, SHOWN.1);
        let shown = basis::map(space, &rows, &shares, candidates, Gloss::Keep)?;
        let mut kept = 1.0;
        let intent = match self.settings.intent {
            Intent::Contrast => {
                kept = local::keep_contrast(candidates, self.pixels, &mut clamped, observer)?;
                Intent::Contrast
            }
            _ => {
                if let Some(spot) = self.settings.eye {
                    kept = spatial_average::match_averages(
                        candidates,
                        self.pixels,
                        &mut clamped,
                        spot,
                        observer,
                    )?;
                }
                if candidates.shine.is_some() { Intent::Shine } else { Intent::Clamp }
            }
        };
        let pixels = self.report(&clamped, kept);
        let mixed = self.compact(clamped, candidates.len())?;
        self.mapped(
            chosen,
            mixed,
            GamutReport {
                intent,
                cartridges: Vec::new(),
                given_up: given_up.clone(),
                gloss_scale: None,
                materials: shown.reports,
                pixels: Some(pixels),
                not_blended,
            },
        )
    }

    /// Maps the bases and keeps the weights.
    fn by_bases(
        &self,
        chosen: &Chosen,
        document: &Factored,
        observer: &dyn Observer,
    ) -> Result<Mapped, GamutError> {
        let bases = self.bases(chosen, document)?;
        say_gloss(&bases, observer);
        self.mapped(
            chosen,
            (bases.shares, document.maps.clone()),
            GamutReport {
                intent: Intent::Basis,
                cartridges: Vec::new(),
                given_up: chosen.given_up.clone(),
                gloss_scale: bases.gloss_scale,
                materials: bases.reports,
                pixels: None,
                not_blended: None,
            },
        )
    }

    fn bases(&self, chosen: &Chosen, document: &Factored) -> Result<Bases, GamutError> {
        let Chosen { candidates, .. } = chosen;
        let space = self.pixels.space();
        basis::map(space, &document.bases, &document.shares(), candidates, self.settings.gloss)
    }

    /// Everything that a blend averages.
    fn blend(
        &self,
        chosen: &Chosen,
        document: &Factored,
        observer: &dyn Observer,
    ) -> Result<Blend, GamutError> {
        let bases = self.bases(chosen, document)?;
        let clamped = clamp::map(&chosen.candidates, self.pixels, observer)?;
        let s = blend::shares(&clamped.distance, &clamped.brightness, self.pixels.width());
        Ok(Blend { bases, clamped, s })
    }

    /// Blends if that keeps clearly more pairs of sampled materials apart than clamping does.
    fn blended_if_that_helps(
        &self,
        chosen: &Chosen,
        document: &Factored,
        observer: &dyn Observer,
    ) -> Result<Mapped, GamutError> {
        let blend = self.blend(chosen, document, observer)?;
        let candidates = &chosen.candidates;
        let k = candidates.len();
        let (mut row, mut shares) = (vec![0.0; k], vec![0; k]);
        let reflectance =
            |shares: &[u16]| candidates.reflectance(shares.iter().map(|&s| f64::from(s) / f64::from(ONE)));
        let columns = self.sample.columns();
        let (mut clamped, mut blended) = (Table::new(columns), Table::new(columns));
        for &pixel in &self.sampled {
            shares.copy_from_slice(&blend.clamped.shares[pixel * k..][..k]);
            clamped.push(&reflectance(&shares));
            blend::average(
                &mut shares,
                blend.s[pixel],
                document.maps.at(pixel),
                &blend.bases.shares,
                &mut row,
            );
            blended.push(&reflectance(&shares));
        }
        let (clamped, blended) = (self.merged(&clamped), self.merged(&blended));
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        if blended > HELPS * clamped {
            observer.note(&format!(
                "{} of the pairs of different materials look alike in print, because the inks cannot tell them apart; intent \
                 `blend` would merge {}, so each pixel is printed as closely as the inks allow (intent `clamp`)",
                percent(clamped),
                percent(blended)
            ));
            return self.without_bases(chosen, blend.clamped, Some(blended), observer);
        }
        observer.note(&format!(
            "{} of the pairs of different materials would look alike if each were printed as closely as the inks allow, and {} \
             do if closeness is traded for difference (intent `blend`), so it is; choose intent `clamp` for closeness alone, \
             `basis` for differences alone",
            percent(clamped),
            percent(blended)
        ));
        self.blended(chosen, document, blend, observer)
    }

    /// Averages clamped pixels and mapped bases.
    fn blended(
        &self,
        chosen: &Chosen,
        document: &Factored,
        Blend { bases, mut clamped, s }: Blend,
        observer: &dyn Observer,
    ) -> Result<Mapped, GamutError> {
        say_gloss(&bases, observer);
        let candidates = &chosen.candidates;
        let mean = s.iter().map(|&s| f64::from(s)).sum::<f64>() / s.len() as f64;
        blend::mix(candidates, self.pixels, &mut clamped, &s, &document.maps, &bases.shares)?;
        let pixels = self.report(&clamped, mean);
        let mixed = self.compact(clamped, candidates.len())?;
        self.mapped(
            chosen,
            mixed,
            GamutReport {
                intent: Intent::Blend,
                cartridges: Vec::new(),
                given_up: chosen.given_up.clone(),
                gloss_scale: bases.gloss_scale,
                materials: bases.reports,
                pixels: Some(pixels),
                not_blended: None,
            },
        )
    }

    fn compact(
        &self,
        clamped: Clamped,
        candidates: usize,
    ) -> Result<(Vec<Vec<u16>>, WeightMaps), GamutError> {
        Ok(assemble::compact(clamped.shares, candidates, self.pixels.width(), self.pixels.height())?)
    }

    /// The facts about the pixels that are known before the mix is: all but the merged pairs.
    fn report(&self, clamped: &Clamped, share: f64) -> PixelReport {
        let mean_square = |d: &[f32]| d.iter().map(|&d| f64::from(d).squared()).sum::<f64>() / d.len() as f64;
        let mut distance = clamped.distance.clone();
        let last = distance.len() - 1;
        let (_, p95, _) = distance.select_nth_unstable_by(last * 95 / 100, f32::total_cmp);
        let p95 = f64::from(*p95);
        PixelReport {
            rms: mean_square(&distance).sqrt(),
            light: mean_square(&clamped.light).sqrt(),
            p95,
            max: f64::from(distance.iter().copied().fold(0.0, f32::max)),
            gap: clamped.gap,
            merged: 0.0,
            clamped: share,
        }
    }

    /// The mix, with what the report can say only of it.
    fn mapped(
        &self,
        Chosen { candidates, judged, .. }: &Chosen,
        (shares, maps): (Vec<Vec<u16>>, WeightMaps),
        mut report: GamutReport,
    ) -> Result<Mapped, GamutError> {
        let (mix, curves) = assemble::assemble(candidates, shares, maps)?;
        if let Some(pixels) = &mut report.pixels {
            let printed = sample::printed(&mix, &curves, &self.sampled);
            pixels.merged = self.merged(&printed);
        }
        report.cartridges = mix.inks();
        Ok(Mapped { mix, report, judged: judged.clone() })
    }
}

/// Lets light count more where the intent wants that, and says so.
fn shine(
    space: &Space,
    things: &Things,
    all: &mut Candidates,
    settings: &GamutSettings,
) -> Result<Vec<String>, MixtureError> {
    let asked = settings.intent == Intent::Shine;
    let nothing = |why: &str| Ok(vec![format!("intent `shine` changes nothing: {why}")]);
    match () {
        () if !asked && settings.intent != Intent::Auto => Ok(Vec::new()),
        () if settings.light > 0.0 && settings.hue => {
            let (shine, said) = sharp::find(space, things, all, asked)?;
            all.shine = shine;
            if asked && all.shine.is_none() {
                return nothing("no material of this document is sharper than the inks");
            }
            Ok(said)
        }
        () if !asked => Ok(Vec::new()),
        () if settings.hue => nothing("the metric of the paper does not weigh light"),
        () => nothing("of two pictures the contrast of both decides"),
    }
}

/// Names the target of a failed fit.
fn in_target(what: impl Into<String>) -> impl FnOnce(MixtureError) -> GamutError {
    let what = what.into();
    move |source| GamutError::Mixture { what, source }
}

/// Inks with what people call the material that each serves most.
fn named(space: &Space, rows: &Table, targets: &Targets, services: &[(Ink, Service)]) -> Vec<Worth> {
    let one = |&(ink, Service { counted, with, without, hue, .. }): &(Ink, Service)| {
        let (row, share) = targets.counted[counted];
        Worth { ink, material: words(space, rows.row(row)), share, with, without, hue }
    };
    services.iter().map(one).collect()
}

fn check_stacks(printable: &Printable) -> Result<(), GamutError> {
    let Printable { stacks, curves, .. } = printable;
    if stacks.is_empty() {
        return Err(GamutError::NothingPrintable);
    }
    if stacks.len() != curves.len() {
        return Err(GamutError::Curves { stacks: stacks.len(), curves: curves.len() });
    }
    match (1..stacks.len()).find(|&i| stacks[..i].contains(&stacks[i])) {
        Some(i) => Err(GamutError::Twice { stack: stacks[i].clone() }),
        None => Ok(()),
    }
}

/// Whether the index of a sheet can name them all.
fn check_number(stacks: &[Stack]) -> Result<(), GamutError> {
    match stacks.iter().filter(|stack| !stack.layers().is_empty()).count() {
        256.. => Err(GamutError::TooManyStacks { found: stacks.len() }),
        _ => Ok(()),
    }
}

fn check_bases(document: &Factored, pixels: &dyn Materials) -> Result<(), GamutError> {
    let maps = &document.maps;
    if document.bases.len() != maps.channels() {
        return Err(GamutError::Channels { bases: document.bases.len(), channels: maps.channels() });
    }
    if (pixels.width(), pixels.height()) != (maps.width(), maps.height()) {
        return Err(GamutError::Size {
            width: maps.width(),
            height: maps.height(),
            found_width: pixels.width(),
            found_height: pixels.height(),
        });
    }
    Ok(())
}
