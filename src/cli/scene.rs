//! The flags that say what a file does not, or override what it says: media, sun, sky, camera.

use super::values::{count, length};
use crate::import::{
    ImportOptions, MAX_VOXELS,
    air::spelt,
    fire::FireSpec,
    sky::{self, SkySpec},
};
use crate::scene::view::LONGEST;
use crate::scene::{Air, Overrides, Sky, View, Wishes, effect::EffectName};
use crate::sculpt::{DetailRequest, Genus, MOST_OCTAVES, MOST_STRENGTH};
use clap::{Args, ValueEnum};
use glam::DVec3;

/// Media, light and camera, in place of the scene's own.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Scene")]
pub struct SceneArguments {
    /// Only nodes whose name matches become regions by their form (* and ?)
    #[arg(long, value_name = "PATTERN")]
    pub regions: Option<String>,
    /// Closed meshes that are no spheres become regions too
    #[arg(long)]
    pub mesh_volumes: bool,
    /// The grids of a .vdb that are regions [default: density]
    #[arg(long, value_name = "NAME")]
    pub grid: Option<String>,
    /// Extinction per metre of every region, for a sample of 1 in a grid; albedo is kept
    #[arg(long, value_name = "X", value_parser = extinction, allow_hyphen_values = true)]
    pub sigma_t: Option<f64>,
    /// Single-scattering albedo of every region, one number or R,G,B; extinction is kept
    #[arg(long, value_name = "A|R,G,B", value_parser = albedo, allow_hyphen_values = true)]
    pub albedo: Option<Rgb>,
    /// Mean cosine of scattering of every region, forward is positive
    #[arg(short, value_name = "G", value_parser = mean_cosine, allow_hyphen_values = true)]
    pub g: Option<f64>,
    /// The direction in which the sun's light travels, Z up, of any length
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    pub sun: Option<DVec3>,
    /// The angular diameter of the sun's disc in radians
    #[arg(long, value_name = "RAD", value_parser = sun_angle, allow_hyphen_values = true)]
    pub sun_angle: Option<f64>,
    /// The sun's irradiance in W/m^2 across its light, one number or R,G,B
    #[arg(long, value_name = "E|R,G,B", value_parser = light, allow_hyphen_values = true)]
    pub irradiance: Option<Rgb>,
    /// The sky's radiance in W/m^2/sr, one number or R,G,B; ZENITH+HORIZON[+GROUND] of these; clear, a clear day's about the sun, as in
    /// clear:turbidity=3; or an image of all directions, as in studio.exr:strength=2,turn=90
    #[arg(long, value_name = "SKY", value_parser = sky::spelt, allow_hyphen_values = true)]
    pub sky: Option<SkySpec>,
    /// The air around the clouds: none, clear, rayleigh, or a medium with a top, with options behind it as in
    /// clear:visibility=20000,base=0 or haze:visibility=8000,top=1500; a + between several
    #[arg(long, value_name = "AIR", value_parser = spelt)]
    pub atmosphere: Option<Air>,
    /// A grid of a .vdb that shines, and what a sample of 1 emits, W/m^3/sr, as in flame=3,1,0.2
    #[arg(long, value_name = "GRID=E|R,G,B", value_parser = emission)]
    pub emission: Option<Emission>,
    /// A grid of a .vdb that glows by its heat, and the kelvins of a sample of 1, as in temperature=1200
    #[arg(long, value_name = "GRID=KELVIN", value_parser = temperature)]
    pub temperature: Option<Heat>,
    /// The absorption per metre of what glows by its heat [default: the medium's own]
    #[arg(long, value_name = "X", value_parser = soot, requires = "temperature")]
    pub soot: Option<f64>,
    /// Simulate an effect whatever it changes, or leave it out, in place of what the scene calls for; repeats. See cloudvdb plan
    #[arg(long = "effect", value_name = "NAME=on|off|auto", value_parser = effect)]
    pub effects: Vec<Wish>,
    /// Leave out effects that change less than this share of the light [default: 0.1%]
    #[arg(long, value_name = "PERCENT", value_parser = tolerance)]
    pub tolerance: Option<f64>,
    /// Repeat grids horizontally without end
    #[arg(long, value_enum, value_name = "AXES")]
    pub periodic: Option<Periodic>,
    /// Turbulent detail of every region, in place of the file's: none or a genus, with options behind it as in congestus:size=80,strength=0.7,octaves=6,seed=2
    #[arg(long, value_name = "GENUS", value_parser = detail)]
    pub detail: Option<Detail>,
    /// Voxel size in metres [default: a third of the smallest region's half extent or of the smallest detail, or 1/128 of the whole]
    #[arg(long, value_name = "METRES", value_parser = length)]
    pub voxel_size: Option<f64>,
    /// The most active voxels a grid may have
    #[arg(long, value_name = "N", default_value_t = MAX_VOXELS, value_parser = count)]
    pub max_voxels: u64,
    /// Where the camera stands, in metres [default: the file's camera, or one that frames the regions]
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub camera: Option<DVec3>,
    /// What the camera looks at, in metres [default: with --camera, the middle of the regions]
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub look_at: Option<DVec3>,
    /// The horizontal angle of view in degrees
    #[arg(long, value_name = "DEGREES", value_parser = field_of_view, allow_hyphen_values = true)]
    pub fov: Option<Radians>,
    /// Pixels of the picture [default: 640 wide, as high as the camera's aspect says]
    #[arg(long, value_name = "WxH", value_parser = size, allow_hyphen_values = true)]
    pub size: Option<[u32; 2]>,
}

