//! A comparison as one page: photograph and prediction under a slider, figures below.
//!
//! Pictures are JPEG inside the page, which loads nothing else and opens from a disk. Names come from files and are escaped.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use press::html::{self, escape};

use super::comparison::{Comparison, PhotoFigures, Pictures};
use super::figures::Errors;

/// Stacks listed for a photograph.
const STACKS: usize = 12;

/// The page. `name` says what was printed.
pub fn html(name: &str, comparison: &Comparison, pictures: &[Pictures]) -> String {
    let mut body = String::new();
    let title = format!("{name} beside its photographs");
    let pictures: Vec<[String; 5]> = pictures.iter().map(encoded).collect();
    // Writing to a string does not fail.
    let _ = write_body(&title, comparison, &pictures, &mut body);
    html::read(&title, include_str!("page.css"), &body)
}

fn encoded(pictures: &Pictures) -> [String; 5] {
    let data = |picture: &Vec<u8>| STANDARD.encode(picture);
    let (document, mapped) = match &pictures.document {
        Some((document, mapped)) => (data(document), data(mapped)),
        None => (String::new(), String::new()),
    };
    [data(&pictures.photo), data(&pictures.print), data(&pictures.difference), document, mapped]
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// The heads of a table of errors, and the errors of one row of it.
fn heads(document: bool) -> &'static str {
    if document {
        "<th class=n>error<th class=n>gamut<th class=n>halftone<th class=n>inks<th class=n>rest"
    } else {
        "<th class=n>error<th class=n>inks<th class=n>rest"
    }
}

fn cells(errors: &Errors, page: &mut String) -> std::fmt::Result {
    write!(page, "<td class=n>{}", percent(errors.total))?;
    for part in [errors.gamut, errors.halftone].into_iter().flatten() {
        write!(page, "<td class=n>{}", percent(part))?;
    }
    write!(page, "<td class=n>{}<td class=n>{}", percent(errors.inks), percent(errors.rest))
}

fn write_body(title: &str, c: &Comparison, pictures: &[[String; 5]], page: &mut String) -> std::fmt::Result {
    write!(page, "<h1>{}</h1>", escape(title))?;
    let [width, height] = c.size_mm;
    let from = if c.document { "the document" } else { "the predicted print" };
    write!(
        page,
        "<p>{width:.0} x {height:.0} mm, {} photographs. An error is the root mean square difference of light from {from}, over \
         spots 1 mm wide and relative to the light of {from}. ",
        c.photos.len()
    )?;
    if c.document {
        page.push_str(
            "Gamut is what the inks cannot show, halftone what the dots change; inks is what stacks that are brighter or darker than \
             the library says explain, and rest is everything else. Parts may cancel, so they do not add up.",
        );
    } else {
        page.push_str(
            "Inks is what stacks that are brighter or darker than the library says explain, and rest is everything else.",
        );
    }
    page.push_str("</p>");
    if !c.warnings.is_empty() {
        page.push_str("<div class=\"doubtful\"><strong>Doubtful</strong><ul>");
        c.warnings.iter().try_for_each(|line| write!(page, "<li>{}", escape(line)))?;
        page.push_str("</ul></div>");
    }
    let wide = html::wide("figures");
    write!(
        page,
        "<h2>Figures</h2>{wide}<table><tr><th>photograph<th class=n>light<th class=n>view<th class=n>half angle{}",
        heads(c.document)
    )?;
    for photo in &c.photos {
        let [light, view, half] = photo.angles_deg;
        write!(
            page,
            "<tr><td>{}<td class=n>{light:.0}°<td class=n>{view:.0}°<td class=n>{half:.0}°",
            escape(&photo.name)
        )?;
        cells(&photo.errors, page)?;
    }
    if c.photos.len() > 1 {
        page.push_str("<tr><th>all<td><td><td>");
        cells(&c.errors, page)?;
    }
    page.push_str("</table></div>");
    for (i, (photo, pictures)) in c.photos.iter().zip(pictures).enumerate() {
        pair(i, photo, pictures, c.document, page)?;
        stacks(photo, page)?;
    }
    camera(c, page)?;
    writeln!(page, "<script>{}</script>", include_str!("page.js"))
}

