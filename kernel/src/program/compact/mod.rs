//! Items as few bytes: each as what differs from what the items before it let expect.
//!
//! Consumes and produces [`Item`]s; lossless, whatever the items. Background. An [`Encoder`] and a [`Decoder`]
//! keep the same state, so items are read in the order in which they were written, from the first on.
//!
//! An item is a row of nibbles, the low one of a byte first, filled up to whole bytes with 0. The first is its
//! kind:
//!
//! | kind | item | then |
//! |---|---|---|
//! | 0 | [`Item::Line`] | line, its end from its start; length less the distance to that end |
//! | 1 | [`Item::Line`] in the last one's direction | line; length less the last piece's |
//! | 2 | [`Item::Line`] | line, direction in full; length less the last piece's |
//! | 3 | [`Item::Septic`] | line, length less the last piece's, the coefficients' grid, their count and themselves by axis |
//! | 4 | [`Item::Feed`], a cruise from the last feed | length |
//! | 5 | [`Item::Feed`] | what fixes its times, feeds and times; length less the ramp's own |
//! | 6 | [`Item::EndOfStretch`] | its place from the last piece's end |
//! | 7 | [`Item::Dwell`] | steps of a tick |
//! | 8 | [`Item::Stop`] | |
//! | 9 | [`Item::Switch`] | spindle and coolant, speed |
//! | 10 | [`Item::Block`] | length, which figures are others than expected, and those |
//! | 11 | [`Item::Block`] with the last one's limits | length, the junction's feed |
//! | 12 | [`Item::Septic`] that goes on as the last piece ended: see [`continued`] | line, length less the last piece's, as above but for q₁ … q₃ |
//! | 13 | [`Item::Septic`] that is the last one [`turned`] | line, length less the last piece's |
//! | 14 | a piece that starts elsewhere than the last one ended | how far from there; the piece |
//! | 15 | [`Item::Line`] to the end of the block | line, its end from its start but for one axis, that one's end less what the length lets expect; length less what is left of the block |
//!
//! **Whole numbers** are a count of nibbles, 15 for 16, and that many of the number, the low ones first; the
//! sign is the least significant bit. The program line is its difference to the last one.
//!
//! **Coefficients** are whole multiples of 2⁻¹⁶, 2⁻¹⁸ … 2⁻⁴⁴ by a nibble from 0 on, or by nibble 15 all 16 nibbles of an f64.
//!
//! **Lengths** of pieces are less what is left of the block where that is expected: of its first piece, and of one that would
//! otherwise be longer.
//!
//! **Figures** are a nibble: 0 for the expected one, 1 to 11 for one of the eleven that were written last, other
//! than as expected, the last one first, 12 to 14 for the upper 5, 7 or 11 nibbles of an f64, whose others are 0, 15 for all 16.
//!
//! What is expected is computed with IEEE basic operations and roots of `libm`, which are the same on every
//! target. The writer computes it, too, and where it is not the item's own, down to the bits, writes that.

mod read;
mod write;

#[cfg(test)]
mod tests;

pub use read::Decoder;
pub use write::Encoder;

use super::Item;
use crate::law::segment::to_f64;
use crate::law::{LimitedBy, PlannedRamp, Ramp};
use crate::num::rolled;
use crate::path::magnitude;
use crate::units::Position;

/// Kinds of items.
mod kind {
    pub(super) const LINE_TO: u8 = 0;
    pub(super) const LINE_ON: u8 = 1;
    pub(super) const LINE: u8 = 2;
    pub(super) const SEPTIC: u8 = 3;
    pub(super) const CRUISE: u8 = 4;
    pub(super) const RAMP: u8 = 5;
    pub(super) const END: u8 = 6;
    pub(super) const DWELL: u8 = 7;
    pub(super) const STOP: u8 = 8;
    pub(super) const SWITCH: u8 = 9;
    pub(super) const BLOCK: u8 = 10;
    pub(super) const BLOCK_ON: u8 = 11;
    pub(super) const SEPTIC_ON: u8 = 12;
    pub(super) const SEPTIC_TURNED: u8 = 13;
    pub(super) const ELSEWHERE: u8 = 14;
    pub(super) const LINE_OVER: u8 = 15;
}

