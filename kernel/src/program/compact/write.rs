//! Items to few bytes: each in the shortest form that gives it back to the bit.

#[cfg(feature = "live")]
use super::other;
use super::{
    FIRST_LENGTH, LENGTHS, Recent, State, WHOLE, as_septic, by_law, continued, cruise, direction, form, grid,
    kind, line_end, own_length, power_of_2, remaining, septic_end, turned, with_peak_jerk,
};
use crate::hal::{OutputState, Spindle};
use crate::law::{LimitedBy, PlannedRamp, Ramp};
use crate::program::Item;
#[cfg(feature = "live")]
use crate::program::PathBlock;
use crate::units::Position;

/// Position steps by which a line may end elsewhere than its block.
const NEAR_STEPS: u64 = 16;
/// How far from a line's length, in halves of a position step, its end is searched along its direction.
const HALF_STEPS: i32 = 4;
/// Digits of an f64 of which jerk and acceleration of a ramp are tried: the limits of a plan may have as few.
const DIGITS: [u32; 2] = [16, 32];

/// Writes items for a [`Decoder`](super::Decoder), from its first on.
#[derive(Clone, Copy, Debug)]
pub struct Encoder<const AXES: usize> {
    state: State<AXES>,
}

impl<const AXES: usize> Default for Encoder<AXES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const AXES: usize> Encoder<AXES> {
    /// For the first item.
    #[must_use]
    pub const fn new() -> Self {
        Self { state: State::NEW }
    }

    /// Writes `item` to the start of `bytes` and returns how many it takes. `None`, and nothing has happened,
    /// if they do not suffice, or if it is a block and the kernel is one without live control.
    pub fn encode(&mut self, item: &Item<AXES>, bytes: &mut [u8]) -> Option<usize> {
        let mut state = self.state;
        let mut nibbles = Nibbles { bytes, count: 0 };
        match *item {
            Item::Line { line, start, direction, length } => {
                state.put_line(&mut nibbles, line, start, direction, length);
            }
            Item::Septic { line, start, coefficients, length } => {
                state.put_septic(&mut nibbles, line, start, &coefficients, length);
            }
            Item::Feed(planned) => state.put_feed(&mut nibbles, &planned),
            Item::EndOfStretch(end) => {
                nibbles.nibble(kind::END);
                nibbles.moved(&state.end, &end);
                state.end = end;
            }
            Item::Dwell(ticks) => {
                nibbles.nibble(kind::DWELL);
                nibbles.number(ticks.to_bits().cast_signed());
            }
            Item::Stop => nibbles.nibble(kind::STOP),
            Item::Switch(OutputState { spindle, speed_rpm, flood, mist }) => {
                let turning = match spindle {
                    Spindle::Off => 0,
                    Spindle::Clockwise => 1,
                    Spindle::Counterclockwise => 2,
                };
                nibbles.nibble(kind::SWITCH);
                nibbles.nibble(turning | u8::from(flood) << 2 | u8::from(mist) << 3);
                nibbles.figure(&mut state.others, 0.0, speed_rpm);
            }
            #[cfg(feature = "live")]
            Item::Block(block) => state.put_block(&mut nibbles, &block),
            #[cfg(not(feature = "live"))]
            Item::Block(_) => return None,
        }
        let length = nibbles.count.div_ceil(2);
        if length > nibbles.bytes.len() {
            return None;
        }
        self.state = state;
        Some(length)
    }
}

impl<const AXES: usize> State<AXES> {
    fn put_line(
        &mut self,
        nibbles: &mut Nibbles<'_>,
        line: u32,
        start: [Position; AXES],
        along: [f64; AXES],
        length: Position,
    ) {
        let offset = offset_of(&along, length);
        let goes_on = along.iter().zip(self.coefficients).all(|(&along, [before, ..])| is(before, along));
        let left = self.left();
        let is_to_end = left > Position::ZERO && (length - left).to_bits().unsigned_abs() <= NEAR_STEPS;
        let (what, expected) = match offset {
            _ if goes_on => (kind::LINE_ON, self.length),
            Some(_) if is_to_end => (kind::LINE_OVER, left),
            Some((_, expected)) => (kind::LINE_TO, expected),
            None => (kind::LINE, self.length),
        };
        nibbles.starts(&self.end, &start);
        nibbles.nibble(what);
        nibbles.number(i64::from(line.wrapping_sub(self.line).cast_signed()));
        let mut end = line_end(start, &along, length);
        match offset {
            Some((offset, _)) if what == kind::LINE_TO || what == kind::LINE_OVER => {
                if what == kind::LINE_TO {
                    nibbles.moved(&[Position::ZERO; AXES], &offset);
                } else {
                    nibbles.moved_over(left, offset);
                }
                for ((end, start), offset) in end.iter_mut().zip(start).zip(offset) {
                    *end = start + offset;
                }
            }
            _ if what == kind::LINE => {
                for part in along {
                    nibbles.bits(part.to_bits(), 16);
                }
            }
            _ => {}
        }
        nibbles.number((length - expected).to_bits());
        self.follow(line, length, &as_septic(&along), end);
    }

