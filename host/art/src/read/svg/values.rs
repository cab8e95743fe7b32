//! Values of CSS as the renderer reads them.
//!
//! Problem: programs write colours of later standards, variables and transforms with units. The renderer prints the first two
//! in black and leaves out the last.
//! Method: `var()` and `light-dark()` are replaced by what they stand for; paper is light. A colour that the renderer does not
//! know is converted to sRGB and cut off at its gamut; a transform loses its units. Whatever is still not understood is `None`,
//! so the value before it counts. Cost: a look at each value, at most [`MOST_REPLACED`] for its variables. Limits: no `calc()`,
//! no `color-mix()`, no percentages in transforms; `device-cmyk()` is converted as CSS does without a profile.
//! Source: CSS Color 4 and 5, CSS Transforms 1 and 2, CSS Variables 1.

use maths::Maths;
use palette::encoding::DisplayP3;
use palette::rgb::Rgb;
use palette::{FromColor, LinSrgb, Oklab, Oklch, Srgb, Xyz};
use svgtypes::{Color, Length, Paint, Transform};

use super::sheets::{closed, is_whole, parts};

/// The most variables that are replaced in one value, so that those that name each other end.
const MOST_REPLACED: usize = 64;

/// The longest value that variables make, so that those that double each other do not fill memory.
const MOST_LONG: usize = 1 << 16;

/// A value that is understood.
#[derive(PartialEq, Debug)]
pub(super) enum Value {
    /// As the renderer reads it.
    Plain(String),
    /// A colour of Display P3, converted. What writes such a colour writes it in sRGB first.
    Wide(String),
    /// As if nothing were said.
    Unset,
}

use Value::{Plain, Unset, Wide};

/// What a property's value is to the renderer; `None` if it is not understood. `variable` finds the value of a variable.
pub(super) fn understood<'a>(
    property: &str,
    value: &'a str,
    variable: &dyn Fn(&str) -> Option<&'a str>,
) -> Option<Value> {
    let value = replaced(value, variable, &mut { MOST_REPLACED })?;
    let value = value.trim();
    if !is_whole(value) {
        return None;
    }
    let lower = value.to_ascii_lowercase();
    match (lower.as_str(), property) {
        ("inherit", _) => return Some(Plain(lower)),
        ("unset" | "revert" | "revert-layer", _) => return Some(Unset),
        ("initial", "fill") => return Some(Plain("#000".into())),
        ("initial", "stroke") => return Some(Plain("none".into())),
        ("initial", _) => return Some(Unset),
        _ => {}
    }
    let plain = |known: bool| known.then(|| Plain(value.to_owned()));
    match property {
        "fill" | "stroke" => paint(value, &lower),
        "color" | "stop-color" | "flood-color" | "lighting-color" => colour(value, &lower),
        "opacity" | "fill-opacity" | "stroke-opacity" | "stop-opacity" | "flood-opacity" => {
            plain(number(value, 1.0).is_some())
        }
        "stroke-width" | "stroke-dashoffset" | "font-size" | "letter-spacing" | "word-spacing" => {
            plain(length(value) || value.bytes().all(|byte| byte.is_ascii_alphabetic() || byte == b'-'))
        }
        "stroke-dasharray" => {
            let mut all = value.split([',', ' ', '\t', '\n']).filter(|part| !part.is_empty());
            plain(lower == "none" || all.all(length))
        }
        "image-rendering" => Some(Plain(match lower.as_str() {
            "-moz-crisp-edges" | "-webkit-crisp-edges" | "-o-crisp-edges" | "-webkit-optimize-contrast" => {
                "crisp-edges".into()
            }
            _ => value.to_owned(),
        })),
        "transform" => transform(value, &lower),
        "translate" | "rotate" | "scale" => match lower.as_str() {
            "none" => Some(Unset),
            _ => transform(&format!("{property}({value})"), &format!("{property}({lower})")),
        },
        _ => plain(
            !["var(", "calc(", "min(", "max(", "clamp(", "env(", "attr("].iter().any(|f| lower.contains(f)),
        ),
    }
}

/// Whether a value is a length.
pub(super) fn length(value: &str) -> bool {
    value.parse::<Length>().is_ok()
}