/// What fixes the times of a ramp.
mod form {
    /// Acceleration: edge, t₁ and the acceleration.
    pub(super) const BY_ACCELERATION: u8 = 0;
    /// Jerk: edge and jerk.
    pub(super) const BY_JERK: u8 = 1;
    /// Snap: t₁.
    pub(super) const BY_SNAP: u8 = 2;
    /// All times; and the limit, from here on.
    pub(super) const TIMES: u8 = 3;
    /// All of a ramp's figures; and the limit, from here on.
    pub(super) const FIGURES: u8 = 6;
    /// Acceleration, with the figures of the last ramp by it.
    pub(super) const BY_ACCELERATION_AGAIN: u8 = 9;
    /// Jerk, with the figures of the last ramp by it.
    pub(super) const BY_JERK_AGAIN: u8 = 10;
}

/// Which figures of a block are others than expected.
#[cfg(feature = "live")]
mod other {
    /// The program's feed and the cap up to it: others than the last block's.
    pub(super) const FEED: u8 = 1;
    /// The limits up to that feed: others than the last block's.
    pub(super) const LIMITS: u8 = 2;
    /// The cap at any feed: another than up to the program's.
    pub(super) const GREATEST_CAP: u8 = 4;
    /// The limits at any feed: others than up to the program's.
    pub(super) const GREATEST_LIMITS: u8 = 8;
}

/// Nibbles of a figure that are written; the others are 0.
const LENGTHS: [u8; 4] = [5, 7, 11, 16];
/// The code of the first of them.
const FIRST_LENGTH: u8 = 12;
/// The count of nibbles that stands for all 16.
const WHOLE: u8 = 15;

/// Figures that were written or referred to of late, the last one first.
#[derive(Clone, Copy, Debug)]
struct Recent([f64; FIRST_LENGTH as usize - 1]);

impl Recent {
    const NONE: Self = Self([0.0; FIRST_LENGTH as usize - 1]);
    /// The place of a figure that is not there.
    const NEW: u8 = FIRST_LENGTH - 2;

    /// Puts `figure`, which is at `place`, before the others.
    fn put_first(&mut self, place: u8, figure: f64) {
        let mut next = figure;
        for figure in self.0.iter_mut().take(usize::from(place) + 1) {
            core::mem::swap(figure, &mut next);
        }
    }
}

/// What both ends know from the items before.
#[derive(Clone, Copy, Debug)]
struct State<const AXES: usize> {
    line: u32,
    /// Where the last piece ended.
    end: [Position; AXES],
    /// The last piece; a line's are its direction and zeros.
    coefficients: [[f64; 7]; AXES],
    /// Its length.
    length: Position,
    feed_mm_s: f64,
    /// Edge, t₁ and acceleration of the last ramp that acceleration fixes.
    by_acceleration: [f64; 3],
    /// Edge and jerk of the last ramp that jerk fixes.
    by_jerk: [f64; 2],
    #[cfg(feature = "live")]
    block: [f64; 10],
    /// What pieces leave of the last block, and whether that is all.
    #[cfg(feature = "live")]
    left: Position,
    #[cfg(feature = "live")]
    is_whole: bool,
    feeds: Recent,
    others: Recent,
}

impl<const AXES: usize> State<AXES> {
    const NEW: Self = Self {
        line: 0,
        end: [Position::ZERO; AXES],
        coefficients: [[0.0; 7]; AXES],
        length: Position::ZERO,
        feed_mm_s: 0.0,
        by_acceleration: [0.0; 3],
        by_jerk: [0.0; 2],
        #[cfg(feature = "live")]
        block: [0.0; 10],
        #[cfg(feature = "live")]
        left: Position::ZERO,
        #[cfg(feature = "live")]
        is_whole: false,
        feeds: Recent::NONE,
        others: Recent::NONE,
    };

    /// What is left of the block; 0 without one.
    fn left(&self) -> Position {
        #[cfg(feature = "live")]
        return self.left;
        #[cfg(not(feature = "live"))]
        Position::ZERO
    }

    /// The expected length of a septic: like the last one's, but all of a block that has not begun and at most what is
    /// left of it.
    fn expected_length(&self) -> Position {
        #[cfg(feature = "live")]
        if self.left > Position::ZERO && (self.is_whole || self.left < self.length) {
            return self.left;
        }
        self.length
    }

    /// Goes on behind a piece.
    fn follow(
        &mut self,
        line: u32,
        length: Position,
        coefficients: &[[f64; 7]; AXES],
        end: [Position; AXES],
    ) {
        (self.line, self.length, self.coefficients, self.end) = (line, length, *coefficients, end);
        #[cfg(feature = "live")]
        {
            // Without blocks as in a kernel without live control: nothing is ever left.
            if self.left > Position::ZERO {
                self.left = self.left - length;
            }
            self.is_whole = false;
        }
    }
}

