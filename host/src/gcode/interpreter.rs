//! Executes the lines, in the order RS-274 gives to the words of a line.

use super::arc;
use super::block::{Block, GGroup, MGroup};
use super::decimal::Length;
use super::error::{Located, Problem};
use super::lexer::{Word, is_blank_line, is_percent_line};
use super::modal::{Distance, Modal, Motion, Units};
use super::program::{
    ArcMove, CubicMove, Feed, LineMove, Notice, NoticeKind, Program, Step, StepKind, ThroughMove,
};
use super::spline;

/// State of a program being read: the steps up to here, and the modes in force.
#[derive(Debug, Default)]
pub(super) struct Interpreter {
    program: Program,
    modal: Modal,
    position: [Length; 3],
    /// P and Q of the G5 that was the move before \[mm\].
    cubic_before_mm: Option<[f64; 2]>,
    /// Line being read, from 1; the last with any text.
    line: u32,
    /// A word or a tape mark was read.
    begun: bool,
    ended: bool,
}

impl Interpreter {
    /// Reads a line, which is without its line end.
    pub(super) fn line(&mut self, line_number: u32, line: &[u8]) -> Result<(), Located> {
        if is_blank_line(line) {
            return Ok(());
        }
        self.line = line_number;
        if is_percent_line(line) {
            // Before any word the mark opens the tape, later it closes it; closed twice is closed.
            if self.begun && !self.ended {
                self.end();
            }
            self.begun = true;
            return Ok(());
        }
        if self.ended {
            self.notice(NoticeKind::TextAfterEnd);
            return Ok(());
        }
        let block = Block::collect(line)?;
        self.begun |= !block.is_empty();
        self.execute(&block)
    }

    /// The program, after its last line.
    pub(super) fn finish(mut self) -> Program {
        if !self.ended {
            self.line = self.line.max(1);
            self.notice(NoticeKind::NoProgramEnd);
        }
        self.program
    }

    fn execute(&mut self, block: &Block<'_>) -> Result<(), Located> {
        self.set_feed(block)?;
        self.note_accessories(block)?;
        self.dwell(block)?;
        self.modal.set(block)?;
        block.refuse_unused(self.modal.motion)?;
        if self.modal.motion != Some(Motion::Cubic) {
            self.cubic_before_mm = None;
        }
        self.motion(block)?;
        match block.m(MGroup::Stop).map(|code| code.tenths) {
            Some(0 | 10) => self.step(StepKind::Stop),
            Some(_) => self.end(),
            None => {}
        }
        Ok(())
    }

    fn step(&mut self, kind: StepKind) {
        self.cubic_before_mm = match &kind {
            StepKind::Cubic(cubic) => Some(cubic.controls_mm[1]),
            _ => None,
        };
        self.program.steps.push(Step { line: self.line, kind });
    }

    fn end(&mut self) {
        self.step(StepKind::End);
        self.ended = true;
    }

    /// Called at most once per line and kind.
    fn notice(&mut self, kind: NoticeKind) {
        match self.program.notices.iter_mut().find(|notice| notice.kind == kind) {
            Some(notice) => notice.count = notice.count.saturating_add(1),
            None => self.program.notices.push(Notice { kind, first_line: self.line, count: 1 }),
        }
    }

    /// The order puts the feed before the units. Still, whoever writes `G20 F40` means inches: the line's own
    /// units hold, and a notice says so where it matters.
    fn set_feed(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let Some(word) = block.letter(b'F') else { return Ok(()) };
        if word.number.signum() <= 0 {
            return Err(word.problem(|word| Problem::FeedNotPositive { word }));
        }
        let units = Units::of(block).unwrap_or(self.modal.units);
        if units != self.modal.units {
            self.notice(NoticeKind::FeedInNewUnits);
        }
        self.modal.feed_mm_min = Some(units.feed_mm_min(word.number));
        Ok(())
    }

