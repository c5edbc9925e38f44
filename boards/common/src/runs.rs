//! The runs that the start button begins, under live control: a move from where the machine stands to the
//! program's start, then the program; again with every start.
//!
//! Consumes the machine's position, the items in flash and commands; keeps the streams filled. Background.

use core::task::Poll;

use motion_kernel::hal::OutputState;
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Real;
use motion_kernel::program::{Header, Item, Items, ProgramError, Reader, Source, SupplyError, Switching};
use motion_kernel::queue::LiveFeeder;
use motion_kernel::straight::{Straight, StraightError};
use motion_kernel::units::Position;

use crate::operator::Settings;

/// Greatest feed to the program's start \[mm/s\]: slow, because the machine may come from anywhere.
const TO_START_MM_S: f64 = 20.0;

/// The way from where the machine stands to a program's start.
///
/// # Errors
/// There is none.
pub fn to_start<const AXES: usize>(
    header: &Header<AXES>,
    here: [Position; AXES],
) -> Result<Straight<AXES>, StraightError> {
    let feed_mm_s = TO_START_MM_S.min(header.rules.feed_mm_s);
    Straight::new(here, header.start, header.pulse, header.rules.limits, [feed_mm_s; 2], header.tick_s)
}

/// The items of one run after the other; pending while no run is started.
#[derive(Debug)]
struct Runs<'a, const AXES: usize> {
    program: Reader<'a, AXES>,
    to_start: Option<Straight<AXES>>,
    items: Option<Items<'a, AXES>>,
}

impl<const AXES: usize> Source<AXES> for Runs<'_, AXES> {
    type Error = ProgramError;

    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, ProgramError>>> {
        if let Some(item) = self.to_start.as_mut().and_then(Iterator::next) {
            return Poll::Ready(Some(item.map_err(|never| match never {})));
        }
        match self.items.as_mut().and_then(Iterator::next) {
            Some(item) => Poll::Ready(Some(item)),
            None => Poll::Pending,
        }
    }
}

/// The program's runs, under live control, which knows `PLACES` blocks and as many ramps ahead.
pub struct Run<'a, R: Real, const AXES: usize, const PLACES: usize> {
    feeder: LiveFeeder<'a, R, AXES>,
    control: LiveControl<R, AXES, Switching<Runs<'a, AXES>>, ProgramError, PLACES>,
}

impl<'a, R: Real, const AXES: usize, const PLACES: usize> Run<'a, R, AXES, PLACES> {
    /// Begins without a run, with streams that were split where the machine stands, and with changes
    /// `leads` ahead.
    #[must_use]
    pub fn new(program: Reader<'a, AXES>, feeder: LiveFeeder<'a, R, AXES>, leads: Leads) -> Self {
        let header = program.header();
        let (pulse, tick_s) = (header.pulse, header.tick_s);
        let runs = Switching::new(Runs { program, to_start: None, items: None });
        Self { feeder, control: LiveControl::new(runs, pulse, tick_s, leads) }
    }

    /// Starts a run on a machine that stands at `here`, where the streams were split or the previous run
    /// ended.
    ///
    /// # Errors
    /// There is no way to the program's start.
    pub fn start(&mut self, here: [Position; AXES]) -> Result<(), StraightError> {
        let runs = self.control.source_mut().items_mut();
        runs.to_start = Some(to_start(runs.program.header(), here)?);
        runs.items = Some(runs.program.items());
        Ok(())
    }

    /// Feed hold: comes to rest on the path.
    pub fn hold(&mut self) {
        self.control.hold();
    }

    /// Resumes after a hold.
    pub fn resume(&mut self) {
        self.control.resume();
    }

    /// Whether it is held, or coming to rest for a hold.
    #[must_use]
    pub fn is_held(&mut self) -> bool {
        matches!(self.state(), State::Holding | State::Held)
    }

