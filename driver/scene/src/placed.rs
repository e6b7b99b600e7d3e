//! Instances of a scene: their bounds, triangle counts and areas, and their expansion to triangles.

use glam::Vec3;
use photoncard_shared::layout::{placed_point, placed_vector};

use crate::contents::SceneContents;
use crate::instance::Instance;
use crate::triangle::{NO_TANGENTS, Triangle, bounds_of};
use crate::{Material, Reflection, Scene, Transmission};

impl Scene {
    /// Instances, each with the lower and the upper corner of the box around it, metres.
    pub fn instance_bounds(&self) -> impl Iterator<Item = (&Instance, [Vec3; 2])> {
        let groups: Vec<_> = self.groups.iter().map(|group| bounds_of(group)).collect();
        self.instances
            .iter()
            .filter_map(move |instance| Some((instance, instance.bounds(groups[instance.group as usize]?))))
    }

    /// Number of triangles in the scene, including the triangles of every instance.
    pub fn placed_triangles(&self) -> u64 {
        let of_instance = |instance: &Instance| self.groups[instance.group as usize].len() as u64;
        self.triangles.len() as u64 + self.instances.iter().map(of_instance).sum::<u64>()
    }

    /// Area of all surfaces, m^2. An instance counts with the area of its group, multiplied by
    /// [`Instance::area_factor`].
    pub fn area(&self) -> f64 {
        let of =
            |triangles: &[Triangle]| triangles.iter().map(|triangle| triangle.area() as f64).sum::<f64>();
        let groups: Vec<f64> = self.groups.iter().map(|group| of(group)).collect();
        let of_instance = |instance: &Instance| groups[instance.group as usize] * instance.area_factor();
        of(&self.triangles) + self.instances.iter().map(of_instance).sum::<f64>()
    }

    /// Returns for each material whether it emits, focuses or transmits light. Triangles of such a material
    /// must be in world space, because lights, caustics and solid glass are found there.
    pub(crate) fn copied_materials(&self) -> Vec<bool> {
        let transmits = |material: &Material| match material.reflection {
            Reflection::MetallicRoughness { transmission: Some(Transmission { factor, .. }), .. } => {
                factor > 0.0
            }
            _ => false,
        };
        let focuses = self.specular_materials().into_iter();
        let materials = self.materials.iter().zip(focuses);
        materials
            .map(|(material, focuses)| focuses || material.is_emissive() || transmits(material))
            .collect()
    }

    /// Returns for each group whether its instances must be expanded to triangles: a material of the group
    /// emits, focuses or transmits light. The loader makes no such groups, but a setting may change a
    /// material later.
    pub fn expanded_groups(&self) -> Vec<bool> {
        let copied = self.copied_materials();
        let expands = |group: &Vec<Triangle>| group.iter().any(|triangle| copied[triangle.material as usize]);
        self.groups.iter().map(expands).collect()
    }

    /// Number of triangles and instances that a card stores of [`Self::expanded`].
    pub fn stored_if_expanded(&self, groups: &[bool]) -> usize {
        let kept = self.groups.iter().zip(groups).filter(|(_, expands)| !**expands);
        let of_instance = |instance: &Instance| {
            let group = instance.group as usize;
            if groups[group] { self.groups[group].len() } else { 1 }
        };
        self.triangles.len()
            + kept.map(|(group, _)| group.len()).sum::<usize>()
            + self.instances.iter().map(of_instance).sum::<usize>()
    }

    /// Copy of the scene in which the instances of the chosen groups are triangles in world space.
    pub fn expanded(&self, groups: &[bool]) -> Self {
        self.clone().with(|scene| {
            let (expanded, kept) = std::mem::take(&mut scene.instances)
                .into_iter()
                .partition::<Vec<Instance>, _>(|instance| groups[instance.group as usize]);
            expanded.iter().for_each(|instance| scene.add_triangles(instance));
            // Groups without instances would still be stored on a card.
            let mut expands = groups.iter();
            scene.groups.retain(|_| expands.next() == Some(&false));
            let mut next = 0;
            let number = |expands: &bool| {
                let number = next;
                next += u32::from(!expands);
                number
            };
            let numbers: Vec<u32> = groups.iter().map(number).collect();
            let renumbered =
                |instance: Instance| Instance { group: numbers[instance.group as usize], ..instance };
            scene.instances = kept.into_iter().map(renumbered).collect();
        })
    }
}

