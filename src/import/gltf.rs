//! What each node becomes: the rules, in the order in which they hold.

use super::{
    Became, ImportOptions, Layout,
    at::At,
    buffers::Buffers,
    build::Builder,
    container::Document,
    extras::{self, ShapeKind, Spec},
    instances, json,
    mesh::Form,
    metaballs, region,
    walk::{self, Visit, node_at},
};
use crate::{
    Result,
    progress::Progress,
    sculpt::{Solid, visible_radius},
};
use glam::{DAffine3, DVec3};
use std::path::Path;

/// Reads the scene out of a parsed file.
pub(super) fn layout(file: &Path, document: &Document, options: &ImportOptions, progress: &dyn Progress) -> Result<Layout> {
    let root = &document.root;
    let mut builder = Builder::new(file, root, options, Buffers::new(file, document));
    let (scene, roots) = walk::roots(file, root)?;
    if let Some((index, scene)) = scene {
        let at = At { file, kind: "scene", index, name: scene.name.as_deref() };
        builder.scene_spec = extras::scene_spec(scene.extras.as_ref(), at, &mut builder.notes)?;
    }
    let visits = walk::walk(file, root, &roots, options.regions.as_deref())?;
    builder.scene.air = builder.scene_spec.air.unwrap_or_default();
    builder.summarise(&visits);
    for visit in &visits {
        if let Some(node) = root.nodes.get(visit.node) {
            builder.node(visit, node)?;
        }
    }
    builder.strays(&visits);
    if !builder.findings.iter().any(|f| f.became == Became::Sun) {
        let lamps = builder.scene.lamps.len();
        if lamps > 0 && options.overrides.sun.is_none() {
            builder.scene.sun.irradiance = [0.0; 3];
            builder.notes.push(format!(
                "No sun (a directional light), and {lamps} lamps: none is assumed, the lamps are the light. --sun gives one."
            ));
        } else if builder.shines() && options.overrides.sun.is_none() {
            builder.scene.sun.irradiance = [0.0; 3];
            builder
                .notes
                .push("No sun (a directional light): none is assumed, what shines is the light. --sun and --irradiance give one.".into());
        } else if options.overrides.sun.is_none() {
            builder.notes.push("No sun (a directional light): one 45 degrees high in the south-west, 1 W/m^2, is assumed. In Blender, add a Sun and tick Punctual Lights when you export.".into());
        }
        if let Some(angle) = builder.scene_spec.sun_angle {
            builder.scene.sun.angular_diameter = angle;
        }
    }
    if let Some(pattern) = options.regions.as_deref().filter(|_| !visits.iter().any(|visit| visit.picked)) {
        builder.notes.push(format!("--regions {pattern:?} matches no node's name."));
    }
    builder.finish(document.hash.clone(), progress)
}

/// One thing to place: a node, or one of its instances.
pub(super) struct Thing<'a> {
    pub at: At<'a>,
    /// From its own space, Y up, to the world.
    pub world: DAffine3,
    picked: bool,
    pub mesh: Option<usize>,
    pub spec: &'a Spec,
}

impl<'a> Builder<'a> {
    fn node(&mut self, visit: &Visit, node: &'a json::Node) -> Result<()> {
        let at = node_at(self.file, visit.node, node);
        let spec = extras::spec(node.extras.as_ref(), at, &mut self.notes)?;
        if spec.as_ref().is_some_and(|spec| spec.shape == Some(ShapeKind::Ignore)) {
            self.found(at.name(), Became::Ignored, "its extras say \"ignore\"");
            return Ok(());
        }
        let extensions = node.extensions.as_deref();
        if let Some(light) = extensions.and_then(|e| e.light.as_ref()) {
            self.light(visit, light.light, spec.as_ref().and_then(|spec| spec.lamp_radius), at)?;
        }
        if let Some(camera) = node.camera {
            self.camera(visit, camera, at)?;
        }
        if let Some(value) = extensions.and_then(|e| e.metaballs.as_ref()) {
            return self.metaballs(visit, value, &spec.unwrap_or_default(), at);
        }
        let said = spec.is_some();
        let spec = spec.unwrap_or_default();
        let mut thing = Thing { at, world: visit.world, picked: visit.picked, mesh: node.mesh, spec: &spec };
        match extensions.and_then(|e| e.instancing.as_ref()).filter(|_| node.mesh.is_some()) {
            Some(instancing) => {
                for (i, transform) in instances::transforms(&self.buffers, instancing, at)?.into_iter().enumerate() {
                    let name = format!("{}[{i}]", at.name());
                    thing.world = visit.world * transform;
                    self.place(&Thing { at: At { name: Some(&name), ..at }, ..thing })?;
                }
                Ok(())
            }
            None if node.mesh.is_some() || thing.spec.shape.is_some() => self.place(&thing),
            None => {
                let bare = node.camera.is_none() && extensions.is_none_or(|e| e.light.is_none());
                // What a lamp's extras say is said of the lamp.
                let lamp = extensions.is_some_and(|e| e.light.is_some())
                    && *thing.spec == Spec { lamp_radius: spec.lamp_radius, ..Spec::default() };
                self.empty(node, bare, (said && !lamp).then_some(&spec), at);
                Ok(())
            }
        }
    }

