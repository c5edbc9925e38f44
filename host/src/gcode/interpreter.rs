//! Executes the lines, in the order RS-274 gives to the words of a line.

use std::mem::take;
use std::rc::Rc;

use super::axis::{Axis, ORIGIN, Point};
use super::block::{Block, GGroup, MGroup};
use super::cutter::Cutter;
use super::cycle::CycleState;
use super::error::{Located, Problem};
use super::expression::Target;
use super::frame::Frame;
use super::lexer::Cursor;
use super::message;
use super::modal::{FeedMode, FeedWord, Modal, Motion, Units};
use super::nurbs;
use super::options::ReadOptions;
use super::parameter_file;
use super::parameters::{Parameters, SELECTED};
use super::probe::Probe;
use super::program::{Batch, Message, Notice, NoticeKind, Outputs, Program, Step, StepKind};
use super::tool::ToolTable;

/// Feeds beyond are no feeds \[mm/min\].
const FEED_MAX: f64 = 1e15;

/// Most bytes of all messages: a loop may ask for long ones.
const MESSAGE_BYTES_MAX: usize = 1 << 26;

/// What comes after a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Control {
    /// The next line.
    Next,
    /// M98: a subprogram, so many times.
    Call { number: u32, repeats: u32 },
    /// M99.
    Return,
    /// M6, by the subroutine that changes tools.
    ChangeTool { tool: u32 },
}

/// State of a program being read: the steps up to here, and the modes in force.
#[derive(Debug)]
pub(super) struct Interpreter {
    pub(super) program: Program,
    pub(super) modal: Modal,
    pub(super) frame: Frame,
    /// The coordinate system in force, 1 to 9: parameter 5220 unless the program assigned that.
    pub(super) system: u32,
    /// Where the machine is, as the program counts.
    pub(super) work: Point,
    /// Where the machine is; with cutter compensation the programmed point.
    pub(super) machine: Point,
    /// G41 or G42.
    pub(super) cutter: Option<Cutter>,
    /// Where the machine is instead, beside the programmed path.
    pub(super) tool_at: Option<Point>,
    pub(super) parameters: Parameters,
    pub(super) tools: Tools,
    /// What spindle and coolant do after the steps up to here.
    pub(super) outputs: Outputs,
    pub(super) cycle: CycleState,
    /// What G38.2 to G38.5 touch.
    pub(super) probe: Option<Rc<Probe>>,
    /// The NURBS whose lines are being read.
    pub(super) nurbs: Option<nurbs::Open>,
    /// P and Q of the G5 that was the move before \[mm\].
    pub(super) cubic_before_mm: Option<[f64; 2]>,
    /// Modes that M70 or M73 saved, for the main program and every subroutine that runs.
    saved: Vec<Option<Saved>>,
    /// What the last subroutine returned.
    pub(super) returned: Option<f64>,
    /// Line of the program for steps, from 1.
    pub(super) line: u32,
    optional_stop: bool,
    /// Most steps, most messages, and most control points of a NURBS.
    pub(super) steps_max: usize,
    /// Steps and messages that were taken out of the program before.
    pub(super) taken: [usize; 2],
    message_bytes: usize,
    /// A word or a tape mark was read.
    pub(super) begun: bool,
    pub(super) ended: bool,
}

/// The tool in the spindle, and those there are.
#[derive(Debug, Default)]
pub(super) struct Tools {
    /// What there is; empty without a table.
    pub(super) table: ToolTable,
    /// Whether a table was given: then there are no others.
    pub(super) is_given: bool,
    /// T.
    pub(super) selected: Option<u32>,
    /// M6, M61; 0 before.
    pub(super) current: u32,
    /// Of every tool, without a table \[mm\]; 0: not known.
    pub(super) radius_mm: f64,
    /// A subroutine changes tools, and does not run.
    pub(super) calls_change: bool,
    /// The tool that the line asks it for.
    pub(super) change_to: Option<u32>,
}

/// Modes that M70 or M73 saved.
#[derive(Clone, Copy, Debug)]
struct Saved {
    modal: Modal,
    system: u32,
    tool: Point,
    /// M73: restored at the end of the subroutine.
    restores: bool,
}

