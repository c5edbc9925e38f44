//! Homing on the simulated machine: the reference from any start, every failure by its name and at rest, and motion after it.

use hal_sim::{EncoderNoise, HomeParameters, IndexParameters, SwitchParameters};
use motion_host::machine::{HomingSettings, Machine};
use motion_host::planning::Executable;
use motion_host::simulate::hardware::Simulated;
use motion_host::simulate::home::{HomeError, HomedAxis};
use motion_host::simulate::session::Session;
use motion_host::trace::TraceRow;
use motion_kernel::homing::{HomingConfig, HomingError};
use motion_kernel::jog::{Direction, Jog, JogAxis, JogTarget};
use motion_kernel::num::Fixed;
use motion_kernel::units::{Counts, Position};
use motion_tests::check::bench::mm;
use motion_tests::check::bounds::Number;
use motion_tests::check::planned;
use motion_tests::judge::Judge;
use motion_tests::random::Random;

const AXIS: usize = 0;
const MM_PER_COUNT: f64 = 1e-4;
/// A revolution.
const INDEX_MM: f64 = 10.0;

/// Where things are in the direction of homing, from where the axis stands when it is switched on.
#[derive(Clone, Copy, Debug)]
struct Place {
    direction: Direction,
    switch_mm: f64,
    switch_length_mm: f64,
    index_mm: f64,
}

impl Place {
    fn sign(&self) -> f64 {
        if self.direction == Direction::Positive { 1.0 } else { -1.0 }
    }

    fn simulated(&self) -> HomeParameters {
        let (near, far) =
            (self.sign() * self.switch_mm, self.sign() * (self.switch_mm + self.switch_length_mm));
        let counts = |mm: f64| (self.sign() * mm / MM_PER_COUNT).round() as i64;
        HomeParameters {
            switch: Some(SwitchParameters { closes_mm: (near.min(far), near.max(far)), hysteresis_mm: 0.2 }),
            index: Some(IndexParameters {
                counts: (INDEX_MM / MM_PER_COUNT) as i64,
                at: Counts(counts(self.index_mm)),
            }),
        }
    }
}

fn jog_axis(machine: &Machine) -> JogAxis {
    JogAxis {
        feed_mm_s: machine.path.feed_mm_s,
        limits: machine.path.limits(),
        pulse: machine.path.pulse,
        travel: None,
    }
}

fn config(direction: Direction, has_index: bool) -> HomingConfig {
    HomingConfig {
        direction,
        fast_mm_s: 40.0,
        slow_mm_s: 2.0,
        travel_mm: 300.0,
        back_off_mm: 80.0,
        index_mm: has_index.then_some(1.1 * INDEX_MM),
        position: mm(-250.0),
        park: Some(mm(0.0)),
    }
}

/// Judges every tick of a session: along the path within the limits and without a step, and no step in what the regulator
/// is given.
struct SessionJudge {
    path: Judge,
    before: Option<TraceRow>,
    wrong: Option<String>,
}

impl SessionJudge {
    fn new<R: Number>(machine: &Machine) -> Self {
        let rules = machine.rules();
        // On a plateau acceleration changes by all that jerk allows. Both accelerations of a step are rounded
        // by half of this.
        let rounding = R::RELATIVE * rules.limits.accel_mm_s2;
        Self { path: Judge::new(&rules, machine.tick_s, 1e-5, rounding), before: None, wrong: None }
    }

    fn tick(&mut self, row: &TraceRow) {
        let verdict = self.verdict(row);
        if let Err(wrong) = verdict {
            self.wrong.get_or_insert(format!("tick {}: {wrong}", row.tick));
        }
        self.before = Some(*row);
    }

    fn verdict(&self, row: &TraceRow) -> Result<(), String> {
        let along = |row: &TraceRow| [row.v_mm_s, row.a_mm_s2, row.j_mm_s3, row.snap_mm_s4];
        self.path.limits(&along(row))?;
        let Some(before) = &self.before else { return Ok(()) };
        self.path.feed(&along(before), &along(row))?;
        self.path.accel(&along(before), &along(row))?;
        for (now, before) in row.axes.iter().zip(&before.axes) {
            // A set position that gets another name is no step of the machine.
            let step_um = (now.err_um - before.err_um).abs();
            if step_um > 60.0 {
                return Err(format!("the following error steps by {step_um} µm"));
            }
        }
        Ok(())
    }
}

