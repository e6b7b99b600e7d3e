//! Disc fractions: the boundary correction of the density estimate.
//!
//! A gather, the density estimate at a point, divides by the area of a flat disc. Its search covers a sphere,
//! however, and counts the photons with a similar normal on all surfaces in the sphere. Near an edge or in a
//! corner these surfaces have less area than the disc, and the estimate would be too dark: on a Cornell box
//! by some 2 % of all indirect light. On steps or between balusters they can have more area, and the estimate
//! would be too bright. This module measures the area once per photon, as a fraction of the disc's area,
//! along chords of a sphere with the radius of a gather ([`super::chords`]). A gather then divides by this
//! area ([`photoncard_firmware::photon`]).
//!
//! Most photons lie inside a large flat surface and have the fraction 1. Leaves of the photon map with only
//! such photons are recognized by the triangles around them. The photons of any other leaf share the search
//! for the radius, the query for triangles, and the chords.

use glam::Vec3;
use photoncard_firmware::photon::{MIN_NORMAL_COSINE, VisibleRegion};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{Ray, is_there, magnitude, offset_origin};
use photoncard_firmware::simd::{LANES, run};
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{FULL_DISC, LEAF_PHOTONS, Photon, PhotonLeaf, decode_normal, encode_disc};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::ball::Ball;
use super::chords::{ChordFrame, Chords};
use super::crossings::{Covered, Crossings, Layer};
use super::evidence::Evidence;
use super::rays::{Met, all_on_way, first_triangle};
use super::search::{GatherDistances, Searcher};
use super::sides::SideTable;
use super::surfaces::{Areas, AreasWithin, FractionWithin, OpenSurfaces, SameSurfaces, SeenRegion};
use super::surroundings::{PlainWall, Surroundings};
use crate::pack::CardImage;
use crate::photon::PhotonError;

/// Number of leaves that one task measures.
const LEAVES_PER_TASK: usize = 64;
/// Minimum cosine between the normals of photons that share chords.
const MIN_SHARED_COSINE: f32 = 0.85;
/// Maximum height of the reference point (`ChordFrame::open`) above a photon, in radii of a gather.
const OPEN_HEIGHT: f32 = 0.1;
/// Radius of the sphere in which a gather looks for hidden surfaces, divided by the radius of a gather at the
/// photon. It exceeds 1 because the point of a gather lies beside the photon.
const MARGIN: f32 = 1.15;
/// Maximum of `|a - p|`. `a` is the fraction of the surface area, and `p` the fraction of the photons' power,
/// that a photon cannot see within [`MARGIN`] radii of a gather. Above this difference, the gather uses only
/// the photons in its visible region.
const MAX_DIFFERENCE: f32 = 0.06;
/// Maximum of `(outer / (MARGIN radius))^2 |a - p|` at which all photons of a group get the fractions of
/// their whole discs. `a` and `p` are the hidden fractions of area and power for the group's first photon, in
/// the whole ball. `outer` and `radius` are those of its [`Cluster`].
const NEAR_DIFFERENCE: f32 = 0.03;
/// Factor of the estimated gather radius `BY_SPREAD d sqrt(k / n)` at a leaf, for gathers of k photons. The
/// leaf has n photons within the distance d of its middle photon.
const BY_SPREAD: f32 = 1.2;
/// Maximum distance at which a photon is evidence that a surface is lit ([`super::evidence`]), divided by the
/// radius of a gather.
const EVIDENT: f32 = 0.7;
/// Distance up to which hits along a ray count as one hit, in radii of the ball.
const STEP: f32 = 1e-5;

/// Disc fraction of a photon. It refers to the whole disc or only to the region that the photon sees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fraction {
    fraction: f32,
    is_of_region: bool,
}

/// Disc fraction of a photon inside a large flat surface.
const WHOLE: Fraction = Fraction { fraction: 1.0, is_of_region: false };

/// Encoded disc fractions of a leaf's photons.
type Codes = [u8; LEAF_PHOTONS];
type DiscPhotons = heapless::Vec<DiscPhoton, LEAF_PHOTONS>;

