//! The value of a word: exact as written, or computed.

use super::decimal::Decimal;

/// How far from a whole number a computed count may be: LinuxCNC's tolerance for indices.
const WHOLE_TOLERANCE: f64 = 1e-4;

/// The value of a word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    /// As written.
    Exact(Decimal),
    /// The value of an expression, or a number beyond the range of a [`Decimal`]. Finite.
    Real(f64),
}

impl Number {
    /// The value, rounded to the nearest f64.
    pub(super) fn to_f64(self) -> f64 {
        match self {
            Self::Exact(decimal) => decimal.to_f64(),
            Self::Real(value) => value,
        }
    }

    /// The value in tenths if it is a whole number of them: G90.1 is 901.
    pub(super) fn tenths(self) -> Option<i64> {
        match self {
            Self::Exact(decimal) => decimal.tenths(),
            Self::Real(value) => near_whole(value * 10.0, 10.0 * WHOLE_TOLERANCE),
        }
    }

    /// The value if it is a whole number.
    pub(super) fn whole(self) -> Option<i64> {
        match self {
            Self::Exact(decimal) => decimal.whole(),
            Self::Real(value) => near_whole(value, WHOLE_TOLERANCE),
        }
    }

    /// Half the value.
    pub(super) fn half(self) -> Self {
        match self {
            Self::Exact(decimal) => decimal.half().map_or(Self::Real(decimal.to_f64() / 2.0), Self::Exact),
            Self::Real(value) => Self::Real(value / 2.0),
        }
    }

    /// -1, 0 or 1.
    pub(super) fn signum(self) -> i64 {
        match self {
            Self::Exact(decimal) => decimal.signum(),
            Self::Real(value) => i64::from(value > 0.0) - i64::from(value < 0.0),
        }
    }
}

/// A computed whole number, which may be off by rounding errors.
pub(super) fn whole(value: f64) -> Option<i64> {
    near_whole(value, WHOLE_TOLERANCE)
}

fn near_whole(value: f64, tolerance: f64) -> Option<i64> {
    const LARGEST: f64 = 1e15;
    let whole = value.round();
    ((value - whole).abs() <= tolerance && whole.abs() <= LARGEST).then_some(whole as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn computed_counts_may_be_off_by_rounding() {
        assert_eq!(Number::Real(2.0 + 1e-9).whole(), Some(2));
        assert_eq!(Number::Real(2.01).whole(), None);
        assert_eq!(Number::Real(5.5).tenths(), Some(55));
        assert_eq!(Number::Real(59.1 + 1e-12).tenths(), Some(591));
        assert_eq!(Number::Real(5.55).tenths(), None);
        for value in [f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(Number::Real(value).whole(), None);
        }
    }

    #[test]
    fn halves_stay_exact_where_they_can() {
        let exact = |text: &str| Number::Exact(Decimal::parse(text.as_bytes()).unwrap().0);
        assert_eq!(exact("0.5").half(), exact("0.25"));
        assert_eq!(exact("0.0000000001").half(), Number::Real(0.5e-10));
        assert_eq!(
            [exact("-1").signum(), Number::Real(-0.0).signum(), Number::Real(3.0).signum()],
            [-1, 0, 1]
        );
    }
}
