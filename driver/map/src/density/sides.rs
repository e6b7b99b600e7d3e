//! Front and back of every triangle: the normals with which photons are stored, and whether the triangle
//! bounds a solid.

use std::collections::BTreeSet;

use glam::Vec3;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::scene::{SceneImage, keeps_photons};
use photoncard_shared::address::Line;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    BLENDS, BvhLeaf, DOUBLE_SIDED, Instance, LEAF_TRIANGLES, Layers, Material, NO_INSTANCE, Record,
    Reflectance, TriangleId, WideNode, encode_normal,
};
use photoncard_shared::message::{Fault, FaultCode};
use rayon::prelude::*;

use crate::pack::CardImage;

/// Properties of the front and the back of a triangle.
#[derive(Clone, Copy, Default)]
pub(super) struct Sides {
    /// Codes of the normals of front and back; `None` for a side where no photons are stored.
    normals: [Option<u8>; 2],
    /// True if the back faces the inside of a solid. False for a double-sided triangle, unless it belongs to
    /// a closed surface.
    pub(super) is_solid: bool,
    /// True if the triangle's texture cuts out parts of it.
    pub(super) has_cut_outs: bool,
}

impl Sides {
    /// Converts front and back of a triangle from the space of its group to the scene. `corners` are its
    /// corners in the scene, in any unit.
    #[inline(always)]
    pub(super) fn placed(self, triangle: TriangleId, corners: [Vec3; 3]) -> Self {
        if triangle.instance == NO_INSTANCE { self } else { self.turned(corners) }
    }

    /// Replaces the codes of the normals by those of a triangle with these corners.
    fn turned(mut self, [a, b, c]: [Vec3; 3]) -> Self {
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let codes = [normal, -normal].map(|normal| encode_normal(normal.to_array()));
        for (own, code) in self.normals.iter_mut().zip(codes) {
            *own = own.map(|_| code);
        }
        self
    }

    /// Code of the normal of a side; `None` if no photons are stored there.
    #[inline(always)]
    pub(super) fn normal(&self, is_front: bool) -> Option<u8> {
        self.normals[usize::from(!is_front)]
    }
}

/// Front and back of all triangles of a card image, by index.
pub(super) struct SideTable {
    sides: Vec<Sides>,
    /// True if any triangle has cut-outs.
    pub(super) has_cut_outs: bool,
}

/// Properties of a material that determine the sides of its triangles.
#[derive(Clone, Copy)]
struct Finish {
    reflects: bool,
    /// True if light can pass, because of glass, partial coverage or diffuse transmission.
    transmits: bool,
    emits: bool,
    is_double_sided: bool,
    /// True if the material has partial coverage (glTF `BLEND`). Its triangles have no cut-outs, because the
    /// photons' powers account for the coverage.
    blends: bool,
}

impl SideTable {
    /// Computes front and back ([`Sides`]) of every triangle in a card image.
    ///
    /// # Errors
    /// If the card image is malformed.
    pub(super) fn new(image: &CardImage) -> Result<Self, Fault> {
        let (scene, mut memory) = image.view();
        let materials = scene.header.section(SectionKind::Materials).records;
        let finishes: Result<Vec<Finish>, Fault> = (0..materials)
            .map(|index| {
                let bytes = scene.record::<{ Material::BYTES }, { Material::PER_LINE as u32 }>(
                    &mut memory,
                    SectionKind::Materials,
                    index,
                )?;
                let material = Material::read(bytes);
                Ok(Finish {
                    reflects: keeps_photons(&scene, &mut memory, &material)?,
                    transmits: matches!(material.reflectance, Reflectance::Glass { .. })
                        || material.flags & BLENDS != 0
                        || transmits_diffusely(&scene, &mut memory, &material)?,
                    emits: material.emission.into_iter().any(|radiance| radiance > 0.0),
                    is_double_sided: material.flags & DOUBLE_SIDED != 0,
                    blends: material.flags & BLENDS != 0,
                })
            })
            .collect();
        let finishes = finishes?;
        let leaves = image.section(SectionKind::Triangles);
        let mut sides = vec![Sides::default(); leaves.len() * LEAF_TRIANGLES];
        sides.par_chunks_mut(LEAF_TRIANGLES).zip(leaves).try_for_each(|(sides, line)| {
            let leaf = BvhLeaf(&line.0);
            for (slot, sides) in sides.iter_mut().enumerate().take(leaf.triangles() as usize) {
                let triangle = leaf.triangle(slot);
                let missing = Fault { code: FaultCode::Record, detail: triangle.material };
                let finish = finishes.get(triangle.material as usize).ok_or(missing)?;
                *sides = Sides {
                    has_cut_outs: triangle.cut_out && !finish.blends,
                    ..Sides::of(triangle.vertices, *finish)
                };
            }
            Ok(())
        })?;
        let has_cut_outs = sides.iter().any(|sides| sides.has_cut_outs);
        let mut table = Self { sides, has_cut_outs };
        if finishes.iter().any(|finish| finish.is_double_sided) {
            let starts = first_leaves(image);
            for (&first, end) in starts.iter().zip(starts.iter().skip(1).copied().chain([leaves.len()])) {
                table.find_closed_sheets(&leaves[first..end], first, &finishes);
            }
        }
        Ok(table)
    }

