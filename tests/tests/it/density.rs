//! The density estimate is unbiased at edges, in corners and on thin walls.

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon_map::{MappedImage, PhotonLayout, PhotonSettings, map_photons};
use photoncard_driver::render::Radiance;
use photoncard_driver::scene::{Encoding, Image, Material, Scene, Texture, Triangle};
use photoncard_firmware::light_groups::LightGroups;
use photoncard_firmware::photon::{
    CandidateBuffer, Estimate, GatherLimits, NearestPhotons, PhotonMap, Reflected, Sight, gather,
    gathered_radiance,
};
use photoncard_firmware::scene::{PartialReflection, Reflection, Surface};
use photoncard_firmware::simd::Level;
use photoncard_tests::shapes::add_textured_quad;
use photoncard_tests::{camera, lambertian, quad, room, scene};

const NEIGHBORS: u32 = 100;
const ALBEDO: f32 = 0.5;

/// Card image with a photon map, in which radiance is gathered.
struct Map {
    image: CardImage,
    max_distance: f32,
    /// Distance of the [`NEIGHBORS`]-th nearest photon from a point of the floor, metres.
    radius: f32,
}

impl Map {
    fn new(scene: &Scene, photons: usize) -> Self {
        let packed = PackedScene::new(scene).unwrap();
        let settings = PhotonSettings {
            camera: None,
            caustic_photons: 0,
            caustic_neighbors: 50,
            seed: 1,
            photons,
            neighbors: NEIGHBORS,
            max_distance: None,
            layout: PhotonLayout::Jensen,
            radiance: Radiance::Density,
        };
        let MappedImage { image, gathers, .. } = map_photons(packed, &settings, &|_| true).unwrap();
        let max_distance = gathers.max_distance;
        let mut buffer = CandidateBuffer::<512>::new();
        let mut nearest = NearestPhotons::new(buffer.view(), NEIGHBORS, max_distance);
        let (header, mut memory) = image.view();
        gather(&header, &mut memory, PhotonMap::Indirect, Vec3::new(0.9, -1.0, 0.0), &mut nearest).unwrap();
        let radius = nearest.radius();
        Self { image, max_distance, radius }
    }

    /// Radiance that a Lambertian surface at `position` reflects, W/(sr m^2). All instruction sets must
    /// agree.
    fn radiance(&self, position: Vec3, normal: Vec3) -> f64 {
        self.radiance_after(f32::INFINITY, position, normal)
    }

    /// [`Self::radiance`] at the end of a gather ray of `length` metres.
    fn radiance_after(&self, length: f32, position: Vec3, normal: Vec3) -> f64 {
        let (scene, mut memory) = self.image.view();
        let mut buffer = CandidateBuffer::<512>::new();
        let mut nearest = NearestPhotons::new(buffer.view(), NEIGHBORS, self.max_distance);
        gather(&scene, &mut memory, PhotonMap::Indirect, position, &mut nearest).unwrap();
        let surface = Surface {
            reflection: Reflection::lambertian(Vec3::splat(ALBEDO)),
            ..Surface::white(position, normal, 1.0)
        };
        let reflection = PartialReflection::encode(
            &surface.reflector(),
            Vec3::splat(scene.header.photon_power_unit),
            1 << 31,
        );
        let lobe = reflection.decode_lobe();
        let radius = nearest.radius();
        let (nearest, reflection) = (&nearest, &reflection);
        let cell = scene.header.photon_grid.cell;
        let estimate =
            || Estimate { nearest, cell, region: None, reflection, lobe, groups: LightGroups::ONE };
        let mut radiances = Level::ALL.iter().filter_map(|level| level.run(estimate()));
        let of_disc = radiances.next().expect("what every processor has");
        assert!(radiances.all(|other| other == of_disc), "{position}");
        let limits = GatherLimits {
            neighbors: NEIGHBORS,
            max_distance: self.max_distance,
            free_within: length,
            groups: LightGroups::ONE,
        };
        let mut searches = 0;
        let mut count = |_: u32, _: &NearestPhotons, _: &Reflected| searches += 1;
        let radiance =
            gathered_radiance((&scene, &mut memory), position, reflection, limits, buffer.view(), &mut count)
                .unwrap();
        let is_simple = of_disc.sight == Sight::Free && length > radius;
        assert!(if is_simple { radiance == of_disc.radiance } else { searches > 0 });
        f64::from(radiance.total(LightGroups::ONE).x)
    }

