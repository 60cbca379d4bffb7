//! Pictures as good as they were asked to be: quick ones tell which settings reach an error, or fill a time.
//!
//! The last picture is made anew, by settings that the report names: given as flags they make the same bytes.

use super::series::Series;
use crate::error::Result;
use crate::export::report::{Expected, Render, duration, percent};
use crate::film::Film;
use crate::integrate::{Integrator, RenderSettings};
use crate::progress::Progress;
use crate::scene::{Framed, Scene};

/// What a picture is to reach: the first of the two that holds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Goal {
    /// The relative error of a pixel.
    pub error: Option<f64>,
    /// Seconds from now on.
    pub seconds: Option<f64>,
}

/// A picture, what it says of itself, and what is to be said of the goal.
#[derive(Debug)]
pub struct Taking {
    /// The picture.
    pub film: Film,
    /// Its account.
    pub render: Render,
    /// Sentences.
    pub notes: Vec<String>,
}

/// The first picture.
const FIRST_PHOTONS: u64 = 32_768;
const FIRST_SPP: [u32; 2] = [8, 4];
/// What the second takes of what the last will; and how many times more work than both the last must be for it to be worth it.
const SHARE: f64 = 0.08;
const WORTH: f64 = 4.0;
/// What is aimed at, of an error and of a time: both scatter.
const AIM_ERROR: f64 = 0.93;
const AIM_SECONDS: f64 = 0.95;
/// Pictures at most.
const PICTURES: u32 = 6;

/// Takes pictures until one reaches the goal; that one counts.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn take_to(goal: &Goal, scene: &Scene, framed: &Framed, settings: &RenderSettings, watch: &dyn Progress) -> Result<Taking> {
    let grid = settings.integrator == Integrator::Grid;
    let of = |photons: u64, spp: u32| {
        let mut settings = RenderSettings { spp, ..*settings };
        if grid {
            settings.photon.photons = photons;
        }
        settings
    };
    let mut series = Series::new(scene, framed, watch);
    let mut notes = Vec::new();
    let mut last = of(FIRST_PHOTONS, FIRST_SPP[usize::from(!grid)]);
    let mut whole = series.take(&last, last.photon.photons, None)?;
    let mut expected = None;
    let mut work = 0.0;
    let mut done = false;
    for picture in 2..=PICTURES {
        let (Some(error), Some(forecast)) = (series.error(), series.forecast()) else {
            if whole {
                notes.push("no light reaches the camera, and an error has nothing to be relative to: the picture is by few samples".into());
            }
            break;
        };
        let elapsed = series.elapsed()?;
        if !whole || done || goal.error.is_some_and(|goal| error <= goal) {
            break;
        }
        let left = goal.seconds.map_or(f64::INFINITY, |seconds| seconds - elapsed);
        let reach = goal.error.and_then(|goal| forecast.reach(AIM_ERROR * goal));
        let wanted = match reach {
            Some(wanted) if forecast.seconds(wanted) <= left => wanted,
            None if goal.seconds.is_none() => {
                notes.push("so small an error is beyond what photons and samples can be counted for: ask for a larger one".into());
                break;
            }
            _ => {
                done = true;
                forecast.within(AIM_SECONDS * left)
            }
        };
        let (error_then, seconds) = (forecast.error(wanted), forecast.seconds(wanted));
        if seconds > left || error_then >= error {
            break;
        }
        let quick = (SHARE * wanted.0, SHARE * wanted.1);
        work += forecast.work((last.photon.photons as f64, last.spp.into()));
        if picture == 2 && forecast.work(wanted) > WORTH * (work + forecast.work(quick)) {
            // Not the picture yet: one of a twelfth tells more of it.
            done = false;
            let least = of(FIRST_PHOTONS, FIRST_SPP[usize::from(!grid)]);
            last = of((quick.0 as u64).max(least.photon.photons), ((quick.1 / 4.0).ceil() as u32 * 4).max(least.spp));
            whole = series.take(&last, wanted.0 as u64, None)?;
            continue;
        }
        watch.expects(error_then, seconds);
        expected.get_or_insert(Expected { relative_error: error_then, seconds: elapsed + seconds });
        last = of(wanted.0 as u64, wanted.1 as u32);
        whole = series.take(&last, last.photon.photons, None)?;
    }
    let (film, mut render) = series.end(goal.error)?;
    render.expected = expected;
    let photons = if grid { format!(" --picture-photons {}", last.photon.photons) } else { String::new() };
    let by = if grid { "grid" } else { "path" };
    render.repeat = whole.then(|| format!("--integrator {by}{photons} --spp {} --seed {}", last.spp, last.seed));
    let missed = goal.error.zip(render.relative_error).filter(|(goal, found)| found > goal);
    if let Some((goal, found)) = missed.filter(|_| whole) {
        let level = render.forecast.iter().find(|level| level.relative_error == goal);
        let more = level.map_or(String::new(), |level| format!("; it would take about {}", duration(level.seconds)));
        notes.push(format!("an error of {} was asked for, and {} reached{more}", percent(goal), percent(found)));
    }
    if let Some(seconds) = goal.seconds.filter(|s| render.seconds > 1.1 * s) {
        notes.push(format!("the quickest picture of this size took {:.1} s, and {seconds:.1} s were left for it", render.seconds));
    }
    Ok(Taking { film, render, notes })
}
