//! Energy of a frame and area of on-chip memory, by published figures of one process.
//!
//! Energies are those of M. Horowitz, "Computing's energy problem (and what we can do about it)", ISSCC 2014,
//! figure 1.1.9: 45 nm, 0.9 V. The area is that of Intel's SRAM of 153 Mbit in 45 nm (2006), 119 mm^2. The
//! model counts reads of caches, fills of their lines, transfers of DRAM, and counted arithmetic. Leakage,
//! clock, control, wires between units, registers, buffers and the host's link are not in it: its figures
//! compare designs, and are a lower bound of a chip's energy.

/// Bits of the accesses to memory whose energies are published, in bytes.
const ACCESS_BYTES: f64 = 8.0;
/// Sizes of caches, bytes, and published energies of a read of 64 bits, pJ.
const SRAM_READS: [(f64, f64); 3] = [(8192.0, 10.0), (32768.0, 20.0), (1_048_576.0, 100.0)];
/// Published energy of a read of 64 bits from DRAM: the range's ends, pJ.
const DRAM_READ: [f64; 2] = [1300.0, 2600.0];
/// Published energies of an addition and of a multiplication of 32-bit floating-point numbers, pJ.
const OPERATIONS: [f64; 2] = [0.9, 3.7];
/// Area of a published SRAM, mm^2, and its size, Mbit.
const PUBLISHED_SRAM: (f64, f64) = (119.0, 153.0);

/// Energies and area of a chip's parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Energy of a byte read from a cache or written to it, pJ; `None` for [`Energy::published_sram`] at the
    /// cache's size.
    pub sram_pj_per_byte: Option<f64>,
    /// Energy of a byte read from DRAM or written to it, pJ.
    pub dram_pj_per_byte: f64,
    /// Mean energy of a floating-point operation, pJ.
    pub flop_pj: f64,
    /// Area of on-chip memory, mm^2 per 2^20 bytes.
    pub sram_mm2_per_mb: f64,
}

impl Default for Energy {
    fn default() -> Self {
        Self::PUBLISHED
    }
}

impl Energy {
    /// Published figures: DRAM at the middle of its range, an operation as the mean of an addition and a
    /// multiplication.
    pub const PUBLISHED: Self = Self {
        sram_pj_per_byte: None,
        dram_pj_per_byte: (DRAM_READ[0] + DRAM_READ[1]) / 2.0 / ACCESS_BYTES,
        flop_pj: (OPERATIONS[0] + OPERATIONS[1]) / 2.0,
        sram_mm2_per_mb: 8.0 * PUBLISHED_SRAM.0 / PUBLISHED_SRAM.1,
    };

    /// Energy of a byte of a cache of `bytes` bytes, pJ: the published energies, and a power law between two
    /// of them and beyond the outer ones.
    pub fn published_sram(bytes: f64) -> f64 {
        let [least, middle, most] = SRAM_READS;
        let [(size, energy), (other_size, other_energy)] =
            if bytes < middle.0 { [least, middle] } else { [middle, most] };
        let exponent = (other_energy / energy).ln() / (other_size / size).ln();
        energy / ACCESS_BYTES * (bytes / size).powf(exponent)
    }

    /// Energy of `traffic` bytes read from or written to a cache of `cache_bytes` bytes, J.
    pub fn sram_joules(&self, traffic: f64, cache_bytes: f64) -> f64 {
        let of_byte = self.sram_pj_per_byte.unwrap_or_else(|| Self::published_sram(cache_bytes));
        traffic * of_byte * PICO
    }

    /// Energy of `traffic` bytes read from or written to DRAM, J.
    pub fn dram_joules(&self, traffic: f64) -> f64 {
        traffic * self.dram_pj_per_byte * PICO
    }

    /// Energy of `flops` floating-point operations, J.
    pub fn flop_joules(&self, flops: f64) -> f64 {
        flops * self.flop_pj * PICO
    }

    /// Area of `bytes` bytes of on-chip memory, mm^2.
    pub fn sram_mm2(&self, bytes: f64) -> f64 {
        self.sram_mm2_per_mb * bytes / f64::from(1 << 20)
    }
}

/// Joules of a picojoule.
const PICO: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_of_a_published_size_takes_the_published_energy() {
        for (bytes, energy) in SRAM_READS {
            let found = ACCESS_BYTES * Energy::published_sram(bytes);
            assert!((found / energy - 1.0).abs() < 1e-12, "{bytes}: {found}");
        }
    }

    #[test]
    fn a_larger_cache_takes_more_energy() {
        let energies: Vec<_> =
            (7..26).map(|exponent| Energy::published_sram(f64::from(1 << exponent))).collect();
        assert!(energies.windows(2).all(|pair| 0.0 < pair[0] && pair[0] < pair[1]), "{energies:?}");
    }

    #[test]
    fn energies_are_of_the_published_units() {
        let energy = Energy::PUBLISHED;
        // 10^12 reads of 64 bits of DRAM take 1300 to 2600 J.
        assert!((energy.dram_joules(8e12) - 1950.0).abs() < 1e-9);
        assert!((energy.flop_joules(1e12) - 2.3).abs() < 1e-12);
        assert!((energy.sram_joules(8e12, 32768.0) - 20.0).abs() < 1e-9);
        let stated = Energy { sram_pj_per_byte: Some(1.0), ..energy };
        assert!((stated.sram_joules(2e12, 32768.0) - 2.0).abs() < 1e-12);
        // 153 Mbit.
        assert!((energy.sram_mm2(153.0 * 131_072.0) - 119.0).abs() < 1e-9);
    }
}
