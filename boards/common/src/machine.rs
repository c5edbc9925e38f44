//! The machine that the board drives: the one its program was compiled for.
//!
//! Consumes a compiled program, which `motion compile` wrote with the machine's scales, gains, limits and
//! guards; produces the kernel's configuration, once, before the first tick. So there is one description of
//! the machine, its file on the PC, and here the board checks what only it can know. A program that is
//! damaged, does not suit the board, or contains an item that could not be executed is refused before
//! anything is enabled.

use motion_kernel::axis::{AxesConfig, AxesError};
use motion_kernel::hal::{BoardOutputs, OutputState, Spindle};
use motion_kernel::homing::HomingFigures;
use motion_kernel::num::Real;
use motion_kernel::program::{CheckError, Header, Item, ProgramError, Reader, check_live, switches_as_stops};

use crate::parameters::BoardParameters;

/// Why the board can't run a program.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MachineError {
    /// The bytes are no program for this board.
    Program(ProgramError),
    /// The program is for another tick \[s\].
    Tick {
        /// The program's.
        found: f64,
        /// The board's.
        expected: f64,
    },
    /// An axis would count faster than its input filter passes for certain.
    CountRate {
        /// The axis, from 0.
        axis: usize,
        /// The rate at twice the greatest feed \[1/s\], as a margin for motion beyond the set-point.
        counts_per_s: f64,
        /// The rate that passes \[1/s\].
        limit: f64,
    },
    /// It has no guards and reactions to faults.
    Unguarded,
    /// A figure of an axis is out of its range.
    Axes(AxesError),
    /// An item can't be executed, the program starts or ends where it can't, or it has no blocks for live
    /// control to plan with (`motion compile --live` writes them).
    Items(CheckError<ProgramError>),
    /// An item turns the spindle counter-clockwise, and there is one output for it. A machine file with `turns =
    /// "clockwise"` has the PC refuse such a program.
    Counterclockwise {
        /// The item, from 0.
        index: usize,
    },
    /// An item turns the spindle at another speed than an item before, and the board can't command a speed.
    SecondSpeed {
        /// The item, from 0.
        index: usize,
    },
    /// An item has a speed that is none: a number of 0 or more, 0 for a spindle that does not turn.
    Speed {
        /// The item, from 0.
        index: usize,
    },
    /// The program ends with spindle or coolant on.
    LeftOn,
}

/// A program that suits the board, and its machine.
#[derive(Clone, Copy, Debug)]
pub struct Machine<'a, R: Real, const AXES: usize> {
    /// All of the program's items.
    pub program: Reader<'a, AXES>,
    /// The kernel's axes.
    pub axes: AxesConfig<R, AXES>,
    /// How they are homed.
    pub homing: HomingFigures<AXES>,
}

impl<'a, R: Real, const AXES: usize> Machine<'a, R, AXES> {
    /// The machine of the program in `bytes`, on `board`.
    ///
    /// # Errors
    /// [`MachineError`].
    pub fn new(bytes: &'a [u8], board: &BoardParameters) -> Result<Self, MachineError> {
        let machine = Self::without_items(bytes, board)?;
        let program = &machine.program;
        let checked = match board.outputs {
            BoardOutputs::None => check_live::<R, AXES, _>(program.header(), program.items()),
            _ => check_live::<R, AXES, _>(program.header(), switches_as_stops(program.items())),
        };
        checked.map_err(MachineError::Items)?;
        check_switches(program, board.outputs)?;
        Ok(machine)
    }

    /// The machine alone, for a board whose items come over the link: what the program drives is not looked at.
    ///
    /// # Errors
    /// [`MachineError`].
    pub fn without_items(bytes: &'a [u8], board: &BoardParameters) -> Result<Self, MachineError> {
        let program = Reader::new(bytes).map_err(MachineError::Program)?;
        let Header { tick_s, rules, axes, .. } = program.header();
        // Compared to the bit: both are the same decimal, or they are different ticks.
        let expected = board.tick_s();
        if *tick_s != expected {
            return Err(MachineError::Tick { found: *tick_s, expected });
        }
        let limit = f64::from(board.counts_per_s_max);
        for (axis, figures) in axes.iter().enumerate() {
            let counts_per_s = 2.0 * rules.feed_mm_s / figures.mm_per_count.abs();
            if !(counts_per_s <= limit) {
                return Err(MachineError::CountRate { axis, counts_per_s, limit });
            }
        }
        let guards = program.guards().map_err(MachineError::Program)?.ok_or(MachineError::Unguarded)?;
        let axes = AxesConfig::new(axes, expected).and_then(|axes| axes.guarded(&guards, expected));
        let axes = axes.map_err(MachineError::Axes)?;
        let axes = if program.is_compensated() { compensated(axes, &program)? } else { axes };
        let homing = program.homing().map_err(MachineError::Program)?;
        Ok(Self { program, axes, homing })
    }

    /// The program's header: what it was planned for.
    #[must_use]
    pub fn header(&self) -> &Header<AXES> {
        self.program.header()
    }
}

