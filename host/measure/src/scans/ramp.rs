//! Dot gain and the smallest cluster that holds, from scans of the ramp chart.
//!
//! Problem: ink spreads beyond its dots, and clusters that are too small come off or never stick; both differ from ribbon to ribbon.
//! Method: the chart has patches of clusters of 1, 2, 3 dots and so on ([`mod@press::chart::ramp`]). The tone of each patch is compared with the
//! one that its dots would have if their edges lay `g` further out (`edges`). The largest clusters give `g`; from them
//! downward each size that agrees with all larger ones holds, and takes part in `g`. The ramp above is read in the same
//! way, as the paper does: with the clusters it is made of it has to be linear but for `g`.
//! Cost: seconds for a scan of 15 megapixels, most of it the search for marks. Limits: spreading is the same in all directions; light
//! that is scattered in the paper counts as ink that spread (Yule and Nielsen's effect), as it does to the eye.

use std::path::{Path, PathBuf};

use inks::{Library, Stack};
use observe::Observer;
use press::chart::ramp::{self, MOST};
use press::layout::camera::{QUIET, SIDE};
use protocol::ink::Ink;
use rayon::prelude::*;
use serde::Serialize;
use sheet::{Area, DOTS_PER_MM, DotMap};

use super::edges::{Edges, FAR};
use super::scan::{Between, Scan, TonePatch};
use crate::MeasureError;
use crate::geometry::sheet_marks::SheetMarks;

/// What is left out at the edges of a patch, in dots: 0.4 mm, for a scanner's blur and the neighbour's
/// spreading ink reach that far.
const INSET: usize = 10;
/// Over how many dots a patch's weight rises, a millimetre, so that no row of clusters counts wholly or not
/// at all.
const SOFT: f64 = 24.0;
/// A tone may differ this much from the expected one, relative to it, for a size to hold
/// (decisions/dots-from-scans.md).
const HOLDS: f64 = 0.06;
/// The largest sizes, which have to agree with each other before any others are looked at
/// (decisions/dots-from-scans.md).
const FIRST: usize = 3;
/// How closely they must agree (decisions/dots-from-scans.md).
const AGREE: f64 = 0.03;
/// A gap that its surroundings close but for this part of it is none (decisions/dots-from-scans.md).
const OPEN: f64 = 0.25;
/// Sizes that disagree about the dot gain so many times less with another tone curve say that the file has it
/// (decisions/dots-from-scans.md), ...
const BETTER: f64 = 2.0;
/// ... if they disagree by this much, in um: less is within what sizes scatter by anyway.
const SCATTER_UM: f64 = 0.4;
/// Windows along the ramp: steps of 5 % of tone, which is enough to draw a curve.
const TONES: usize = 20;
const BAND: usize = 320;
/// A ramp that is this far from what its dots and their gain say is not linear: as much as sizes may
/// disagree.
pub const LINEAR: f64 = 0.03;

/// What the chart says.
#[derive(Clone, Debug, Serialize)]
pub struct Ramp {
    /// The scans.
    pub scans: Vec<String>,
    /// Clusters of the first stack in the second, and of the second in the first.
    pub series: [RampSeries; 2],
    /// The ramp, from all of the first stack downward.
    pub tones: Vec<Tone>,
    /// The tone at half ink minus a half.
    pub gain_at_half: f64,
    /// How far the ramp is from what its dots and their gain say, at most.
    pub off_linear: f64,
    /// The smallest clusters that the ramp is made of, of the first and of the second stack, in dots.
    pub ramp_clusters: [u32; 2],
}

/// Clusters of one stack in another.
#[derive(Clone, Debug, Serialize)]
pub struct RampSeries {
    /// The stack of the clusters.
    pub stack: String,
    /// The stack around them.
    pub ground: String,
    /// What the figures belong to, if that is one thing.
    pub owner: Option<Owner>,
    /// The smallest cluster that holds, in dots; `None` if not even the largest do.
    pub minimum_cluster: Option<u16>,
    /// How far ink reaches beyond its dots, in um; negative if it falls short of them.
    pub dot_gain_um: f64,
    /// How far sizes disagree about that: standard error in um.
    pub dot_gain_error_um: f64,
    /// Each size from 1 dot on.
    pub sizes: Vec<Size>,
}