    /// Mean radiance of a horizontal surface at height `y` along four segments of length `2 half`, each at
    /// `distance` from the y axis.
    fn mean_around(&self, y: f32, distance: f32, half: f32) -> f64 {
        let sides = [-distance, distance].map(|side| {
            let along_z = [-half, half].map(|z| Vec3::new(side, y, z));
            let along_x = [-half, half].map(|x| Vec3::new(x, y, side));
            [along_z, along_x].map(|[from, to]| self.mean_along(from, to, Vec3::Y))
        });
        sides.as_flattened().iter().sum::<f64>() / 4.0
    }

    /// Mean radiance at a hundred points of a segment.
    fn mean_along(&self, from: Vec3, to: Vec3, normal: Vec3) -> f64 {
        let places = (0..100).map(|i| from.lerp(to, (i as f32 + 0.5) / 100.0));
        places.map(|place| self.radiance(place, normal)).sum::<f64>() / 100.0
    }
}

/// Closed room whose walls emit 1: every point reflects rho / (1 - rho) = 1, with rho = [`ALBEDO`].
fn furnace() -> Scene {
    cluttered_furnace(Vec::new(), glowing())
}

fn glowing() -> Material {
    Material { emission: Vec3::ONE, ..lambertian("wall", ALBEDO) }
}

/// Furnace with objects `things` of the material `finish` in it.
fn cluttered_furnace(things: Vec<Triangle>, finish: Material) -> Scene {
    let mut triangles = room([0; 6]);
    triangles.extend(things.into_iter().map(|triangle| Triangle { material: 1, ..triangle }));
    scene(triangles, vec![glowing(), finish], camera(Vec3::ZERO, Vec3::NEG_Z))
}

/// Closed box that faces outwards, from `lower` to `lower + size`.
fn closed_box(lower: Vec3, size: Vec3) -> impl Iterator<Item = Triangle> {
    room([0; 6]).into_iter().map(move |mut triangle| {
        triangle.vertices = triangle.vertices.map(|corner| lower + size * (0.5 + 0.5 * corner));
        // The walls of a room face inwards: their orientation is reversed.
        triangle.vertices.reverse();
        triangle
    })
}

#[test]
fn the_radiance_of_a_wall_is_the_same_up_to_its_edges() {
    let map = Map::new(&furnace(), 300_000);
    for distance in [0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 2.0] {
        let x = 1.0 - distance * map.radius;
        let mean = map.mean_along(Vec3::new(x, -1.0, -0.8), Vec3::new(x, -1.0, 0.8), Vec3::Y);
        // On the edge itself the nearest photon is always a little inside, where the disc fraction is
        // greater.
        let tolerance = if distance == 0.0 { 0.08 } else { 0.05 };
        assert!((mean - 1.0).abs() < tolerance, "at {distance} radii from the edge it is {mean}");
    }
}

#[test]
fn the_mean_radiance_around_a_corner_equals_that_of_the_wall() {
    let map = Map::new(&furnace(), 300_000);
    let mut sum = 0.0;
    for corner in 0..4 {
        let [x, z] = [0, 1].map(|axis| if corner >> axis & 1 == 0 { -1.0_f32 } else { 1.0 });
        for step in 0..20 {
            let along = |offset: f32| x * (1.0 - offset * map.radius);
            let inward = z * (1.0 - (step as f32 + 0.5) / 20.0 * map.radius);
            let [from, to] = [0.0, 1.0].map(|offset| Vec3::new(along(offset), -1.0, inward));
            sum += map.mean_along(from, to, Vec3::Y);
        }
    }
    let mean = sum / 80.0;
    assert!((mean - 1.0).abs() < 0.05, "around the corners it is {mean}");
}