    fn put_septic(
        &mut self,
        nibbles: &mut Nibbles<'_>,
        line: u32,
        start: [Position; AXES],
        coefficients: &[[f64; 7]; AXES],
        length: Position,
    ) {
        let on = continued(&self.coefficients, self.length, length);
        let goes_on = coefficients.iter().zip(on).all(|(&[q1, q2, q3, ..], [first, second, third])| {
            is(first, q1) && is(second, q2) && is(third, q3)
        });
        let turned = turned(&self.coefficients);
        let is_turned = coefficients
            .as_flattened()
            .iter()
            .zip(turned.as_flattened())
            .all(|(&coefficient, &turned)| is(turned, coefficient));
        let (what, first) = match (is_turned, goes_on) {
            (true, _) => (kind::SEPTIC_TURNED, 7),
            (false, true) => (kind::SEPTIC_ON, 3),
            (false, false) => (kind::SEPTIC, 0),
        };
        nibbles.starts(&self.end, &start);
        nibbles.nibble(what);
        nibbles.number(i64::from(line.wrapping_sub(self.line).cast_signed()));
        nibbles.number((length - self.expected_length()).to_bits());
        if what != kind::SEPTIC_TURNED {
            nibbles.coefficients(first, coefficients);
        }
        self.follow(line, length, coefficients, septic_end(start, coefficients, length));
    }

    fn put_feed(&mut self, nibbles: &mut Nibbles<'_>, planned: &PlannedRamp) {
        let &PlannedRamp { ramp, length } = planned;
        let is_cruise = same(&cruise(self.feed_mm_s, length).ramp, &ramp);
        let from_mm_s = self.feed_mm_s;
        self.feed_mm_s = ramp.to_mm_s;
        if is_cruise {
            nibbles.nibble(kind::CRUISE);
            nibbles.number(length.to_bits());
            return;
        }
        let limit = match ramp.limited_by {
            LimitedBy::Acceleration => 0,
            LimitedBy::Jerk => 1,
            LimitedBy::Snap => 2,
        };
        let by_law = is(from_mm_s, ramp.from_mm_s).then(|| self.law_limit(&ramp)).flatten();
        let how = match by_law {
            Some(_) => limit,
            None if is(from_mm_s, ramp.from_mm_s) && same(&with_peak_jerk(ramp), &ramp) => {
                form::TIMES + limit
            }
            None => form::FIGURES + limit,
        };
        let (feeds, others) = (&mut self.feeds, &mut self.others);
        let again = |how: u8, again: u8, last: &[f64], figures: &[f64]| {
            let is_again = last.iter().zip(figures).all(|(&last, &figure)| is(last, figure));
            if is_again { again } else { how }
        };
        let &Ramp { edge_s, t1_s, t2_s, .. } = &ramp;
        let limit = by_law.unwrap_or_default();
        let (by_acceleration, by_jerk) = ([edge_s, t1_s, limit], [edge_s, limit]);
        let how = match how {
            form::BY_ACCELERATION => {
                again(how, form::BY_ACCELERATION_AGAIN, &self.by_acceleration, &by_acceleration)
            }
            form::BY_JERK => again(how, form::BY_JERK_AGAIN, &self.by_jerk, &by_jerk),
            _ => how,
        };
        nibbles.nibble(kind::RAMP);
        nibbles.nibble(how);
        let is_irregular = (form::FIGURES..form::BY_ACCELERATION_AGAIN).contains(&how);
        if is_irregular {
            nibbles.figure(feeds, from_mm_s, ramp.from_mm_s);
        }
        nibbles.figure(feeds, 0.0, ramp.to_mm_s);
        match how {
            form::BY_ACCELERATION_AGAIN | form::BY_JERK_AGAIN => {}
            form::BY_ACCELERATION => {
                by_acceleration.iter().for_each(|&figure| nibbles.figure(others, 0.0, figure));
                self.by_acceleration = by_acceleration;
            }
            form::BY_JERK => {
                by_jerk.iter().for_each(|&figure| nibbles.figure(others, 0.0, figure));
                self.by_jerk = by_jerk;
            }
            form::BY_SNAP => nibbles.figure(others, 0.0, t1_s),
            _ => {
                nibbles.figure(others, 0.0, t1_s);
                nibbles.figure(others, 0.5 * t1_s, edge_s);
                nibbles.figure(others, t1_s, t2_s);
                if is_irregular {
                    nibbles.figure(others, 0.0, ramp.peak_jerk_mm_s3);
                }
            }
        }
        nibbles.number((length - own_length(&ramp)).to_bits());
    }

