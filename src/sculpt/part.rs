//! The parts of a sculpture, ready to be put into bricks.

use super::metaballs::{Metaballs, ROW, Row};
use super::noise::{Moved, Noise};
use super::{Distances, Part, Solid};
use crate::error::Result;
use crate::geom::Bounds;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use crate::scene::{BrickGrid, Shape};
use crate::voxelise::{Cover, Lattice, Up};
use glam::{DAffine3, DVec3, IVec3};
use std::sync::Arc;

/// A part, compiled for one lattice.
pub(super) struct Compiled {
    form: Form,
    weight: f64,
    /// The depth over which density rises, m.
    falloff: f64,
    bounds: Bounds,
}

enum Form {
    /// What nothing is done to, as exactly as voxels can be.
    Plain(Shape),
    /// A family, and how much field above its threshold makes the full density.
    Metaballs(Arc<Metaballs>, f64),
    /// From the world to the unit ball.
    Ellipsoid(DAffine3),
    /// A layer: its middle and half its sides; infinite where it is endless.
    Layer(DVec3, DVec3),
    /// The depth inside a mesh at each sample of the lattice, m.
    Depths(BrickGrid),
}

/// A part or one of its elements, in one of the tiles that reach into this one.
pub(super) struct Piece {
    pub part: u32,
    element: u32,
    /// How it is shifted into this tile, m.
    shift: DVec3,
    /// Coverage in units of voxels, of what is plain.
    cover: Option<Cover>,
}

impl Piece {
    /// Whether two pieces are of one part, alike shifted: their fields are summed before anything is made of them.
    pub fn alike(&self, other: &Piece) -> bool {
        self.part == other.part && self.shift == other.shift && self.cover.is_none()
    }
}

/// What all parts share.
pub(super) struct Setting<'a> {
    pub lattice: Lattice,
    pub noise: Option<&'a Noise>,
    /// Nothing is below this height, m.
    pub base: f64,
    /// Whether slabs go on without end.
    pub endless: bool,
}

impl Compiled {
    /// Compiles a part; meshes are measured by `distances`.
    ///
    /// # Errors
    /// What `distances` says.
    pub fn new(part: &Part, setting: &Setting, distances: Distances) -> Result<Self> {
        let (reach, bite, edge) = setting.noise.map_or((0.0, 0.0, 0.0), |n| (n.reach(), n.bite(), n.edge()));
        let falloff = part.falloff.max(edge);
        let own = part.solid.bounds();
        let mut bounds = Bounds { min: own.min - reach, max: own.max + reach };
        let form = match &part.solid {
            Solid::Metaballs(family) => {
                bounds = own;
                Form::Metaballs(Arc::clone(family), family.span())
            }
            Solid::Shape(shape) if setting.noise.is_none() && falloff == 0.0 => Form::Plain(shape.clone()),
            Solid::Shape(shape) => match shape {
                Shape::Ellipsoid { world_from_unit } => Form::Ellipsoid(world_from_unit.inverse()),
                Shape::Slab { centre, half_height, half_extent } => {
                    let half = half_extent.extend(*half_height);
                    Form::Layer(*centre, if setting.endless { DVec3::INFINITY.with_z(half.z) } else { half })
                }
                Shape::Mesh(mesh) => {
                    let margin = 2.0 * setting.lattice.step.max_element();
                    Form::Depths(distances(mesh, &setting.lattice, bite + falloff + margin, reach + margin)?)
                }
                Shape::Grid(_) => Form::Plain(shape.clone()),
            },
        };
        Ok(Compiled { form, weight: part.weight, falloff, bounds })
    }

    /// Whether it is alike in all tiles, and counts once.
    pub fn is_endless(&self) -> bool {
        matches!(&self.form, Form::Layer(_, half) if half.x == f64::INFINITY)
    }

    /// Its bounds in the world, detail included.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Its pieces, shifted, each with its bounds in units of voxels.
    pub fn pieces(&self, part: u32, shift: DVec3, lattice: &Lattice, mut visit: impl FnMut(Piece, Bounds)) {
        let here = Lattice { anchor: lattice.anchor - shift, ..*lattice };
        let voxels = |own: Bounds| Bounds { min: here.index(own.min), max: here.index(own.max) };
        match &self.form {
            Form::Plain(shape) => {
                let cover = Cover::new(shape, Up::Z).into_index(&here);
                let bounds = cover.bounds;
                visit(Piece { part, element: 0, shift, cover: Some(cover) }, bounds);
            }
            Form::Metaballs(family, _) => {
                for (element, one) in (0..).zip(&family.elements) {
                    visit(Piece { part, element, shift, cover: None }, voxels(one.bounds()));
                }
            }
            _ => visit(Piece { part, element: 0, shift, cover: None }, voxels(self.bounds)),
        }
    }

    /// Whether a piece may be other than 0 in the brick at `origin`, where its bounds are.
    pub fn meets(&self, piece: &Piece, lattice: &Lattice, origin: IVec3) -> bool {
        let Form::Metaballs(family, _) = &self.form else { return true };
        let half = 0.5 * f64::from(BRICK_SIDE);
        let middle = lattice.anchor + lattice.step * (origin.as_dvec3() + half) - piece.shift;
        family.elements[piece.element as usize].reaches(middle, half * lattice.step.length())
    }