/// The distance between shelves is less than the radius of a gather: a search finds photons of several
/// shelves. Boards reflect on their outsides, sheets on both sides.
#[test]
fn the_radiance_of_stacked_shelves_equals_that_of_the_wall() {
    let top = |shelf: u32| -0.5 + 0.02 * shelf as f32;
    let boards = (0..12).flat_map(|shelf| {
        closed_box(Vec3::new(-0.25, top(shelf) - 0.005, -0.25), Vec3::new(0.5, 0.005, 0.5))
    });
    let sheets = (0..12).flat_map(|shelf| {
        let corner = |x: f32, z: f32| Vec3::new(x, top(shelf), z);
        quad([corner(-0.25, 0.25), corner(0.25, 0.25), corner(0.25, -0.25), corner(-0.25, -0.25)], 0)
    });
    let sheet = Material { double_sided: true, ..glowing() };
    for (shelves, finish) in [(boards.collect(), glowing()), (sheets.collect(), sheet)] {
        let map = Map::new(&cluttered_furnace(shelves, finish), 300_000);
        let (mut within, mut edge) = (0.0, 0.0);
        for shelf in 2..10 {
            let y = top(shelf);
            let along = |z: f32| map.mean_along(Vec3::new(-0.2, y, z), Vec3::new(0.2, y, z), Vec3::Y) / 8.0;
            within += along(0.1 - 0.03 * shelf as f32);
            edge += along(0.24);
        }
        assert!((within - 1.0).abs() < 0.05, "on the shelves it is {within}");
        assert!((edge - 1.0).abs() < 0.07, "at their edge it is {edge}");
    }
}

/// The holes of the lattice, cut out by alpha, are narrower than the radius of a gather.
#[test]
fn the_radiance_of_a_lattice_equals_that_of_the_wall() {
    let lattice =
        Material { alpha_cutoff: Some(0.5), base_texture: Some(0), double_sided: true, ..glowing() };
    let mut furnace = cluttered_furnace(Vec::new(), lattice);
    let texels = [255, 0, 0, 255].map(|alpha| [255, 255, 255, alpha]).to_vec();
    furnace.images.push(Image {
        name: "lattice".into(),
        width: 2,
        height: 2,
        texels,
        encoding: Encoding::Srgb,
    });
    furnace.textures.push(Texture { nearest: true, ..Texture::new(0) });
    let corners = [[-1., 1.], [1., 1.], [1., -1.], [-1., -1.]].map(|[x, z]| Vec3::new(0.4 * x, 0.0, 0.4 * z));
    add_textured_quad(&mut furnace, corners, [[0., 0.], [40., 0.], [40., 40.], [0., 40.]], 1);
    let map = Map::new(&furnace, 300_000);
    let lines = [-0.2, -0.1, 0.0, 0.1, 0.2]
        .map(|z| map.mean_along(Vec3::new(-0.2, 0.0, z), Vec3::new(0.2, 0.0, z), Vec3::Y));
    let mean = lines.iter().sum::<f64>() / 5.0;
    assert!((mean - 1.0).abs() < 0.04, "{mean}");
}

/// Bars and gaps are narrower than the radius of a gather, and the tops of the bars are close above the
/// floor: a search on either finds photons of the other. Double-sided bars are dark inside, and their ends
/// change nothing.
#[test]
fn the_radiance_of_bars_and_of_the_floor_between_them_equals_that_of_the_wall() {
    let bars = (0..40).flat_map(|bar| {
        closed_box(Vec3::new(-0.4 + 0.02 * bar as f32, -0.998, -0.4), Vec3::new(0.01, 0.015, 0.8))
    });
    let bars: Vec<Triangle> = bars.collect();
    // Under equal light, an albedo of 1 without emission is as bright as the furnace's walls.
    let white = Material { double_sided: true, ..lambertian("white", 1.0) };
    for finish in [glowing(), white] {
        let map = Map::new(&cluttered_furnace(bars.clone(), finish), 300_000);
        let (mut top, mut floor) = (0.0, 0.0);
        for bar in 10..30 {
            let x = -0.395 + 0.02 * bar as f32;
            let along = |x: f32, y: f32| {
                map.mean_along(Vec3::new(x, y, -0.35), Vec3::new(x, y, 0.35), Vec3::Y) / 20.0
            };
            top += along(x, -0.983);
            floor += along(x + 0.01, -1.0);
        }
        assert!((top - 1.0).abs() < 0.05, "on the bars it is {top}");
        assert!((floor - 1.0).abs() < 0.05, "on the floor it is {floor}");
    }
}

