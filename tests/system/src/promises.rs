//! What is promised to users, each sentence with a name.

/// A promise, and where it is given.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Promise {
    /// Guide, 6: "The program sends only one whole legal job." What reaches the printer behind a part of a sheet is a reset.
    NothingIntoAnotherSheet,
    /// Guide, 6: "It never sends a job a second time by itself."
    NothingTwice,
    /// Guide, 6: "What it calls *printed* has crossed the printer's own port", and all of it, byte for byte.
    PrintedIsAtThePrinter,
    /// Guide, 6: "If the printer or the bridge loses power in the middle, the sheet is lost, and the program says so."
    LossIsTold,
    /// Guide, 6, and wiring: a pulled data cable, a crash or a restart of the board by its watchdog costs nothing.
    HarmlessCostsNothing,
    /// Guide, 6: "or end the sheet; the printer is ready for the next job".
    EndedSheetIsLegal,
    /// Guide, 6: between jobs, and only there, the printer is asked for its status.
    NoQuestionInASheet,
    /// Guide, 6: a sheet that is said to be out is out.
    OutIsOut,
    /// Guide, 6: a job that stays on disk can be resumed until it has ended.
    EveryJobEnds,
    /// Decision "print alone": what the flash does not hold any more is told as broken.
    StoredIsWholeOrBroken,
}

/// A promise that was not kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Broken {
    /// Which.
    pub promise: Promise,
    /// In which step.
    pub step: u64,
    /// What was found.
    pub found: String,
}
