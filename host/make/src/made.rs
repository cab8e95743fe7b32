//! What was made of a document, of art or of a chart: the job, its plan, and pictures and pages by name.
//!
//! Problem: a print is a folder for one user, an answer over the network for another and a value for a third.
//! Method: the job and its figures are made at once; a picture or a page is drawn when it is asked for, and
//! nothing is written. Names are those of the files in the folder of `foilpress print`, by which the pages
//! show the pictures. Cost: a page of pictures takes about as long as the job. Limits: the passes as data are
//! [`press::separate::files`]' to write.

use appearance::document::Document;
use art::Report;
use observe::Observer;
use press::job::page::{self, Pictures};
use press::job::plan::Plan;
use press::pipeline::{self, Draft, Job, Request};
use press::preview::inks::{Ground, pass_in_ink, pass_thumbnail, sheet_in_inks, thumbnail};
use press::separate::Pass;
use press::simulate::Printout;
use rayon::prelude::*;
use serde_json::{Value, json};
use sheet::{Area, Sheet};

use crate::print::{Print, Seen, Settings};
use crate::{Error, PageSettings};

/// Pixels of the longer side of the sheet on the plan's page.
const THUMBNAIL: usize = 640;
/// The same for a pass.
const PASS_THUMBNAIL: usize = 320;

/// A job that was proved on the simulated printer, and what is known of it.
pub struct Made {
    /// The job with its plan.
    pub job: Job,
    /// What it was made of.
    pub subject: Subject,
    printout: Printout,
    ground: Ground,
}

/// What a job was made of.
pub enum Subject {
    /// Dots alone, as of a chart.
    Dots,
    /// Flat art: what was laid of it.
    Layers(Box<Report>),
    /// A document, and what was seen of its print.
    Document(Box<Seen>),
}

impl Print {
    /// The job of a document, proved on the simulated printer, with its plan.
    ///
    /// # Errors
    /// Those of the stages, and rules that forbid the job.
    pub fn of(document: Document, settings: &Settings, observer: &dyn Observer) -> Result<Made, Error> {
        Print::new(document, settings, observer)?.made(observer)
    }

    /// The job, proved on the simulated printer.
    ///
    /// # Errors
    /// Those of the stages, and rules that forbid the job.
    pub fn made(self, observer: &dyn Observer) -> Result<Made, Error> {
        let prove = |print: &Print| Made::proved(&print.request(), &print.settings.page, observer);
        let (mut made, seen) = self.seen(prove, observer)?;
        seen.complete(&mut made.job.draft.plan);
        Ok(made.of(Subject::Document(Box::new(seen))))
    }
}

impl Made {
    /// The job of dots on a page.
    ///
    /// # Errors
    /// A layout without room, and rules that forbid the job.
    pub fn proved(
        request: &Request<'_>,
        page: &PageSettings,
        observer: &dyn Observer,
    ) -> Result<Made, Error> {
        let mut job = pipeline::job(request, observer)?;
        job.draft.plan.price(&page.prices);
        let printout = job.prove(observer)?;
        Ok(Made { job, subject: Subject::Dots, printout, ground: page.ground })
    }

    /// The same with what it was made of.
    pub(crate) fn of(self, subject: Subject) -> Made {
        Made { subject, ..self }
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.job.draft.plan
    }

