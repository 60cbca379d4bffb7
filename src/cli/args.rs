//! The flags, and the job that they make.

use super::doctor::DoctorArguments;
use super::flux::FluxArguments;
use super::scene::SceneArguments;
use super::study::StudyArguments;
use super::values::{count, megabytes, percent, step, stops, time};
use crate::bake::Bake;
use crate::error::Error;
use crate::export::vdb::{GridName, VdbOptions};
use crate::integrate::photon::Gathering;
use crate::integrate::{Directional, Integrator};
use crate::photon::Model;
use crate::pipeline::{Baking, Job, Picture, usual_density};
use crate::plan::Density;
use crate::regions::{Duality, Placement};
use crate::voxelise::Up;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Photon-cloud regions from a Blender layout, written as OpenVDB grids.
///
/// Reads a glTF layout of spheres (or metaballs, slabs, closed meshes), traces photons from the sun through it, makes new
/// regions where light scatters multiply, and writes them as a grid that Blender opens. Takes pictures of them, and of any .vdb.
#[derive(Debug, Parser)]
#[command(name = "cloudvdb", version, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, after_help = EXAMPLES)]
pub struct Arguments {
    /// What to do instead of the main job.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The main job.
    #[command(flatten)]
    pub run: Run,
}

impl Arguments {
    /// How progress and errors are told.
    pub fn progress(&self) -> ProgressStyle {
        match &self.command {
            None => self.run.manners.progress,
            Some(Command::Flux(flux)) => flux.manners.progress,
            Some(Command::Study(study)) => study.manners.progress,
            Some(_) => ProgressStyle::Bar,
        }
    }
}

const EXAMPLES: &str = "Examples:
  cloudvdb cloud.glb -o cloud.vdb                        the main job
  cloudvdb cloud.glb -o cloud.vdb -o report.json         and its report
  cloudvdb cloud.glb -o regions.glb --photons 10M        the regions as spheres, to edit in Blender
  cloudvdb cloud.glb -o cloud.vdb -o cloud.png           and a picture of it
  cloudvdb smoke.vdb -o smoke.exr --sigma-t 25 --sun 1,0,-1
  cloudvdb flux cloud.glb                                where the light goes
  cloudvdb plan cloud.glb                                which effects are simulated, and why
  cloudvdb study --paper scenes/hura2006*.gltf           the thesis's tables again
  cloudvdb doctor cloud.vdb                              why a VDB looks wrong in Blender, and the fix";

/// In less memory than this a scene's box may not fit, however coarse its voxels, bytes.
const LEAST_MEMORY: u64 = 100_000_000;

/// What else the command can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Say which effects the scene calls for, which not, and why
    Plan(PlanArguments),
    /// Say where the light goes: up, down, absorbed
    Flux(FluxArguments),
    /// Run the thesis's tests again, and print its tables beside ours
    Study(StudyArguments),
    /// Say what would make a VDB look wrong or empty in Blender, and the fix
    Doctor(DoctorArguments),
    /// Print completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
}

/// The arguments of `plan`.
#[derive(Debug, Args)]
pub struct PlanArguments {
    /// The layout: .gltf or .glb; or a .vdb
    pub input: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Which medium the plan is for
    #[arg(long, value_enum, default_value_t = DensityArgument::Source)]
    pub density: DensityArgument,
    /// What is in the scene.
    #[command(flatten)]
    pub scene: SceneArguments,
}

