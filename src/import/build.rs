//! The scene as it grows while nodes are visited.

use super::{
    Became, Finding, ImportOptions, Layout,
    at::{At, file_error},
    buffers::Buffers,
    extras::{self, SceneSpec, Spec},
    fire::Ember,
    gltf::Thing,
    json,
    medium::{Filling, MediumSpec, Shining},
    mend::Mended,
    mesh::{self, RawMesh, Summary},
    metaballs::Balls,
    settle::{self, Draft},
    vdb,
    walk::{Visit, node_at},
};
use crate::{
    Error, Result,
    progress::Progress,
    scene::{Scene, Shape, Surface},
    sculpt::{Element, Metaballs, Solid},
};
use glam::DAffine3;
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// The albedo of a surface whose material gives none.
const GREY: f64 = 0.8;
/// A mesh that encloses more than this share of its volume twice passes through itself: less is what counting by lines may err.
const THROUGH: f64 = 0.02;
/// The most vertices of surfaces and mesh regions, instances included.
const MAX_VERTICES: usize = 100_000_000;

/// What is known so far.
pub(super) struct Builder<'a> {
    pub file: &'a Path,
    pub root: &'a json::Root,
    pub options: &'a ImportOptions,
    pub buffers: Buffers<'a>,
    pub scene_spec: SceneSpec,
    pub scene: Scene,
    pub findings: Vec<Finding>,
    pub notes: Vec<String>,
    /// Names of empty nodes that were metaballs in Blender.
    pub lost_metaballs: Vec<String>,
    /// The VDBs that nodes name, each once, with the SHA-256 of their bytes.
    pub volumes: Vec<(PathBuf, String)>,
    /// Grids of theirs that shine.
    pub embers: Vec<Ember>,
    drafts: Vec<Draft>,
    families: Vec<Family>,
    summaries: Vec<Option<Result<Summary>>>,
    last_mesh: Option<(usize, RawMesh)>,
    materials: Vec<Option<MediumSpec>>,
    vertices: usize,
    /// Assumptions that many nodes may share: how many, and the first one's name.
    tallies: BTreeMap<&'static str, (usize, String)>,
}

/// A family of metaballs as its nodes are found: the object with the lowest number says threshold and medium.
struct Family {
    name: String,
    number: u64,
    threshold: f64,
    elements: Vec<Element>,
    draft: usize,
}

impl<'a> Builder<'a> {
    pub fn new(file: &'a Path, root: &'a json::Root, options: &'a ImportOptions, buffers: Buffers<'a>) -> Self {
        Builder {
            file,
            root,
            options,
            buffers,
            scene_spec: SceneSpec::default(),
            scene: Scene::default(),
            findings: Vec::new(),
            notes: Vec::new(),
            lost_metaballs: Vec::new(),
            volumes: Vec::new(),
            embers: Vec::new(),
            drafts: Vec::new(),
            families: Vec::new(),
            summaries: Vec::new(),
            last_mesh: None,
            materials: vec![None; root.materials.len()],
            vertices: 0,
            tallies: BTreeMap::new(),
        }
    }

    /// Looks at each mesh once, however many nodes share it, on all cores.
    pub fn summarise(&mut self, visits: &[Visit]) {
        let mut first_user = vec![None; self.root.meshes.len()];
        for visit in visits {
            let node = self.root.nodes.get(visit.node);
            if let Some(user) = node.and_then(|node| node.mesh).and_then(|mesh| first_user.get_mut(mesh)) {
                user.get_or_insert(visit.node);
            }
        }
        let (file, buffers) = (self.file, &self.buffers);
        let look = |(mesh, user): (usize, &Option<usize>)| {
            let node = user.and_then(|user| Some((user, buffers.root.nodes.get(user)?)));
            node.map(|(user, node)| Ok(mesh::summary(&mesh::read(buffers, mesh, node_at(file, user, node))?)))
        };
        self.summaries = first_user.par_iter().enumerate().map(look).collect();
    }

