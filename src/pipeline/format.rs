//! What is written, by the targets' extensions; and whether the job makes sense at all.

use super::Job;
use super::picture::gridless;
use crate::bake::Bake;
use crate::error::{Error, Result};
use crate::export::staged::Staged;
use crate::export::vdb::GridName;
use crate::import::{self, Layout};
use crate::integrate::Integrator;
use crate::integrate::photon::Gathering;
use crate::photon::Model;
use crate::plan::Density;
use crate::scene::{Region, Scene, Shape};
use crate::voxelise::Up;
use std::path::{Path, PathBuf};

/// What a file is, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// OpenVDB grids.
    Vdb,
    /// The report.
    Json,
    /// Regions as glTF.
    Glb,
    /// A picture, in layers, linear.
    Exr,
    /// A picture to look at.
    Png,
    /// A script that sets a scene up in Blender.
    Blend,
}

impl Format {
    /// The format of a target.
    ///
    /// # Errors
    /// [`Error::Usage`] that lists what can be written.
    pub fn of(path: &Path) -> Result<Format> {
        if path.file_name().is_some_and(|name| name.to_string_lossy().to_lowercase().ends_with(".blend.py")) {
            return Ok(Format::Blend);
        }
        match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
            Some("vdb") => Ok(Format::Vdb),
            Some("json") => Ok(Format::Json),
            Some("glb") => Ok(Format::Glb),
            Some("exr") => Ok(Format::Exr),
            Some("png") => Ok(Format::Png),
            _ => Err(Error::Usage(format!(
                "-o {}: the extension says what is written, and must be .vdb (grids), .blend.py (a script that sets them up in Blender), .exr or .png (a picture), .json (the report) or .glb (the regions as spheres)",
                path.display()
            ))),
        }
    }
}

/// The targets of a run with their formats.
pub(super) struct Targets<'a>(Vec<(&'a PathBuf, Format)>);

impl<'a> Targets<'a> {
    /// Looks at what is to be read and, by a process that `writes`, written, before any work is done.
    ///
    /// # Errors
    /// [`Error::Usage`] where a target is the input, or what it asks for is not there; [`Error::Write`] as [`Staged::check`].
    pub fn of(job: &'a Job, writes: bool) -> Result<Self> {
        let formats = job.outputs.iter().map(|o| Format::of(o).map(|format| (o, format))).collect::<Result<Vec<_>>>()?;
        let targets = Targets(formats);
        if import::is_vdb(&job.input) {
            // Before it is read: it may be large.
            targets.check_grids(&job.input.display().to_string())?;
        }
        if writes {
            Staged::check(&job.outputs, job.overwrite)?;
        }
        if let Some(target) = overwritten(&job.outputs, &job.input) {
            return Err(Error::Usage(format!("-o {} is the layout itself: name another file", target.display())));
        }
        Ok(targets)
    }