    /// Applies `settings` to this run and later ones.
    pub fn set(&mut self, settings: &Settings) {
        let set = self.control.set_override(settings.feed_override.share());
        debug_assert!(set.is_ok(), "an operator's range of overrides is within live control's");
        self.control.set_single_block(settings.is_single);
    }

    /// Reads and plans as far as there is room. Ticks come meanwhile: it may take many of them, unless
    /// `is_stop_asked` says that a hold waits ([`LiveControl::poll_unless`]).
    ///
    /// # Errors
    /// An item can't be executed; every later call returns the same error. The items entered before it end at
    /// rest ([`State::Failed`]).
    pub fn poll(&mut self, is_stop_asked: &dyn Fn() -> bool) -> Result<(), SupplyError<ProgramError>> {
        self.control.poll_unless(is_stop_asked, &mut self.feeder)
    }

    /// What the program switches outputs to now; see [`LiveControl::switch`].
    pub fn switch(&mut self) -> Option<OutputState> {
        self.control.switch(&self.feeder)
    }

    /// The state of live control; [`State::Waiting`] before, between and after runs.
    #[must_use]
    pub fn state(&mut self) -> State {
        match self.control.state(&self.feeder) {
            // Not at its end.
            State::Waiting if self.control.source_mut().due().is_some() => State::Running,
            state => state,
        }
    }

    /// Number of stops because the background was too slow.
    #[must_use]
    pub fn starvations(&self) -> u32 {
        self.control.starvations()
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::Executor;
    use motion_kernel::program::write;
    use motion_kernel::queue::{Intake, LiveStreams};

    use super::*;
    use crate::console::{FeedOverride, Step};
    use crate::fixture::{AXES, BOARD, POLL_TICKS_MAX, TICK_S, end, machine};

    type Run<'a> = super::Run<'a, f32, AXES, 64>;

    /// A board whose background polls every given number of ticks.
    struct TestBoard<'a> {
        run: Run<'a>,
        intake: Intake<'a, f32, AXES>,
        executor: Executor<f32, AXES>,
        here: [Position; AXES],
        poll_ticks: u32,
    }