    /// What a mesh is.
    pub fn summary(&mut self, mesh: usize, at: At) -> Result<Summary> {
        match self.summaries.get_mut(mesh) {
            Some(Some(Ok(summary))) => Ok(*summary),
            // An error ends the import: it is told once.
            Some(slot @ Some(Err(_))) => slot.take().unwrap_or_else(|| Ok(mesh::summary(&RawMesh::default()))),
            _ => Ok(mesh::summary(&mesh::read(&self.buffers, mesh, at)?)),
        }
    }

    pub fn found(&mut self, node: String, became: Became, why: impl Into<String>) {
        self.findings.push(Finding { node, became, why: why.into() });
    }

    /// Counts an assumption; the sentence goes on with the number of nodes and the first one's name.
    pub fn tally(&mut self, sentence: &'static str, at: At) {
        self.tallies.entry(sentence).or_insert_with(|| (0, at.name())).0 += 1;
    }

    /// What a material says about its medium.
    pub fn material_medium(&mut self, material: Option<usize>, at: At) -> Result<MediumSpec> {
        let Some(index) = material else { return Ok(MediumSpec::default()) };
        let material = self.material(index, at)?;
        if let Some(Some(known)) = self.materials.get(index) {
            return Ok(*known);
        }
        let at = self.material_at(index, material);
        let spec = extras::spec(material.extras.as_ref(), at, &mut self.notes)?.unwrap_or_default();
        if spec.shape.is_some() || spec.radius.is_some() || spec.half_height.is_some() || spec.file.is_some() {
            self.notes.push(format!("{at}: shape, file, radius and half_height mean nothing on a material; they belong on the node."));
        }
        if let Some(slot) = self.materials.get_mut(index) {
            *slot = Some(spec.medium);
        }
        Ok(spec.medium)
    }

