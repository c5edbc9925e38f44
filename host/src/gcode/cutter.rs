//! Cutter radius compensation: G40, G41, G42, G41.1 and G42.1, and what they rule out.

use super::block::{Block, GGroup};
use super::cutter_path::Track;
use super::error::{Located, Problem};
use super::interpreter::Interpreter;
use super::lexer::Word;
use super::modal::Motion;
use super::program::Plane;

/// The compensation in force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cutter {
    /// The word that set it: 410, 420, 411 or 421.
    pub(super) tenths: i64,
    /// The tool is on the left of the path.
    pub(super) is_left: bool,
    /// Of the tool \[mm\]; 0: the path is kept.
    pub(super) radius_mm: f64,
    /// The tool's controlled point, from its centre, along the axes of the plane \[mm\]: not 0 for tools
    /// of a lathe.
    pub(super) shift_mm: [f64; 2],
    plane: Plane,
    /// Behind the entry move.
    pub(super) track: Option<Track>,
}

impl Interpreter {
    /// G40 to G42.1.
    pub(super) fn compensation(&mut self, block: &Block<'_>) -> Result<(), Located> {
        if let (Some(cutter), Some(code)) = (&self.cutter, block.g(GGroup::Plane))
            && cutter.plane != self.modal.plane
        {
            return Err(compensated(code.word));
        }
        if let Some(code) = block.g(GGroup::CutterCompensation) {
            if code.tenths == 400 {
                self.end_track(code.word.offset)?;
            }
            self.cutter = match (code.tenths, &self.cutter) {
                (400, _) => None,
                (_, Some(_)) => return Err(compensated(code.word)),
                (tenths, None) => Some(self.cutter_of(block, tenths, code.word)?),
            };
        }
        if self.cutter.is_none() {
            return Ok(());
        }
        let moves_zero = |tenths| match tenths {
            100 => block.letter(b'L').is_some_and(|word| matches!(word.number.whole(), Some(2 | 20))),
            tenths => matches!(tenths, 280 | 281 | 300 | 301 | 520 | 920),
        };
        let barred = [
            block.g(GGroup::NonModal).filter(|code| moves_zero(code.tenths)),
            block.g(GGroup::Shift),
            block.g(GGroup::ToolLength),
            block.g(GGroup::CoordinateSystem),
        ];
        barred.into_iter().flatten().next().map_or(Ok(()), |code| Err(compensated(code.word)))
    }

    /// Refuses moves that have no path beside them, and curves right behind G40.
    pub(super) fn refuse_uncompensated(&self, motion: Motion, offset: usize) -> Result<(), Located> {
        if self.cutter.is_some() && !motion.is_arc() && !matches!(motion, Motion::Rapid | Motion::Feed) {
            let word = motion.word().to_owned();
            return Err(Located::new(offset, Problem::Compensated { word }));
        }
        let is_beside = self.tool_at.is_some() && self.cutter.is_none_or(|cutter| cutter.track.is_none());
        let is_curve = !matches!(motion, Motion::Rapid | Motion::Feed | Motion::Cycle(_));
        if is_beside && is_curve {
            return Err(Located::new(offset, Problem::CompensationLeft { motion: motion.word() }));
        }
        Ok(())
    }

    /// Refuses G53, whose point is none of the path.
    pub(super) fn refuse_machine_move(&self, word: Word<'_>) -> Result<(), Located> {
        if self.is_offset() { Err(compensated(word)) } else { Ok(()) }
    }

    /// Whether the path is offset.
    pub(super) fn is_offset(&self) -> bool {
        self.cutter.is_some_and(|cutter| cutter.radius_mm > 0.0)
    }

    /// The compensation that a word asks for.
    fn cutter_of(&mut self, block: &Block<'_>, tenths: i64, code: Word<'_>) -> Result<Cutter, Located> {
        let plane = self.modal.plane;
        let refused = |expected| code.problem(|word| Problem::Setup { word, expected });
        if plane == Plane::Yz {
            return Err(refused("the XY plane (G17) or the ZX plane (G18)"));
        }
        let (radius_mm, orientation) = if matches!(tenths, 411 | 421) {
            let d = block.letter(b'D').ok_or_else(|| refused("the tool's diameter, a D word"))?;
            let orientation = block.letter(b'L').map(|word| orientation(&word)).transpose()?;
            (self.modal.units.mm(d.number.to_f64()) / 2.0, orientation.unwrap_or(0))
        } else {
            let d = block.letter(b'D');
            let number = d.map_or(Ok(0), |word| word.count(0, "a whole tool number, 0 or more"))?;
            let number = if number == 0 { self.tools.current } else { number };
            let place = d.map_or(code.offset, |word| word.offset);
            match self.tools.table.get(number) {
                Some(tool) => (tool.diameter.to_mm() / 2.0, tool.orientation),
                None if self.tools.radius_mm > 0.0 => {
                    self.assume_tool(number);
                    (self.tools.radius_mm, 0)
                }
                None => return Err(Located::new(place, Problem::CompensationRadius { number })),
            }
        };
        let is_lathe_tool = !matches!(orientation, 0 | 9);
        if is_lathe_tool && plane != Plane::Zx {
            return Err(refused("the ZX plane (G18): the tool has an orientation, so it is a lathe's"));
        }
        // A negative radius is one on the other side.
        let is_left = matches!(tenths, 410 | 411) != (radius_mm < 0.0);
        let radius_mm = radius_mm.abs();
        let shift_mm = nose(orientation).map(|part| part * radius_mm);
        Ok(Cutter { tenths, is_left, radius_mm, shift_mm, plane, track: None })
    }
}

/// The problem of a word that does not go with G41 and G42.
pub(super) fn compensated(word: Word<'_>) -> Located {
    word.problem(|word| Problem::Compensated { word })
}

fn orientation(word: &Word<'_>) -> Result<u32, Located> {
    const EXPECTED: &str = "a whole orientation from 0 to 9";
    let number = word.count(0, EXPECTED)?;
    if number > 9 {
        return Err(word.problem(|word| Problem::NotThisCount { word, expected: EXPECTED }));
    }
    Ok(number)
}

/// Where the controlled point of a tool is, from the centre of its nose along Z and X \[radii\]. Orientations
/// 1 to 4 are corners, 5 to 8 sides; 0 and 9 are the centre.
fn nose(orientation: u32) -> [f64; 2] {
    let along_z = match orientation {
        2 | 3 | 7 => -1.0,
        1 | 4 | 5 => 1.0,
        _ => 0.0,
    };
    let along_x = match orientation {
        1 | 2 | 6 => -1.0,
        3 | 4 | 8 => 1.0,
        _ => 0.0,
    };
    [along_z, along_x]
}
