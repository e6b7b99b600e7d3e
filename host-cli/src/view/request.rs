//! Messages from pages: JSON in which every name and number is checked.

use photoncard_driver::choice::Choice;
use photoncard_driver::render::Sampling;
use photoncard_driver::scheduler::GatherOrder;
use photoncard_driver::tone_mapping::{ToneCurve, ToneMapping};
use serde_json::{Map, Value};

use super::canvas::Shown;

/// Maximum side of a picture, pixels.
pub(super) const MAX_SIDE: u64 = 4096;
/// Maximum number of pixels of a picture. A view holds tiles of at most two pictures.
pub(super) const MAX_PIXELS: u64 = 1 << 22;
/// Maximum absolute coordinate of a position, metres.
const MAX_PLACE: f64 = 1e15;
/// Maximum absolute exposure, stops (powers of two).
const MAX_STOPS: f64 = 120.0;
/// Maximum turn of an environment map, degrees.
const MAX_TURN: f64 = 360.0;
/// Maximum length of an environment map that a page sends, bytes.
const MAX_DROPPED: u64 = 64 << 20;
/// Maximum length of a text, bytes.
const MAX_NAME: usize = 1024;

/// Message from a page.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Request {
    Camera {
        view: View,
        is_moving: bool,
    },
    Set {
        name: String,
        value: Vec<f64>,
    },
    /// Factors of the light of a light group.
    Mix {
        group: String,
        gain: [f32; 3],
    },
    Setting(Setting),
    Reset,
    /// Read the scene's files again.
    Reload,
    /// Turn the environment map, degrees.
    Turn(f32),
    /// Take the environment map whose bytes follow in binary messages.
    Drop(Announced),
    Layer(Shown),
    Size([u32; 2]),
    Cursor(Option<[u32; 2]>),
    Pick([u32; 2]),
    /// Show and save denoised radiance, or radiance as it is rendered.
    Denoise(bool),
    Save(Saving),
    /// Total size of the tiles that the page has received since it connected, bytes.
    Shown(u64),
    Steer,
}

/// File that a page is going to send.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Announced {
    pub(super) name: String,
    /// Length of the file, bytes.
    pub(super) length: usize,
}

/// Camera of a page.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct View {
    /// Name of the scene's camera whose lens and shift it has; `None` for that of the view so far.
    pub(super) camera: Option<String>,
    pub(super) position: [f64; 3],
    pub(super) look_at: [f64; 3],
    /// Direction that is up in the picture; `None` for +y.
    pub(super) up: Option<[f64; 3]>,
    /// Lens shift; `None` for that of the view so far.
    pub(super) shift: Option<[f32; 2]>,
    /// Diameter of the lens and distance in focus, metres, of which 0 is a pinhole; `None` for the lens of
    /// the view so far.
    pub(super) lens: Option<[f32; 2]>,
    pub(super) shown: Extent,
}

/// Projection of a page's camera, by what the picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Extent {
    /// Vertical field of view of a perspective picture, degrees.
    Fov(f32),
    /// Height of an orthographic picture, metres.
    Height(f32),
    /// Longitudes and latitudes of a panorama, degrees.
    Angles([f32; 2]),
}

/// Request to save a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Saving {
    pub(super) name: String,
    /// Tone mapping for a PNG.
    pub(super) tone: ToneMapping,
    /// True if the page is sent the file, false if the view writes it to its folder.
    pub(super) is_download: bool,
}

/// Setting of the render that a page can change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Setting {
    Photons(usize),
    Samples(u32),
    GatherRays(u32),
    Order(GatherOrder),
    /// Side of the tiles, pixels; 0 for the greatest that all cards can hold.
    Tile(u32),
    Cache(bool),
    Sampling(Sampling),
}

/// Reason why a message is not accepted.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    /// The message is no JSON object: the connection is closed.
    Foreign,
    /// The message has an invalid type or field; the text says which.
    Refused(String),
}

impl From<String> for Fault {
    fn from(reason: String) -> Self {
        Self::Refused(reason)
    }
}

/// Parses a message. Also returns its `id`, which the answer to a refused message contains.
pub(super) fn parse(text: &str) -> (Result<Request, Fault>, Option<u64>) {
    let Ok(Value::Object(message)) = serde_json::from_str(text) else { return (Err(Fault::Foreign), None) };
    (request(&Fields(&message)), message.get("id").and_then(Value::as_u64))
}