    /// What the readers had to assume, and what else a user should know.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.plan().notes
    }

    /// The average difference d of a document and its print for an eye at [`EYE`](press::preview::EYE)
    /// metres: 0.01 is barely visible, 0.05 obvious.
    #[must_use]
    pub fn distance(&self) -> Option<f64> {
        match &self.subject {
            Subject::Document(seen) => Some(seen.fidelity.mean),
            Subject::Dots | Subject::Layers(_) => None,
        }
    }

    /// The names of all pictures, those that take longest first.
    #[must_use]
    pub fn pictures(&self) -> Vec<String> {
        let mut names = vec!["preview.png".to_owned(), "separation.png".into()];
        if let Subject::Document(_) = self.subject {
            names.extend(["sheet.png".into(), "materials.png".into()]);
        }
        let passes = self.printout.passes.iter().enumerate();
        names.extend(passes.map(|(i, pass)| name(i, pass)));
        names
    }

    /// The names of all pages.
    #[must_use]
    pub fn pages(&self) -> Vec<&'static str> {
        match self.subject {
            Subject::Document(_) => vec!["sheet.html", "plan.html", "report.html"],
            Subject::Dots | Subject::Layers(_) => vec!["plan.html"],
        }
    }

    /// A picture as PNG: `preview.png` (all inks, dot for dot, as the simulated printer printed them),
    /// `separation.png` (stacks in false colours), `preview-01-cyan.png` (a pass, dot for dot); of a document
    /// also `sheet.png` (it and its print under four lights) and
    /// `materials.png` (balls of its materials before and after mapping).
    ///
    /// # Errors
    /// A name that is none of [`pictures`](Self::pictures).
    pub fn picture(&self, name: &str, observer: &dyn Observer) -> Result<Vec<u8>, Error> {
        let Draft { sheet, laid, plan, .. } = &self.job.draft;
        let across = across(plan);
        match (name, &self.subject) {
            // The page is the simulated sheet, dot for dot.
            ("preview.png", _) => Ok(sheet_in_inks(sheet, laid.area, across, self.ground)?),
            ("separation.png", _) => Ok(sheet.in_colours(laid.area, plan.resolution_dpi)?),
            ("sheet.png", Subject::Document(seen)) => Ok(seen.sheet(plan, observer)?.png()?),
            ("materials.png", Subject::Document(seen)) => Ok(seen.materials(observer)?.png()?),
            _ => {
                let mut passes = self.printout.passes.iter().enumerate();
                let found = passes.find(|(i, pass)| self::name(*i, pass) == name);
                let (_, pass) =
                    found.ok_or_else(|| Error::Name { name: name.into(), known: self.pictures() })?;
                Ok(pass_in_ink(pass, laid.area, across, self.ground)?)
            }
        }
    }

    /// A page as HTML: `plan.html` (the plan to print and keep beside the printer); of a document also
    /// `report.html` (all figures beside the pictures, which it shows by their names) and `sheet.html` (the
    /// sheet under light that follows the hand).
    ///
    /// # Errors
    /// A name that is none of [`pages`](Self::pages).
    pub fn page(&self, name: &str, observer: &dyn Observer) -> Result<String, Error> {
        match (name, &self.subject) {
            ("plan.html", _) => plan_page(self.plan(), (&self.job.draft).into(), self.ground),
            ("report.html", Subject::Document(seen)) => seen.report_page(self.plan()),
            ("sheet.html", Subject::Document(seen)) => seen.light(observer),
            _ => {
                let known = self.pages().into_iter().map(str::to_owned).collect();
                Err(Error::Name { name: name.into(), known })
            }
        }
    }

    /// All figures, as `report.json` has them.
    #[must_use]
    pub fn report(&self) -> Value {
        let mut report = json!({
            "program": concat!("foilpress ", env!("CARGO_PKG_VERSION")),
            "document": { "name": self.plan().document },
            "plan": self.plan(),
            "modelled": self.plan().modelled(),
            "job": { "bytes": self.job.bytes.len() },
        });
        let more = match &self.subject {
            Subject::Dots => Value::Null,
            Subject::Layers(laid) => json!({ "art": { "composed": laid } }),
            Subject::Document(seen) => seen.figures(),
        };
        if let Value::Object(more) = more {
            more.into_iter().for_each(|(name, value)| report[name] = value);
        }
        report
    }
}

/// The name of the picture of a pass as it was printed.
fn name(index: usize, pass: &Pass) -> String {
    format!("preview-{}", press::separate::files::name(index, pass.ink))
}

/// Dots across in 1/600 inch.
fn across(plan: &Plan) -> usize {
    usize::from(plan.resolution_dpi.0 / 600).max(1)
}

/// What the page of a plan shows.
#[derive(Clone, Copy)]
pub struct Drawn<'a> {
    /// The sheet.
    pub sheet: &'a Sheet,
    /// The passes of the plan.
    pub passes: &'a [Pass],
    /// The part of the sheet with anything on it.
    pub area: Area,
}

impl<'a> From<&'a Draft> for Drawn<'a> {
    fn from(Draft { sheet, laid, separation, .. }: &'a Draft) -> Drawn<'a> {
        Drawn { sheet, passes: &separation.passes, area: laid.area }
    }
}

/// A plan as a page with its pictures on this ground.
///
/// # Errors
/// A picture that cannot be compressed; none is known.
pub fn plan_page(plan: &Plan, drawn: Drawn<'_>, ground: Ground) -> Result<String, Error> {
    let across = across(plan);
    let passes = drawn.passes.par_iter();
    let pictures = Pictures {
        sheet: thumbnail(drawn.sheet, drawn.sheet.whole(), across, ground, THUMBNAIL),
        passes: passes.map(|pass| pass_thumbnail(pass, drawn.area, across, ground, PASS_THUMBNAIL)).collect(),
    };
    Ok(page::html(plan, &pictures)?)
}
