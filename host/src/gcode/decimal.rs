//! Exact decimals: a number is kept as the program writes it.

use std::fmt;

/// Decimals kept of a number.
const DECIMALS: u32 = 10;
/// Units in one: 10¹⁰.
const UNITS_PER_ONE: i64 = 10_i64.pow(DECIMALS);

/// A number as written in a program, a whole count of 10⁻¹⁰; range ±9.2e8.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Decimal(i64);

/// Why a text is no [`Decimal`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberFault {
    /// No text at all.
    Missing,
    /// The text is not `[+-]digits[.digits]`.
    Malformed,
    /// The number is beyond the range.
    TooLarge,
}

impl Decimal {
    /// Reads `[+-]digits[.digits]` with blanks anywhere, as RS-274 allows. More than ten decimals are rounded,
    /// halves away from zero; the second value says whether that changed the number.
    pub(super) fn parse(text: &[u8]) -> Result<(Self, bool), NumberFault> {
        let mut bytes = text.iter().filter(|byte| !matches!(byte, b' ' | b'\t')).peekable();
        let sign = match bytes.peek() {
            None => return Err(NumberFault::Missing),
            Some(b'-') => -1,
            Some(_) => 1,
        };
        bytes.next_if(|byte| matches!(byte, b'+' | b'-'));

        let mut magnitude = Some(0_i64);
        let mut decimals = None;
        let mut digits_seen = false;
        let (mut rounded, mut excess_digits, mut rounds_up) = (false, false, false);
        for &byte in bytes {
            let digit = match byte {
                b'0'..=b'9' => i64::from(byte - b'0'),
                b'.' if decimals.is_none() => {
                    decimals = Some(0);
                    continue;
                }
                _ => return Err(NumberFault::Malformed),
            };
            digits_seen = true;
            if decimals == Some(DECIMALS) {
                rounds_up |= !excess_digits && digit >= 5;
                excess_digits = true;
                rounded |= digit != 0;
                continue;
            }
            decimals = decimals.map(|count| count + 1);
            magnitude = magnitude.and_then(|units| units.checked_mul(10)?.checked_add(digit));
        }
        if !digits_seen {
            return Err(NumberFault::Malformed);
        }
        let missing_decimals = DECIMALS - decimals.unwrap_or(0);
        let units = magnitude
            .and_then(|units| units.checked_mul(10_i64.pow(missing_decimals)))
            .and_then(|units| units.checked_add(i64::from(rounds_up)))
            .ok_or(NumberFault::TooLarge)?;
        Ok((Self(sign * units), rounded))
    }

    /// The value as f64, correctly rounded up to ±900 000 and within one unit in the last place beyond.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        self.0 as f64 / UNITS_PER_ONE as f64
    }

    /// The value in tenths if it is a whole number of them: G90.1 is 901.
    pub(super) fn tenths(self) -> Option<i64> {
        const UNITS_PER_TENTH: i64 = UNITS_PER_ONE / 10;
        (self.0 % UNITS_PER_TENTH == 0).then_some(self.0 / UNITS_PER_TENTH)
    }

    /// The value if it is a whole number.
    pub(super) fn whole(self) -> Option<i64> {
        (self.0 % UNITS_PER_ONE == 0).then_some(self.0 / UNITS_PER_ONE)
    }

    /// Half the value, if that is exact.
    pub(super) fn half(self) -> Option<Self> {
        (self.0 % 2 == 0).then_some(Self(self.0 / 2))
    }

    /// Whether as many inches are a whole count of 10⁻¹⁰ mm.
    pub(super) fn is_exact_in_inches(self) -> bool {
        self.0 % 5 == 0
    }

    /// -1, 0 or 1.
    pub(super) fn signum(self) -> i64 {
        self.0.signum()
    }
}

/// A length or coordinate \[10⁻¹⁰ mm\], exact, within ±[`Length::LIMIT`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Length(i64);

impl Length {
    /// 0 mm.
    pub const ZERO: Self = Self(0);
    /// Units in a millimetre.
    pub const UNITS_PER_MM: i64 = UNITS_PER_ONE;
    /// The largest length, 1 000 000 mm; its negative is the smallest. The distance of any two lengths, and
    /// the products an arc needs, then fit their integers without overflow checks.
    pub const LIMIT: Self = Self(1_000_000 * Self::UNITS_PER_MM);

    /// A count of 10⁻¹⁰ mm; `None` beyond ±[`Length::LIMIT`].
    #[must_use]
    pub const fn from_units(units: i64) -> Option<Self> {
        if units >= -Self::LIMIT.0 && units <= Self::LIMIT.0 { Some(Self(units)) } else { None }
    }

    /// The count of 10⁻¹⁰ mm.
    #[must_use]
    pub const fn units(self) -> i64 {
        self.0
    }

    /// \[mm\], the f64 nearest to the exact value up to ±900 000 mm, within one unit in the last place
    /// beyond.
    #[must_use]
    pub fn to_mm(self) -> f64 {
        self.0 as f64 / Self::UNITS_PER_MM as f64
    }

    /// The sum, exact; `None` beyond ±[`Length::LIMIT`].
    #[must_use]
    pub const fn checked_add(self, other: Self) -> Option<Self> {
        Self::from_units(self.0 + other.0)
    }

