//! Pass 2 judged.

mod basics;