/// Measures the disc fraction of every photon, for gathers of `neighbors` photons within `distances`, and
/// writes it into the card image. `go_on` is called before each task.
///
/// # Errors
/// If the card image is malformed, or `go_on` returns false.
pub(crate) fn measure_discs(
    image: &mut CardImage,
    neighbors: u32,
    distances: GatherDistances,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<(), PhotonError> {
    let leaves = image.section(SectionKind::PhotonLeaves).len();
    let sides = SideTable::new(image)?;
    let same = SameSurfaces::new();
    let measured: Result<Vec<Vec<(usize, Codes)>>, PhotonError> = (0..leaves.div_ceil(LEAVES_PER_TASK))
        .into_par_iter()
        .map_init(
            || Meter::new(image, (&sides, &same), neighbors, distances),
            |meter, task| {
                if !go_on() {
                    return Err(PhotonError::Stopped);
                }
                let first = task * LEAVES_PER_TASK;
                Ok(meter.measure_leaves(first, (first + LEAVES_PER_TASK).min(leaves))?)
            },
        )
        .collect();
    let measured = measured?;
    let lines = image.section_mut(SectionKind::PhotonLeaves);
    for (leaf, codes) in measured.into_iter().flatten() {
        for (index, code) in (0..).zip(codes) {
            PhotonLeaf::set_disc(&mut lines[leaf].0, index, code);
        }
    }
    Ok(())
}

/// Measurement of disc fractions, with its buffers.
struct Meter<'a> {
    image: &'a CardImage,
    sides: &'a SideTable,
    same: &'a SameSurfaces,
    searcher: Searcher<'a>,
    /// Radius that most gathers do not exceed, metres.
    usual: f32,
    surroundings: Surroundings,
    evidence: Evidence,
    /// True if [`Self::evidence`] holds the photons of the current ball.
    has_evidence: bool,
    /// True if [`Self::surroundings`] contains all triangles in the ball.
    is_complete: bool,
    chords: Chords,
    /// Smaller set of chords, for balls with many triangles.
    few_chords: Chords,
    crossings: Crossings,
    covered: Vec<Covered>,
    surfaces: OpenSurfaces,
    /// Photons in the ball, as surface points whose areas are the photons' powers.
    lights: OpenSurfaces,
}

/// A photon whose disc fraction is measured.
#[derive(Clone, Copy)]
struct DiscPhoton {
    /// Index of the photon in its leaf.
    photon: usize,
    position: Vec3,
    /// Code of the surface normal.
    normal: u8,
}

impl DiscPhoton {
    /// Decoded unit normal.
    fn coded_normal(&self) -> Vec3 {
        Vec3::from(decode_normal(self.normal)).normalize()
    }
}

/// Ball and gather radius of photons that are measured together, in metres.
struct Cluster {
    ball: Ball,
    radius: f32,
    /// Radius of a disc that contains the discs of all photons of the cluster, metres.
    outer: f32,
}

impl<'a> Meter<'a> {
    fn new(
        image: &'a CardImage,
        (sides, same): (&'a SideTable, &'a SameSurfaces),
        neighbors: u32,
        distances: GatherDistances,
    ) -> Self {
        let searcher = Searcher::new(image, neighbors, distances.greatest);
        Self {
            image,
            sides,
            same,
            searcher,
            usual: distances.usual,
            surroundings: Surroundings::default(),
            evidence: Evidence::default(),
            has_evidence: false,
            is_complete: false,
            chords: Chords::many(),
            few_chords: Chords::few(),
            crossings: Crossings::new(),
            covered: Vec::new(),
            surfaces: OpenSurfaces::default(),
            lights: OpenSurfaces::default(),
        }
    }

    /// Measures the disc fractions in the leaves `first..end`. Returns the index and the encoded fractions of
    /// each leaf that has a fraction other than 1.
    fn measure_leaves(&mut self, first: usize, end: usize) -> Result<Vec<(usize, Codes)>, Fault> {
        let grid = self.searcher.scene.header.photon_grid;
        let mut measured = Vec::new();
        for (index, line) in (first..end).zip(&self.image.section(SectionKind::PhotonLeaves)[first..end]) {
            let leaf = PhotonLeaf::read(&line.0);
            let photons: DiscPhotons = (0..leaf.photons())
                .map(|photon| {
                    let [.., low, high] = leaf.content(photon);
                    let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
                    let position = grid.position(leaf.point(photon)).into();
                    DiscPhoton { photon: photon as usize, position, normal }
                })
                .collect();
            let fractions = self.measure(photons)?;
            let codes = codes(&fractions, index);
            if codes.iter().any(|&code| code != FULL_DISC) {
                measured.push((index, codes));
            }
        }
        Ok(measured)
    }

