//! One HTML file that shows a document and its print under light that follows the hand.
//!
//! Problem: a page that opens from a disk, asks no network, draws what [`Renderer`](crate::Renderer) draws, and stays small.
//! Method: sources in `web/` are joined into one module (imports between them are dropped, so their top-level names differ),
//! and the data is JSON beside it. Weight maps are bytes, channel by channel, each byte as the step from its left neighbour,
//! deflated; dots are one byte each, deflated. The page averages the dots to the weights of their stacks itself, so the print
//! is stored once and exactly. Curves are tables over the chord between normal and half vector.
//! Names come from documents of unknown origin: the page sets them as text, and `<` never appears in the data.
//! Cost: most of the time is deflate. Limits: maps of at most [`LONGEST`] places a side; curves within 0.3 % at the peak of the
//! sharpest foil.

use std::f64::consts::SQRT_2;
use std::io::Write as _;

use appearance::brdf::{Space, Table};
use appearance::edit::fingerprint;
use appearance::factor::Factored;
use appearance::materials::{Metallic, Nearest};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use inks::Stack;
use observe::Observer;
use press::html;
use press::preview::{Probe, Source, ToneCurve};
use press::separate;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use sheet::{Area, DotMap, colours, label};

use crate::error::ViewError;
use crate::lit::fit;

/// The longer side of a weight map.
pub const LONGEST: usize = 1024;

/// Entries of a curve's table.
pub(crate) const STEPS: usize = 1024;

/// The longer side of the map of differences.
const DIFFERENCE: usize = 256;

/// A difference of this size is the last byte.
const MOST_DIFFERENCE: f64 = 0.51;

/// Rows of the light probe: texels of 2.8 degrees.
const PROBE_ROWS: usize = 64;

/// White paper in false colours.
const PAPER: [u8; 3] = [250, 250, 247];

/// What the pages that work look like.
pub(crate) const STYLE: &str = include_str!("../web/style.css");

/// The sources in the order of their use.
const SCRIPTS: [&str; 15] = [
    include_str!("../web/geometry.js"),
    include_str!("../web/edit.js"),
    include_str!("../web/data.js"),
    include_str!("../web/surroundings.js"),
    include_str!("../web/draw.js"),
    include_str!("../web/state.js"),
    include_str!("../web/spot.js"),
    include_str!("../web/stage.js"),
    include_str!("../web/controls.js"),
    include_str!("../web/editing.js"),
    include_str!("../web/lamps.js"),
    include_str!("../web/look.js"),
    include_str!("../web/hand.js"),
    include_str!("../web/panel.js"),
    include_str!("../web/main.js"),
];

/// What the page shows.
pub struct Subject<'a> {
    /// Its name, as text of unknown origin.
    pub name: &'a str,
    /// A line about it.
    pub about: &'a str,
    /// Width and height in metres.
    pub size: [f64; 2],
    /// The document and its mixture of inks, if there is more than a sheet.
    pub target: Option<Target<'a>>,
    /// The printed dots.
    pub dots: &'a DotMap,
    /// What the stacks of the dots reflect.
    pub stacks: &'a Table,
    /// The tabulation of all curves.
    pub space: &'a Space,
    /// Light from everywhere, where it is switched on.
    pub probe: &'a Probe,
    /// The scene at first, as the fragment of an address: `light=-20,30&exposure=0.5`.
    pub start: &'a str,
    /// The picture for browsers that cannot draw, as PNG.
    pub still: &'a [u8],
}

/// The document beside its print.
pub struct Target<'a> {
    /// The document, factored.
    pub document: &'a Factored,
    /// The mixtures that stand for it.
    pub mapped: &'a Factored,
    /// What each basis of `mapped` is mixed of.
    pub mixtures: &'a [String],
    /// The commands that replay `steps.toml` on the document, one a line; empty if bases are not edited.
    pub replay: &'a str,
}

/// Weights over curves.
#[derive(Serialize)]
struct Layer {
    width: usize,
    height: usize,
    names: Vec<String>,
    curves: String,
    weights: String,
}

