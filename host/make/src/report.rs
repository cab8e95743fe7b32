//! The page that joins what a print of a document writes: `report.html`.
//!
//! It lies in the folder of the print and shows the pictures beside it by their names, so each exists once;
//! curves and spectra are drawn in it. The plan stays a page of its own, `plan.html`, because it is printed
//! and kept beside the printer. Names come from documents of unknown origin and appear as text.

use maths::Maths;
use std::fmt::{self, Write as _};

use appearance::brdf::{Space, plot};
use appearance::gamut::{DistanceUncertainty, MaterialReport};
use halftone::metrics::{Look, Tone};
use press::html::{self, escape};
use press::job::plan::{Plan, grouped};
use press::preview::gloss::{self, Gloss};
use press::preview::{Contrasts, FidelityReport, Spectrum, mix_in_words};

use crate::Error;

/// Materials whose curves are drawn: those that stand for most of the document.
const DRAWN: usize = 8;

/// What figures mean that have no unit.
const UNIT: &str = "A difference of 0.01, in d or light, is barely visible, one of 0.05 obvious.";

/// The finest pattern that an eye resolves, in cycles a degree.
const RESOLVED: f64 = 30.0;

const STYLE: &str = "img{display:block}nav{display:flex;flex-wrap:wrap;gap:.3rem 1rem}\
    .many{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,22rem),1fr));gap:1rem;\
    margin-top:1rem}\
    .passes{grid-template-columns:repeat(auto-fill,minmax(9rem,1fr))}figure{background:var(--card);padding:.6rem;\
    border-radius:8px}figure>svg{max-width:min(100%,720px);margin:0 auto}";

/// What the page shows.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The tabulation of the materials' rows.
    pub space: &'a Space,
    /// Materials before and after mapping.
    pub materials: &'a [MaterialReport],
    /// The gloss of each.
    pub gloss: &'a [Gloss],
    /// What a material is: a basis of the document, or a typical one.
    pub kind: &'a str,
    /// Document and print as an eye sees them, and its distance in metres.
    pub fidelity: (&'a FidelityReport, f64),
    /// How much of the distance the measurement of the stacks leaves open, if they were measured.
    pub doubt: Option<DistanceUncertainty>,
    /// How the halftone looks, if it is large enough.
    pub look: Option<&'a Look>,
    /// Its tones.
    pub tones: &'a [Tone],
    /// Its spectrum, if it has one.
    pub spectrum: Option<&'a Spectrum>,
    /// How well each of two pictures is seen, if it prints two.
    pub contrasts: Option<&'a Contrasts>,
}

/// The page.
///
/// # Errors
/// A plot that cannot be drawn: a bug if it is ever seen.
pub fn page(subject: &Subject) -> Result<String, Error> {
    let plots = drawn(subject.materials)
        .into_iter()
        .map(|i| {
            let material = &subject.materials[i];
            let curves = [&material.target, &material.printed].map(|row| subject.space.curve(row));
            let lines = [0, 1].map(|k: usize| plot::Line { curve: &curves[k], uncertainty: None });
            let title = format!("{} {i}: d = {:.3}", subject.kind, material.distance);
            Ok((i, plot::compared(&title, &lines)?))
        })
        .collect::<Result<Vec<(usize, String)>, Error>>()?;
    let mut body = String::new();
    write(subject, &plots, &mut body)?;
    Ok(html::read(&format!("{}: report of the print", subject.plan.document), STYLE, &body))
}