/// The axes with what their machine's screws need. In its own stack frame: a table of each axis is there once more.
#[inline(never)]
fn compensated<R: Real, const AXES: usize>(
    axes: AxesConfig<R, AXES>,
    program: &Reader<'_, AXES>,
) -> Result<AxesConfig<R, AXES>, MachineError> {
    let compensation = program.compensation().map_err(MachineError::Program)?;
    axes.compensated(&compensation, program.header().tick_s).map_err(MachineError::Axes)
}

/// Whether the board can put out every state of spindle and coolant that the program asks for, the last of them off.
fn check_switches<const AXES: usize>(
    program: &Reader<'_, AXES>,
    outputs: BoardOutputs,
) -> Result<(), MachineError> {
    let (mut speed_rpm, mut last) = (None, OutputState::OFF);
    for (index, item) in program.items().enumerate() {
        let Ok(Item::Switch(to)) = item else { continue };
        if !(to.speed_rpm >= 0.0 && to.speed_rpm.is_finite()) || !to.spindle_turns() && to.speed_rpm != 0.0 {
            return Err(MachineError::Speed { index });
        }
        if outputs != BoardOutputs::CommandedSpeed && to.spindle_turns() {
            if to.spindle == Spindle::Counterclockwise {
                return Err(MachineError::Counterclockwise { index });
            }
            if *speed_rpm.get_or_insert(to.speed_rpm) != to.speed_rpm {
                return Err(MachineError::SecondSpeed { index });
            }
        }
        last = to;
    }
    if last == OutputState::OFF { Ok(()) } else { Err(MachineError::LeftOn) }
}

#[cfg(test)]
mod tests {
    use motion_kernel::axis::{AxisCompensation, Backlash, Compensation, GuardFigures, Guards, PitchError};
    use motion_kernel::program::{Item, SupplyError, write, write_compensated};
    use motion_kernel::units::Position;

    use super::*;
    use crate::fixture::{AXES, BOARD, Machine, PROGRAM, TICK_S, machine};

    fn guards() -> Guards<AXES> {
        machine().program.guards().expect("guards").expect("guarded")
    }