    fn note_accessories(&mut self, block: &Block<'_>) -> Result<(), Located> {
        if let Some(word) = block.letter(b'S') {
            word.refuse_negative()?;
            self.notice(NoticeKind::SpindleSpeed);
        }
        if block.m(MGroup::ToolChange).is_some() {
            self.notice(NoticeKind::ToolChange);
        }
        if block.m(MGroup::Spindle).is_some() {
            self.notice(NoticeKind::Spindle);
        }
        if [MGroup::Mist, MGroup::Flood, MGroup::CoolantOff].iter().any(|&group| block.m(group).is_some()) {
            self.notice(NoticeKind::Coolant);
        }
        Ok(())
    }

    fn dwell(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let Some(code) = block.g(GGroup::Dwell) else { return Ok(()) };
        let Some(time) = block.letter(b'P') else {
            return Err(Located::new(code.word.offset, Problem::DwellWithoutTime));
        };
        if block.is_blend() {
            return Err(time.problem(|word| Problem::WordShared { word, takers: "G4 and G64" }));
        }
        time.refuse_negative()?;
        self.step(StepKind::Dwell { seconds: time.number.to_f64() });
        Ok(())
    }

    /// The move a line asks for by an axis word or, in the arc modes, an offset or radius.
    fn motion(&mut self, block: &Block<'_>) -> Result<(), Located> {
        // P and Q alone belong to a G4 or G64 in the line.
        let is_cubic = self.modal.motion == Some(Motion::Cubic);
        let is_taken = block.is_blend() || block.g(GGroup::Dwell).is_some();
        let ends = [b'P', b'Q'].map(|letter| block.letter(letter).filter(|_| is_cubic && !is_taken));
        let words = block.axes().into_iter().chain(block.offsets()).chain([block.letter(b'R')]).chain(ends);
        let Some(first) = words.flatten().min_by_key(|word| word.offset) else { return Ok(()) };
        let Some(motion) = self.modal.motion else {
            return Err(first.problem(|word| Problem::AxisWithoutMotion { word }));
        };
        let offset = block.g(GGroup::Motion).map_or(first.offset, |code| code.word.offset);
        let feed = match self.modal.feed_mm_min {
            _ if motion == Motion::Rapid => Feed::Rapid,
            Some(feed_mm_min) => Feed::MmPerMin(feed_mm_min),
            None => return Err(Located::new(offset, Problem::FeedMissing { motion: motion.word() })),
        };
        let (from, to, mode) = (self.position, self.end_point(block)?, self.modal.path);
        if is_cubic && is_taken {
            let word = block.letter(b'P').or(block.letter(b'Q')).unwrap_or(first);
            return Err(word.problem(|word| Problem::WordShared { word, takers: "G5 and G4 or G64" }));
        }
        if is_cubic {
            let controls_mm = spline::controls_mm(block, &self.modal, self.cubic_before_mm, offset)?;
            self.position = to;
            if from != to || controls_mm != [[0.0; 2]; 2] {
                self.step(StepKind::Cubic(CubicMove { from, to, controls_mm, feed, mode }));
            }
            return Ok(());
        }
        self.position = to;
        if motion.is_arc() {
            let arc = self.arc(block, motion, from, to, feed, offset)?;
            self.step(StepKind::Arc(arc));
        } else if from != to && motion == Motion::Through {
            let begins = block.g(GGroup::Motion).is_some();
            self.step(StepKind::Through(ThroughMove { from, to, begins, feed, mode }));
        } else if from != to {
            self.step(StepKind::Line(LineMove { from, to, feed, mode }));
        }
        Ok(())
    }

    fn end_point(&self, block: &Block<'_>) -> Result<[Length; 3], Located> {
        let mut to = self.position;
        for (coordinate, word) in to.iter_mut().zip(block.axes()) {
            let Some(word) = word else { continue };
            let length = self.modal.units.length(word)?;
            *coordinate = match self.modal.distance {
                Distance::Absolute => length,
                Distance::Incremental => coordinate
                    .checked_add(length)
                    .ok_or_else(|| word.problem(|word| Problem::PositionOutOfRange { word }))?,
            };
        }
        Ok(to)
    }

