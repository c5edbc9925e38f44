//! Spindle, coolant, tools, inputs and outputs: what a line asks of everything but the axes.
//!
//! Spindle and coolant become a step where they change, each change a step of its own, as LinuxCNC's calls come.

use super::axis::{Axis, ORIGIN, Point};
use super::block::{Block, GGroup, MGroup};
use super::cutter::compensated;
use super::decimal::Length;
use super::error::{Located, Problem};
use super::interpreter::Interpreter;
use super::modal::{Modal, Overrides};
use super::program::{NoticeKind, Outputs, SpindleSpeed, StepKind};
use super::tool::Tool;
use motion_kernel::hal::Spindle;

/// Greatest S: with the greatest F, the feed of G95 is finite.
const SPEED_MAX: f64 = 1e9;

impl Interpreter {
    /// S, T, and the M words that are no stops, in their order.
    pub(super) fn accessories(&mut self, block: &Block<'_>) -> Result<(), Located> {
        if let Some(code) = block.g(GGroup::SpindleMode) {
            let is_surface = code.tenths == 960;
            if is_surface && block.letter(b'S').is_none() {
                let expected = "S, the speed of the surface, in the same line";
                return Err(code.word.problem(|word| Problem::Setup { word, expected }));
            }
            self.modal.spindle.is_surface = is_surface;
            self.notice(NoticeKind::Spindle);
        }
        if let Some(word) = block.letter(b'S') {
            word.refuse_negative()?;
            if word.number.to_f64() > SPEED_MAX {
                let expected = "a speed of 1000000000 at most";
                return Err(word.problem(|word| Problem::NotThisCount { word, expected }));
            }
            self.modal.spindle.speed = word.number.to_f64();
            self.notice(NoticeKind::SpindleSpeed);
        }
        self.switch()?;
        if let Some(word) = block.letter(b'T') {
            let number = word.count(0, "a whole tool number, 0 or more")?;
            self.tool(number, word.offset)?;
            self.tools.selected = Some(number);
        }
        self.inputs_and_outputs(block)?;
        self.change_tool(block)?;
        if let Some(code) = block.m(MGroup::Spindle) {
            self.modal.spindle.clockwise = match code.tenths {
                30 => Some(true),
                40 => Some(false),
                _ => None,
            };
            self.notice(NoticeKind::Spindle);
            self.switch()?;
        }
        if let Some(code) = block.m(MGroup::Modes) {
            self.modes(code.tenths, code.word.offset)?;
        }
        self.coolant(block)?;
        self.overrides(block);
        Ok(())
    }

    /// Appends a step for the spindle's speed, its direction, the mist and the flood, each if it is to be another one than
    /// before. A spindle that is started has its speed at once.
    pub(super) fn switch(&mut self) -> Result<(), Located> {
        let spindle = &self.modal.spindle;
        let speed = match (spindle.clockwise, spindle.is_surface) {
            (None, _) => SpindleSpeed::default(),
            (Some(_), false) => SpindleSpeed::Rpm(spindle.speed),
            (Some(_), true) => SpindleSpeed::Surface(spindle.speed),
        };
        let spindle = match spindle.clockwise {
            None => Spindle::Off,
            Some(true) => Spindle::Clockwise,
            Some(false) => Spindle::Counterclockwise,
        };
        let Modal { mist, flood, .. } = self.modal;
        let stays = spindle != Spindle::Off && self.outputs.spindle != Spindle::Off;
        let with_speed = if stays { Outputs { speed, ..self.outputs } } else { self.outputs };
        let with_spindle = Outputs { spindle, speed, ..with_speed };
        let with_mist = Outputs { mist, ..with_spindle };
        for to in [with_speed, with_spindle, with_mist, Outputs { flood, ..with_mist }] {
            if to != self.outputs {
                self.outputs = to;
                // A curve goes on behind it.
                let cubic_before_mm = self.cubic_before_mm;
                self.step(StepKind::Switch(to))?;
                self.cubic_before_mm = cubic_before_mm;
            }
        }
        Ok(())
    }

    /// Stops the spindle.
    pub(super) fn stop_spindle(&mut self) -> Result<(), Located> {
        self.modal.spindle.clockwise = None;
        self.switch()
    }

    /// Switches all off.
    pub(super) fn all_off(&mut self) -> Result<(), Located> {
        (self.modal.mist, self.modal.flood) = (false, false);
        self.stop_spindle()
    }