    /// Adds its density to a brick, which `group`, pieces of this part alike shifted, meet. `moved` is what is known of the noise in
    /// each voxel.
    pub fn add(&self, origin: IVec3, group: &[&Piece], setting: &Setting, moved: &mut [Moved], sum: &mut [f64; BRICK_VOXELS]) {
        if let Some(cover) = &group[0].cover {
            return cover.cover(origin, self.weight, sum);
        }
        let (lattice, shift) = (&setting.lattice, group[0].shift);
        // Tiles are whole numbers of voxels.
        let by = (shift / lattice.step).round().as_ivec3();
        for (row, (sum, moved)) in sum.chunks_exact_mut(ROW).zip(moved.chunks_exact_mut(ROW)).enumerate() {
            let start = origin + IVec3::new((row >> 3) as i32, (row & 7) as i32, 0);
            let place = |index: IVec3| lattice.anchor + lattice.step * (index.as_dvec3() + 0.5);
            let fields = self.fields(group, place(start) - shift, lattice.step);
            for (k, (sum, moved)) in sum.iter_mut().zip(moved).enumerate() {
                let index = start + IVec3::Z * k as i32;
                let p = place(index);
                let q = p - shift;
                let density = match &self.form {
                    Form::Plain(_) => 0.0,
                    Form::Metaballs(family, span) => of_family(family.threshold, *span, &fields, k, p, setting, moved),
                    Form::Ellipsoid(unit_from_world) => self.at_depth(ellipsoid_depth(unit_from_world, q), p, setting, moved),
                    Form::Layer(centre, half) => self.at_depth((*half - (q - *centre).abs()).min_element(), p, setting, moved),
                    Form::Depths(depths) => {
                        let depth = depths.at_or((index - by).to_array(), f32::NEG_INFINITY);
                        self.at_depth(f64::from(depth), p, setting, moved)
                    }
                };
                *sum += self.weight * density;
            }
        }
    }

    /// The fields of a family's elements along a row of voxels.
    fn fields(&self, group: &[&Piece], start: DVec3, step: DVec3) -> Row {
        let mut row = Row::default();
        if let Form::Metaballs(family, _) = &self.form {
            for piece in group {
                row.add(&family.elements[piece.element as usize], start, step.with_x(0.0).with_y(0.0));
            }
        }
        row
    }

    /// The density of what lies `depth` metres below a sharp boundary, before detail.
    fn at_depth(&self, depth: f64, p: DVec3, setting: &Setting, moved: &mut Moved) -> f64 {
        let voxel = setting.lattice.step.max_element();
        // The mean over a voxel, as a ramp of the same middle and the same variance.
        let width = self.falloff.hypot(voxel);
        let rise = |depth: f64| ((depth - 0.5 * self.falloff) / width + 0.5).clamp(0.0, 1.0);
        let Some(noise) = setting.noise else { return rise(depth) };
        let above = p.z - setting.base;
        let density = noise.moved(p, moved, |by| rise((depth + by).min(above)));
        noise.eroded(density, p, moved)
    }
}

/// The density of a family of metaballs, `span` of whose field makes the full density, at point `k` of a row, which is at `p`.
///
/// Detail moves the surface: the field here is that of a lone ball at some radius, and becomes that ball's field as far inward or
/// outward as the surface moves.
fn of_family(threshold: f64, span: f64, fields: &Row, k: usize, p: DVec3, setting: &Setting, moved: &mut Moved) -> f64 {
    let field = fields.field[k];
    let rise = |field: f64, steepness: f64| (steepness * (field - threshold)).clamp(0.0, 1.0);
    let Some(noise) = setting.noise else { return rise(field, span.recip()) };
    let Some((radius, stiffness)) = fields.ball(k) else { return 0.0 };
    let flatness = (radius * radius).recip();
    let lone = |r: f64| {
        let inside = (1.0 - r * r * flatness).max(0.0);
        stiffness * inside * inside * inside
    };
    // In single precision: what it is off by is in `still` too, and cancels.
    let inside = f64::from(((field.clamp(0.0, stiffness) / stiffness) as f32).cbrt());
    let at = radius * (1.0 - inside).max(0.0).sqrt();
    let still = field - lone(at);
    let voxel = setting.lattice.step.max_element();
    let above = ((p.z - setting.base) / voxel + 0.5).clamp(0.0, 1.0);
    let steepness = noise.contrast() / span;
    let density = noise.moved(p, moved, |by| above * rise(still + lone((at - by).max(0.0)), steepness));
    noise.eroded(density, p, moved)
}

/// The depth below an ellipsoid's surface, m: exact for spheres, and to first order near the surface of others.
fn ellipsoid_depth(unit_from_world: &DAffine3, p: DVec3) -> f64 {
    let q = unit_from_world.transform_point3(p);
    let r = q.length();
    // The gradient of |q| in the world has length |M^T q| / |q|.
    let slope = (unit_from_world.matrix3.transpose() * q).length();
    if r > 1e-9 { (1.0 - r) * r / slope } else { unit_from_world.matrix3.determinant().abs().cbrt().recip() }
}