fn request(fields: &Fields) -> Result<Request, Fault> {
    Ok(match fields.text("type")?.as_str() {
        "camera" => Request::Camera { view: view(fields)?, is_moving: fields.switch("moving")? },
        "set" => Request::Set { name: fields.text("name")?, value: fields.values("value")? },
        "mix" => Request::Mix { group: fields.text("name")?, gain: gain(fields)? },
        "setting" => Request::Setting(setting(fields)?),
        "reset" => Request::Reset,
        "reload" => Request::Reload,
        "turn" => Request::Turn(fields.number("degrees", -MAX_TURN, MAX_TURN)? as f32),
        "drop" => Request::Drop(announced(fields)?),
        "layer" => Request::Layer(layer(&fields.text("name")?)?),
        "size" => Request::Size(fields.size()?),
        "cursor" if fields.0.get("at") == Some(&Value::Null) => Request::Cursor(None),
        "cursor" => Request::Cursor(Some(fields.pixel("at")?)),
        "pick" => Request::Pick(fields.pixel("at")?),
        "denoise" => Request::Denoise(fields.switch("value")?),
        "save" => Request::Save(Saving {
            name: fields.text("name")?,
            tone: fields.tone()?,
            is_download: fields.0.contains_key("download") && fields.switch("download")?,
        }),
        "shown" => Request::Shown(fields.whole("bytes", u64::MAX)?),
        "steer" => Request::Steer,
        other => return Err(Fault::Refused(format!("there is no message of the type {other:?}"))),
    })
}

fn view(fields: &Fields) -> Result<View, String> {
    let is_stated = |name: &str| fields.0.contains_key(name);
    let shown = if is_stated("height") {
        Extent::Height(fields.number("height", 1e-6, 1e9)? as f32)
    } else if is_stated("angles") {
        Extent::Angles(fields.pair("angles")?)
    } else {
        Extent::Fov(fields.number("fov", 1e-3, 179.999)? as f32)
    };
    Ok(View {
        camera: if is_stated("name") { Some(fields.text("name")?) } else { None },
        position: fields.place("position")?,
        look_at: fields.place("look_at")?,
        up: if is_stated("up") { Some(fields.place("up")?) } else { None },
        shift: if is_stated("shift") { Some(fields.pair("shift")?) } else { None },
        lens: if is_stated("lens") { Some(fields.lens()?) } else { None },
        shown,
    })
}

/// Factors in the field `value`: one number, or one for each channel.
fn gain(fields: &Fields) -> Result<[f32; 3], String> {
    let factors = fields.values("value")?;
    let factors = match factors[..] {
        [red, green, blue] => [red, green, blue],
        _ => [factors.first().copied().unwrap_or(1.0); 3],
    };
    let is_gain = factors.iter().all(|factor| *factor >= 0.0);
    if is_gain {
        Ok(factors.map(|factor| factor as f32))
    } else {
        Err("\"value\" is a factor of 0 or more, or three".into())
    }
}

/// File that a page announces: an environment map with a plain name.
fn announced(fields: &Fields) -> Result<Announced, String> {
    let name = fields.text("name")?;
    let is_plain =
        !name.starts_with(['.', '-']) && !name.contains(|c: char| c.is_control() || "/\\:".contains(c));
    let lower = name.to_lowercase();
    if !is_plain || ![".hdr", ".exr"].iter().any(|suffix| lower.ends_with(suffix)) {
        return Err("an environment map is a file .hdr or .exr with a plain name".into());
    }
    let length = fields.whole("bytes", MAX_DROPPED).ok().filter(|length| *length > 0).ok_or_else(|| {
        format!(
            "an environment map that is dropped has 1 byte to {} MB: use --environment",
            MAX_DROPPED >> 20
        )
    })?;
    Ok(Announced { name, length: length as usize })
}

fn layer(name: &str) -> Result<Shown, String> {
    let known = Shown::all().find(|shown| shown.name() == name);
    known.ok_or_else(|| format!("there is no layer {name:?}"))
}

fn setting(fields: &Fields) -> Result<Setting, String> {
    let whole = || fields.whole("value", u64::from(u32::MAX));
    let name = fields.text("name")?;
    Ok(match name.as_str() {
        "photons" => Setting::Photons(whole()? as usize),
        "spp" => Setting::Samples(whole()? as u32),
        "gather_rays" => Setting::GatherRays(whole()? as u32),
        "order" => Setting::Order(Choice::of_name(&fields.text("value")?)?),
        "tile" => Setting::Tile(whole()? as u32),
        "cache" => Setting::Cache(fields.switch("value")?),
        "sampling" => Setting::Sampling(Choice::of_name(&fields.text("value")?)?),
        _ => return Err(format!("there is no setting {name:?}")),
    })
}

