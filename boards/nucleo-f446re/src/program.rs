//! What the start button runs: from where the machine stands to the program's start, then the program.
//!
//! Consumes the machine's position and the items in flash; offers both to the streams. Background.

use motion_kernel::program::{ProgramError, Reader, Supply, SupplyError};
use motion_kernel::queue::Feeder;
use motion_kernel::units::Position;

use crate::design_parameters::TICK_S;
use crate::machine::{AXES, Machine};
use crate::travel::{Travel, TravelError};

/// How fast the machine goes to the program's start, at most \[mm/s\]: slowly, it may come from anywhere.
const TO_START_MM_S: f64 = 20.0;

/// Why a run ends before its end.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(target_arch = "arm", derive(defmt::Format))]
pub enum RunError {
    /// On the way to the program's start.
    Travel(TravelError),
    /// In the program.
    Program(SupplyError<ProgramError>),
}

/// A run of the program and how much of it is in the streams.
#[derive(Debug)]
pub struct Run {
    to_start: Travel,
    program: Supply<f32, AXES, Reader<'static, AXES>, ProgramError>,
}

impl Run {
    /// A run on a machine that stands at `here`.
    ///
    /// # Errors
    /// The way to the start can't be planned.
    pub fn new(machine: &Machine, here: [Position; AXES]) -> Result<Self, RunError> {
        let header = machine.header();
        let feed_mm_s = TO_START_MM_S.min(header.rules.feed_mm_s);
        let to_start = Travel::new(header.rules.limits, here, header.start, feed_mm_s);
        Ok(Self {
            to_start: to_start.map_err(RunError::Travel)?,
            program: Supply::new(machine.program, TICK_S),
        })
    }

    /// Offers what is left to the streams until they are full; whether all of it has entered.
    ///
    /// # Errors
    /// An item can't be had or is refused. What has entered before it is in the streams.
    pub fn fill(&mut self, feeder: &mut Feeder<'_, f32, AXES>) -> Result<bool, RunError> {
        if !self.to_start.fill(feeder).map_err(RunError::Travel)? {
            return Ok(false);
        }
        self.program.fill(feeder).map_err(RunError::Program)?;
        Ok(self.program.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::{ExecState, Executor};
    use motion_kernel::queue::Streams;

    use super::*;
    use crate::machine::PROGRAM;

    /// Runs the program as the board does, one fill and one tick in turn, from each of two places: at its
    /// start, and where it ends. The ticks of each run and where it ended.
    fn two_runs() -> [(u32, [Position; AXES]); 2] {
        let machine = Machine::new(PROGRAM).expect("suits");
        let mut here = machine.header().start;
        let mut streams = Streams::<f32, AXES, 64, 64>::new();
        let (mut feeder, mut intake) = streams.split(machine.header().rules, here);
        let mut executor = Executor::new(here);
        core::array::from_fn(|_| {
            let mut run = Run::new(&machine, here).expect("plannable");
            for tick in 1..1_000_000 {
                let filled = run.fill(&mut feeder).expect("accepted");
                let executed = executor.tick(&mut intake).expect("no fault");
                if filled && executed.state == ExecState::Idle {
                    here = executed.setpoints.map(|setpoint| setpoint.position);
                    return (tick, here);
                }
            }
            panic!("it never ends");
        })
    }

    #[test]
    fn runs_the_stringer_and_again() {
        let [(first_ticks, first_end), (second_ticks, second_end)] = two_runs();
        // As `motion compile` prints: 2.320 s to (102.045923136, 0, 0).
        assert!(first_ticks.abs_diff(4640) <= 2, "{first_ticks}");
        let end = [102.045_923_136, 0.0, 0.0].map(|mm| Position::from_mm(mm).expect("in range"));
        assert_eq!((first_end, second_end), (end, end));
        // And back at 20 mm/s before the second: with a ramp's time 2·√(2·20/5000) s on top.
        let back_s = 102.045_923_136 / TO_START_MM_S + 2.0 * (2.0 * TO_START_MM_S / 5.0e3).sqrt();
        let expected = first_ticks + (back_s / TICK_S) as u32;
        assert!(second_ticks.abs_diff(expected) <= 4, "{second_ticks} {expected}");
    }
}
