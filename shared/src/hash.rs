//! Integer hash from which all random numbers are made, on chips and on hosts.

/// 32-bit integer hash (Wellons, `lowbias32`).
#[inline(always)]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected values follow from the constants that Wellons published. Other constants would change
    /// every picture.
    #[test]
    fn hash_has_its_golden_values() {
        assert_eq!([0, 1, 2, u32::MAX].map(hash), [0, 0x6889_90c0, 0xd113_2181, 0x6768_824a]);
    }

    #[test]
    fn an_input_bit_changes_half_of_the_hash_bits() {
        let mut changed = 0;
        for number in 0..1_000_u32 {
            for bit in 0..32 {
                changed += (hash(number) ^ hash(number ^ 1 << bit)).count_ones();
            }
        }
        let mean = f64::from(changed) / 32_000.0;
        assert!((mean - 16.0).abs() < 0.1, "{mean}");
    }
}
