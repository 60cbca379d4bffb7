//! Hard cases: numbers at the ends of their ranges, scenes that nobody would build, bytes that nobody checked.
//!
//! `cargo test --release --test stability -- --nocapture` prints a line a case; the README's tables are made of these lines.
//! What takes longer: `cargo test --release --test stability -- --ignored --nocapture`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod cases;
mod hostile;
mod numbers;
mod photons;
mod pictures;
#[path = "../support/mod.rs"]
mod support;
mod twin;
