//! Flat art to its print: what the command line, print queues and the print server do alike.
//!
//! Method: [`Layers::open`] reads the art for the room that its page has, [`Layers::compose`] makes its dots,
//! and job, plan and pictures are made of these. Cost and limits: those of [`art`].

use std::path::PathBuf;

use art::{Accept, Artwork, Composed, Finish, Remedy, Room, White};
use inks::{InkSet, Library};
use observe::{Diagnosis, Observer};
use press::job::Handling;
use press::job::plan::Suggestion;
use press::layout::{self, Layout};
use press::pipeline::{self, Draft, Job, JobError, Request};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;

use crate::made::{Made, Subject};
use crate::options::{Choices, Spots};
use crate::{Error, PageSettings};

/// How flat art is printed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How it is read. The room that its page has is known to [`page`](Self::page).
    pub read: art::Options,
    /// How its layers become stacks.
    pub compose: art::Settings,
    /// The ink library.
    pub library: Library,
    /// How it lies on the paper.
    pub page: PageSettings,
    /// How to ask for what would improve the print, in the words of whoever shows the plan; of the inks that
    /// may be used.
    pub how: fn(&Remedy, &InkSet) -> String,
}

impl Default for Settings {
    /// As drawn, in all inks but the foils, in the middle of A4.
    fn default() -> Settings {
        Settings {
            read: art::Options::default(),
            compose: art::Settings::default(),
            library: Library::builtin(),
            page: PageSettings::default(),
            how: |_, _| String::new(),
        }
    }
}

impl Settings {
    /// How art of a page is printed by these choices, on this sheet.
    #[must_use]
    pub fn of(choices: &Choices, paper: Paper, library: &Library) -> Settings {
        let mut reserved = InkSet::EMPTY;
        if choices.spots == Spots::Reserved {
            reserved = art::Options::default().inks;
        } else if choices.white == White::Reserved {
            reserved = reserved.with(Ink::White);
        }
        let inks = Ink::ALL.into_iter().filter(|ink| match ink.kind() {
            Kind::Process => choices.colours.contains(*ink),
            Kind::Foil => choices.foils && choices.more.inks.contains(*ink),
            _ => choices.more.inks.contains(*ink),
        });
        Settings {
            read: art::Options {
                dpi: Some(choices.dpi.into()),
                reserved: !reserved.is_empty(),
                inks: reserved,
                colours: choices.inks_of.clone(),
                tolerance: choices.tolerance,
                ..art::Options::default()
            },
            compose: art::Settings {
                inks: InkSet::of(inks),
                // What the page itself draws in white or finish is printed whatever is chosen.
                // Its reserved white is a layer of it, which `read` finds.
                white: Some(choices.white).filter(|white| !matches!(white, White::None | White::Reserved)),
                finish: Some(choices.finish).filter(|&finish| finish != Finish::None),
                intent: choices.intent,
                gamma: choices.gamma,
                halftone: choices.halftone,
                ..choices.more.clone()
            },
            library: library.clone(),
            page: PageSettings {
                layout: Layout {
                    mirror: choices.mirror,
                    cut: true,
                    profile: choices.profile,
                    ..Layout::centred(paper)
                },
                handling: Handling { media: choices.media, curl_correction: choices.curl_correction },
                ..PageSettings::default()
            },
            ..Settings::default()
        }
    }
}

impl Settings {
    /// How the art is read for what its print needs: on film, white lies beneath colours, whose program
    /// left it out there as on white paper; beneath metals it stays where they knock nothing out.
    #[must_use]
    pub fn reading(&self) -> art::Options {
        let Settings { read, compose, page, .. } = self;
        let metals = Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Metallic);
        art::Options {
            keep_white: compose.accept.contains(&Accept::WhiteKept) || page.handling.is_film(),
            over_white: InkSet::of(metals.filter(|&metal| !compose.knockout.contains(metal))),
            ..read.clone()
        }
    }
}

/// Art as dots, and everything that decides its print.
pub struct Layers<'a> {
    name: &'a str,
    settings: &'a Settings,
    /// The dots, what was laid, and what would improve it.
    pub composed: Composed,
}

impl<'a> Layers<'a> {
    /// The job of art in files, proved on the simulated printer, with its plan.
    ///
    /// # Errors
    /// Those of [`art`], a layout without room, and rules that forbid the job.
    pub fn of(files: &[PathBuf], settings: &Settings, observer: &dyn Observer) -> Result<Made, Error> {
        let art = Layers::open(files, settings, observer)?;
        Layers::compose(&art, settings, observer)?.made(observer)
    }

