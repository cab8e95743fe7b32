//! From planes and colours to dots: what is hard, what is screened, and which inks lie on which.

pub(crate) mod bitplane;
pub(crate) mod compose;
pub(crate) mod distance;
pub(crate) mod edges;
pub(crate) mod order;
pub(crate) mod pixels;
pub(crate) mod resample;
pub(crate) mod screen;
pub(crate) mod tones;
pub(crate) mod trace;
pub(crate) mod turn;
pub(crate) mod white;