impl Interpreter {
    /// Before the first line.
    pub(super) fn new(options: &ReadOptions) -> Self {
        let parameters = Parameters::with(options.parameters.values());
        let mut interpreter = Self {
            program: Program {
                axes: options.axes,
                tool_radius_mm: options.tool_radius_mm,
                ..Program::default()
            },
            modal: Modal::default(),
            frame: Frame::default(),
            system: 1,
            work: ORIGIN,
            machine: ORIGIN,
            cutter: None,
            tool_at: None,
            tools: Tools {
                table: options.tools.clone().unwrap_or_default(),
                is_given: options.tools.is_some(),
                radius_mm: if options.tools.is_none() { options.tool_radius_mm } else { 0.0 },
                calls_change: options.change_subroutine.is_some(),
                ..Tools::default()
            },
            parameters,
            outputs: Outputs::default(),
            cycle: CycleState::default(),
            probe: options.probe.clone().map(Rc::new),
            nurbs: None,
            cubic_before_mm: None,
            saved: vec![None],
            returned: None,
            line: 0,
            optional_stop: options.optional_stop,
            steps_max: options.steps_max,
            taken: [0; 2],
            message_bytes: 0,
            begun: false,
            ended: false,
        };
        interpreter.start_frame();
        interpreter
    }

    /// Executes a line from the cursor on.
    pub(super) fn execute(&mut self, cursor: Cursor<'_>) -> Result<Control, Located> {
        let block = Block::collect(cursor, self, self.program.axes)?;
        self.begun |= !block.is_empty();
        self.refuse_in_nurbs(&block)?;
        for assignment in &block.assignments {
            match &assignment.target {
                Target::Number(number) if !parameter_file::fits(*number, assignment.value) => {
                    let (number, value) = (*number, assignment.value);
                    return Err(Located::new(0, Problem::ParameterValue { number, value }));
                }
                Target::Number(number) => self.parameters.set(*number, assignment.value),
                Target::Name(name) => self.parameters.set_named(name, assignment.value),
            }
        }
        if block.asks_for_file {
            self.notice(NoticeKind::File);
        }
        for text in &block.comments {
            if let Some(text) = message::shown(text, self)? {
                self.message(text)?;
            }
        }
        self.refuse_unequipped(&block)?;
        if let Some(code) = block.m(MGroup::Subprogram) {
            return Self::subprogram(&block, code.tenths == 980);
        }
        self.modal.set_feed_mode(&block);
        self.set_feed(&block)?;
        self.accessories(&block)?;
        if let Some(tool) = self.tools.change_to.take() {
            return Ok(Control::ChangeTool { tool });
        }
        self.dwell(&block)?;
        self.modal.set(&block)?;
        self.note_rounding(&block);
        block.refuse_unused(self.modal.motion)?;
        if block.has_idle_d() {
            self.notice(NoticeKind::IdleD);
        }
        if self.modal.motion != Some(Motion::Cubic) {
            self.cubic_before_mm = None;
        }
        if !matches!(self.modal.motion, Some(Motion::Cycle(_))) {
            self.end_cycles();
        }
        self.compensation(&block)?;
        self.offsets(&block)?;
        self.motion(&block)?;
        match block.m(MGroup::Stop).map(|code| code.tenths) {
            Some(10) if !self.optional_stop => {}
            Some(0 | 10 | 600) => self.step(StepKind::Stop)?,
            Some(_) => self.end()?,
            None => {}
        }
        Ok(Control::Next)
    }

    /// M98 or M99, alone in its line.
    fn subprogram(block: &Block<'_>, calls: bool) -> Result<Control, Located> {
        if let Some(word) = block.stranger(if calls { b"MNPL" } else { b"MN" }, &[]) {
            return Err(word.problem(|word| Problem::SubprogramAlone { word }));
        }
        if !calls {
            return Ok(Control::Return);
        }
        let place = block.m(MGroup::Subprogram).map_or(0, |code| code.word.offset);
        let number = block.letter(b'P').ok_or(Located::new(place, Problem::SubprogramWithoutNumber))?;
        let number = number.count(0, "the whole number of a subprogram")?;
        let repeats =
            block.letter(b'L').map_or(Ok(1), |word| word.count(0, "a whole number of calls, 0 or more"))?;
        Ok(Control::Call { number, repeats })
    }

