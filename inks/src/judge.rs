//! Whether a measured curve is believable.
//!
//! Problem: a curve that can be read may still be wrong: a reflection of the room, a clipped highlight, dust, a lamp that moved.
//! Method: what every print obeys is checked sample by sample, each against the file's own standard deviations where it has
//! them. A curve falls from its peak until grazing angles. Neighbouring samples agree: each is compared with the cubic
//! through the two on either side of it, over the root of the angle, and the median of the differences gives the noise. A
//! process ink over anything takes light away. The reader of libraries checks energy. Cost: a few operations a sample.
//! Limits: an error that is smooth in the angle, such as a wrong scale, shows only in the energy and beside other stacks.
//! Reciprocity needs no check: a function of the half angle has it.

use maths::Maths;
use std::path::Path;

use protocol::ink::Kind;

use crate::curve::Curve;
use crate::library::Entry;
use crate::problem::{Findings, Problem};
use crate::rule::Severity;
use crate::stack::Stack;
use crate::uncertainty::{SampleKind, Uncertainty};

/// Half angle in degrees up to which a curve has to fall: beyond it, rough surfaces brighten again.
const FALLING: f64 = 45.0;
/// The rise, as a share, that is not worth a word.
const RISE: f64 = 0.1;
/// The scatter of neighbouring samples that is, and the one below which stated deviations are not doubted.
const NOISE: f64 = 0.05;
const QUIET: f64 = 0.01;
/// Fewer samples say nothing about noise.
const FEWEST: usize = 12;
/// The standard deviation, as a share of the value, from which a sample says little.
const VAGUE: f64 = 0.25;
/// The first and last half angle, in degrees, that a measurement should hold.
const FIRST: f64 = 5.0;
const LAST: f64 = 45.0;
/// The factor between neighbouring samples beyond which the shape between them is a guess.
const STEEP: f64 = 3.0;
/// What the surface of a process ink may add, in 1/sr.
const SURFACE: f64 = 0.003;

const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// The findings about one measured curve.
struct Judge<'a> {
    stack: &'a Stack,
    file: &'a Path,
    curve: &'a Curve,
    uncertainty: Option<&'a Uncertainty>,
    found: &'a mut Vec<Problem>,
}

/// Judges the curve of a stack that was read from `file`.
pub(crate) fn curve(
    stack: &Stack,
    file: &Path,
    curve: &Curve,
    uncertainty: Option<&Uncertainty>,
    findings: &mut Findings,
) {
    let mut judge = Judge { stack, file, curve, uncertainty, found: &mut findings.found };
    judge.coverage();
    judge.bands();
    judge.falling();
    judge.noise();
}