fn pair(
    i: usize,
    photo: &PhotoFigures,
    [seen, print, difference, document, mapped]: &[String; 5],
    with: bool,
    page: &mut String,
) -> std::fmt::Result {
    let name = escape(&photo.name);
    write!(page, "<h2>{name}</h2><figure class=\"pair\"><div class=\"stage\">")?;
    let mut views = vec![("print", "predicted print", print)];
    if with {
        views.extend([("document", "document", document), ("mixture", "mixture of inks", mapped)]);
    }
    views.push(("difference", "difference: red brighter, blue darker than predicted", difference));
    for (what, _, data) in &views {
        write!(
            page,
            "<img class=\"view\" alt=\"{what}\" draggable=\"false\" src=\"data:image/jpeg;base64,{data}\">"
        )?;
    }
    write!(
        page,
        "<img class=\"over\" alt=\"photograph {name}\" draggable=\"false\" src=\"data:image/jpeg;base64,{seen}\"></div><figcaption>\
         <label for=\"split{i}\">photograph</label><input id=\"split{i}\" type=\"range\" min=\"0\" max=\"100\" value=\"50\">\
         <select aria-label=\"compared with\">"
    )?;
    views.iter().try_for_each(|(_, words, _)| write!(page, "<option>{words}"))?;
    page.push_str("</select></figcaption></figure>");
    Ok(())
}

fn stacks(photo: &PhotoFigures, page: &mut String) -> std::fmt::Result {
    if photo.stacks.is_empty() {
        return Ok(());
    }
    let ([least, most], wide) = (photo.half_angles_deg, html::wide(&format!("stacks of {}", photo.name)));
    write!(
        page,
        "<details><summary>Stacks: photographed over predicted, half angles {least:.0} to {most:.0}°</summary>{wide}<table>\
         <tr><th>stack<th class=n>of the dots<th class=n>red<th class=n>green<th class=n>blue<th>"
    )?;
    for factor in photo.stacks.iter().take(STACKS) {
        write!(page, "<tr><td>{}<td class=n>{}", escape(&factor.stack), percent(factor.share))?;
        for (value, error) in factor.factor.iter().zip(factor.standard_error) {
            write!(page, "<td class=n>{value:.3} ± {error:.3}")?;
        }
        write!(page, "<td>{}", if factor.differs { "differs" } else { "no difference found" })?;
    }
    page.push_str(
        "</table></div><p>± is one standard error. A stack differs if a channel is off from 1 by more than four of them and 0.01.</p></details>",
    );
    Ok(())
}

fn camera(c: &Comparison, page: &mut String) -> std::fmt::Result {
    let (lens, wide) = (&c.lens, html::wide("camera"));
    write!(
        page,
        "<h2>Camera</h2><p>Focal length {:.0} pixels, uncertain by {:.2} %; angle of view {:.1}°; distortion {:+.4}, {:+.4}. Millimetres \
         count from the middle of the camera marks.</p>{wide}<table><tr><th>photograph<th class=n>camera, mm\
         <th class=n>uncertain by<th class=n>lamp, mm<th class=n>marks<th class=n>off by<th class=n>paper off by<th class=n>seen",
        lens.focal_px,
        100.0 * lens.focal_error,
        lens.field_of_view_deg,
        lens.radial[0],
        lens.radial[1]
    )?;
    for photo in &c.photos {
        let place = |[x, y, z]: [f64; 3]| format!("{x:.1}, {y:.1}, {z:.1}");
        write!(
            page,
            "<tr><td>{}<td class=n>{}<td class=n>{:.2} mm<td class=n>{}<td class=n>{}<td class=n>{:.2} px<td class=n>{}<td class=n>{:.0} %",
            escape(&photo.name),
            place(photo.camera_mm),
            photo.camera_error_mm,
            place(photo.light_mm),
            photo.marks,
            photo.residual_px,
            percent(photo.paper_deviation),
            100.0 * photo.seen
        )?;
    }
    page.push_str("</table></div>");
    Ok(())
}
