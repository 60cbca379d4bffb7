//! A grid as the document has it.

use crate::vdb::{Exam, GridContents, Meta, Unread};
use glam::{DAffine3, DVec3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};

/// What is in a grid.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Grid {
    /// The name; may be empty.
    pub name: String,
    /// The type of a value: `float`, `vec3s`, `bool`.
    #[serde(rename = "type")]
    pub value_type: String,
    /// `fog volume`, `level set`, `staggered vector field` or `unknown`.
    pub class: String,
    /// Whether values are stored as 16-bit floats.
    pub half: bool,
    /// `blosc` or `zip`, `active mask`; empty where nothing is compressed.
    pub compression: Vec<&'static str>,
    /// What it takes of the file.
    pub bytes: u64,
    /// From index space to the world; absent where that is not affine (a frustum).
    pub transform: Option<Transform>,
    /// What its values are; absent where they cannot be read.
    pub values: Option<Values>,
    /// Its metadata.
    pub metadata: BTreeMap<String, serde_json::Value>,
    /// Why its values cannot be read.
    #[serde(skip)]
    pub unread: Option<Unread>,
}

/// An affine transform from index space to the world.
#[derive(Debug, Clone, Serialize)]
pub struct Transform {
    /// Where an index moves by one along each axis: three columns, in metres.
    pub axes: [[f64; 3]; 3],
    /// Where index (0, 0, 0) is.
    pub origin: [f64; 3],
    /// The lengths of a voxel's edges, in metres.
    pub voxel: [f64; 3],
}

impl Transform {
    fn of(affine: &DAffine3) -> Self {
        let m = affine.matrix3;
        let axes = [m.x_axis, m.y_axis, m.z_axis];
        Transform { axes: axes.map(|axis| axis.to_array()), origin: affine.translation.to_array(), voxel: axes.map(DVec3::length) }
    }

    /// The same as glam's.
    pub fn affine(&self) -> DAffine3 {
        let [x, y, z] = self.axes.map(DVec3::from_array);
        DAffine3::from_cols(x, y, z, DVec3::from_array(self.origin))
    }
}

/// What a grid's values are.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Values {
    /// What a look at every one of them found.
    #[serde(flatten)]
    pub exam: Exam,
    /// The corners of what active voxels fill in the world, in metres; absent for a frustum.
    pub world_box: Option<[[f64; 3]; 2]>,
    /// The box as dense 32-bit floats, in bytes: what the viewport and EEVEE make of it.
    pub dense_bytes: f64,
}

impl Deref for Values {
    type Target = Exam;

    fn deref(&self) -> &Exam {
        &self.exam
    }
}

impl DerefMut for Values {
    fn deref_mut(&mut self) -> &mut Exam {
        &mut self.exam
    }
}

impl Values {
    /// Voxels along the sides of the box of active ones.
    pub fn sides(&self) -> Option<[i64; 3]> {
        let [min, max] = self.index_box?;
        Some(std::array::from_fn(|a| i64::from(max[a]) - i64::from(min[a]) + 1))
    }
}

impl Grid {
    /// What the file and a look at its values say.
    pub fn of(contents: GridContents) -> Self {
        let GridContents { info, compression, bytes, exam } = contents;
        let channels = if info.value_type.starts_with("vec") { 3.0 } else { 1.0 };
        let (exam, unread) = exam.map_or_else(|unread| (None, Some(unread)), |exam| (Some(exam), None));
        let values = exam.map(|exam| values(exam, info.world_from_index.as_ref(), channels));
        Grid {
            name: info.name,
            value_type: info.value_type,
            class: info.class,
            half: info.saved_as_half,
            compression,
            bytes,
            transform: info.world_from_index.as_ref().map(Transform::of),
            values,
            metadata: metadata(&info.metadata),
            unread,
        }
    }

    /// Whether its values are distances to a surface: by its class, or because they go through 0 and end at a background above it.
    pub fn is_level_set(&self) -> bool {
        let by_values = |v: &Values| v.lowest < 0.0 && v.highest > 0.0 && v.background > 0.0 && v.background >= v.highest;
        self.class == "level set" || (self.class == "unknown" && self.values.as_ref().is_some_and(by_values))
    }

    /// Whether a sample is three numbers.
    pub fn is_vector(&self) -> bool {
        self.value_type.starts_with("vec")
    }
}

fn values(exam: Exam, world: Option<&DAffine3>, channels: f64) -> Values {
    let mut values = Values { exam, ..Values::default() };
    values.dense_bytes = values.sides().map_or(0.0, |sides| sides.iter().map(|&s| s as f64).product::<f64>() * 4.0 * channels);
    values.world_box = values.index_box.zip(world).map(|(ends, world)| {
        // Voxels reach half an edge beyond their samples.
        let corner = |i: usize| DVec3::from_array(std::array::from_fn(|a| f64::from(ends[i >> a & 1][a]) + (i >> a & 1) as f64 - 0.5));
        let corners = (0..8).map(|i| world.transform_point3(corner(i)));
        let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        [low.to_array(), high.to_array()]
    });
    values
}

/// Metadata as JSON.
pub fn metadata(all: &[(String, Meta)]) -> BTreeMap<String, serde_json::Value> {
    let value = |meta: &Meta| match meta {
        Meta::Text(text) => text.as_str().into(),
        Meta::Int(whole) => (*whole).into(),
        Meta::Float(real) => (*real).into(),
    };
    all.iter().map(|(key, meta)| (key.clone(), value(meta))).collect()
}
