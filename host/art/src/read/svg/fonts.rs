//! Fonts for the text of drawings.
//!
//! Problem: the renderer draws text in a family that is not installed, and in `sans-serif`, in one family with serifs. Drawing programs show
//! such text in another.
//! Method: fontconfig, which drawing programs ask, names the installed family that stands for others (`fc-match`). Families that are not
//! installed are reported with what stands for them, and so are characters that no font has. Without fontconfig the renderer's default stands for all.
//! Cost: a program started for each list of families that does not begin with an installed one. Limits: [`MOST`] such lists.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use resvg::usvg::{Font, FontFamily, FontResolver, fontdb};

use crate::error::wrong;
use crate::read::process::{self, Process};
use observe::Diagnosis;

/// The most lists of families that fontconfig is asked for: no drawing of a person has more.
const MOST: usize = 64;

/// What text without a family is drawn in.
pub(super) const DEFAULT: &str = "serif";

/// This computer's fonts.
pub(super) struct Fonts {
    database: Arc<fontdb::Database>,
    stand_ins: Arc<Mutex<BTreeMap<String, StandIn>>>,
    /// The characters that no font has.
    without_glyph: Arc<Mutex<BTreeSet<char>>>,
}

/// What is drawn instead of a list of families.
struct StandIn {
    /// The first of them, if it is the name of a font.
    named: Option<String>,
    family: String,
    /// The fonts with this family in the place of the others.
    database: Arc<fontdb::Database>,
}

impl Fonts {
    /// No font at all.
    pub fn none() -> Fonts {
        Fonts { database: Arc::default(), stand_ins: Arc::default(), without_glyph: Arc::default() }
    }

    /// Loads the fonts. The renderer draws text of a missing family in the default family and leaves it out if that is missing
    /// too, so one is chosen here.
    pub fn load(path: &Path) -> Result<Fonts, Diagnosis> {
        let mut fonts = fontdb::Database::new();
        fonts.load_system_fonts();
        let default = fontdb::Query { families: &[fontdb::Family::Serif], ..fontdb::Query::default() };
        if fonts.query(&default).is_none() {
            // A regular upright face replaces any other best; the least name makes the choice the same every time.
            let plain = |face: &fontdb::FaceInfo| {
                face.style == fontdb::Style::Normal
                    && face.weight == fontdb::Weight::NORMAL
                    && !face.monospaced
            };
            let named = |face: &fontdb::FaceInfo| Some((!plain(face), face.families.first()?.0.clone()));
            let Some((_, family)) = fonts.faces().filter_map(named).min() else {
                let problem = "it has text, but this computer has no fonts";
                return Err(wrong(path, problem).hint("convert the text to paths"));
            };
            fonts.set_serif_family(family);
        }
        Ok(Fonts { database: Arc::new(fonts), ..Fonts::none() })
    }

    pub fn is_empty(&self) -> bool {
        self.database.is_empty()
    }

    pub fn database(&self) -> Arc<fontdb::Database> {
        self.database.clone()
    }

    /// Chooses the font of each text, and takes down which families are not installed.
    pub fn resolver(&self) -> FontResolver<'static> {
        let usual = FontResolver::default_font_selector();
        let stand_ins = self.stand_ins.clone();
        FontResolver {
            select_font: Box::new(move |font, fonts| match of(font, fonts, &stand_ins) {
                // Faces have the same numbers there.
                Some(mut others) => usual(font, &mut others),
                None => usual(font, fonts),
            }),
            select_fallback: Box::new({
                let usual = FontResolver::default_fallback_selector();
                let lost = self.without_glyph.clone();
                move |character, tried, fonts| {
                    let found = usual(character, tried, fonts);
                    let mut lost = lost.lock().unwrap_or_else(PoisonError::into_inner);
                    if found.is_none() && lost.len() < MOST {
                        lost.insert(character);
                    }
                    found
                }
            }),
        }
    }

    /// The characters that no font has, in words.
    pub fn characters(&self) -> Option<String> {
        let lost = self.without_glyph.lock().unwrap_or_else(PoisonError::into_inner);
        let shown =
            |c: &char| if c.is_control() { format!("U+{:04X}", u32::from(*c)) } else { format!("`{c}`") };
        let words: Vec<String> = lost.iter().map(shown).collect();
        (!words.is_empty()).then(|| words.join(", "))
    }

    /// The families that are not installed, each with what is drawn instead, in words.
    pub fn missing(&self) -> Option<String> {
        let stand_ins = self.stand_ins.lock().unwrap_or_else(PoisonError::into_inner);
        let words = stand_ins.values().filter_map(|StandIn { named, family, .. }| {
            named.as_ref().map(|named| format!("{named} (drawn in {family})"))
        });
        let words: Vec<String> = words.collect();
        (!words.is_empty()).then(|| words.join(", "))
    }
}