    /// Appends a step.
    pub(super) fn step(&mut self, kind: StepKind) -> Result<(), Located> {
        if self.taken[0] + self.program.steps.len() >= self.steps_max {
            return Err(Located::new(0, Problem::TooManySteps { steps_max: self.steps_max }));
        }
        self.cubic_before_mm = None;
        if let Some([from, to]) = kind.ends() {
            // Turns and polar words move axes that no word names.
            if let Some(axis) = Axis::ALL
                .into_iter()
                .find(|axis| from[axis.index()] != to[axis.index()] && !self.program.axes.contains(*axis))
            {
                return Err(Located::new(0, Problem::MissingAxisMoves { axis, axes: self.program.axes }));
            }
            self.program.systems.insert(self.system);
        }
        self.program.steps.push(Step { line: self.line, kind });
        Ok(())
    }

    /// Shows a text to the operator before the next step.
    pub(super) fn message(&mut self, text: String) -> Result<(), Located> {
        self.message_bytes = self.message_bytes.saturating_add(text.len());
        if self.taken[1] + self.program.messages.len() >= self.steps_max
            || self.message_bytes > MESSAGE_BYTES_MAX
        {
            return Err(Located::new(0, Problem::TooManySteps { steps_max: self.steps_max }));
        }
        let step = self.program.steps.len();
        self.program.messages.push(Message { line: self.line, within: None, step, text });
        Ok(())
    }

    /// Takes the steps and messages that no later line changes any more; none while cutter compensation may.
    pub(super) fn take(&mut self) -> Option<Batch> {
        if self.cutter.is_some() {
            return None;
        }
        let Program { steps, nurbs, messages, .. } = &mut self.program;
        let (steps, nurbs, messages) = (take(steps), take(nurbs), take(messages));
        self.taken = [self.taken[0] + steps.len(), self.taken[1] + messages.len()];
        Some(Batch { steps, nurbs, messages })
    }

    /// Ends the program; the next one starts in the first coordinate system.
    pub(super) fn end(&mut self) -> Result<(), Located> {
        self.unended_nurbs().map_or(Ok(()), Err)?;
        self.end_track(0)?;
        self.all_off()?;
        self.step(StepKind::End)?;
        self.parameters.set(SELECTED, 1.0);
        self.ended = true;
        Ok(())
    }

    /// Called at most once per line and kind.
    pub(super) fn notice(&mut self, kind: NoticeKind) {
        match self.program.notices.iter_mut().find(|notice| notice.kind == kind) {
            Some(notice) => notice.count = notice.count.saturating_add(1),
            None => self.program.notices.push(Notice { kind, first_line: self.line, count: 1 }),
        }
    }

    fn note_rounding(&mut self, block: &Block<'_>) {
        if block.rounded || self.modal.units == Units::Inches && block.is_inexact_in_inches() {
            self.notice(NoticeKind::Rounded);
        }
    }

    /// The order puts the feed before the units. Still, whoever writes `G20 F40` means inches: the line's own
    /// units hold, and a notice says so where it matters.
    fn set_feed(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let Some(word) = block.letter(b'F') else { return Ok(()) };
        if word.number.signum() < 0 || word.number.to_f64() > FEED_MAX {
            return Err(word.problem(|word| Problem::FeedNegative { word }));
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            return Ok(());
        }
        let units = Units::of(block).unwrap_or(self.modal.units);
        if units != self.modal.units {
            self.notice(NoticeKind::FeedInNewUnits);
        }
        // F0 is no feed: what moves after it is refused.
        let number = word.number.to_f64();
        let feed = FeedWord { linear: units.mm(number), angular: number };
        self.modal.feed = Some(feed).filter(|_| number > 0.0);
        Ok(())
    }

    fn dwell(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let Some(code) = block.g(GGroup::NonModal).filter(|code| code.tenths == 40) else { return Ok(()) };
        let Some(time) = block.letter(b'P') else {
            return Err(Located::new(code.word.offset, Problem::DwellWithoutTime));
        };
        if block.is_blend() {
            return Err(time.problem(|word| Problem::WordShared { word, letter: 'P' }));
        }
        time.refuse_negative()?;
        self.step(StepKind::Dwell { seconds: time.number.to_f64() })
    }