impl SceneContents {
    /// Triangles of an instance in world space. They keep the attribute indices of the group's triangles.
    pub(crate) fn placed(&self, instance: &Instance) -> impl Iterator<Item = Triangle> {
        let to_world = instance.to_world;
        let place = move |vertex: Vec3| placed_point(&to_world, vertex.to_array()).into();
        let group = self.groups[instance.group as usize].iter();
        let object = instance.object;
        group.map(move |triangle| Triangle { vertices: triangle.vertices.map(place), object, ..*triangle })
    }

    /// Adds the triangles of an instance in world space, with transformed copies of the group's attributes.
    fn add_triangles(&mut self, instance: &Instance) {
        let placed: Vec<_> = self.placed(instance).collect();
        for mut triangle in placed {
            if let Some(attributes) = self.attributes.get(triangle.attributes as usize) {
                let mut attributes = instance.attributes(attributes);
                if attributes.tangents != NO_TANGENTS {
                    let tangents = self.tangents[attributes.tangents as usize].map(|tangent| {
                        let along = placed_vector(&instance.to_world, tangent.truncate().to_array());
                        Vec3::from(along).normalize_or_zero().extend(tangent.w)
                    });
                    attributes.tangents = self.tangents.len() as u32;
                    self.tangents.push(tangents);
                }
                triangle.attributes = self.attributes.len() as u32;
                self.attributes.push(attributes);
            }
            self.triangles.push(triangle);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DQuat, DVec3};

    use super::*;
    use crate::Material;

    fn turned(angle: f64, scale: f64) -> DMat4 {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), angle);
        DMat4::from_scale_rotation_translation(DVec3::splat(scale), turn, DVec3::new(4.0, -5.0, 6.0))
    }

    fn scene(material: Material) -> Scene {
        let group = vec![Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0)];
        Scene::default().with(|scene| {
            scene.materials = vec![material];
            scene.groups = vec![group];
            scene.instances =
                (0..3).filter_map(|index| Instance::new(0, &turned(f64::from(index), 2.0))).collect();
        })
    }

    #[test]
    fn a_transform_that_mirrors_or_flattens_places_no_instance() {
        assert!(Instance::new(0, &turned(1.0, 3.0)).is_some());
        assert!(Instance::new(0, &turned(1.0, -3.0)).is_none());
        assert!(Instance::new(0, &turned(1.0, 0.0)).is_none());
        assert!(Instance::new(0, &DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
        assert!(Instance::new(0, &DMat4::from_scale(DVec3::splat(f64::NAN))).is_none());
        let stretched =
            |by: f64| turned(1.0, 1.0) * DMat4::from_scale(DVec3::new(1.0, by, 1.0)) * turned(2.0, 1.0);
        assert!(Instance::new(0, &stretched(0.05)).is_some());
        assert!(Instance::new(0, &stretched(1e-3)).is_none());
    }

    #[test]
    fn expanded_instances_have_the_bounds_the_area_and_the_number_of_the_instances() {
        let matte = scene(Material::lambertian("leaf", Vec3::ONE));
        assert_eq!(matte.expanded_groups(), [false], "matte groups stay");
        let mut lamp = Material::lambertian("lamp", Vec3::ONE);
        lamp.emission = Vec3::ONE;
        let lamp = scene(lamp);
        assert_eq!(lamp.expanded_groups(), [true]);
        let expanded = lamp.expanded(&[true]);
        assert_eq!((expanded.triangles.len(), expanded.instances.len()), (3, 0));
        assert_eq!(lamp.placed_triangles(), 3);
        assert_eq!([[true], [false]].map(|groups| lamp.stored_if_expanded(&groups)), [3, 4]);
        assert!((lamp.area() - expanded.area()).abs() < 1e-5 && (lamp.area() - 6.0).abs() < 1e-5);
        let [(lower, upper), (low, high)] = [lamp.bounds(), expanded.bounds()];
        // The box of a turned box contains the turned triangle.
        assert!(lower.cmple(low).all() && upper.cmpge(high).all() && lower.distance(low) < 2.0);
    }
}
