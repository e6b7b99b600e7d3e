//! Command `photoncard scene info`.

mod json;

use std::fmt::Write;
use std::path::Path;

use photoncard_driver::scene::gltf::{Animation, LoadSettings, SceneFile};
use photoncard_driver::scene::{
    Camera, Encoding, Image, Layers, Lens, Material, Projection, PunctualKind, PunctualLight, Reflection,
    Scene, Texture, Wrap,
};

use crate::arguments::LightOptions;
use crate::console::{print, print_json};
use crate::failure::Failure;

/// Prints the contents of a scene as a report or as JSON.
pub(crate) fn info(path: &Path, json: bool, lights: &LightOptions) -> Result<(), Failure> {
    let settings = LoadSettings { light_units: lights.light_units, ..LoadSettings::default() };
    let file = SceneFile::open(path, &settings).map_err(Failure::input)?;
    let animations = file.animations().map_err(Failure::input)?;
    let scene = file.at_rest().map_err(Failure::input)?;
    if json {
        return print_json(&format!("{:#}", json::contents(&scene, &animations)));
    }
    let mut lines = vec![path.display().to_string()];
    lines.extend(geometry(&scene).map(|row| format!("  {row}")));
    lines.extend(scene.generator.iter().map(|generator| format!("  written by  {generator}")));
    for (heading, rows) in [
        ("Cameras", scene.cameras.iter().map(|item| camera(item, &scene)).collect::<Vec<_>>()),
        ("Punctual lights", scene.lights.iter().map(|item| light(item, &scene)).collect()),
        ("Animations", animations.iter().map(animation).collect()),
        ("Materials", scene.materials.iter().map(|item| material(item, &scene)).collect()),
        ("Images", scene.images.iter().map(image).collect()),
        ("Variants", scene.variants.clone()),
        ("Ignored", scene.notices.clone()),
        ("Remarks", scene.remarks.clone()),
    ] {
        if !rows.is_empty() {
            lines.push(String::new());
            lines.push(format!("{heading} ({})", rows.len()));
            lines.extend(rows.iter().map(|row| format!("  {row}")));
        }
    }
    print(&lines)
}

/// Table rows about triangles, bounds, attributes and textures of a scene.
fn geometry(scene: &Scene) -> [String; 5] {
    let (lower, upper) = scene.bounds();
    let size = upper - lower;
    let [lower, upper] = [lower, upper].map(|corner| scene.in_file(corner));
    let emissive = scene.emissive_triangles();
    let instances = match scene.instances.len() {
        0 => String::new(),
        count => format!("; {count} instances of {} meshes", scene.groups.len()),
    };
    [
        format!("triangles   {}, {emissive} of them emissive{instances}", scene.placed_triangles()),
        format!("left out    {} of zero area", scene.skipped_triangles),
        format!("size        {} x {} x {} m, from {lower} to {upper}", size.x, size.y, size.z),
        attributes(scene),
        textures(scene),
    ]
}

fn attributes(scene: &Scene) -> String {
    let smooth = scene.attributes.iter().filter(|attributes| attributes.normals.is_some()).count();
    let is_coloured = |colours: &[[f32; 4]; 3]| colours.as_flattened().iter().any(|channel| *channel < 1.0);
    let coloured = scene.attributes.iter().filter(|attributes| is_coloured(&attributes.colours)).count();
    let count = scene.attributes.len();
    format!("attributes  {count} triangles: {smooth} with smooth normals, {coloured} with colours")
}

fn textures(scene: &Scene) -> String {
    let texels: usize = scene.images.iter().map(|image| image.texels.len()).sum();
    let bytes: u64 = scene.images.iter().map(Image::bytes).sum();
    let images = scene.images.len();
    format!("textures    {} of {images} images, {texels} texels, {bytes} bytes", scene.textures.len())
}

