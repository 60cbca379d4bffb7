//! Light transport, from outside the crate: against truths that nobody here wrote, and against what the plan promises.
//!
//! `cargo test --release --test light -- --nocapture` prints every figure with its error.
#![allow(clippy::unwrap_used, clippy::panic)]

mod coverage;
mod fire;
mod oracles;
mod plan;