    fn measure(&mut self, mut photons: DiscPhotons) -> Result<[Fraction; LEAF_PHOTONS], Fault> {
        let mut fractions = [WHOLE; LEAF_PHOTONS];
        if self.are_usual(&photons) && self.is_plain(&photons, self.usual)? {
            return Ok(fractions);
        }
        while let Some(middle) = middle(&photons) {
            let radius = self.searcher.radius(middle.position)?.max(f32::MIN_POSITIVE);
            let cluster =
                split_off(&mut photons, |photon| photon.position.distance(middle.position) <= radius);
            if !self.is_plain(&cluster, radius)? {
                self.measure_cluster(cluster, middle, radius, &mut fractions)?;
            }
        }
        Ok(fractions)
    }

    /// Returns whether gathers at the photons of a leaf have at most the radius `Self::usual`. The radius
    /// is estimated from the density of these photons.
    fn are_usual(&self, photons: &[DiscPhoton]) -> bool {
        let share = self.searcher.neighbors() as f32 / photons.len() as f32;
        let spread = middle(photons).map_or(0.0, |middle| spread(photons, middle));
        BY_SPREAD * spread * share.sqrt() <= self.usual
    }

    /// Returns true if the spheres around `photons` contain no surface but the plane on which all of them
    /// lie.
    fn is_plain(&mut self, photons: &[DiscPhoton], radius: f32) -> Result<bool, Fault> {
        let Some(middle) = middle(photons) else { return Ok(true) };
        if photons.iter().any(|photon| photon.normal != middle.normal) {
            return Ok(false);
        }
        let places: heapless::Vec<Vec3, LEAF_PHOTONS> =
            photons.iter().map(|photon| photon.position).collect();
        let lift = self.lift(radius);
        let wall = PlainWall { normal: middle.normal, lift, places: &places };
        let outer = 1.001 * (MARGIN * radius + spread(photons, middle)) + lift;
        let ball = Ball { centre: middle.position, radius: outer };
        let Searcher { scene, memory, .. } = &self.searcher;
        self.surroundings.is_plain(scene, *memory, self.sides, ball, wall)
    }

    /// Measures the disc fractions of a cluster of photons. `radius` is the radius of their gathers, metres;
    /// all of them lie within this distance of the photon `middle`.
    fn measure_cluster(
        &mut self,
        mut photons: DiscPhotons,
        middle: DiscPhoton,
        radius: f32,
        fractions: &mut [Fraction; LEAF_PHOTONS],
    ) -> Result<(), Fault> {
        let spread = spread(&photons, middle);
        let outer = MARGIN * radius + spread;
        // The ball also contains the paths from the reference point to the chords. Its radius is computed in
        // `f64`, because squares of `f32` lengths can overflow.
        let [across, along] = [outer, spread + OPEN_HEIGHT * radius].map(f64::from);
        let reach = (across * across + along * along).sqrt() as f32;
        let ball = Ball { centre: middle.position, radius: 1.001 * reach + 2.0 * self.lift(radius) };
        let cluster = Cluster { ball, radius, outer };
        let Searcher { scene, memory, .. } = &self.searcher;
        self.is_complete = self.surroundings.find(scene, *memory, self.sides, ball)?;
        self.has_evidence = false;
        while let Some(nearest) = nearest(&photons, middle.position) {
            let frame = self.frame(&nearest, &cluster)?;
            let [.., along] = frame.axes;
            let group = split_off(&mut photons, |photon| {
                photon.photon == nearest.photon || photon.coded_normal().dot(along) >= MIN_SHARED_COSINE
            });
            self.measure_group(&group, &frame, &cluster, fractions)?;
        }
        Ok(())
    }