/// One number for each of red, green and blue.
type Rgb = [f64; 3];
/// A grid's name, and what a sample of 1 of it emits.
type Emission = (String, Rgb);
/// A grid's name, and the temperature of a sample of 1, K.
type Heat = (String, f64);
/// A detail, or expressly none.
type Detail = Option<DetailRequest>;
/// An effect, and whether it is to be on; or as the scene calls for.
type Wish = (EffectName, Option<bool>);
/// An angle in radians, given in degrees.
type Radians = f64;

/// `--periodic`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Periodic {
    /// along x and y
    Xy,
}

impl SceneArguments {
    /// How the scene is read.
    pub fn import(&self) -> ImportOptions {
        ImportOptions {
            regions: self.regions.clone(),
            mesh_volumes: self.mesh_volumes,
            grid: self.grid.clone(),
            overrides: Overrides {
                sigma_t: self.sigma_t,
                albedo: self.albedo,
                g: self.g,
                sun: self.sun,
                sun_angle: self.sun_angle,
                irradiance: self.irradiance,
                sky: match self.sky {
                    Some(SkySpec::Made(Sky::Even(radiance))) => Some(radiance),
                    _ => None,
                },
                air: self.atmosphere,
                wishes: self.wishes(),
                periodic: self.periodic.is_some(),
            },
            sky: self.sky.clone().filter(|sky| !matches!(sky, SkySpec::Made(Sky::Even(_)))),
            fire: FireSpec { emission: self.emission.clone(), temperature: self.temperature.clone(), soot: self.soot },
            detail: self.detail,
            voxel_size: self.voxel_size,
            max_voxels: self.max_voxels,
        }
    }

    /// What is wished of the effects: the last word on each counts.
    fn wishes(&self) -> Wishes {
        let begin = Wishes { tolerance: self.tolerance.unwrap_or(Wishes::default().tolerance), ..Wishes::default() };
        self.effects.iter().fold(begin, |wishes, &(name, wish)| wishes.with(name, wish))
    }

    /// How it is looked at.
    pub fn view(&self) -> View {
        View { position: self.camera, target: self.look_at, xfov: self.fov, size: self.size }
    }
}

/// A finite number that single precision can hold.
fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|v: &f64| v.abs() <= f64::from(f32::MAX))
}

/// Three finite numbers with commas between them.
fn three(text: &str) -> Option<[f64; 3]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    numbers?.try_into().ok()
}

/// One number for all channels, or three.
fn rgb(text: &str) -> Option<Rgb> {
    number(text).map(|v| [v; 3]).or_else(|| three(text))
}

fn extinction(text: &str) -> Result<f64, String> {
    number(text).filter(|&v| v > 0.0).ok_or_else(|| format!("{text:?} is not an extinction per metre above 0"))
}

fn albedo(text: &str) -> Result<Rgb, String> {
    let fine = |rgb: &Rgb| rgb.iter().all(|v| (0.0..=1.0).contains(v));
    rgb(text).filter(fine).ok_or_else(|| format!("{text:?} is not an albedo from 0 to 1, or three of them such as 0.9,0.95,1"))
}

fn mean_cosine(text: &str) -> Result<f64, String> {
    number(text).filter(|v| v.abs() < 1.0).ok_or_else(|| format!("{text:?} is not a number between -1 and 1, both excluded"))
}