    /// Millimetres; `None` beyond ±[`Length::LIMIT`].
    pub(super) fn from_mm(number: Decimal) -> Option<Self> {
        Self::from_units(number.0)
    }

    /// Inches of 25.4 mm, rounded to 10⁻¹⁰ mm; `None` beyond ±[`Length::LIMIT`].
    pub(super) fn from_inches(number: Decimal) -> Option<Self> {
        let tenths_of_units = i128::from(number.0) * 254;
        let half = if tenths_of_units < 0 { -5 } else { 5 };
        i64::try_from((tenths_of_units + half) / 10).ok().and_then(Self::from_units)
    }

    /// The length nearest to a computed number of millimetres; `None` beyond ±[`Length::LIMIT`], and for what
    /// is no number.
    #[must_use]
    pub fn nearest(mm: f64) -> Option<Self> {
        let units = (mm * Self::UNITS_PER_MM as f64).round();
        // As an integer the limit is exact in f64.
        (units.abs() <= Self::LIMIT.0 as f64).then_some(Self(units as i64))
    }
}

/// Writes all decimals that are not zero: the exact value.
fn write_units(units: i64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let sign = if units < 0 { "-" } else { "" };
    let magnitude = units.unsigned_abs();
    let whole = magnitude / UNITS_PER_ONE.unsigned_abs();
    let fraction = format!("{:010}", magnitude % UNITS_PER_ONE.unsigned_abs());
    match fraction.trim_end_matches('0') {
        "" => write!(f, "{sign}{whole}"),
        decimals => write!(f, "{sign}{whole}.{decimals}"),
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_units(self.0, f)
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_units(self.0, f)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Decimal, NumberFault> {
        Decimal::parse(text.as_bytes()).map(|(number, _)| number)
    }

    #[test]
    fn reads_what_rs274_writes() {
        for (text, exact) in [
            ("1", "1"),
            ("+1.", "1"),
            ("-.5", "-0.5"),
            ("007.250", "7.25"),
            ("-0", "0"),
            (" + 0. 12\t34", "0.1234"),
            ("0.0000000001", "0.0000000001"),
            ("0.10000000000000000000000", "0.1"),
            ("922337203.6854775807", "922337203.6854775807"),
        ] {
            assert_eq!(parse(text).map(|number| number.to_string()), Ok(exact.to_owned()), "{text}");
        }
    }

    #[test]
    fn refuses_the_rest() {
        for text in ["-", "+", ".", "-.", "1.2.3", "--5", "+-5", "5-", "5-3", "1..2"] {
            assert_eq!(parse(text), Err(NumberFault::Malformed), "{text}");
        }
        assert_eq!(parse(" "), Err(NumberFault::Missing));
        assert_eq!(parse("922337203.6854775808"), Err(NumberFault::TooLarge));
        assert_eq!(parse(&"9".repeat(100_000)), Err(NumberFault::TooLarge));
        assert_eq!(parse("922337203.68547758075"), Err(NumberFault::TooLarge));
    }

    #[test]
    fn more_than_ten_decimals_are_rounded() {
        for (text, exact, rounded) in [
            ("0.00000000001", "0", true),
            ("0.00000000005", "0.0000000001", true),
            ("-0.00000000005", "-0.0000000001", true),
            ("-0.000000000049", "0", true),
            ("1.99999999999", "2", true),
            ("0.100000000000", "0.1", false),
        ] {
            let (number, was_rounded) = Decimal::parse(text.as_bytes()).unwrap();
            assert_eq!((number.to_string().as_str(), was_rounded), (exact, rounded), "{text}");
        }
    }

    #[test]
    fn inches_are_exact_or_rounded() {
        let length = |text| Length::from_inches(parse(text).unwrap());
        assert_eq!(length("1").unwrap().to_string(), "25.4");
        assert_eq!(length("-0.000000001").unwrap().units(), -254);
        assert_eq!(length("0.0000000005").unwrap().units(), 127);
        assert_eq!(length("0.0000000001").unwrap().units(), 25);
        assert_eq!(length("-0.0000000003").unwrap().units(), -76);
        assert!(!parse("0.0000000001").unwrap().is_exact_in_inches());
        assert_eq!(length("39370.078740157").unwrap().to_string(), "999999.9999999878");
        assert_eq!(length("39370.078740158"), None);
        assert_eq!(length("900000000"), None);
    }

    #[test]
    fn computed_lengths_are_the_nearest() {
        assert_eq!(Length::nearest(0.1 + 0.2).unwrap().to_string(), "0.3");
        assert_eq!(Length::nearest(-1e6), Some(Length(-Length::LIMIT.0)));
        for mm in [1_000_000.001, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(Length::nearest(mm), None);
        }
    }

    #[test]
    fn the_limit_is_inside() {
        assert_eq!(Length::from_mm(parse("-1000000").unwrap()).unwrap().to_mm(), -1e6);
        assert_eq!(Length::from_mm(parse("1000000.0000000001").unwrap()), None);
        assert_eq!(Length::LIMIT.checked_add(Length(1)), None);
    }
}
