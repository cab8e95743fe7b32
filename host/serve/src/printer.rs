//! What a printer says of itself: Get-Printer-Attributes.
//!
//! Method: one list, made anew for each answer from the tables that jobs are read by ([`template`](crate::template)), so a printer
//! offers what it takes. Each attribute is of a group, for clients that ask for groups.
//! Limits: one tray, one side, no finishings. The printer does not know how much ribbon is left.
//! Source: RFC 8011, section 5.4; PWG 5100.3, 5100.7, 5100.11, 5100.13 and 5100.14; for `urf-supported` and `mopria-certified`, which
//! have no public text, what clients ask for.

use ipp::value::IppValue;

use crate::budget::Client;
use crate::server::{Cartridge, Preset, Server, identity};
use crate::spool::KINDS;
use crate::template::{
    AUTO, MOST_COPIES, ORIENTATIONS, OVERRIDES, QUALITIES, RESOLUTIONS, Size, keyword_of, margins, paper,
    sheets, sizes, supported,
};
use crate::values::{
    charset, collection, date_time, dpi, integer, keyword, keywords, language, list, long_text, mime, name,
    octets, range, text, unknown, uri,
};
use crate::wire::{Operation, Place};
use press::layout::fit::Scaling;
use queue::messages::Reason;

/// The type of printer in its names.
pub const MODEL: &str = "ALPS MD-5500 (Foilpress)";
/// Its device ID.
pub const DEVICE_ID: &str = "MFG:ALPS;MDL:MD-5500;CMD:PDF,PWGRaster,AppleRaster,URF,JPEG,PNG;CLS:PRINTER;";
/// What phones are told of Apple raster: one copy, sRGB and grey, 300 and 600 dpi, media type by itself, version 1.4.
pub const URF: [&str; 7] = ["V1.4", "CP1", "W8", "SRGB24", "DM1", "RS300-600", "MT1-2-3"];
/// The longest name of a service. Source: RFC 6763, section 4.1.1.
const LONGEST: usize = 63;

/// An attribute with its group.
pub type Attribute = (&'static str, &'static str, IppValue);

/// How a printer is called in dialogs, on a computer of this name.
pub fn title(preset: &str, computer: &str) -> String {
    let mut title = format!("ALPS {preset} @ {computer}");
    while title.len() > LONGEST {
        title.pop();
    }
    title
}

fn media_size((width, length): Size) -> IppValue {
    collection([("x-dimension", integer(width)), ("y-dimension", integer(length))])
}

/// A sheet with its margins; with `kind` what it is made of.
pub fn media_col(sheet: Size, kind: Option<&str>) -> IppValue {
    let [left, top, right, bottom] = paper(sheet).map_or([0; 4], margins);
    let mut members = vec![
        ("media-size", media_size(sheet)),
        ("media-size-name", keyword(&keyword_of(sheet))),
        ("media-left-margin", integer(left)),
        ("media-top-margin", integer(top)),
        ("media-right-margin", integer(right)),
        ("media-bottom-margin", integer(bottom)),
        ("media-source", keyword("main")),
    ];
    members.extend(kind.map(|kind| ("media-type", keyword(kind))));
    collection(members)
}

/// A sheet of any size, with the margins it has.
fn media_col_range() -> IppValue {
    let (least, most) = sizes();
    let [left, top, right, bottom] = paper(least).map_or([0; 4], margins);
    collection([
        (
            "media-size",
            collection([("x-dimension", range(least.0, most.0)), ("y-dimension", range(least.1, most.1))]),
        ),
        ("media-left-margin", integer(left)),
        ("media-top-margin", integer(top)),
        ("media-right-margin", integer(right)),
        ("media-bottom-margin", integer(bottom)),
        ("media-source", keyword("main")),
    ])
}

