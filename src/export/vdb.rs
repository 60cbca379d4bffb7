//! The VDB that Blender opens: which grids, at which voxel size, with which metadata.

use super::emission::EmissionGrid;
use super::lattice::{Ready, merge, turn};
use crate::bake::{Baked, LightGrid, Term};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::{BrickGrid, Flame, Region, Scene};
use crate::vdb::{Carried, GridOut, Meta, write_beside};
pub use crate::vdb::{limit_threads, on_abort};
use crate::voxelise::{Up, voxel_size, voxelise};
use glam::DAffine3;
use serde::Serialize;
use std::path::Path;

/// A grid that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GridName {
    /// The medium of the run: the synthesised regions, or with `--density source` the layout.
    Density,
    /// The layout before the duality.
    Source,
}

impl GridName {
    /// Its name in the file.
    pub fn as_str(self) -> &'static str {
        match self {
            GridName::Density => "density",
            GridName::Source => "source",
        }
    }
}

/// How grids are written.
#[derive(Debug, Clone)]
pub struct VdbOptions {
    /// In metres; `None` takes the regions' own lattice where all are voxel grids on one, else a third of the smallest half extent
    /// or 1/128 of the longest side, whichever is finer.
    pub voxel_size: Option<f64>,
    /// The most active voxels a grid may have.
    pub max_voxels: u64,
    /// The axis that points up.
    pub up: Up,
    /// 16-bit samples.
    pub half: bool,
    /// Which grids.
    pub grids: Vec<GridName>,
}

/// What was written, for the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GridSummary {
    /// The grid's name.
    pub name: GridName,
    /// Samples that are not zero.
    pub active_voxels: u64,
    /// The integral of the grid times `density_scale`: its optical mass, m^2.
    pub optical_mass: f64,
    /// The largest sample.
    pub max: f32,
}

/// What a grid of light says of itself.
fn of_light(baked: &Baked, grid: &LightGrid) -> Vec<(String, Meta)> {
    let part = &baked.parts[grid.part];
    let text = |key: &str, value: String| (key.to_string(), Meta::Text(value));
    let number = |key: &str, value: f64| (key.to_string(), Meta::Float(value));
    let [r, g, b] = part.tint;
    let (means, own) = match grid.term {
        Term::Light => ("what goes toward the viewer".into(), None),
        Term::Sunlight => ("sunlight that scatters once: times the phase function of mean cosine g".into(), Some(baked.mean_cosine)),
        Term::Glow => (
            "what scattered twice, a lobe about the sun's light: times the phase function of mean cosine g".into(),
            Some(baked.lobes[grid.part]),
        ),
        Term::Flow => (
            "what scattered three or four times, a lobe about its flow: times the phase function of mean cosine |flow| / flow".into(),
            None,
        ),
        Term::FlowX | Term::FlowY | Term::FlowZ => ("that flow along an axis, of the vector (flow_x, flow_y, flow_z)".into(), None),
        Term::Harmonic(i) => (format!("the coefficient of real spherical harmonic {i}"), None),
    };
    let mut all = vec![
        text("light", means),
        text("unit", "light_scale W m^-2 sr^-1 per unit of optical depth".into()),
        number("light_scale", part.scale),
        text("light_tint", format!("{r} {g} {b}")),
    ];
    all.extend(own.map(|g| number("g", g)));
    all
}

/// The grids of a file, ready to be written.
#[derive(Debug, Clone)]
pub struct Voxels {
    grids: Vec<(GridName, Ready)>,
    emission: Vec<EmissionGrid>,
    light: Option<Baked>,
    others: Carried,
    up: Up,
    /// Extinction in 1/m of a sample of 1: Blender's Principled Volume Density.
    pub density_scale: f64,
    /// The shortest edge of a voxel, in metres.
    pub voxel_size: f64,
    /// Whether `max_voxels` made the voxels coarser than they would be.
    pub coarsened: bool,
}

impl Voxels {
    /// Voxelises the regions to be written and, where asked, the layout. Voxel grids on one lattice stay in it, unless voxels of
    /// another size are asked for or more than the most would be active.
    ///
    /// # Errors
    /// [`crate::Error::TooManyVoxels`], [`crate::Error::Interrupted`].
    pub fn new(layout: &Scene, written: &[Region], options: &VdbOptions, progress: &dyn Progress) -> Result<Self> {
        let density_scale = layout.regions.iter().map(|r| r.medium.sigma_t()).fold(0.0, f64::max);
        let of = |name: GridName| match name {
            GridName::Density => written,
            GridName::Source => &layout.regions,
        };
        let of_density = |grids, voxel_size, coarsened| {
            let (emission, others, up) = (Vec::new(), Carried::default(), options.up);
            Voxels { grids, emission, light: None, others, up, density_scale, voxel_size, coarsened }
        };
        let mut kept = Vec::new();
        for &name in &options.grids {
            let one = merge(of(name), options.voxel_size, options.max_voxels, density_scale, options.up, progress)?;
            kept.extend(one.map(|one| (name, one)));
        }
        if kept.len() == options.grids.len() && !kept.is_empty() {
            let voxel_size = kept.iter().map(|(_, (_, edge))| *edge).fold(f64::INFINITY, f64::min);
            let grids = kept.into_iter().map(|(name, (ready, _))| (name, ready)).collect();
            return Ok(of_density(grids, voxel_size, false));
        }
        let (mut size, mut coarsened) = (0.0f64, false);
        for &name in &options.grids {
            let (fits, coarse) = voxel_size(of(name), options.voxel_size, options.max_voxels)?;
            // One lattice for all: as fine as the density asks, as coarse as the other must be.
            if size == 0.0 || (coarse && fits > size) {
                (size, coarsened) = (fits, coarse);
            }
        }
        let voxels = |name| voxelise(of(name), size, density_scale, options.up, progress).map(|grid| (name, Ready::Own(grid)));
        let grids = options.grids.iter().map(|&name| voxels(name)).collect::<Result<_>>()?;
        Ok(of_density(grids, size, coarsened))
    }