#[test]
fn light_on_one_side_of_a_thin_wall_does_not_show_on_the_other() {
    // A wall of a millimetre divides the room; light falls on its upper side alone.
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    let mut triangles = room([0, 0, 0, 1, 0, 0]);
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    triangles.extend(quad(
        [corner(-1., 0.001, 1.), corner(1., 0.001, 1.), corner(1., 0.001, -1.), corner(-1., 0.001, -1.)],
        0,
    ));
    triangles.extend(quad(
        [corner(-1., 0., -1.), corner(1., 0., -1.), corner(1., 0., 1.), corner(-1., 0., 1.)],
        0,
    ));
    let scene = scene(triangles, vec![lambertian("wall", ALBEDO), lamp], camera(Vec3::ZERO, Vec3::NEG_Z));
    let map = Map::new(&scene, 100_000);
    let upper = map.mean_along(Vec3::new(-0.5, 0.001, 0.0), Vec3::new(0.5, 0.001, 0.0), Vec3::Y);
    let lower = map.mean_along(Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0), Vec3::NEG_Y);
    assert!(upper > 0.2, "{upper}");
    assert_eq!(lower, 0.0);
}

/// A board is behind a wall. The board's side towards the wall has the normal of the wall's lit side, but the
/// wall keeps all light from the board.
#[test]
fn light_on_a_wall_does_not_show_on_the_back_of_furniture_behind_it() {
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    for gap in [0.002, 0.01, 0.03, 0.06] {
        let mut triangles = room([0, 0, 0, 1, 0, 0]);
        let sheet = |half: f32, y: f32| {
            let corner = |x: f32, z: f32| Vec3::new(half * x, y, half * z);
            quad([corner(-1., 1.), corner(1., 1.), corner(1., -1.), corner(-1., -1.)], 2)
        };
        triangles.extend([sheet(1.0, 0.0), sheet(0.5, -gap)].as_flattened());
        let sheets = Material { double_sided: true, ..lambertian("sheet", ALBEDO) };
        let materials = vec![lambertian("wall", ALBEDO), lamp.clone(), sheets];
        let map = Map::new(&scene(triangles, materials, camera(Vec3::ZERO, Vec3::NEG_Z)), 100_000);
        assert!(map.radiance(Vec3::ZERO, Vec3::Y) > 0.2);
        for x in [0.0, 0.2, 0.4, 0.48] {
            let radiance = map.radiance_after(0.02, Vec3::new(x, -gap, 0.1), Vec3::Y);
            assert_eq!(radiance, 0.0, "{x} m from the middle, {gap} m behind the wall");
        }
    }
}

/// Walls and floor around the cube from -1 to 1, each a box. They touch along the edges of the cube; if
/// `overlap`, the floor extends below the walls.
fn walls_of_boxes(thickness: f32, overlap: bool) -> Vec<Triangle> {
    let wall = |side: usize| {
        let axis = side / 2;
        let beyond = if overlap && axis == 1 { 1.0 + thickness } else { 1.0 };
        let (mut lower, mut size) = (Vec3::splat(-beyond), Vec3::splat(2.0 * beyond));
        size[axis] = thickness;
        lower[axis] = if side.is_multiple_of(2) { -1.0 - thickness } else { 1.0 };
        closed_box(lower, size)
    };
    [0, 1, 2, 4, 5].into_iter().flat_map(wall).collect()
}

/// Furnace of white objects below a glowing ceiling.
fn white_furnace(white: Vec<Triangle>, double_sided: bool) -> Scene {
    let corner = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let ceiling = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 0);
    let mut triangles = ceiling.to_vec();
    triangles.extend(white.into_iter().map(|triangle| Triangle { material: 1, ..triangle }));
    let white = Material { double_sided, ..lambertian("white", 1.0) };
    scene(triangles, vec![glowing(), white], camera(Vec3::ZERO, Vec3::NEG_Z))
}

/// Boxes that touch share edges, and the space inside a box must stay dark.
#[test]
fn a_room_of_boxes_that_touch_is_as_bright_as_one_of_sheets() {
    for (thickness, double_sided, overlap) in [
        (0.0001, true, false),
        (0.0001, false, false),
        (0.001, true, true),
        (0.05, true, false),
        (0.2, true, true),
        (0.2, false, false),
    ] {
        let room = white_furnace(walls_of_boxes(thickness, overlap), double_sided);
        let map = Map::new(&room, 300_000);
        for distance in [0.02, 0.1, 0.3, 0.9] {
            let mean = map.mean_around(-1.0, 1.0 - distance, 0.8);
            assert!(
                (mean - 1.0).abs() < 0.06,
                "{thickness} m, double-sided {double_sided}, overlap {overlap}: {mean} at {distance} m"
            );
        }
    }
}