    /// Returns front and back of a triangle in the scene. If its index is out of range, neither stores
    /// photons. `corners` are its corners in the scene, in any unit.
    #[inline(always)]
    pub(super) fn of(&self, triangle: TriangleId, corners: [Vec3; 3]) -> Sides {
        self.stored(triangle).placed(triangle, corners)
    }

    /// Returns front and back of a triangle in the space of its group. If its index is out of range, neither
    /// stores photons.
    #[inline(always)]
    pub(super) fn stored(&self, triangle: TriangleId) -> Sides {
        self.sides.get(triangle.index as usize).copied().unwrap_or_default()
    }

    pub(super) fn is_cut_out(&self, triangle: TriangleId) -> bool {
        self.sides.get(triangle.index as usize).is_some_and(|sides| sides.has_cut_outs)
    }

    /// Marks the double-sided triangles of closed surfaces as solid, because no light enters such surfaces.
    /// Surfaces that emit or transmit light are excluded. A surface is closed if each edge of its triangles
    /// is shared with one other triangle, which has the edge in the opposite direction. Where meshes touch,
    /// more than two triangles share an edge. Two of them then bound a solid together if they are neighbours
    /// by angle around the edge and no other solid lies between them. `leaves` are the leaves of the scene or
    /// of one group; `first` is the index of the first of them.
    fn find_closed_sheets(&mut self, leaves: &[Line], first: usize, finishes: &[Finish]) {
        let mut sheets: Vec<(usize, [[u32; 3]; 3])> = Vec::new();
        let mut is_open = Vec::new();
        for (leaf, line) in (first..).zip(leaves) {
            let leaf_triangles = BvhLeaf(&line.0);
            for slot in 0..leaf_triangles.triangles() as usize {
                let index = leaf * LEAF_TRIANGLES + slot;
                if !self.sides[index].is_solid {
                    // `-0.0 + 0.0` is `0.0`: equal coordinates have equal bits.
                    let bits = |vertex: [f32; 3]| vertex.map(|coordinate| (coordinate + 0.0).to_bits());
                    let triangle = leaf_triangles.triangle(slot);
                    sheets.push((index, triangle.vertices.map(bits)));
                    let finish = finishes.get(triangle.material as usize);
                    is_open.push(finish.is_none_or(|finish| finish.emits || finish.transmits));
                }
            }
        }
        let directed =
            sheets.par_iter().zip(0_u32..sheets.len() as u32).flat_map_iter(|((_, vertices), sheet)| {
                edges_of(*vertices).map(|[from, to]| ([from.min(to), from.max(to)], from < to, sheet))
            });
        let mut edges: Vec<_> = directed.collect();
        edges.par_sort_unstable();
        let mut meshes = Components::new(sheets.len());
        for along in edges.chunk_by(|(one, ..), (other, ..)| one == other) {
            match *along {
                [(_, false, one), (_, true, other)] => meshes.join(one as usize, other as usize),
                // An edge of length 0 is its own opposite.
                [([from, to], ..)] if from == to => {}
                [(edge, ..), ..] => {
                    let around = around_edge(
                        edge,
                        along.iter().map(|&(_, is_forward, sheet)| {
                            (is_forward, sheet as usize, sheets[sheet as usize].1)
                        }),
                    );
                    for (sheet, other) in around {
                        match other {
                            Some(other) => meshes.join(sheet, other),
                            None => is_open[sheet] = true,
                        }
                    }
                }
                [] => {}
            }
        }
        let mut is_mesh_open = vec![false; sheets.len()];
        for sheet in (0..sheets.len()).filter(|sheet| is_open[*sheet]) {
            is_mesh_open[meshes.root(sheet)] = true;
        }
        for (sheet, (index, _)) in sheets.iter().enumerate() {
            self.sides[*index].is_solid = !is_mesh_open[meshes.root(sheet)];
        }
    }
}