/// Returns whether a view supports pictures of this size.
pub(super) fn is_size_of_view(width: u64, height: u64) -> bool {
    [width, height].iter().all(|side| (1..=MAX_SIDE).contains(side)) && width * height <= MAX_PIXELS
}

/// Fields of a JSON message.
struct Fields<'a>(&'a Map<String, Value>);

impl Fields<'_> {
    fn field(&self, name: &str) -> Result<&Value, String> {
        self.0.get(name).ok_or_else(|| format!("the message lacks {name:?}"))
    }

    fn text(&self, name: &str) -> Result<String, String> {
        let text = self.field(name)?.as_str().filter(|text| text.len() <= MAX_NAME);
        text.map(str::to_owned).ok_or_else(|| format!("{name:?} is a text of at most {MAX_NAME} bytes"))
    }

    fn switch(&self, name: &str) -> Result<bool, String> {
        self.field(name)?.as_bool().ok_or_else(|| format!("{name:?} is true or false"))
    }

    fn number(&self, name: &str, least: f64, most: f64) -> Result<f64, String> {
        let number = self.field(name)?.as_f64().filter(|number| (least..=most).contains(number));
        number.ok_or_else(|| format!("{name:?} is a number from {least} to {most}"))
    }

    fn whole(&self, name: &str, most: u64) -> Result<u64, String> {
        let number = self.field(name)?.as_u64().filter(|number| *number <= most);
        number.ok_or_else(|| format!("{name:?} is a whole number from 0 to {most}"))
    }

    /// Returns the numbers in a field: one number, or a list of three. Each must be finite as `f32`.
    fn values(&self, name: &str) -> Result<Vec<f64>, String> {
        let number = |value: &Value| value.as_f64().filter(|number| (*number as f32).is_finite());
        let values = match self.field(name)? {
            Value::Array(list) if list.len() == 3 => list.iter().map(number).collect(),
            value => number(value).map(|number| vec![number]),
        };
        values.ok_or_else(|| format!("{name:?} is a number, or a list of three"))
    }

    /// Parses the tone mapping of a picture to save. A missing or null field has its default.
    fn tone(&self) -> Result<ToneMapping, String> {
        let is_stated = |name: &str| self.0.get(name).is_some_and(|value| !value.is_null());
        let stops = || self.number("exposure", -MAX_STOPS, MAX_STOPS);
        let exposure = is_stated("exposure").then(stops).transpose()?.map(|stops| stops as f32);
        let curve = is_stated("tonemap").then(|| ToneCurve::of_name(&self.text("tonemap")?)).transpose()?;
        Ok(ToneMapping { exposure, curve: curve.unwrap_or_default() })
    }

    fn place(&self, name: &str) -> Result<[f64; 3], String> {
        let list = self.field(name)?.as_array().filter(|list| list.len() == 3);
        let number = |value: &Value| value.as_f64().filter(|number| number.abs() <= MAX_PLACE);
        let numbers: Option<Vec<f64>> = list.and_then(|list| list.iter().map(number).collect());
        let place = numbers.and_then(|numbers| numbers.try_into().ok());
        place.ok_or_else(|| format!("{name:?} is a place: a list of three numbers of metres"))
    }

    fn pair(&self, name: &str) -> Result<[f32; 2], String> {
        let list = self.field(name)?.as_array().filter(|list| list.len() == 2);
        let number = |value: &Value| value.as_f64().map(|number| number as f32);
        let numbers: Option<Vec<f32>> = list.and_then(|list| list.iter().map(number).collect());
        let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
        numbers.ok_or_else(|| format!("{name:?} is a list of two numbers"))
    }

    fn lens(&self) -> Result<[f32; 2], String> {
        let lens = self.pair("lens")?;
        let is_lens = lens == [0.0; 2] || lens.iter().all(|metres| (1e-6..=1e9).contains(metres));
        if is_lens { Ok(lens) } else { Err("\"lens\" is diameter and focus in metres, or [0, 0]".into()) }
    }

    fn pixel(&self, name: &str) -> Result<[u32; 2], String> {
        let list = self.field(name)?.as_array().filter(|list| list.len() == 2);
        let number =
            |value: &Value| value.as_u64().filter(|number| *number < MAX_SIDE).map(|number| number as u32);
        let numbers: Option<Vec<u32>> = list.and_then(|list| list.iter().map(number).collect());
        let pixel = numbers.and_then(|numbers| numbers.try_into().ok());
        pixel.ok_or_else(|| format!("{name:?} is a pixel: a list of two whole numbers below {MAX_SIDE}"))
    }

    fn size(&self) -> Result<[u32; 2], String> {
        let list = self.field("size")?.as_array().filter(|list| list.len() == 2);
        let sides: Option<Vec<u64>> = list.and_then(|list| list.iter().map(Value::as_u64).collect());
        match sides.as_deref() {
            Some(&[width, height]) if is_size_of_view(width, height) => Ok([width as u32, height as u32]),
            _ => Err(format!(
                "a size is a list of two whole numbers from 1 to {MAX_SIDE}, {MAX_PIXELS} pixels in all"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_driver::layer::Layer;

    use super::*;

    /// View of the tests' messages.
    fn view(camera: Option<String>, shown: Extent) -> View {
        View {
            camera,
            position: [1.0, 2.5, -3.0],
            look_at: [0.0; 3],
            up: None,
            shift: None,
            lens: None,
            shown,
        }
    }

    #[test]
    fn valid_messages_are_parsed() {
        for (text, request) in [
            (
                r#"{"type":"camera","position":[1,2.5,-3],"look_at":[0,0,0],"fov":40,"moving":true}"#,
                Request::Camera { view: view(None, Extent::Fov(40.0)), is_moving: true },
            ),
            (
                r#"{"type":"camera","name":"plan","position":[1,2.5,-3],"look_at":[0,0,0],"height":3,"moving":false}"#,
                Request::Camera { view: view(Some("plan".into()), Extent::Height(3.0)), is_moving: false },
            ),
            (
                r#"{"type":"camera","position":[1,2.5,-3],"look_at":[0,0,0],"angles":[360,180],"moving":false}"#,
                Request::Camera { view: view(None, Extent::Angles([360.0, 180.0])), is_moving: false },
            ),
            (
                r#"{"type":"camera","position":[1,2.5,-3],"look_at":[0,0,0],"up":[0,0,-1],"shift":[0.1,-2],"lens":[0.25,3],"fov":40,"moving":false}"#,
                Request::Camera {
                    view: View {
                        up: Some([0.0, 0.0, -1.0]),
                        shift: Some([0.1, -2.0]),
                        lens: Some([0.25, 3.0]),
                        ..view(None, Extent::Fov(40.0))
                    },
                    is_moving: false,
                },
            ),
            (
                r#"{"type":"set","name":"a.b","value":2}"#,
                Request::Set { name: "a.b".into(), value: vec![2.0] },
            ),
            (
                r#"{"type":"mix","name":"key","value":[1.5,0,2]}"#,
                Request::Mix { group: "key".into(), gain: [1.5, 0.0, 2.0] },
            ),
            (
                r#"{"type":"mix","name":"key","value":0.5}"#,
                Request::Mix { group: "key".into(), gain: [0.5; 3] },
            ),
            (r#"{"type":"setting","name":"cache","value":false}"#, Request::Setting(Setting::Cache(false))),
            (
                r#"{"type":"setting","name":"order","value":"hash"}"#,
                Request::Setting(Setting::Order(GatherOrder::Hash)),
            ),
            (r#"{"type":"layer","name":"radiance"}"#, Request::Layer(Shown::Radiance)),
            (r#"{"type":"layer","name":"N"}"#, Request::Layer(Shown::Layer(Layer::Normal))),
            (r#"{"type":"size","size":[640,480]}"#, Request::Size([640, 480])),
            (r#"{"type":"cursor","at":null}"#, Request::Cursor(None)),
            (r#"{"type":"pick","at":[3,4]}"#, Request::Pick([3, 4])),
            (r#"{"type":"denoise","value":false}"#, Request::Denoise(false)),
            (r#"{"type":"reload"}"#, Request::Reload),
            (r#"{"type":"turn","degrees":-30}"#, Request::Turn(-30.0)),
            (
                r#"{"type":"drop","name":"a sky.HDR","bytes":77}"#,
                Request::Drop(Announced { name: "a sky.HDR".into(), length: 77 }),
            ),
            (r#"{"type":"shown","version":3,"bytes":77}"#, Request::Shown(77)),
        ] {
            assert_eq!(parse(text), (Ok(request), None), "{text}");
        }
    }

    #[test]
    fn a_picture_is_saved_as_it_is_shown() {
        let saved = |exposure, curve, is_download| {
            let tone = ToneMapping { exposure, curve };
            (Ok(Request::Save(Saving { name: "a.png".into(), tone, is_download })), Some(7))
        };
        for (more, saving) in [
            ("", saved(None, ToneCurve::Reinhard, false)),
            (r#","exposure":null,"tonemap":"none""#, saved(None, ToneCurve::None, false)),
            (r#","exposure":-1.5,"tonemap":"aces""#, saved(Some(-1.5), ToneCurve::Aces, false)),
            (r#","download":true"#, saved(None, ToneCurve::Reinhard, true)),
        ] {
            assert_eq!(parse(&format!(r#"{{"type":"save","id":7,"name":"a.png"{more}}}"#)), saving, "{more}");
        }
    }

    #[test]
    fn text_that_is_no_message_is_foreign() {
        for text in ["", "hello", "[1]", "3", "null", "{", &"[".repeat(10_000)] {
            assert_eq!(parse(text), (Err(Fault::Foreign), None), "{text:.20}");
        }
    }

    #[test]
    fn messages_that_cannot_be_used_are_refused_with_a_reason() {
        let camera = |position: &str, fov: &str| {
            format!(
                r#"{{"type":"camera","position":{position},"look_at":[0,0,0],"fov":{fov},"moving":false}}"#
            )
        };
        for (text, said) in [
            ("{}".to_owned(), "type"),
            (r#"{"type":"run"}"#.into(), "run"),
            (camera("[0,0]", "40"), "position"),
            (camera("[0,0,1e30]", "40"), "position"),
            (camera("[0,0,\"1\"]", "40"), "position"),
            (camera("[0,0,1]", "0"), "fov"),
            (camera("[0,0,1]", "180"), "fov"),
            (camera("[0,0,1]", "null"), "fov"),
            (camera("[0,0,1],\"up\":[0,1]", "40"), "up"),
            (camera("[0,0,1],\"shift\":0.5", "40"), "shift"),
            (camera("[0,0,1],\"lens\":[0.5,0]", "40"), "lens"),
            (r#"{"type":"set","name":"a.b","value":1e39}"#.into(), "value"),
            (r#"{"type":"set","name":"a.b","value":[1,2]}"#.into(), "value"),
            (format!(r#"{{"type":"set","name":"{}","value":1}}"#, "a".repeat(2000)), "name"),
            (r#"{"type":"mix","name":"key","value":[1,-1,1]}"#.into(), "value"),
            (r#"{"type":"setting","name":"spp","value":-1}"#.into(), "value"),
            (r#"{"type":"setting","name":"spp","value":1.5}"#.into(), "value"),
            (r#"{"type":"setting","name":"order","value":"best"}"#.into(), "best"),
            (r#"{"type":"setting","name":"cards","value":9}"#.into(), "cards"),
            (r#"{"type":"layer","name":"beauty"}"#.into(), "beauty"),
            (r#"{"type":"size","size":[0,5]}"#.into(), "size"),
            (r#"{"type":"size","size":[4096,4096]}"#.into(), "size"),
            (r#"{"type":"size","size":[5000,1]}"#.into(), "size"),
            (r#"{"type":"pick","at":[-1,0]}"#.into(), "at"),
            (r#"{"type":"pick","at":[4096,0]}"#.into(), "at"),
            (r#"{"type":"shown","bytes":-3}"#.into(), "bytes"),
            (r#"{"type":"denoise","value":1}"#.into(), "value"),
            (r#"{"type":"turn","degrees":400}"#.into(), "degrees"),
            (r#"{"type":"drop","name":"../sky.hdr","bytes":77}"#.into(), "plain"),
            (r#"{"type":"drop","name":"sky.png","bytes":77}"#.into(), ".hdr"),
            (r#"{"type":"drop","name":"sky.hdr","bytes":1e9}"#.into(), "64 MB"),
            (r#"{"type":"save","name":"a.png","download":"yes"}"#.into(), "download"),
            (r#"{"type":"save","name":"a.png","exposure":1e9}"#.into(), "exposure"),
            (r#"{"type":"save","name":"a.png","tonemap":"best"}"#.into(), "best"),
        ] {
            match parse(&text).0 {
                Err(Fault::Refused(reason)) => assert!(reason.contains(said), "{text}: {reason}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