    /// The number of subroutines that run.
    pub(super) fn call_level(&self) -> usize {
        self.saved.len() - 1
    }

    /// A subroutine begins.
    pub(super) fn enter(&mut self) {
        self.saved.push(None);
    }

    /// A subroutine ends.
    pub(super) fn leave(&mut self) -> Result<(), Located> {
        match self.saved.pop().flatten() {
            Some(saved) if saved.restores => self.restore(saved),
            _ => Ok(()),
        }
    }

    /// M70 to M73.
    pub(super) fn modes(&mut self, tenths: i64, offset: usize) -> Result<(), Located> {
        let now = Saved {
            modal: self.modal,
            system: self.system(),
            tool: self.frame.tool,
            restores: tenths == 730,
        };
        let Some(slot) = self.saved.last_mut() else { return Ok(()) };
        match tenths {
            700 | 730 => *slot = Some(now),
            710 => *slot = None,
            _ => match *slot {
                Some(saved) => return self.restore(saved),
                None => return Err(Located::new(offset, Problem::NothingSaved)),
            },
        }
        Ok(())
    }

    /// All modes but the motion mode.
    fn restore(&mut self, saved: Saved) -> Result<(), Located> {
        self.unended_nurbs().map_or(Ok(()), Err)?;
        let moves_path = saved.modal.plane != self.modal.plane
            || saved.system != self.system()
            || saved.tool != self.frame.tool;
        if self.cutter.is_some() && moves_path {
            let word = "another plane or offset restored".to_owned();
            return Err(Located::new(0, Problem::Compensated { word }));
        }
        self.modal = Modal { motion: self.modal.motion, ..saved.modal };
        self.frame.tool = saved.tool;
        self.switch()?;
        self.select(saved.system, 0)
    }

