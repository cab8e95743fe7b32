//! What can be wrong with a stream or with a requested job.
//!
//! What the strict reader refuses: `docs/rgl.md`, section "What is never sent".

/// A fault. Tools and the link report the numbers: append only, never renumber.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
#[non_exhaustive]
pub enum Fault {
    /// No command starts with these bytes.
    UnknownCommand = 1,
    /// The stream ends inside a command or before the job does.
    Truncated = 2,
    /// No such resolution code.
    ResolutionCode = 3,
    /// The `00` after the resolution command is missing.
    ResolutionTail = 4,
    /// A media code that is unknown, reserved or for dye-sub.
    MediaCode = 5,
    /// A paper code that is unknown or for dye-sub.
    PaperCode = 6,
    /// A transfer mode that is unknown or not for our ribbons.
    ModeCode = 7,
    /// The curl byte is neither 00 nor 01.
    CurlCode = 8,
    /// The compression code is neither 00 nor 02.
    CompressionCode = 9,
    /// An unknown ink code, or one whose meaning is uncertain.
    InkCode = 10,
    /// The last-pass flag is neither 00 nor 80.
    LastPassFlag = 11,
    /// A cartridge list with no entry or more than seven.
    CartridgeCount = 12,
    /// A barcode that belongs to no known ink.
    Barcode = 13,
    /// An adjustment of 0 or out of range.
    Adjustment = 14,
    /// A shift of 0.
    ZeroShift = 15,
    /// A filler byte that must be 00 is not.
    Filler = 16,

    /// A command outside its place in the job.
    OutOfOrder = 32,
    /// A setup command is repeated.
    Repeated = 33,
    /// A setup without resolution.
    MissingResolution = 34,
    /// A setup without media type.
    MissingMedia = 35,
    /// A setup without paper code.
    MissingPaper = 36,
    /// A setup without page length.
    MissingLength = 37,
    /// A setup without page width.
    MissingWidth = 38,
    /// A setup without curl correction on or off.
    MissingCurl = 39,
    /// A setup without transfer mode.
    MissingMode = 40,
    /// multiPlane without a cartridge list.
    MissingCartridges = 41,
    /// A cartridge list in a mode that has none.
    UnexpectedCartridges = 42,
    /// A page without dots, or larger than the printer takes.
    PageSize = 43,
    /// The raster data end, or a row comes, before any pass.
    NoPass = 44,
    /// A pass selects an ink that is not in the cartridge list.
    InkNotInList = 45,
    /// Another pass begins without a back-feed.
    MissingBackFeed = 46,
    /// A back-feed after the last pass.
    BackFeedAfterLast = 47,
    /// No pass follows a back-feed.
    BackFeedWithoutPass = 48,
    /// The raster data end in a pass that was not announced as the last.
    NotLastPass = 49,
    /// Another pass after the one announced as the last.
    PassAfterLast = 50,
    /// No form feed at the end.
    MissingFormFeed = 51,
    /// Bytes after the job.
    AfterJob = 52,
    /// A status question in the middle of a job.
    StatusInJob = 53,

    /// A row before the pass has said how rows are packed.
    NoCompression = 64,
    /// No row follows a compression command.
    CompressionWithoutRow = 65,
    /// A skip of 0 rows.
    ZeroSkip = 66,
    /// Two skips, or no row after a skip.
    SkipWithoutRow = 67,
    /// A row without bytes.
    EmptyRow = 68,
    /// A row that ends in a blank byte.
    TrailingZero = 69,
    /// A row beyond the width of the page.
    BeyondWidth = 70,
    /// A row beyond the length of the page.
    BeyondLength = 71,
    /// A row after the one that was sent as the last of the image.
    RowAfterLast = 72,
    /// PackBits header `80`.
    ReservedHeader = 73,
    /// A packed row that ends inside a run.
    PackedCutOff = 74,

    /// The output slice is too small.
    NoRoom = 96,
    /// A job without passes.
    NoPasses = 97,
    /// More passes than [`MAX_PASSES`](super::order::MAX_PASSES).
    TooManyPasses = 98,
    /// More than seven different cartridges.
    TooManyCartridges = 99,
    /// An ink other than cyan, magenta, yellow and black at another resolution than 600 dpi.
    SpotResolution = 100,
    /// A foil without the user's explicit consent.
    FoilWithoutConsent = 101,
    /// The image has more rows than the page has room for.
    TooManyRows = 102,
}

impl Fault {
    /// The stable number.
    pub fn number(self) -> u8 {
        self as u8
    }
}

/// A fault and its place: `at` counts bytes from the start of the slice that was read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// What is wrong.
    pub fault: Fault,
    /// The byte at fault, or the first byte of the command at fault.
    pub at: usize,
}

impl Refusal {
    pub(super) const fn new(fault: Fault, at: usize) -> Refusal {
        Refusal { fault, at }
    }
}