/// A value with its variables replaced; `left` is how many more may be.
fn replaced<'a>(
    value: &'a str,
    variable: &dyn Fn(&str) -> Option<&'a str>,
    left: &mut usize,
) -> Option<String> {
    let mut out = String::new();
    let mut rest = value;
    loop {
        // Both are written in small letters by all that is known to write them.
        let found = [("var(", true), ("light-dark(", false)]
            .map(|(name, is)| rest.find(name).map(|at| (at, name, is)));
        let Some((at, name, is_variable)) = found.into_iter().flatten().min() else { break };
        *left = left.checked_sub(1)?;
        let (inside, after) = closed(&rest[at + name.len()..], b')');
        let first = parts(inside, b',').next().unwrap_or_default();
        let stands_for = match variable(first) {
            Some(known) if is_variable => replaced(known, variable, left)?,
            _ if is_variable => replaced(inside.split_once(',')?.1, variable, left)?,
            _ => replaced(first, variable, left)?,
        };
        out.push_str(&rest[..at]);
        out.push_str(&stands_for);
        if out.len() > MOST_LONG {
            return None;
        }
        rest = after;
    }
    out.push_str(rest);
    Some(out)
}

/// A number or percentage; `full` is 100 %.
fn number(text: &str, full: f64) -> Option<f64> {
    let found = match text.strip_suffix('%') {
        _ if text == "none" => 0.0,
        Some(percent) => percent.trim_end().parse::<f64>().ok()? / 100.0 * full,
        None => text.parse::<f64>().ok()?,
    };
    Some(found).filter(|found| found.is_finite())
}

/// An angle in degrees.
fn angle(text: &str) -> Option<f64> {
    let units = [("deg", 1.0), ("grad", 0.9), ("rad", 180.0 / std::f64::consts::PI), ("turn", 360.0)];
    let unit = units.iter().find_map(|(unit, degrees)| Some((text.strip_suffix(unit)?, degrees)));
    let (text, degrees) = unit.unwrap_or((text, &1.0));
    Some(number(text, 360.0)? * degrees)
}

/// A function's name and what its brackets hold, in small letters.
fn function(lower: &str) -> Option<(&str, &str)> {
    let (name, inside) = lower.split_once('(')?;
    Some((name.trim(), inside.strip_suffix(')')?))
}

fn paint(value: &str, lower: &str) -> Option<Value> {
    if matches!(lower, "none" | "context-fill" | "context-stroke") {
        return Some(Plain(lower.to_owned()));
    }
    if lower.starts_with("url(") {
        if Paint::from_str(value).is_ok() {
            return Some(Plain(value.to_owned()));
        }
        // A fallback that is not known is none.
        let (link, fallback) = value.split_at(value.find(')')? + 1);
        let fallback = fallback.trim();
        return Some(Plain(match colour(fallback, &fallback.to_ascii_lowercase()) {
            Some(Plain(colour) | Wide(colour)) => format!("{link} {colour}"),
            _ => link.to_owned(),
        }));
    }
    // What follows a colour is the same in another space.
    let first = value.split_once(char::is_whitespace).filter(|(_, rest)| {
        ["icc-color(", "icc-named-color(", "device-"].iter().any(|name| rest.trim_start().starts_with(name))
    });
    match first {
        Some((first, _)) => colour(first, &first.to_ascii_lowercase()),
        None => colour(value, lower),
    }
}

/// A colour.
fn colour(value: &str, lower: &str) -> Option<Value> {
    match lower {
        "currentcolor" => return Some(Plain("currentColor".into())),
        "rebeccapurple" => return Some(Plain("#663399".into())),
        _ if value.parse::<Color>().is_ok() => return Some(Plain(value.to_owned())),
        _ => {}
    }
    let (name, inside) = function(lower)?;
    let inside = inside.replace([',', '/'], " ");
    let mut all = inside.split_whitespace();
    let space = if name == "color" { all.next()? } else { name };
    let all: Vec<&str> = all.collect();
    let count = if space == "device-cmyk" { 4 } else { 3 };
    let alpha = match all.get(count..)? {
        [] => 1.0,
        [alpha] => number(alpha, 1.0)?,
        _ => return None,
    };
    let of = |at: usize, full: f64| number(all[at], full).map(|v| v as f32);
    let (rgb, wide) = match space {
        "rgb" | "rgba" => {
            (Srgb::new(of(0, 255.0)? / 255.0, of(1, 255.0)? / 255.0, of(2, 255.0)? / 255.0), false)
        }
        "srgb" => (Srgb::new(of(0, 1.0)?, of(1, 1.0)?, of(2, 1.0)?), false),
        "srgb-linear" => (Srgb::from_linear(LinSrgb::new(of(0, 1.0)?, of(1, 1.0)?, of(2, 1.0)?)), false),
        "display-p3" => {
            let p3 = Rgb::<DisplayP3, f32>::new(of(0, 1.0)?, of(1, 1.0)?, of(2, 1.0)?);
            (Srgb::from_color(Xyz::from_color(p3)), true)
        }
        "oklab" => (Srgb::from_color(Oklab::new(of(0, 1.0)?, of(1, 0.4)?, of(2, 0.4)?)), false),
        "oklch" => (Srgb::from_color(Oklch::new(of(0, 1.0)?, of(1, 0.4)?, angle(all[2])? as f32)), false),
        "device-cmyk" => {
            let k = of(3, 1.0)?;
            let light = |v: f32| 1.0 - (v * (1.0 - k) + k).min(1.0);
            (Srgb::new(light(of(0, 1.0)?), light(of(1, 1.0)?), light(of(2, 1.0)?)), false)
        }
        _ => return None,
    };
    let [r, g, b] = [rgb.red, rgb.green, rgb.blue].map(|v| (v * 255.0).round() as u8);
    let alpha = (alpha * 255.0).round() as u8;
    let text = if alpha == 255 {
        format!("#{r:02x}{g:02x}{b:02x}")
    } else {
        format!("#{r:02x}{g:02x}{b:02x}{alpha:02x}")
    };
    Some(if wide { Wide(text) } else { Plain(text) })
}

