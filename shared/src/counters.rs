//! Counters of the work that a chip does.

use serde::{Deserialize, Serialize};

/// Work done on a tile. The sums over all tiles do not depend on which chip rendered which tile, with two
/// exceptions: [`Self::drains`], [`Self::most_waiting`] and [`Self::cycles`] always depend on it, and all
/// counters do if chips keep irradiance records
/// ([`FrameParameters::keep_records`](crate::message::FrameParameters::keep_records)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Eye rays. A path of a pixel without gather rays takes one. A path of a pixel with gather rays takes at
    /// least two: one to place its gather point, one to complete the pixel. If the gather point is seen in a
    /// mirror or through glass, the path is also traced again for the point's shadow rays, and for each group
    /// of up to 64 of its gather rays, or 16 in a frame with near ends. A survey takes one for each lattice
    /// point that it visits.
    pub eye_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Final gather rays.
    pub gather_rays: u64,
    /// Rays that survey the surroundings of irradiance records.
    pub survey_rays: u64,
    /// Rays from specular surfaces, which continue eye and gather rays.
    pub specular_rays: u64,
    /// Paths that contributed nothing because they had [`crate::budget::SPECULAR_BOUNCES`] specular bounces,
    /// or met a surface that absorbs all light.
    pub lost_paths: u64,
    /// Gathers in the caustic map, each a sum over all photons whose kernels reach the point.
    pub caustic_gathers: u64,
    /// Searches for the k nearest photons in the photon map.
    pub gathers: u64,
    /// Searches of [`Self::gathers`] made to build tables for importance sampling of directions.
    pub tables: u64,
    /// Irradiance records computed by a final gather.
    pub records: u64,
    /// Irradiance records reused from an earlier frame instead of being gathered.
    pub kept_records: u64,
    /// Paths that see a surface with a Lambertian component, in a frame with final gather rays. A sample has
    /// one path, with adaptive sampling up to 16.
    pub lambertian_samples: u64,
    /// Paths of [`Self::lambertian_samples`] whose indirect irradiance was interpolated between irradiance
    /// records.
    pub interpolated_samples: u64,
    /// Photons of the photon map whose distance to a search's position was computed.
    pub photons_tested: u64,
    /// Photons of [`Self::photons_tested`] that lay within the search radius when they were tested, and
    /// became candidates.
    pub photons_taken: u64,
    /// Candidates read by selections of the k nearest; a candidate counts once for each selection that reads
    /// it.
    pub photons_selected: u64,
    /// Comparisons of distances in selections of the k nearest, except those between equal distances.
    pub distances_compared: u64,
    /// Photons that searches returned: k each, or fewer if fewer lie within the maximum distance.
    pub photons_found: u64,
    /// Photons found by gathers at surfaces with a Phong or GGX lobe, which is evaluated for each photon's
    /// direction. Gathers in the caustic map are included.
    pub photons_reflected: u64,
    /// Photons of [`Self::photons_reflected`] whose lobe is a microfacet model (GGX).
    pub photons_on_microfacets: u64,
    /// Photon normals that gathers decoded to reject photons of other surfaces.
    pub normals_decoded: u64,
    /// Searches for the nearest irradiance point.
    pub lookups: u64,
    /// Irradiance points whose distance to a search's position was computed.
    pub points_tested: u64,
    /// Number of times that the gather queue was emptied (drained).
    pub drains: u64,
    /// Maximum number of gathers that were queued at the same time on one chip.
    pub most_waiting: u64,
    /// Processor cycles of the chip's work; 0 if the board has no counter of cycles.
    pub cycles: u64,
}

impl Counters {
    /// Counters that are all zero.
    pub const ZERO: Self = Self {
        eye_rays: 0,
        shadow_rays: 0,
        gather_rays: 0,
        survey_rays: 0,
        specular_rays: 0,
        lost_paths: 0,
        caustic_gathers: 0,
        gathers: 0,
        tables: 0,
        records: 0,
        kept_records: 0,
        lambertian_samples: 0,
        interpolated_samples: 0,
        photons_tested: 0,
        photons_taken: 0,
        photons_selected: 0,
        distances_compared: 0,
        photons_found: 0,
        photons_reflected: 0,
        photons_on_microfacets: 0,
        normals_decoded: 0,
        lookups: 0,
        points_tested: 0,
        drains: 0,
        most_waiting: 0,
        cycles: 0,
    };

    /// Counts one search for the k nearest photons. The arguments count photons whose distance was computed,
    /// photons that became candidates, candidates read and distances compared by selections, and photons
    /// returned.
    #[inline(always)]
    pub fn count_gather(&mut self, tested: u32, taken: u32, [selected, compared]: [u32; 2], found: u32) {
        self.gathers += 1;
        self.photons_tested += u64::from(tested);
        self.photons_taken += u64::from(taken);
        self.photons_selected += u64::from(selected);
        self.distances_compared += u64::from(compared);
        self.photons_found += u64::from(found);
    }

    /// Total number of rays, gathers and irradiance lookups.
    #[inline(always)]
    pub fn rays_and_gathers(&self) -> u64 {
        let rays = [self.eye_rays, self.shadow_rays, self.gather_rays, self.survey_rays, self.specular_rays];
        let searches = [self.gathers, self.caustic_gathers, self.lookups];
        rays.into_iter().chain(searches).fold(0, u64::wrapping_add)
    }

    /// Adds the counts of another tile or chip; [`Self::most_waiting`] becomes the maximum of both.
    pub fn add(&mut self, other: &Self) {
        self.eye_rays = self.eye_rays.saturating_add(other.eye_rays);
        self.shadow_rays = self.shadow_rays.saturating_add(other.shadow_rays);
        self.gather_rays = self.gather_rays.saturating_add(other.gather_rays);
        self.survey_rays = self.survey_rays.saturating_add(other.survey_rays);
        self.specular_rays = self.specular_rays.saturating_add(other.specular_rays);
        self.lost_paths = self.lost_paths.saturating_add(other.lost_paths);
        self.caustic_gathers = self.caustic_gathers.saturating_add(other.caustic_gathers);
        self.gathers = self.gathers.saturating_add(other.gathers);
        self.tables = self.tables.saturating_add(other.tables);
        self.records = self.records.saturating_add(other.records);
        self.kept_records = self.kept_records.saturating_add(other.kept_records);
        self.lambertian_samples = self.lambertian_samples.saturating_add(other.lambertian_samples);
        self.interpolated_samples = self.interpolated_samples.saturating_add(other.interpolated_samples);
        self.photons_tested = self.photons_tested.saturating_add(other.photons_tested);
        self.photons_taken = self.photons_taken.saturating_add(other.photons_taken);
        self.photons_selected = self.photons_selected.saturating_add(other.photons_selected);
        self.distances_compared = self.distances_compared.saturating_add(other.distances_compared);
        self.photons_found = self.photons_found.saturating_add(other.photons_found);
        self.photons_reflected = self.photons_reflected.saturating_add(other.photons_reflected);
        self.photons_on_microfacets =
            self.photons_on_microfacets.saturating_add(other.photons_on_microfacets);
        self.normals_decoded = self.normals_decoded.saturating_add(other.normals_decoded);
        self.lookups = self.lookups.saturating_add(other.lookups);
        self.points_tested = self.points_tested.saturating_add(other.points_tested);
        self.drains = self.drains.saturating_add(other.drains);
        self.most_waiting = self.most_waiting.max(other.most_waiting);
        self.cycles = self.cycles.saturating_add(other.cycles);
    }
}