/// The fonts in which another family stands for those of a text; `None` if the first of them is installed, or nothing is known to stand
/// for it.
fn of(
    font: &Font,
    fonts: &Arc<fontdb::Database>,
    stand_ins: &Mutex<BTreeMap<String, StandIn>>,
) -> Option<Arc<fontdb::Database>> {
    let first = font.families().first()?;
    let has = |name: &str| {
        let families = &[fontdb::Family::Name(name)];
        fonts.query(&fontdb::Query { families, ..fontdb::Query::default() }).is_some()
    };
    let named = match first {
        FontFamily::Named(name) if has(name) => return None,
        FontFamily::Named(name) => Some(name.clone()).filter(|name| !is_generic(name)),
        _ => None,
    };
    if fonts.is_empty() {
        return None;
    }
    let list = font.families().iter().map(pattern).collect::<Vec<String>>().join(",");
    let mut stand_ins = stand_ins.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = stand_ins.get(&list) {
        return Some(known.database.clone());
    }
    let asked = if stand_ins.len() < MOST { fontconfig(&list) } else { None };
    let mut database = fontdb::Database::clone(fonts);
    let family = match asked.filter(|family| has(family)) {
        Some(family) => {
            database.set_serif_family(&*family);
            database.set_sans_serif_family(&*family);
            database.set_monospace_family(&*family);
            database.set_cursive_family(&*family);
            database.set_fantasy_family(&*family);
            family
        }
        None => database.family_name(&fontdb::Family::Serif).to_owned(),
    };
    let database = Arc::new(database);
    stand_ins.insert(list, StandIn { named, family, database: database.clone() });
    Some(database)
}

/// Whether a name stands for any font of a kind, as drawing programs and browsers write it beside those of CSS: nobody can install that.
fn is_generic(name: &str) -> bool {
    const GENERIC: [&str; 8] = [
        DEFAULT,
        "sans",
        "sans serif",
        "mono",
        "monospace",
        "system-ui",
        "-apple-system",
        "blinkmacsystemfont",
    ];
    GENERIC.iter().any(|generic| name.eq_ignore_ascii_case(generic)) || name.starts_with("ui-")
}

/// A family as fontconfig reads it.
fn pattern(family: &FontFamily) -> String {
    let generic = match family {
        FontFamily::Serif => "serif",
        FontFamily::SansSerif => "sans-serif",
        FontFamily::Cursive => "cursive",
        FontFamily::Fantasy => "fantasy",
        FontFamily::Monospace => "monospace",
        FontFamily::Named(name) => name,
    };
    // These end a name in a pattern.
    let escaped = generic.chars().filter(|c| *c != '\0').flat_map(|c| {
        let escape = matches!(c, '\\' | '-' | ':' | ',').then_some('\\');
        escape.into_iter().chain([c])
    });
    escaped.collect()
}

/// The family that fontconfig draws a list of families in.
fn fontconfig(list: &str) -> Option<String> {
    let mut command = Command::new("fc-match");
    command.args(["--format=%{family[0]}", "--", list]).stdout(Stdio::piped());
    let mut matching = Process::start(&mut command, process::limit()).ok()?;
    let mut family = String::new();
    matching.output()?.take(1 << 10).read_to_string(&mut family).ok()?;
    matching.end(|| false).ok()?;
    Some(family)
}
