//! The rules, each on either side of what decides it. Blender's part is in `tests/python/test_doctor.py`.

use super::figure::{count, figure, size};
use super::file::judge;
use super::place::lies_on_minus_y;
use super::sequence::better;
use super::{Findings, Grid, Severity, Transform, Values, chosen};
use crate::vdb::{Columns, Exam, Unread};
use std::collections::BTreeSet;

/// A fog volume of 20 x 20 x 20 voxels of 0.1 m about the origin, whose values are 0 to 1.
fn cloud() -> Grid {
    let edge = |a: usize| std::array::from_fn(|b| if a == b { 0.1 } else { 0.0 });
    Grid {
        name: "density".into(),
        value_type: "float".into(),
        class: "fog volume".into(),
        transform: Some(Transform { axes: std::array::from_fn(edge), origin: [0.0; 3], voxel: [0.1; 3] }),
        values: Some(Values {
            exam: Exam {
                active_voxels: 4000,
                index_box: Some([[-10; 3], [9; 3]]),
                highest: 1.0,
                mean: 0.5,
                columns: Some(Columns { sum: [15.0; 3], flat: [[0.1; 2]; 3] }),
                ..Exam::default()
            },
            world_box: Some([[-1.0; 3], [1.0; 3]]),
            ..Values::default()
        }),
        ..Grid::default()
    }
}

/// The cloud with other values.
fn with(change: impl Fn(&mut Values)) -> Grid {
    let mut grid = cloud();
    grid.values.iter_mut().for_each(change);
    grid
}

/// What is found, with a mark on problems.
fn found(grids: &[Grid]) -> Vec<String> {
    let mut findings = Findings::default();
    judge(grids, &mut findings);
    findings.all.iter().map(|f| format!("{}{}", if f.severity == Severity::Problem { "!" } else { "" }, f.id)).collect()
}

fn one(grid: Grid) -> Vec<String> {
    found(&[grid])
}

#[test]
fn a_usual_cloud_has_nothing() {
    assert_eq!(one(cloud()), [""; 0]);
}

#[test]
fn values_on_either_side_of_their_rules() {
    let most = |highest: f64| one(with(|v| v.highest = highest));
    assert_eq!(most(0.001), ["!clipped"]);
    assert_eq!(most(0.0011), ["range"]);
    assert_eq!([most(0.01), most(100.0)], [[""; 0], [""; 0]]);
    assert_eq!([most(101.0), most(65505.0)], [["range"], ["range"]]);
    assert_eq!(one(with(|v| v.nan = 1)), ["!not-finite"]);
    assert_eq!(one(with(|v| v.infinite = 1)), ["!not-finite"]);
    assert_eq!(one(with(|v| (v.negative, v.lowest) = (1, -0.1))), ["negative"]);
    assert_eq!(one(with(|v| v.inactive = 1)), ["!inactive"]);
    assert_eq!(one(with(|v| v.background = 0.5)), ["!background"]);
    assert_eq!(one(with(|v| (v.active_voxels, v.index_box) = (0, None))), ["!empty"]);
    assert_eq!(one(with(|v| v.highest = 0.0)), ["!empty"]);
    // Of a fog volume by its class, these are just odd values.
    assert_eq!(one(with(|v| (v.lowest, v.background, v.highest) = (-0.3, 0.3, 0.3))), ["!background"]);
    let unsaid =
        |background: f64| Grid { class: "unknown".into(), ..with(|v| (v.lowest, v.background, v.highest) = (-0.3, background, 0.3)) };
    assert_eq!(one(unsaid(0.3)), ["!level-set"]);
    assert_eq!(one(unsaid(0.0)), [""; 0]);
    assert_eq!(one(Grid { class: "level set".into(), ..cloud() }), ["!level-set"]);
}