/// The direction of a line from its start to `offset` from there, and its length \[mm\]: the line that takes the
/// fewest bytes. Not finite where there is no offset.
#[must_use]
#[inline(never)]
pub fn direction<const AXES: usize>(offset: [Position; AXES]) -> ([f64; AXES], f64) {
    let mut direction = [0.0; AXES];
    let (places, offsets) = rolled((direction.as_mut_slice(), offset.as_slice()));
    for (part, offset) in places.iter_mut().zip(offsets) {
        *part = offset.to_mm();
    }
    let length_mm = magnitude(&direction);
    (unit(direction), length_mm)
}

/// How far a line of this length goes along one axis, of which `others` are the offsets along the others.
fn remaining(length: Position, others: &[Position]) -> Position {
    let length_mm = length.to_mm();
    let mut square = length_mm * length_mm;
    for other in rolled(others) {
        let other_mm = other.to_mm();
        square -= other_mm * other_mm;
    }
    Position::from_mm(libm::sqrt(square)).unwrap_or_default()
}

/// Where a line ends, to a few position steps.
#[must_use]
#[inline(never)]
pub fn line_end<const AXES: usize>(
    start: [Position; AXES],
    direction: &[f64; AXES],
    length: Position,
) -> [Position; AXES] {
    let mut end = start;
    let length_mm = length.to_mm();
    let (places, parts) = rolled((end.as_mut_slice(), direction.as_slice()));
    for (end, part) in places.iter_mut().zip(parts) {
        *end = *end + Position::from_mm(part * length_mm).unwrap_or_default();
    }
    end
}

/// Where a septic ends, to a few position steps.
fn septic_end<const AXES: usize>(
    start: [Position; AXES],
    coefficients: &[[f64; 7]; AXES],
    length: Position,
) -> [Position; AXES] {
    let mut sums = [0.0; AXES];
    let (places, axes) = rolled((sums.as_mut_slice(), coefficients.as_slice()));
    for (sum, coefficients) in places.iter_mut().zip(axes) {
        for coefficient in rolled(coefficients.as_slice()) {
            *sum += *rolled(coefficient);
        }
    }
    line_end(start, &sums, length)
}

/// Where a piece ends, its coefficients and its length: what the next piece may be expected from. A line's coefficients
/// are its direction and zeros. `None` of other items.
#[must_use]
pub fn piece<const AXES: usize>(item: &Item<AXES>) -> Option<([Position; AXES], [[f64; 7]; AXES], Position)> {
    match item {
        Item::Line { start, direction, length, .. } => {
            Some((line_end(*start, direction, *length), as_septic(direction), *length))
        }
        Item::Septic { start, coefficients, length, .. } => {
            Some((septic_end(*start, coefficients, *length), *coefficients, *length))
        }
        _ => None,
    }
}

