//! Coordinate systems, G10, G28, G30, G52 and G92: where the program's zero is.
//!
//! Parameters hold the offsets \[mm\], as in LinuxCNC: 5161 and 5181 on the places of G28 and G30, 5211 on those
//! of G92, 5221 + 20 n on those of the coordinate systems, with their rotation \[°\] nine places further.

use super::axis::{AXES_MAX, Axis, ORIGIN, Point};
use super::block::{Block, GGroup};
use super::decimal::Length;
use super::error::{Located, Problem};
use super::frame::{Frame, lengths};
use super::interpreter::Interpreter;
use super::lexer::Word;
use super::parameters::SELECTED;
use super::program::Feed;

/// The places of G28 and G30.
const PLACES: [u32; 2] = [5161, 5181];
/// Whether G92 is in force, and its offsets.
const SHIFT_APPLIES: u32 = 5210;
const SHIFT: u32 = 5211;

/// The first offset of a coordinate system, 1 to 9.
fn origin_of(system: u32) -> u32 {
    5201 + 20 * system
}

/// The rotation of a coordinate system.
fn rotation_of(system: u32) -> u32 {
    5210 + 20 * system
}

impl Interpreter {
    /// The offsets that the parameter file left.
    pub(super) fn start_frame(&mut self) {
        // The file's lengths were checked when it was read.
        if self.parameters.get(SHIFT_APPLIES) != 0.0 {
            self.frame.shift = self.stored(SHIFT, 0).unwrap_or_default();
        }
        self.system = self.parameters.get(SELECTED).clamp(1.0, 9.0) as u32;
        if let Ok(frame) = self.frame_in(self.system(), 0) {
            self.frame = frame;
        }
        self.work = self.frame.work(self.machine).unwrap_or_default();
    }

    /// The coordinate system in force, 1 to 9.
    pub(super) fn system(&self) -> u32 {
        self.system
    }

    /// The coordinates from parameter `first` on.
    fn stored(&self, first: u32, offset: usize) -> Result<Point, Located> {
        let mut stored = ORIGIN;
        for (length, number) in stored.iter_mut().zip(first..) {
            let mm = self.parameters.get(number);
            *length =
                Length::nearest(mm).ok_or(Located::new(offset, Problem::OffsetOutOfRange { number, mm }))?;
        }
        Ok(stored)
    }

    fn store(&mut self, first: u32, values: Point) {
        for (value, number) in values.into_iter().zip(first..) {
            self.parameters.set(number, value.to_mm());
        }
    }

    /// The frame as it is in another coordinate system.
    fn frame_in(&self, system: u32, offset: usize) -> Result<Frame, Located> {
        let origin = self.stored(origin_of(system), offset)?;
        Ok(Frame { origin, rotation_deg: self.parameters.get(rotation_of(system)), ..self.frame })
    }

    /// Selects a coordinate system.
    pub(super) fn select(&mut self, system: u32, offset: usize) -> Result<(), Located> {
        self.system = system;
        self.parameters.set(SELECTED, f64::from(system));
        self.frame = self.frame_in(system, offset)?;
        self.update_work(offset)
    }

    /// Offsets changed; the machine is where it was.
    pub(super) fn update_work(&mut self, offset: usize) -> Result<(), Located> {
        self.work = self.frame.work(self.machine).ok_or(Located::new(offset, Problem::WorkOutOfRange))?;
        Ok(())
    }

