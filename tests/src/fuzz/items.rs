//! A program out of bytes: stretches that can be driven, rests between them, and some items broken.

use arbitrary::{Result, Unstructured};
use motion_kernel::law::{Law, Limits, PlannedRamp, Pulse, Ramp, Ticks};
use motion_kernel::program::{Allowed, Item, PathBlock};
use motion_kernel::queue::PathRules;
use motion_kernel::units::Position;

/// The control tick \[s\].
pub(super) const TICK_S: f64 = 0.0005;
/// Limits along the path.
pub(super) const LIMITS: Limits<f64> = Limits { accel_mm_s2: 2000.0, jerk_mm_s3: 5e4, snap_mm_s4: 4e6 };
/// What the streams are held to.
pub(super) const RULES: PathRules =
    PathRules { limits: LIMITS, feed_mm_s: 300.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
/// Stretches and rests of a program at most.
const PHRASES_MAX: usize = 6;
/// Pieces of a stretch at most, and the longest \[mm\].
const PIECES_MAX: u64 = 12;
const PIECE_MM_MAX: f64 = 15.0;
/// The shortest curve \[mm\].
const CURVE_MM_MIN: f64 = 0.5;
/// The slowest and the fastest cruise \[mm/s\].
const FEED_MM_S: (f64, f64) = (0.5, 250.0);
/// The shortest and the longest stretch \[mm\].
const STRETCH_MM: (f64, f64) = (1e-6, 100.0);

/// A program.
pub(super) struct Program {
    pub(super) items: Vec<Item<2>>,
    /// Where its last stretch ends.
    pub(super) end: [Position; 2],
    /// As long as it takes, roughly \[ticks\].
    pub(super) ticks: f64,
    /// No item is broken.
    pub(super) is_whole: bool,
}

impl Program {
    /// What `input` says, with ramps of this law.
    pub(super) fn read(pulse: Pulse, input: &mut Unstructured<'_>) -> Result<Self> {
        let law = Law::new(pulse, LIMITS).expect("limits");
        let mut program = Self { items: Vec::new(), end: [Position::ZERO; 2], ticks: 0.0, is_whole: true };
        for line in 1..=input.int_in_range(1..=PHRASES_MAX)? {
            match input.int_in_range(0..=7)? {
                0 => program.dwell(input)?,
                1 => program.items.push(Item::Stop),
                _ => program.stretch(&law, input, line as u32)?,
            }
        }
        // Bytes that have come to their end say the least, which is "yes".
        while !input.is_empty() && input.ratio(1, 8)? && !program.items.is_empty() {
            let index = input.choose_index(program.items.len())?;
            program.items[index] = broken(input, program.items[index])?;
            program.is_whole = false;
        }
        Ok(program)
    }

    fn dwell(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        let bits = u64::from(input.arbitrary::<u16>()?) << 26 | 1;
        self.ticks += Ticks::from_bits(bits).to_f64();
        self.items.push(Item::Dwell(Ticks::from_bits(bits)));
        Ok(())
    }

    /// Straight from rest to rest, in pieces that are lines or the same as curves.
    fn stretch(&mut self, law: &Law<f64>, input: &mut Unstructured<'_>, line: u32) -> Result<()> {
        let angle_rad = f64::from(input.arbitrary::<u8>()?) * core::f64::consts::TAU / 256.0;
        let direction = [libm::cos(angle_rad), libm::sin(angle_rad)];
        let whole = length(scaled(input, STRETCH_MM)?);
        let cap_mm_s = scaled(input, FEED_MM_S)?;
        let feed = self.feed(law, whole, cap_mm_s);
        // Blocks, pieces and ramps come in the order of where they begin.
        let mut placed = Vec::new();
        let fewest = (whole.to_mm() / PIECE_MM_MAX).ceil() as u64;
        let pieces = parts(whole, fewest.max(input.int_in_range(1..=PIECES_MAX)?));
        // In fixed point a shorter curve is refused: what its rounded coefficients ask for grows with the feed over its length.
        let is_curve = input.arbitrary()? && pieces[0].1.to_mm() > CURVE_MM_MIN;
        for &(at, part) in &pieces {
            let start = self.ahead(direction, at);
            let piece = if is_curve {
                let coefficients = direction.map(|d| [d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
                Item::Septic { line, start, coefficients, length: part }
            } else {
                Item::Line { line, start, direction, length: part }
            };
            placed.push((at, 1, piece));
        }
        // A piece lies on one block.
        let allowed = Allowed { cap_mm_s: RULES.feed_mm_s, limits: LIMITS };
        for block in pieces.chunks(input.int_in_range(1..=pieces.len())?) {
            let start = block[0].0;
            let part = block.iter().fold(Position::ZERO, |sum, &(_, part)| sum + part);
            let junction_mm_s = if start + part == whole { 0.0 } else { RULES.feed_mm_s };
            placed.push((
                start,
                0,
                Item::Block(PathBlock::new(part, cap_mm_s, allowed, allowed, junction_mm_s)),
            ));
        }
        let mut start = Position::ZERO;
        for (ramp, length) in feed {
            placed.push((start, 2, Item::Feed(PlannedRamp { ramp, length })));
            start = start + length;
        }
        placed.sort_by_key(|&(start, kind, _)| (start, kind));
        self.items.extend(placed.into_iter().map(|(.., item)| item));
        self.end = self.ahead(direction, whole);
        self.items.push(Item::EndOfStretch(self.end));
        Ok(())
    }

    /// Up, along and down again.
    fn feed(&mut self, law: &Law<f64>, whole: Position, cap_mm_s: f64) -> Vec<(Ramp<f64>, Position)> {
        let mut top_mm_s = cap_mm_s;
        let mut up = Ramp::new(law, 0.0, top_mm_s);
        while 2.0 * up.length_mm() > whole.to_mm() {
            top_mm_s *= 0.75;
            up = Ramp::new(law, 0.0, top_mm_s);
        }
        let ramp = length(up.length_mm());
        let cruise = whole - ramp - ramp;
        self.ticks += (2.0 * up.duration_s() + cruise.to_mm() / top_mm_s) / TICK_S;
        let mut feed = vec![(up, ramp)];
        if cruise > Position::ZERO {
            feed.push((Ramp::cruise(top_mm_s, cruise.to_mm() / top_mm_s), cruise));
        }
        feed.push((up.reversed(), whole - ramp - cruise));
        feed
    }

    fn ahead(&self, direction: [f64; 2], at: Position) -> [Position; 2] {
        core::array::from_fn(|axis| self.end[axis] + length(direction[axis] * at.to_mm()))
    }
}

/// Where each of `count` parts begins, and how long it is; fewer where there are no more steps.
fn parts(whole: Position, count: u64) -> Vec<(Position, Position)> {
    let count = (count as i64).min(whole.to_bits()).max(1);
    let end = |part: i64| {
        Position::from_bits((i128::from(whole.to_bits()) * i128::from(part) / i128::from(count)) as i64)
    };
    (0..count).map(|part| (end(part), end(part + 1) - end(part))).collect()
}

fn length(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

/// From the first to the second, by orders of magnitude.
fn scaled(input: &mut Unstructured<'_>, (from, to): (f64, f64)) -> Result<f64> {
    Ok(from * libm::pow(to / from, f64::from(input.arbitrary::<u16>()?) / 65535.0))
}

/// The same kind of item with one of its figures as it happens to come.
fn broken(input: &mut Unstructured<'_>, item: Item<2>) -> Result<Item<2>> {
    let axis = input.choose_index(2)?;
    let value: f64 = input.arbitrary()?;
    let bits = Position::from_bits(input.arbitrary()?);
    let which = input.int_in_range(0..=5)?;
    Ok(match item {
        Item::Line { line, mut start, mut direction, mut length } => {
            match which {
                0 => start[axis] = bits,
                1 => direction[axis] = value,
                _ => length = bits,
            }
            Item::Line { line, start, direction, length }
        }
        Item::Septic { line, mut start, mut coefficients, mut length } => {
            match which {
                0 => start[axis] = bits,
                1 => length = bits,
                _ => coefficients[axis][input.choose_index(7)?] = value,
            }
            Item::Septic { line, start, coefficients, length }
        }
        Item::Feed(PlannedRamp { mut ramp, mut length }) => {
            match which {
                0 => ramp.from_mm_s = value,
                1 => ramp.to_mm_s = value,
                2 => ramp.peak_jerk_mm_s3 = value,
                3 => (ramp.t1_s, ramp.t2_s) = (value, input.arbitrary()?),
                4 => ramp.edge_s = value,
                _ => length = bits,
            }
            Item::Feed(PlannedRamp { ramp, length })
        }
        Item::EndOfStretch(mut end) => {
            end[axis] = bits;
            Item::EndOfStretch(end)
        }
        Item::Dwell(_) => Item::Dwell(Ticks::from_bits(input.arbitrary()?)),
        Item::Block(block) => {
            let mut allowed = block.greatest();
            match which {
                0 => allowed.cap_mm_s = value,
                1 => allowed.limits.accel_mm_s2 = value,
                2 => allowed.limits.jerk_mm_s3 = value,
                _ => allowed.limits.snap_mm_s4 = value,
            }
            let (length, junction_mm_s) =
                if axis == 0 { (bits, block.junction_mm_s()) } else { (block.length, value) };
            Item::Block(PathBlock::new(length, block.feed_mm_s(), block.programmed(), allowed, junction_mm_s))
        }
        Item::Stop | Item::Switch(_) => Item::EndOfStretch([bits; 2]),
    })
}
