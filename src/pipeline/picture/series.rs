//! Pictures of one view, one after another: what each took, and the best so far.

use super::forecast::{Forecast, Shot};
use super::timed::Timed;
use crate::error::{Error, Result};
use crate::export::report::{Render, Stage};
use crate::film::{Film, Pixel};
use crate::integrate::{Integrator, Ready, RenderSettings, Rendering};
use crate::photon::PhotonMap;
use crate::plan::{Density, Plan};
use crate::progress::{Progress, agreed};
use crate::scene::{Framed, Scene};
use std::time::Instant;

/// The stage of samples.
const RENDER: &str = "render";

/// A view, and what has been seen of it.
pub(super) struct Series<'a> {
    scene: &'a Scene,
    framed: &'a Framed,
    /// By what the picture is asked for; quick ones may be by other photons and samples, and smaller.
    settings: RenderSettings,
    /// The effects of what is rendered: regions of the duality overlap where those of the layout may not.
    plan: Plan,
    pub watch: &'a dyn Progress,
    begun: Instant,
    /// What the next picture is taken of, and how long that took by stages.
    ready: Option<(Ready<'a>, u64, Timed<'a>)>,
    /// The last picture, and what its pixels and those of the one before it say.
    last: Option<(RenderSettings, Rendering, Vec<Stage>)>,
    shot: Option<Shot>,
    before: Option<Shot>,
    /// The share of the last picture's pixels that were done, where it was interrupted: the others are the picture's before it.
    cut: Option<f64>,
}

impl<'a> Series<'a> {
    /// Before the first picture.
    pub fn new(scene: &'a Scene, framed: &'a Framed, settings: &RenderSettings, watch: &'a dyn Progress) -> Self {
        let plan = Plan::for_scene(scene, Density::Source);
        Series {
            scene,
            framed,
            settings: *settings,
            plan,
            watch,
            begun: Instant::now(),
            ready: None,
            last: None,
            shot: None,
            before: None,
            cut: None,
        }
    }

    /// Makes ready for pictures with voxels as for so many photons: these are known then, and nothing is lit yet.
    ///
    /// # Errors
    /// As [`crate::integrate::render`].
    pub fn prepare(&mut self, settings: &RenderSettings, voxels_for: u64, pass1: Option<PhotonMap>) -> Result<()> {
        // Room for the next.
        self.ready = None;
        let timed = Timed::new(self.watch);
        let ready = Ready::new(self.scene, &self.plan, &self.framed.camera, settings, voxels_for, pass1, &timed)?;
        self.ready = Some((ready, voxels_for, timed));
        self.before = self.shot;
        Ok(())
    }

    /// Lights what is ready. `false` where the run should stop and keep what it has.
    ///
    /// # Errors
    /// As [`crate::integrate::render`].
    pub fn brighten(&mut self) -> Result<bool> {
        let Some((ready, _, timed)) = &mut self.ready else { return Ok(false) };
        let done = ready.brighten(&*timed);
        self.going_on(done).map(|done| done.is_some())
    }

    /// Takes a picture of what is lit, by so many samples a pixel. `false` where the run should stop and keep what it has.
    ///
    /// # Errors
    /// As [`crate::integrate::render`].
    pub fn expose(&mut self, spp: u32) -> Result<bool> {
        let Some((ready, voxels_for, timed)) = &mut self.ready else { return Ok(false) };
        let before = timed.stages();
        let (taken, voxels_for) = (ready.expose(spp, &*timed), *voxels_for);
        let (settings, stages) = (*ready.settings(), timed.stages());
        let Some(mut rendering) = self.going_on(taken)? else { return Ok(false) };
        let pixels = &mut rendering.film.pixels;
        let done = pixels.iter().filter(|p| **p != Pixel::UNKNOWN).count() as f64 / pixels.len() as f64;
        if done < 1.0 {
            if done == 0.0 && self.last.is_none() {
                return Err(Error::Interrupted);
            }
            if let Some((_, before, _)) = &self.last {
                let known = pixels.iter_mut().zip(&before.film.pixels).filter(|(p, _)| **p == Pixel::UNKNOWN);
                known.for_each(|(pixel, before)| *pixel = *before);
            }
            self.cut = Some(done);
        } else {
            // This picture's samples alone.
            let mut own = stages.clone();
            for stage in own.iter_mut().filter(|s| s.stage == RENDER) {
                stage.seconds -= before.iter().filter(|s| s.stage == RENDER).map(|s| s.seconds).sum::<f64>();
            }
            if let Some(crew) = self.watch.crew() {
                let seconds: Vec<f64> = own.iter().map(|s| s.seconds).collect();
                own.iter_mut().zip(crew.agree(&seconds, self.watch)?).for_each(|(stage, seconds)| stage.seconds = seconds);
            }
            self.shot = Shot::of(&settings, voxels_for, &rendering, &own);
        }
        self.last = Some((settings, rendering, stages));
        Ok(done == 1.0)
    }