    /// Refuses what needs what the machine does not have. In a subroutine that is never called it may stand.
    fn refuse_unequipped(&self, block: &Block<'_>) -> Result<(), Located> {
        if let Some(code) = block.m(MGroup::User) {
            return Err(code.word.problem(|word| Problem::UserProgram { word }));
        }
        let Some(code) = block.g(GGroup::Motion) else { return Ok(()) };
        match code.tenths {
            330 | 331 | 740 | 760 | 840 => Err(code.word.problem(|word| Problem::NeedsEncoder { word })),
            382..=385 if self.probe.is_none() => Err(code.word.problem(|word| Problem::NeedsProbe { word })),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::super::{ArcMove, Feed, GcodeError, LineMove, PathMode, read};
    use super::*;

    fn steps(text: &str) -> Vec<StepKind> {
        let program = read("a.ngc", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        program.steps.into_iter().map(|step| step.kind).collect()
    }

    fn last_mm(text: &str) -> [f64; 3] {
        match steps(text).last() {
            Some(StepKind::Line(LineMove { to, .. }) | StepKind::Arc(ArcMove { to, .. })) => {
                super::super::xyz_mm(*to)
            }
            other => panic!("a move, not {other:?}"),
        }
    }

    #[test]
    fn a_line_runs_in_the_order_of_the_standard() {
        let kinds = steps("X25.4 M0 G1 G4 P2 F600 M3 S5");
        assert!(matches!(
            kinds[..],
            [
                StepKind::Switch(_),
                StepKind::Dwell { .. },
                StepKind::Line(LineMove { feed: Feed::MmPerMin(_), .. }),
                StepKind::Stop,
                // At the end of the file.
                StepKind::Switch(_)
            ]
        ));
        assert_eq!(last_mm("G0 X1 G20"), [25.4, 0.0, 0.0]);
        assert_eq!(last_mm("G0 X1\nX1 Y2 G91"), [2.0, 2.0, 0.0]);
    }

    #[test]
    fn a_feed_is_a_speed() {
        let feed = |text| match steps(text).last() {
            Some(StepKind::Line(line)) => line.feed,
            other => panic!("a line, not {other:?}"),
        };
        assert_eq!(feed("G20 F10\nG21 G1 X1"), Feed::MmPerMin(254.0));
        assert_eq!(feed("F10\nG0 X1"), Feed::Rapid);
        let notices = read("a", b"G20 F10\nF20 G20 M2").unwrap().notices;
        assert_eq!(notices, [Notice { kind: NoticeKind::FeedInNewUnits, first_line: 1, count: 1 }]);
    }

    #[test]
    fn path_modes_reach_the_moves() {
        let modes: Vec<_> = steps("G0 X1\nG64 P0.1 X2\nG64 Q.2 X3\nG61 X4\nG20 G64 P1 Q0 X5")
            .iter()
            .map(|kind| match kind {
                StepKind::Line(line) => line.mode,
                other => panic!("a line, not {other:?}"),
            })
            .collect();
        let blend = |tolerance_mm, merging_mm| PathMode::Blend { tolerance_mm, merging_mm };
        let (exact, unprogrammed) = (PathMode::ExactPath, PathMode::Unprogrammed);
        assert_eq!(
            modes,
            [
                unprogrammed,
                blend(Some(0.1), None),
                blend(None, Some(0.2)),
                exact,
                blend(Some(25.4), Some(0.0)),
            ]
        );
    }

    #[test]
    fn moves_of_no_length_vanish_but_need_their_feed() {
        assert_eq!(steps("G0 X0\nG1 F5 X0 Y0\nG0\nX0.0 M2"), [StepKind::End]);
        assert!(read("a", b"G1 X0").is_err());
    }

    #[test]
    fn arc_words_alone_repeat_the_arc() {
        let kinds = steps("F9 G2 I5\nI5\nG91 Z1 I5\nG3\nG90.1 I5 J0");
        let turns = |kind: &StepKind| match kind {
            StepKind::Arc(arc) => arc.sweep_rad / (2.0 * std::f64::consts::PI),
            other => panic!("an arc, not {other:?}"),
        };
        assert_eq!(kinds.iter().map(turns).collect::<Vec<_>>(), [-1.0, -1.0, -1.0, 1.0]);
    }

    #[test]
    fn tape_marks_and_ends() {
        assert_eq!(steps("(head)\n%\nG0 X0\n%\n").len(), 1);
        assert_eq!(steps("G0 X1\n%"), steps("%\nX1 G0 M30\n%"));
        let program = read("a", b"M2\n\n%\nG99 [\n(x)").unwrap();
        assert_eq!(program.notices, [Notice { kind: NoticeKind::TextAfterEnd, first_line: 4, count: 2 }]);
        let program = read("a", b"()").unwrap();
        assert_eq!(program.notices, [Notice { kind: NoticeKind::NoProgramEnd, first_line: 1, count: 1 }]);
    }

    #[test]
    fn what_is_not_acted_on_is_noticed_once_per_kind() {
        let program =
            read("a", b"M3 S9\nS8 M7 M8\nT1 M61 Q2\nM5 M9\nG64 Q.1\nG64\nF1 G2 X2.001 R1\nM30").unwrap();
        let notices: Vec<_> = program.notices.iter().map(|n| (n.kind, n.first_line, n.count)).collect();
        assert_eq!(
            notices,
            [
                (NoticeKind::SpindleSpeed, 1, 2),
                (NoticeKind::Spindle, 1, 2),
                (NoticeKind::Coolant, 2, 2),
                (NoticeKind::RadiusEnlarged, 7, 1),
            ]
        );
    }

    #[test]
    fn requests_that_cannot_be_met_are_refused() {
        for (text, place, message) in [
            ("G1 X1", "1:1:", "found G1 without a feed"),
            ("G1\n X1", "2:2:", "found G1 without a feed"),
            ("F0 G1 X1", "1:4:", "found G1 without a feed"),
            ("F-5", "1:1:", "found F-5, expected a feed that is not negative"),
            ("G0 @5 ^10 X1", "1:11:", "found X1 in a line with @ or ^"),
            ("G0 @5", "1:4:", "found @5 at X0 Y0"),
            ("G0 X1\nG53 G0 @5 ^1", "2:8:", "found @5 with G53, expected axis words"),
            ("G92 @5 ^1", "1:5:", "found @5 in a line without a move in the XY plane"),
            ("X1", "1:1:", "found X1 without a motion mode"),
            ("G0 X1\nG80 Y2", "2:5:", "found Y2 without a motion mode"),
            ("S-1", "1:1:", "found S-1"),
            ("G4", "1:1:", "found G4 without a time"),
            ("G4 P-1", "1:4:", "found P-1"),
            ("G4 G64 P1", "1:8:", "both would take it"),
            ("G0 X1 P5", "1:7:", "in a line without G2, G3, G4, G5, G5.2, G6.2, G10, G64"),
            ("G61 P5", "1:5:", "in a line without G2, G3, G4, G5, G5.2, G6.2, G10, G64"),
            ("G64 P-.1", "1:5:", "not negative"),
            ("G1 F5 X1 I2", "1:10:", "in a line without G2, G3, G5, G5.1 or G10"),
            ("R5", "1:1:", "in a line without G2, G3, G6.2, G10 or"),
            ("F5 G2 X1", "1:4:", "found G2 without a centre or radius, expected I and J or R"),
            ("F5 G2 X1 I1 K1", "1:13:", "found K1 in an arc of the XY plane"),
            ("F5 G18 G2 X1 J1", "1:14:", "expected I and K or R"),
            ("F5 G2 X1 I1 R1", "1:13:", "the centre or the radius"),
            ("F5 G2 X2 I1.1", "1:4:", "starts 1.100000 mm and ends 0.900000 mm"),
            ("F5 G2 X2 I1.015", "1:4:", "expected a difference of 0.028284 mm at most"),
            ("F5 G20 G2 X2 I1.0015", "1:8:", "expected a difference of 0.071842 mm at most"),
            ("F5 G2 X0 R1", "1:10:", "ends where it starts"),
            ("F5 G2 X2.006 R1", "1:14:", "found R1 for two points 2.006000 mm apart"),
            ("F5 G2 X1 I0", "1:4:", "centre is its start point"),
            ("F5 G90.1 G2 X2 I1", "1:10:", "one coordinate only"),
            ("F5 G5 X1 Y1 P0 Q-1", "1:4:", "found a first G5 without I and J"),
            ("F5 G5 X1 I1 J0", "1:4:", "found G5 without P and Q"),
            ("F5 G5 X1 I1 P0 Q1", "1:10:", "found I1 alone in a line of G5 or G5.1, expected I and J"),
            ("F5 G5 X1 I1 J1 Q1", "1:16:", "found Q1 alone in a line of G5 or G5.1, expected P and Q"),
            ("F5 G18 G5 X1 I1 J1 P1 Q1", "1:8:", "found G5 in the ZX plane"),
            ("F5 G5 Z1 I1 J1 P1 Q1", "1:7:", "found Z1 in a line of G5"),
            ("F5 G5 X1 K1 P1 Q1", "1:10:", "found K1 in a line without G2, G3 or G6.2"),
            ("F5 G5 X1 I1 J1 P1 Q1\nG1 X2\nG5 X3 P1 Q1", "3:1:", "found a first G5 without I and J"),
            ("F5 G5 X1 I1 J1 G64 P1 Q1", "1:20:", "found P1 in a line with two words that take P"),
            ("G5 X1 I1 J1 P1 Q1", "1:1:", "found G5 without a feed"),
            ("F5 G5.5 X1 P1", "1:12:", "found P1 in a line without G2, G3, G4, G5, G5.2, G6.2, G10, G64"),
            ("G5.2 X1", "1:1:", "found G5.2"),
            ("F9 G33 Z1 K1", "1:4:", "found G33, which needs a spindle encoder"),
            ("G84 X1 Z1 R2", "1:1:", "found G84, which needs a spindle encoder"),
            (
                "F9 G38.2 Z-1",
                "1:4:",
                "found G38.2, which needs a probe, expected [[probe.box]] in a machine file",
            ),
            ("M110 P1", "1:1:", "found M110, which runs a program of the user's"),
            ("G0 X1000000.1", "1:4:", "within ±1000000 mm"),
            ("G91 G0 X-999999\nX-2", "2:1:", "adds up beyond"),
        ] {
            let error: GcodeError = read("a", text.as_bytes()).unwrap_err();
            let shown = error.to_string();
            assert!(shown.starts_with(&format!("a:{place}")) && shown.contains(message), "{text}: {shown}");
        }
    }
}
