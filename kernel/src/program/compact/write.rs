//! Items to few bytes: each in the shortest form that gives it back to the bit.

use super::{
    FIRST_LENGTH, LENGTHS, Recent, State, WHOLE, as_septic, by_law, continued, cruise, direction, form, grid,
    kind, line_end, own_length, power_of_2, septic_end, turned, with_peak_jerk,
};
use crate::hal::{OutputState, Spindle};
use crate::law::{LimitedBy, PlannedRamp, Ramp};
use crate::program::{Item, PathBlock};
use crate::units::Position;

/// How far from a line's length, in halves of a position step, its end is searched along its direction.
const HALF_STEPS: i32 = 4;
/// Digits of an f64 of which jerk and acceleration of a ramp are tried: the limits of a plan may have as few.
const DIGITS: [u32; 2] = [20, 32];

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
        let (what, expected) = match offset {
            _ if goes_on => (kind::LINE_ON, self.length),
            Some((_, expected)) => (kind::LINE_TO, expected),
            None => (kind::LINE, self.length),
        };
        nibbles.starts(&self.end, &start);
        nibbles.nibble(what);
        nibbles.number(i64::from(line.wrapping_sub(self.line).cast_signed()));
        self.end = line_end(start, &along, length);
        match offset {
            Some((offset, _)) if what == kind::LINE_TO => {
                nibbles.moved(&[Position::ZERO; AXES], &offset);
                for ((end, start), offset) in self.end.iter_mut().zip(start).zip(offset) {
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
        (self.line, self.coefficients, self.length) = (line, as_septic(&along), length);
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
        nibbles.number((length - self.length).to_bits());
        if what != kind::SEPTIC_TURNED {
            nibbles.coefficients(first, coefficients);
        }
        self.coefficients = *coefficients;
        (self.line, self.length) = (line, length);
        self.end = septic_end(start, coefficients, length);
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
            None if is(from_mm_s, ramp.from_mm_s) && same(&with_peak_jerk(ramp), &ramp) => form::TIMES + limit,
            None => form::FIGURES + limit,
        };
        nibbles.nibble(kind::RAMP);
        nibbles.nibble(how);
        if how >= form::FIGURES {
            nibbles.figure(&mut self.feeds, from_mm_s, ramp.from_mm_s);
        }
        nibbles.figure(&mut self.feeds, 0.0, ramp.to_mm_s);
        let others = &mut self.others;
        if how != form::BY_JERK {
            nibbles.figure(others, 0.0, ramp.t1_s);
        }
        if how != form::BY_SNAP {
            let t1_s = if how == form::BY_JERK { 0.0 } else { ramp.t1_s };
            nibbles.figure(others, 0.5 * t1_s, ramp.edge_s);
        }
        match by_law {
            Some(_) if how == form::BY_SNAP => {}
            Some(limit) => nibbles.figure(others, 0.0, limit),
            None => nibbles.figure(others, ramp.t1_s, ramp.t2_s),
        }
        if how >= form::FIGURES {
            nibbles.figure(others, 0.0, ramp.peak_jerk_mm_s3);
        }
        nibbles.number((length - own_length(&ramp)).to_bits());
    }

    /// The limit by which the law's figures give this ramp; of snap, any.
    fn law_limit(&self, ramp: &Ramp<f64>) -> Option<f64> {
        let &Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, limited_by, .. } = ramp;
        let makes = |&limit: &f64| {
            same(&by_law(limited_by, from_mm_s, to_mm_s, edge_s, t1_s, limit), ramp)
        };
        let near = match limited_by {
            LimitedBy::Acceleration => ramp.peak_accel_mm_s2(),
            LimitedBy::Jerk => peak_jerk_mm_s3,
            LimitedBy::Snap => return makes(&0.0).then_some(0.0),
        };
        let steps = DIGITS.iter().map(|digits| rounded(near, 52 - digits));
        steps.chain(self.others.figures).chain((-4..=4).map(|ulps| f64::from_bits(near.to_bits().wrapping_add_signed(ulps)))).find(makes)
    }

    #[cfg(feature = "live")]
    fn put_block(&mut self, nibbles: &mut Nibbles<'_>, block: &PathBlock) {
        let (feeds, others) = (&mut self.feeds, &mut self.others);
        let [held @ .., _] = block.figures;
        let [before @ .., junction] = self.block;
        let goes_on = held.iter().zip(before).all(|(&held, before)| is(before, held));
        nibbles.nibble(if goes_on { kind::BLOCK_ON } else { kind::BLOCK });
        nibbles.number(block.length.to_bits());
        let [feed_mm_s, programmed @ .., _, _, _, _, _] = block.figures;
        let [_, _, _, _, _, greatest @ .., junction_mm_s] = block.figures;
        if !goes_on {
            let [feed_before, before @ .., _, _, _, _, _] = self.block;
            nibbles.figure(feeds, feed_before, feed_mm_s);
            nibbles.allowed(feeds, others, &before, &programmed);
            nibbles.allowed(feeds, others, &programmed, &greatest);
        }
        nibbles.figure(feeds, junction, junction_mm_s);
        self.block = block.figures;
    }
}

/// Whether what is computed or remembered is the item's own figure. None that is not a number: its bits differ
/// from processor to processor.
fn is(expected: f64, figure: f64) -> bool {
    expected.to_bits() == figure.to_bits() && !figure.is_nan()
}

fn same(expected: &Ramp<f64>, ramp: &Ramp<f64>) -> bool {
    let figures =
        |ramp: &Ramp<f64>| [ramp.from_mm_s, ramp.to_mm_s, ramp.peak_jerk_mm_s3, ramp.edge_s, ramp.t1_s, ramp.t2_s];
    figures(expected).into_iter().zip(figures(ramp)).all(|(expected, figure)| is(expected, figure))
        && expected.limited_by == ramp.limited_by
}

/// The offset of a line's end from its start whose direction is this one, and its length.
fn offset_of<const AXES: usize>(
    along: &[f64; AXES],
    length: Position,
) -> Option<([Position; AXES], Position)> {
    (-HALF_STEPS..=HALF_STEPS).find_map(|half_steps| {
        let length_mm = length.to_mm() + f64::from(half_steps) * power_of_2(-33);
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
            *byte = if self.count % 2 == 0 { nibble } else { *byte | nibble << 4 };
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
        if let Some(place) = recent.figures.iter().position(|&recent| is(recent, figure)) {
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
        recent.push(figure);
    }

    #[cfg(feature = "live")]
    fn allowed(&mut self, feeds: &mut Recent, others: &mut Recent, expected: &[f64; 4], allowed: &[f64; 4]) {
        let ([expected_cap, expected @ ..], [cap, limits @ ..]) = (expected, allowed);
        self.figure(feeds, *expected_cap, *cap);
        for (&expected, &limit) in expected.iter().zip(limits) {
            self.figure(others, expected, limit);
        }
    }

    /// The coefficients of every axis from the one at `first` on, up to the last that is not 0.
    fn coefficients(&mut self, first: usize, axes: &[[f64; 7]]) {
        let written = || axes.iter().flat_map(|coefficients| coefficients.iter().skip(first));
        let code = (0..WHOLE).find(|&code| written().all(|&c| on_grid(c, grid(code)).is_some())).unwrap_or(WHOLE);
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
