//! Ways of light from the camera: through media, where light is looked up, and off surfaces.

use super::field::{Field, Found};
use super::orders::Through;
use super::{Channel, Room};
use crate::geom::Ray;
use crate::integrate::lens::{Stratum, View};
use crate::integrate::tile::{Arrival, Layer};
use crate::rng::Rng;
use crate::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};
use glam::Vec3;

/// The chance of a collision in a slice of the march; and of those off surfaces.
const SLICE: f64 = 0.125;
const COARSE: f64 = 0.5;
/// And of light that is seen through similar media.
const SIMILAR: f64 = 0.25;
/// Up to this optical depth extinction in grids is integrated exactly; behind it is little light, and that of similar media is even.
const EXACT: f64 = 8.0;
/// Beyond this optical depth nothing is seen.
const OPAQUE: f64 = 14.0;
/// Nor behind so much of similar media.
const HAZY: f64 = 7.0;

/// What of the light on a way is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Counted {
    All,
    /// What media send: regions, air and flames.
    Media,
    /// The rest: what surfaces get from elsewhere, and the sky.
    Rest,
}

/// What a stretch of a ray brings.
#[derive(Debug, Default)]
struct Stretch {
    direct: Vec3,
    found: Found,
    clear: f64,
    /// The mean distance of a collision, m, times its chance.
    far: f64,
    looks: u64,
}

impl Channel {
    /// What arrives along a camera ray, or from the sky behind.
    pub(super) fn radiance(&self, view: &View, rng: &mut Rng, room: &mut Room) -> Arrival {
        self.walk(view.ray, view.stratum, (view.reach, Layer::Environment, Counted::All), rng, room)
    }

    /// What media send to a white surface at `p` from one direction, drawn by the cosine: an estimate of the radiance that it sends out; and
    /// how far away the way's first event is.
    pub(super) fn cast_on(&self, p: Vec3, normal: Vec3, rng: &mut Rng, room: &mut Room) -> Arrival {
        let direction = cosine_hemisphere(normal, rng.uniform_f32(), rng.uniform_f32());
        self.walk(Ray { origin: p, direction }, Stratum::default(), (f32::INFINITY, Layer::Surface, Counted::Media), rng, room)
    }