    /// Reads art for its page.
    ///
    /// # Errors
    /// Those of [`art::open`], and a page on which it has no room.
    pub fn open(files: &[PathBuf], settings: &Settings, observer: &dyn Observer) -> Result<Artwork, Error> {
        let layout = &settings.page.layout;
        let (width, length) = layout.largest();
        let across = layout.resolution.across(1);
        let room = Room { width, length, cut: layout.cut };
        let art =
            art::open(files, &art::Options { across: across.into(), room, ..settings.reading() }, observer)?;
        // Before the long work.
        layout::check(art.width / usize::from(across), art.length, layout).map_err(JobError::from)?;
        Ok(art)
    }

    /// The dots of art.
    ///
    /// # Errors
    /// Those of [`art::compose`](art::compose()).
    pub fn compose(
        art: &'a Artwork,
        settings: &'a Settings,
        observer: &dyn Observer,
    ) -> Result<Layers<'a>, Diagnosis> {
        let composed = art::compose(art, &settings.compose, &settings.library, observer)?;
        Ok(Layers { name: &art.name, settings, composed })
    }

    /// The page, its passes and its plan. What must not be printed is planned, too.
    ///
    /// # Errors
    /// A layout without room.
    pub fn draft(&self, observer: &dyn Observer) -> Result<Draft, Error> {
        let mut draft = pipeline::draft(&self.request(), observer)?;
        draft.plan.notes.clone_from(&self.composed.report.notes);
        draft.plan.suggestions = self.suggestions();
        Ok(draft)
    }

    /// The job, not proved: for whoever sends it at once.
    ///
    /// # Errors
    /// A layout without room, and rules that forbid the job.
    pub fn job(&self, observer: &dyn Observer) -> Result<Job, JobError> {
        pipeline::job(&self.request(), observer)
    }

    /// The job, proved on the simulated printer.
    ///
    /// # Errors
    /// A layout without room, and rules that forbid the job.
    pub fn made(self, observer: &dyn Observer) -> Result<Made, Error> {
        let mut made = Made::proved(&self.request(), &self.settings.page, observer)?;
        made.job.draft.plan.suggestions = self.suggestions();
        made.job.draft.plan.notes.clone_from(&self.composed.report.notes);
        Ok(made.of(Subject::Layers(Box::new(self.composed.report))))
    }

    fn request(&self) -> Request<'_> {
        let Settings { compose, library, page, .. } = self.settings;
        page.request(self.name, &self.composed.dots, compose.inks, library)
    }

    fn suggestions(&self) -> Vec<Suggestion> {
        let of = |art::Suggestion { text, remedy, dots }: &art::Suggestion| Suggestion {
            text: text.clone(),
            how: (self.settings.how)(remedy, &self.settings.compose.inks),
            dots: *dots,
        };
        self.composed.suggestions.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use art::Options;
    use files::shelf::Memory;
    use observe::Silent;
    use protocol::rgl::Media;
    use readers::Pixels;

    #[test]
    fn on_film_white_lies_beneath_colours_and_beneath_metal_that_knocks_nothing_out() {
        let reading = |media, curl_correction, knockout| {
            let mut settings = Settings::default();
            settings.page.handling = Handling { media, curl_correction };
            settings.compose.knockout = knockout;
            let Options { keep_white, over_white, .. } = settings.reading();
            (keep_white, over_white.contains(Ink::MetallicGold))
        };
        let usual = art::Settings::default().knockout;
        assert_eq!(reading(Media::Plain, true, usual), (false, false));
        assert_eq!(reading(Media::Plain, false, usual), (true, false));
        assert_eq!(reading(Media::Transparency, true, usual), (true, false));
        assert_eq!(reading(Media::Cardboard, false, usual), (false, false));
        assert_eq!(reading(Media::Plain, true, InkSet::EMPTY), (false, true));
    }

    #[test]
    fn art_in_memory_becomes_a_job_with_a_pass_of_its_ink_and_what_is_missing_is_named() {
        let mut memory = Memory::default();
        let square = Pixels::from_fn(60, 40, |x, _| [if x < 30 { 0u8 } else { 255 }; 3]);
        memory.insert("gold.png", square.png().unwrap()).unwrap();
        let mut settings = Settings::default();
        settings.read =
            Options { size: Some("6mm".parse().unwrap()), shelf: Arc::new(memory), ..settings.read };
        let made = Layers::of(&["gold.png".into()], &settings, &Silent).unwrap();
        let [pass] = &made.plan().passes[..] else { panic!("{:?}", made.plan().passes) };
        // Half of 6 x 4 mm at 600 dpi, to a row of dots.
        let inch = 600.0 / 25.4;
        let half = 0.5 * (6.0 * inch) * (4.0 * inch);
        assert_eq!(pass.ink, Ink::MetallicGold.name());
        assert!((pass.dots as f64 / half - 1.0).abs() < 0.015, "{} dots, not {half}", pass.dots);
        assert!(made.picture("preview.png", &Silent).unwrap().starts_with(b"\x89PNG"));
        let missing = Layers::of(&["white.png".into()], &settings, &Silent).err().expect("it is missing");
        assert!(missing.to_string().contains("white.png"), "{missing}");
    }
}