    /// The limit by which the law's figures give this ramp; of snap, any.
    fn law_limit(&self, ramp: &Ramp<f64>) -> Option<f64> {
        let &Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, limited_by, .. } = ramp;
        let makes = |&limit: &f64| same(&by_law(limited_by, from_mm_s, to_mm_s, edge_s, t1_s, limit), ramp);
        let near = match limited_by {
            LimitedBy::Acceleration => ramp.peak_accel_mm_s2(),
            LimitedBy::Jerk => peak_jerk_mm_s3,
            LimitedBy::Snap => return makes(&0.0).then_some(0.0),
        };
        let steps = DIGITS.iter().map(|digits| rounded(near, 52 - digits));
        steps
            .chain(self.others.0)
            .chain((-4..=4).map(|ulps| f64::from_bits(near.to_bits().wrapping_add_signed(ulps))))
            .find(makes)
    }

    #[cfg(feature = "live")]
    fn put_block(&mut self, nibbles: &mut Nibbles<'_>, block: &PathBlock) {
        let (feeds, others) = (&mut self.feeds, &mut self.others);
        let [held @ .., _] = block.figures;
        let [before @ .., junction] = self.block;
        let goes_on = held.iter().zip(before).all(|(&held, before)| is(before, held));
        nibbles.nibble(if goes_on { kind::BLOCK_ON } else { kind::BLOCK });
        nibbles.number(block.length.to_bits());
        let [feed_mm_s, cap, limits @ .., greatest_cap, _, _, _, junction_mm_s] = block.figures;
        let [_, _, _, _, _, _, greatest @ .., _] = block.figures;
        if !goes_on {
            let [feed_before, cap_before, limits_before @ .., _, _, _, _, _] = self.block;
            let differ = |bit: u8, expected: &[f64], figures: &[f64]| {
                if expected.iter().zip(figures).all(|(&expected, &figure)| is(expected, figure)) {
                    0
                } else {
                    bit
                }
            };
            let others_are = differ(other::FEED, &[feed_before, cap_before], &[feed_mm_s, cap])
                | differ(other::LIMITS, &limits_before, &limits)
                | differ(other::GREATEST_CAP, &[cap], &[greatest_cap])
                | differ(other::GREATEST_LIMITS, &limits, &greatest);
            nibbles.nibble(others_are);
            if others_are & other::FEED != 0 {
                nibbles.figure(feeds, feed_before, feed_mm_s);
                nibbles.figure(feeds, cap_before, cap);
            }
            if others_are & other::LIMITS != 0 {
                nibbles.limits(others, &limits_before, &limits);
            }
            if others_are & other::GREATEST_CAP != 0 {
                nibbles.figure(feeds, cap, greatest_cap);
            }
            if others_are & other::GREATEST_LIMITS != 0 {
                nibbles.limits(others, &limits, &greatest);
            }
        }
        nibbles.figure(feeds, junction, junction_mm_s);
        self.block = block.figures;
        (self.left, self.is_whole) = (block.length, true);
    }
}

/// Whether what is computed or remembered is the item's own figure. None that is not a number: its bits differ
/// from processor to processor.
fn is(expected: f64, figure: f64) -> bool {
    expected.to_bits() == figure.to_bits() && !figure.is_nan()
}

fn same(expected: &Ramp<f64>, ramp: &Ramp<f64>) -> bool {
    let figures = |ramp: &Ramp<f64>| {
        [ramp.from_mm_s, ramp.to_mm_s, ramp.peak_jerk_mm_s3, ramp.edge_s, ramp.t1_s, ramp.t2_s]
    };
    figures(expected).into_iter().zip(figures(ramp)).all(|(expected, figure)| is(expected, figure))
        && expected.limited_by == ramp.limited_by
}

/// The offset of a line's end from its start whose direction is this one, and its length.
fn offset_of<const AXES: usize>(
    along: &[f64; AXES],
    length: Position,
) -> Option<([Position; AXES], Position)> {
    // The nearest first.
    (0..=2 * HALF_STEPS).find_map(|number| {
        let half_steps = f64::from((number + 1) / 2) * power_of_2(-33);
        let length_mm = length.to_mm() + if number % 2 == 0 { half_steps } else { -half_steps };
        let mut offset = [Position::ZERO; AXES];
        for (offset, part) in offset.iter_mut().zip(along) {
            *offset = Position::from_mm(part * length_mm)?;
        }
        let (towards, length_mm) = direction(offset);
        let is_same = towards.iter().zip(along).all(|(&towards, &along)| is(towards, along));
        is_same.then(|| (offset, Position::from_mm(length_mm).unwrap_or_default()))
    })
}