    fn place(&mut self, thing: &Thing) -> Result<()> {
        let Thing { at, world, spec, .. } = thing;
        let Some(shape) = spec.shape else { return self.plain(thing) };
        if shape == ShapeKind::Vdb {
            return self.volume(thing);
        }
        let summary = thing.mesh.map(|mesh| self.summary(mesh, *at)).transpose()?;
        if shape == ShapeKind::Surface {
            return match summary.map(|s| s.form) {
                None | Some(Form::Nothing(_)) => {
                    let fix = "Put it on an object with a mesh";
                    Err(at.error("extras.cloudvdb.shape", "\"surface\" on a node without triangles", "a node with a mesh", fix))
                }
                Some(_) => self.surface(thing, "its extras say \"surface\""),
            };
        }
        region::check_scale(world, *at)?;
        let mut why = format!("its extras say {:?}", ShapeKind::NAMES.iter().find(|(_, kind)| *kind == shape).map_or("", |(name, _)| name));
        let shape = match (shape, summary) {
            (ShapeKind::Slab, summary) => region::slab(world, summary.as_ref(), spec.half_height, *at)?,
            (ShapeKind::Mesh, Some(summary)) => return self.closed_mesh(thing, summary.form, summary.material, why),
            (ShapeKind::Mesh, None) => {
                return Err(at.error(
                    "extras.cloudvdb.shape",
                    "\"mesh\" on a node without a mesh",
                    "a node with a closed mesh",
                    "Put it on the object that has the mesh",
                ));
            }
            (ShapeKind::Metaball, _) => {
                let threshold = spec.threshold.unwrap_or(metaballs::THRESHOLD);
                let stiffness = spec.stiffness.unwrap_or(metaballs::STIFFNESS);
                let radius = visible_radius(spec.radius.unwrap_or(1.0), threshold, stiffness).ok_or_else(|| {
                    let fix = "Raise the stiffness or lower the threshold";
                    at.error("extras.cloudvdb.stiffness", stiffness.to_string(), format!("more than the threshold, {threshold}"), fix)
                })?;
                why += &format!("; a sphere of its visible radius, {radius:.6} in the node's space");
                region::ball(world, DVec3::ZERO, radius)
            }
            (_, Some(mesh)) if spec.radius.is_none() => match mesh.form {
                Form::Ellipsoid(fit) => region::ellipsoid(world, fit),
                _ if mesh.reach > 0.0 => {
                    why += "; not sphere-like, so the sphere around its mesh";
                    region::ball(world, mesh.bounds.centre(), mesh.reach)
                }
                _ => region::ball(world, DVec3::ZERO, 1.0),
            },
            _ => region::ball(world, DVec3::ZERO, spec.radius.unwrap_or(1.0)),
        };
        let material = self.material_medium(summary.and_then(|s| s.material), *at)?;
        self.region(at.name(), Solid::Shape(shape), spec, &material);
        self.found(at.name(), Became::Region, why);
        Ok(())
    }

    /// A mesh that says nothing about its shape.
    fn plain(&mut self, thing: &Thing) -> Result<()> {
        let Thing { at, world, picked, spec, .. } = *thing;
        let Some(mesh) = thing.mesh else { return Ok(()) };
        let summary = self.summary(mesh, at)?;
        let material = self.material_medium(summary.material, at)?;
        let medium = !spec.medium.is_empty() || !material.is_empty();
        if spec.radius.is_some() || spec.half_height.is_some() || spec.file.is_some() {
            self.notes.push(format!("{at}: extras.cloudvdb has a radius, half_height or file but no shape, so they were not used."));
        }
        match summary.form {
            Form::Nothing(skipped) => {
                let why = format!("its mesh has no triangles ({skipped} primitives of points or lines)");
                self.found(at.name(), Became::Ignored, why);
                Ok(())
            }
            Form::Ellipsoid(fit) if picked => {
                region::check_scale(&world, at)?;
                self.region(at.name(), Solid::Shape(region::ellipsoid(&world, fit)), spec, &material);
                self.found(at.name(), Became::Region, "its mesh is sphere-like");
                Ok(())
            }
            Form::Ellipsoid(_) => self.surface(thing, "sphere-like, but no name on its path matches --regions"),
            Form::Closed if picked && (self.options.mesh_volumes || medium) => {
                region::check_scale(&world, at)?;
                let why = if medium { "its mesh is closed and has a medium" } else { "its mesh is closed (--mesh-volumes)" };
                self.closed_mesh(thing, summary.form, summary.material, why.into())
            }
            Form::Closed if self.options.mesh_volumes => self.surface(thing, "closed, but no name on its path matches --regions"),
            Form::Closed => self.surface(thing, "closed but not sphere-like: a surface; --mesh-volumes makes it a cloud"),
            Form::Open(_, true) if picked && (self.options.mesh_volumes || medium) => {
                region::check_scale(&world, at)?;
                self.closed_mesh(thing, summary.form, summary.material, "its mesh is almost closed and has a medium".into())
            }
            Form::Flat | Form::Open(..) => {
                if medium {
                    self.tally("A medium is given, but the mesh is open or flat and became a surface:", at);
                }
                self.surface(thing, if summary.form == Form::Flat { "its mesh is flat" } else { "its mesh is open" })
            }
        }
    }