    /// Measures the disc fractions of photons with similar normals.
    fn measure_group(
        &mut self,
        group: &[DiscPhoton],
        frame: &ChordFrame,
        cluster: &Cluster,
        fractions: &mut [Fraction; LEAF_PHOTONS],
    ) -> Result<(), Fault> {
        let Cluster { ball, radius, outer } = *cluster;
        let is_crowded = self.surroundings.is_crowded();
        let chords = if is_crowded { &self.few_chords } else { &self.chords }.scaled(outer / ball.radius);
        if self.is_complete {
            self.surroundings.cross(frame, &chords, &mut self.crossings);
        } else {
            self.cross_by_rays(frame, &chords, ball)?;
        }
        if self.sides.has_cut_outs {
            self.leave_out_cut_outs(frame, &chords, ball)?;
        }
        let lift = self.lift(radius) / ball.radius;
        self.crossings.open_surfaces(&chords, &mut self.surfaces, &mut self.covered);
        self.add_covered(group.first().map_or(ball.centre, |photon| photon.position), frame, cluster)?;
        let may_differ = self.may_differ(group, frame, cluster, &chords)?;
        let mut chosen = None;
        for photon in group {
            if chosen.replace(photon.normal) != Some(photon.normal) {
                self.surfaces.choose(photon.normal, self.same);
                self.lights.choose(photon.normal, self.same);
            }
            fractions[photon.photon] = if may_differ {
                let region = self.region(photon, frame, cluster)?;
                let within = (&chords, [radius, MARGIN * radius]);
                let [areas, powers] = [&self.surfaces, &self.lights]
                    .map(|surfaces| self.seen(surfaces, photon, &region, frame, cluster, within));
                Fraction::new(&areas, &powers)
            } else {
                let (surfaces, chords) = (&self.surfaces, &chords);
                let centre = frame.along((photon.position - ball.centre) / ball.radius);
                let radius = radius / ball.radius;
                let fraction = run(FractionWithin { chords, surfaces, centre, radius, lift });
                Fraction { fraction, is_of_region: false }
            };
        }
        Ok(())
    }

    /// Computes the [`Areas`] of surfaces around a photon. The two radii, metres, are those of the photon's
    /// sphere and of the larger sphere.
    fn seen(
        &self,
        surfaces: &OpenSurfaces,
        photon: &DiscPhoton,
        region: &SeenRegion,
        frame: &ChordFrame,
        cluster: &Cluster,
        (chords, [radius, outer_radius]): (&Chords, [f32; 2]),
    ) -> Areas {
        let ball = cluster.ball;
        let lift = self.lift(cluster.radius) / ball.radius;
        let centre = frame.along((photon.position - ball.centre) / ball.radius);
        let [radius, outer_radius] = [radius, outer_radius].map(|radius| radius / ball.radius);
        run(AreasWithin { chords, surfaces, region, centre, radius, outer_radius, lift })
    }

    /// Adds the lit crossings of `Self::covered` to [`Self::surfaces`]. A crossing is lit if a photon is
    /// stored near it ([`super::evidence`]). `photon` is the position of the photon whose disc is measured. A
    /// crossing is skipped if the gap to the crossing above it is within the error of the photon grid.
    fn add_covered(&mut self, photon: Vec3, frame: &ChordFrame, cluster: &Cluster) -> Result<(), Fault> {
        if self.covered.is_empty() {
            return Ok(());
        }
        let Cluster { ball, radius, .. } = *cluster;
        let lift = self.lift(radius) / ball.radius;
        self.find_evidence(ball)?;
        let Self { evidence, covered, surfaces, .. } = self;
        evidence.choose(ball, frame, (photon, EVIDENT * radius));
        for crossing in covered.iter().filter(|crossing| crossing.gap > 2.0 * lift) {
            let [x, y, _] = crossing.place;
            if evidence.is_near([x, y], crossing.heights) {
                surfaces.push(crossing.place, crossing.slope, crossing.normal);
            }
        }
        Ok(())
    }

    /// Finds the photons in the ball of a cluster, unless [`Self::evidence`] holds them already.
    fn find_evidence(&mut self, ball: Ball) -> Result<(), Fault> {
        let Searcher { scene, memory, .. } = &self.searcher;
        if !std::mem::replace(&mut self.has_evidence, true) {
            self.evidence.find(scene, *memory, ball)?;
        }
        Ok(())
    }

    /// Returns whether the photons of a group may need the fractions of their visible regions. They may if
    /// the two hidden fractions around the first photon differ too much (`NEAR_DIFFERENCE`).
    fn may_differ(
        &mut self,
        group: &[DiscPhoton],
        frame: &ChordFrame,
        cluster: &Cluster,
        chords: &Chords,
    ) -> Result<bool, Fault> {
        let Some(first) = group.first() else { return Ok(false) };
        self.surfaces.choose(first.normal, self.same);
        let region = self.region(first, frame, cluster)?;
        let Cluster { ball, radius, outer } = *cluster;
        let whole = (chords, [2.0 * ball.radius; 2]);
        let areas = self.seen(&self.surfaces, first, &region, frame, cluster, whole);
        if areas.hidden <= 0.0 {
            self.lights.clear();
            return Ok(false);
        }
        self.find_evidence(ball)?;
        self.evidence.powers(ball, frame, &mut self.lights);
        self.lights.choose(first.normal, self.same);
        let powers = self.seen(&self.lights, first, &region, frame, cluster, whole);
        let spheres = outer / (MARGIN * radius);
        Ok(spheres * spheres * (areas.hidden - powers.hidden).abs() > NEAR_DIFFERENCE)
    }