    /// What `work` does with a board that stands at the program's start.
    fn on_a_board<T>(poll_ticks: u32, work: impl FnOnce(&mut TestBoard<'_>) -> T) -> T {
        let machine = machine();
        let here = machine.header().start;
        let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
        let (feeder, intake) = streams.split(machine.header().rules, here);
        let run = Run::new(machine.program, feeder, BOARD.leads);
        work(&mut TestBoard { run, intake, executor: Executor::new(here), here, poll_ticks })
    }

    impl TestBoard<'_> {
        /// The program from where the machine stands; before each tick `command` may say something. Its
        /// ticks, and where it ended.
        fn program(&mut self, command: &mut dyn FnMut(u32, &mut Run<'_>)) -> (u32, [Position; AXES]) {
            self.run.start(self.here).expect("a way");
            for tick in 0..1_000_000 {
                command(tick, &mut self.run);
                if tick % self.poll_ticks == 0 {
                    self.run.poll(&|| false).expect("accepted");
                    if self.run.state() == State::Waiting {
                        return (tick, self.here);
                    }
                }
                let executed = self.executor.tick(&mut self.intake).expect("no fault");
                self.here = executed.setpoints.map(|setpoint| setpoint.position);
            }
            panic!("it never ends");
        }
    }

    /// Runs the program as the board does, twice: from its start, and from where it ended. The ticks of each
    /// run, where it ended, and how often it had to stop for want of data.
    fn two_runs(
        poll_ticks: u32,
        mut command: impl FnMut(u32, &mut Run<'_>),
    ) -> ([(u32, [Position; AXES]); 2], u32) {
        on_a_board(poll_ticks, |board| {
            (core::array::from_fn(|_| board.program(&mut command)), board.run.starvations())
        })
    }

    /// It runs until the switch is made, and comes to its end after that.
    #[test]
    fn a_run_that_waits_for_a_switch_is_not_at_its_end() {
        let stringer = machine();
        let (header, on) = (*stringer.header(), OutputState { flood: true, ..OutputState::OFF });
        let mut bytes = Vec::new();
        write(&header, None, &[Item::Switch(on)], &mut bytes).expect("short");
        let program = Reader::new(bytes.leak()).expect("a program");
        let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
        let (feeder, _intake) = streams.split(header.rules, header.start);
        let mut run = Run::new(program, feeder, BOARD.leads);
        run.poll(&|| false).expect("nothing to do");
        assert_eq!((run.state(), run.switch()), (State::Waiting, None));
        run.start(header.start).expect("a way");
        run.poll(&|| false).expect("accepted");
        assert_eq!((run.state(), run.switch()), (State::Running, Some(on)));
        run.poll(&|| false).expect("nothing left");
        assert_eq!((run.state(), run.switch()), (State::Waiting, None));
    }

    /// As `motion compile` prints: 2.320 s to (102.045923136, 0, 0).
    const STRINGER_TICKS: u32 = 4330;
    /// And back at 20 mm/s before the second: with a ramp's time 2·√(2·20/5000) s on top.
    fn back_ticks() -> u32 {
        // Half an edge, and the pulse of jerk that makes the feed.
        let half_edge_s = 0.25 * core::f64::consts::PI * 5.0e3 / 4.0e5;
        let pulse_s = half_edge_s + (half_edge_s * half_edge_s + TO_START_MM_S / 5.0e3).sqrt();
        let back_s = end()[0].to_mm() / TO_START_MM_S + 2.0 * pulse_s;
        (back_s / TICK_S) as u32
    }

    #[test]
    fn runs_the_stringer_and_again() {
        let ([(first_ticks, first_end), (second_ticks, second_end)], starvations) = two_runs(1, |_, _| {});
        assert!(first_ticks.abs_diff(STRINGER_TICKS) <= 4, "{first_ticks}");
        assert_eq!((first_end, second_end), (end(), end()));
        let expected = first_ticks + back_ticks();
        assert!(second_ticks.abs_diff(expected) <= 4, "{second_ticks} {expected}");
        assert_eq!(starvations, 0);
    }

    /// Polls as seldom as the longest one would let them be: what is under way is no slower for it, only what
    /// begins.
    #[test]
    fn seldom_polls_cost_no_stop() {
        let (runs, starvations) = two_runs(POLL_TICKS_MAX, |_, _| {});
        let items = machine().program.items();
        let stretches = items.filter(|item| matches!(item, Ok(Item::EndOfStretch(_)))).count() as u32;
        let most_ticks = [STRINGER_TICKS, STRINGER_TICKS + back_ticks()];
        for (((ticks, at), most), ways) in runs.into_iter().zip(most_ticks).zip([0, 1]) {
            assert_eq!(at, end());
            // A poll for each stretch to begin after, and one to see the end in.
            assert!(ticks <= most + (stretches + ways + 1) * POLL_TICKS_MAX, "{ticks} {most}");
        }
        assert_eq!(starvations, 0);
    }

    /// The button every so many ticks of both runs, and as soon as it is at rest again.
    #[test]
    fn held_again_and_again_it_ends_where_it_should() {
        for (poll_ticks, every) in [1, POLL_TICKS_MAX]
            .into_iter()
            .flat_map(|poll| (100..3000).step_by(97).map(move |every| (poll, every)))
        {
            let mut held = 0;
            let (runs, starvations) = two_runs(poll_ticks, |tick, run| {
                if tick % every == every - 1 {
                    run.hold();
                }
                if run.state() == State::Held {
                    run.resume();
                    held += 1;
                }
            });
            assert_eq!(runs.map(|(_, at)| at), [end(); 2], "every {every}");
            assert!(runs[0].0 > STRINGER_TICKS && held > 2, "every {every}: {held}");
            assert_eq!(starvations, 0, "every {every}");
        }
    }

    /// Slower and faster again and again, on both runs: they end where they should, later or sooner.
    #[test]
    fn under_any_override_it_ends_where_it_should() {
        let [slower, faster] = [Step::Down, Step::Up].map(|step| {
            let mut settings = Settings::NONE;
            let (runs, starvations) = two_runs(1, |tick, run| {
                settings.feed_override = match tick % 1500 {
                    400..500 => settings.feed_override.after(step),
                    1400 => FeedOverride::NONE,
                    _ => settings.feed_override,
                };
                run.set(&settings);
            });
            assert_eq!(runs.map(|(_, at)| at), [end(); 2], "{step:?}");
            assert_eq!(starvations, 0);
            runs[0].0
        });
        // Curves and jerk limit most of it, so there is little to gain.
        assert!(slower > STRINGER_TICKS + 1000 && faster < STRINGER_TICKS - 40, "{slower} {faster}");
    }

    /// In single block it is held after every line of the program, the last one too, because more may come.
    /// Switched on between two runs it is held after the way to the start first.
    #[test]
    fn in_single_block_it_is_held_after_every_line() {
        let items = machine().program.items();
        let line_of = |item| match item {
            Ok(Item::Line { line, .. } | Item::Septic { line, .. }) => Some(line),
            _ => None,
        };
        let mut lines: Vec<u32> = items.filter_map(line_of).collect();
        lines.dedup();
        let single = Settings { is_single: true, ..Settings::NONE };
        // The ticks of a run in which it came to be held.
        let holds = |board: &mut TestBoard<'_>| {
            let (mut ticks_held, mut was_held) = (Vec::new(), false);
            let (_, at) = board.program(&mut |tick, run| {
                let is_held = run.state() == State::Held;
                if is_held && !was_held {
                    ticks_held.push(tick);
                }
                was_held = is_held;
                if is_held {
                    run.resume();
                }
            });
            assert_eq!(at, end());
            ticks_held
        };
        on_a_board(1, |board| {
            board.run.set(&single);
            assert_eq!(holds(board).len(), lines.len(), "{lines:?}");
            board.run.set(&Settings::NONE);
            assert!(holds(board).is_empty());
            board.run.set(&single);
            for _ in 0..3 {
                board.run.poll(&|| false).expect("nothing to do");
            }
            let held = holds(board);
            assert_eq!(held.len(), lines.len() + 1, "{held:?}");
            assert!(held[0] > back_ticks() / 2, "held before it was on its way: {held:?}");
        });
    }

    /// From one encoder count to the whole machine, longer than the streams hold, in any direction, at the
    /// feed there is.
    #[test]
    fn the_way_to_the_start_is_any() {
        let machine = machine();
        let rules = machine.header().rules;
        for mm in [0.0, 1e-4, 2e-4, 1e-3, 0.01, 1.0, 15.999, 16.0, 16.001, 100.0, 3000.0] {
            for direction in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.48, -0.64, 0.6]] {
                let here = direction.map(|part| Position::from_mm(part * mm).expect("in range"));
                let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
                let (feeder, mut intake) = streams.split(rules, here);
                let mut run = Run::new(machine.program, feeder, BOARD.leads);
                let mut executor = Executor::new(here);
                run.start(here).expect("a way");
                run.control.source_mut().items_mut().items = None;
                let (mut ticks, mut at) = (0_u32, here);
                loop {
                    run.poll(&|| false).expect("accepted");
                    if run.state() == State::Waiting {
                        break;
                    }
                    let executed = executor.tick(&mut intake).expect("no fault");
                    at = executed.setpoints.map(|setpoint| setpoint.position);
                    let length = |v: [f32; AXES]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
                    let feed = length(executed.setpoints.map(|setpoint| setpoint.velocity_mm_s));
                    assert!(f64::from(feed) <= TO_START_MM_S * (1.0 + 1e-6));
                    ticks += 1;
                    assert!(ticks < 1_000_000, "it never arrives");
                }
                assert_eq!(at, machine.header().start, "{mm} {direction:?}");
            }
        }
    }
}
