//! Arguments that several subcommands share.

use clap::Args;
use protocol::paper::Paper;

use crate::job::placement::Size;

/// Where and how large.
#[derive(Args, Debug)]
pub struct PageArgs {
    /// Size on paper, such as 120x90mm, 12cm or 5x4in; the document keeps its shape and is centred
    /// [default: the document's own size, else as large as the page allows]
    #[arg(long)]
    pub size: Option<Size>,
    /// Paper: a4, letter, legal, executive, b5 or postcard
    #[arg(long, default_value = "a4", value_parser = paper)]
    pub paper: Paper,
}

fn paper(name: &str) -> Result<Paper, String> {
    Paper::from_name(name).ok_or_else(|| {
        format!("the papers are {}", Paper::named().map(Paper::name).collect::<Vec<_>>().join(", "))
    })
}