    /// Region that a photon sees, in the ball's coordinates.
    fn region(
        &self,
        photon: &DiscPhoton,
        frame: &ChordFrame,
        cluster: &Cluster,
    ) -> Result<SeenRegion, Fault> {
        let Cluster { ball, radius, .. } = *cluster;
        let Searcher { scene, memory, .. } = &self.searcher;
        let at = (photon.position, photon.normal);
        let region = VisibleRegion::new(scene, &mut memory.clone(), at, radius, 2.0 * MARGIN * radius)?;
        Ok(SeenRegion {
            axes: region.axes.map(|axis| frame.along(axis).to_array()),
            inner: region.sectors.scaled(ball.radius),
            outer: region.outer.scaled(ball.radius),
        })
    }

    /// Removes the crossings at points that a triangle's texture cuts out.
    fn leave_out_cut_outs(&mut self, frame: &ChordFrame, chords: &Chords, ball: Ball) -> Result<(), Fault> {
        let Self { sides, searcher: Searcher { scene, memory, .. }, crossings, .. } = self;
        let [tangent, bitangent, normal] = frame.axes;
        let mut fault = None;
        for (batch, layers) in crossings.layers.iter_mut().enumerate() {
            for layer in layers.iter_mut().filter(|layer| sides.is_cut_out(layer.triangle)) {
                let triangle = layer.triangle;
                layer.retain(|lane, height| {
                    let [x, y] = chords.point(batch * LANES + lane);
                    let along = tangent * x + bitangent * y + normal * height;
                    let found = is_there(scene, memory, triangle, ball.centre + along * ball.radius);
                    found.unwrap_or_else(|error| {
                        fault = Some(error);
                        true
                    })
                });
            }
        }
        fault.map_or(Ok(()), Err)
    }

    /// Coordinate frame along the normal of a photon. Its reference point lies above the photon: at
    /// [`OPEN_HEIGHT`] or halfway to the nearest surface above, whichever is lower.
    fn frame(&self, photon: &DiscPhoton, cluster: &Cluster) -> Result<ChordFrame, Fault> {
        let Cluster { ball, radius, .. } = *cluster;
        let normal = self.exact_normal(photon, radius)?;
        let tangent = normal.any_orthonormal_vector();
        let surface = offset_origin(photon.position, normal, magnitude(&[photon.position]))
            + normal * self.lift(radius);
        let height = 2.0 * OPEN_HEIGHT * radius;
        let free = self.first_on_way(surface, normal, height)?.map_or(height, |(distance, _)| distance);
        let open = surface + normal * (0.5 * free);
        let frame = ChordFrame { axes: [tangent, normal.cross(tangent), normal], open: Vec3::ZERO };
        Ok(ChordFrame { open: frame.along((open - ball.centre) / ball.radius), ..frame })
    }

    /// Normal of the surface that a photon lies on, found by a short ray because the stored code is coarse.
    fn exact_normal(&self, photon: &DiscPhoton, radius: f32) -> Result<Vec3, Fault> {
        let coded = photon.coded_normal();
        let above =
            offset_origin(photon.position, coded, magnitude(&[photon.position])) + coded * self.lift(radius);
        let found = self.first_on_way(above, -coded, radius)?.map(|(_, normal)| normal);
        Ok(found.filter(|normal| normal.dot(coded) >= MIN_NORMAL_COSINE).unwrap_or(coded))
    }

    /// Height above a photon at which rays start, metres. It is a small part of the radius, but larger than
    /// the distance by which the grid may have moved the photon below its surface.
    fn lift(&self, radius: f32) -> f32 {
        1e-3 * radius + self.searcher.scene.header.photon_grid.cell
    }

    /// Finds the nearest surface from `origin` along a unit vector. Returns its distance, metres, and its
    /// normal, which faces the origin.
    fn first_on_way(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
    ) -> Result<Option<(f32, Vec3)>, Fault> {
        if self.is_complete {
            return Ok(self.surroundings.first_on_way(origin, direction, max_distance));
        }
        let ray = Ray::of_light(origin, direction, max_distance);
        let Searcher { scene, memory, .. } = &self.searcher;
        Ok(first_triangle(scene, *memory, &ray)?.map(|Met { distance, normal, .. }| {
            (distance, if normal.dot(direction) > 0.0 { -normal } else { normal })
        }))
    }

