//! Assignments to materials, lights and the environment.

use glam::Vec3;

use crate::error::SceneError;
use crate::{
    Environment, LightAxes, Material, PunctualKind, PunctualLight, Reflection, Scene, SceneContents,
    Transmission,
};

fn scene() -> Scene {
    let material = |name: &str| Material::lambertian(name, Vec3::splat(0.5));
    let mut materials = ["floor", "wall.left", "a=b", "floor"].map(material).to_vec();
    materials.push(Material::new("metal", METAL));
    Scene::from(SceneContents { materials, ..SceneContents::default() })
}

const METAL: Reflection = Reflection::MetallicRoughness {
    base_colour: Vec3::splat(0.9),
    metallic: 1.0,
    roughness: 0.5,
    dielectric: Vec3::splat(0.04),
    grazing: 1.0,
    transmission: None,
};

fn exponent(material: &Material) -> f32 {
    let Reflection::Phong { exponent, .. } = material.reflection else { panic!("{material:?}") };
    exponent
}

#[test]
fn any_dielectric_becomes_glass() {
    let mut scene = scene();
    for assignment in [
        "metal.metallic=0",
        "metal.transmission=0.9",
        "metal.thickness=0.01",
        "metal.ior=1.33",
        "floor.alpha=0.5",
    ] {
        scene.apply(assignment).unwrap();
    }
    let Reflection::MetallicRoughness { dielectric, transmission, .. } = scene.materials[4].reflection else {
        panic!("{:?}", scene.materials[4]);
    };
    assert!((dielectric.x - 0.020_06).abs() < 1e-4, "{dielectric}");
    let glass = Transmission { factor: 0.9, ior: 1.33, is_volume: true, absorption: Vec3::ZERO };
    assert_eq!(transmission, Some(glass));
    assert!(scene.materials[0].blends && scene.materials[0].alpha == 0.5);
    assert!(scene.apply("floor.ior=1.5").is_err());
    for impossible in ["metal.ior=0.5", "metal.ior=nan", "metal.thickness=-3", "metal.thickness=nan"] {
        assert!(scene.apply(impossible).is_err(), "{impossible}");
    }
    assert!(scene.apply("metal.transmission=2").is_err());
}

#[test]
fn each_property_is_set_on_every_material_of_the_name() {
    let mut scene = scene();
    for assignment in
        ["floor.exponent=32", "floor.specular=0.1,0.2,0.3", "floor.diffuse=.25", "floor.emission= 5"]
    {
        scene.apply(assignment).unwrap();
    }
    for index in [0, 3] {
        let mut expected = Material::phong("floor", Vec3::splat(0.25), Vec3::new(0.1, 0.2, 0.3), 32.0);
        expected.emission = Vec3::splat(5.0);
        assert_eq!(scene.materials[index], expected);
    }
    assert_eq!(exponent(&scene.materials[1]), 0.0);
}

#[test]
fn metallic_roughness_properties_are_set_on_such_materials_alone() {
    let mut scene = scene();
    for assignment in ["metal.metallic=0.5", "metal.roughness=0.25", "metal.diffuse=0.1,0.2,0.3"] {
        scene.apply(assignment).unwrap();
    }
    let reflection = scene.materials[4].reflection;
    let Reflection::MetallicRoughness { base_colour, metallic, roughness, .. } = reflection else {
        panic!("{reflection:?}")
    };
    assert_eq!((base_colour, metallic, roughness), (Vec3::new(0.1, 0.2, 0.3), 0.5, 0.25));
}

#[test]
fn names_may_hold_dots_and_equals_signs() {
    let mut scene = scene();
    scene.apply("wall.left.exponent=2").unwrap();
    scene.apply("a=b.exponent=3").unwrap();
    assert_eq!([1, 2].map(|index| exponent(&scene.materials[index])), [2.0, 3.0]);
}

#[test]
fn an_unknown_material_is_refused_with_similar_names() {
    let error = scene().apply("flor.exponent=32").unwrap_err();
    let help = miette::Diagnostic::help(&error).unwrap().to_string();
    assert!(matches!(error, SceneError::UnknownMaterial { .. }));
    assert!(help.starts_with("choose one of: 'floor', "), "{help}");
}

#[test]
fn bad_settings_change_nothing() {
    let untouched = scene();
    for assignment in [
        "",
        "floor",
        "floor.exponent",
        "floor=3",
        "floor.gloss=3",
        "floor.exponent=",
        "floor.exponent=x",
        "floor.exponent=1,2,3",
        "floor.exponent=-1",
        "floor.exponent=10001",
        "floor.exponent=nan",
        "floor.diffuse=1,2",
        "floor.diffuse=1.5",
        "floor.diffuse=inf",
        "floor.specular=0.6",
        "floor.specular=-0.1",
        "floor.emission=-1",
        "floor.emission=inf",
        "floor.emission=1,,2",
        "floor.metallic=1",
        "floor.roughness=1",
        "metal.specular=0.1",
        "metal.exponent=4",
        "metal.metallic=1.5",
        "metal.roughness=-1",
        "metal.roughness=0,0,0",
        "metal.diffuse=2",
        ".exponent=1",
        "=",
    ] {
        let mut scene = scene();
        let error = scene.apply(assignment).unwrap_err();
        assert!(miette::Diagnostic::help(&error).is_some(), "{assignment}");
        assert!(error.to_string().contains(&format!("`{assignment}`")), "{error}");
        assert_eq!(scene.materials, untouched.materials, "{assignment}");
    }
}