    fn of(
        header: &Header<AXES>,
        guards: Option<&Guards<AXES>>,
        items: &[Item<AXES>],
    ) -> Result<Machine<'static>, MachineError> {
        let mut bytes = Vec::new();
        write(header, guards, items, &mut bytes).expect("short");
        Machine::new(bytes.leak(), &BOARD)
    }

    /// The machine of the program with a changed header.
    fn with(change: impl Fn(&mut Header<AXES>)) -> Result<Machine<'static>, MachineError> {
        let mut header = *machine().header();
        change(&mut header);
        of(&header, Some(&guards()), &[])
    }

    /// Its axes are guarded as the machine's file says, and its faults end so.
    #[test]
    fn the_program_in_flash_suits() {
        let machine = machine();
        let axes = AxesConfig::<f32, AXES>::new(&machine.header().axes, TICK_S).expect("axes");
        assert_ne!(machine.axes, axes);
        assert_eq!(machine.axes, axes.guarded(&guards(), TICK_S).expect("guarded"));
        assert!(guards().axes.iter().all(Option::is_some));
        // 0.1 s.
        assert_eq!(guards().reactions.ramp_ticks, 200);
    }

    /// As the PC has it; too steep a table is refused like any figure.
    #[test]
    fn compensation_is_that_of_the_program() {
        let header = *machine().header();
        let of = |spacing_mm: f64| {
            let pitch_error = PitchError::new(0.0, spacing_mm, &[0.0, 10.0, -10.0], true);
            let backlash = Some(Backlash { play_mm: 0.02, take_up_s: 0.006 });
            let axes = [None, Some(AxisCompensation { backlash, pitch_error }), None];
            (Compensation { axes }, HomingFigures { axes: [None; AXES] })
        };
        let read = |spacing_mm: f64| {
            let (mut bytes, (compensation, homing)) = (Vec::new(), of(spacing_mm));
            write_compensated(&header, &guards(), &homing, &compensation, &[], &mut bytes).expect("short");
            Machine::without_items(bytes.leak(), &BOARD).map(|machine| machine.axes)
        };
        let expected = machine().axes.compensated(&of(1.25).0, TICK_S).expect("compensated");
        assert_ne!(expected, machine().axes);
        assert_eq!(read(1.25), Ok(expected));
        assert!(matches!(read(0.5), Err(MachineError::Axes(AxesError { axis: 1, .. }))));
    }

    #[test]
    fn guards_that_are_not_there_or_none_are_refused() {
        let header = *machine().header();
        assert_eq!(of(&header, None, &[]).map(|_| ()), Err(MachineError::Unguarded));
        let mut none = guards();
        none.axes[2] = none.axes[2].map(|figures| GuardFigures { jump_mm: 0.0, ..figures });
        let refused = of(&header, Some(&none), &[]).map(|_| ());
        assert!(matches!(refused, Err(MachineError::Axes(AxesError { axis: 2, .. }))), "{refused:?}");
    }

    /// Spindle and coolant switch, between stretches; nothing here turns the other way round.
    #[test]
    fn a_program_may_switch_outputs_at_rest() {
        let header = *machine().header();
        let stringer: Vec<Item<AXES>> =
            machine().program.items().map(|item| item.expect("an item")).collect();
        let on = OutputState { spindle: Spindle::Clockwise, ..OutputState::OFF };
        let with = |at: usize, to: OutputState| {
            let mut items = stringer.clone();
            items.insert(at, Item::Switch(to));
            of(&header, Some(&guards()), &items).map(|_| ())
        };
        assert_eq!(with(0, on), Err(MachineError::LeftOn));
        assert_eq!(with(0, OutputState::OFF), Ok(()));
        let speeds = |speeds: &[f64]| {
            let states = speeds.iter().map(|&speed_rpm| OutputState { speed_rpm, ..on });
            let items: Vec<Item<AXES>> = states.chain([OutputState::OFF]).map(Item::Switch).collect();
            of(&header, Some(&guards()), &[items, stringer.clone()].concat()).map(|_| ())
        };
        assert_eq!(speeds(&[9000.0, 9000.0]), Ok(()));
        assert_eq!(speeds(&[9000.0, 12_000.0]), Err(MachineError::SecondSpeed { index: 1 }));
        for none in [f64::NAN, -1.0, f64::INFINITY] {
            assert_eq!(speeds(&[none]), Err(MachineError::Speed { index: 0 }));
        }
        let without = BoardParameters { outputs: BoardOutputs::None, ..BOARD };
        let mut bytes = Vec::new();
        write(&header, Some(&guards()), &[Item::Switch(OutputState::OFF)], &mut bytes).expect("short");
        let refused = crate::fixture::Machine::new(bytes.leak(), &without).map(|_| ());
        assert!(matches!(refused, Err(MachineError::Items(_))), "{refused:?}");
        let within = with(stringer.len() - 1, on);
        assert!(matches!(within, Err(MachineError::Items(CheckError::Item { .. }))), "{within:?}");
        let reverse = OutputState { spindle: Spindle::Counterclockwise, ..on };
        assert_eq!(with(0, reverse), Err(MachineError::Counterclockwise { index: 0 }));
    }

    /// The last item but one is damaged, with a right checksum: nothing of the program starts.
    #[test]
    fn an_item_that_cannot_be_executed_is_found_before_the_start() {
        let good = machine().program;
        let header = *good.header();
        let mut items: Vec<Item<AXES>> = good.items().map(|item| item.expect("an item")).collect();
        let at = items.iter().rposition(|item| matches!(item, Item::Line { .. })).expect("a line");
        if let Item::Line { direction, .. } = &mut items[at] {
            direction[0] = f64::NAN;
        }
        let refused = of(&header, Some(&guards()), &items).map(|_| ());
        assert!(
            matches!(refused, Err(MachineError::Items(CheckError::Item { index, cause: SupplyError::Piece(_) }))
                if index as usize == at),
            "{refused:?}"
        );
        let far = with(|header| header.start[1] = Position::from_bits(i64::MAX)).map(|_| ());
        assert!(matches!(far, Err(MachineError::Items(CheckError::Start { axis: 1, .. }))), "{far:?}");
    }

    /// Without any of its blocks, without its last one, with one that is longer, and with one after its end.
    #[test]
    fn a_program_that_does_not_hold_its_feed_is_refused() {
        let good = machine().program;
        let items: Vec<Item<AXES>> = good.items().map(|item| item.expect("an item")).collect();
        let is_block = |item: &Item<AXES>| matches!(item, Item::Block(_));
        let last = items.iter().rposition(is_block).expect("blocks");
        let mut longer = items.clone();
        if let Item::Block(block) = &mut longer[last] {
            block.length = block.length + Position::from_bits(1);
        }
        let without: Vec<_> = items.iter().filter(|item| !is_block(item)).copied().collect();
        let but_last = [&items[..last], &items[last + 1..]].concat();
        let behind = [&items[..], &[items[last]]].concat();
        assert!(of(good.header(), Some(&guards()), &items).is_ok());
        for items in [without, but_last, longer, behind] {
            let refused = of(good.header(), Some(&guards()), &items).map(|_| ());
            let is_found = matches!(refused, Err(MachineError::Items(CheckError::NotHeld { .. })));
            assert!(is_found, "{refused:?}");
        }
    }

    #[test]
    fn others_are_refused() {
        let slow = with(|header| header.tick_s = 0.001).map(|_| ());
        assert_eq!(slow, Err(MachineError::Tick { found: 0.001, expected: TICK_S }));
        let fine = with(|header| header.axes[1].mm_per_count = -5e-5).map(|_| ());
        let expected = MachineError::CountRate { axis: 1, counts_per_s: 1.2e7, limit: 6e6 };
        assert_eq!(fine, Err(expected));
        let still = with(|header| header.axes[2].mm_s_at_10_v = 0.0).map(|_| ());
        assert!(matches!(still, Err(MachineError::Axes(_))));
        assert!(matches!(Machine::new(&PROGRAM[1..], &BOARD), Err(MachineError::Program(_))));
    }
}
