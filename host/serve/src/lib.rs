//! A printer for every device of the house: IPP Everywhere 1.1 over HTTP, and a page for people.
//!
//! ```text
//! phone, Windows, CUPS ─▶ [http] ─▶ [wire] ─▶ [operations] ─▶ [jobs] on disk ─▶ [worker] ─▶ the queue's filter ─▶ its backend ─▶ printer
//! browser ─────────────▶ [http] ─▶ [desk] ───────┘
//! ```
//! Each preset is a printer of its own, for dialogs show no vendor's options ([`template`]). What is drawn and how it is sent is what
//! print queues do: this crate adds the protocol, jobs that outlive it, who may do what ([`access`]) and how
//! much of it ([`budget`]), and how dialogs find it ([`advert`]).
//! Source: PWG 5100.14 (IPP Everywhere), RFC 8010 and 8011 (IPP), RFC 9110 and 9112 (HTTP).
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(clippy::cast_possible_truncation, clippy::cast_sign_loss))]

pub mod access;
pub mod advert;
pub mod body;
pub mod budget;
pub mod charts;
pub mod desk;
pub mod http;
pub mod install;
pub mod jobs;
pub mod making;
pub mod operations;
pub mod printer;
pub mod seen;
pub mod server;
pub mod spool;
pub mod template;
pub mod tls;
pub mod values;
pub mod wire;
pub mod worker;

/// Fills bytes with what nobody can guess.
///
/// # Errors
/// The system has none.
pub fn random(bytes: &mut [u8]) -> std::io::Result<()> {
    getrandom::fill(bytes).map_err(|error| std::io::Error::other(error.to_string()))
}
