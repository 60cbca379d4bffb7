//! Seconds by stage of a picture: the core reads no clock, so whoever watches it does.

use crate::export::report::Stage;
use crate::progress::{Crew, Progress};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Watches for another, and notes when stages begin.
pub(super) struct Timed<'a> {
    watch: &'a dyn Progress,
    begun: Mutex<Vec<(&'static str, Instant)>>,
}

impl<'a> Timed<'a> {
    /// From now on. What comes before the first stage is `preparing`.
    pub fn new(watch: &'a dyn Progress) -> Self {
        Timed { watch, begun: Mutex::new(vec![("preparing", Instant::now())]) }
    }

    /// The stages so far, each name once, in the order of their first beginning.
    pub fn stages(&self) -> Vec<Stage> {
        let (begun, now) = (self.begun.lock().unwrap_or_else(PoisonError::into_inner), Instant::now());
        let mut stages: Vec<Stage> = Vec::new();
        for (i, &(stage, start)) in begun.iter().enumerate() {
            let end = begun.get(i + 1).map_or(now, |next| next.1);
            let seconds = (end - start).as_secs_f64();
            match stages.iter_mut().find(|s| s.stage == stage) {
                Some(known) => known.seconds += seconds,
                None => stages.push(Stage { stage, seconds }),
            }
        }
        stages
    }
}

impl Progress for Timed<'_> {
    fn begin(&self, stage: &'static str, total: u64) {
        self.begun.lock().unwrap_or_else(PoisonError::into_inner).push((stage, Instant::now()));
        self.watch.begin(stage, total);
    }

    fn at(&self, done: u64) {
        self.watch.at(done);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
    }

    fn keeps(&self) -> bool {
        self.watch.keeps()
    }

    fn crew(&self) -> Option<&dyn Crew> {
        self.watch.crew()
    }

    fn expects(&self, error: f64, seconds: f64) {
        self.watch.expects(error, seconds);
    }
}