/// The arguments of the main job.
#[derive(Debug, Args)]
pub struct Run {
    /// The layout: .gltf or .glb; or a .vdb
    #[arg(required = true)]
    pub input: Option<PathBuf>,
    /// What to write; repeats. The extension says what: .vdb grids, .exr or .png a picture, .json the report, .glb the regions as spheres
    #[arg(short, long = "output", value_name = "FILE")]
    pub outputs: Vec<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub overwrite: bool,
    /// Which medium is written and rendered: the synthesised regions, or the input as it is [default: duality; source for a .vdb]
    #[arg(long, value_enum)]
    pub density: Option<DensityArgument>,
    /// How the thesis is read: corrected, or to the letter
    #[arg(long, value_enum, default_value_t = ModelArgument::Physical)]
    pub model: ModelArgument,
    /// Where candidates for regions are drawn: anywhere in a region, or at its photons
    #[arg(long, value_enum, default_value_t = PlacementArgument::Uniform)]
    pub placement: PlacementArgument,
    /// Photons to store (10k, 1M and 1e6 are numbers too)
    #[arg(long, value_name = "N", default_value = "1M", value_parser = count)]
    pub photons: u64,
    /// Photons that must lie within the search distance [default: the square root of a region's photons]
    #[arg(long, value_name = "N", value_parser = count)]
    pub estimate: Option<u64>,
    /// The axis that points up in the grid: z for Blender, y for Houdini, Unreal and USD
    #[arg(long, value_enum, default_value_t = UpArgument::Z)]
    pub up: UpArgument,
    /// Store 32-bit samples, not 16-bit ones
    #[arg(long)]
    pub float32: bool,
    /// The grids to write
    #[arg(long, value_enum, value_delimiter = ',', default_value = "density")]
    pub grids: Vec<GridArgument>,
    /// Light that goes into the VDB beside the density, so that Blender shows all scattering at once: what goes toward the
    /// camera (view), its mean over all directions (isotropic), or all directions by harmonics up to degree 1 or 3
    #[arg(long, value_enum, default_value_t = BakeArgument::None)]
    pub bake: BakeArgument,
    /// Do not compare baked light with the path tracer's pictures: seconds saved for each frame of a sequence
    #[arg(long)]
    pub no_check: bool,
    /// The most megabytes that a .vdb may have: voxels are made wider until it fits
    #[arg(long, value_name = "MB", value_parser = megabytes, conflicts_with = "voxel_size")]
    pub max_mb: Option<f64>,
    /// How light is followed in a picture [default: grid; path where regions have no end]
    #[arg(long, value_enum)]
    pub integrator: Option<IntegratorArgument>,
    /// Samples a pixel of a picture [default: 16; 64 with --integrator path and photon]
    #[arg(long, value_name = "N", value_parser = count)]
    pub spp: Option<u64>,
    /// Go on until a pixel of a picture is known to so many per cent: 5%. It sets the samples, and the
    /// grid integrator's photons
    #[arg(long, value_name = "PERCENT", value_parser = percent, conflicts_with = "spp")]
    pub error: Option<f64>,
    /// Make a picture as good as it can be within so much time, that of the whole run: 30s, 5m, 1h. The report names
    /// the flags that make the same bytes again
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "spp")]
    pub time: Option<f64>,
    /// Photons of a picture by the grid integrator [default: --photons]
    #[arg(long, value_name = "N", value_parser = count, conflicts_with_all = ["error", "time"])]
    pub picture_photons: Option<u64>,
    /// On Ctrl-C, write the picture so far, with its error, and the other files; a second one ends at once
    #[arg(long)]
    pub keep_partial: bool,
    /// Keep what is done in a file: the same command, stopped and started again, goes on from there and makes the same bytes. It is
    /// removed when the run is done
    #[arg(long, value_name = "FILE", conflicts_with_all = ["keep_partial", "time", "dry_run"])]
    pub checkpoint: Option<PathBuf>,
    /// What the voxels of the grid integrator may take, and what the photons of the duality and of the photon integrator may, in
    /// bytes [default: 1G for voxels; for photons what the system has free]
    #[arg(long, value_name = "BYTES", value_parser = count)]
    pub memory: Option<u64>,
    /// What of light's directions those voxels keep
    #[arg(long, value_enum, default_value_t = DirectionalArgument::View)]
    pub directional: DirectionalArgument,
    /// Where the photon integrator looks for photons: at points along a ray, or along the whole of it
    #[arg(long, value_enum, default_value_t = GatherArgument::March)]
    pub gather: GatherArgument,
    /// The optical depth of the photon integrator's first step along a ray; it sets the noise, and no bias
    #[arg(long, value_name = "DEPTH", default_value = "0.1", value_parser = step)]
    pub step: f64,
    /// Looks of the photon integrator at the sun's disc from each point of a surface
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub shadow_rays: u32,
    /// By how many stops a .png is brightened
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = stops, allow_hyphen_values = true)]
    pub exposure: f64,
    /// The seed: the same seed gives the same bytes, on any number of threads
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Read and plan, but trace and write nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Print the report as JSON on stdout
    #[arg(long)]
    pub json: bool,
    /// Threads, progress, quiet.
    #[command(flatten)]
    pub manners: Manners,
    /// Name everything that was found, and every effect
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// What is in the scene.
    #[command(flatten)]
    pub scene: SceneArguments,
}