/// An assignment changes either all materials of a name, or none.
#[test]
fn materials_of_one_name_change_together() {
    let mut scene = scene();
    scene.materials[3] = Material::lambertian("floor", Vec3::ONE);
    let before = scene.materials.clone();
    assert!(scene.apply("floor.specular=0.3").is_err());
    assert_eq!(scene.materials, before);
}

fn lit() -> Scene {
    let at = |name: &str, kind| PunctualLight {
        name: name.into(),
        kind,
        intensity: Vec3::new(2.0, 4.0, 1.0),
        axes: LightAxes::default(),
    };
    let position = Vec3::ONE;
    let lights = vec![
        at("bulb", PunctualKind::Point { position }),
        at("sun", PunctualKind::Directional { direction: Vec3::NEG_Y, angle: 0.0 }),
        at("pair", PunctualKind::Point { position }),
        at("pair", PunctualKind::Point { position }),
    ];
    let environment = Environment::constant(Vec3::new(0.5, 1.0, 2.0));
    scene().with(|scene| (scene.lights, scene.environment) = (lights, Some(environment)))
}

#[test]
fn colour_and_intensity_of_a_light_are_independent() {
    let mut scene = lit();
    scene.apply("bulb.intensity=8").unwrap();
    assert_eq!(scene.lights[0].intensity, Vec3::new(4.0, 8.0, 2.0));
    scene.apply("bulb.colour=0.5,0,0.25").unwrap();
    assert_eq!(scene.lights[0].intensity, Vec3::new(8.0, 0.0, 4.0));
    scene.apply("sun.intensity=0").unwrap();
    scene.apply("sun.colour=1,0,0").unwrap();
    assert_eq!(scene.lights[1].intensity, Vec3::ZERO);
    scene.apply("sun.intensity=3").unwrap();
    assert_eq!(scene.lights[1].intensity, Vec3::splat(3.0));
    scene.apply("pair.intensity=1").unwrap();
    assert!(scene.lights[2..].iter().all(|light| light.intensity == Vec3::new(0.5, 1.0, 0.25)));
}

#[test]
fn a_light_with_a_place_is_moved() {
    let mut scene = lit();
    scene.apply("bulb.position=1,-2,3").unwrap();
    assert_eq!(scene.lights[0].kind, PunctualKind::Point { position: Vec3::new(1.0, -2.0, 3.0) });
}

#[test]
fn a_directional_light_comes_from_a_disk_of_an_angle() {
    let mut scene = lit();
    let before = scene.checksum().to_owned();
    scene.apply("sun.angle=90").unwrap();
    let kind = PunctualKind::Directional { direction: Vec3::NEG_Y, angle: std::f32::consts::FRAC_PI_2 };
    assert_eq!(scene.lights[1].kind, kind);
    assert_ne!(scene.checksum(), before);
    scene.apply("sun.angle=0").unwrap();
    assert_eq!(scene.checksum(), before);
}

#[test]
fn the_strength_of_the_environment_is_replaced() {
    let mut scene = lit();
    let before = scene.checksum().to_owned();
    for (strength, is_lit) in [("3", true), ("0", false), ("2.5", true)] {
        scene.apply(&format!("environment.strength={strength}")).unwrap();
        let environment = scene.environment.as_ref().unwrap();
        assert_eq!((environment.strength.to_string().as_str(), environment.is_lit()), (strength, is_lit));
        assert_ne!(scene.checksum(), before);
    }
    scene.apply("environment.strength=1").unwrap();
    assert_eq!(scene.checksum(), before);
}

#[test]
fn bad_settings_of_lights_are_refused_with_a_remedy() {
    let mut scene = lit();
    let untouched = scene.clone();
    for (assignment, said) in [
        ("bulb.intensity=1,2,3", "one number"),
        ("bulb.intensity=-1", "intensity"),
        ("bulb.intensity=inf", "intensity"),
        ("bulb.colour=0", "colour"),
        ("bulb.colour=-1,0,0", "colour"),
        ("bulb.position=1", "three numbers"),
        ("bulb.position=1,2,nan", "position"),
        ("sun.position=1,2,3", "directional"),
        ("sun.angle=1,2,3", "one number"),
        ("sun.angle=181", "0 to 180"),
        ("sun.angle=nan", "0 to 180"),
        ("bulb.angle=1", "no directional"),
        ("pair.position=1,2,3", "2 lights"),
        ("lamp.intensity=1", "'bulb'"),
        ("floor.intensity=1", "'floor' is a material"),
        ("bulb.diffuse=1", "'bulb' is a light"),
        ("bulb.strength=1", "environment"),
        ("environment.strength=1,2,3", "one number"),
        ("environment.strength=-1", "strength"),
        ("environment.strength=1e20", "strength"),
        ("environment.colour=1,2,3", "'bulb'"),
    ] {
        let error = scene.apply(assignment).unwrap_err();
        let text = format!("{error} {}", miette::Diagnostic::help(&error).unwrap());
        assert!(text.contains(said), "{assignment}: {text}");
        assert_eq!((&scene.lights, &scene.environment), (&untouched.lights, &untouched.environment));
        assert_eq!(scene.materials, untouched.materials);
    }
    let mut dark = lit().with(|scene| scene.environment = None);
    let error = dark.apply("environment.strength=1").unwrap_err().to_string();
    assert!(error.contains("no environment"), "{error}");
}
