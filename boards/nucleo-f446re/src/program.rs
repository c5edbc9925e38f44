//! What the start button runs: from where the machine stands to the program's start, then the program.
//!
//! Consumes the machine's position; offers items to the streams. The program is out and back on X, planned
//! on the board. Background.

use motion_kernel::queue::Feeder;
use motion_kernel::units::Position;

use crate::machine::AXES;
use crate::travel::{Travel, TravelError};

/// Where the program begins: where the machine stands when the board starts is called that.
pub const START: [Position; AXES] = [Position::ZERO; AXES];
/// How fast the machine goes to the start \[mm/s\]: slowly, it may come from anywhere.
const TO_START_MM_S: f64 = 10.0;
/// Out and back: length on X \[mm\].
const WAY_MM: f64 = 20.0;
/// And feed \[mm/s\].
const FEED_MM_S: f64 = 50.0;

/// A run of the program and how much of it is in the streams.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    travels: [Travel; 3],
}

impl Program {
    /// The program for a machine that stands at `here`.
    ///
    /// # Errors
    /// A move can't be planned.
    pub fn new(here: [Position; AXES]) -> Result<Self, TravelError> {
        let [x, y, z] = START;
        let out = [x + Position::from_mm(WAY_MM).ok_or(TravelError::Length(WAY_MM))?, y, z];
        Ok(Self {
            travels: [
                Travel::new(0, here, START, TO_START_MM_S)?,
                Travel::new(1, START, out, FEED_MM_S)?,
                Travel::new(2, out, START, FEED_MM_S)?,
            ],
        })
    }

    /// Where the machine stands after it.
    #[must_use]
    pub fn end(&self) -> [Position; AXES] {
        let [.., last] = &self.travels;
        last.end()
    }

    /// Offers what is left to the streams until they are full; whether all of it has entered.
    ///
    /// # Errors
    /// The streams refuse an item.
    pub fn fill(&mut self, feeder: &mut Feeder<'_, f32, AXES>) -> Result<bool, TravelError> {
        for travel in &mut self.travels {
            if !travel.fill(feeder)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::{ExecState, Executor};
    use motion_kernel::queue::Streams;

    use super::*;
    use crate::machine::RULES;

    #[test]
    fn runs_twice_and_returns_to_its_start() {
        let mut here = [0.01, -3.0, 0.5].map(|mm| Position::from_mm(mm).expect("in range"));
        let mut streams = Streams::<f32, AXES, 64, 64>::new();
        let (mut feeder, mut intake) = streams.split(RULES, here);
        let mut executor = Executor::new(here);
        for _ in 0..2 {
            let mut program = Program::new(here).expect("plannable");
            let mut farthest = Position::ZERO;
            for tick in 0.. {
                assert!(tick < 1_000_000, "it never arrives");
                let filled = program.fill(&mut feeder).expect("accepted");
                let executed = executor.tick(&mut intake).expect("no fault");
                let [x, ..] = executed.setpoints;
                farthest = farthest.max(x.position);
                if filled && executed.state == ExecState::Idle {
                    break;
                }
            }
            assert_eq!(farthest.to_mm(), WAY_MM);
            here = program.end();
            assert_eq!(here, START);
        }
    }
}