    /// Collects the crossings of chords by rays through the whole scene, for a ball without a complete list
    /// of triangles.
    fn cross_by_rays(&mut self, frame: &ChordFrame, chords: &Chords, ball: Ball) -> Result<(), Fault> {
        self.crossings.clear(frame.open.z);
        let Searcher { scene, memory, .. } = &self.searcher;
        let step = STEP * ball.radius;
        let [tangent, bitangent, normal] = frame.axes;
        let place =
            |x: f32, y: f32, z: f32| ball.centre + (tangent * x + bitangent * y + normal * z) * ball.radius;
        let open = place(frame.open.x, frame.open.y, frame.open.z);
        for chord in 0..chords.number() {
            let [x, y] = chords.point(chord);
            let half = (1.0 - x * x - y * y).max(0.0).sqrt();
            for met in all_on_way(scene, *memory, [place(x, y, half), place(x, y, -half)], step)? {
                let height = half - met.distance / ball.radius;
                let cosine = met.normal.dot(normal);
                let face = (met.triangle, self.sides.of(met.triangle, met.corners), cosine > 0.0);
                let mut misses = [1; LANES];
                misses[chord % LANES] = 0;
                let layer = Layer::new((&[height; LANES], &misses), face, cosine.abs().recip());
                self.crossings.layers[chord / LANES].push(layer);
            }
            let way = place(x, y, frame.open.z) - open;
            let mut depth = 0;
            for met in all_on_way(scene, *memory, [open, open + way], step)? {
                let change = if met.normal.dot(way) < 0.0 { 1 } else { -1 };
                depth += if self.sides.of(met.triangle, met.corners).is_solid { change } else { 0 };
            }
            self.crossings.set_depth(chord, depth);
        }
        Ok(())
    }
}

impl Fraction {
    /// Chooses the disc fraction of a photon. It is that of the visible region if the hidden fractions of
    /// area and power differ by more than [`MAX_DIFFERENCE`] plus 1.5 standard deviations, else that of the
    /// whole disc.
    fn new(areas: &Areas, powers: &Areas) -> Self {
        let chance = areas.hidden * (1.0 - areas.hidden) / powers.points.max(1.0);
        let differs = (areas.hidden - powers.hidden).abs() > MAX_DIFFERENCE + 1.5 * chance.sqrt();
        Self { fraction: if differs { areas.of_region } else { areas.fraction }, is_of_region: differs }
    }
}

/// Photon nearest to the mean position. On a curved surface the mean itself lies off the surface.
fn middle(photons: &[DiscPhoton]) -> Option<DiscPhoton> {
    nearest(photons, photons.iter().map(|photon| photon.position).sum::<Vec3>() / photons.len() as f32)
}

fn nearest(photons: &[DiscPhoton], to: Vec3) -> Option<DiscPhoton> {
    let distance = |photon: &&DiscPhoton| photon.position.distance_squared(to);
    photons.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
}

/// Greatest distance of a photon from `middle`, metres.
fn spread(photons: &[DiscPhoton], middle: DiscPhoton) -> f32 {
    photons.iter().map(|photon| photon.position.distance(middle.position)).fold(0.0, f32::max)
}

/// Removes and returns the photons for which `is_chosen` is true.
fn split_off(photons: &mut DiscPhotons, is_chosen: impl Fn(&DiscPhoton) -> bool) -> DiscPhotons {
    let chosen = photons.iter().filter(|photon| is_chosen(photon)).copied().collect();
    photons.retain(|photon| !is_chosen(photon));
    chosen
}

/// Encodes the fractions of a leaf. The dither values of its photons are spread evenly (golden ratio), so
/// that the rounding errors of neighbours cancel.
fn codes(fractions: &[Fraction; LEAF_PHOTONS], leaf: usize) -> Codes {
    const GOLDEN_RATIO: u32 = 0x9e37_79b9;
    let first = hash(leaf as u32);
    let mut photon = 0_u32;
    fractions.map(|Fraction { fraction, is_of_region }| {
        let dither = first.wrapping_add(photon.wrapping_mul(GOLDEN_RATIO));
        photon += 1;
        encode_disc(fraction, is_of_region, (dither >> 8) as f32 * (1.0 / 16_777_216.0))
    })
}

#[cfg(test)]
mod tests;
