//! Scenes with a large plane ground and detail only in a small part of it, such as a product on a ground of
//! many kilometres.
//!
//! Photons are stored only in this part and its surroundings. Their coordinates have 20 bits: on a ground of
//! 10 km they would be multiples of 1 cm, and few photons of the sky would reach a product of 10 cm. A
//! computed point of a triangle is only as exact as the coordinates of the triangle's corners. Triangles that
//! are larger than their distance from the middle of the part are therefore split.

use glam::{Vec2, Vec3, Vec4};
use photoncard_scene::{NO_ATTRIBUTES, NO_TANGENTS, Scene, SceneContents, Triangle, VertexAttributes};

/// Maximum size of a triangle that counts as detail, relative to the scene's size.
const SHARE_OF_DETAIL: f32 = 1.0 / 64.0;
/// Distance from the bounding box of all detail up to which photons are stored, relative to the size of this
/// box.
const SIZES_AROUND: f32 = 256.0;
/// Maximum distance of the detail and of the ground's corners from the ground's plane, divided by the
/// distance from the detail up to which photons are stored. At most 1 / 2^12 of the light that the ground
/// reflects to the detail then comes from places without photons.
const MAX_HEIGHT: f32 = 1.0 / 64.0;
/// Maximum number of triangles of the ground, before they are split.
const MAX_GROUND: usize = 1024;
/// Minimum of the distance from the detail up to which photons are stored, relative to the scene's size.
/// Depths, in cells of the photon grid, then fit 64 bits for cameras within the scene.
const MIN_SHARE: f32 = 1.0 / 8192.0;
/// Margin for rounding beyond the scene's bounds, relative to the distance from the detail up to which
/// photons are stored.
const MARGIN: f32 = 1e-3;
/// Size up to which triangles are never split, relative to the size of the part of the scene in which photons
/// are stored.
const SHARE_OF_PART: f32 = 1.0 / 32.0;

/// Returns the box in which photons are stored: its lower and upper corner, metres. It contains all detail of
/// a scene and the surroundings. Returns `None` unless the box is less than half as large as the scene and
/// all triangles that are no detail lie in one plane.
pub(crate) fn detailed_part(scene: &Scene) -> Option<[Vec3; 2]> {
    let (lower, upper) = scene.bounds();
    let size = (upper - lower).max_element();
    let is_detail = |triangle: &&Triangle| {
        let [low, high] = ends(&triangle.vertices);
        (high - low).max_element() < SHARE_OF_DETAIL * size
    };
    let instances: Vec<_> = scene.instance_bounds().map(|(_, corners)| corners).collect();
    if instances.iter().any(|[low, high]| (high - low).max_element() >= SHARE_OF_DETAIL * size) {
        return None;
    }
    let detail = scene.triangles.iter().filter(is_detail).map(|triangle| ends(&triangle.vertices));
    let detail = detail.chain(instances);
    let [low, high] = detail.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])?;
    let around = (SIZES_AROUND * (high - low).max_element()).max(MIN_SHARE * size);
    let margin = MARGIN * around;
    let part = [(lower - margin).max(low - around), (upper + margin).min(high + around)];
    let is_smaller = (part[1] - part[0]).max_element() < 0.5 * size;
    let ground = || scene.triangles.iter().filter(|triangle| !is_detail(triangle));
    (is_smaller && is_plane(ground(), [low, high], MAX_HEIGHT * around)).then_some(part)
}

/// Returns whether there are 1 to [`MAX_GROUND`] triangles, and they and `corners` lie within `distance`
/// metres of one plane.
fn is_plane<'s>(
    triangles: impl Iterator<Item = &'s Triangle> + Clone,
    corners: [Vec3; 2],
    distance: f32,
) -> bool {
    let largest = triangles.clone().max_by(|a, b| a.area().total_cmp(&b.area()));
    let Some(largest) = largest.filter(|_| triangles.clone().count() <= MAX_GROUND) else { return false };
    let (origin, normal) = (largest.vertices[0], largest.scaled_normal().normalize_or_zero());
    let mut all = triangles.flat_map(|triangle| triangle.vertices).chain(corners);
    normal != Vec3::ZERO && all.all(|place| normal.dot(place - origin).abs() <= distance)
}