    fn closed_mesh(&mut self, thing: &Thing, form: Form, material: Option<usize>, why: String) -> Result<()> {
        let at = thing.at;
        let refused = |found: String, fix: &str| Err(at.error("mesh", found, "a closed mesh", fix));
        match form {
            Form::Open(1, false) => {
                return refused(
                    "open: 1 edge is not shared by two faces".into(),
                    "Close it in Blender (Edit Mode: Mesh > Clean Up > Fill Holes)",
                );
            }
            Form::Open(edges, false) => {
                let found = format!("open: {edges} edges are not shared by two faces");
                return refused(found, "Close it in Blender (Edit Mode: Mesh > Clean Up > Fill Holes)");
            }
            Form::Flat => {
                return refused(
                    "flat: it has no volume".into(),
                    "Give it a volume (a Solidify modifier), or remove the shape from its extras",
                );
            }
            Form::Nothing(_) => return refused("without triangles".into(), "Give it faces, or remove the shape from its extras"),
            Form::Ellipsoid(_) | Form::Closed | Form::Open(_, true) => {}
        }
        if let Some(mesh) = thing.mesh {
            let material = self.material_medium(material, at)?;
            self.closed(mesh, thing, &material)?;
            self.found(at.name(), Became::Region, why);
        }
        Ok(())
    }

    fn surface(&mut self, thing: &Thing, why: &str) -> Result<()> {
        region::check_zero(&thing.world, thing.at)?;
        if let Some(mesh) = thing.mesh {
            self.surfaces(mesh, thing.world, thing.at)?;
            self.found(thing.at.name(), Became::Surface, why);
        }
        Ok(())
    }

    /// Adds a node's elements to its family, which becomes a region when all are known.
    fn metaballs(&mut self, visit: &Visit, value: &serde_json::Value, spec: &Spec, at: At) -> Result<()> {
        region::check_zero(&visit.world, at)?;
        let balls = metaballs::read(value, &visit.world, at)?;
        let why = format!("metaballs of the family {:?}: {} elements", balls.family, balls.elements.len());
        if balls.elements.is_empty() {
            self.found(at.name(), Became::Ignored, "a metaball without elements");
            return Ok(());
        }
        self.found(at.name(), Became::Region, why);
        self.family(balls, spec);
        Ok(())
    }

    /// A node without a mesh and without a shape.
    fn empty(&mut self, node: &json::Node, bare: bool, said: Option<&Spec>, at: At) {
        if let Some(spec) = said {
            let shape = if spec.file.is_some() { "vdb" } else { "sphere" };
            self.found(at.name(), Became::Ignored, "its extras.cloudvdb names no shape, and it has no mesh");
            self.notes.push(format!("{at} has extras.cloudvdb but neither a shape nor a mesh, and was ignored: add \"shape\": {shape:?}."));
        } else if bare && node.children.is_empty() {
            let metaball = is_metaball_name(&at.name());
            self.found(at.name(), Became::Ignored, if metaball { "an empty that was a metaball in Blender" } else { "empty" });
            if metaball {
                self.lost_metaballs.push(at.name());
            }
        }
    }

    /// Nodes that are not in the scene that is shown.
    fn strays(&mut self, visits: &[Visit]) {
        let mut shown = vec![false; self.root.nodes.len()];
        for visit in visits {
            if let Some(shown) = shown.get_mut(visit.node) {
                *shown = true;
            }
        }
        for (index, node) in self.root.nodes.iter().enumerate().filter(|(i, _)| shown.get(*i) == Some(&false)) {
            if node.mesh.is_some() || node.camera.is_some() || node.extensions.is_some() || node.extras.is_some() {
                self.found(node_at(self.file, index, node).name(), Became::Ignored, "not in the file's default scene");
            }
        }
    }
}

/// Whether Blender would give this name to a metaball: `Mball`, `Meta`, `MetaBall.001`...
fn is_metaball_name(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    let base = lower.trim_end_matches(|c: char| c.is_ascii_digit() || matches!(c, '.' | '_' | '-' | ' '));
    base == "meta" || base.starts_with("mball") || base.starts_with("metaball")
}