fn direction(text: &str) -> Result<DVec3, String> {
    let direction = three(text).and_then(|v| DVec3::from_array(v).try_normalize());
    direction.ok_or_else(|| format!("{text:?} is not a direction such as 1,0,-1: three numbers, not all 0"))
}

fn sun_angle(text: &str) -> Result<f64, String> {
    let fine = |v: &f64| (0.0..std::f64::consts::PI).contains(v);
    number(text).filter(fine).ok_or_else(|| format!("{text:?} is not an angle in radians from 0 to below pi"))
}

fn light(text: &str) -> Result<Rgb, String> {
    let fine = |rgb: &Rgb| rgb.iter().all(|&v| v >= 0.0);
    rgb(text).filter(fine).ok_or_else(|| format!("{text:?} is not a number from 0 up, or three of them such as 0.1,0.2,0.4"))
}

/// What stands before and behind the last equals sign.
fn of_grid(text: &str) -> Option<(String, &str)> {
    text.rsplit_once('=').filter(|(name, _)| !name.is_empty()).map(|(name, value)| (name.to_owned(), value))
}

fn emission(text: &str) -> Result<Emission, String> {
    let fine = |rgb: &Rgb| rgb.iter().all(|&v| v >= 0.0) && rgb.iter().any(|&v| v > 0.0);
    let found = of_grid(text).and_then(|(name, value)| Some((name, rgb(value).filter(fine)?)));
    found.ok_or_else(|| format!("{text:?} is not a grid and what it emits, such as flame=5 or flame=3,1,0.2 (from 0 up, not all 0)"))
}

fn temperature(text: &str) -> Result<Heat, String> {
    let fine = |kelvin: &f64| *kelvin > 0.0 && *kelvin <= 1e6;
    let found = of_grid(text).and_then(|(name, value)| Some((name, number(value).filter(fine)?)));
    found.ok_or_else(|| format!("{text:?} is not a grid and the kelvins of a sample of 1, such as temperature=1200 (up to 1e6)"))
}

fn soot(text: &str) -> Result<f64, String> {
    number(text).filter(|&v| v > 0.0).ok_or_else(|| format!("{text:?} is not an absorption per metre above 0"))
}