/// Splits triangles until each is at most as large as its distance from the centre of a box, or as
/// `SHARE_OF_PART` of the box's size.
pub(crate) fn split_around(scene: &Scene, [lower, upper]: [Vec3; 2]) -> Scene {
    let centre = lower.midpoint(upper);
    let least = SHARE_OF_PART * (upper - lower).max_element();
    let is_large = |vertices: &[Vec3; 3]| {
        let [low, high] = ends(vertices);
        let distance = centre.distance(centre.clamp(low, high));
        // If the middle of an edge is rounded to one of its ends, one half is the whole triangle and
        // splitting would never end.
        let is_divisible = || !halves(longest_edge(vertices), *vertices, Vec3::midpoint).contains(vertices);
        (high - low).max_element() > least.max(distance) && is_divisible()
    };
    scene.clone().with(|scene| {
        let mut index = 0;
        while index < scene.triangles.len() {
            let triangle = scene.triangles[index];
            if is_large(&triangle.vertices) {
                let [first, second] = halves_of(scene, &triangle);
                scene.triangles[index] = first;
                scene.triangles.push(second);
            } else {
                index += 1;
            }
        }
    })
}

/// Halves of a triangle, split at the middle of its longest edge. Their attributes are added to the scene.
fn halves_of(scene: &mut SceneContents, triangle: &Triangle) -> [Triangle; 2] {
    let edge = longest_edge(&triangle.vertices);
    let vertices = halves(edge, triangle.vertices, Vec3::midpoint);
    let attributes = if triangle.attributes == NO_ATTRIBUTES {
        [NO_ATTRIBUTES; 2]
    } else {
        let own = scene.attributes[triangle.attributes as usize];
        let tangents = if own.tangents == NO_TANGENTS {
            [NO_TANGENTS; 2]
        } else {
            let own = scene.tangents[own.tangents as usize];
            halves(edge, own, middle_tangent).map(|half| pushed(&mut scene.tangents, half))
        };
        let normals = own.normals.map(|normals| halves(edge, normals, middle_normal));
        let coordinates = own.coordinates.map(|set| halves(edge, set, Vec2::midpoint));
        let colours = halves(edge, own.colours, |a, b| Vec4::from(a).midpoint(b.into()).to_array());
        [0, 1].map(|half: usize| {
            let attributes = VertexAttributes {
                normals: normals.map(|normals| normals[half]),
                coordinates: coordinates.map(|set| set[half]),
                colours: colours[half],
                tangents: tangents[half],
            };
            pushed(&mut scene.attributes, attributes)
        })
    };
    [0, 1].map(|half: usize| Triangle { vertices: vertices[half], attributes: attributes[half], ..*triangle })
}

/// Returns the index of the corner at which a triangle's longest edge begins. Lengths are by the maximum
/// norm.
fn longest_edge(vertices: &[Vec3; 3]) -> usize {
    let length = |edge: usize| (vertices[edge] - vertices[(edge + 1) % 3]).abs().max_element();
    (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0)
}

/// Splits the values at a triangle's corners into the values of its two halves. The triangle is split at the
/// middle of edge `edge`. Corners keep their order.
fn halves<T: Copy>(edge: usize, corners: [T; 3], middle: impl Fn(T, T) -> T) -> [[T; 3]; 2] {
    let end = (edge + 1) % 3;
    let middle = middle(corners[edge], corners[end]);
    let [mut first, mut second] = [corners; 2];
    (first[end], second[edge]) = (middle, middle);
    [first, second]
}

fn middle_normal(a: Vec3, b: Vec3) -> Vec3 {
    a.midpoint(b).try_normalize().unwrap_or(a)
}

fn middle_tangent(a: Vec4, b: Vec4) -> Vec4 {
    middle_normal(a.truncate(), b.truncate()).extend(a.w)
}

/// Adds a value to a list, and returns its index.
fn pushed<T>(list: &mut Vec<T>, value: T) -> u32 {
    list.push(value);
    (list.len() - 1) as u32
}

