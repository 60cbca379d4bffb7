//! Where a grid is, how large, and which way up.

use super::figure::{figure, size};
use super::grid::{Grid, Transform, Values};
use super::{Findings, Severity};
use crate::vdb::Columns;
use glam::DVec3;

/// The longest side of a 3D texture that every graphics card of today allows (`GL_MAX_3D_TEXTURE_SIZE`); many allow 16384.
const TEXTURE: i64 = 2048;
/// Dense voxels of this many bytes stop a viewport.
const DENSE: f64 = 4e9;
/// Beyond so many of its own diagonals a cloud is not where one looks.
const ASIDE: f64 = 10.0;
/// The Clip End of the camera in Blender's default scene, and of new cameras and the 3D view, in metres.
const CLIP_END: [f64; 2] = [100.0, 1000.0];
/// How far a voxel's edges may differ and be of one length, or lean and be square.
const SAME: f64 = 1e-3;
/// A side is flat if this share of the columns ends there, and round if at most that.
const FLAT: [f64; 2] = [0.5, 0.25];

/// Looks at the transform and the box of the density.
pub fn judge(grid: &Grid, values: &Values, findings: &mut Findings) {
    dense(grid, values, findings);
    let name = &grid.name;
    let Some(transform) = &grid.transform else {
        let says = format!(
            "The transform of the grid {name:?} is a frustum. Blender 4.5 and 5.2 take it for a straight box, each for another: place, size and \
             shape are wrong."
        );
        let fix = "Resample it to a grid of cubic voxels (OpenVDB's resampleToMatch; Houdini's VDB Resample with a straight reference)";
        return findings.grid(grid, "frustum", Severity::Problem, says, fix);
    };
    let determinant = transform.affine().matrix3.determinant();
    let volume: f64 = transform.voxel.iter().product();
    if !determinant.is_finite() || determinant.abs() <= 1e-12 * volume {
        let says = format!("The transform of the grid {name:?} squashes it: a voxel measures {}.", product(transform.voxel));
        findings.grid(grid, "squashed", Severity::Problem, says, "Give every axis a voxel size other than 0, and write it again");
        return;
    }
    if determinant < 0.0 {
        let says = format!(
            "The transform of the grid {name:?} mirrors it (its determinant is {}). Cycles in Blender 4.5 shows nothing, \
             whatever the object's scale; 5.2 shows it.",
            figure(determinant)
        );
        let fix = "Turn the order of the voxels round along one axis, with that axis's voxel size positive, and write it again";
        findings.grid(grid, "mirrored", Severity::Problem, says, fix);
    }
    shape(grid, transform, findings);
    if let Some([low, high]) = values.world_box {
        position(grid, transform, DVec3::from_array(low), DVec3::from_array(high), findings);
    }
    if let Some(columns) = values.columns
        && let Some(share) = lies_on_minus_y(transform, &columns)
    {
        let says = format!(
            "It looks Y-up, a guess by its form: {:.0} % of the grid {name:?} stands on a flat base toward -Y, and no other side is flat. In \
             Blender Z is up, so it lies on its side.",
            100.0 * share
        );
        let fix = "If so, rotate the object by 90 degrees about X (R X 90), or export with Z up";
        findings.grid(grid, "y-up", Severity::Hint, says, fix);
    }
}

fn product(lengths: [f64; 3]) -> String {
    let [x, y, z] = lengths.map(figure);
    format!("{x} x {y} x {z} m")
}

/// What EEVEE and the viewport make of the box.
fn dense(grid: &Grid, values: &Values, findings: &mut Findings) {
    let Some(sides) = values.sides() else { return };
    let [x, y, z] = sides;
    let name = &grid.name;
    let fix = "Resample it coarser, split it, or remove stray voxels far from the cloud. Cycles does not mind";
    if sides.iter().any(|&side| side > TEXTURE) {
        let says = format!(
            "The active voxels of the grid {name:?} lie in a box of {x} x {y} x {z}. EEVEE and the Solid view put it into one 3D texture, and \
             show nothing on graphics cards that end at {TEXTURE} along a side."
        );
        findings.grid(grid, "texture-size", Severity::Hint, says, fix);
    }
    if values.dense_bytes > DENSE {
        let says = format!(
            "The active voxels of the grid {name:?} lie in a box of {x} x {y} x {z}. EEVEE and the Solid view fill it with {} of dense voxels: \
             Blender stalls or runs out of memory.",
            size(values.dense_bytes)
        );
        findings.grid(
            grid,
            "dense-memory",
            Severity::Problem,
            says,
            format!("{fix}; keep the viewport in Wireframe, or the volume hidden there"),
        );
    }
}