fn effect(text: &str) -> Result<Wish, String> {
    let (name, wish) = text.split_once('=').ok_or_else(|| format!("{text:?} is not an effect and a wish, such as surface_bounce=off"))?;
    let known = EffectName::SWITCHES.iter().find(|(known, _)| *known == name.trim().replace('-', "_"));
    let names = EffectName::SWITCHES.map(|(name, _)| name).join(", ");
    let (_, name) = known.ok_or_else(|| format!("{name:?} is no effect that can be switched: say one of {names}"))?;
    match wish.trim() {
        "on" => Ok((*name, Some(true))),
        "off" => Ok((*name, Some(false))),
        "auto" => Ok((*name, None)),
        other => Err(format!("{other:?} is none of on, off and auto")),
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    let share = text.trim().trim_end_matches('%').parse::<f64>().ok().filter(|v| (0.0..=100.0).contains(v));
    share.map(|v| v / 100.0).ok_or_else(|| format!("{text:?} is not a share from 0% to 100%"))
}

fn point(text: &str) -> Result<DVec3, String> {
    three(text).map(DVec3::from_array).ok_or_else(|| format!("{text:?} is not a point such as 0,-10,2: three numbers of metres"))
}

fn field_of_view(text: &str) -> Result<Radians, String> {
    let degrees = number(text).filter(|&v| v > 0.0 && v < 180.0);
    degrees.map(f64::to_radians).ok_or_else(|| format!("{text:?} is not an angle in degrees between 0 and 180"))
}

fn detail(text: &str) -> Result<Detail, String> {
    let (name, options) = text.split_once(':').unwrap_or((text, ""));
    if name == "none" && options.is_empty() {
        return Ok(None);
    }
    let names = Genus::NAMES.map(|(name, _)| name).join(", ");
    let genus = Genus::NAMES.iter().find(|(known, _)| *known == name);
    let genus = genus.ok_or_else(|| format!("{name:?} is no genus: say none, or one of {names}"))?.1;
    let mut detail = DetailRequest::new(genus);
    for option in options.split(',').filter(|option| !option.is_empty()) {
        let (key, value) = option.split_once('=').unwrap_or((option, ""));
        let real = |fine: fn(f64) -> bool, what: &str| {
            number(value).filter(|&v| fine(v)).ok_or_else(|| format!("{option:?}: {key} must be {what}"))
        };
        let whole = |least: u32, most: u32| {
            let fine = value.parse().ok().filter(|n| (least..=most).contains(n));
            fine.ok_or_else(|| format!("{option:?}: {key} must be a whole number from {least} to {most}"))
        };
        match key {
            "strength" => detail.strength = real(|v| (0.0..=MOST_STRENGTH).contains(&v), "a number from 0 to 4")?,
            "size" => detail.size = Some(real(|v| v > 0.0, "a number of metres above 0")?),
            "octaves" => detail.octaves = whole(1, MOST_OCTAVES)?,
            "seed" => detail.seed = whole(0, u32::MAX)?,
            _ => return Err(format!("{option:?}: a detail has strength, size, octaves and seed, each with = and a number")),
        }
    }
    Ok(Some(detail))
}

pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    let side = |text: &str| text.trim().parse::<u32>().ok().filter(|n| (1..=LONGEST).contains(n));
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([side(w)?, side(h)?]));
    sides.ok_or_else(|| format!("{text:?} is not a size such as 640x360: width and height in pixels, each from 1 to {LONGEST}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_read_as_people_write_them() {
        assert_eq!((albedo("0.5"), albedo("0, 0.5,1")), (Ok([0.5; 3]), Ok([0.0, 0.5, 1.0])));
        assert_eq!((light("3"), light("1,2,4e2")), (Ok([3.0; 3]), Ok([1.0, 2.0, 400.0])));
        assert_eq!((mean_cosine("-0.3"), extinction("25"), sun_angle("0")), (Ok(-0.3), Ok(25.0), Ok(0.0)));
        assert_eq!((direction("-3,0,0"), point("1,-2,3.5")), (Ok(DVec3::NEG_X), Ok(DVec3::new(1.0, -2.0, 3.5))));
        assert_eq!((field_of_view("90"), size("640x360")), (Ok(std::f64::consts::FRAC_PI_2), Ok([640, 360])));
    }

    #[test]
    fn wishes_read_as_people_write_them() {
        assert_eq!((effect("sky=off"), effect("sun-disc=auto")), (Ok((EffectName::Sky, Some(false))), Ok((EffectName::SunDisc, None))));
        assert_eq!((tolerance("0.5%"), tolerance("0")), (Ok(0.005), Ok(0.0)));
        assert!(["sky", "sky=no", "duality=off", "=on"].iter().all(|t| effect(t).is_err()));
        assert!(["-1", "101%", "much"].iter().all(|t| tolerance(t).is_err()));
    }

    #[test]
    fn details_read_as_people_write_them() {
        let congestus = DetailRequest::new(Genus::Congestus);
        assert_eq!((detail("none"), detail("congestus")), (Ok(None), Ok(Some(congestus))));
        let full = DetailRequest { strength: 0.5, size: Some(80.0), octaves: 3, seed: 9, ..congestus };
        assert_eq!(detail("congestus:strength=0.5,size=80,octaves=3,seed=9"), Ok(Some(full)));
        let wrong =
            ["", "nimbus", "none:size=3", "cirrus:size", "cirrus:size=0", "cirrus:octaves=13", "cirrus:strength=5", "cirrus:wind=3"];
        assert!(wrong.iter().all(|t| detail(t).is_err()));
    }

    #[test]
    fn values_without_a_meaning_are_refused() {
        assert!(["", "-0.1", "1.1", "nan", "inf", "1,1", "1,1,1,1", "1,1,2", "a"].iter().all(|t| albedo(t).is_err()));
        assert!(["", "-1", "nan", "1,2", "1,-2,3", "1e39"].iter().all(|t| light(t).is_err()));
        assert!(["1", "-1", "nan", "1.5", "0,0,0"].iter().all(|t| mean_cosine(t).is_err()));
        assert!(["0", "-1", "inf", ""].iter().all(|t| extinction(t).is_err()));
        assert!(["0,0,0", "1,2", "1,2,nan", "1,2,3,4", "up", "1e-300,0,0"].iter().all(|t| direction(t).is_err()));
        assert!(["1,2", "1,2,inf", "1;2;3"].iter().all(|t| point(t).is_err()));
        assert!(["0", "180", "-5", "nan"].iter().all(|t| field_of_view(t).is_err()));
        assert!(["640", "0x360", "640x", "x360", "16385x1", "-1x5", "640x360x2", "6.4x3"].iter().all(|t| size(t).is_err()));
        assert!(["-0.1", "3.2", "nan"].iter().all(|t| sun_angle(t).is_err()));
    }
}