    /// Looks at what was read: its regions say what can be asked of it, and the files that it names stay.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self, job: &Job, layout: &Layout) -> Result<()> {
        if let Some(target) = layout.volumes.iter().find_map(|volume| overwritten(&job.outputs, volume)) {
            return Err(Error::Usage(format!("-o {} is a VDB that the layout names: name another file", target.display())));
        }
        if let Some(name) = layout.scene.voxel_grid() {
            self.check_grids(&format!("{}: region {name:?}", job.input.display()))?;
        }
        self.check_light(job, layout)?;
        let picture = self.any(Format::Exr) || self.any(Format::Png);
        if !picture && (job.picture.error.is_some() || job.picture.seconds.is_some()) {
            let idle = "--error and --time say how good a picture is to be, and none is written: add -o cloud.exr, or leave them out";
            return Err(Error::Usage(idle.into()));
        }
        match job.picture.integrator.filter(|_| picture) {
            Some(Integrator::Photon) => check_photons(job, &layout.scene),
            Some(Integrator::Grid) => match gridless(layout.scene.regions.iter().filter(|r| stays(r, job.density)), job.duality.model) {
                Some(reason) => Err(Error::Usage(format!("{}: {reason}: use --integrator path", job.input.display()))),
                None => Ok(()),
            },
            Some(Integrator::Path) | None => Ok(()),
        }
    }

    /// Refuses a bake or a script that would have nothing to be of.
    fn check_light(&self, job: &Job, layout: &Layout) -> Result<()> {
        let usage = |text: String| Err(Error::Usage(text));
        if let Some(script) = self.each(Format::Blend).next() {
            let who = script.display();
            if self.each(Format::Vdb).count() != 1 {
                return usage(format!("-o {who}: the script sets a .vdb up in Blender: name one beside it, -o cloud.vdb"));
            }
            if job.vdb.up != Up::Z {
                return usage(format!("-o {who}: Blender's z is up: leave out --up y"));
            }
            if !job.vdb.grids.contains(&GridName::Density) {
                return usage(format!("-o {who}: the cloud is the grid \"density\": add it to --grids"));
            }
        }
        let Some(bake) = job.bake.light else {
            let idle = "--no-check leaves the check of baked light out, and none is baked: add --bake, or leave it out too";
            return if job.bake.checked { Ok(()) } else { usage(idle.into()) };
        };
        if !self.any(Format::Vdb) {
            return usage("--bake puts light beside the density of a VDB: add -o cloud.vdb".into());
        }
        if !job.vdb.grids.contains(&GridName::Density) {
            return usage("--bake puts light beside the grid \"density\": add it to --grids".into());
        }
        if matches!(bake, Bake::Sh1 | Bake::Sh2) && job.vdb.up != Up::Z {
            return usage(
                "--bake sh1 and sh2 are of directions in Blender's axes: leave out --up y, or use --bake view or isotropic".into(),
            );
        }
        match gridless(layout.scene.regions.iter().filter(|r| stays(r, job.density)), job.duality.model) {
            Some(reason) => usage(format!("{}: {reason}, which also bakes: leave out --bake", job.input.display())),
            None => Ok(()),
        }
    }

    /// Refuses what cannot be of voxel grids, of which `who` is one.
    fn check_grids(&self, who: &str) -> Result<()> {
        match self.each(Format::Glb).next() {
            Some(target) => {
                Err(Error::Usage(format!("-o {}: glTF can hold no voxel grid, and {who} is one: write .vdb", target.display())))
            }
            None => Ok(()),
        }
    }

    /// The targets of a format.
    pub fn each(&self, format: Format) -> impl Iterator<Item = &'a PathBuf> {
        self.0.iter().filter(move |(_, f)| *f == format).map(|(target, _)| *target)
    }

    /// Whether any target has a format.
    pub fn any(&self, format: Format) -> bool {
        self.each(format).next().is_some()
    }
}

/// Whether a region is rendered as it is: the duality makes balls of everything but grids.
fn stays(region: &Region, density: Density) -> bool {
    density == Density::Source || matches!(region.shape, Shape::Grid(_))
}

/// Refuses what the photon integrator cannot do.
fn check_photons(job: &Job, scene: &Scene) -> Result<()> {
    let usage = |text: String| Err(Error::Usage(text));
    let beam = job.picture.gather == Gathering::Beam;
    check_gather(job.picture.gather, job.duality.model)?;
    let grid = |r: &Region| matches!(r.shape, Shape::Grid(_));
    let endless = |r: &Region| r.shape.is_endless() && stays(r, job.density);
    let name = |region: Option<&Region>| region.map_or_else(String::new, |r| format!("{}: region {:?}", job.input.display(), r.name));
    let first = scene.regions.iter().find(|r| endless(r));
    if first.is_some() && !scene.regions.iter().all(endless) {
        let who = name(first);
        return usage(format!(
            "{who} goes on without end, and photons are stored within its tile only: beside other regions use --integrator path"
        ));
    }
    let odd = scene.regions.iter().find(|r| endless(r) || grid(r));
    if beam && odd.is_some() {
        return usage(format!("--gather beam cannot follow {}, a layer without end or a voxel grid: use --gather march", name(odd)));
    }
    if job.duality.model == Model::Hura2006 && scene.voxel_grid().is_some() {
        let odd = scene.regions.iter().find(|r| grid(r));
        return usage(format!("{} is a voxel grid, and the thesis marches homogeneous regions only: use --model physical", name(odd)));
    }
    Ok(())
}

/// Refuses beams in the thesis's own reading.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_gather(gather: Gathering, model: Model) -> Result<()> {
    if gather == Gathering::Beam && model == Model::Hura2006 {
        let text = "--gather beam: the thesis has no beams; use --gather march with --model hura2006, or --model physical";
        return Err(Error::Usage(text.into()));
    }
    Ok(())
}

/// The target that is this file, where one is.
fn overwritten<'a>(targets: &'a [PathBuf], file: &Path) -> Option<&'a PathBuf> {
    let file = file.canonicalize().ok()?;
    targets.iter().find(|target| target.canonicalize().is_ok_and(|target| target == file))
}

/// The density of an input for which nobody says one: the duality of a layout, a VDB as it is.
pub fn usual_density(input: &Path) -> Density {
    if import::is_vdb(input) { Density::Source } else { Density::Duality }
}
