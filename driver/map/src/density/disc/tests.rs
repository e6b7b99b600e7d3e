//! Tests that disc fractions measured by rays and by the list of triangles agree.

use photoncard_scene::gltf;

use super::*;
use crate::pack::PackedScene;
use crate::photon::trace;
use crate::photon_map::store_photons;

#[test]
fn rays_hit_the_triangles_listed_around_a_photon() {
    for (name, photons) in [("cornell.gltf", 3000), ("atrium.glb", 10_000)] {
        let path = format!("{}/../../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
        let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
        let packed = PackedScene::new(&scene).expect("packs");
        let photons = trace(&packed, 1, photons, &|_| true).expect("it is lit").photons;
        let image = store_photons(packed, photons, 20).expect("packs");
        let sides = SideTable::new(&image).expect("sound");
        let same = SameSurfaces::new();
        let greatest = f32::MAX.sqrt() * 0.5;
        let distances = GatherDistances { usual: greatest, greatest };
        let mut meter = Meter::new(&image, (&sides, &same), 20, distances);
        let grid = meter.searcher.scene.header.photon_grid;
        let (mut discs, mut cut, mut far, mut sums) = (0, 0, 0, [0.0; 2]);
        for line in image.section(SectionKind::PhotonLeaves) {
            let leaf = PhotonLeaf::read(&line.0);
            let [.., low, high] = leaf.content(0);
            let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
            let place = DiscPhoton { photon: 0, position: grid.position(leaf.point(0)).into(), normal };
            let radius = meter.searcher.radius(place.position).expect("sound");
            let ball = Ball { centre: place.position, radius: 1.1 * MARGIN * radius };
            let Meter { searcher, surroundings, .. } = &mut meter;
            if !surroundings.find(&searcher.scene, searcher.memory, &sides, ball).expect("sound") {
                continue;
            }
            let cluster = Cluster { ball, radius, outer: MARGIN * radius };
            let [by_rays, by_list] = [false, true].map(|is_complete| {
                meter.is_complete = is_complete;
                let frame = meter.frame(&place, &cluster).expect("sound");
                let mut fractions = [WHOLE; LEAF_PHOTONS];
                meter.measure_group(&[place], &frame, &cluster, &mut fractions).expect("sound");
                fractions[0].fraction
            });
            discs += 1;
            cut += u32::from((by_rays - 1.0).abs() > 0.01);
            far += u32::from((by_rays - by_list).abs() > 0.02);
            sums = [sums[0] + by_rays, sums[1] + by_list];
        }
        println!("{name}: {discs} discs, {cut} not whole, {far} differ, sums {sums:?}");
        assert!(discs > 200 && cut * 5 > discs, "{cut} of {discs} discs are not whole");
        assert!(far * 100 <= discs, "{far} of {discs} differ");
        assert!((sums[0] / sums[1] - 1.0).abs() < 1e-3, "{sums:?}");
    }
}