/// Lower and upper corner of a triangle's bounding box.
fn ends([a, b, c]: &[Vec3; 3]) -> [Vec3; 2] {
    [a.min(*b).min(*c), a.max(*b).max(*c)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ground of the given size, with texture coordinates from 0 to 1, and a small triangle on it.
    fn scene(size: f32) -> Scene {
        above_ground(size, 0.0)
    }

    /// [`scene`] with the triangle at a height above the ground, metres.
    fn above_ground(size: f32, height: f32) -> Scene {
        let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z) * size;
        let corners = [corner(-0.5, -0.5), corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5)];
        let halves = [[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|index: usize| corners[index]));
        Scene::default().with(|scene| {
            for (attributes, vertices) in (0..).zip(halves) {
                let across = vertices.map(|corner| Vec2::new(corner.x, corner.z) / size + 0.5);
                scene.attributes.push(VertexAttributes {
                    normals: Some([Vec3::Y; 3]),
                    coordinates: [across; 2],
                    ..VertexAttributes::NONE
                });
                scene.triangles.push(Triangle { vertices, material: 0, attributes, object: 0 });
            }
            let corners = [Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.1];
            scene.triangles.push(Triangle::new(corners.map(|corner| corner + Vec3::Y * height), 0));
        })
    }

    #[test]
    fn photons_are_stored_in_the_whole_of_a_scene_unless_its_detail_is_in_a_small_part() {
        for size in [1.0, 20.0, 50.0] {
            assert_eq!(detailed_part(&scene(size)), None, "{size} m");
        }
        for size in [1e3, 1e5, 1e6] {
            let [lower, upper] = detailed_part(&scene(size)).expect("a small part");
            let around = 25.6_f32.max(size / 8192.0);
            assert!((lower + Vec3::new(around, 0.0, around)).length() < 2e-3 * around, "{size} m: {lower}");
            assert!(upper.x < 0.11 + around && upper.z < 0.01 + around, "{size} m: {upper}");
            assert!(lower.y < 0.0 && upper.y > 0.1, "{size} m: {lower} {upper}");
        }
    }

    #[test]
    fn photons_are_stored_in_the_whole_of_a_scene_whose_far_surfaces_light_its_detail() {
        assert_eq!(detailed_part(&above_ground(1e4, 50.0)), None, "detail high above the ground");
        let wall = [Vec3::ZERO, Vec3::Y * 900.0, Vec3::X * 900.0].map(|corner| corner + Vec3::Z * 500.0);
        let walled = scene(1e4).with(|scene| scene.triangles.push(Triangle::new(wall, 0)));
        assert_eq!(detailed_part(&walled), None, "a wall far away");
    }

    #[test]
    fn triangles_are_split_until_they_are_as_small_as_they_are_near() {
        let whole = scene(1e6);
        let part = detailed_part(&whole).expect("a small part");
        let split = split_around(&whole, part);
        assert!(split.triangles.len() < 2_000, "{}", split.triangles.len());
        let area = |scene: &Scene| scene.triangles.iter().map(|own| f64::from(own.area())).sum::<f64>();
        assert!((area(&split) / area(&whole) - 1.0).abs() < 1e-6);
        let centre = part[0].midpoint(part[1]);
        for triangle in &split.triangles {
            let [low, high] = ends(&triangle.vertices);
            let distance = centre.distance(centre.clamp(low, high));
            let most = distance.max((part[1] - part[0]).max_element() / 32.0);
            assert!((high - low).max_element() <= most, "{triangle:?}");
        }
    }

    #[test]
    fn halves_have_the_attributes_of_their_whole() {
        let whole = scene(1e5);
        let split = split_around(&whole, detailed_part(&whole).expect("a small part"));
        for triangle in split.triangles.iter().filter(|triangle| triangle.attributes != NO_ATTRIBUTES) {
            let attributes = split.attributes[triangle.attributes as usize];
            assert_eq!(attributes.normals, Some([Vec3::Y; 3]));
            assert!(triangle.scaled_normal().y > 0.0, "{triangle:?}");
            for (corner, across) in triangle.vertices.into_iter().zip(attributes.coordinates[1]) {
                let stated = Vec2::new(corner.x, corner.z) / 1e5 + 0.5;
                assert!(across.distance(stated) < 1e-6, "{across} instead of {stated}");
            }
        }
    }
}
