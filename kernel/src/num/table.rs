//! Tables of coefficients in a number's own type, converted when the kernel is compiled: on a core that has
//! no f64, each conversion in the tick would be a subroutine, and the optimiser is not to be relied upon for
//! it.

use fixed::types::I3F29;

macro_rules! convert {
    ($name:ident, $unit:ty, |$value:ident| $constant:expr) => {
        /// The first `N` of `table`, each the nearest value of this type. For constants: too short a table
        /// does not compile.
        #[allow(clippy::indexing_slicing, clippy::cast_possible_truncation)]
        pub(crate) const fn $name<const N: usize, const M: usize>(table: &[f64; M]) -> [$unit; N] {
            let mut converted = [<$unit as super::Scalar>::ZERO; N];
            let mut index = 0;
            while index < N {
                let $value = table[index];
                converted[index] = $constant;
                index += 1;
            }
            converted
        }
    };
}

convert!(f32s, f32, |value| value as f32);
convert!(f64s, f64, |value| value);
convert!(fixed_points, I3F29, |value| {
    I3F29::from_bits((value * 536_870_912.0 + if value < 0.0 { -0.5 } else { 0.5 }) as i32)
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::Scalar;

    #[test]
    fn converts_as_at_run_time() {
        const TABLE: [f64; 4] = [2.029_356_063_208_384_1, -0.667_631_384_427_294_7, 4e-9, -3e-12];
        assert_eq!(f32s(&TABLE), TABLE.map(f32::from_f64));
        assert_eq!(f64s::<3, 4>(&TABLE), TABLE[..3]);
        assert_eq!(fixed_points(&TABLE), TABLE.map(I3F29::from_f64));
    }
}