/// Writes the page.
///
/// # Errors
/// Tables that do not match each other.
pub fn page(subject: &Subject, observer: &dyn Observer) -> Result<String, ViewError> {
    observer.begin("writing the page", 4);
    let Subject { dots, stacks, space, .. } = subject;
    // Stacks without a dot are left out.
    let census = dots.census();
    let used: Vec<usize> = (0..census.len()).filter(|&q| census[q] > 0).collect();
    let mut number = [0u8; 256];
    used.iter().enumerate().for_each(|(new, &old)| number[old] = new as u8);
    let index: Vec<u8> = dots.index().par_iter().map(|&dot| number[usize::from(dot)]).collect();
    let every: Vec<Stack> = dots.stacks().to_vec();
    let names: Vec<Stack> = used.iter().map(|&q| every[q].clone()).collect();
    let (passes, bits) = separate::passes(&names);
    let shades = colours(&every);
    let map = fit((dots.width(), dots.length()), LONGEST);
    let rows: Vec<&[f64]> = used.iter().map(|&q| stacks.row(q)).collect();
    let printed = json!({
        "width": dots.width(), "length": dots.length(), "map": [map.0, map.1],
        "names": names.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "inks": names.iter().map(|s| s.layers().iter().map(|ink| ink.name()).collect()).collect::<Vec<Vec<_>>>(),
        "colours": used.iter().map(|&q| shades[q]).collect::<Vec<_>>(),
        "passes": passes.iter().map(|ink| json!({ "name": ink.name(), "colour": label(*ink, PAPER) })).collect::<Vec<_>>(),
        "bits": bits,
        "curves": packed(&tables(space, &rows))?,
        "dots": packed(&index)?,
    });
    observer.advance(1);
    let target = subject.target.as_ref();
    let document = target.map(|t| layer(t.document, &|i| format!("basis {i}"))).transpose()?;
    observer.advance(1);
    let mapped =
        target.map(|t| layer(t.mapped, &|i| t.mixtures.get(i).cloned().unwrap_or_default())).transpose()?;
    observer.advance(1);
    let area = Area::whole(dots);
    let print = Source::Print { dots, space, stacks, area };
    let difference = target.map(|t| difference(&Source::Factored(t.document), &print)).transpose()?;
    let probe = subject.probe.resized(PROBE_ROWS);
    let texels: Vec<u8> = probe.rgb().iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let every_third = |values: &[f64]| values.iter().step_by(3).copied().collect::<Vec<f64>>();
    let data = json!({
        "name": subject.name, "about": subject.about, "size": subject.size, "start": subject.start,
        "white": ToneCurve::PAPER.exposure, "steps": STEPS,
        "metric": { "angles": space.angles(), "radiance": every_third(space.radiance()), "weight": every_third(space.weight()) },
        "edits": target.filter(|target| !target.replay.is_empty()).map(edits),
        "document": document, "mapped": mapped, "printed": printed, "difference": difference,
        "probe": { "width": probe.width(), "height": probe.height(), "texels": packed(&texels)? },
    });
    let page = assembled(subject, &serde_json::to_string(&data)?);
    observer.advance(1);
    observer.end();
    Ok(page)
}

/// The template with everything in its place.
fn assembled(subject: &Subject, data: &str) -> String {
    let script = SCRIPTS.map(joined).concat();
    let still = BASE64_STANDARD.encode(subject.still);
    let parts = [
        ("{{head}}", html::head(&format!("{} · Foilpress preview", subject.name), &[STYLE])),
        ("{{title}}", html::escape(subject.name)),
        ("{{vertex}}", include_str!("../web/vertex.glsl").to_owned()),
        ("{{fragment}}", include_str!("../web/fragment.glsl").to_owned()),
        ("{{still}}", still),
        // `<` occurs only within strings.
        ("{{data}}", data.replace('<', "\\u003c")),
        ("{{script}}", script),
    ];
    filled(include_str!("../web/page.html"), &parts)
}

/// A template with everything in its place. It is split once, so that nothing in a document's name is taken for a place.
pub(crate) fn filled(template: &str, parts: &[(&str, String)]) -> String {
    let mut rest = template;
    let mut out = String::with_capacity(rest.len() + parts.iter().map(|(_, text)| text.len()).sum::<usize>());
    while let Some((at, (mark, text))) =
        parts.iter().filter_map(|part| Some((rest.find(part.0)?, part))).min_by_key(|(at, _)| *at)
    {
        out.push_str(&rest[..at]);
        out.push_str(text);
        rest = &rest[at + mark.len()..];
    }
    out + rest
}

/// A source as part of the one module: what it takes from the others is there already.
pub(crate) fn joined(source: &str) -> String {
    let mut out = String::with_capacity(source.len());
    let mut inside_import = false;
    for line in source.lines() {
        inside_import |= line.starts_with("import ");
        if inside_import {
            inside_import = !line.trim_end().ends_with(';');
            continue;
        }
        out.push_str(line.strip_prefix("export ").unwrap_or(line));
        out.push('\n');
    }
    out
}

/// Bytes deflated (RFC 1950), as base64.
pub(crate) fn packed(bytes: &[u8]) -> Result<String, std::io::Error> {
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len() / 4), Compression::new(5));
    encoder.write_all(bytes)?;
    Ok(BASE64_STANDARD.encode(encoder.finish()?))
}

