//! Sums, products, quotients and the order of any two numbers: zeros, subnormal numbers, infinities and NaN, too.
//!
//! `double` comes here with what its short way does not take. IEEE 754, to nearest, ties to even. In whole numbers:
//! an operation of f64 would be a call of the routine that asks.

const SIGN: u64 = 1 << 63;
const INFINITE: u64 = 0x7FF << FRACTION_BITS;
const NOT_A_NUMBER: u64 = INFINITE | 1 << 51;

const FRACTION_BITS: u32 = 52;
/// Bits below the last place while a result is made; the lowest one stands for all that lie lower.
const GUARD_BITS: u32 = 3;
/// Where the leading bit is then.
const LEADING: u32 = FRACTION_BITS + GUARD_BITS;
const BIAS: i32 = 1023;

/// A finite number without its sign: `whole`·2^(`exponent` − 1075).
struct Finite {
    exponent: i32,
    whole: u64,
}

impl Finite {
    fn of(bits: u64) -> Self {
        let (exponent, fraction) =
            ((bits >> FRACTION_BITS & 0x7FF) as i32, bits & ((1 << FRACTION_BITS) - 1));
        if exponent == 0 {
            Self { exponent: 1, whole: fraction }
        } else {
            Self { exponent, whole: fraction | 1 << FRACTION_BITS }
        }
    }

    /// A number other than 0 with its leading bit in the place of a normal one's.
    #[inline(never)]
    fn normal(bits: u64) -> Self {
        let Self { exponent, whole } = Self::of(bits);
        let by = whole.leading_zeros() - (u64::BITS - 1 - FRACTION_BITS);
        Self { exponent: exponent - by as i32, whole: whole << by }
    }
}

fn is_nan(bits: u64) -> bool {
    bits & !SIGN > INFINITE
}

fn is_infinite(bits: u64) -> bool {
    bits & !SIGN == INFINITE
}

fn is_zero(bits: u64) -> bool {
    bits & !SIGN == 0
}

/// `bits` shifted to the right; whether something was lost is in the lowest bit.
#[inline(never)]
fn shifted(bits: u64, by: u32) -> u64 {
    if by >= u64::BITS { u64::from(bits != 0) } else { bits >> by | u64::from(bits & ((1 << by) - 1) != 0) }
}

/// The number `whole`·2^(`exponent` − 1075 − [`GUARD_BITS`]), rounded.
fn rounded(sign: u64, exponent: i32, whole: u64) -> u64 {
    if whole == 0 {
        return sign;
    }
    let (mut exponent, mut whole) = (exponent, whole);
    let above = u64::BITS - 1 - LEADING;
    let zeros = whole.leading_zeros();
    if zeros < above {
        whole = shifted(whole, above - zeros);
        exponent += (above - zeros) as i32;
    } else {
        whole <<= zeros - above;
        exponent -= (zeros - above) as i32;
    }
    if exponent >= 0x7FF {
        return sign | INFINITE;
    }
    // A subnormal number has the exponent of the smallest normal one.
    let mut field = exponent as u64;
    if exponent < 1 {
        whole = shifted(whole, (1 - exponent) as u32);
        field = 1;
    }
    let (kept, guard) = (whole >> GUARD_BITS, whole & ((1 << GUARD_BITS) - 1));
    let half = 1 << (GUARD_BITS - 1);
    let is_up = guard > half || guard == half && kept & 1 == 1;
    // The leading bit counts as one of the exponent, and a carry as one more.
    sign | (((field - 1) << FRACTION_BITS) + kept + u64::from(is_up))
}

/// a + b.
pub(crate) extern "C" fn sum(a: u64, b: u64) -> u64 {
    if is_nan(a) || is_nan(b) || is_infinite(a) && is_infinite(b) && a != b {
        return NOT_A_NUMBER;
    }
    if is_infinite(a) || is_infinite(b) {
        return if is_infinite(a) { a } else { b };
    }
    let (a, b) = if b & !SIGN > a & !SIGN { (b, a) } else { (a, b) };
    let (large, small) = (Finite::of(a), Finite::of(b));
    let apart = (large.exponent - small.exponent) as u32;
    let (high, low) = (large.whole << GUARD_BITS, shifted(small.whole << GUARD_BITS, apart));
    if (a ^ b) & SIGN == 0 {
        rounded(a & SIGN, large.exponent, high + low)
    } else if high == low {
        0
    } else {
        rounded(a & SIGN, large.exponent, high - low)
    }
}

