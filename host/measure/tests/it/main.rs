//! Photographs, scans and other readings to curves, as the program uses them.

mod can;
mod flat;
mod made;
mod narrow;
mod rendered;
mod renderer;
mod scans;