    /// Tool length, coordinate system, and the words that take axis words for something else than a move.
    pub(super) fn offsets(&mut self, block: &Block<'_>) -> Result<(), Located> {
        self.tool_length(block)?;
        if let Some(code) = block.g(GGroup::CoordinateSystem) {
            let system = match code.tenths {
                540..=590 => (code.tenths - 530) / 10,
                tenths => tenths - 584,
            };
            // Selecting the system in force changes nothing, even if its parameters, or their 5220, were assigned.
            let system = u32::try_from(system).unwrap_or(1);
            if system != self.system() {
                self.select(system, code.word.offset)?;
            }
        }
        if let Some(code) = block.g(GGroup::NonModal) {
            match code.tenths {
                100 => self.set_up(block, code.word)?,
                280 | 300 => self.go_to_place(block, PLACES[usize::from(code.tenths == 300)], code.word)?,
                281 | 301 => self.store(PLACES[usize::from(code.tenths == 301)], self.machine),
                520 | 920 => self.shift(block, code.tenths == 520, code.word)?,
                _ => {}
            }
        }
        let Some(code) = block.g(GGroup::Shift) else { return Ok(()) };
        self.frame.shift = if code.tenths == 923 { self.stored(SHIFT, code.word.offset)? } else { ORIGIN };
        self.parameters.set(SHIFT_APPLIES, f64::from(u8::from(code.tenths == 923)));
        if code.tenths == 921 {
            self.store(SHIFT, ORIGIN);
        }
        self.update_work(code.word.offset)
    }

    /// G52: the offset itself. G92: what the position is to be called.
    fn shift(&mut self, block: &Block<'_>, is_offset: bool, code: Word<'_>) -> Result<(), Located> {
        if !block.axes().iter().any(Option::is_some) {
            return Err(code.problem(|word| Problem::Setup { word, expected: "axis words" }));
        }
        for (axis, word) in block.axes().into_iter().enumerate() {
            let Some(word) = word else { continue };
            let length = self.modal.units.coordinate(word)?;
            let shift = if is_offset {
                Some(length)
            } else {
                Length::from_units(self.work[axis].units() + self.frame.shift[axis].units() - length.units())
            };
            self.frame.shift[axis] =
                shift.ok_or_else(|| word.problem(|word| Problem::PositionOutOfRange { word }))?;
        }
        self.parameters.set(SHIFT_APPLIES, 1.0);
        self.store(SHIFT, self.frame.shift);
        self.update_work(code.offset)
    }

    /// G28 and G30: by way of the end point of the line, to the place; along the axes given, or all.
    fn go_to_place(&mut self, block: &Block<'_>, place: u32, code: Word<'_>) -> Result<(), Located> {
        let place = self.stored(place, code.offset)?;
        let place = self.frame.work(place).ok_or(Located::new(code.offset, Problem::WorkOutOfRange))?;
        let way = self.end_point(block)?;
        let axes = block.axes();
        let all = axes.iter().all(Option::is_none);
        let mut end = way;
        for axis in self.program.axes.iter().map(Axis::index) {
            if all || axes[axis].is_some() {
                end[axis] = place[axis];
            }
        }
        self.rapid(way, code)?;
        self.rapid(end, code)
    }

    fn rapid(&mut self, work: Point, code: Word<'_>) -> Result<(), Located> {
        self.straight(work.map(Length::units), Feed::Rapid, self.modal.path, code)
    }

    /// G10.
    fn set_up(&mut self, block: &Block<'_>, code: Word<'_>) -> Result<(), Located> {
        let needs = |expected| code.problem(|word| Problem::Setup { word, expected });
        let l = block.letter(b'L').ok_or_else(|| needs("L1, L2, L10, L11 or L20"))?;
        let p = block.letter(b'P').ok_or_else(|| needs("a P word"))?;
        match l.number.whole() {
            Some(2 | 20) => {
                let system = p.count(0, "a coordinate system from 0 to 9")?;
                if system > 9 {
                    let expected = "a coordinate system from 0 to 9";
                    return Err(p.problem(|word| Problem::NotThisCount { word, expected }));
                }
                let system = if system == 0 { self.system() } else { system };
                self.set_system(block, system, l.number.whole() == Some(20), code)
            }
            Some(kind @ (1 | 10 | 11)) => {
                let number = p.count(1, "a whole tool number, 1 or more")?;
                self.set_tool(block, number, kind, code)
            }
            _ => Err(l.problem(|word| Problem::NotThisCount { word, expected: "L1, L2, L10, L11 or L20" })),
        }
    }

