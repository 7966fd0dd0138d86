//! Classes of densities: how finely the decision graph tells them apart.

/// Bits of a density that its class leaves out: what is left are the exponent and three bits, eight classes to an octave.
const CLASS_BITS: u32 = 49;

/// The class of a density (never negative) in the decision graph.
pub(super) fn density_class(rho: f64) -> u32 {
    (rho.to_bits() >> CLASS_BITS) as u32
}

/// The middle of a class.
pub(super) fn class_density(class: u32) -> f64 {
    let edge = |class: u32| f64::from_bits(u64::from(class) << CLASS_BITS);
    f64::midpoint(edge(class), edge(class + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_of_densities_are_eighths_of_octaves() {
        for (rho, middle) in
            [(1.0, 1.0625), (1.124, 1.0625), (1.125, 1.1875), (4.1, 4.25), (0.05, 0.048_828_125)]
        {
            let class = density_class(rho);
            assert!((class_density(class) - middle).abs() < 1e-6, "{rho}: {}", class_density(class));
            assert!((class_density(class) / rho - 1.0).abs() < 0.07);
        }
        assert!(density_class(0.3) < density_class(0.5) && density_class(0.5) < density_class(100.0));
    }
}