/// What a figure is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// An ink.
    Ink(Ink),
    /// Bare paper: its clusters are gaps between inks.
    Paper,
}

impl Owner {
    /// Its name in a library.
    pub fn name(self) -> &'static str {
        match self {
            Owner::Ink(ink) => ink.name(),
            Owner::Paper => "paper",
        }
    }
}

impl Serialize for Owner {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

/// Clusters of one size.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Size {
    /// Dots of a cluster.
    pub dots: usize,
    /// The share that they take in the job.
    pub share: f64,
    /// What the scan shows.
    pub seen: f64,
    /// What it would show if they held.
    pub expected: f64,
}

impl Size {
    fn agrees(&self, within: f64) -> bool {
        self.share > 0.0
            && (self.seen - self.expected).abs() <= within * self.expected.max(self.share)
            && self.expected >= OPEN * self.share
    }
}

/// A tone of the ramp.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Tone {
    /// The share of the first stack in the job.
    pub share: f64,
    /// What the scan shows.
    pub seen: f64,
    /// What its dots and their gain say.
    pub expected: f64,
}

/// The chart on its sheet.
struct RampChart<'a> {
    sheet: &'a DotMap,
    parts: ramp::Parts,
    /// Its stacks and their numbers.
    stacks: [(Stack, u8); 2],
}

/// Reads scans or photographs of the ramp chart that was printed as `sheet`. `linear` says whether values are proportional to
/// light [default: those of 16 bits and OpenEXR are, those of 8 bits are not].
///
/// # Errors
/// A sheet that is no ramp chart; scans that cannot be read, show another sheet, part of it or none, are clipped, too coarse or
/// mirrored; stacks that look alike.
pub fn measure(
    scans: &[PathBuf],
    sheet: &DotMap,
    library: &Library,
    linear: Option<bool>,
    observer: &dyn Observer,
) -> Result<Ramp, MeasureError> {
    let marks = SheetMarks::find(sheet, library)?;
    let chart = RampChart::find(sheet, &marks)?;
    observer.begin("scans", scans.len() as u64);
    let mut seen: Vec<ScannedTones> = Vec::new();
    for path in scans {
        let scan = Scan::read(path, &marks, linear)?;
        scan.not_sharpened(path)?;
        let tones = chart.read(&scan, path)?;
        if linear.is_none()
            && let Some(other) = scan.other_tones()
        {
            chart.not_bent(path, &tones, &chart.read(&other, path)?)?;
        }
        seen.push(tones);
        observer.advance(1);
    }
    observer.end();
    let names = scans.iter().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned());
    Ok(chart.reduced(names.collect(), &seen))
}

/// The tones of a scan: of each patch, and along the ramp.
struct ScannedTones {
    patches: [Vec<f64>; 2],
    ramp: Vec<f64>,
}

fn patch(area: &Area) -> TonePatch {
    let area = Area {
        left: area.left + INSET,
        top: area.top + INSET,
        width: area.width - 2 * INSET,
        length: area.length - 2 * INSET,
    };
    TonePatch { area, soft: SOFT }
}

