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
    /// Digits other than zero after the tenth decimal.
    TooManyDecimals,
}

impl Decimal {
    /// Reads `[+-]digits[.digits]` with blanks anywhere, as RS-274 allows.
    pub(super) fn parse(text: &[u8]) -> Result<Self, NumberFault> {
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
        let mut excess = false;
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
                excess |= digit != 0;
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
            .ok_or(NumberFault::TooLarge)?;
        if excess { Err(NumberFault::TooManyDecimals) } else { Ok(Self(sign * units)) }
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

    /// Whether it is a whole number.
    pub(super) fn is_whole(self) -> bool {
        self.0 % UNITS_PER_ONE == 0
    }

    /// -1, 0 or 1.
    pub(super) fn signum(self) -> i64 {
        self.0.signum()
    }
}

/// A length or coordinate \[10⁻¹⁰ mm\], exact, within ±[`Length::LIMIT`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Length(i64);

/// Why a number is no [`Length`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LengthFault {
    /// The length is beyond ±[`Length::LIMIT`].
    OutOfRange,
    /// An inch value that is no whole count of 10⁻¹⁰ mm.
    Inexact,
}

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

    /// Millimetres.
    pub(super) fn from_mm(number: Decimal) -> Result<Self, LengthFault> {
        Self::from_units(number.0).ok_or(LengthFault::OutOfRange)
    }

    /// Inches of 25.4 mm.
    pub(super) fn from_inches(number: Decimal) -> Result<Self, LengthFault> {
        let tenths_of_units = i128::from(number.0) * 254;
        if tenths_of_units % 10 != 0 {
            return Err(LengthFault::Inexact);
        }
        i64::try_from(tenths_of_units / 10).ok().and_then(Self::from_units).ok_or(LengthFault::OutOfRange)
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
        Decimal::parse(text.as_bytes())
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
        for text in ["0.00000000001", "0.000000000010", "-1.00000000000000005"] {
            assert_eq!(parse(text), Err(NumberFault::TooManyDecimals), "{text}");
        }
    }

    #[test]
    fn inches_are_exact_or_refused() {
        let length = |text| Length::from_inches(parse(text).unwrap());
        assert_eq!(length("1").unwrap().to_string(), "25.4");
        assert_eq!(length("-0.000000001").unwrap().units(), -254);
        assert_eq!(length("0.0000000005").unwrap().units(), 127);
        assert_eq!(length("0.0000000001"), Err(LengthFault::Inexact));
        assert_eq!(length("39370.078740157").unwrap().to_string(), "999999.9999999878");
        assert_eq!(length("39370.078740158"), Err(LengthFault::OutOfRange));
        assert_eq!(length("900000000"), Err(LengthFault::OutOfRange));
    }

    #[test]
    fn the_limit_is_inside() {
        assert_eq!(Length::from_mm(parse("-1000000").unwrap()).unwrap().to_mm(), -1e6);
        assert_eq!(Length::from_mm(parse("1000000.0000000001").unwrap()), Err(LengthFault::OutOfRange));
        assert_eq!(Length::LIMIT.checked_add(Length(1)), None);
    }
}