/// Two rooms stand side by side: a furnace, and a dark room whose floor continues the furnace's.
#[test]
fn no_photon_counts_through_a_wall_on_the_floor() {
    for thickness in [0.001_f32, 0.02, 0.1] {
        let half = 0.5 * thickness;
        let mut triangles = Vec::new();
        for (lower, upper, material) in [(-1.0, -half, 0), (half, 1.0, 1)] {
            let size = Vec3::new(upper - lower, 2.0, 2.0);
            triangles.extend(room([0; 6]).into_iter().map(|triangle| {
                let place = |corner: Vec3| Vec3::new(lower, -1.0, -1.0) + size * (0.5 + 0.5 * corner);
                Triangle { material, vertices: triangle.vertices.map(place), ..triangle }
            }));
        }
        let dark = lambertian("dark", ALBEDO);
        let rooms = scene(triangles, vec![glowing(), dark], camera(Vec3::new(-0.5, 0.0, 0.0), Vec3::NEG_X));
        let map = Map::new(&rooms, 200_000);
        for distance in [0.0005, 0.005, 0.02, 0.05, 0.2] {
            let along = |x: f32| map.mean_along(Vec3::new(x, -1.0, -0.8), Vec3::new(x, -1.0, 0.8), Vec3::Y);
            let [lit, dark] = [along(-half - distance), along(half + distance)];
            assert_eq!(dark, 0.0, "light {distance} m behind a wall of {thickness} m");
            assert!((lit - 1.0).abs() < 0.1, "{lit} at {distance} m before a wall of {thickness} m");
        }
    }
}

/// A tray without a bottom, such as a picture frame or a carpet, covers an area of the floor, where no light
/// falls.
#[test]
fn a_sheet_close_before_a_wall_is_as_bright_as_the_wall() {
    for gap in [0.0005, 0.005, 0.02, 0.05] {
        let (lower, size) = (Vec3::new(-0.4, -1.0, -0.4), Vec3::new(0.8, gap, 0.8));
        let is_bottom = |triangle: &Triangle| triangle.vertices.iter().all(|corner| corner.y == -1.0);
        let tray = closed_box(lower, size).filter(|triangle| !is_bottom(triangle));
        let room = room([0; 6])
            .into_iter()
            .filter(|triangle| !triangle.vertices.iter().all(|corner| corner.y == 1.0));
        let map = Map::new(&white_furnace(room.chain(tray).collect(), true), 300_000);
        let on_sheet = map.mean_around(-1.0 + gap, 0.2, 0.3);
        let beside = map.mean_around(-1.0, 0.42, 0.4);
        assert!((on_sheet - 1.0).abs() < 0.05, "{on_sheet} on a sheet {gap} m before the wall");
        assert!((beside - 1.0).abs() < 0.08, "{beside} beside a sheet {gap} m before the wall");
    }
}

/// Between two white sheets a path has hundreds of hits close together: the photons of a single path do not
/// give the density.
#[test]
fn sheets_that_nearly_touch_have_no_bright_spot() {
    const GAP: f32 = 0.001;
    let sheet = |y: f32| {
        let corner = |x: f32, z: f32| Vec3::new(x, y, z);
        quad([corner(-0.4, -0.4), corner(-0.4, 0.4), corner(0.4, 0.4), corner(0.4, -0.4)], 1)
    };
    let room =
        room([0; 6]).into_iter().filter(|triangle| !triangle.vertices.iter().all(|corner| corner.y == 1.0));
    let white = room.chain(sheet(0.0)).chain(sheet(-GAP));
    let map = Map::new(&white_furnace(white.collect(), true), 300_000);
    let mut radiances = Vec::new();
    for i in 0..2000 {
        // Points along the four edges of the sheet, at most 3 cm from them.
        let (along, inward) = (-0.4 + 0.8 * (i / 4) as f32 / 500.0, 0.03 * ((7 * i) % 40) as f32 / 40.0);
        let (x, z) = if i % 2 == 0 { (along, 0.399 - inward) } else { (0.399 - inward, along) };
        let side = if i % 4 < 2 { 1.0 } else { -1.0 };
        radiances.push(map.radiance(Vec3::new(side * x, 0.0, side * z), Vec3::Y));
    }
    let mean = radiances.iter().sum::<f64>() / radiances.len() as f64;
    let greatest = radiances.iter().copied().fold(0.0, f64::max);
    assert!((mean - 1.0).abs() < 0.1, "the mean is {mean}");
    assert!(greatest < 2.0, "a spot has {greatest}");
}
