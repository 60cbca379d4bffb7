//! Progress on stderr: a bar for stages over half a second, or JSON lines.

use super::args::ProgressStyle;
use super::{event, say};
use crate::cluster::Team;
use crate::error::Result;
use crate::export::report::{duration, percent};
use crate::progress::{Crew, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle as BarStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Stages shorter than this are not worth a bar.
const PATIENCE: Duration = Duration::from_millis(500);
/// JSON lines come no more often than this.
const BEAT: Duration = Duration::from_millis(100);

/// Watches a run for the terminal or the add-on.
pub struct Watch {
    cancelled: Arc<AtomicBool>,
    keep: bool,
    style: ProgressStyle,
    visible: bool,
    team: Option<&'static Team>,
    stage: Arc<Mutex<Stage>>,
}

struct Stage {
    name: &'static str,
    total: u64,
    began: Instant,
    told: Instant,
    bar: Option<ProgressBar>,
}

impl Watch {
    /// Watches in a style; quiet shows nothing. To `keep` is to want what is done when the run is stopped. The `team` works at it.
    pub fn new(style: ProgressStyle, quiet: bool, keep: bool, team: Option<&'static Team>) -> Self {
        let visible = !quiet && (style == ProgressStyle::Json || std::io::stderr().is_terminal());
        let stage = Stage { name: "", total: 0, began: Instant::now(), told: Instant::now(), bar: None };
        let watch = Watch { cancelled: Arc::new(AtomicBool::new(false)), keep, style, visible, team, stage: Arc::new(Mutex::new(stage)) };
        if visible && style == ProgressStyle::Bar {
            // Stages that cannot tell how far they are (reading, OpenVDB writing) get their bar too.
            let stage = Arc::clone(&watch.stage);
            let showing = move || {
                loop {
                    std::thread::sleep(BEAT);
                    stage.lock().unwrap_or_else(PoisonError::into_inner).show(0);
                }
            };
            // Where no thread is to be had, they go without.
            let _ = std::thread::Builder::new().spawn(showing);
        }
        watch
    }

    /// Set when the run should stop.
    pub fn cancelled_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.cancelled)
    }

    /// The run is over, and well: its checkpoint goes.
    pub fn over(&self) -> Result<()> {
        self.team.map_or(Ok(()), Team::over)
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        let mut stage = self.lock();
        stage.name = "";
        if let Some(bar) = stage.bar.take() {
            bar.finish_and_clear();
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Stage> {
        self.stage.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, stage: &Stage, done: u64) {
        let share = done.min(stage.total) as f64 / stage.total.max(1) as f64;
        event(&serde_json::json!({"event": "progress", "stage": stage.name, "done": done, "total": stage.total, "fraction": share}));
    }
}

impl Stage {
    /// The bar, once the stage has lasted long enough; it never goes back.
    fn show(&mut self, done: u64) {
        if self.name.is_empty() || self.began.elapsed() < PATIENCE {
            return;
        }
        let (name, total) = (self.name, self.total);
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            let template = BarStyle::with_template("{msg:>8} {bar:32} {percent:>3} % {eta:>4}");
            bar.set_style(template.unwrap_or_else(|_| BarStyle::default_bar()));
            bar.set_message(name);
            bar
        });
        bar.set_position(done.max(bar.position()));
    }
}

impl Progress for Watch {
    fn begin(&self, name: &'static str, total: u64) {
        self.finish();
        let now = Instant::now();
        *self.lock() = Stage { name, total, began: now, told: now, bar: None };
        if self.visible && self.style == ProgressStyle::Json {
            self.tell(&self.lock(), 0);
        }
    }

    fn at(&self, done: u64) {
        if !self.visible {
            return;
        }
        let mut stage = self.lock();
        match self.style {
            ProgressStyle::Json => {
                if stage.told.elapsed() >= BEAT {
                    stage.told = Instant::now();
                    self.tell(&stage, done);
                }
            }
            ProgressStyle::Bar => stage.show(done),
        }
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn keeps(&self) -> bool {
        self.keep
    }

    fn crew(&self) -> Option<&dyn Crew> {
        self.team.map(|team| team as &dyn Crew)
    }

    fn expects(&self, error: f64, seconds: f64) {
        if !self.visible {
            return;
        }
        self.finish();
        match self.style {
            ProgressStyle::Json => event(&serde_json::json!({"event": "forecast", "relative_error": error, "seconds": seconds})),
            ProgressStyle::Bar => say(&format!("forecast  {} in about {} more", percent(error), duration(seconds))),
        }
    }
}
