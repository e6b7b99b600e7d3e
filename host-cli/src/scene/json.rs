//! Contents of a scene as JSON with stable keys.

use glam::Vec3;
use photoncard_driver::scene::gltf::Animation;
use photoncard_driver::scene::{
    Camera, Encoding, Image, Material, Projection, PunctualKind, PunctualLight, Reflection, Scene,
};
use serde_json::{Value, json};

/// Contents of a scene, without vertices and texels.
pub(super) fn contents(scene: &Scene, animations: &[Animation]) -> Value {
    let (lower, upper) = scene.bounds();
    json!({
        "checksum": scene.checksum(),
        "triangles": scene.placed_triangles(),
        "instances": scene.instances.len(),
        "emissive_triangles": scene.emissive_triangles(),
        "skipped_triangles": scene.skipped_triangles,
        "bounds": [scene.in_file(lower).to_array(), scene.in_file(upper).to_array()],
        "textures": scene.textures.len(),
        "cameras": scene.cameras.iter().map(|item| camera(item, scene)).collect::<Vec<_>>(),
        "animations": animations.iter().map(animation).collect::<Vec<_>>(),
        "lights": scene.lights.iter().map(|item| light(item, scene)).collect::<Vec<_>>(),
        "materials": scene.materials.iter().map(material).collect::<Vec<_>>(),
        "images": scene.images.iter().map(image).collect::<Vec<_>>(),
        "variants": scene.variants,
        "generator": scene.generator,
        "ignored": scene.notices,
        "remarks": scene.remarks,
    })
}

fn camera(camera: &Camera, scene: &Scene) -> Value {
    let Camera { name, origin, forward, up, projection, shift, lens, aspect, right: _ } = camera;
    let mut described = json!({
        "name": name,
        "at": scene.in_file(*origin).to_array(),
        "forward": forward.to_array(),
        "up": up.to_array(),
        "projection": projection.name(),
        "aspect": aspect,
        "shift": shift,
        "aperture": lens.map(|lens| 2.0 * lens.radius),
        "focus": lens.map(|lens| lens.focus),
    });
    match projection {
        Projection::Perspective { vertical_fov } => described["fov"] = json!(vertical_fov.to_degrees()),
        Projection::Orthographic { half_height } => described["height"] = json!(2.0 * half_height),
        Projection::Panorama { angles } => described["angles"] = json!(angles.map(f32::to_degrees)),
    }
    described
}

fn animation(animation: &Animation) -> Value {
    let Animation { name, seconds, moves_only_cameras } = animation;
    json!({"name": name, "seconds": seconds, "moves_only_cameras": moves_only_cameras})
}

fn light(light: &PunctualLight, scene: &Scene) -> Value {
    let place = |position: Vec3| Some(scene.in_file(position).to_array());
    let PunctualLight { name, kind, intensity, axes } = light;
    let degrees = |cosine: f32| cosine.clamp(-1.0, 1.0).acos().to_degrees();
    let disk = |angle: f32| (angle > 0.0).then(|| angle.to_degrees());
    let (kind, position, direction, cone, angle) = match kind {
        PunctualKind::Point { position } => ("point", place(*position), None, None, None),
        PunctualKind::Spot { position, direction, inner_cosine, outer_cosine } => {
            let cone = [degrees(*inner_cosine), degrees(*outer_cosine)];
            ("spot", place(*position), Some(direction.to_array()), Some(cone), None)
        }
        PunctualKind::Directional { direction, angle } => {
            ("directional", None, Some(direction.to_array()), None, disk(*angle))
        }
        PunctualKind::Profile { position, .. } => {
            ("profile", place(*position), Some(axes.aim.to_array()), None, None)
        }
    };
    json!({
        "name": name,
        "kind": kind,
        "at": position,
        "direction": direction,
        "cone_degrees": cone,
        "angle_degrees": angle,
        "intensity": intensity.to_array(),
    })
}

fn material(material: &Material) -> Value {
    json!({
        "name": material.name,
        "reflection": reflection(&material.reflection),
        "emission": material.emission.to_array(),
        "double_sided": material.double_sided,
        "alpha": material.alpha,
        "alpha_cutoff": material.alpha_cutoff,
        "blends": material.blends,
        "base_texture": material.base_texture,
        "metallic_roughness_texture": material.metallic_roughness_texture,
        "emissive_texture": material.emissive_texture,
    })
}

fn reflection(reflection: &Reflection) -> Value {
    match reflection {
        Reflection::Phong { diffuse, specular, exponent } => json!({
            "model": "phong",
            "diffuse": diffuse.to_array(),
            "specular": specular.to_array(),
            "exponent": exponent,
        }),
        Reflection::MetallicRoughness { base_colour, metallic, roughness, transmission, .. } => json!({
            "model": "metallic-roughness",
            "base_colour": base_colour.to_array(),
            "metallic": metallic,
            "roughness": roughness,
            "transmission": transmission.map(|transmission| transmission.factor),
            "ior": transmission.map(|transmission| transmission.ior),
        }),
    }
}

fn image(image: &Image) -> Value {
    let encoding = match image.encoding {
        Encoding::Srgb => "srgb",
        Encoding::Linear => "linear",
        Encoding::SharedExponent => "shared-exponent",
        Encoding::LinearPair => "linear-pair",
        Encoding::NormalPair => "normal-pair",
    };
    json!({"name": image.name, "width": image.width, "height": image.height, "encoding": encoding})
}