impl Judge<'_> {
    /// Adds a finding about a sample, or about the file as a whole.
    fn say(&mut self, severity: Severity, sample: Option<usize>, text: String) {
        self.found.push(Problem {
            file: self.file.to_path_buf(),
            // The header is line 1.
            line: sample.map(|sample| sample + 2),
            field: format!("stack {}", self.stack),
            severity,
            text,
        });
    }

    fn degrees(&self, sample: usize) -> f64 {
        self.curve.theta()[sample].to_degrees()
    }

    fn sigma(&self, sample: usize) -> [f64; 3] {
        self.uncertainty.map_or([0.0; 3], |u| u.sigma()[sample])
    }

    fn kind(&self, sample: usize) -> SampleKind {
        self.uncertainty.map_or(SampleKind::Measured, |u| u.kinds()[sample])
    }

    /// The samples that were seen.
    fn seen(&self) -> Vec<usize> {
        (0..self.curve.theta().len()).filter(|&i| self.kind(i) == SampleKind::Measured).collect()
    }

    fn coverage(&mut self) {
        let seen = self.seen();
        let (Some(&first), Some(&last)) = (seen.first(), seen.last()) else {
            self.say(Severity::Warning, None, "no sample of this curve was measured".into());
            return;
        };
        let (from, to) = (self.degrees(first), self.degrees(last));
        if from > FIRST {
            let text = format!("is measured from {from:.1} degrees on; the peak, below {FIRST:.0}, is not");
            self.say(Severity::Warning, Some(first), text);
        }
        if to < LAST {
            let text = format!("is measured up to {to:.1} degrees; beyond it the value is an assumption");
            self.say(Severity::Note, Some(last), text);
        }
        let steep = seen.windows(2).find_map(|pair| {
            let (a, b) = (self.curve.rgb()[pair[0]], self.curve.rgb()[pair[1]]);
            (0..3).find(|&c| b[c] > 0.0 && a[c] > STEEP * b[c]).map(|c| (pair[1], c, a[c] / b[c]))
        });
        if let Some((at, c, factor)) = steep {
            let text = format!(
                "{} falls to 1/{factor:.1} between {:.1} and {:.1} degrees; measure more angles there",
                CHANNELS[c],
                self.degrees(at - 1),
                self.degrees(at)
            );
            self.say(Severity::Note, Some(at), text);
        }
    }

    /// What the file says of itself.
    fn bands(&mut self) {
        let Some(uncertainty) = self.uncertainty else {
            let text = "has no standard deviations (columns r_sigma, g_sigma, b_sigma), so a difference cannot be told from noise";
            self.say(Severity::Note, None, text.into());
            return;
        };
        for (kind, severity, says) in [
            (
                SampleKind::Clipped,
                Severity::Warning,
                "are clipped: at least this much; use a shorter exposure",
            ),
            (SampleKind::Blurred, Severity::Note, "are blurred: the peak's height is a guess"),
        ] {
            let of: Vec<usize> = (0..uncertainty.kinds().len()).filter(|&i| self.kind(i) == kind).collect();
            if let (Some(&first), Some(&last)) = (of.first(), of.last()) {
                let range = format!("{:.1} to {:.1} degrees", self.degrees(first), self.degrees(last));
                self.say(severity, Some(first), format!("{} samples, {range}, {says}", of.len()));
            }
        }
        let vague = |&i: &usize| (0..3).any(|c| self.sigma(i)[c] > VAGUE * self.curve.rgb()[i][c]);
        let vague: Vec<usize> = self.seen().into_iter().filter(vague).collect();
        if let (Some(&first), Some(&last)) = (vague.first(), vague.last()) {
            let text = format!(
                "{} samples between {:.1} and {:.1} degrees are uncertain by more than {:.0} % (one standard deviation)",
                vague.len(),
                self.degrees(first),
                self.degrees(last),
                100.0 * VAGUE
            );
            self.say(Severity::Note, Some(first), text);
        }
    }

    /// A curve falls from its peak; what rises is a second reflection, or a neighbour in the picture.
    fn falling(&mut self) {
        let seen: Vec<usize> = self.seen().into_iter().filter(|&i| self.degrees(i) <= FALLING).collect();
        let mut worst: Option<(f64, usize, usize, usize)> = None;
        for c in 0..3 {
            let mut least: Option<usize> = None;
            for &i in &seen {
                let value = self.curve.rgb()[i][c];
                let Some(low) = least.filter(|&low| self.curve.rgb()[low][c] <= value) else {
                    least = Some(i);
                    continue;
                };
                let floor = self.curve.rgb()[low][c];
                let doubt = 2.0 * self.sigma(i)[c].hypotenuse(self.sigma(low)[c]);
                let rise = (value - floor) / floor.max(1e-12);
                if value - floor > doubt && rise > RISE && worst.is_none_or(|worst| rise > worst.0) {
                    worst = Some((rise, low, i, c));
                }
            }
        }
        if let Some((rise, low, high, c)) = worst {
            let text = format!(
                "{} rises by {:.0} % from {:.1} to {:.1} degrees, where prints only fall; look for a second reflection",
                CHANNELS[c],
                100.0 * rise,
                self.degrees(low),
                self.degrees(high)
            );
            self.say(Severity::Warning, Some(high), text);
        }
    }

    fn noise(&mut self) {
        let seen = self.seen();
        let mut off: Vec<f64> = Vec::new();
        for five in seen.windows(5) {
            let root: Vec<f64> = five.iter().map(|&i| self.curve.theta()[i].max(0.0).sqrt()).collect();
            // Lagrange's weights of the four neighbours at the middle one.
            let around = [0, 1, 3, 4];
            let weights = around.map(|i| {
                let others = around.iter().filter(|&&j| j != i);
                others.map(|&j| (root[2] - root[j]) / (root[i] - root[j])).product::<f64>()
            });
            let spread = (1.0 + weights.iter().map(|w| w * w).sum::<f64>()).sqrt();
            for c in 0..3 {
                let log: Vec<f64> = five.iter().map(|&i| self.curve.rgb()[i][c].logarithm()).collect();
                let middle: f64 = around.iter().zip(weights).map(|(&i, w)| w * log[i]).sum();
                let difference = (log[2] - middle).abs() / spread;
                if difference.is_finite() {
                    off.push(difference);
                }
            }
        }
        if seen.len() < FEWEST || off.is_empty() {
            return;
        }
        // 1.4826 makes the median of absolute values a standard deviation.
        let scatter = 1.4826 * median(&mut off);
        let relative = |i: &usize| self.sigma(*i)[1] / self.curve.rgb()[*i][1].max(1e-12);
        let stated = self.uncertainty.map(|_| median(&mut seen.iter().map(relative).collect::<Vec<_>>()));
        let percent = 100.0 * scatter;
        match stated {
            Some(stated) if scatter > QUIET && scatter > 2.0 * stated => {
                let text = format!(
                    "neighbouring samples scatter by {percent:.1} %, but the file states {:.1} %",
                    100.0 * stated
                );
                self.say(Severity::Warning, None, text);
            }
            _ if scatter > NOISE => {
                let text = format!(
                    "neighbouring samples scatter by {percent:.1} %; measure longer, or smooth the curve"
                );
                self.say(Severity::Warning, None, text);
            }
            _ => {}
        }
    }
}