/// a·b.
pub(crate) extern "C" fn product(a: u64, b: u64) -> u64 {
    let sign = (a ^ b) & SIGN;
    if is_nan(a) || is_nan(b) || is_infinite(a) && is_zero(b) || is_zero(a) && is_infinite(b) {
        return NOT_A_NUMBER;
    }
    if is_infinite(a) || is_infinite(b) {
        return sign | INFINITE;
    }
    if is_zero(a) || is_zero(b) {
        return sign;
    }
    let (a, b) = (Finite::normal(a), Finite::normal(b));
    // Of 128 bits, those from 64 on, with 64 bits of one factor.
    let (a_whole, b_whole) = (a.whole << (63 - FRACTION_BITS), b.whole);
    let part = |a: u64, b: u64| (a & 0xFFFF_FFFF) * (b & 0xFFFF_FFFF);
    let lowest = part(a_whole, b_whole);
    let first = part(a_whole >> 32, b_whole) + (lowest >> 32);
    let second = part(a_whole, b_whole >> 32) + (first & 0xFFFF_FFFF);
    let high = part(a_whole >> 32, b_whole >> 32) + (first >> 32) + (second >> 32);
    // From 2^51 to 2^53: where guard bits are missing, they are taken from below.
    let whole = high << GUARD_BITS | (second & 0xFFFF_FFFF) >> (32 - GUARD_BITS);
    let is_more = second << (32 + GUARD_BITS) != 0 || lowest << 32 != 0;
    rounded(sign, a.exponent + b.exponent - BIAS + 1, whole | u64::from(is_more))
}

/// a/b.
pub(crate) extern "C" fn quotient(a: u64, b: u64) -> u64 {
    let sign = (a ^ b) & SIGN;
    if is_nan(a) || is_nan(b) || is_infinite(a) && is_infinite(b) || is_zero(a) && is_zero(b) {
        return NOT_A_NUMBER;
    }
    if is_infinite(a) || is_zero(b) {
        return sign | INFINITE;
    }
    if is_zero(a) || is_infinite(b) {
        return sign;
    }
    let (a, b) = (Finite::normal(a), Finite::normal(b));
    // Digit by digit; the first one may be 0.
    let (mut rest, mut digits) = (a.whole, 0);
    for _ in 0..=LEADING {
        digits <<= 1;
        if rest >= b.whole {
            rest -= b.whole;
            digits |= 1;
        }
        rest <<= 1;
    }
    rounded(sign, a.exponent - b.exponent + BIAS, digits | u64::from(rest != 0))
}

/// Whether a < b, a = b or a > b: −1, 0 or 1; 2 if one is NaN.
// Shared by six routines: flash counts here, not time.
#[inline(never)]
fn order(a: u64, b: u64) -> i32 {
    if is_nan(a) || is_nan(b) {
        return 2;
    }
    let place = |bits: u64| {
        let magnitude = (bits & !SIGN).cast_signed();
        if bits & SIGN == 0 { magnitude } else { -magnitude }
    };
    let (a, b) = (place(a), place(b));
    i32::from(a > b) - i32::from(a < b)
}

/// Whether a < b.
pub(crate) extern "C" fn is_less(a: u64, b: u64) -> u32 {
    u32::from(order(a, b) < 0)
}

/// Whether a > b.
pub(crate) extern "C" fn is_greater(a: u64, b: u64) -> u32 {
    u32::from(order(a, b) == 1)
}

/// Whether a ≤ b.
pub(crate) extern "C" fn is_not_greater(a: u64, b: u64) -> u32 {
    u32::from(order(a, b) <= 0)
}

/// Whether a ≥ b.
pub(crate) extern "C" fn is_not_less(a: u64, b: u64) -> u32 {
    u32::from((0..=1).contains(&order(a, b)))
}

/// Whether a = b.
pub(crate) extern "C" fn is_equal(a: u64, b: u64) -> u32 {
    u32::from(order(a, b) == 0)
}

/// Whether one is NaN.
pub(crate) extern "C" fn is_unordered(a: u64, b: u64) -> u32 {
    u32::from(order(a, b) == 2)
}