    /// What was done, where it was; nothing where the run is stopped and there is a picture to be kept.
    fn going_on<T>(&mut self, done: Result<T>) -> Result<Option<T>> {
        match done {
            Err(Error::Interrupted) if self.watch.keeps() && self.last.is_some() => {
                self.cut = Some(0.0);
                Ok(None)
            }
            done => done.map(Some),
        }
    }

    /// Takes a picture with voxels as for so many photons. `false` where the run should stop and keep what it has.
    ///
    /// # Errors
    /// As [`crate::integrate::render`].
    pub fn take(&mut self, settings: &RenderSettings, voxels_for: u64, pass1: Option<PhotonMap>) -> Result<bool> {
        let ready = self.prepare(settings, voxels_for, pass1);
        Ok(self.going_on(ready)?.is_some() && self.brighten()? && self.expose(settings.spp)?)
    }

    /// Voxels of what is ready.
    pub fn voxels(&self) -> Option<u64> {
        self.ready.as_ref()?.0.lighting().map(|lit| lit.voxels)
    }

    /// Seconds since the first picture began.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn elapsed(&self) -> Result<f64> {
        Ok(agreed([self.begun.elapsed().as_secs_f64()], self.watch)?[0])
    }

    /// The settings of the last picture.
    pub fn settings(&self) -> Option<&RenderSettings> {
        self.last.as_ref().map(|last| &last.0)
    }

    /// The relative error of the last picture, where any pixel of it receives light.
    pub fn error(&self) -> Option<f64> {
        self.last.as_ref().and_then(|(_, rendering, _)| rendering.film.relative_error())
    }

    /// Whether the last picture has the size that was asked for.
    pub fn of_full_size(&self) -> bool {
        self.last.as_ref().is_some_and(|(settings, ..)| settings.width == self.settings.width && settings.height == self.settings.height)
    }

    /// What others would be, by the last picture and the one before it.
    pub fn forecast(&self) -> Option<Forecast> {
        Some(Forecast::new(&self.settings, self.shot?, self.before, !self.scene.air.is_empty()))
    }

    /// The last picture, and what it says of itself, also of an error that was `asked` for.
    ///
    /// # Errors
    /// [`Error::Interrupted`] where there is none.
    pub fn end(self, asked: Option<f64>) -> Result<(Film, Render)> {
        let forecast = self.forecast();
        let seconds = self.elapsed()?;
        let Some((settings, rendering, stages)) = self.last else { return Err(Error::Interrupted) };
        let mut render = Render::of(&settings, &rendering, seconds);
        render.stages = stages;
        render.finished = self.cut;
        // What is cut short is not what was forecast from.
        if let Some(forecast) = forecast.filter(|_| self.cut.is_none() && settings.integrator != Integrator::Photon) {
            render.forecast = forecast.levels(asked);
        }
        Ok((rendering.film, render))
    }
}

/// Samples and photons of the pictures that come first where what is done is to be kept, one after another: so many times fewer. In all
/// they take a fifteenth of the last.
const FEWER: [u32; 3] = [4096, 256, 16];
/// The fewest of them that show anything.
const FEWEST: (u32, u64) = (2, 10_000);

/// Takes the picture of a scene. The photons of pass 1 light it where they are given. Where the watch [`Progress::keeps`] what is done,
/// quick pictures come first.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn take(
    scene: &Scene,
    framed: &Framed,
    settings: &RenderSettings,
    pass1: Option<PhotonMap>,
    watch: &dyn Progress,
) -> Result<(Film, Render)> {
    let mut series = Series::new(scene, framed, settings, watch);
    for fewer in FEWER.into_iter().filter(|_| watch.keeps() && settings.integrator != Integrator::Photon) {
        let mut quick = RenderSettings { spp: (settings.spp / fewer).max(FEWEST.0), ..*settings };
        quick.photon.photons /= u64::from(fewer);
        let shows =
            if settings.integrator == Integrator::Grid { quick.photon.photons >= FEWEST.1 } else { settings.spp / fewer >= FEWEST.0 };
        if shows && !series.take(&quick, quick.photon.photons, None)? {
            return series.end(None);
        }
    }
    series.take(settings, settings.photon.photons, pass1)?;
    series.end(None)
}