#[test]
fn depth_on_either_side_of_its_rules() {
    let deep = |depths: [f64; 3], scale: Option<f64>| {
        let mut grid = with(|v| v.columns = Some(Columns { sum: depths.map(|d| d / 0.1), flat: [[0.1; 2]; 3] }));
        grid.metadata.extend(scale.map(|s| ("density_scale".to_string(), s.into())));
        let mut findings = Findings::default();
        let depth = judge(&[grid], &mut findings).unwrap();
        (findings.all.iter().map(|f| f.id).collect::<Vec<_>>(), depth.set_density, depth.set_bounces)
    };
    assert_eq!(deep([0.019; 3], None), (vec!["thin"], 530.0, 32));
    // What shows along one axis is no empty picture.
    assert_eq!(deep([0.01, 0.01, 0.21], None).0, [""; 0]);
    assert_eq!(deep([0.19; 3], None).0, ["thin"]);
    assert_eq!(deep([0.21; 3], None), (vec![], 1.0, 4));
    assert_eq!([deep([3.9; 3], None).0, deep([4.1; 3], None).0], [vec![], vec!["bounces"]]);
    // A wide layer is as deep as its light must go: the short way.
    assert_eq!(deep([5000.0, 5000.0, 16.0], None), (vec!["bounces"], 1.0, 32));
    assert_eq!(deep([511.0; 3], None), (vec!["bounces"], 1.0, 1024));
    assert_eq!(deep([520.0; 3], None), (vec!["thick", "bounces"], 0.077, 128));
    assert_eq!(deep([520.0; 3], Some(0.05)), (vec!["bounces"], 0.05, 64));
    assert_eq!(deep([0.021; 3], Some(0.5)).0, ["thin"]);
}

#[test]
fn places_on_either_side_of_their_rules() {
    let moved = |x: f64| {
        let mut grid = with(|v| v.world_box = Some([[x - 1.0, -1.0, -1.0], [x + 1.0, 1.0, 1.0]]));
        grid.transform.iter_mut().for_each(|t| t.origin = [x, 0.0, 0.0]);
        one(grid)
    };
    assert_eq!([moved(34.0), moved(-34.0)], [[""; 0], [""; 0]]);
    assert_eq!([moved(35.0), moved(-35.0), moved(1e6)], [["far-away"], ["far-away"], ["far-away"]]);
    assert_eq!([moved(2e6), moved(1e300)], [["!far-away"], ["!far-away"]]);
    let box_of = |sides: [i32; 3]| {
        let dense = sides.iter().map(|&s| 4.0 * f64::from(s) / 4f64.powf(2.0 / 3.0)).product::<f64>();
        one(with(|v| (v.index_box, v.dense_bytes) = (Some([[0; 3], sides.map(|s| s - 1)]), dense)))
    };
    assert_eq!([box_of([2048, 10, 10]), box_of([999, 1000, 1000])], [[""; 0], [""; 0]]);
    assert_eq!(box_of([10, 2049, 10]), ["texture-size"]);
    assert_eq!(box_of([1001, 1000, 1000]), ["!dense-memory"]);
    let across = |half: f64| one(with(|v| v.world_box = Some([[-half; 3], [half; 3]])));
    assert_eq!(across(28.8), [""; 0]);
    assert_eq!(across(29.0), ["clip-end"]);
}