fn image(image: &Image) -> String {
    let encoding = match image.encoding {
        Encoding::Srgb => "sRGB",
        Encoding::Linear => "linear",
        Encoding::SharedExponent => "linear of 16 bits, with a shared exponent",
        Encoding::LinearPair => "linear of 16 bits, two channels",
        Encoding::NormalPair => "normals of 16 bits",
    };
    format!("{}: {} x {}, {encoding}", image.name, image.width, image.height)
}

fn camera(camera: &Camera, scene: &Scene) -> String {
    let Camera { name, origin, projection, shift, lens, aspect, .. } = camera;
    let mut line = format!("{name}: at {}", scene.in_file(*origin));
    let _ = match projection {
        Projection::Perspective { vertical_fov } => {
            write!(line, ", vertical field of view {:.1} degrees", vertical_fov.to_degrees())
        }
        Projection::Orthographic { half_height } => {
            write!(line, ", orthographic, {} m high", 2.0 * half_height)
        }
        Projection::Panorama { angles } => {
            let [longitude, latitude] = angles.map(f32::to_degrees);
            write!(line, ", panorama of {longitude:.1} by {latitude:.1} degrees")
        }
    };
    if let Some(aspect) = aspect {
        let _ = write!(line, ", aspect ratio {aspect}");
    }
    if *shift != [0.0; 2] {
        let _ = write!(line, ", lens shift {},{}", shift[0], shift[1]);
    }
    if let Some(Lens { radius, focus }) = lens {
        let _ = write!(line, ", aperture {} m, focus {focus} m", 2.0 * radius);
    }
    line
}

fn animation(animation: &Animation) -> String {
    let Animation { name, seconds, moves_only_cameras } = animation;
    // The file has times in single precision: as `f32` they print without digits of the conversion.
    let [begin, end] = seconds.map(|time| time as f32);
    let moved = if *moves_only_cameras { "moves cameras alone" } else { "moves meshes or lights" };
    format!("{name}: {begin} to {end} s, {moved}")
}

fn light(light: &PunctualLight, scene: &Scene) -> String {
    let PunctualLight { name, kind, intensity, axes } = light;
    let degrees = |cosine: f32| cosine.clamp(-1.0, 1.0).acos().to_degrees();
    let kind = match kind {
        PunctualKind::Point { position } => {
            format!("point at {}, {intensity} W/sr", scene.in_file(*position))
        }
        PunctualKind::Spot { position, direction, inner_cosine, outer_cosine } => {
            let (inner, outer) = (degrees(*inner_cosine), degrees(*outer_cosine));
            let cone = format!("{inner:.1} to {outer:.1} degrees");
            let position = scene.in_file(*position);
            format!("spot at {position} towards {direction}, {cone}, {intensity} W/sr")
        }
        PunctualKind::Profile { position, texture } => {
            let texture = scene.textures.get(*texture as usize);
            let image = texture.and_then(|texture| scene.images.get(texture.image as usize));
            let file = image.map_or("", |image| image.name.as_str());
            let (position, aim) = (scene.in_file(*position), axes.aim);
            format!("profile '{file}' at {position} towards {aim}, at most {intensity} W/sr")
        }
        PunctualKind::Directional { direction, angle } => {
            let disk = match angle.to_degrees() {
                0.0 => String::new(),
                degrees => format!(", from a disk of {degrees:.2} degrees"),
            };
            format!("directional towards {direction}{disk}, {intensity} W/m^2")
        }
    };
    format!("{name}: {kind}")
}

fn material(material: &Material, scene: &Scene) -> String {
    let mut parts = reflection(&material.reflection);
    if material.emission.max_element() > 0.0 {
        parts.push(format!("emission {} W/(sr m^2)", material.emission));
    }
    if material.double_sided {
        parts.push("double-sided".into());
    }
    if let Some(cutoff) = material.alpha_cutoff {
        parts.push(format!("not there where alpha {} is below {cutoff}", material.alpha));
    }
    if material.blends {
        parts.push(format!("covered by alpha {}", material.alpha));
    }
    parts.extend(material.layers.iter().flat_map(|layers| of_layers(layers)));
    let textures = [
        ("base", material.base_texture),
        ("metallic-roughness", material.metallic_roughness_texture),
        ("emissive", material.emissive_texture),
    ];
    let of_layers = material.layers.iter().flat_map(|layers| layer_textures(layers));
    for (use_, index) in textures.into_iter().chain(of_layers) {
        if let Some(texture) = index.and_then(|index| scene.textures.get(index as usize)) {
            parts.push(format!("{use_} texture {}", describe(texture, scene)));
        }
    }
    format!("{}: {}", material.name, parts.join(", "))
}