/// Voxels that are no cubes.
fn shape(grid: &Grid, transform: &Transform, findings: &mut Findings) {
    let [x, y, z] = transform.axes.map(DVec3::from_array);
    let leaning = [(x, y), (y, z), (z, x)].iter().map(|(a, b)| (a.dot(*b) / (a.length() * b.length())).abs()).fold(0.0, f64::max);
    let (short, long) = transform.voxel.iter().fold((f64::INFINITY, 0.0f64), |(s, l), &e| (s.min(e), l.max(e)));
    let what = if leaning > SAME {
        format!("sheared: its axes lean by up to {} degrees", figure(leaning.asin().to_degrees()))
    } else if long > short * (1.0 + SAME) {
        format!("stretched: a voxel measures {}", product(transform.voxel))
    } else {
        return;
    };
    let says = format!("The grid {:?} is {what}. Blender shows it so; game engines and some tools want cubes.", grid.name);
    findings.grid(grid, "voxel-shape", Severity::Hint, says, "If it looks wrong, resample it to cubic voxels where it was made");
}

/// Far away, or large.
fn position(grid: &Grid, transform: &Transform, low: DVec3, high: DVec3, findings: &mut Findings) {
    let name = &grid.name;
    let (centre, diagonal) = ((low + high) / 2.0, (high - low).length());
    let farthest = low.abs().max(high.abs()).max_element() as f32;
    // The distance to the next 32-bit float: Blender's positions are such.
    let step = f64::from(farthest.next_up() - farthest);
    let edge = transform.voxel.iter().copied().fold(f64::INFINITY, f64::min);
    let away = format!(
        "The grid {name:?} is {} m from the origin, {} of its own diagonals",
        figure(centre.length()),
        figure(centre.length() / diagonal)
    );
    let [x, y, z] = (-centre).to_array().map(figure);
    if step > edge || !step.is_finite() {
        let says = format!(
            "{away}. Blender's 32-bit positions are {} m apart there, and a voxel is {} m: it comes out in steps, or not at all.",
            figure(step),
            figure(edge)
        );
        let fix = format!("Move it to the origin where it was made, by ({x}, {y}, {z})");
        findings.grid(grid, "far-away", Severity::Problem, says, fix);
    } else if centre.length() > ASIDE * diagonal {
        let fix = format!("View > Frame Selected (Numpad .) finds it; Location ({x}, {y}, {z}) brings it to the origin");
        findings.grid(grid, "far-away", Severity::Hint, format!("{away}: it is not where the view looks."), fix);
    }
    if diagonal > CLIP_END[0] {
        let enough = figure(format!("{:.0e}", 5.0 * diagonal).parse().unwrap_or(diagonal));
        let others = if diagonal > CLIP_END[1] { ", others and the view 1000 m" } else { "" };
        let says =
            format!("The grid {name:?} is {} m across; the camera of Blender's default scene sees 100 m far{others}.", figure(diagonal));
        let fix = format!("Set Clip End to {enough} m or more: the camera's (Object Data > Lens), and the view's (N, View)");
        findings.grid(grid, "clip-end", Severity::Hint, says, fix);
    }
}

/// The share of a cloud that stands on a flat base toward -Y, where no other side is flat; `None` where that is not so.
pub fn lies_on_minus_y(transform: &Transform, columns: &Columns) -> Option<f64> {
    let mut down = None;
    for a in 0..3 {
        let y = transform.axes[a][1] / transform.voxel[a];
        for end in 0..2 {
            let share = columns.flat[a][end];
            // The lower end of an axis that points along +Y, or the upper of one that points along -Y.
            if y.abs() > 1.0 - SAME && (y > 0.0) == (end == 0) {
                down = Some(share);
            } else if share > FLAT[1] {
                return None;
            }
        }
    }
    down.filter(|&share| share >= FLAT[0])
}