    /// G10 L2 and L20.
    fn set_system(
        &mut self,
        block: &Block<'_>,
        system: u32,
        from_position: bool,
        code: Word<'_>,
    ) -> Result<(), Located> {
        if let Some(word) = block.letter(b'I').or(block.letter(b'J')).or(block.letter(b'Q')) {
            return Err(word.problem(|word| Problem::Setup { word, expected: "axis words and R" }));
        }
        if let Some(word) = block.letter(b'R') {
            if from_position {
                return Err(
                    word.problem(|word| Problem::Setup { word, expected: "axis words only in G10 L20" })
                );
            }
            self.parameters.set(rotation_of(system), word.number.to_f64());
        }
        let frame = self.frame_in(system, code.offset)?;
        let beyond = || code.problem(|word| Problem::PositionOutOfRange { word });
        let mut origin = frame.origin;
        if from_position {
            let here = frame.work(self.machine).ok_or_else(beyond)?;
            let mut back = [0; AXES_MAX];
            for (axis, word) in block.axes().into_iter().enumerate() {
                let Some(word) = word else { continue };
                back[axis] = here[axis].units() - self.modal.units.coordinate(word)?.units();
            }
            let back = frame.turned(back);
            origin =
                lengths(core::array::from_fn(|axis| origin[axis].units() + back[axis])).ok_or_else(beyond)?;
        } else {
            for (length, word) in origin.iter_mut().zip(block.axes()) {
                if let Some(word) = word {
                    *length = self.modal.units.coordinate(word)?;
                }
            }
        }
        self.store(origin_of(system), origin);
        if system == self.system() { self.select(system, code.offset) } else { Ok(()) }
    }

    /// G10 L1: a tool's offset. L10: such that the position becomes what is given, here; L11: in G59.3, without
    /// G92. For this program; the table's file stays.
    fn set_tool(&mut self, block: &Block<'_>, number: u32, kind: i64, code: Word<'_>) -> Result<(), Located> {
        let p = block.letter(b'P').map_or(code.offset, |word| word.offset);
        let mut tool = self.tool(number, p)?;
        let beyond = || code.problem(|word| Problem::PositionOutOfRange { word });
        let axes = block.axes();
        let others = [b'R', b'I', b'J', b'Q'].map(|letter| block.letter(letter));
        if axes.iter().chain(&others).all(Option::is_none) {
            return Err(code.problem(|word| Problem::Setup { word, expected: "axis words, R, I, J or Q" }));
        }
        let mut given = [None; AXES_MAX];
        for (length, word) in given.iter_mut().zip(axes) {
            *length = word.map(|word| self.modal.units.coordinate(word)).transpose()?;
        }
        if kind == 1 {
            for (offset, length) in tool.offset.iter_mut().zip(given) {
                *offset = length.unwrap_or(*offset);
            }
        } else {
            let mut frame = self.frame_in(if kind == 11 { 9 } else { self.system() }, code.offset)?;
            frame.tool = ORIGIN;
            if kind == 11 {
                frame.shift = ORIGIN;
            }
            let here = frame.work(self.machine).ok_or_else(beyond)?;
            let mut offset = frame.turned_back(tool.offset.map(Length::units));
            for (axis, length) in given.into_iter().enumerate() {
                if let Some(length) = length {
                    offset[axis] = here[axis].units() - length.units();
                }
            }
            tool.offset = lengths(frame.turned(offset)).ok_or_else(beyond)?;
        }
        let [r, i, j, q] = others;
        if let Some(word) = r {
            let radius = self.modal.units.length(word)?;
            tool.diameter = radius.checked_add(radius).ok_or_else(beyond)?;
        }
        for (angle_deg, word) in tool.angles_deg.iter_mut().zip([i, j]) {
            *angle_deg = word.map_or(*angle_deg, |word| word.number.to_f64());
        }
        if let Some(word) = q {
            tool.orientation = word.count(0, "a whole orientation from 0 to 9")?;
        }
        *self.tools.table.entry(number) = tool;
        Ok(())
    }
}