/// Homes an axis of the reference machine, and hands over the session.
fn homed<R: Number>(
    settings: HomingSettings,
    noise: Option<EncoderNoise>,
    behind: &mut dyn FnMut(&mut Session<'_, R>, &Simulated, &mut SessionJudge),
) -> Result<HomedAxis, HomingError> {
    let mut machine = Machine::reference();
    (machine.axes[AXIS].homing, machine.axes[AXIS].noise) = (Some(settings), noise);
    // Position set-points that are delayed get the new position, too.
    machine.axes[1].feedforward.lead_s = 12.0 * machine.tick_s;
    let simulated = Simulated::new(&machine.simulated()).expect("a machine");
    let mut session = Session::<R>::new(&machine, &simulated).expect("a session");
    let mut judge = SessionJudge::new::<R>(&machine);
    let homed = session.home(AXIS, &settings, &mut |row| judge.tick(row));
    let homed = homed.map_err(|error| match error {
        HomeError::Axis { source, .. } => source,
        other => panic!("{settings:?}: {other}"),
    });
    // What fails comes to rest first.
    let rest = judge.before.expect("a tick");
    assert_eq!(rest.v_mm_s, 0.0, "{settings:?}");
    if homed.is_ok() {
        behind(&mut session, &simulated, &mut judge);
    }
    assert_eq!(judge.wrong, None, "{settings:?}");
    homed
}

fn homed_in(seed: u64, settings: HomingSettings) -> Result<HomedAxis, HomingError> {
    match seed % 3 {
        0 => homed::<f32>(settings, None, &mut |_, _, _| {}),
        1 => homed::<f64>(settings, None, &mut |_, _, _| {}),
        _ => homed::<Fixed>(settings, None, &mut |_, _, _| {}),
    }
}

/// From anywhere before the switch and on it, in both directions.
fn places(seed: u64) -> impl Iterator<Item = Place> {
    let mut random = Random::new(seed);
    let direction = if random.chance(0.5) { Direction::Positive } else { Direction::Negative };
    // In machine positions, from the switch: the index follows after 3 mm.
    (0..).map(move |_| {
        let switch_mm =
            if random.chance(0.3) { -random.between(0.0, 30.0) } else { random.between(0.0, 150.0) };
        Place { direction, switch_mm, switch_length_mm: 35.0, index_mm: switch_mm + 3.0 }
    })
}

#[test]
fn with_an_index_it_is_the_same_count_from_anywhere() {
    let count = motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(40) as usize;
    for seed in 1..=2 {
        for (number, place) in places(seed).take(count / 2).enumerate() {
            let settings =
                HomingSettings { config: config(place.direction, true), simulated: place.simulated() };
            let found =
                homed_in(number as u64, settings).unwrap_or_else(|error| panic!("{place:?}: {error}"));
            let expected = (place.sign() * place.index_mm / MM_PER_COUNT).round() as i64;
            assert_eq!(found.homed.counts, Counts(expected), "{place:?}");
            let behind = place.sign() * found.homed.index_counts.expect("an index") as f64 * MM_PER_COUNT;
            assert!((2.99..=3.0001).contains(&behind), "{place:?}: {behind} mm behind the switch");
            // Parked at 0 by the position of the index; the regulator leaves less than 2 µm.
            let truth_mm = place.sign() * place.index_mm + 250.0;
            assert!((found.position_mm).abs() < 1e-6, "{place:?}: {}", found.position_mm);
            let true_mm = found.true_mm.expect("simulated");
            assert!((true_mm - truth_mm).abs() < 2e-3, "{place:?}: at {true_mm} for {truth_mm}");
        }
    }
}

/// The switch is seen once a tick: at the slow feed it is at most the travel of a tick later, and a count.
#[test]
fn with_a_switch_alone_it_is_as_good_as_a_tick() {
    let count = motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(40) as usize;
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for seed in 3..=4 {
        for (number, place) in places(seed).take(count / 2).enumerate() {
            let config = config(place.direction, false);
            let settings = HomingSettings { config, simulated: place.simulated() };
            let found =
                homed_in(number as u64, settings).unwrap_or_else(|error| panic!("{place:?}: {error}"));
            let late_mm = place.sign() * found.homed.counts.0 as f64 * MM_PER_COUNT - place.switch_mm;
            (least, most) = (least.min(late_mm), most.max(late_mm));
            // The drive follows the slow feed within a hundredth.
            let tick_mm = 1.01 * config.slow_mm_s * 5e-4;
            let count_mm = 0.5 * MM_PER_COUNT + 1e-9;
            assert!((-count_mm..=tick_mm + count_mm).contains(&late_mm), "{place:?}: {late_mm} mm late");
            assert_eq!(found.homed.index_counts, None);
        }
    }
    println!("the switch was seen {least} to {most} mm late");
}

/// Guards sample an axis every 24 ticks; whenever its position gets another name, none of them takes that for motion.
#[test]
fn a_reference_is_no_motion_for_the_guards() {
    for tick in 0..48_u32 {
        for direction in [Direction::Positive, Direction::Negative] {
            // At the slow feed the switch closes a tick later.
            let switch_mm = 20.0 + f64::from(tick) * 1e-3;
            let place = Place { direction, switch_mm, switch_length_mm: 35.0, index_mm: 23.0 };
            let settings = HomingSettings { config: config(direction, false), simulated: place.simulated() };
            let noise = EncoderNoise { amplitude_counts: 1, seed: tick.into() };
            let found = homed::<f32>(settings, Some(noise), &mut |_, _, _| {});
            assert!(found.is_ok(), "{place:?}: {found:?}");
        }
    }
}

#[test]
fn what_is_broken_is_named() {
    for direction in [Direction::Positive, Direction::Negative] {
        let place = Place { direction, switch_mm: 60.0, switch_length_mm: 35.0, index_mm: 63.0 };
        let good = place.simulated();
        let home = |config: HomingConfig, simulated: HomeParameters| {
            homed_in(1, HomingSettings { config, simulated }).map(|_| ()).map_err(|error| error.to_string())
        };
        let with_index = config(direction, true);
        assert_eq!(home(with_index, good), Ok(()));
        let no_switch = "no home switch within 300 mm: expected it to close there".to_owned();
        let dead = HomeParameters { switch: None, ..good };
        assert_eq!(home(with_index, dead), Err(no_switch.clone()));
        // The axis stands beyond it.
        let beyond = Place { switch_mm: -90.0, ..place };
        assert_eq!(home(with_index, beyond.simulated()), Err(no_switch));
        let stuck = Place { switch_mm: -200.0, switch_length_mm: 400.0, ..place };
        let expected = "home switch closed over 80 mm: expected it to open when backing off".to_owned();
        assert_eq!(home(with_index, stuck.simulated()), Err(expected));
        let no_index = "no index within 11 mm of the home switch: expected one a revolution".to_owned();
        assert_eq!(home(with_index, HomeParameters { index: None, ..good }), Err(no_index));
        let fast = HomingConfig { fast_mm_s: 300.1, ..with_index };
        assert_eq!(home(fast, good), Err("feed 300.1 mm/s: expected above 0, at most 300".to_owned()));
        // A switch that is shorter than the way to stop is passed, and found again on the way back.
        let short = Place { switch_length_mm: 1.0, ..place };
        assert_eq!(home(with_index, short.simulated()), Ok(()));
    }
}

/// Behind homing a program is driven, from the new position.
#[test]
fn programs_go_on_from_the_new_position() {
    fn driven<R: Number>(direction: Direction) {
        let place = Place { direction, switch_mm: 25.0, switch_length_mm: 35.0, index_mm: 28.5 };
        let settings = HomingSettings { config: config(direction, true), simulated: place.simulated() };
        homed::<R>(settings, None, &mut |session, simulated, judge| {
            assert_eq!(session.position(), [Position::ZERO; 3]);
            let origin_mm = simulated.truth()[AXIS].position_mm;
            let machine = Machine::reference();
            let text = "G61 G1 X20 Y5 F2400\nG4 P0.2\nG1 X-5\nG0 X7 Y0\n";
            let plan = planned(text, &machine).expect("a plan");
            let executable = Executable::new::<R>(&plan).expect("executable");
            for _ in 0..2 {
                session.run(executable.supplied(), &mut |row| judge.tick(row)).expect("a run");
                assert_eq!(session.position(), [7.0, 0.0, 0.0].map(mm));
                let moved_mm = simulated.truth()[AXIS].position_mm - origin_mm;
                assert!((moved_mm - 7.0).abs() < 0.01, "{moved_mm}");
                let back = JogTarget::By(mm(-7.0));
                let jog = Jog::new(&jog_axis(&machine), AXIS, session.position(), back, 30.0, machine.tick_s);
                session.run(jog.expect("a jog"), &mut |row| judge.tick(row)).expect("a run");
                assert_eq!(session.position(), [Position::ZERO; 3]);
            }
        })
        .unwrap_or_else(|error| panic!("{direction:?}: {error}"));
    }
    driven::<f32>(Direction::Negative);
    driven::<f64>(Direction::Positive);
    driven::<Fixed>(Direction::Negative);
}
