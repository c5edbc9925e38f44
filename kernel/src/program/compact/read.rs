//! Items out of few bytes.
//!
//! Like [`wire`](crate::program::wire), it does not return at every nibble that is missing or wrong: that is noted, and
//! makes the whole item `None` at its end.

use super::{
    FIRST_LENGTH, LENGTHS, Recent, State, WHOLE, as_septic, by_law, continued, cruise, direction, form, grid,
    kind, line_end, own_length, power_of_2, septic_end, turned, with_peak_jerk,
};
#[cfg(feature = "live")]
use super::{other, remaining};
use crate::hal::{OutputState, Spindle};
use crate::law::{LimitedBy, PlannedRamp, Ramp, Ticks};
use crate::program::Item;
#[cfg(feature = "live")]
use crate::program::PathBlock;
use crate::units::Position;

/// Reads items that an [`Encoder`](super::Encoder) wrote, from its first on.
#[derive(Clone, Copy, Debug)]
pub struct Decoder<const AXES: usize> {
    state: State<AXES>,
}

impl<const AXES: usize> Default for Decoder<AXES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const AXES: usize> Decoder<AXES> {
    /// For the first item.
    #[must_use]
    pub const fn new() -> Self {
        Self { state: State::NEW }
    }

    /// The item at the start of `bytes`, and the bytes after it; `None` if there is none. After that it is of
    /// no more use.
    pub fn take<'a>(&mut self, bytes: &'a [u8]) -> Option<(Item<AXES>, &'a [u8])> {
        let mut nibbles = Nibbles { left: bytes, is_half: false, is_sound: true };
        let item = self.item(&mut nibbles);
        if nibbles.is_half && nibbles.nibble() != 0 {
            nibbles.is_sound = false;
        }
        nibbles.is_sound.then_some((item, nibbles.left))
    }

    fn item(&mut self, nibbles: &mut Nibbles<'_>) -> Item<AXES> {
        let state = &mut self.state;
        let mut what = nibbles.nibble();
        let mut start = state.end;
        if what == kind::ELSEWHERE {
            nibbles.move_by(&mut start);
            what = nibbles.nibble();
            nibbles.is_sound &= what != kind::ELSEWHERE;
        }
        match what {
            kind::LINE_TO | kind::LINE_ON | kind::LINE => state.line(nibbles, what, start),
            // Without live control there are no blocks.
            #[cfg(feature = "live")]
            kind::LINE_OVER => state.line(nibbles, what, start),
            kind::SEPTIC | kind::SEPTIC_ON | kind::SEPTIC_TURNED => state.septic(nibbles, what, start),
            kind::CRUISE => Item::Feed(cruise(state.feed_mm_s, Position::from_bits(nibbles.number()))),
            kind::RAMP => Item::Feed(state.ramp(nibbles)),
            kind::END => {
                nibbles.move_by(&mut state.end);
                Item::EndOfStretch(state.end)
            }
            kind::DWELL => Item::Dwell(Ticks::from_bits(nibbles.number().cast_unsigned())),
            kind::STOP => Item::Stop,
            kind::SWITCH => {
                let how = nibbles.nibble();
                let spindle = match how & 3 {
                    0 => Spindle::Off,
                    1 => Spindle::Clockwise,
                    2 => Spindle::Counterclockwise,
                    _ => nibbles.unsound(Spindle::Off),
                };
                let speed_rpm = nibbles.figure(&mut state.others, 0.0);
                Item::Switch(OutputState { spindle, speed_rpm, flood: how & 4 != 0, mist: how & 8 != 0 })
            }
            #[cfg(feature = "live")]
            kind::BLOCK | kind::BLOCK_ON => Item::Block(state.block(nibbles, what)),
            _ => nibbles.unsound(Item::Stop),
        }
    }
}

impl<const AXES: usize> State<AXES> {
    fn line_number(&mut self, nibbles: &mut Nibbles<'_>) -> u32 {
        #[allow(clippy::cast_possible_truncation)]
        self.line.wrapping_add(nibbles.number() as u32)
    }