fn write(subject: &Subject, plots: &[(usize, String)], page: &mut String) -> fmt::Result {
    let plan = subject.plan;
    let (name, (width, height)) = (escape(&plan.document), plan.size_mm);
    let (fidelity, eye) = subject.fidelity;
    write!(
        page,
        "<h1>{name}</h1>\n<p>{width:.1} &times; {height:.1} mm on {}, {} passes. Seen from {eye} m, print and document \
         differ by d = {:.3} on average <span class=\"faint\">(0.01: barely visible; 0.05: obvious)</span>.</p>\n\
         <nav aria-label=\"Files\"><a href=\"plan.html\">The plan: cartridges, passes, ribbon, cautions</a>\
         <a href=\"preview.png\">All inks, dot for dot</a><a href=\"separation.png\">Stacks in false colours</a>\
         <a href=\"passes/\">Passes, dot for dot</a><a href=\"report.json\">All figures</a><a href=\"job.rgl\">The job</a></nav>\n",
        escape(plan.paper),
        plan.passes.len(),
        fidelity.mean
    )?;
    page.push_str(&html::modelled(plan.modelled_in_words().as_deref()));
    if let Some(contrasts) = subject.contrasts {
        writeln!(page, "<p>Two pictures: {}.</p>", escape(&contrasts.to_string()))?;
    }
    write!(
        page,
        "<h2>The sheet</h2>\n<p>Document above, print below, under four lights, and the dots under a lens. On <a href=\"sheet.html\">the sheet's own page</a> \
         the light follows the hand.</p>\n\
         <a href=\"sheet.png\"><img alt=\"document and print under four lights\" src=\"sheet.png\"></a>\n\
         <h2>Materials</h2>\n<p>Before and after they were fitted to the inks.</p>\n\
         <a href=\"materials.png\"><img alt=\"materials before and after mapping, as balls\" src=\"materials.png\"></a>\n"
    )?;
    write_gamut(subject, plots, page)?;
    write_errors(fidelity, eye, subject.doubt, page)?;
    write_halftone(subject, page)?;
    writeln!(page, "<h2>Passes</h2>\n<div class=\"many passes\">")?;
    for pass in &plan.passes {
        let (number, ink) = (pass.number, pass.ink);
        writeln!(
            page,
            "<figure><a href=\"preview-{number:02}-{ink}.png\"><img loading=\"lazy\" alt=\"pass {number}, {ink}\" \
             src=\"preview-{number:02}-{ink}.png\"></a><figcaption>{number} {ink}, {} dots</figcaption></figure>",
            grouped(pass.dots)
        )?;
    }
    writeln!(page, "</div>")
}

/// The materials whose curves are drawn, in their order. They count from 0, as bases do everywhere.
fn drawn(materials: &[MaterialReport]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..materials.len()).collect();
    order.sort_by(|&a, &b| materials[b].share.total_cmp(&materials[a].share));
    order.truncate(DRAWN);
    order.sort_unstable();
    order
}

/// Curves of the materials against what is printable.
fn write_gamut(subject: &Subject, plots: &[(usize, String)], page: &mut String) -> fmt::Result {
    let kind = subject.kind;
    let some = if plots.len() < subject.materials.len() {
        format!(" Drawn are the {} that stand for most of the document.", plots.len())
    } else {
        String::new()
    };
    write!(
        page,
        "<h2>Gamut</h2>\n<p>Lines: the {kind}. Dashed: the best mixture of the stacks in use.{some} {UNIT}</p>\n\
         <table class=\"cards\"><tr><th class=\"n\">{kind}<th class=\"n\">share<th class=\"n\">d<th class=\"n\">light\
         <th>gloss at 20, 60, 85&deg;, GU<th>printed, GU<th>mixture"
    )?;
    for (number, (material, gloss)) in subject.materials.iter().zip(subject.gloss).enumerate() {
        write!(
            page,
            "<tr><td class=\"n\" data-name=\"{kind}\">{number}<td class=\"n\" data-name=\"share\">{:.1} %\
             <td class=\"n\" data-name=\"d\">{:.3}<td class=\"n\" data-name=\"light\">{:.3}\
             <td data-name=\"gloss at 20, 60, 85&deg;, GU\">{}{}<td data-name=\"printed, GU\">{}\
             <td class=\"words\" data-name=\"mixture\">{}",
            100.0 * material.share,
            material.unscaled_distance,
            material.light,
            gloss::in_words(gloss.target),
            if gloss.matter_than_any_ink { ", matter than any ink: a matt spray would bring it" } else { "" },
            gloss::in_words(gloss.printed),
            escape(&mix_in_words(&material.weights))
        )?;
    }
    writeln!(page, "</table>\n<div class=\"many\">")?;
    for (number, svg) in plots {
        writeln!(page, "{}", html::drawing(&format!("curves of {kind} {number}"), svg))?;
    }
    writeln!(page, "</div>")
}