    /// The samples of the medium of the run, where they are to be written.
    pub fn density(&self) -> Option<&BrickGrid> {
        self.grids.iter().find(|(name, _)| *name == GridName::Density).map(|(_, grid)| grid.bricks())
    }

    /// What turns the scene into the world of the grids; `None` where it stays.
    pub fn turned(&self) -> Option<DAffine3> {
        turn(self.up)
    }

    /// Puts what shines by itself beside the density, where that is to be written.
    ///
    /// # Errors
    /// Those of [`EmissionGrid::of`].
    pub fn burn(&mut self, flames: &[Flame], max_voxels: u64, progress: &dyn Progress) -> Result<()> {
        if let Some(density) = self.density() {
            self.emission = EmissionGrid::of(flames, (density, self.voxel_size), max_voxels, self.up, progress)?;
        }
        Ok(())
    }

    /// What shines by itself.
    pub fn emission(&self) -> &[EmissionGrid] {
        &self.emission
    }

    /// Puts light beside the density.
    pub fn shine(&mut self, light: Baked) {
        self.light = Some(light);
    }

    /// The light that was put there.
    pub fn light(&self) -> Option<&Baked> {
        self.light.as_ref()
    }

    /// Takes grids of the input along, those of other names than the written ones; a sentence for each that stays behind.
    pub fn take_along(&mut self, others: Carried) -> Vec<String> {
        let light = self.light.iter().flat_map(|light| &light.grids).map(|grid| grid.name.as_str());
        let light = light.chain(self.emission.iter().map(|grid| grid.name));
        let names: Vec<&str> = self.grids.iter().map(|(name, _)| name.as_str()).chain(light).collect();
        let (others, notes) = others.beside(&names, turn(self.up));
        self.others = others;
        notes
    }

    /// Writes the grids with their metadata, and those that were taken along.
    ///
    /// # Errors
    /// [`crate::Error::Write`], [`crate::Error::Vdb`]; [`crate::Error::File`] of the input, where a grid taken along is damaged.
    pub fn write(&self, path: &Path, half: bool, metadata: &[(String, Meta)]) -> Result<()> {
        let scale = [
            ("density_scale".to_string(), Meta::Float(self.density_scale)),
            ("unit".to_string(), Meta::Text("density_scale per metre".into())),
        ];
        let mut grids: Vec<GridOut> =
            self.grids.iter().map(|(name, grid)| GridOut { name: name.as_str(), bricks: grid.bricks(), half, metadata: &scale }).collect();
        let light: Vec<_> = self.light.iter().flat_map(|baked| baked.grids.iter().map(|grid| (grid, of_light(baked, grid)))).collect();
        grids.extend(light.iter().map(|(grid, metadata)| GridOut { name: &grid.name, bricks: &grid.bricks, half, metadata }));
        let emission: Vec<_> = self.emission.iter().map(|grid| (grid, grid.metadata())).collect();
        grids.extend(emission.iter().map(|(grid, metadata)| GridOut { name: grid.name, bricks: grid.bricks(), half, metadata }));
        write_beside(path, &grids, &self.others, metadata)
    }

    /// How large the file is.
    ///
    /// # Errors
    /// As [`Voxels::write`].
    pub fn bytes(&self, half: bool, metadata: &[(String, Meta)]) -> Result<u64> {
        let wrong = |error: std::io::Error| Error::Write {
            target: std::env::temp_dir(),
            reason: format!("cannot be written ({error})"),
            fix: "Free some space there, or set TMPDIR".into(),
        };
        let file = tempfile::Builder::new().suffix(".vdb").tempfile().map_err(wrong)?;
        self.write(file.path(), half, metadata)?;
        Ok(std::fs::metadata(file.path()).map_err(wrong)?.len())
    }

    /// What the grids hold.
    pub fn summary(&self) -> Vec<GridSummary> {
        let one = |(name, grid): &(GridName, Ready)| GridSummary {
            name: *name,
            active_voxels: grid.bricks().active_voxels(),
            optical_mass: grid.bricks().integral() * self.density_scale,
            max: grid.bricks().values.iter().copied().fold(0.0, f32::max),
        };
        self.grids.iter().map(one).collect()
    }
}