    #[inline(never)]
    fn line(&mut self, nibbles: &mut Nibbles<'_>, what: u8, start: [Position; AXES]) -> Item<AXES> {
        let line = self.line_number(nibbles);
        let mut along = self.coefficients.map(|[q1, ..]| q1);
        let (mut expected, mut offset) = (self.length, [Position::ZERO; AXES]);
        match what {
            kind::LINE_TO => {
                nibbles.move_by(&mut offset);
                let (towards, length_mm) = direction(offset);
                along = towards;
                expected = Position::from_mm(length_mm).unwrap_or_default();
            }
            #[cfg(feature = "live")]
            kind::LINE_OVER => {
                expected = self.left();
                nibbles.move_over(expected, &mut offset);
                (along, _) = direction(offset);
            }
            kind::LINE => {
                for part in &mut along {
                    *part = f64::from_bits(nibbles.bits(16));
                }
            }
            _ => {}
        }
        let length = expected + Position::from_bits(nibbles.number());
        let mut end = line_end(start, &along, length);
        if what == kind::LINE_TO || what == kind::LINE_OVER {
            for ((end, start), offset) in end.iter_mut().zip(start).zip(offset) {
                *end = start + offset;
            }
        }
        self.follow(line, length, &as_septic(&along), end);
        Item::Line { line, start, direction: along, length }
    }

    #[inline(never)]
    fn septic(&mut self, nibbles: &mut Nibbles<'_>, what: u8, start: [Position; AXES]) -> Item<AXES> {
        let line = self.line_number(nibbles);
        let length = self.expected_length() + Position::from_bits(nibbles.number());
        let mut coefficients = [[0.0; 7]; AXES];
        if what == kind::SEPTIC_TURNED {
            coefficients = turned(&self.coefficients);
        } else {
            let mut first = 0;
            if what == kind::SEPTIC_ON {
                first = 3;
                let known = continued(&self.coefficients, self.length, length);
                for ([a, b, c, ..], [first, second, third]) in coefficients.iter_mut().zip(known) {
                    (*a, *b, *c) = (first, second, third);
                }
            }
            nibbles.coefficients(first, coefficients.as_mut_slice());
        }
        self.follow(line, length, &coefficients, septic_end(start, &coefficients, length));
        Item::Septic { line, start, coefficients, length }
    }

    #[inline(never)]
    fn ramp(&mut self, nibbles: &mut Nibbles<'_>) -> PlannedRamp {
        let how = nibbles.nibble();
        let (feeds, others) = (&mut self.feeds, &mut self.others);
        let is_irregular = (form::FIGURES..form::BY_ACCELERATION_AGAIN).contains(&how);
        let from_mm_s = if is_irregular { nibbles.figure(feeds, self.feed_mm_s) } else { self.feed_mm_s };
        let to_mm_s = nibbles.figure(feeds, 0.0);
        self.feed_mm_s = to_mm_s;
        let limited_by = match how {
            form::BY_ACCELERATION | 3 | 6 | form::BY_ACCELERATION_AGAIN => LimitedBy::Acceleration,
            form::BY_JERK | 4 | 7 | form::BY_JERK_AGAIN => LimitedBy::Jerk,
            form::BY_SNAP | 5 | 8 => LimitedBy::Snap,
            _ => nibbles.unsound(LimitedBy::Snap),
        };
        let ramp = match how {
            form::BY_ACCELERATION | form::BY_ACCELERATION_AGAIN => {
                if how == form::BY_ACCELERATION {
                    for figure in &mut self.by_acceleration {
                        *figure = nibbles.figure(others, 0.0);
                    }
                }
                let [edge_s, t1_s, accel_mm_s2] = self.by_acceleration;
                by_law(limited_by, from_mm_s, to_mm_s, edge_s, t1_s, accel_mm_s2)
            }
            form::BY_JERK | form::BY_JERK_AGAIN => {
                if how == form::BY_JERK {
                    for figure in &mut self.by_jerk {
                        *figure = nibbles.figure(others, 0.0);
                    }
                }
                let [edge_s, jerk_mm_s3] = self.by_jerk;
                by_law(limited_by, from_mm_s, to_mm_s, edge_s, 0.0, jerk_mm_s3)
            }
            form::BY_SNAP => by_law(limited_by, from_mm_s, to_mm_s, 0.0, nibbles.figure(others, 0.0), 0.0),
            _ => {
                let t1_s = nibbles.figure(others, 0.0);
                let edge_s = nibbles.figure(others, 0.5 * t1_s);
                let t2_s = nibbles.figure(others, t1_s);
                let ramp = Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3: 0.0, edge_s, t1_s, t2_s, limited_by };
                if is_irregular {
                    Ramp { peak_jerk_mm_s3: nibbles.figure(others, 0.0), ..ramp }
                } else {
                    with_peak_jerk(ramp)
                }
            }
        };
        PlannedRamp { ramp, length: own_length(&ramp) + Position::from_bits(nibbles.number()) }
    }

    #[cfg(feature = "live")]
    #[inline(never)]
    fn block(&mut self, nibbles: &mut Nibbles<'_>, what: u8) -> PathBlock {
        let length = Position::from_bits(nibbles.number());
        let (feeds, others) = (&mut self.feeds, &mut self.others);
        if what == kind::BLOCK {
            let others_are = nibbles.nibble();
            let [feed, cap, limits @ .., _, _, _, _, _] = &mut self.block;
            if others_are & other::FEED != 0 {
                *feed = nibbles.figure(feeds, *feed);
                *cap = nibbles.figure(feeds, *cap);
            }
            if others_are & other::LIMITS != 0 {
                nibbles.limits(others, limits);
            }
            let (cap, limits) = (*cap, *limits);
            let [_, _, _, _, _, greatest_cap, greatest @ .., _] = &mut self.block;
            (*greatest_cap, *greatest) = (cap, limits);
            if others_are & other::GREATEST_CAP != 0 {
                *greatest_cap = nibbles.figure(feeds, cap);
            }
            if others_are & other::GREATEST_LIMITS != 0 {
                nibbles.limits(others, greatest);
            }
        }
        let [.., junction] = &mut self.block;
        *junction = nibbles.figure(feeds, *junction);
        (self.left, self.is_whole) = (length, true);
        PathBlock { length, figures: self.block }
    }
}

