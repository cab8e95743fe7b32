//! The faults of a stream in the printer's language, in words: what was found, and what belongs there.

use protocol::rgl::Fault;

/// A fault in words, without its place.
pub(crate) fn words(fault: Fault) -> &'static str {
    match fault {
        Fault::UnknownCommand => "no command of the printer's language begins with these bytes",
        Fault::Truncated => "the stream ends before the job does",
        Fault::ResolutionCode => "this resolution code is not 02 (300), 03 (600) or 04 (1200 x 600 dpi)",
        Fault::ResolutionTail => "the resolution command lacks the 00 at its end",
        Fault::MediaCode => "this media code is unknown, reserved or for dye-sub",
        Fault::PaperCode => "this paper code is unknown or for dye-sub",
        Fault::ModeCode => {
            "this transfer mode is not 00 (black), 04 (colour planes) or 08 (with a cartridge list)"
        }
        Fault::CurlCode => "curl correction is neither 00 (on) nor 01 (off)",
        Fault::CompressionCode => "rows are neither plain (00) nor PackBits (02)",
        Fault::InkCode => "no ink is known to have this code",
        Fault::LastPassFlag => "the last-pass flag is neither 00 nor 80",
        Fault::CartridgeCount => "a cartridge list has one to seven entries",
        Fault::Barcode => "no ink is known to have this barcode",
        Fault::Adjustment => "this adjustment is 0 or out of its range",
        Fault::ZeroShift => "a shift of 0 is not written",
        Fault::Filler => "a byte that must be 00 is not",
        Fault::OutOfOrder => "this command does not belong here",
        Fault::Repeated => "this setup command comes twice",
        Fault::MissingResolution => "the setup has no resolution",
        Fault::MissingMedia => "the setup has no media type",
        Fault::MissingPaper => "the setup has no paper code",
        Fault::MissingLength => "the setup has no page length",
        Fault::MissingWidth => "the setup has no page width",
        Fault::MissingCurl => "the setup does not say whether curl is corrected",
        Fault::MissingMode => "the setup has no transfer mode",
        Fault::MissingCartridges => "transfer mode 08 needs a cartridge list",
        Fault::UnexpectedCartridges => "a cartridge list belongs to transfer mode 08 only",
        Fault::PageSize => {
            "the page has no dots or is larger than the printer takes (4940 x 7760 at 600 dpi)"
        }
        Fault::NoPass => "no pass has begun; an ink-select must come first",
        Fault::InkNotInList => "the pass's ink is not in the cartridge list",
        Fault::MissingBackFeed => "another pass begins without a back-feed",
        Fault::BackFeedAfterLast => "a back-feed follows the last pass",
        Fault::BackFeedWithoutPass => "no pass follows the back-feed",
        Fault::NotLastPass => "the raster data end in a pass that was not announced as the last",
        Fault::PassAfterLast => "another pass follows the one announced as the last",
        Fault::MissingFormFeed => "the sheet is not ejected before the job ends",
        Fault::AfterJob => "bytes follow the job",
        Fault::StatusInJob => "a status question in the middle of a job would be taken as data",
        Fault::NoCompression => "a row comes before the pass has said how rows are packed",
        Fault::CompressionWithoutRow => "no row follows the compression command",
        Fault::ZeroSkip => "a skip of 0 rows is not written",
        Fault::SkipWithoutRow => "no row follows the skip",
        Fault::EmptyRow => "a row of no bytes is not written",
        Fault::TrailingZero => "the row ends in a blank byte, which is not written",
        Fault::BeyondWidth => "the row reaches beyond the page's width",
        Fault::BeyondLength => "the row lies beyond the page's length",
        Fault::RowAfterLast => "something follows the row that was sent as the last of its pass",
        Fault::ReservedHeader => "PackBits header 80 has no agreed meaning",
        Fault::PackedCutOff => "the packed row ends inside a run",
        Fault::NoRoom => "the output buffer is too small",
        Fault::NoPasses => "the job has no passes",
        Fault::TooManyPasses => "the job has more than 32 passes",
        Fault::TooManyCartridges => "the job needs more than seven cartridges, and the printer holds seven",
        Fault::SpotResolution => {
            "only cyan, magenta, yellow and black print at other resolutions than 600 dpi; use 600 dpi or drop the other inks"
        }
        Fault::FoilWithoutConsent => {
            "foil needs your explicit consent: its ink codes are inferred, and it needs cyan, magenta, yellow and black beneath it"
        }
        Fault::TooManyRows => "the image has more rows than the page",
        _ => "a fault this version has no words for",
    }
}