    fn coolant(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let [mist, flood, off] =
            [MGroup::Mist, MGroup::Flood, MGroup::CoolantOff].map(|group| block.m(group).is_some());
        self.modal.mist = !off && (self.modal.mist || mist);
        self.modal.flood = !off && (self.modal.flood || flood);
        self.switch()?;
        if mist || flood || off {
            self.notice(NoticeKind::Coolant);
        }
        Ok(())
    }

    fn overrides(&mut self, block: &Block<'_>) {
        let Some(code) = block.m(MGroup::Override) else { return };
        let is_on = block.letter(b'P').is_none_or(|word| word.number.signum() != 0);
        let now = self.modal.overrides;
        self.modal.overrides = match code.tenths {
            480 => Overrides { feed: true, speed: true, ..now },
            490 => Overrides { feed: false, speed: false, ..now },
            500 => Overrides { feed: is_on, ..now },
            510 => Overrides { speed: is_on, ..now },
            520 => Overrides { adaptive_feed: is_on, ..now },
            _ => Overrides { feed_stop: is_on, ..now },
        };
        self.notice(NoticeKind::Override);
    }

    fn inputs_and_outputs(&mut self, block: &Block<'_>) -> Result<(), Located> {
        /// The result of M66.
        const INPUT: u32 = 5399;
        let Some(code) = block.m(MGroup::InputOutput) else { return Ok(()) };
        let [p, e] = [b'P', b'E'].map(|letter| block.letter(letter));
        let needs = |expected| code.word.problem(|word| Problem::Setup { word, expected });
        let channel = match code.tenths {
            620..=650 => p.ok_or_else(|| needs("the number of an output, a P word"))?,
            660 => match (p, e) {
                (Some(word), None) | (None, Some(word)) => word,
                _ => return Err(needs("the number of an input, a P or an E word")),
            },
            _ => e.ok_or_else(|| needs("the number of an output, an E word"))?,
        };
        channel.count(0, "a whole number, 0 or more")?;
        if code.tenths == 660 {
            let waits = match block.letter(b'L') {
                Some(word) => word.count(0, "a whole number from 0 to 4")? > 0,
                None => false,
            };
            if waits && (e.is_some() || block.letter(b'Q').is_none_or(|word| word.number.signum() <= 0)) {
                return Err(needs("L0, or a digital input (P) and a time to wait for it (Q)"));
            }
            // A wait for what never comes ends by its time.
            self.parameters.set(INPUT, if waits { -1.0 } else { 0.0 });
            self.notice(NoticeKind::Input);
        } else {
            self.notice(NoticeKind::Output);
        }
        Ok(())
    }

    /// M6 stops for the tool that T selected; M61 says which one there is.
    fn change_tool(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let Some(code) = block.m(MGroup::ToolChange) else { return Ok(()) };
        if self.cutter.is_some() {
            return Err(compensated(code.word));
        }
        if code.tenths == 610 {
            let Some(word) = block.letter(b'Q') else {
                let expected = "the number of the tool, a Q word";
                return Err(code.word.problem(|word| Problem::Setup { word, expected }));
            };
            let number = word.count(0, "a whole tool number, 0 or more")?;
            self.tool(number, word.offset)?;
            self.take_tool(number);
            return Ok(());
        }
        // The position is read anew: behind G40 the tool is beside the point that was programmed.
        if let Some(at) = self.tool_at.take() {
            self.machine = at;
            self.update_work(code.word.offset)?;
        }
        // Without a tool there is nothing to take: LinuxCNC refuses it, older programs of this reader have it.
        let Some(number) = self.tools.selected else {
            self.notice(NoticeKind::ToolChange);
            return Ok(());
        };
        self.stop_spindle()?;
        if number == self.tools.current {
            return Ok(());
        }
        if self.tools.calls_change {
            if let Some(word) = block.beside_tool_change() {
                return Err(word.problem(|word| Problem::BesideToolChange { word }));
            }
            self.tools.change_to = Some(number);
            return Ok(());
        }
        self.take_tool(number);
        let tool = self.tool(number, code.word.offset)?;
        let text = match (number, tool.remark.as_str()) {
            (0, _) => "take the tool out".to_owned(),
            (_, "") => format!("tool {number}"),
            (_, remark) => format!("tool {number}: {remark}"),
        };
        self.message(text)?;
        self.step(StepKind::ToolChange { tool: number })
    }

    /// The tool is in the spindle; 0: none is.
    fn take_tool(&mut self, number: u32) {
        self.tools.current = number;
        let (step, changes) = (self.program.steps.len(), &mut self.program.tool_changes);
        match changes.last_mut() {
            Some((before, tool)) if *before == step => *tool = number,
            _ => changes.push((step, number)),
        }
        let tools = &mut self.program.tools;
        if number != 0 && !tools.contains(&number) {
            tools.push(number);
        }
    }