/// The nibbles not read yet.
struct Nibbles<'a> {
    left: &'a [u8],
    /// The low one of the first byte is read.
    is_half: bool,
    /// All so far were there and sound.
    is_sound: bool,
}

// Not inlined: each is in the image once.
impl Nibbles<'_> {
    fn unsound<T>(&mut self, instead: T) -> T {
        self.is_sound = false;
        instead
    }

    #[inline(never)]
    fn nibble(&mut self) -> u8 {
        let Some((&byte, left)) = self.left.split_first() else { return self.unsound(0) };
        self.is_half = !self.is_half;
        if self.is_half {
            byte & 15
        } else {
            self.left = left;
            byte >> 4
        }
    }

    /// The lowest `count` nibbles of a number, at most 16.
    #[inline(never)]
    fn bits(&mut self, count: u8) -> u64 {
        let mut bits = 0;
        for place in 0..u32::from(count) {
            bits |= u64::from(self.nibble()) << (4 * place);
        }
        bits
    }

    #[inline(never)]
    fn number(&mut self) -> i64 {
        let count = self.nibble();
        let bits = self.bits(if count == WHOLE { 16 } else { count });
        (bits >> 1).cast_signed() ^ -((bits & 1).cast_signed())
    }

    #[inline(never)]
    fn figure(&mut self, recent: &mut Recent, expected: f64) -> f64 {
        let code = self.nibble();
        let Some(length) = code.checked_sub(FIRST_LENGTH) else {
            return match code.checked_sub(1) {
                None => expected,
                Some(place) => {
                    let figure = recent.0.get(usize::from(place)).copied().unwrap_or_default();
                    recent.put_first(place, figure);
                    figure
                }
            };
        };
        let count = LENGTHS.get(usize::from(length)).copied().unwrap_or(16);
        let figure = f64::from_bits(self.bits(count) << (64 - 4 * u32::from(count)));
        recent.put_first(Recent::NEW, figure);
        figure
    }

    /// Limits, where others are expected.
    #[cfg(feature = "live")]
    fn limits(&mut self, others: &mut Recent, limits: &mut [f64; 3]) {
        for limit in limits {
            *limit = self.figure(others, *limit);
        }
    }

    /// How far a line of this length goes.
    #[cfg(feature = "live")]
    #[inline(never)]
    fn move_over(&mut self, length: Position, offset: &mut [Position]) {
        let axis = usize::from(self.nibble());
        for (_, offset) in offset.iter_mut().enumerate().filter(|&(index, _)| index != axis) {
            *offset = Position::from_bits(self.number());
        }
        let expected = remaining(length, offset);
        let less = self.number();
        let expected = if less & 1 == 0 { expected } else { -expected };
        match offset.get_mut(axis) {
            Some(place) => *place = expected + Position::from_bits(less >> 1),
            None => self.is_sound = false,
        }
    }

    #[inline(never)]
    fn move_by(&mut self, positions: &mut [Position]) {
        for position in positions {
            *position = *position + Position::from_bits(self.number());
        }
    }

    /// The coefficients of every axis from the one at `first` on.
    fn coefficients(&mut self, first: usize, axes: &mut [[f64; 7]]) {
        let code = self.nibble();
        let to_grid = power_of_2(32 - grid(code));
        for coefficients in axes {
            let end = usize::from(self.nibble());
            self.is_sound &= end <= 7;
            for coefficient in coefficients.iter_mut().take(end).skip(first) {
                *coefficient = if code == WHOLE {
                    f64::from_bits(self.bits(16))
                } else {
                    Position::from_bits(self.number()).to_mm() * to_grid
                };
            }
        }
    }
}
