//! Head of a part's file: everything about the part and its picture except pixels.

use photoncard_picture::cryptomatte::Identities;
use photoncard_picture::film::{Film, FilmError, PixelForm, SumFormat, Window};
use photoncard_picture::layer::Layers;
use photoncard_scene::LightGroups;
use photoncard_shared::message::SumScale;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use super::dealing::Part;

/// Head of a part's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartHead {
    /// Part that the file contains.
    #[serde(serialize_with = "write_part", deserialize_with = "read_part")]
    pub part: Part,
    /// Provenance of the picture: everything that its pixels depend on, as values by option names.
    pub settings: Map<String, Value>,
    /// Layers of the picture besides radiance, in the text form of [`Layers`].
    pub layers: String,
    /// Arguments of the command that rendered the part.
    pub command: Vec<String>,
    /// `f32::to_bits` of the units of the sums: radiance, W/(sr m^2), and depth, metres.
    pub units: [u32; 2],
    /// Position of the scene's origin in the coordinates of its file, metres; left out if it is 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub origin: [f64; 3],
    /// Names for the picture's mattes; left out without mattes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identities: Option<Identities>,
    /// Names of the picture's light groups; left out without groups.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_groups: Vec<String>,
}

fn is_zero(origin: &[f64; 3]) -> bool {
    *origin == [0.0; 3]
}

impl PartHead {
    /// Creates the head of a part of the picture in `film`.
    pub fn new(
        part: Part,
        film: &Film,
        settings: Map<String, Value>,
        layers: &Layers,
        identities: Option<&Identities>,
        command: Vec<String>,
    ) -> Self {
        let SumScale { radiance, depth } = film.format().scale;
        let units = [radiance, depth].map(f32::to_bits);
        // Only positions are in the file's coordinates.
        let origin = if film.format().form.position { film.origin() } else { [0.0; 3] };
        let identities = identities.filter(|_| layers.have_mattes()).cloned();
        let light_groups = film.light_groups().to_vec();
        Self { part, settings, layers: layers.to_string(), command, units, origin, identities, light_groups }
    }

    /// Returns whether the picture has alpha, and its radiance is premultiplied.
    pub(super) fn is_transparent(&self) -> bool {
        self.settings.get("transparent") == Some(&Value::Bool(true))
    }

    /// Picture that the head describes; `None` if no such picture is possible.
    pub(super) fn picture(&self) -> Option<PartPicture> {
        let numbers = |name: &str| -> Option<Vec<u32>> {
            let numbers = self.settings.get(name)?.as_array()?.iter();
            numbers.map(|number| number.as_u64()?.try_into().ok()).collect()
        };
        let [width, height] = numbers("size")?.try_into().ok()?;
        let [x0, x1, y0, y1] = numbers("crop")?.try_into().ok()?;
        let samples = self.settings.get("spp")?.as_u64()?.try_into().ok()?;
        let layers: Layers = self.layers.parse().ok()?;
        let [radiance, depth] = self.units.map(f32::from_bits);
        let is_unit = |unit: f32| unit.is_normal() && unit > 0.0;
        let is_adaptive = self.settings.get("adaptive").is_some_and(Value::is_number);
        let scale = SumScale { radiance, depth };
        let form = layers.form();
        let light_groups = u8::try_from(self.light_groups.len()).ok()?;
        let form = PixelForm { coverage: form.coverage || self.is_transparent(), light_groups, ..form };
        let format = SumFormat::of_range(form, (0, samples), is_adaptive, scale);
        let window = Window { x0, x1, y0, y1 };
        let is_possible = Film::check(width, height, window).is_ok()
            && samples > 0
            && is_unit(radiance)
            && is_unit(depth)
            && self.origin.iter().all(|coordinate| coordinate.is_finite())
            && self.identities.is_some() == layers.have_mattes()
            && LightGroups::are_names(&self.light_groups);
        let (size, origin) = ([width, height], self.origin);
        let light_groups = self.light_groups.clone();
        is_possible.then_some(PartPicture { size, window, format, origin, layers, light_groups })
    }

    /// Describes the settings in which two heads differ. `own` and `others` name the files of the two heads.
    pub(super) fn differences(&self, other: &Self, [own, others]: [&str; 2]) -> Vec<String> {
        let say = |value: Option<&Value>| value.map_or("nothing".to_owned(), Value::to_string);
        let names = self
            .settings
            .keys()
            .chain(other.settings.keys().filter(|name| !self.settings.contains_key(*name)));
        let differing = names.filter(|name| self.settings.get(*name) != other.settings.get(*name));
        let of_settings = differing.map(|name| {
            let [a, b] = [self, other].map(|head| say(head.settings.get(name)));
            format!("{name}: {a} in {own}, {b} in {others}")
        });
        let of_head = [
            ("number of parts", [self, other].map(|head| head.part.count().to_string())),
            ("layers", [self, other].map(|head| head.layers.clone())),
            ("units", [self, other].map(|head| format!("{:x?}", head.units))),
            ("origin", [self, other].map(|head| format!("{:?}", head.origin))),
            ("light groups", [self, other].map(|head| head.light_groups.join(", "))),
        ];
        let others_names = self.identities != other.identities;
        let of_names =
            others_names.then(|| format!("names of objects and materials differ in {own} and {others}"));
        let of_head = of_head.into_iter().filter(|(_, [a, b])| a != b);
        of_settings
            .chain(of_head.map(|(name, [a, b])| format!("{name}: {a} in {own}, {b} in {others}")))
            .chain(of_names)
            .collect()
    }
}

/// Picture that a part belongs to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PartPicture {
    size: [u32; 2],
    pub(super) window: Window,
    pub(super) format: SumFormat,
    origin: [f64; 3],
    pub(super) layers: Layers,
    light_groups: Vec<String>,
}

impl PartPicture {
    /// Creates an empty film of the picture.
    ///
    /// # Errors
    /// If the film does not fit in memory.
    pub(super) fn film(&self) -> Result<Film, FilmError> {
        let [width, height] = self.size;
        let mut film = Film::new(width, height, self.window, self.format)?;
        film.set_origin(self.origin);
        film.set_light_groups(&self.light_groups);
        Ok(film)
    }
}

fn write_part<S: serde::Serializer>(part: &Part, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(part)
}

fn read_part<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Part, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
}