/// The tables of rows over the chord from 0 to the root of 2: for each row and entry R G B, as little-endian f32.
pub(crate) fn tables(space: &Space, rows: &[&[f64]]) -> Vec<u8> {
    let angle = |n: usize| 2.0 * (0.5 * SQRT_2 * n as f64 / (STEPS - 1) as f64).min(1.0).asin();
    let angles: Vec<f64> = (0..STEPS).map(angle).collect();
    let table = |row: &&[f64]| {
        let curve = space.curve(row);
        angles.iter().flat_map(|&t| curve.at(t)).flat_map(|f| (f as f32).to_le_bytes()).collect::<Vec<u8>>()
    };
    rows.par_iter().map(table).collect::<Vec<_>>().concat()
}

fn layer(factored: &Factored, name: &dyn Fn(usize) -> String) -> Result<Layer, ViewError> {
    let pixels = (factored.maps.width(), factored.maps.height());
    let (width, height) = fit(pixels, LONGEST);
    let shares = Source::Factored(factored).shares(width, height)?.ok_or(ViewError::NotFactored)?;
    let channels = factored.bases.len();
    let totals = factored.maps.totals();
    let used: Vec<usize> = (0..channels).filter(|&i| totals[i] > 0).collect();
    let plane = |&channel: &usize| {
        let mut bytes: Vec<u8> =
            shares.chunks_exact(channels).map(|weights| (255.0 * weights[channel] + 0.5) as u8).collect();
        for row in bytes.chunks_exact_mut(width) {
            for x in (1..width).rev() {
                row[x] = row[x].wrapping_sub(row[x - 1]);
            }
        }
        bytes
    };
    let planes: Vec<u8> = used.par_iter().map(plane).collect::<Vec<_>>().concat();
    let rows: Vec<&[f64]> = used.iter().map(|&i| factored.bases.row(i)).collect();
    Ok(Layer {
        width,
        height,
        names: used.iter().map(|&i| name(i)).collect(),
        curves: packed(&tables(&factored.space, &rows))?,
        weights: packed(&planes)?,
    })
}

/// What edits of the bases need: each as a body and one lobe, and what the document is known by. Bases are those of its [`layer`].
fn edits(target: &Target) -> serde_json::Value {
    let Factored { space, bases, maps } = target.document;
    let totals = maps.totals();
    let surface = |i: &usize| {
        let row = bases.row(*i);
        let found = Nearest::to(space, row);
        let Metallic { base, metallic } = found.metallic();
        json!({
            "number": i, "body": found.diffuse.map(|d| d / std::f64::consts::PI), "f0": found.f0, "alpha": found.alpha, "base": base, "metallic": metallic,
        })
    };
    let used: Vec<usize> = (0..bases.len()).filter(|&i| totals[i] > 0).collect();
    let surfaces: Vec<serde_json::Value> = used.par_iter().map(surface).collect();
    json!({ "fingerprint": fingerprint(target.document), "replay": target.replay, "surfaces": surfaces })
}

