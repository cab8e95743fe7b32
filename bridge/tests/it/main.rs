//! The bridge from outside: its parts on simulated pins in virtual time.

mod alone;
mod diary;
mod driver;
mod engine;
mod faults;
mod links;
mod printer_class;
mod store;