fn write_errors(
    fidelity: &FidelityReport,
    eye: f64,
    doubt: Option<DistanceUncertainty>,
    page: &mut String,
) -> fmt::Result {
    let row = |name: &str, value: f64| format!("<tr><th>{name}<td class=\"n\">d = {value:.3}");
    writeln!(
        page,
        "<h2>Errors</h2>\n<p>Differences between print and document, seen from {eye} m. {UNIT}</p>\n<table>{}{}{}{}{}</table>",
        row("average", fidelity.mean),
        row("root mean square", fidelity.rmse),
        row("95 % of places below", fidelity.p95),
        row("largest", fidelity.max),
        format_args!("<tr><th>light, root mean square<td class=\"n\">{:.3}", fidelity.light_rmse)
    )?;
    doubt.map_or(Ok(()), |doubt| writeln!(page, "<p>{doubt}.</p>"))
}

fn write_halftone(subject: &Subject, page: &mut String) -> fmt::Result {
    writeln!(page, "<h2>Halftone</h2>")?;
    if let Some(look) = subject.look {
        writeln!(page, "<p>From its dots: {}.</p>", escape(&look.to_string()))?;
    }
    match subject.spectrum {
        Some(spectrum) => {
            writeln!(
                page,
                "<p>Power of the dots over their frequency, on the most even windows of the print; white noise is 1. What lies right of \
                 the line is too fine for an eye {} m away; far left the document itself shows.</p>\n<figure>",
                subject.fidelity.1
            )?;
            draw_spectrum(spectrum, subject.fidelity.1, page)?;
            writeln!(page, "</figure>")?;
        }
        None => writeln!(page, "<p>The print is too small or too even for a spectrum.</p>")?,
    }
    write!(
        page,
        "<table class=\"cards\"><tr><th>stack<th class=\"n\">asked<th class=\"n\">printed<th class=\"n\">worst window\
         <th class=\"n\">smallest cluster"
    )?;
    for tone in subject.tones {
        write!(
            page,
            "<tr><td data-name=\"stack\">{}<td class=\"n\" data-name=\"asked\">{:.2} %\
             <td class=\"n\" data-name=\"printed\">{:.2} %\
             <td class=\"n\" data-name=\"worst window\">{:.2} %<td class=\"n\" data-name=\"smallest cluster\">{} dots",
            tone.stack,
            100.0 * tone.asked,
            100.0 * tone.printed,
            100.0 * tone.worst_window,
            tone.smallest_cluster
        )?;
    }
    writeln!(page, "</table>")
}