fn as_septic<const AXES: usize>(direction: &[f64; AXES]) -> [[f64; 7]; AXES] {
    direction.map(|part| [part, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// q₁ … q₃ of a piece of `length` that goes on with the tangent, curvature and its change with which a piece ends.
#[must_use]
#[inline(never)]
pub fn continued<const AXES: usize>(
    coefficients: &[[f64; 7]; AXES],
    length_before: Position,
    length: Position,
) -> [[f64; 3]; AXES] {
    let ratio = length.to_mm() / length_before.to_mm();
    let mut at_end = [[0.0; 3]; AXES];
    let (places, axes) = rolled((at_end.as_mut_slice(), coefficients.as_slice()));
    for (at_end, coefficients) in places.iter_mut().zip(axes) {
        let at_end = rolled(at_end);
        // Binomial coefficients: derivatives of powers at 1, by their factorials.
        let [mut once, mut twice, mut thrice] = [1.0, 0.0, 0.0];
        let [first, second, third] = at_end;
        for coefficient in rolled(coefficients.as_slice()) {
            let coefficient = *rolled(coefficient);
            *first += once * coefficient;
            *second += twice * coefficient;
            *third += thrice * coefficient;
            thrice += twice;
            twice += once;
            once += 1.0;
        }
        *second *= ratio;
        *third = *third * ratio * ratio;
    }
    at_end
}

/// A piece of a circle or helix turned so that it goes on where it ended.
#[must_use]
#[inline(never)]
pub fn turned<const AXES: usize>(coefficients: &[[f64; 7]; AXES]) -> [[f64; 7]; AXES] {
    let one = Position::from_bits(1);
    let end = continued(coefficients, one, one);
    // Across the circle where the piece starts, and the part along it of what is across where it ends: a sharper plane than
    // that of the third derivative.
    let across = unit(column(coefficients, 1));
    let across_end = end.map(|[_, second, _]| second);
    let mut along = across_end;
    add(&mut along, -dot(&across_end, &across), &across);
    let along = unit(along);
    let parts = |vector: &[f64; AXES]| (dot(vector, &along), dot(vector, &across));
    let (a, b) = parts(&column(coefficients, 0));
    let (a_end, b_end) = parts(&end.map(|[first, ..]| first));
    let squares = libm::sqrt((a * a + b * b) * (a_end * a_end + b_end * b_end));
    let (less, sine) = ((a * a_end + b * b_end) / squares - 1.0, (a * b_end - b * a_end) / squares);
    let mut turned = *coefficients;
    for power in rolled(0..7) {
        let mut vector = column(coefficients, power);
        let (a, b) = parts(&vector);
        add(&mut vector, less * a - sine * b, &along);
        add(&mut vector, less * b + sine * a, &across);
        for (turned, part) in turned.iter_mut().zip(vector) {
            if let Some(place) = turned.get_mut(power) {
                *place = part;
            }
        }
    }
    turned
}

/// The coefficients of a power, from 0 for the first.
fn column<const AXES: usize>(coefficients: &[[f64; 7]; AXES], power: usize) -> [f64; AXES] {
    coefficients.map(|of_axis| of_axis.get(power).copied().unwrap_or_default())
}

/// Adds `part` of another vector.
#[inline(never)]
fn add<const AXES: usize>(vector: &mut [f64; AXES], part: f64, other: &[f64; AXES]) {
    let (places, other) = rolled((vector.as_mut_slice(), other.as_slice()));
    for (place, other) in places.iter_mut().zip(other) {
        *place += part * *rolled(other);
    }
}

#[inline(never)]
fn dot<const AXES: usize>(a: &[f64; AXES], b: &[f64; AXES]) -> f64 {
    let mut sum = 0.0;
    let (a, b) = rolled((a.as_slice(), b.as_slice()));
    for (a, b) in a.iter().zip(b) {
        sum += *rolled(a) * b;
    }
    sum
}

#[inline(never)]
fn unit<const AXES: usize>(mut vector: [f64; AXES]) -> [f64; AXES] {
    let magnitude = magnitude(&vector);
    for part in rolled(vector.as_mut_slice()) {
        *rolled(part) /= magnitude;
    }
    vector
}

/// 2 to the power of `exponent`, from −1022 to 1023.
fn power_of_2(exponent: i32) -> f64 {
    f64::from_bits((1023 + i64::from(exponent)).cast_unsigned() << 52)
}

/// The scale of coefficients that are whole numbers: 2⁻¹⁶ and less by a factor of four each.
fn grid(code: u8) -> i32 {
    16 + 2 * i32::from(code)
}

/// A ramp with the peak jerk that its feeds and times make.
fn with_peak_jerk(ramp: Ramp<f64>) -> Ramp<f64> {
    to_f64(&Ramp { peak_jerk_mm_s3: 0.0, ..ramp })
}

/// The length that a ramp has of itself.
fn own_length(ramp: &Ramp<f64>) -> Position {
    Position::from_mm(ramp.length_mm()).unwrap_or_default()
}

/// A cruise from `feed_mm_s` over `length`.
fn cruise(feed_mm_s: f64, length: Position) -> PlannedRamp {
    PlannedRamp { ramp: Ramp::cruise(feed_mm_s, length.to_mm() / feed_mm_s), length }
}

/// A ramp between two feeds whose times the law's figures fix: by acceleration with edge, t₁ and acceleration, by jerk with
/// edge and jerk, by snap with t₁.
fn by_law(
    limited_by: LimitedBy,
    from_mm_s: f64,
    to_mm_s: f64,
    edge_s: f64,
    t1_s: f64,
    limit: f64,
) -> Ramp<f64> {
    let change_mm_s = libm::fabs(to_mm_s - from_mm_s);
    let mut ramp = Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3: limit, edge_s, t1_s, t2_s: t1_s, limited_by };
    match limited_by {
        LimitedBy::Acceleration => {
            let t2_s = change_mm_s / limit;
            if t2_s > t1_s {
                ramp.t2_s = t2_s;
            }
        }
        LimitedBy::Jerk => {
            ramp.t1_s = ramp.rise_for_s(change_mm_s);
            ramp.t2_s = ramp.t1_s;
        }
        LimitedBy::Snap => ramp.edge_s = 0.5 * t1_s,
    }
    with_peak_jerk(ramp)
}