/// A transform, as an attribute states it.
fn transform(value: &str, lower: &str) -> Option<Value> {
    if lower == "none" {
        return Some(Plain(String::new()));
    }
    if value.parse::<Transform>().is_ok() {
        return Some(Plain(value.to_owned()));
    }
    let mut out = String::new();
    for function in lower.split_inclusive(')').map(str::trim).filter(|function| !function.is_empty()) {
        let (name, inside) = self::function(function)?;
        let inside = inside.replace(',', " ");
        let all: Vec<&str> = inside.split_whitespace().collect();
        let px = |text: &str| number(text.strip_suffix("px").unwrap_or(text), f64::NAN);
        let share = |text: &str| number(text, 1.0);
        out.push_str(&match (name, &all[..]) {
            ("translate" | "translatex", [x]) => format!("translate({} 0)", px(x)?),
            ("translate", [x, y]) | ("translate3d", [x, y, _]) => format!("translate({} {})", px(x)?, px(y)?),
            ("translatey", [y]) => format!("translate(0 {})", px(y)?),
            ("translatez", [_]) => String::new(),
            ("rotate" | "rotatez", [turn]) => format!("rotate({})", angle(turn)?),
            ("scale", [both]) => format!("scale({})", share(both)?),
            ("scale", [x, y]) | ("scale3d", [x, y, _]) => format!("scale({} {})", share(x)?, share(y)?),
            ("scalex", [x]) => format!("scale({} 1)", share(x)?),
            ("scaley", [y]) => format!("scale(1 {})", share(y)?),
            ("skewx" | "skew", [x]) => format!("skewX({})", angle(x)?),
            ("skewy", [y]) => format!("skewY({})", angle(y)?),
            ("skew", [x, y]) => {
                let slope = |text: &str| angle(text).map(|degrees| degrees.to_radians().tangent());
                format!("matrix(1 {} {} 1 0 0)", slope(y)?, slope(x)?)
            }
            ("matrix", [_, _, _, _, _, _]) => {
                let all = all.iter().map(|v| px(v).map(|v| v.to_string())).collect::<Option<Vec<_>>>()?;
                format!("matrix({})", all.join(" "))
            }
            _ => return None,
        });
    }
    Some(Plain(out))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(property: &str, value: &str) -> Option<Value> {
        let known = [
            ("--a", "#123456"),
            ("--b", "var(--a)"),
            ("--loop", "var(--loop)"),
            ("--more", "var(--more) var(--more)"),
        ];
        understood(property, value, &|name| {
            known.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
        })
    }

    fn plain(property: &str, value: &str) -> String {
        match of(property, value) {
            Some(Plain(text) | Wide(text)) => text,
            other => panic!("{property}:{value}: {other:?}"),
        }
    }

    #[test]
    fn colours_of_later_standards_are_those_of_its_own_examples() {
        // The test suite of CSS has `green` and `lime` in each space.
        for (value, wanted) in [
            ("oklch(51.975% 0.17686 142.495)", "#008000"),
            ("oklab(51.975% -0.1403 0.10768)", "#008000"),
            ("color(srgb 0 50.2% 0)", "#008000"),
            ("color(srgb-linear 0 .21586 0)", "#008000"),
            ("color(display-p3 .21604 .49418 .13151)", "#008000"),
            ("color(display-p3 0 1 0)", "#00ff00"),
            ("rgb(0 160 0 / 100%)", "#00a000"),
            ("RGBA(100% 0% 0% / 50%)", "#ff000080"),
            ("rgb(none 300 -5 / none)", "#00ff0000"),
            ("device-cmyk(0 1 100% 0)", "#ff0000"),
            ("device-cmyk(0, 0, 0, .5)", "#808080"),
            ("rebeccapurple", "#663399"),
            ("light-dark(#fff2cc, #281d00)", "#fff2cc"),
            ("light-dark(rgb(1, 2, 3), #000)", "rgb(1, 2, 3)"),
            ("var(--b)", "#123456"),
            ("var(--none, var( --a ))", "#123456"),
            ("var(--none,)", ""),
            ("#CD853F icc-color(acmecmyk, 0.11, 0.48)", "#CD853F"),
            ("url(#a) oklch(0 0 0)", "url(#a) #000000"),
            ("url(#a) odd", "url(#a)"),
            ("CurrentColor", "currentColor"),
            ("NONE", "none"),
        ] {
            if wanted.is_empty() {
                assert_eq!(of("fill", value), None);
            } else {
                assert_eq!(plain("fill", value), wanted, "{value}");
            }
        }
        assert!(matches!(of("fill", "color(display-p3 0 0 0)"), Some(Wide(_))));
        for value in [
            "",
            "blurple",
            "var(--none)",
            "var(--loop)",
            "var(--more)",
            "color-mix(in srgb, red, blue)",
            "rgb(1 2)",
        ] {
            assert_eq!(of("fill", value), None, "{value}");
        }
        assert_eq!(of("stroke", "unset"), Some(Unset));
    }

    #[test]
    fn a_transform_moves_as_the_matrix_of_its_own_definition() {
        let matrix = |value: &str| {
            let t: Transform = plain("transform", value).parse().unwrap();
            [t.a, t.b, t.c, t.d, t.e, t.f].map(|v| (v * 1e6).round() / 1e6)
        };
        let (s, c) = (20f64.to_radians().sin(), 20f64.to_radians().cos());
        let round = |all: [f64; 6]| all.map(|v| (v * 1e6).round() / 1e6);
        for (value, wanted) in [
            ("rotate(20deg)", [c, s, -s, c, 0.0, 0.0]),
            ("rotate(.25turn)", [0.0, 1.0, -1.0, 0.0, 0.0, 0.0]),
            ("translateX(20px)", [1.0, 0.0, 0.0, 1.0, 20.0, 0.0]),
            ("translate(10px,0) scale(50%, 2)", [0.5, 0.0, 0.0, 2.0, 10.0, 0.0]),
            ("translate3d(1px, 2px, 0) scaleY(3)", [1.0, 0.0, 0.0, 3.0, 1.0, 2.0]),
            ("skew(45deg, 0)", [1.0, 0.0, 1.0, 1.0, 0.0, 0.0]),
            ("skewY(50grad)", [1.0, 1.0, 0.0, 1.0, 0.0, 0.0]),
            ("matrix(1, 2, 3, 4, 5, 6)", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            ("none", [1.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        ] {
            assert_eq!(matrix(value), round(wanted), "{value}");
        }
        for value in [
            "translate(50%, 0)",
            "rotate3d(1,1,1,4deg)",
            "translateX(1em)",
            "rotate(",
            ")",
            "translate(calc(1px))",
        ] {
            assert_eq!(of("transform", value), None, "{value}");
        }
        assert_eq!(plain("rotate", "90deg"), "rotate(90)");
        assert_eq!(plain("scale", "2 3"), "scale(2 3)");
    }

    #[test]
    fn other_values_are_known_by_their_kind() {
        for (property, value) in [
            ("opacity", "50%"),
            ("stroke-width", ".2px"),
            ("font-size", "x-large"),
            ("stroke-dasharray", "1, 2 3mm"),
            ("stroke-linecap", "round"),
            ("filter", "drop-shadow(1px 1px 2px #000)"),
        ] {
            assert_eq!(plain(property, value), value, "{property}");
        }
        for value in ["-moz-crisp-edges", "-webkit-crisp-edges", "crisp-edges"] {
            assert_eq!(plain("image-rendering", value), "crisp-edges");
        }
        for (property, value) in [
            ("opacity", "half"),
            ("stroke-width", "calc(1px + 2px)"),
            ("stroke-width", "1rem"),
            ("width", "calc(1px)"),
        ] {
            assert_eq!(of(property, value), None, "{property}");
        }
    }
}
