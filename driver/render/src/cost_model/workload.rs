//! Workload of one frame: counts that follow from the symbols of Table 7.1, or that a run has measured.

use photoncard_shared::counters::Counters;

use super::Symbols;

/// Counts of rays, gathers, samples and bytes of one frame, summed over all chips. *Nominal* values follow
/// from the symbols of Table 7.1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Workload {
    /// Number of eye rays. Nominal: `T P`.
    pub eye_rays: f64,
    /// Number of shadow rays. Nominal: `T P N_S`.
    pub shadow_rays: f64,
    /// Number of final gather rays, including those of irradiance records. Nominal: `T P R_FG N_FG`.
    pub gather_rays: f64,
    /// Number of rays that survey the surroundings of irradiance records. Nominal: 0, because Table 7.1 has
    /// no such rays.
    pub survey_rays: f64,
    /// Number of photon searches at the ends of gather rays. Nominal: `T P R_FG N_FG`, one per gather ray.
    pub ray_gathers: f64,
    /// Number of photon searches for importance tables. Nominal: `T P R_FG`, one per pixel with a final
    /// gather.
    pub table_gathers: f64,
    /// Mean number of photons that a gather returns, to be reflected or counted in a table. Nominal: `k`.
    pub photons_per_gather: f64,
    /// Number of samples whose irradiance is interpolated. Nominal: `T P R_IC`.
    pub interpolated_samples: f64,
    /// Number of irradiance records created. Nominal: `T P R_FG`, one per pixel with a final gather.
    pub records: f64,
    /// Bytes of the photon map read from DRAM. Nominal: `B_G` per photon search.
    pub photon_map_bytes: f64,
    /// Bytes of the scene read from DRAM. Nominal: `B_R` per ray.
    pub scene_bytes: f64,
    /// Number of tiles of the picture. Nominal: `T`.
    pub tiles: f64,
    /// Bytes from the chips to the host (pixels). Nominal: `T P B_P`.
    pub bytes_to_host: f64,
    /// Bytes from the host to the chips (tile commands). Nominal: `T B_T`. The card image is loaded before
    /// the frame.
    pub bytes_from_host: f64,
}

impl Workload {
    /// Workload of a frame with all three techniques, by Table 7.1. It has `T P (1 + R_FG N_FG + N_S)` rays.
    pub fn nominal(symbols: &Symbols) -> Self {
        let pixels = symbols.pixels();
        let gathering_pixels = pixels * symbols.gathering_share();
        let mut workload = Self {
            gather_rays: gathering_pixels * symbols.gather_rays,
            ray_gathers: gathering_pixels * symbols.gather_rays,
            table_gathers: gathering_pixels,
            interpolated_samples: pixels * symbols.interpolated_share,
            records: gathering_pixels,
            ..Self::of_pixels(symbols)
        };
        workload.photon_map_bytes = workload.gathers() * symbols.gather_dram;
        workload.scene_bytes = workload.rays() * symbols.ray_dram;
        workload
    }

    /// Workload of a frame without the three techniques, by Table 7.1. Every pixel has a final gather with
    /// `N_FG` rays, and each photon gather reads `B_N` bytes.
    pub fn naive(symbols: &Symbols) -> Self {
        let rays = symbols.pixels() * symbols.gather_rays;
        let mut workload = Self { gather_rays: rays, ray_gathers: rays, ..Self::of_pixels(symbols) };
        workload.photon_map_bytes = workload.gathers() * symbols.naive_gather_dram;
        workload.scene_bytes = workload.rays() * symbols.ray_dram;
        workload
    }

    /// Part of the workload that does not depend on the fraction of interpolated pixels: eye rays, shadow
    /// rays, photons per gather, tiles, and transfers over the link.
    fn of_pixels(symbols: &Symbols) -> Self {
        let pixels = symbols.pixels();
        Self {
            eye_rays: pixels,
            shadow_rays: pixels * symbols.shadow_rays,
            photons_per_gather: symbols.neighbors,
            tiles: symbols.tiles,
            bytes_to_host: pixels * symbols.pixel_bytes,
            bytes_from_host: symbols.tiles * symbols.command_bytes,
            ..Self::default()
        }
    }

    /// Workload measured by the counters of chips. Bytes and tiles are zero, because [`Counters`] lacks them.
    pub fn counted(counters: &Counters) -> Self {
        Self {
            eye_rays: counters.eye_rays as f64,
            shadow_rays: counters.shadow_rays as f64,
            gather_rays: counters.gather_rays as f64,
            survey_rays: counters.survey_rays as f64,
            ray_gathers: (counters.gathers - counters.tables) as f64,
            table_gathers: counters.tables as f64,
            photons_per_gather: counters.photons_found as f64 / counters.gathers.max(1) as f64,
            interpolated_samples: counters.interpolated_samples as f64,
            records: counters.records as f64,
            ..Self::default()
        }
    }

    /// Number of rays of all kinds.
    pub fn rays(&self) -> f64 {
        self.eye_rays + self.shadow_rays + self.gather_rays + self.survey_rays
    }

    /// Number of photon searches: at the ends of gather rays, and for importance tables.
    pub fn gathers(&self) -> f64 {
        self.ray_gathers + self.table_gathers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nominal_second_casts_385_million_rays() {
        let symbols = Symbols::NOMINAL;
        let rays = symbols.frames_per_second * Workload::nominal(&symbols).rays();
        assert!((rays - 385.35e6).abs() < 0.01e6, "{rays}");
    }

    #[test]
    fn a_naive_second_reads_11_terabytes_of_photons() {
        let symbols = Symbols::NOMINAL;
        let bytes = symbols.frames_per_second * Workload::naive(&symbols).photon_map_bytes;
        assert!((bytes / 11e12 - 1.0).abs() < 1e-12, "{bytes}");
    }

    #[test]
    fn a_nominal_frame_without_the_cache_casts_the_rays_of_the_naive_frame() {
        let symbols = Symbols { interpolated_share: 0.0, ..Symbols::NOMINAL };
        assert_eq!(Workload::nominal(&symbols).rays(), Workload::naive(&symbols).rays());
        assert_eq!(Workload::nominal(&symbols).interpolated_samples, 0.0);
    }
}
