//! How a plan is shown: in words, as JSON, or as a page.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use make::made::{Drawn, plan_page};
use serde_json::Value;

use crate::cli::commands::ledger;
use crate::cli::console::show;
use crate::cli::output::{Staged, write};
use press::job::plan::Plan;
use press::pipeline::Draft;
use press::preview::inks::Ground;
use press::separate::Pass;
use sheet::{Area, Sheet};

/// A plan and what is drawn of it.
pub struct DrawnPlan {
    /// The plan.
    pub plan: Plan,
    /// The sheet.
    pub sheet: Sheet,
    /// The passes of the plan.
    pub passes: Vec<Pass>,
    /// The part of the sheet with anything on it.
    pub area: Area,
}

impl From<Draft> for DrawnPlan {
    fn from(draft: Draft) -> DrawnPlan {
        let Draft { sheet, laid, separation, plan } = draft;
        DrawnPlan { plan, sheet, passes: separation.passes, area: laid.area }
    }
}

/// How a plan is shown.
#[derive(Args, Debug)]
pub struct PlanOutputArgs {
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

impl PlanOutputArgs {
    /// Prepares the page before the work, so that a wrong place is reported early.
    pub fn stage(&self) -> Result<Option<Staged>> {
        self.html.as_deref().map(Staged::file).transpose()
    }

    /// Shows a plan and writes its page, if that is wanted. `more` is what else the JSON holds (an object, or null for
    /// nothing), `advice` what else to say to people.
    pub fn show(
        &self,
        staged: Option<Staged>,
        mut drawn: DrawnPlan,
        more: &Value,
        advice: &str,
    ) -> Result<()> {
        drawn.plan.price(&ledger::prices());
        let DrawnPlan { plan, sheet, passes, area } = &drawn;
        if let Some(staged) = staged {
            let drawn = Drawn { sheet, passes, area: *area };
            let html = plan_page(plan, drawn, self.background.unwrap_or_default())?;
            write(staged.path(), html.as_bytes())?;
            staged.commit()?;
        }
        if !self.json {
            return show(&format!("{plan}{advice}"));
        }
        let mut json = serde_json::to_value(plan)?;
        if let Value::Object(more) = more {
            for (name, value) in more {
                json[name] = value.clone();
            }
        }
        show(&format!("{}\n", serde_json::to_string_pretty(&json)?))
    }
}
