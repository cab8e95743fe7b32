//! How a plan is shown: in words, as JSON, or as a page.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::Value;

use super::job::{THUMBNAIL, write};
use super::output::Staged;
use press::job::page;
use press::job::plan::Plan;
use press::preview::inks::{Ground, thumbnail};
use press::sheet::Sheet;

/// How a plan is shown.
#[derive(Args, Debug)]
pub struct Shown {
    /// Also write the plan as a self-contained HTML page to this file
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Background colour of the page's picture: black, white, clear, or a value such as #204080
    #[arg(long, value_name = "COLOUR")]
    background: Option<Ground>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Shown {
    /// Prepares the page before the work, so that a wrong place is reported early.
    pub fn stage(&self) -> Result<Option<Staged>> {
        self.html.as_deref().map(Staged::file).transpose()
    }

    /// Shows a plan and writes its page, if that is wanted. `more` is what else the JSON holds (an object, or null for
    /// nothing), `advice` what else to say to people.
    pub fn show(
        &self,
        staged: Option<Staged>,
        (plan, sheet): (&Plan, &Sheet),
        more: &Value,
        advice: &str,
    ) -> Result<()> {
        if let Some(staged) = staged {
            let picture = thumbnail(sheet, self.background.unwrap_or_default(), THUMBNAIL);
            write(staged.path(), page::html(plan, &picture)?.as_bytes())?;
            staged.commit()?;
        }
        if !self.json {
            return super::stdio::show(&format!("{plan}{advice}"));
        }
        let mut json = serde_json::to_value(plan)?;
        if let Value::Object(more) = more {
            for (name, value) in more {
                json[name] = value.clone();
            }
        }
        super::stdio::show(&format!("{}\n", serde_json::to_string_pretty(&json)?))
    }
}