/// The middle value; the list must not be empty.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Warns where a process ink adds light to what is beneath it; only measured stacks are compared.
pub(crate) fn filters(entries: &[Entry], findings: &mut Findings) {
    let theta = FALLING.to_radians();
    for above in entries.iter().filter(|entry| entry.provenance.is_measured()) {
        let Some((top, beneath)) = above.stack.layers().split_last() else { continue };
        let measured = |entry: &&Entry| entry.provenance.is_measured() && entry.stack.layers() == beneath;
        let Some(below) = entries.iter().find(measured).filter(|_| top.kind() == Kind::Process) else {
            continue;
        };
        let sigma = |entry: &Entry| entry.uncertainty.as_ref().map_or([0.0; 3], |u| u.at(theta));
        let (more, less) = (above.curve.at(theta), below.curve.at(theta));
        let doubt: [f64; 3] = std::array::from_fn(|c| 2.0 * sigma(above)[c].hypotenuse(sigma(below)[c]));
        let limit = |c: usize| less[c] * (1.0 + RISE) + SURFACE + doubt[c];
        if let Some(c) = (0..3).find(|&c| more[c] > limit(c)) {
            let text = format!(
                "reflects {:.4} in {} at {FALLING:.0} degrees, but {} without {} over it only {:.4}: a process ink takes \
                 light away, so one of the two is off in scale",
                more[c],
                CHANNELS[c],
                below.stack,
                top.name(),
                less[c]
            );
            findings.add(Severity::Warning, None, format!("stack {}", above.stack), text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Library;

    fn found(curve_: &Curve, uncertainty: Option<&Uncertainty>) -> Vec<Problem> {
        let mut findings = Findings { text: "", file: "library.toml".into(), found: Vec::new() };
        curve(&"MS+C".parse().unwrap(), Path::new("ms-c.csv"), curve_, uncertainty, &mut findings);
        findings.found
    }

    fn angles(samples: u32) -> Vec<f64> {
        (0..samples).map(|n| 1.5 * (f64::from(n) / f64::from(samples)).powi(2)).collect()
    }

    fn lobe(t: f64) -> f64 {
        0.02 + 0.4 * crate::ggx::lobe(t, 0.15)
    }

    /// A file with a relative standard deviation and one kind for all rows.
    fn stated(curve: &Curve, relative: f64, kind: &str) -> Uncertainty {
        let mut text = "theta_h_deg,r_sigma,g_sigma,b_sigma,kind\n".to_owned();
        for (t, v) in curve.theta().iter().zip(curve.rgb()) {
            let s = v.map(|v| v * relative);
            text += &format!("{},{},{},{},{kind}\n", t.to_degrees(), s[0], s[1], s[2]);
        }
        Uncertainty::from_csv(&text, Path::new("ms-c.csv")).unwrap().unwrap()
    }

    #[test]
    fn every_modelled_curve_is_believable() {
        for entry in Library::builtin().entries() {
            let curve = entry.curve_at(&angles(64));
            let found = found(&curve, Some(&stated(&curve, 0.02, "measured")));
            let bad: Vec<_> = found.iter().filter(|p| p.severity > Severity::Note).collect();
            assert!(bad.is_empty(), "{}: {bad:?}", entry.stack);
        }
    }

    /// Noise of a known size from a fixed sequence of normal deviates is found within a fifth of it.
    #[test]
    fn noise_is_found_with_its_size() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1u32 << 24)
        };
        let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let noisy =
            Curve::sampled(&angles(200), |t| std::array::from_fn(|_| lobe(t) * (0.08 * normal()).exp()));
        let said = found(&noisy, None);
        let warning = said.iter().find(|p| p.text.contains("scatter")).expect("noise");
        let percent: f64 = warning.text.split(['%', ' ']).find_map(|word| word.parse().ok()).unwrap();
        assert!((percent - 8.0).abs() < 1.6, "{warning}");
        assert!(
            found(&noisy, Some(&stated(&noisy, 0.02, "measured")))
                .iter()
                .any(|p| p.text.contains("states 2.0 %"))
        );
        let smooth = Curve::sampled(&angles(200), |t| [lobe(t); 3]);
        assert!(!found(&smooth, None).iter().any(|p| p.text.contains("scatter")));
    }

    #[test]
    fn a_second_highlight_is_named_with_its_line_unless_it_is_within_the_band() {
        let ghost = |t: f64| lobe(t) + 0.02 * (-((t.to_degrees() - 30.0) / 3.0).powi(2)).exp();
        let curve = Curve::sampled(&angles(64), |t| [lobe(t), ghost(t), lobe(t)]);
        let said = found(&curve, None);
        let warning = said.iter().find(|p| p.text.contains("rises")).expect("a rise");
        let at = curve.theta()[warning.line.unwrap() - 2].to_degrees();
        assert!((at - 30.0).abs() < 1.5 && warning.text.starts_with("green"), "{warning}");
        assert!(warning.to_string().starts_with("ms-c.csv:") && warning.field == "stack MS+C");
        let vague = stated(&curve, 0.5, "measured");
        let said = found(&curve, Some(&vague));
        assert!(!said.iter().any(|p| p.text.contains("rises")), "{said:?}");
        assert!(said.iter().any(|p| p.text.contains("uncertain by more than 25 %")));
    }

    #[test]
    fn what_was_not_seen_is_said() {
        let curve = Curve::sampled(&[0.2, 0.3, 0.5], |t| [lobe(t); 3]);
        let said = found(&curve, None);
        assert!(
            said.iter().any(|p| p.text.contains("from 11.5 degrees on") && p.severity == Severity::Warning)
        );
        assert!(said.iter().any(|p| p.text.contains("up to 28.6 degrees") && p.severity == Severity::Note));
        assert!(said.iter().any(|p| p.text.contains("no standard deviations")));
        let steep = Curve::new(vec![0.0, 0.1, 0.9], vec![[9.0; 3], [1.0, 4.0, 4.0], [1.0; 3]]).unwrap();
        assert!(
            found(&steep, None).iter().any(|p| p.text.contains("red falls to 1/9.0") && p.line == Some(3))
        );
        let clipped = found(&curve, Some(&stated(&curve, 0.01, "clipped")));
        assert!(clipped.iter().any(|p| p.text.contains("3 samples") && p.severity == Severity::Warning));
        assert!(clipped.iter().any(|p| p.text.contains("no sample of this curve was measured")));
    }
}