/// The distance d between document and print at every place of a coarse map.
fn difference(document: &Source, print: &Source) -> Result<serde_json::Value, ViewError> {
    let (width, height) = fit(print.size(), DIFFERENCE);
    let (Source::Factored(factored), Source::Print { stacks, space, .. }) = (document, print) else {
        return Err(ViewError::NotFactored);
    };
    let shares = |source: &Source| source.shares(width, height)?.ok_or(ViewError::NotFactored);
    let (a, b) = (shares(document)?, shares(print)?);
    let mixed = |shares: &[f32], rows: &Table, out: &mut [f64]| {
        out.fill(0.0);
        for (&share, row) in shares.iter().zip(rows.rows()).filter(|(share, _)| **share > 0.0) {
            out.iter_mut().zip(row).for_each(|(out, f)| *out += f64::from(share) * f);
        }
    };
    let bytes: Vec<u8> = a
        .par_chunks_exact(factored.bases.len())
        .zip(b.par_chunks_exact(stacks.len()))
        .map_init(
            || (vec![0.0; space.columns()], vec![0.0; space.columns()]),
            |(one, two), (a, b)| {
                mixed(a, &factored.bases, one);
                mixed(b, stacks, two);
                (255.0 * space.distance(one, two) / MOST_DIFFERENCE).round().min(255.0) as u8
            },
        )
        .collect();
    Ok(json!({ "width": width, "height": height, "most": MOST_DIFFERENCE, "bytes": packed(&bytes)? }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::weights::WeightMaps;
    use flate2::read::ZlibDecoder;
    use inks::Library;
    use observe::Silent;
    use std::io::Read as _;

    fn unpacked(text: &str) -> Vec<u8> {
        let mut out = Vec::new();
        ZlibDecoder::new(&BASE64_STANDARD.decode(text).unwrap()[..]).read_to_end(&mut out).unwrap();
        out
    }

    fn data(page: &str) -> serde_json::Value {
        let start = page.find("id=\"data\"").unwrap();
        let start = start + page[start..].find('>').unwrap() + 1;
        let end = start + page[start..].find("</script").unwrap();
        serde_json::from_str(&page[start..end]).unwrap()
    }

    fn made(name: &str) -> String {
        let library = Library::builtin();
        let stacks: Vec<Stack> = ["substrate", "K", "MS", "MS+C"].map(|s| s.parse().unwrap()).to_vec();
        // The black stack has no dot.
        let index = (0..60 * 40).map(|i| [0, 2, 3][i / 7 % 3]).collect();
        let dots = DotMap::new(60, 40, stacks.clone(), index).unwrap();
        let space = Space::half_angle(32);
        let rows = appearance::brdf::reflectances(&stacks, &library, &space);
        let document = Factored {
            space: space.clone(),
            bases: rows.clone(),
            maps: WeightMaps::new(1, 1, 4, vec![0, 0, 8192, 24576]).unwrap(),
        };
        page(
            &Subject {
                name,
                about: "60 x 40 dots",
                size: [0.00254, 0.00169],
                target: Some(Target { document: &document, mapped: &document, mixtures: &[], replay: "" }),
                dots: &dots,
                stacks: &rows,
                space: &space,
                probe: &Probe::studio(16),
                start: "light=0,0",
                still: b"png",
            },
            &Silent,
        )
        .unwrap()
    }

    #[test]
    fn dots_and_weights_come_back() {
        let data = data(&made("x"));
        let printed = &data["printed"];
        assert_eq!(printed["names"], json!(["substrate", "MS", "MS+C"]));
        assert_eq!(printed["inks"][2], json!(["metallic-silver", "cyan"]));
        let dots = unpacked(printed["dots"].as_str().unwrap());
        assert!((0..60 * 40).all(|i| usize::from(dots[i]) == i / 7 % 3));
        let curves = unpacked(printed["curves"].as_str().unwrap());
        assert_eq!(curves.len(), 3 * STEPS * 3 * 4);
        let layer = &data["document"];
        let weights = unpacked(layer["weights"].as_str().unwrap());
        let (width, height) =
            (layer["width"].as_u64().unwrap() as usize, layer["height"].as_u64().unwrap() as usize);
        assert_eq!(weights.len(), 2 * width * height);
        // Steps from the left: the first of a row is the weight itself.
        let sums: Vec<u8> = weights[..width]
            .iter()
            .scan(0u8, |sum, &step| {
                *sum = sum.wrapping_add(step);
                Some(*sum)
            })
            .collect();
        assert!(sums.iter().all(|&w| w == 64), "{sums:?}");
        let d = unpacked(data["difference"]["bytes"].as_str().unwrap());
        assert_eq!(
            d.len(),
            data["difference"]["width"].as_u64().unwrap() as usize
                * data["difference"]["height"].as_u64().unwrap() as usize
        );
    }

    /// Whatever a document is called, no tag of it reaches the page.
    #[test]
    fn hostile_names_stay_text() {
        for name in [
            "</script><script>alert(1)</script>",
            "{{data}}{{script}}",
            "a\"b'c&<img src=x onerror=alert(1)>",
            "\u{2028}\u{202e}<!--",
        ] {
            let page = made(name);
            assert_eq!(data(&page)["name"], *name);
            assert_eq!(page.matches("<script").count(), made("x").matches("<script").count(), "{name}");
            assert!(!page.contains("<img src=x"), "{name}");
            assert!(!page.contains("<!--"), "{name}");
        }
    }

    /// Nothing in the page can be asked of a network, and the policy of the page forbids it.
    #[test]
    fn the_page_is_whole() {
        let page = made("x");
        assert!(page.contains("default-src 'none'"));
        for outside in ["http://", "https://", "import ", "src=\"/", "url(", "{{data}}", "{{script}}"] {
            let found = page.replace("http://www.w3.org/2000/svg", "");
            assert!(!found.contains(outside), "{outside}");
        }
    }

    #[test]
    fn sources_are_joined_without_their_imports() {
        assert_eq!(joined("import { a } from './a.js';\nexport const b = a;\n"), "const b = a;\n");
        assert_eq!(joined("import {\n  a,\n} from './a.js';\nimportant();\n"), "important();\n");
    }
}