    /// The subroutine that changes tools begins: in it M6 is a stop for the operator. It has the names of LinuxCNC's.
    pub(super) fn begin_change(&mut self, tool: u32) {
        self.tools.calls_change = false;
        let pocket = |number| self.tools.table.get(number).map_or(-1.0, |tool| f64::from(tool.pocket));
        let current = self.tools.current;
        for (name, value) in [
            ("tool_in_spindle", f64::from(current)),
            ("selected_tool", f64::from(tool)),
            ("current_pocket", pocket(current)),
            ("selected_pocket", pocket(tool)),
        ] {
            self.parameters.set_named(name, value);
        }
    }

    /// It ends: by its M6 or M61 the tool is there, or it returns a value above 0 and has changed it by itself.
    pub(super) fn end_change(&mut self, tool: u32) -> Result<(), Located> {
        self.tools.calls_change = true;
        if self.tools.current == tool {
            return Ok(());
        }
        match self.returned {
            Some(value) if value > 0.0 => {
                self.take_tool(tool);
                self.stop_spindle()
            }
            found => Err(Located::new(0, Problem::ToolNotChanged { tool, found })),
        }
    }

    /// Lists a tool that no table has.
    pub(super) fn assume_tool(&mut self, number: u32) {
        // As many as there are in the text, unless it computes them.
        const LISTED_MAX: usize = 1000;
        let assumed = &mut self.program.tools_assumed;
        if assumed.len() < LISTED_MAX && !assumed.contains(&number) {
            assumed.push(number);
        }
    }

    /// A tool by its number. Without a table it is assumed.
    pub(super) fn tool(&mut self, number: u32, offset: usize) -> Result<Tool, Located> {
        match self.tools.table.get(number) {
            Some(tool) => Ok(tool.clone()),
            None if number == 0 => Ok(Tool::default()),
            None if self.tools.is_given => Err(Located::new(offset, Problem::ToolUnknown { number })),
            None => {
                self.assume_tool(number);
                let diameter = Length::nearest(2.0 * self.tools.radius_mm).unwrap_or_default();
                Ok(Tool { number, diameter, ..Tool::default() })
            }
        }
    }

    /// A tool's offset; along other axes than the machine's it is refused.
    fn tool_offset(&mut self, number: u32, place: usize) -> Result<Point, Located> {
        let offset = self.tool(number, place)?.offset;
        let axes = self.program.axes;
        let is_lost = |axis: &Axis| !axes.contains(*axis) && offset[axis.index()] != Length::ZERO;
        match Axis::ALL.into_iter().find(is_lost) {
            Some(axis) => Err(Located::new(place, Problem::ToolOffsetAxis { number, axis, axes })),
            None => Ok(offset),
        }
    }

    /// G43 to G49.
    pub(super) fn tool_length(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let Some(code) = block.g(GGroup::ToolLength) else { return Ok(()) };
        let axes = block.axes();
        let h = block.letter(b'H');
        let mut tool = match code.tenths {
            490 => ORIGIN,
            430 => {
                let number =
                    h.map_or(Ok(self.tools.current), |word| word.count(0, "a whole tool number, 0 or more"))?;
                self.tool_offset(number, h.map_or(code.word.offset, |word| word.offset))?
            }
            _ => self.frame.tool,
        };
        if code.tenths == 431 || code.tenths == 432 {
            let has_axes = axes.iter().any(Option::is_some);
            let adds = code.tenths == 432;
            if adds && has_axes == h.is_some() || !adds && !has_axes {
                let expected = if adds { "either axis words or H" } else { "axis words" };
                return Err(code.word.problem(|word| Problem::Setup { word, expected }));
            }
            for (axis, word) in axes.into_iter().enumerate() {
                let Some(word) = word else { continue };
                let length = self.modal.units.coordinate(word)?;
                let sum = if adds { tool[axis].checked_add(length) } else { Some(length) };
                tool[axis] = sum.ok_or_else(|| word.problem(|word| Problem::PositionOutOfRange { word }))?;
            }
            if let Some(word) = h {
                let number = word.count(0, "a whole tool number, 0 or more")?;
                let offset = self.tool_offset(number, word.offset)?;
                for (sum, more) in tool.iter_mut().zip(offset) {
                    let beyond = || word.problem(|word| Problem::PositionOutOfRange { word });
                    *sum = sum.checked_add(more).ok_or_else(beyond)?;
                }
            }
        }
        self.frame.tool = tool;
        self.update_work(code.word.offset)
    }
}