    /// What arrives along the first `reach` metres of a ray that came from a `layer`, or from the sky behind.
    fn walk(
        &self,
        mut ray: Ray,
        mut stratum: Stratum,
        (mut reach, mut layer, mut counted): (f32, Layer, Counted),
        rng: &mut Rng,
        room: &mut Room,
    ) -> Arrival {
        let (tracer, band) = (&self.tracer, &self.tracer.bands[0]);
        let (mut arrival, mut throughput, mut own, mut begun) = (Arrival::default(), Vec3::ONE, f64::INFINITY, false);
        loop {
            let hit = tracer.surfaces.nearest(&ray, reach);
            let free = hit.map_or(reach, |h| h.t);
            let air = band.air.transmittance(&ray, free);
            let clear = if counted == Counted::Rest {
                (-band.media.optical_depth(&ray, free, &mut room.scratch)).exp()
            } else {
                let Stretch { far, clear, .. } = self.media((&ray, stratum), free, (layer, throughput), &mut arrival, rng, room);
                if !begun {
                    arrival.depth = hit.map_or((far, 1.0 - clear), |hit| (far + clear * f64::from(hit.t), 1.0));
                    arrival.clear = (clear * f64::from(air.element_sum() / 3.0), if hit.is_some() { 1.0 } else { 0.0 });
                }
                clear
            };
            begun = true;
            throughput *= clear as f32 * air;
            let Some(hit) = hit else {
                if counted != Counted::Media {
                    arrival.light[layer as usize] += throughput * tracer.sky.met(ray.direction, own);
                }
                return arrival;
            };
            throughput *= tracer.albedos[hit.owner as usize];
            // What the camera sees is worth a direction each time; what is seen of that plays roulette.
            let kept = if layer == Layer::Environment { 1.0 } else { throughput.max_element().min(1.0) };
            if throughput == Vec3::ZERO {
                return arrival;
            }
            layer = Layer::Surface;
            let p = hit.off(&ray);
            if counted != Counted::Media {
                let light = tracer.on_surface(band, p, &hit, rng, &mut room.scratch);
                let sky = tracer.sky_on_surface(band, p, &hit, rng, &mut room.scratch);
                arrival.light[layer as usize] += throughput * (light + sky);
            }
            if let Some(cast) = self.cast.as_ref().filter(|_| counted == Counted::All)
                && let Some(found) = cast.on(p, &hit)
            {
                arrival.light[layer as usize] += throughput * found.rgb;
                found.add_to(&mut arrival, throughput);
                counted = Counted::Rest;
            }
            if rng.uniform_f32() >= kept {
                return arrival;
            }
            throughput /= kept;
            ray = Ray { origin: p, direction: cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32()) };
            own = cosine_hemisphere_pdf(ray.direction.dot(hit.normal)).into();
            (reach, stratum) = (f32::INFINITY, Stratum::default());
        }
    }

    /// Adds what media along the first `reach` metres of a ray send back, that came from a `layer` with a throughput.
    fn media(
        &self,
        (ray, stratum): (&Ray, Stratum),
        reach: f32,
        (layer, throughput): (Layer, Vec3),
        arrival: &mut Arrival,
        rng: &mut Rng,
        room: &mut Room,
    ) -> Stretch {
        let tracer = &self.tracer;
        let first = layer == Layer::Environment;
        let (field, slice) =
            if first { (&self.view, SLICE) } else { (if self.around.is_some() { &self.around } else { &self.view }, COARSE) };
        // What regions send to surfaces may not be called for.
        let (field, slice) = if first || tracer.lights { (field.as_ref(), slice) } else { (None, f64::INFINITY) };
        let stretch = self.march((ray, stratum), reach, field, slice, rng, room);
        arrival.light[layer.then(Layer::VolumeDirect) as usize] += throughput * stretch.direct;
        arrival.light[layer.then(Layer::VolumeIndirect) as usize] += throughput * stretch.found.rgb;
        stretch.found.add_to(arrival, throughput);
        arrival.collisions += stretch.looks;
        if !tracer.bands[0].air.is_empty() {
            let sent = self.air((ray, stratum), reach, first, rng, room);
            arrival.light[layer.then(Layer::VolumeDirect) as usize] += throughput * sent.direct;
            arrival.light[layer.then(Layer::VolumeIndirect) as usize] += throughput * (sent.found.rgb + sent.followed);
            sent.found.add_to(arrival, throughput);
            arrival.collisions += sent.looks;
        }
        if !tracer.fire.is_empty() {
            let Room { scratch, profile, own } = room;
            let near = if first { f32::INFINITY } else { tracer.fire.near_surface() };
            let sent = tracer.fire_along(ray, reach.min(near), profile, scratch, own);
            arrival.light[layer.beside(Layer::VolumeDirect) as usize] += throughput * sent;
        }
        stretch
    }

    /// The first `reach` metres of a ray, by slices of the chance of a collision of at most `slice`.
    fn march(
        &self,
        (ray, stratum): (&Ray, Stratum),
        reach: f32,
        field: Option<&Field>,
        slice: f64,
        rng: &mut Rng,
        room: &mut Room,
    ) -> Stretch {
        let (tracer, band) = (&self.tracer, &self.tracer.bands[0]);
        let similar = field.and_then(|field| Some((field, field.similar()?)));
        let opaque = similar.map_or(OPAQUE, |(_, similar)| OPAQUE.max(HAZY / similar.thinnest()));
        band.media.profile(ray, reach, (EXACT, opaque), &mut room.scratch, &mut room.profile);
        let depth = room.profile.depth();
        let chance = -(-depth).exp_m1();
        let slices = (chance / slice).ceil() as u32;
        let weight = chance / f64::from(slices.max(1));
        let (mut direct, mut far, mut found, mut step) = (Vec3::ZERO, 0.0, Found::default(), 0);
        for i in 0..slices {
            let tau = -(-(f64::from(i) + stratum.of(i, rng.uniform())) * weight).ln_1p();
            let distance = room.profile.distance(tau, &mut step);
            let region = room.profile.region(distance, || rng.uniform());
            let (albedo, g) = band.optics[region as usize];
            let before = band.air.transmittance(ray, distance);
            let here = Ray { origin: ray.at(distance), direction: ray.direction };
            let sun = tracer.sun.in_medium(band, &tracer.surfaces, &here, (g, 1.0), rng, &mut room.scratch).0;
            direct += albedo * before * (sun + tracer.lamps_in_medium(band, &here, g, rng, &mut room.scratch));
            far += f64::from(distance);
            if let Some(field) = field.filter(|field| field.seen_through_own()) {
                field.scattered(Through::Own, (here.origin, -ray.direction), g, before * albedo * weight as f32, &mut found);
            }
        }
        if let Some((field, similar)) = similar {
            let (media, profile) = (&similar.media, &mut room.own);
            room.profile.times(|region| similar.ratio(region), profile);
            let chance = -(-profile.depth()).exp_m1();
            let slices = (chance / SIMILAR).ceil() as u32;
            let (weight, mut step, mut far) = (chance / f64::from(slices.max(1)), 0, Found::default());
            for i in 0..slices {
                let tau = -(-(f64::from(i) + rng.uniform()) * weight).ln_1p();
                let distance = profile.distance(tau, &mut step);
                let region = profile.region(distance, || rng.uniform());
                let share = band.air.transmittance(ray, distance) * (media.optics(region).albedo * weight) as f32;
                let g = band.optics[region as usize].1;
                field.scattered(Through::Similar, (ray.at(distance), -ray.direction), g, share, &mut far);
            }
            far.doubt = far.doubt.hypot(field.off() * far.groups.iter().sum::<f32>());
            found.add(&far);
        }
        Stretch { direct: direct * weight as f32, found, clear: (-depth).exp(), far: far * weight, looks: slices.into() }
    }
}