impl Run {
    /// The job that the flags ask for.
    pub fn job(&self) -> Result<Job, Error> {
        let usage = |text: &str| Err(Error::Usage(text.into()));
        let Some(input) = self.input.clone() else { return usage("name a layout: cloudvdb cloud.glb -o cloud.vdb") };
        if self.outputs.is_empty() && !self.dry_run && !self.json {
            return usage("say what to write: -o cloud.vdb (or --json for the report on stdout, or --dry-run)");
        }
        if self.photons == 0 || self.estimate == Some(0) || self.scene.max_voxels == 0 {
            return usage("--photons, --estimate and --max-voxels must be at least 1");
        }
        if self.photons > u64::from(u32::MAX) {
            return usage("--photons can be at most 4294967295");
        }
        let spp = match self.spp.map(u32::try_from) {
            None => None,
            Some(Ok(n)) if n > 0 => Some(n),
            _ => return usage("--spp must be from 1 to 4294967295"),
        };
        if self.memory.is_some_and(|bytes| bytes < LEAST_MEMORY) {
            return usage("--memory: the voxels of the grid integrator need at least 100M (bytes)");
        }
        if (self.error.is_some() || self.time.is_some()) && self.integrator == Some(IntegratorArgument::Photon) {
            return usage(
                "--error and --time: which photons and --estimate reach an error is not known beforehand: use --integrator grid or path, or --photons and --estimate",
            );
        }
        if self.picture_photons.is_some_and(|n| !(1..=u64::from(u32::MAX)).contains(&n)) {
            return usage("--picture-photons must be from 1 to 4294967295");
        }
        let mut grids: Vec<GridName> = self.grids.iter().map(|&g| g.into()).collect();
        grids.sort_unstable_by_key(|g| g.as_str());
        grids.dedup();
        Ok(Job {
            density: self.density.map_or_else(|| usual_density(&input), Into::into),
            input,
            outputs: self.outputs.clone(),
            overwrite: self.overwrite,
            import: self.scene.import(),
            photons: self.photons,
            duality: Duality { model: self.model.into(), placement: self.placement.into(), estimate: self.estimate, seed: self.seed },
            vdb: VdbOptions {
                voxel_size: self.scene.voxel_size,
                max_voxels: self.scene.max_voxels,
                up: self.up.into(),
                half: !self.float32,
                grids,
            },
            bake: Baking { light: self.bake.into(), checked: !self.no_check, most_bytes: self.max_mb.map(|mb| (mb * 1e6) as u64) },
            picture: Picture {
                integrator: self.integrator.map(Into::into),
                spp,
                photons: self.picture_photons,
                error: self.error,
                seconds: self.time,
                memory: self.memory,
                directional: self.directional.into(),
                gather: self.gather.into(),
                step: self.step,
                shadow_rays: self.shadow_rays,
                exposure: self.exposure,
                view: self.scene.view(),
            },
            dry_run: self.dry_run,
        })
    }
}

/// How a command behaves, whatever it does.
#[derive(Debug, Args)]
pub struct Manners {
    /// Threads to use [default: all]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// How progress is told on stderr: bars in a terminal, or JSON lines
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    pub progress: ProgressStyle,
    /// Say nothing but the result and errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// How progress is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressStyle {
    /// A bar, where stderr is a terminal.
    Bar,
    /// JSON lines.
    Json,
}

