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

/// Quick pictures have about so many pixels, where nothing of them is kept.
const QUICK: f64 = 27_000.0;
/// The first picture.
const FIRST_PHOTONS: u64 = 32_768;
const FIRST_SPP: u32 = 4;
/// Samples of a pixel in the first look at what is lit.
const FEW_SPP: f64 = 8.0;
/// What the second has of the photons of the last, or of its samples; and how many times its work the last must be for it to be worth it.
const SHARE: f64 = 0.05;
const WORTH: f64 = 8.0;
/// What is aimed at, of an error and of a time, before the light is known: both scatter. And once it is known, by samples.
const AIM_ERROR: f64 = 0.93;
const AIM_SECONDS: f64 = 0.92;
const CLOSE: f64 = 0.98;
/// Pictures at most.
const PICTURES: u32 = 6;

/// Takes pictures until one reaches the goal; that one counts.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn take_to(goal: &Goal, scene: &Scene, framed: &Framed, settings: &RenderSettings, watch: &dyn Progress) -> Result<Taking> {
    let grid = settings.integrator == Integrator::Grid;
    let of = |(photons, spp): (f64, f64)| {
        let mut settings = RenderSettings { spp: spp as u32, ..*settings };
        if grid {
            settings.photon.photons = photons as u64;
        }
        settings
    };
    let pixels = f64::from(settings.width) * f64::from(settings.height);
    // What air sends is looked up by the picture's pixels: it tells of no other picture.
    let small = grid && !watch.keeps() && scene.air.is_empty();
    let fewer = if small { (pixels / QUICK).sqrt().floor().max(1.0) as u32 } else { 1 };
    let quickly = |wanted: (f64, f64)| {
        let settings = of(wanted);
        RenderSettings { width: (settings.width / fewer).max(1), height: (settings.height / fewer).max(1), ..settings }
    };
    let mut series = Series::new(scene, framed, settings, watch);
    let mut notes = Vec::new();
    let least = (if grid { FIRST_PHOTONS as f64 } else { settings.photon.photons as f64 }, FIRST_SPP.into());
    let mut whole = series.take(&quickly(least), least.0 as u64, None)?;
    let mut expected = None;
    let mut done = false;
    for picture in 2..=PICTURES {
        let (Some(error), Some(forecast)) = (series.error(), series.forecast()) else {
            if whole {
                notes.push("no light reaches the camera, and an error has nothing to be relative to: the picture is by few samples".into());
            }
            break;
        };
        let elapsed = series.elapsed()?;
        let counts = series.of_full_size();
        if !whole || done || (counts && goal.error.is_some_and(|goal| error <= goal)) {
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
        if counts && (forecast.seconds(wanted) > left || forecast.error(wanted) >= error) {
            break;
        }
        let quick = if grid { ((SHARE * wanted.0).round(), least.1) } else { (wanted.0, (SHARE * wanted.1).round()) };
        let more = if grid { quick.0 > 2.0 * least.0 } else { quick.1 > 2.0 * least.1 };
        if picture == 2 && more && forecast.work(wanted) > WORTH * forecast.work(quick) {
            // Not the picture yet: one of a twentieth tells more of it.
            done = false;
            whole = series.take(&quickly(quick), quick.0 as u64, None)?;
            continue;
        }
        series.prepare(&of(wanted), wanted.0 as u64, None)?;
        let forecast = series.voxels().map_or(forecast, |voxels| forecast.with_voxels(voxels));
        let (error, seconds) = (forecast.error(wanted), forecast.seconds(wanted));
        watch.expects(error, seconds);
        expected.get_or_insert(Expected { relative_error: error, seconds: series.elapsed()? + seconds });
        // By few samples first, where there are photons: these leave so much to the others.
        let spp = match (grid, goal.seconds) {
            (false, _) => wanted.1,
            (true, None) => wanted.1.min(FEW_SPP),
            // What fewer take tells no time.
            (true, Some(_)) => FEW_SPP,
        };
        whole = series.brighten()? && series.expose(spp as u32)?;
        if whole && grid {
            whole = close(&mut series, goal, done)?;
        }
    }
    if whole && !series.of_full_size() {
        whole = series.take(&of(least), least.0 as u64, None)?;
    }
    let last = series.settings().copied().unwrap_or(*settings);
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

/// More samples of what is lit, where these bring the error to what was asked for; and as many as there is time for, where time is `filled`
/// or they do not. `false` where the run should stop and keep what it has.
fn close(series: &mut Series, goal: &Goal, filled: bool) -> Result<bool> {
    let (Some(forecast), Some(&now)) = (series.forecast(), series.settings()) else { return Ok(true) };
    let enough = match goal.error {
        None => f64::INFINITY,
        Some(error) => {
            // More photons may be the cheaper way, and the only one.
            let anew = forecast.reach(AIM_ERROR * error).map_or(f64::INFINITY, |anew| forecast.work(anew));
            let samples = forecast.samples(CLOSE * error).filter(|&spp| forecast.work((0.0, spp)) < anew);
            match samples {
                Some(spp) => spp,
                None if filled => f64::INFINITY,
                None => return Ok(true),
            }
        }
    };
    let fits = match goal.seconds {
        Some(seconds) => forecast.samples_within(CLOSE * (seconds - series.elapsed()?)),
        None => f64::INFINITY,
    };
    let spp = enough.min(fits);
    if spp.is_finite() && spp > now.spp.into() { series.expose(spp as u32) } else { Ok(true) }
}