/// Keywords of the smallest and the largest sheet.
fn custom() -> [String; 2] {
    let (least, most) = sizes();
    let side = |side: i32| {
        let text = format!("{}.{:02}", side / 100, side % 100);
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    [("min", least), ("max", most)]
        .map(|(which, (width, length))| format!("custom_{which}_{}x{}mm", side(width), side(length)))
}

/// All margins there are on one side, the smallest first.
fn margin(side: usize) -> IppValue {
    let (least, _) = sizes();
    let sheets = sheets().filter_map(|(_, size)| paper(size)).chain(paper(least));
    let mut all: Vec<i32> = sheets.map(|paper| margins(paper)[side]).collect();
    all.sort_unstable();
    all.dedup();
    list(all.into_iter().map(integer))
}

/// A ribbon as IPP tells it. The printer does not know how much is left: -3 is some, 0 none, -2 not known.
fn supply(index: usize, cartridge: &Cartridge) -> String {
    let level = if cartridge.is_loaded { -3 } else { 0 };
    format!(
        "index={index};class=supplyThatIsConsumed;type=ribbonWax;unit=percent;maxcapacity=100;level={level};colorantname={};",
        cartridge.name
    )
}

/// All that can be known of a printer.
pub fn attributes(server: &Server, preset: &Preset, place: &Place) -> Vec<Attribute> {
    let data = server.data();
    let uuid = identity(&data, &format!("printer {}", preset.name));
    let loaded = data.loaded();
    let up = server.started.elapsed().as_secs() + 1;
    let began = crate::values::now().saturating_sub(up);
    let is_printing = data.current().is_some();
    let is_stopped = match is_printing {
        true => data.reasons.iter().any(|&reason| reason != Reason::SupplyMissing),
        false => data.stopped().is_some(),
    };
    let state = if is_stopped { 5 } else { 3 + i32::from(is_printing) };
    let reasons = match data.keywords() {
        none if none.is_empty() => keyword("none"),
        some => keywords(some),
    };
    let queued = data.jobs.values().filter(|job| !job.state.is_over() && job.printer == preset.name).count();
    let names: Vec<String> = sheets().map(|(keyword, _)| keyword.into()).collect();
    let media = names.iter().cloned().chain(custom());
    let mut formats: Vec<&str> = vec!["application/octet-stream"];
    KINDS.iter().for_each(|kind| {
        if !formats.contains(&kind.mime) {
            formats.push(kind.mime);
        }
    });
    let types = || supported("media-type").chain([AUTO]);
    let none = Cartridge { name: "unknown".into(), colour: "none", is_loaded: true };
    let cartridges =
        if data.cartridges.is_empty() { std::slice::from_ref(&none) } else { &data.cartridges[..] };
    let supplies = (1..).zip(cartridges);
    let colour = preset.choices.colours.len() > 1;
    const D: &str = "printer-description";
    const T: &str = "job-template";
    vec![
        (D, "charset-configured", charset("utf-8")),
        (D, "charset-supported", list(["utf-8", "us-ascii"].map(charset))),
        (D, "color-supported", IppValue::Boolean(colour)),
        (D, "compression-supported", keywords(["none", "deflate", "gzip"])),
        (D, "document-format-default", mime("application/octet-stream")),
        (D, "document-format-preferred", mime("image/pwg-raster")),
        (D, "document-format-supported", list(formats.into_iter().map(mime))),
        (D, "document-password-supported", integer(0)),
        (D, "generated-natural-language-supported", language("en")),
        (D, "identify-actions-default", keyword("display")),
        (D, "identify-actions-supported", keyword("display")),
        (D, "ipp-features-supported", keyword("ipp-everywhere")),
        (D, "ipp-versions-supported", keywords(["1.1", "2.0"])),
        (
            D,
            "job-creation-attributes-supported",
            keywords([
                "copies",
                "finishings",
                "ipp-attribute-fidelity",
                "job-hold-until",
                "job-name",
                "media",
                "media-col",
                "multiple-document-handling",
                "orientation-requested",
                "output-bin",
                "page-ranges",
                "print-color-mode",
                "print-content-optimize",
                "print-quality",
                "print-rendering-intent",
                "print-scaling",
                "printer-resolution",
                "sides",
            ]),
        ),
        (D, "job-ids-supported", IppValue::Boolean(true)),
        (D, "job-k-octets-supported", range(0, 1 << 20)),
        (D, "landscape-orientation-requested-preferred", IppValue::Enum(4)),
        (D, "mopria-certified", keyword("1.3")),
        (D, "multiple-document-jobs-supported", IppValue::Boolean(false)),
        (D, "multiple-operation-time-out", integer(TIME_OUT)),
        (D, "multiple-operation-time-out-action", keyword("abort-job")),
        (D, "natural-language-configured", language("en")),
        (
            D,
            "operations-supported",
            list(Operation::ALL.map(|operation| IppValue::Enum(operation.code().into()))),
        ),
        (D, "pages-per-minute", integer(1)),
        (D, "pages-per-minute-color", integer(1)),
        (D, "pdl-override-supported", keyword("attempted")),
        (D, "preferred-attributes-supported", IppValue::Boolean(false)),
        (D, "printer-config-change-date-time", date_time(data.configured)),
        (D, "printer-config-change-time", integer(data.configured.saturating_sub(began))),
        (D, "printer-current-time", date_time(crate::values::now())),
        (D, "printer-device-id", long_text(DEVICE_ID)),
        (D, "printer-dns-sd-name", name(&title(&preset.name, &server.settings.called()))),
        (D, "printer-geo-location", unknown()),
        (D, "printer-get-attributes-supported", keyword("document-format")),
        (D, "printer-icons", uri(&place.page("icon.png"))),
        (D, "printer-info", text(&preset.about)),
        (
            D,
            "printer-input-tray",
            octets(
                "type=sheetFeedAutoNonRemovableTray;mediafeed=0;mediaxfeed=0;maxcapacity=1;level=-2;status=0;name=main;",
            ),
        ),
        (D, "printer-is-accepting-jobs", IppValue::Boolean(server.accepts(&data, Client::at(place.from)))),
        (D, "printer-kind", keywords(["document", "photo"])),
        (D, "printer-location", text("")),
        (D, "printer-make-and-model", text(MODEL)),
        (D, "printer-more-info", uri(&place.page(""))),
        (D, "printer-name", name(&preset.name)),
        (D, "printer-organization", text("")),
        (D, "printer-organizational-unit", text("")),
        (
            D,
            "printer-output-tray",
            octets(
                "type=unRemovableBin;maxcapacity=1;remaining=-2;status=0;stackingorder=firstToLast;pagedelivery=faceUp;name=face-up;",
            ),
        ),
        (D, "printer-state", IppValue::Enum(state)),
        (D, "printer-state-change-date-time", date_time(data.changed)),
        (D, "printer-state-change-time", integer(data.changed.saturating_sub(began))),
        (D, "printer-state-message", long_text(&data.said())),
        (D, "printer-state-reasons", reasons),
        (D, "printer-supply", list(supplies.clone().map(|(index, found)| octets(&supply(index, found))))),
        (D, "printer-supply-description", list(supplies.map(|(_, found)| text(&found.name)))),
        (D, "printer-supply-info-uri", uri(&place.page(""))),
        (D, "marker-names", list(cartridges.iter().map(|found| name(&found.name)))),
        (D, "marker-types", list(cartridges.iter().map(|_| keyword("ribbonWax")))),
        (D, "marker-colors", list(cartridges.iter().map(|found| name(found.colour)))),
        (
            D,
            "marker-levels",
            list(cartridges.iter().map(|found| integer(if found.is_loaded { -3 } else { 0 }))),
        ),
        (D, "printer-up-time", integer(up)),
        (
            D,
            "printer-uri-supported",
            list(["ipp", "ipps"].map(|scheme| uri(&place.as_scheme(scheme, &preset.name)))),
        ),
        (D, "printer-uuid", uri(&format!("urn:uuid:{uuid}"))),
        (D, "pwg-raster-document-resolution-supported", list(queue::raster::RESOLUTIONS.map(dpi))),
        (D, "pwg-raster-document-sheet-back", keyword("normal")),
        (
            D,
            "pwg-raster-document-type-supported",
            keywords(["black_1", "cmyk_8", "sgray_8", "srgb_8", "srgb_16"]),
        ),
        (D, "queued-job-count", integer(queued)),
        (D, "urf-supported", keywords(URF)),
        (D, "uri-authentication-supported", keywords(["none", "none"])),
        (D, "uri-security-supported", keywords(["none", "tls"])),
        (D, "which-jobs-supported", keywords(["completed", "not-completed", "all"])),
        (T, "copies-default", integer(1)),
        (T, "copies-supported", range(1, MOST_COPIES)),
        (T, "finishings-default", IppValue::Enum(3)),
        (T, "finishings-supported", IppValue::Enum(3)),
        (T, "job-hold-until-default", keyword("no-hold")),
        (T, "job-hold-until-supported", keywords(["no-hold", "indefinite"])),
        (T, "job-priority-default", integer(50)),
        (T, "job-priority-supported", integer(1)),
        (T, "job-sheets-default", keyword("none")),
        (T, "job-sheets-supported", keyword("none")),
        (T, "media-default", keyword(&keyword_of(loaded.size))),
        (T, "media-ready", keyword(&keyword_of(loaded.size))),
        (T, "media-supported", list(media.map(|name| keyword(&name)))),
        (T, "media-col-default", media_col(loaded.size, Some(&loaded.kind))),
        (T, "media-col-ready", media_col(loaded.size, Some(&loaded.kind))),
        (
            T,
            "media-col-supported",
            keywords([
                "media-bottom-margin",
                "media-left-margin",
                "media-right-margin",
                "media-size",
                "media-size-name",
                "media-source",
                "media-top-margin",
                "media-type",
            ]),
        ),
        (
            T,
            "media-col-database",
            list(
                sheets()
                    .flat_map(|(_, size)| types().map(move |kind| media_col(size, Some(kind))))
                    .chain([media_col_range()]),
            ),
        ),
        (T, "media-size-supported", {
            let (least, most) = sizes();
            let any = collection([
                ("x-dimension", range(least.0, most.0)),
                ("y-dimension", range(least.1, most.1)),
            ]);
            list(sheets().map(|(_, size)| media_size(size)).chain([any]))
        }),
        (T, "media-left-margin-supported", margin(0)),
        (T, "media-top-margin-supported", margin(1)),
        (T, "media-right-margin-supported", margin(2)),
        (T, "media-bottom-margin-supported", margin(3)),
        // A bare number here hangs a client.
        (T, "media-source-supported", keyword("main")),
        (T, "media-type-supported", keywords(types())),
        (T, "multiple-document-handling-default", keyword("separate-documents-uncollated-copies")),
        (T, "multiple-document-handling-supported", keyword("separate-documents-uncollated-copies")),
        (T, "number-up-default", integer(1)),
        (T, "number-up-supported", integer(1)),
        // Without a wish a page lies as it fits.
        (T, "orientation-requested-default", IppValue::NoValue),
        (
            T,
            "orientation-requested-supported",
            list(ORIENTATIONS.map(|(orientation, _)| IppValue::Enum(orientation))),
        ),
        (T, "output-bin-default", keyword("face-up")),
        (T, "output-bin-supported", keyword("face-up")),
        (T, "overrides-supported", keywords(OVERRIDES)),
        (T, "page-ranges-supported", IppValue::Boolean(true)),
        (T, "print-color-mode-default", keyword(AUTO)),
        (T, "print-color-mode-supported", keywords(supported("print-color-mode"))),
        (T, "print-content-optimize-default", keyword(AUTO)),
        (T, "print-content-optimize-supported", keywords(supported("print-content-optimize"))),
        (T, "print-quality-default", IppValue::Enum(4)),
        (T, "print-quality-supported", list(QUALITIES.map(IppValue::Enum))),
        (T, "print-rendering-intent-default", keyword(AUTO)),
        (T, "print-rendering-intent-supported", keywords(supported("print-rendering-intent"))),
        (T, "print-scaling-default", keyword(AUTO)),
        (T, "print-scaling-supported", keywords(Scaling::ALL.map(Scaling::name))),
        (T, "printer-resolution-default", dpi(600)),
        (T, "printer-resolution-supported", list(RESOLUTIONS.map(dpi))),
        (T, "sides-default", keyword("one-sided")),
        (T, "sides-supported", keyword("one-sided")),
    ]
}

/// Seconds until the document of a job has to begin to come, from the last operation of that job.
pub const TIME_OUT: i32 = 120;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_fits() {
        assert_eq!(title("decal", "workshop"), "ALPS decal @ workshop");
        let long = title(&"ä".repeat(60), "workshop");
        assert!(long.len() <= LONGEST && long.starts_with("ALPS ä"), "{long}");
    }
}