#[test]
fn transforms() {
    let shaped = |axes: [[f64; 3]; 3]| {
        let voxel = axes.map(|a| glam::DVec3::from_array(a).length());
        one(Grid { transform: Some(Transform { axes, origin: [0.0; 3], voxel }), ..cloud() })
    };
    assert_eq!(shaped([[0.0, 0.1, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 0.1]]), [""; 0]);
    assert_eq!(shaped([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.11]]), ["voxel-shape"]);
    assert_eq!(shaped([[0.1, 0.0, 0.0], [0.05, 0.1, 0.0], [0.0, 0.0, 0.1]]), ["voxel-shape"]);
    assert_eq!(shaped([[-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]), ["!mirrored"]);
    assert_eq!(shaped([[0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])[0], "!squashed");
    assert_eq!(shaped([[f64::NAN, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]])[0], "!squashed");
    assert_eq!(one(Grid { transform: None, ..cloud() }), ["!frustum"]);
}

#[test]
fn a_flat_base_toward_minus_y_looks_y_up() {
    let upright = cloud().transform.unwrap();
    let flat = |flat: [[f64; 2]; 3], transform: &Transform| lies_on_minus_y(transform, &Columns { sum: [1.0; 3], flat });
    let base = [[0.1, 0.1], [0.8, 0.1], [0.1, 0.1]];
    assert_eq!(flat(base, &upright), Some(0.8));
    assert_eq!(flat([[0.1, 0.1], [0.1, 0.8], [0.1, 0.1]], &upright), None);
    assert_eq!(flat([[0.1, 0.1], [0.1, 0.1], [0.8, 0.1]], &upright), None);
    assert_eq!(flat([[0.1, 0.1], [0.4, 0.1], [0.1, 0.1]], &upright), None);
    // Boxes, and clouds that touch the side of their domain, say nothing.
    assert_eq!(flat([[1.0; 2]; 3], &upright), None);
    assert_eq!(flat([[0.1, 0.3], [0.8, 0.1], [0.1, 0.1]], &upright), None);
    // Turned upright by the transform; and the other way round.
    let turned = Transform { axes: [[0.1, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, -0.1, 0.0]], ..upright.clone() };
    assert_eq!(flat(base, &turned), None);
    assert_eq!(flat([[0.1, 0.1], [0.1, 0.1], [0.1, 0.8]], &turned), Some(0.8));
    let leaning = Transform { axes: [[0.1, 0.0, 0.0], [0.0, 0.08, 0.06], [0.0, -0.06, 0.08]], ..upright };
    assert_eq!(flat(base, &leaning), None);
}

#[test]
fn names() {
    let named = |name: &str| Grid { name: name.into(), ..cloud() };
    assert_eq!(found(&[]), ["!no-grid"]);
    assert_eq!(found(&[named("smoke")]), ["!no-density"]);
    assert_eq!(found(&[named("Density")]), ["!no-density"]);
    assert_eq!(found(&[named("")]), ["!unnamed"]);
    assert_eq!(found(&[named(""), cloud()]), ["unnamed"]);
    assert_eq!(found(&[cloud(), cloud()]), ["!same-name"]);
    assert_eq!(found(&[cloud(), named("heat"), named("heat")]), ["same-name"]);
    assert_eq!(one(Grid { value_type: "vec3s".into(), ..cloud() }), ["vectors"]);
    let points = Grid { value_type: "Tree_ptdataidx32_5_4_3".into(), unread: Some(Unread::Type), values: None, ..cloud() };
    assert_eq!(one(points), ["!type"]);
    let damaged = Grid { unread: Some(Unread::Damaged("it ends early".into())), values: None, ..cloud() };
    assert_eq!(one(damaged), ["!damaged"]);
    // Who is meant.
    let vel = Grid { value_type: "vec3s".into(), ..named("vel") };
    let set = Grid { class: "level set".into(), ..named("surface") };
    let many = [set, vel, named("heat"), named("Smoke_Density"), named("other")];
    assert_eq!(chosen(&many).unwrap().name, "Smoke_Density");
    assert_eq!(chosen(&many[..3]).unwrap().name, "heat");
    assert!(chosen(&[]).is_none());
}

#[test]
fn numbers_of_sequences_come_last() {
    let judged = |stem: &str, others: &[&str]| {
        let names: BTreeSet<String> = others.iter().chain([&stem]).map(|s| s.to_string()).collect();
        better(stem, &names).map(|(name, _)| name)
    };
    assert_eq!(judged("smoke_0001_density", &["smoke_0002_density"]).unwrap(), "smoke_density.0001.vdb");
    assert_eq!(judged("smoke_0010_v2", &["smoke_0009_v2"]).unwrap(), "smoke_v2.0010.vdb");
    assert_eq!(judged("9.smoke", &["10.smoke"]).unwrap(), "smoke.9.vdb");
    assert_eq!(judged("1é2", &["2é2"]).unwrap(), "é2.1.vdb");
    let quiet: [(&str, &[&str]); 8] = [
        ("smoke.0001", &["smoke.0002"]),
        ("smoke_0001", &["smoke_0002"]),
        ("smoke_0001_density", &["smoke_0003_density"]),
        ("smoke_0001_density", &["fire_0002_density"]),
        ("cloud_v1_low", &["cloud_v2_low"]),
        // Takes beside each other, each with its frames.
        ("take2_0001", &["take3_0001", "take2_0002"]),
        ("cloud", &["clouds"]),
        ("99999999999999999999999_x", &["1_x"]),
    ];
    for (stem, others) in quiet {
        assert_eq!(judged(stem, others), None, "{stem}");
    }
}

#[test]
fn figures_are_short() {
    let shown = [0.0, 1.0, 0.0525, 41.26, 5263.0, 1.2e6, 65504.0, 0.001, 0.00012, -0.3, 999.6, 1e-300].map(figure);
    assert_eq!(shown, ["0", "1", "0.0525", "41.3", "5263", "1.2e6", "65504", "0.001", "1.2e-4", "-0.3", "1000", "1e-300"]);
    assert_eq!([figure(f64::NAN), figure(f64::INFINITY)], ["NaN", "inf"]);
    assert_eq!([size(640.0), size(12_345.0), size(4.5e9)], ["640 bytes", "12.3 kB", "4.5 GB"]);
    assert_eq!([count(1, "value"), count(2, "value")], ["1 value", "2 values"]);
}