/// The spectrum as a drawing of 720 x 260, with the frequency an eye at this distance resolves.
fn draw_spectrum(spectrum: &Spectrum, eye: f64, page: &mut String) -> fmt::Result {
    const LEFT: f64 = 44.0;
    const TOP: f64 = 28.0;
    const WIDE: f64 = 660.0;
    const HIGH: f64 = 182.0;
    // Slower than this, the document's own content prevails.
    let fast = spectrum.rings.iter().filter(|ring| ring.0 >= 0.5);
    let most = fast.map(|ring| ring.1).fold(1.5, f64::max);
    let last = spectrum.rings.last().map_or(1.0, |ring| ring.0).max(1.0);
    let x = |cycles: f64| LEFT + WIDE * cycles / last;
    let y = |power: f64| TOP + HIGH * (1.0 - power.min(most) / most);
    write!(
        page,
        "<svg role=\"img\" aria-label=\"power spectrum of the halftone\" viewBox=\"0 0 720 260\" font-family=\"sans-serif\" \
         font-size=\"12\" fill=\"#5f5b55\">"
    )?;
    for cycles in (0..=24u32).step_by(2).filter(|&cycles| f64::from(cycles) <= last) {
        let at = x(f64::from(cycles));
        write!(
            page,
            "<path d=\"M{at:.1} {TOP}V{:.1}\" stroke=\"#eceae5\"/><text x=\"{at:.1}\" y=\"228\" text-anchor=\"middle\">{cycles}</text>",
            TOP + HIGH
        )?;
    }
    for power in [0.0, 1.0, most] {
        let at = y(power);
        let digits = if power.fract() == 0.0 { 0 } else { 1 };
        write!(
            page,
            "<path d=\"M{LEFT} {at:.1}H{:.1}\" stroke=\"#dcd8d0\"/><text x=\"38\" y=\"{:.1}\" text-anchor=\"end\">{power:.digits$}</text>",
            LEFT + WIDE,
            at + 4.0
        )?;
    }
    // A degree covers so many millimetres.
    let resolved = RESOLVED / (1000.0 * eye * 1f64.to_radians().tangent());
    if resolved < last {
        // Above the curve, and no farther to the side than the drawing reaches.
        write!(
            page,
            "<path d=\"M{0:.1} {TOP}V{1:.1}\" stroke=\"#8a4b12\" stroke-dasharray=\"4 3\"/>\
             <text x=\"{2:.1}\" y=\"{3}\" fill=\"#8a4b12\" text-anchor=\"middle\">finest an eye resolves</text>",
            x(resolved),
            TOP + HIGH,
            x(resolved).clamp(LEFT + 40.0, LEFT + WIDE - 60.0),
            TOP - 8.0
        )?;
    }
    let points: Vec<String> =
        spectrum.rings.iter().map(|&(cycles, power)| format!("{:.1} {:.1}", x(cycles), y(power))).collect();
    write!(
        page,
        "<path d=\"M{}\" fill=\"none\" stroke=\"#1b63a5\" stroke-width=\"2\"/>\
         <text x=\"{}\" y=\"250\" text-anchor=\"middle\">cycles a millimetre</text></svg>",
        points.join("L"),
        LEFT + 0.5 * WIDE
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::reflectances;
    use inks::{InkSet, Library, Stack};
    use observe::Silent;
    use press::job::Handling;
    use press::job::plan::Share;
    use press::layout::Layout;
    use press::pipeline::{Request, draft};
    use protocol::paper::Paper;
    use protocol::rgl::Media;
    use sheet::DotMap;

    #[test]
    fn names_from_documents_stay_text_and_every_part_is_there() {
        const NAME: &str = "<script>alert(1)</script>\"'&<img src=x>";
        let library = Library::builtin();
        let stacks: Vec<Stack> = ["substrate", "MS+C"].map(|stack| stack.parse().unwrap()).to_vec();
        let index = (0..200 * 200).map(|dot| u8::from(dot % 200 / 4 % 2 == dot / 800 % 2)).collect();
        let dots = DotMap::new(200, 200, stacks.clone(), index).unwrap();
        let request = Request {
            name: NAME,
            dots: &dots,
            layout: &Layout::centred(Paper::Postcard),
            handling: Handling { media: Media::Plain, curl_correction: true },
            allowed: InkSet::default(),
            library: &library,
        };
        let plan = draft(&request, &Silent).unwrap().plan;
        let space = Space::half_angle(32);
        let looks = reflectances(&stacks, &library, &space);
        let material = |q: usize| MaterialReport {
            share: 0.25,
            target: looks.row(0).to_vec(),
            printed: looks.row(q).to_vec(),
            distance: 0.123,
            unscaled_distance: 0.456,
            light: 0.01,
            weights: vec![(stacks[q].clone(), 1.0)],
            gap: 0.0,
            convex: true,
            starts: 1,
            agreeing: 1,
            pruning_cost: 0.0,
        };
        let mut materials: Vec<MaterialReport> = (0..DRAWN + 3).map(|i| material(i % 2)).collect();
        let gloss = [false, true].map(|matter_than_any_ink| Gloss {
            target: [1.0, 2.0, 3.0],
            printed: [20.0, 45.0, 80.0],
            matter_than_any_ink,
        });
        let gloss: Vec<Gloss> = (0..DRAWN + 3).map(|i| gloss[i % 2]).collect();
        materials[..3].iter_mut().for_each(|material| material.share = 0.01);
        let (rmse, p95, max, light_rmse) = (0.02, 0.03, 0.4, 0.05);
        let fidelity =
            FidelityReport { mean: 0.0171, rmse, p95, max, light_rmse, width: 1, height: 1, map: vec![0.0] };
        let spectrum = press::preview::spectrum(&dots, &[0.9, 0.2]);
        assert!(spectrum.is_some());
        let subject = Subject {
            plan: &plan,
            space: &space,
            materials: &materials,
            gloss: &gloss,
            kind: "basis",
            fidelity: (&fidelity, 0.5),
            doubt: Some(DistanceUncertainty { distance: 0.03, deviation: 0.006, within: 0.124, known: 0.96 }),
            look: None,
            tones: &[],
            spectrum: spectrum.as_ref(),
            contrasts: None,
        };
        let text = page(&subject).unwrap();
        assert!(text.contains("&lt;script&gt;alert(1)"));
        assert!(!text.contains("<script") && !text.contains("<img src=x"));
        assert_eq!(text.matches("<svg").count(), DRAWN + 1);
        // The first three stand for less than the last.
        let drawn = |number: usize| text.contains(&format!("curves of basis {number}\""));
        assert_eq!(
            (0..DRAWN + 3).filter(|&number| drawn(number)).collect::<Vec<_>>(),
            (3..DRAWN + 3).collect::<Vec<_>>()
        );
        assert!(text.contains("Drawn are the 8 that stand for most"), "{text}");
        for part in [
            "0.017",
            "0.456",
            "12 % of the difference lies within your measurement",
            "100 % MS+C",
            "preview-02-cyan.png",
            "plan.html",
            "finest an eye resolves",
            "1.0, 2.0, 3.0 (matt), matter than any ink: a matt spray would bring it",
            "20, 45, 80 (satin)",
        ] {
            assert!(text.contains(part), "{part}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"));
        // The label stands above the curve, wherever that goes.
        let (before, drawing) = text.split_once(" fill=\"#8a4b12\" text-anchor").unwrap();
        let label: f64 = before.rsplit('"').nth(1).unwrap().parse().unwrap();
        let (curve, _) = drawing.split_once("fill=\"none\" stroke=\"#1b63a5\"").unwrap();
        let (_, curve) = curve.rsplit_once("d=\"M").unwrap();
        let highest = curve
            .trim_end_matches("\" ")
            .split('L')
            .map(|at| at.split_once(' ').unwrap().1.parse::<f64>().unwrap());
        assert!(label + 5.0 < highest.fold(f64::MAX, f64::min), "{label}");
        // On a phone each cell says what it is.
        let tables = text.split("class=\"cards\"").skip(1).map(|rest| rest.split_once("</table>").unwrap().0);
        let cells = tables.map(|table| (table.matches("<td").count(), table.matches("data-name=\"").count()));
        let cells: Vec<(usize, usize)> = cells.collect();
        assert!(cells.len() == 2 && cells.iter().all(|(cells, named)| cells == named), "{cells:?}");
        // Every stack of the built-in library is modelled, until it is measured.
        let measured = Plan {
            stacks: plan.stacks.iter().cloned().map(|stack| Share { modelled: false, ..stack }).collect(),
            ..plan.clone()
        };
        let badge = |plan: &Plan| {
            let page = page(&Subject { plan, ..subject }).unwrap();
            let text = plan.to_string();
            assert_eq!(page.contains("modelled inks</span>"), text.contains("Modelled inks: "));
            (page.contains("modelled inks</span>"), text.contains("no curve of these stacks was measured"))
        };
        assert_eq!([badge(&plan), badge(&measured)], [(true, true), (false, false)]);
        let even = page(&Subject { spectrum: None, ..subject }).unwrap();
        assert!(even.contains("too small or too even") && even.matches("<svg").count() == DRAWN);
    }
}
