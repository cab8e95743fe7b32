//! How a stage reports progress without knowing who is watching.

/// Watches a stage at work. Calls may come from several threads.
pub trait Observer: Sync {
    /// A stage begins; `total` steps will be reported through [`Observer::advance`].
    fn begin(&self, stage: &str, total: u64);
    /// Some steps of the current stage are done.
    fn advance(&self, steps: u64);
    /// The current stage is done.
    fn end(&self);
    /// Something the user should know, in a sentence.
    fn note(&self, text: &str);
}

/// Watches nothing.
pub struct Silent;

impl Observer for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
    fn note(&self, _text: &str) {}
}