/// Returns the indices of the first leaves of the scene and of each group, ascending.
fn first_leaves(image: &CardImage) -> Vec<usize> {
    let nodes = image.section(SectionKind::Nodes);
    let instances = image.section(SectionKind::Triangles).iter().filter_map(|line| Instance::read(&line.0));
    let roots: BTreeSet<u32> = instances.map(|instance| instance.root).collect();
    // The leaves of a tree are in the order of its nodes, of which the root is the first.
    let first = |root: u32| Some(WideNode(&nodes.get(root as usize)?.0).links().first_leaf as usize);
    std::iter::once(0).chain(roots.into_iter().filter_map(first)).collect()
}

fn transmits_diffusely(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    material: &Material,
) -> Result<bool, Fault> {
    let Some(index) = material.layers else { return Ok(false) };
    let kind = SectionKind::Layers;
    let bytes = scene.record::<{ Layers::BYTES }, { Layers::PER_LINE as u32 }>(memory, kind, index)?;
    Ok(Layers::read(bytes).diffuse_transmission > 0.0)
}

impl Sides {
    fn of(vertices: [[f32; 3]; 3], finish: Finish) -> Self {
        let [a, b, c] = vertices.map(Vec3::from);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let code = |normal: Vec3, reflects: bool| reflects.then(|| encode_normal(normal.to_array()));
        let Finish { reflects, transmits, is_double_sided, .. } = finish;
        Self {
            normals: [code(normal, reflects), code(-normal, reflects && is_double_sided)],
            is_solid: !is_double_sided && !transmits,
            has_cut_outs: false,
        }
    }
}

/// Returns, for each triangle at an edge, its index and the index of the next triangle by angle on its back
/// side. The latter is `None` if the two cannot bound a solid. Each item of `triangles` holds whether the
/// triangle has the edge in the given direction, its index, and its corners.
fn around_edge(
    edge: [[u32; 3]; 2],
    triangles: impl Iterator<Item = (bool, usize, [[u32; 3]; 3])>,
) -> Vec<(usize, Option<usize>)> {
    let place = |bits: [u32; 3]| glam::DVec3::from(bits.map(|bits| f64::from(f32::from_bits(bits))));
    let [from, to] = edge.map(place);
    let axis = (to - from).normalize_or_zero();
    let (x, y) = axis.any_orthonormal_pair();
    let mut around: Vec<(f64, bool, usize)> = triangles
        .map(|(is_forward, index, corners)| {
            let third = corners.into_iter().find(|corner| !edge.contains(corner));
            let way = third.map_or(glam::DVec3::ZERO, |corner| place(corner) - from);
            (libm::atan2(way.dot(y), way.dot(x)), is_forward, index)
        })
        .collect();
    // By ascending angle, a solid begins at a triangle that has the edge in reverse and ends at one that has
    // it in the given direction. At equal angles one solid ends before another begins.
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)).then(a.2.cmp(&b.2)));
    let count = around.len();
    let other = |index: usize| {
        let (_, is_forward, _) = around[index];
        let (_, is_other_forward, other) =
            around[if is_forward { index + count - 1 } else { index + 1 } % count];
        (is_forward != is_other_forward).then_some(other)
    };
    (0..count).map(|index| (around[index].2, other(index))).collect()
}

fn edges_of<T: Copy>([a, b, c]: [T; 3]) -> [[T; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Disjoint-set forest.
struct Components {
    parents: Vec<usize>,
}

impl Components {
    fn new(count: usize) -> Self {
        Self { parents: (0..count).collect() }
    }

    fn root(&mut self, mut item: usize) -> usize {
        while self.parents[item] != item {
            self.parents[item] = self.parents[self.parents[item]];
            item = self.parents[item];
        }
        item
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.parents[one] = other;
    }
}