/// An argument that stands for a value of the core, which knows no command line.
macro_rules! argument {
    ($(#[$doc:meta])* $name:ident for $core:ident { $($(#[$help:meta])* $variant:ident),+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
        pub enum $name { $($(#[$help])* $variant),+ }
        impl From<$name> for $core {
            fn from(argument: $name) -> Self {
                match argument { $($name::$variant => $core::$variant),+ }
            }
        }
    };
}

argument!(/// `--density`
    DensityArgument for Density { /// the regions that the duality makes
        Duality, /// the layout as it is
        Source });
argument!(/// `--model`
    ModelArgument for Model { /// energy is conserved
        Physical, /// Hura's text to the letter, traps included
        Hura2006 });
argument!(/// `--placement`
    PlacementArgument for Placement { /// anywhere in a region (the thesis)
        Uniform, /// at photons (its future work)
        Importance });
argument!(/// `--integrator`
    IntegratorArgument for Integrator { /// photons' light toward the camera in voxels, smoothed: the fast one
        Grid, /// the reference: unbiased path tracing
        Path, /// the thesis's pass 2: sunlight that scattered once, and stored photons for the rest
        Photon });
argument!(/// `--directional`
    DirectionalArgument for Directional { /// what goes toward the camera
        View, /// all, by harmonics of degrees 0 to 2: for light that is not peaked
        Sh2 });
argument!(/// `--gather`
    GatherArgument for Gathering { /// the nearest at points along a ray (the thesis)
        March, /// all along a ray, each photon a ball
        Beam });
argument!(/// `--up`
    UpArgument for Up { /// Blender
        Z, /// Houdini, Unreal, USD
        Y });
argument!(/// `--grids`
    GridArgument for GridName { /// the medium of the run
        Density, /// the layout before the duality
        Source });

/// `--bake`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BakeArgument {
    /// nothing
    None,
    /// what goes toward the camera
    View,
    /// one grid for any view: the mean over all directions
    Isotropic,
    /// any view: the sun's peaks, the rest by harmonics up to degree 1
    Sh1,
    /// the same up to degree 3
    Sh2,
}

impl From<BakeArgument> for Option<Bake> {
    fn from(argument: BakeArgument) -> Self {
        match argument {
            BakeArgument::None => None,
            BakeArgument::View => Some(Bake::View),
            BakeArgument::Isotropic => Some(Bake::Isotropic),
            BakeArgument::Sh1 => Some(Bake::Sh1),
            BakeArgument::Sh2 => Some(Bake::Sh2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_sound() {
        Arguments::command().debug_assert();
    }

    fn job(flags: &[&str]) -> Result<Job, String> {
        let line = ["cloudvdb", "in.vdb", "-o", "out.png"].iter().chain(flags);
        let arguments = Arguments::try_parse_from(line).map_err(|e| e.to_string())?;
        arguments.run.job().map_err(|e| e.to_string())
    }

    #[test]
    fn values_may_begin_with_a_minus_sign() {
        let job = job(&["--sun", "-1,0,0", "-g", "-0.3", "--exposure", "-1.5", "--camera", "-1,-2,3", "--look-at", "-1,0,0"]).unwrap();
        let said = job.import.overrides;
        assert_eq!((said.sun, said.g, job.picture.exposure), (Some(glam::DVec3::NEG_X), Some(-0.3), -1.5));
        assert_eq!(job.picture.view.position, Some(glam::DVec3::new(-1.0, -2.0, 3.0)));
    }

    #[test]
    fn defaults_follow_the_input() {
        let bare = job(&[]).unwrap();
        assert_eq!((bare.density, bare.picture, bare.import), (Density::Source, Picture::default(), Default::default()));
        assert_eq!(job(&["--density", "duality"]).unwrap().density, Density::Duality);
        let glb = Arguments::try_parse_from(["cloudvdb", "in.glb", "--json"]).unwrap().run.job().unwrap();
        assert_eq!(glb.density, Density::Duality);
        for wrong in
            [["--spp", "0"], ["--spp", "5G"], ["--exposure", "nan"], ["--size", "0x0"], ["--fov", "180"], ["--integrator", "voxels"]]
        {
            assert!(job(&wrong).is_err(), "{wrong:?}");
        }
    }
}