    fn arc(
        &mut self,
        block: &Block<'_>,
        motion: Motion,
        from: [Length; 3],
        to: [Length; 3],
        feed: Feed,
        offset: usize,
    ) -> Result<ArcMove, Located> {
        let Modal { plane, units, path: mode, .. } = self.modal;
        let [first, second, normal] = plane.axes();
        let offsets = block.offsets();
        if let Some(word) = offsets[normal] {
            return Err(word.problem(|word| Problem::ArcOffsetOutsidePlane { word, plane }));
        }
        let in_plane = |point: [Length; 3]| [point[first], point[second]];
        let (start, end) = (in_plane(from), in_plane(to));
        let clockwise = motion == Motion::Clockwise;
        let centre_words = [offsets[first], offsets[second]];
        let resolved = match (block.letter(b'R'), centre_words) {
            (None, [None, None]) => {
                Err(Located::new(offset, Problem::ArcWithoutCentre { motion: motion.word(), plane }))
            }
            (None, _) => {
                let centre = self.centre(centre_words, start, offset)?;
                arc::about_centre(start, end, centre, clockwise)
                    .map_err(|problem| Located::new(offset, problem))
            }
            (Some(word), [None, None]) => {
                let radius = units.length(word)?;
                arc::of_radius(start, end, radius, clockwise, plane, || word.text())
                    .map_err(|problem| Located::new(word.offset, problem))
            }
            (Some(word), _) => Err(word.problem(|word| Problem::ArcCentreAndRadius { word })),
        }?;
        if resolved.radius_enlarged {
            self.notice(NoticeKind::RadiusEnlarged);
        }
        let arc::Resolved { centre_mm, start_radius_mm, end_radius_mm, sweep_rad, .. } = resolved;
        Ok(ArcMove { from, to, plane, centre_mm, start_radius_mm, end_radius_mm, sweep_rad, feed, mode })
    }