impl<'a> RampChart<'a> {
    fn find(sheet: &'a DotMap, marks: &SheetMarks) -> Result<RampChart<'a>, MeasureError> {
        let no_chart = || {
            MeasureError::Scene(
                "the job is not a ramp chart with all its camera marks; print one with `foilpress chart ramp`, on a4 or letter, \
                 without crop marks and without a profile that corrects the feed"
                    .into(),
            )
        };
        let mut parts = ramp::parts();
        let (width, length) = parts.size;
        let corner = |n: u8| {
            let mark = marks.marks.iter().find(|mark| mark.name.corner == n)?;
            Some(marks.dots(mark.corners[0]).map(|v| v.round() as i64))
        };
        let [Some(top_left), Some(top_right), Some(bottom_left), Some(_)] = [0, 1, 2, 3].map(corner) else {
            return Err(no_chart());
        };
        let (left, top) = (top_left[0], top_left[1] + (SIDE + QUIET) as i64);
        let (wide, long) = (top_right[0] + SIDE as i64 - left, bottom_left[1] - QUIET as i64 - top);
        if wide != width as i64 || long != length as i64 || left < 0 || top < 0 {
            return Err(no_chart());
        }
        let moved = |area: &mut Area| {
            area.left += left as usize;
            area.top += top as usize;
        };
        moved(&mut parts.ramp);
        parts.solids.iter_mut().chain(&mut parts.clusters).flatten().for_each(moved);
        let number = |area: &Area| -> Option<u8> {
            let first = sheet.index()[area.top * sheet.width() + area.left];
            let row = |y: usize| &sheet.index()[y * sheet.width() + area.left..][..area.width];
            (area.top..area.top + area.length)
                .all(|y| row(y).iter().all(|dot| *dot == first))
                .then_some(first)
        };
        let mut stacks = Vec::new();
        for strips in &parts.solids {
            let numbers: Vec<Option<u8>> = strips.iter().map(number).collect();
            let Some(first) = numbers[0].filter(|_| numbers.iter().all(|n| *n == numbers[0])) else {
                return Err(no_chart());
            };
            stacks.push((sheet.stacks()[usize::from(first)].clone(), first));
        }
        let Ok(stacks) = <[(Stack, u8); 2]>::try_from(stacks) else { return Err(no_chart()) };
        if stacks[0].1 == stacks[1].1 {
            return Err(no_chart());
        }
        Ok(RampChart { sheet, parts, stacks })
    }

    fn tones(&self) -> Vec<TonePatch> {
        let ramp = self.parts.ramp;
        let step = ramp.width / TONES;
        (0..TONES)
            .map(|i| TonePatch {
                area: Area {
                    left: ramp.left + i * step,
                    top: ramp.top + (ramp.length - BAND) / 2,
                    width: step,
                    length: BAND,
                },
                soft: SOFT,
            })
            .collect()
    }

    fn read(&self, scan: &Scan, path: &Path) -> Result<ScannedTones, MeasureError> {
        let names = self.stacks.each_ref().map(|(stack, _)| stack.to_string());
        let between = Between::fit(scan, path, &self.parts.solids, [&names[0], &names[1]])?;
        let share = |window: TonePatch| between.share(scan, path, &window);
        let row = |k: usize| -> Result<Vec<f64>, MeasureError> {
            let own = |share: f64| if k == 0 { share } else { 1.0 - share };
            self.parts.clusters[k].par_iter().map(|area| share(patch(area)).map(own)).collect()
        };
        let patches = [row(0)?, row(1)?];
        let ramp = self.tones().into_par_iter().map(share).collect::<Result<_, _>>()?;
        Ok(ScannedTones { patches, ramp })
    }

    /// Refuses tones of 16 bits that fit their chart only if they are not proportional to light. A tone curve makes all clusters look larger or
    /// smaller, but not alike: small ones have longer edges, hence another tone, and gaps stand at the other end of the curve.
    fn not_bent(&self, path: &Path, plain: &ScannedTones, bent: &ScannedTones) -> Result<(), MeasureError> {
        let windows =
            [0, 1].map(|k| self.edges(k, &self.parts.clusters[k].iter().map(patch).collect::<Vec<_>>()));
        let [plain, bent] = [plain, bent].map(|tones| self.disagreement(&windows, tones));
        if plain > SCATTER_UM && plain > BETTER * bent {
            let problem = format!(
                "its 16 bits have a tone curve: clusters disagree by {plain:.1} um about the dot gain if values are proportional to light, and by \
                 {bent:.1} um with the curve of sRGB; scan without a gamma, or give --linear false (or true, if you know better)"
            );
            return Err(MeasureError::photo(path, problem));
        }
        Ok(())
    }

    /// How far sizes that hold disagree about where edges lie, in um: root mean square.
    fn disagreement(&self, windows: &[Vec<Edges>; 2], tones: &ScannedTones) -> f64 {
        let mut reaches = Vec::new();
        for (k, edges) in windows.iter().enumerate() {
            let (own, other) = (&self.stacks[k].0, &self.stacks[1 - k].0);
            let series = RampSeries::fit(own, other, edges, &tones.patches[k]);
            let from = series.minimum_cluster.map_or(MOST - FIRST, |least| usize::from(least) - 1);
            let sign = if k == 0 { 1.0 } else { -1.0 };
            reaches.extend((from..MOST).map(|i| sign * reach(&[(&edges[i], tones.patches[k][i])])));
        }
        let mean = reaches.iter().sum::<f64>() / reaches.len() as f64;
        let square = reaches.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / reaches.len() as f64;
        square.sqrt() / DOTS_PER_MM * 1000.0
    }

    fn edges(&self, k: usize, windows: &[TonePatch]) -> Vec<Edges> {
        let mut inked = vec![false; self.sheet.stacks().len()];
        inked[usize::from(self.stacks[k].1)] = true;
        windows.par_iter().map(|window| Edges::measure(self.sheet, &inked, window)).collect()
    }

    fn reduced(&self, scans: Vec<String>, seen: &[ScannedTones]) -> Ramp {
        let mean =
            |of: &dyn Fn(&ScannedTones) -> f64| seen.iter().map(of).sum::<f64>() / seen.len().max(1) as f64;
        let series = [0, 1].map(|k| {
            let windows: Vec<TonePatch> = self.parts.clusters[k].iter().map(patch).collect();
            let edges = self.edges(k, &windows);
            let tones: Vec<f64> = (0..MOST).map(|i| mean(&|seen| seen.patches[k][i])).collect();
            let (own, other) = (&self.stacks[k].0, &self.stacks[1 - k].0);
            RampSeries::fit(own, other, &edges, &tones)
        });
        // What the gain of the first stack's clusters makes of the ramp; if they do not hold, that of the second's.
        let reach = match (series[0].minimum_cluster, series[1].minimum_cluster) {
            (None, Some(_)) => -series[1].dot_gain_um,
            _ => series[0].dot_gain_um,
        } / 1000.0
            * DOTS_PER_MM;
        let tones: Vec<Tone> = self
            .edges(0, &self.tones())
            .iter()
            .enumerate()
            .map(|(i, edges)| Tone {
                share: edges.printed,
                seen: mean(&|seen| seen.ramp[i]),
                expected: edges.covered(reach),
            })
            .collect();
        let off_linear = tones.iter().map(|tone| (tone.seen - tone.expected).abs()).fold(0.0, f64::max);
        let gain_at_half = at_half(&tones);
        let ramp_clusters =
            self.stacks.each_ref().map(|(_, number)| smallest(self.sheet, &self.parts.ramp, *number));
        Ramp { scans, series, tones, gain_at_half, off_linear, ramp_clusters }
    }
}

/// Dots of the smallest cluster of a stack in an area that does not touch the area's edge; 0 if there is none.
fn smallest(sheet: &DotMap, area: &Area, number: u8) -> u32 {
    let own = |x: usize, y: usize| sheet.index()[(area.top + y) * sheet.width() + area.left + x] == number;
    let mut done = vec![false; area.width * area.length];
    let (mut least, mut open) = (0, Vec::new());
    for start in 0..done.len() {
        if done[start] || !own(start % area.width, start / area.width) {
            continue;
        }
        done[start] = true;
        open.push(start);
        let (mut count, mut touches) = (0u32, false);
        while let Some(i) = open.pop() {
            let (x, y) = (i % area.width, i / area.width);
            count += 1;
            touches |= x == 0 || y == 0 || x + 1 == area.width || y + 1 == area.length;
            let near = [
                (x > 0).then(|| i - 1),
                (x + 1 < area.width).then_some(i + 1),
                i.checked_sub(area.width),
                Some(i + area.width).filter(|i| *i < done.len()),
            ];
            for next in near.into_iter().flatten() {
                if !done[next] && own(next % area.width, next / area.width) {
                    done[next] = true;
                    open.push(next);
                }
            }
        }
        if !touches && (least == 0 || count < least) {
            least = count;
        }
    }
    least
}

/// The tone at half ink minus a half, by a line between the neighbours.
fn at_half(tones: &[Tone]) -> f64 {
    tones.windows(2).find(|pair| pair[0].share >= 0.5 && pair[1].share < 0.5).map_or(0.0, |pair| {
        let t = (pair[0].share - 0.5) / (pair[0].share - pair[1].share);
        pair[0].seen + t * (pair[1].seen - pair[0].seen) - 0.5
    })
}

/// The reach at which these windows are nearest to what was seen, in dots.
fn reach(windows: &[(&Edges, f64)]) -> f64 {
    let cost = |g: f64| windows.iter().map(|(edges, seen)| (edges.covered(g) - seen).powi(2)).sum::<f64>();
    // The cost need not have one valley only, so it is searched in steps first.
    let steps = 200;
    let at = |i: i32| -FAR + 0.02 + f64::from(i) * (2.0 * FAR - 0.04) / f64::from(steps);
    let best = (0..=steps).min_by(|a, b| cost(at(*a)).total_cmp(&cost(at(*b)))).unwrap_or(steps / 2);
    let (mut low, mut high) = (at((best - 1).max(0)), at((best + 1).min(steps)));
    for _ in 0..40 {
        let (a, b) = (low + (high - low) * 0.382, low + (high - low) * 0.618);
        if cost(a) < cost(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

impl RampSeries {
    fn fit(stack: &Stack, ground: &Stack, edges: &[Edges], seen: &[f64]) -> RampSeries {
        let sizes = |g: f64| -> Vec<Size> {
            let size = |(i, (edges, seen)): (usize, (&Edges, &f64))| Size {
                dots: i + 1,
                share: edges.printed,
                seen: *seen,
                expected: edges.covered(g),
            };
            edges.iter().zip(seen).enumerate().map(size).collect()
        };
        let fitted = |from: usize| {
            let windows: Vec<(&Edges, f64)> =
                edges[from..].iter().zip(seen[from..].iter().copied()).collect();
            reach(&windows)
        };
        let mut from = MOST - FIRST;
        let mut g = fitted(from);
        let agreed = sizes(g)[from..].iter().all(|size| size.agrees(AGREE));
        while agreed && from > 0 && sizes(g)[from - 1].agrees(HOLDS) {
            from -= 1;
            g = fitted(from);
        }
        let each: Vec<f64> = (from..MOST).map(|i| reach(&[(&edges[i], seen[i])])).collect();
        let n = each.len() as f64;
        let variance = each.iter().map(|own| (own - g).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let um = 1000.0 / DOTS_PER_MM;
        RampSeries {
            stack: stack.to_string(),
            ground: ground.to_string(),
            owner: owner(stack, ground),
            minimum_cluster: agreed.then_some(from as u16 + 1),
            dot_gain_um: um * g,
            dot_gain_error_um: um * (variance / n).sqrt(),
            sizes: sizes(g),
        }
    }
}

/// What clusters of a stack in another tell about: the one ink that only they have; bare paper, if it shows between ink.
fn owner(stack: &Stack, ground: &Stack) -> Option<Owner> {
    if stack.layers().is_empty() {
        return Some(Owner::Paper);
    }
    let mut own = stack.layers().iter().filter(|ink| !ground.layers().contains(ink));
    own.next().filter(|_| own.next().is_none()).map(|ink| Owner::Ink(*ink))
}

/// What a library is told: the smallest cluster of each ink or of the paper, and the dot gain where an ink lies on what is around it.
pub struct Dots {
    /// What of.
    pub owner: Owner,
    /// The smallest cluster that holds, in dots.
    pub minimum_cluster: u16,
    /// The dot gain in um; none where two inks meet, since it is the difference of both.
    pub dot_gain_um: Option<f64>,
}

impl Ramp {
    /// What is known for sure.
    pub fn dots(&self) -> Vec<Dots> {
        let both: Vec<Stack> = self.series.iter().filter_map(|series| series.stack.parse().ok()).collect();
        let on = |k: usize| {
            let ground = both.get(1 - k).map_or(&[][..], Stack::layers);
            both.get(k).is_some_and(|stack| stack.layers().starts_with(ground))
        };
        self.series
            .iter()
            .enumerate()
            .filter_map(|(k, series)| {
                let (owner, minimum_cluster) = series.owner.zip(series.minimum_cluster)?;
                let dot_gain_um = (owner != Owner::Paper && on(k)).then_some(series.dot_gain_um);
                Some(Dots { owner, minimum_cluster, dot_gain_um })
            })
            .collect()
    }
}