    fn material(&self, index: usize, at: At) -> Result<&'a json::Material> {
        let count = self.root.materials.len();
        let missing = || at.error("material", index.to_string(), format!("one of the file's {count} materials"), "Export the file again");
        self.root.materials.get(index).ok_or_else(missing)
    }

    fn material_at(&self, index: usize, material: &'a json::Material) -> At<'a> {
        At { file: self.file, kind: "material", index, name: material.name.as_deref() }
    }

    /// Adds a region; its medium is settled when all are known. `inner` is what its material says, or its VDB.
    pub fn region(&mut self, name: String, solid: Solid, node: &Spec, inner: &MediumSpec) {
        let draft = self.draft(name, solid, node, inner);
        self.drafts.push(draft);
    }

    /// How a node shines, which its scene may say too.
    pub fn shining(&self, node: &Spec) -> Shining {
        Filling::new(&[self.scene_spec.medium, node.medium]).shining()
    }

    fn draft(&self, name: String, solid: Solid, node: &Spec, inner: &MediumSpec) -> Draft {
        let filling = Filling::new(&[self.scene_spec.medium, *inner, node.medium]);
        let detail = self.options.detail.or(node.detail).or(self.scene_spec.detail).flatten();
        Draft { name, solid, filling, detail, falloff: node.falloff.unwrap_or(0.0), tangled: false, dark: node.names_fire() }
    }

    /// Adds an object's metaballs to their family.
    pub fn family(&mut self, balls: Balls, node: &Spec) {
        let Balls { family: name, number, threshold, elements } = balls;
        let Some(known) = self.families.iter().position(|family| family.name == name) else {
            // The elements come when all are known.
            let nothing = Solid::Metaballs(Arc::new(Metaballs { threshold, elements: Vec::new() }));
            self.region(name.clone(), nothing, node, &MediumSpec::default());
            return self.families.push(Family { name, number, threshold, elements, draft: self.drafts.len() - 1 });
        };
        let draft = self.families.get(known).filter(|family| number < family.number).map(|family| family.draft);
        let basis = draft.and_then(|i| Some((i, self.draft(name, self.drafts.get(i)?.solid.clone(), node, &MediumSpec::default()))));
        let Some(family) = self.families.get_mut(known) else { return };
        family.elements.extend(elements);
        if let Some((i, draft)) = basis {
            (family.number, family.threshold) = (number, threshold);
            self.drafts[i] = draft;
        }
    }

    /// Adds a closed mesh, or one that was mended, as a region. One that passes through itself becomes voxels, which count what it
    /// encloses once.
    pub fn closed(&mut self, mesh: usize, thing: &Thing, inner: &MediumSpec) -> Result<()> {
        let at = thing.at;
        let (solid, mended) = mesh::solid(self.raw(mesh, at)?, thing.world);
        if mended != Mended::default() {
            let Mended { turned, caps } = mended;
            self.notes.push(format!("{at}: its mesh was mended: {caps} holes were capped, {turned} faces turned over."));
        }
        let overlap = mesh::overlap(&solid);
        let mut draft = self.draft(at.name(), Solid::Shape(Shape::Mesh(solid.into())), thing.spec, inner);
        if overlap > THROUGH {
            self.notes.push(format!(
                "{at}: its mesh passes through itself ({:.0} % of its volume is enclosed more than once); what it encloses counts once.",
                100.0 * overlap
            ));
            draft.tangled = true;
        }
        self.drafts.push(draft);
        Ok(())
    }

    /// Adds a surface for each material of a mesh.
    pub fn surfaces(&mut self, mesh: usize, world: DAffine3, at: At) -> Result<()> {
        let raw = self.raw(mesh, at)?;
        let parts: Vec<_> = raw.parts.iter().filter(|p| !p.triangles.is_empty()).map(|p| (p.material, mesh::part(raw, p, world))).collect();
        if raw.skipped > 0 {
            self.tally("Points and lines, which are no surface, were left out of", at);
        }
        for (material, mesh) in parts {
            let albedo = self.albedo(material, at)?;
            self.scene.surfaces.push(Surface { name: at.name(), mesh, albedo });
        }
        Ok(())
    }

    fn raw(&mut self, mesh: usize, at: At) -> Result<&RawMesh> {
        if self.last_mesh.as_ref().is_none_or(|(known, _)| *known != mesh) {
            self.last_mesh = Some((mesh, mesh::read(&self.buffers, mesh, at)?));
        }
        let raw = self.last_mesh.get_or_insert_default();
        self.vertices = self.vertices.saturating_add(raw.1.points.len());
        if self.vertices > MAX_VERTICES {
            let reason = format!("its surfaces have more than {MAX_VERTICES} vertices, instances included ({at} is one too many)");
            return Err(file_error(self.file, reason, "Decimate the meshes, or leave out what light does not need"));
        }
        Ok(&raw.1)
    }

    fn albedo(&mut self, material: Option<usize>, at: At) -> Result<[f64; 3]> {
        let unsaid = "No base colour is given, and albedo 0.8 was assumed, for";
        let Some(index) = material else {
            self.tally(unsaid, at);
            return Ok([GREY; 3]);
        };
        let material = self.material(index, at)?;
        let pbr = material.pbr_metallic_roughness.as_ref();
        if pbr.is_some_and(|pbr| pbr.base_color_texture.is_some()) {
            self.tally("Textures are not read: only the base colour factor counts for", at);
        }
        let Some(factor) = pbr.and_then(|pbr| pbr.base_color_factor.as_ref()) else {
            self.tally(unsaid, at);
            return Ok([GREY; 3]);
        };
        let [r, g, b, _] = super::walk::numbers(factor, "baseColorFactor", self.material_at(index, material))?;
        Ok([r, g, b].map(|c: f64| c.clamp(0.0, 1.0)))
    }

    /// Settles the media and closes the account.
    pub fn finish(mut self, source_hash: String, progress: &dyn Progress) -> Result<Layout> {
        if self.drafts.is_empty() {
            return Err(self.nothing_found());
        }
        for Family { threshold, elements, draft, .. } in std::mem::take(&mut self.families) {
            self.drafts[draft].solid = Solid::Metaballs(Arc::new(Metaballs { threshold, elements }));
        }
        let (regions, embers) = settle::settle(std::mem::take(&mut self.drafts), self.options, &mut self.notes, progress)?;
        self.scene.regions = regions;
        self.embers.extend(embers);
        if self.scene.regions.is_empty() {
            return Err(self.nothing_found());
        }
        for (sentence, (count, first)) in &self.tallies {
            let others = if *count > 1 { format!(" and {} more", count - 1) } else { String::new() };
            self.notes.push(format!("{sentence} {first:?}{others}."));
        }
        for name in &self.lost_metaballs {
            self.notes.push(format!(
                "Node {name:?} is empty, and has a metaball's name: Blender's glTF exporter drops metaballs and leaves an empty node. \
                 Convert it first (Object > Convert > Mesh)."
            ));
        }
        let source_hash = match self.volumes.is_empty() {
            true => source_hash,
            false => vdb::hex(self.volumes.iter().fold(Sha256::new_with_prefix(source_hash), |all, (_, hash)| all.chain_update(hash))),
        };
        let volumes = self.volumes.into_iter().map(|(path, _)| path).collect();
        Ok(Layout {
            scene: self.scene,
            sky: self.scene_spec.sky,
            embers: self.embers,
            findings: self.findings,
            notes: self.notes,
            source_hash,
            volumes,
        })
    }

    /// Whether anything shines by itself.
    pub fn shines(&self) -> bool {
        !self.embers.is_empty() || self.drafts.iter().any(|draft| draft.filling.shining().shines())
    }

    fn nothing_found(&self) -> Error {
        let count = |became: Became| self.findings.iter().filter(|f| f.became == became).count();
        let ignored: Vec<String> = self.findings.iter().filter(|f| f.became == Became::Ignored).map(|f| format!("{:?}", f.node)).collect();
        let kinds = [
            (Became::Surface, "surface"),
            (Became::Sun, "sun"),
            (Became::Lamp, "lamp"),
            (Became::Flame, "flame"),
            (Became::Camera, "camera"),
            (Became::Ignored, "ignored node"),
        ];
        let plural = |(became, word)| match count(became) {
            0 => None,
            1 => Some(format!("1 {word}")),
            n => Some(format!("{n} {word}s")),
        };
        let instead: Vec<String> = kinds.into_iter().filter_map(plural).collect();
        let instead = if instead.is_empty() { "nothing else either".into() } else { format!("only {}", instead.join(", ")) };
        let mut reason = format!("it holds no region of cloud, {instead}");
        if !ignored.is_empty() {
            let more = if ignored.len() > 5 { ", ..." } else { "" };
            reason += &format!(" ({}{more})", ignored.iter().take(5).cloned().collect::<Vec<_>>().join(", "));
        }
        if let Some(name) = self.lost_metaballs.first() {
            reason += &format!("; node {name:?} was a metaball in Blender, whose glTF exporter drops metaballs");
        }
        if let Some(pattern) = &self.options.regions {
            reason += &format!("; --regions {pattern:?} picks among sphere-like and closed meshes");
        }
        let fix = "A region can be: a sphere-like mesh (UV sphere, icosphere, scaled or not); a node with the custom property \
                   `cloudvdb`, such as {\"shape\": \"sphere\", \"radius\": 1}; a metaball \
                   converted to a mesh (Object > Convert > Mesh); a closed mesh with --mesh-volumes; a node that names a VDB, \
                   {\"shape\": \"vdb\", \"file\": \"smoke.vdb\"}";
        file_error(self.file, reason, fix)
    }
}