fn of_layers(layers: &Layers) -> Vec<String> {
    let Layers { normal, coat, sheen, diffuse_transmission, .. } = layers;
    let scale = normal.filter(|map| map.scale != 1.0).map(|map| format!("normals scaled by {}", map.scale));
    let coat = coat.map(|coat| format!("coat {} of roughness {}", coat.factor, coat.roughness));
    let sheen = sheen.map(|sheen| format!("sheen {} of roughness {}", sheen.colour, sheen.roughness));
    let behind = diffuse_transmission
        .map(|part| format!("diffuse transmission {} of colour {}", part.factor, part.colour));
    [scale, coat, sheen, behind].into_iter().flatten().collect()
}

fn layer_textures(layers: &Layers) -> Vec<(&'static str, Option<u32>)> {
    let mut textures = vec![
        ("normal", layers.normal.map(|map| map.texture)),
        ("specular", layers.specular_texture),
        ("specular colour", layers.specular_colour_texture),
        ("transmission", layers.transmission_texture),
    ];
    if let Some(coat) = layers.coat {
        textures.push(("coat", coat.factor_texture));
        textures.push(("coat roughness", coat.roughness_texture));
        textures.push(("coat normal", coat.normal.map(|map| map.texture)));
    }
    if let Some(sheen) = layers.sheen {
        textures.push(("sheen", sheen.colour_texture));
        textures.push(("sheen roughness", sheen.roughness_texture));
    }
    if let Some(part) = layers.diffuse_transmission {
        textures.push(("diffuse transmission", part.factor_texture));
        textures.push(("diffuse transmission colour", part.colour_texture));
    }
    textures
}

fn describe(texture: &Texture, scene: &Scene) -> String {
    let name = scene.images.get(texture.image as usize).map_or("", |image| &image.name);
    let wrap = texture.wrap.map(|wrap| match wrap {
        Wrap::Repeat => "repeated",
        Wrap::Mirror => "mirrored",
        Wrap::Clamp => "clamped",
    });
    let [across, down] = wrap;
    let wrap = if across == down { across.to_owned() } else { format!("{across} across and {down} down") };
    let filter = if texture.nearest { " nearest" } else { "" };
    let is_transformed = texture.matrix != [[1.0, 0.0], [0.0, 1.0]] || texture.offset != [0.0; 2];
    let transform = if is_transformed { ", transformed" } else { "" };
    format!("{name} (set {}, {wrap}{filter}{transform})", texture.set)
}

fn reflection(reflection: &Reflection) -> Vec<String> {
    match reflection {
        Reflection::Phong { diffuse, specular, exponent } => {
            let mut parts = vec![format!("diffuse {diffuse}")];
            if specular.max_element() > 0.0 {
                parts.push(format!("specular {specular} exponent {exponent}"));
            }
            parts
        }
        Reflection::MetallicRoughness {
            base_colour,
            metallic,
            roughness,
            dielectric,
            grazing,
            transmission,
        } => {
            let mut parts = vec![format!(
                "base colour {base_colour}, metallic {metallic}, roughness {roughness}, dielectric {dielectric}"
            )];
            if *grazing < 1.0 {
                parts.push(format!("grazing {grazing}"));
            }
            if let Some(transmission) = transmission {
                let kind = if transmission.is_volume { "into a volume" } else { "through a thin wall" };
                parts.push(format!(
                    "transmission {} {kind}, ior {}, absorption {} / m",
                    transmission.factor, transmission.ior, transmission.absorption
                ));
            }
            parts
        }
    }
}
