//! Coefficients of the power series of cosine and sine without their first terms, in each number's own type.
//!
//! With the terms up to y² and y³ taken off, what is left is, but for a factor,
//!
//! ```text
//! COSINE_TAIL: (cos πy − 1 + π²y²/2)/2 = y⁴·(c₁ + c₂·y² + c₃·y⁴ + …)
//! SINE_TAIL:   (sin πy − πy + π³y³/6)/(4π) = y⁵·(s₁ + s₂·y² + s₃·y⁴ + …)
//! ```
//!
//! The law's shapes are made of them ([`crate::law::shape`]).

use fixed::types::I3F29;

use super::table;

/// Terms that f64 resolves up to y = 1: the first one left out is below 7·10⁻¹⁷ of the sum's first.
pub(crate) const SERIES_TERMS_MAX: usize = 12;

/// (−1)^(n+1)·π^(2n+2)/(2·(2n+2)!), n = 1 …
const COSINE_TAIL: [f64; SERIES_TERMS_MAX] = [
    2.029_356_063_208_384_109_1,
    -0.667_631_384_427_294_747_94,
    0.117_665_315_179_446_602_27,
    -0.012_903_445_695_007_030_00,
    0.000_964_787_154_701_961_523_95,
    -0.000_052_319_052_462_422_853_559,
    0.000_002_151_534_793_516_473_503_6,
    -0.000_000_069_394_762_311_068_860_572,
    0.000_000_001_802_365_398_731_250_466_9,
    -0.000_000_000_038_503_535_653_006_766_899,
    0.000_000_000_000_688_432_364_018_870_685_21,
    -0.000_000_000_000_010_453_161_676_573_842_349,
];
/// (−1)^(n+1)·π^(2n+2)/(4·(2n+3)!), n = 1 …
const SINE_TAIL: [f64; SERIES_TERMS_MAX] = [
    0.202_935_606_320_838_410_91,
    -0.047_687_956_030_521_053_42,
    0.006_536_961_954_413_700_12,
    -0.000_586_520_258_863_955_909_38,
    0.000_037_107_198_257_767_750_921,
    -0.000_001_743_968_415_414_095_118_6,
    0.000_000_063_280_435_103_425_691_284,
    -0.000_000_001_826_177_955_554_443_699_3,
    0.000_000_000_042_913_461_874_553_582_546,
    -0.000_000_000_000_837_033_383_761_016_671_72,
    0.000_000_000_000_013_768_647_280_377_413_704,
    -0.000_000_000_000_000_193_577_068_084_700_784_24,
];

/// The coefficients in a number's own type.
pub trait Coefficients: Sized + 'static {
    /// Cosine's, over y⁴.
    const COSINE_TAIL: &'static [Self; SERIES_TERMS_MAX];
    /// Sine's, over y⁵.
    const SINE_TAIL: &'static [Self; SERIES_TERMS_MAX];
}

macro_rules! coefficients {
    ($unit:ty, $table:path) => {
        impl Coefficients for $unit {
            const COSINE_TAIL: &'static [Self; SERIES_TERMS_MAX] = &$table(&COSINE_TAIL);
            const SINE_TAIL: &'static [Self; SERIES_TERMS_MAX] = &$table(&SINE_TAIL);
        }
    };
}

coefficients!(f32, table::f32s);
coefficients!(f64, table::f64s);
coefficients!(I3F29, table::fixed_points);