    /// Centre along the plane's axes \[10⁻¹⁰ mm\]; a relative one may lie beyond the range of a [`Length`].
    fn centre(
        &self,
        words: [Option<Word<'_>>; 2],
        start: [Length; 2],
        offset: usize,
    ) -> Result<[i64; 2], Located> {
        let mut centre = [0; 2];
        for (coordinate, (word, start)) in centre.iter_mut().zip(words.into_iter().zip(start)) {
            let length = word.map(|word| self.modal.units.length(word)).transpose()?;
            *coordinate = match (self.modal.arc_distance, length) {
                (Distance::Incremental, length) => start.units() + length.unwrap_or_default().units(),
                (Distance::Absolute, Some(length)) => length.units(),
                (Distance::Absolute, None) => {
                    let plane = self.modal.plane;
                    return Err(Located::new(offset, Problem::ArcCentreIncomplete { plane }));
                }
            };
        }
        Ok(centre)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::super::{GcodeError, PathMode, read};
    use super::*;

    fn steps(text: &str) -> Vec<StepKind> {
        let program = read("a.ngc", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        program.steps.into_iter().map(|step| step.kind).collect()
    }

    fn last_mm(text: &str) -> [f64; 3] {
        match steps(text).last() {
            Some(StepKind::Line(LineMove { to, .. }) | StepKind::Arc(ArcMove { to, .. })) => {
                to.map(Length::to_mm)
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
                StepKind::Dwell { .. },
                StepKind::Line(LineMove { feed: Feed::MmPerMin(_), .. }),
                StepKind::Stop
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
        let exact = PathMode::ExactPath;
        assert_eq!(
            modes,
            [exact, blend(Some(0.1), None), blend(None, Some(0.2)), exact, blend(Some(25.4), Some(0.0)),]
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
        let program = read("a", b"").unwrap();
        assert_eq!(program.notices, [Notice { kind: NoticeKind::NoProgramEnd, first_line: 1, count: 1 }]);
    }

    #[test]
    fn what_is_not_acted_on_is_noticed_once_per_kind() {
        let program = read("a", b"M3 S9\nS8 M7 M8\nM6\nM5 M9\nG64 Q.1\nG64\nF1 G2 X2.001 R1\nM30").unwrap();
        let notices: Vec<_> = program.notices.iter().map(|n| (n.kind, n.first_line, n.count)).collect();
        assert_eq!(
            notices,
            [
                (NoticeKind::SpindleSpeed, 1, 2),
                (NoticeKind::Spindle, 1, 2),
                (NoticeKind::Coolant, 2, 2),
                (NoticeKind::ToolChange, 3, 1),
                (NoticeKind::RadiusEnlarged, 7, 1),
            ]
        );
    }

    #[test]
    fn requests_that_cannot_be_met_are_refused() {
        for (text, place, message) in [
            ("G1 X1", "1:1:", "found G1 without a feed"),
            ("G1\n X1", "2:2:", "found G1 without a feed"),
            ("F0", "1:1:", "found F0, expected a positive feed"),
            ("F-5", "1:1:", "found F-5"),
            ("X1", "1:1:", "found X1 without a motion mode"),
            ("G0 X1\nG80 Y2", "2:5:", "found Y2 without a motion mode"),
            ("S-1", "1:1:", "found S-1"),
            ("G4", "1:1:", "found G4 without a time"),
            ("G4 P-1", "1:4:", "found P-1"),
            ("G4 G64 P1", "1:8:", "both would take it"),
            ("G0 X1 P5", "1:7:", "in a line without G4, G5 or G64"),
            ("G61 P5", "1:5:", "in a line without G4, G5 or G64"),
            ("G64 P-.1", "1:5:", "not negative"),
            ("G1 F5 X1 I2", "1:10:", "in a line without G2, G3 or G5"),
            ("R5", "1:1:", "in a line without G2 or G3"),
            ("F5 G2 X1", "1:4:", "found G2 without a centre or radius, expected I and J or R"),
            ("F5 G2 X1 I1 K0", "1:13:", "found K0 in an arc of the XY plane"),
            ("F5 G18 G2 X1 J1", "1:14:", "expected I and K or R"),
            ("F5 G2 X1 I1 R1", "1:13:", "the centre or the radius"),
            ("F5 G2 X2 I1.1", "1:4:", "starts 1.100000 mm and ends 0.900000 mm"),
            ("F5 G2 X0 R1", "1:10:", "ends where it starts"),
            ("F5 G2 X2.006 R1", "1:14:", "found R1 for two points 2.006000 mm apart"),
            ("F5 G2 X1 I0", "1:4:", "centre is its start point"),
            ("F5 G90.1 G2 X2 I1", "1:10:", "one coordinate only"),
            ("F5 G5 X1 Y1 P0 Q-1", "1:4:", "found a first G5 without I and J"),
            ("F5 G5 X1 I1 J0", "1:4:", "found G5 without P and Q"),
            ("F5 G5 X1 I1 P0 Q1", "1:10:", "found I1 alone in a line of G5, expected I and J"),
            ("F5 G5 X1 I1 J1 Q1", "1:16:", "found Q1 alone in a line of G5, expected P and Q"),
            ("F5 G18 G5 X1 I1 J1 P1 Q1", "1:8:", "found G5 in the ZX plane"),
            ("F5 G5 Z1 I1 J1 P1 Q1", "1:7:", "found Z1 in a line of G5"),
            ("F5 G5 X1 K1 P1 Q1", "1:10:", "found K1 in a line without G2 or G3"),
            ("F5 G5 X1 I1 J1 P1 Q1\nG1 X2\nG5 X3 P1 Q1", "3:1:", "found a first G5 without I and J"),
            ("F5 G5 X1 I1 J1 G64 P1 Q1", "1:20:", "found P1 in a line with G5 and G4 or G64"),
            ("G5 X1 I1 J1 P1 Q1", "1:1:", "found G5 without a feed"),
            ("F5 G5.5 X1 P1", "1:12:", "found P1 in a line without G4, G5 or G64"),
            ("G5.2 X1", "1:1:", "found G5.2"),
            ("G0 X1000000.1", "1:4:", "within ±1000000 mm"),
            ("G91 G0 X-999999\nX-2", "2:1:", "adds up beyond"),
            ("G20 G0 X.0000000001", "1:8:", "at most 9 decimals"),
        ] {
            let error: GcodeError = read("a", text.as_bytes()).unwrap_err();
            let shown = error.to_string();
            assert!(shown.starts_with(&format!("a:{place}")) && shown.contains(message), "{text}: {shown}");
        }
    }
}