/// The number of steps of 2 to the power of minus `bits` in a coefficient, if that is a whole one.
fn on_grid(coefficient: f64, bits: i32) -> Option<i64> {
    let steps = Position::from_mm(coefficient * power_of_2(bits - 32))?;
    is(steps.to_mm() * power_of_2(32 - bits), coefficient).then_some(steps.to_bits())
}

/// `figure` without its lowest bits.
fn rounded(figure: f64, bits: u32) -> f64 {
    let half = 1_u64 << (bits - 1);
    f64::from_bits(figure.to_bits().wrapping_add(half) >> bits << bits)
}

/// The nibbles written, of which those that have no room are only counted.
struct Nibbles<'a> {
    bytes: &'a mut [u8],
    count: usize,
}

impl Nibbles<'_> {
    fn nibble(&mut self, nibble: u8) {
        if let Some(byte) = self.bytes.get_mut(self.count / 2) {
            *byte = if self.count.is_multiple_of(2) { nibble } else { *byte | nibble << 4 };
        }
        self.count += 1;
    }

    /// The lowest `count` nibbles of a number.
    fn bits(&mut self, bits: u64, count: u8) {
        for place in 0..count {
            self.nibble((bits >> (4 * u32::from(place))) as u8 & 15);
        }
    }

    fn number(&mut self, number: i64) {
        let bits = (number << 1 ^ number >> 63).cast_unsigned();
        let count = ((64 - bits.leading_zeros()).div_ceil(4)) as u8;
        self.nibble(count.min(WHOLE));
        self.bits(bits, if count < WHOLE { count } else { 16 });
    }

    fn figure(&mut self, recent: &mut Recent, expected: f64, figure: f64) {
        if is(expected, figure) {
            return self.nibble(0);
        }
        if let Some(place) = recent.0.iter().position(|&recent| is(recent, figure)) {
            recent.put_first(place as u8, figure);
            return self.nibble(place as u8 + 1);
        }
        let bits = figure.to_bits();
        let shift = |count: u8| 64 - 4 * u32::from(count);
        let lengths = (FIRST_LENGTH..).zip(LENGTHS);
        let (code, count) = lengths
            .clone()
            .find(|&(_, count)| bits.unbounded_shl(64 - shift(count)) == 0)
            .unwrap_or((FIRST_LENGTH + 3, 16));
        self.nibble(code);
        self.bits(bits >> shift(count), count);
        recent.put_first(Recent::NEW, figure);
    }

    #[cfg(feature = "live")]
    fn limits(&mut self, others: &mut Recent, expected: &[f64; 3], limits: &[f64; 3]) {
        for (&expected, &limit) in expected.iter().zip(limits) {
            self.figure(others, expected, limit);
        }
    }

    /// The offset of a line of this length: of its greatest part, what the others let expect is left out.
    fn moved_over<const AXES: usize>(&mut self, length: Position, mut offset: [Position; AXES]) {
        let greatest = offset.iter().enumerate().max_by_key(|(_, part)| part.to_bits().unsigned_abs());
        let axis = greatest.map_or(0, |(axis, _)| axis);
        self.nibble(axis as u8);
        let mut greatest = Position::ZERO;
        for (index, part) in offset.iter_mut().enumerate() {
            if index == axis {
                greatest = core::mem::take(part);
            } else {
                self.number(part.to_bits());
            }
        }
        let expected = remaining(length, &offset);
        let is_back = greatest < Position::ZERO;
        let less = greatest - if is_back { -expected } else { expected };
        self.number(less.to_bits() << 1 | i64::from(is_back));
    }

    /// The coefficients of every axis from the one at `first` on, up to the last that is not 0.
    fn coefficients(&mut self, first: usize, axes: &[[f64; 7]]) {
        let written = || axes.iter().flat_map(|coefficients| coefficients.iter().skip(first));
        let code =
            (0..WHOLE).find(|&code| written().all(|&c| on_grid(c, grid(code)).is_some())).unwrap_or(WHOLE);
        self.nibble(code);
        for coefficients in axes {
            let end = coefficients.iter().rposition(|&c| !is(0.0, c)).map_or(0, |last| last + 1);
            let end = if end > first { end } else { 0 };
            self.nibble(end as u8);
            for &coefficient in coefficients.iter().take(end).skip(first) {
                match on_grid(coefficient, grid(code)) {
                    Some(whole) if code < WHOLE => self.number(whole),
                    _ => self.bits(coefficient.to_bits(), 16),
                }
            }
        }
    }

    /// Positions, from others.
    fn moved(&mut self, from: &[Position], to: &[Position]) {
        for (&from, &to) in from.iter().zip(to) {
            self.number((to - from).to_bits());
        }
    }

    /// Where a piece starts, if that is not where it is expected.
    fn starts(&mut self, expected: &[Position], start: &[Position]) {
        if expected != start {
            self.nibble(kind::ELSEWHERE);
            self.moved(expected, start);
        }
    }
}
