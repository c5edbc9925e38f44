//! A recorded run replays to the bit: whatever the program, the commands, the number type, and what failed on the way.

use motion_host::planning::{Mode, Plan};
use motion_host::recording::{Recorder, Recording, replay};
use motion_host::simulate::inject::Injections;
use motion_host::simulate::live::Script;
use motion_host::simulate::{self, Hardware, Job, Number, RunOptions, RunSummary, StretchCorrection};
use motion_host::trace::TraceRow;
use motion_kernel::hal::{
    AxisInputs, DriveEnable, Encoder, Inputs, MachineInputs, OutputState, Outputs, VelocityChannel,
};
use motion_kernel::num::Scalar;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};
use motion_tests::check::totals::Totals;
use motion_tests::check::{drive, machine, program};
use motion_tests::random::Random;

/// Axes of the machine.
const AXES: usize = 3;

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Breakage {
    /// The encoders can't be read, from a tick on or in that tick alone.
    Encoders { for_good: bool },
    /// One encoder jumps.
    Jump { axis: usize, counts: i64 },
    /// The digital inputs can't be read.
    Inputs,
    /// They report something.
    Reports(MachineInputs<AXES>),
    /// The converter's bus.
    Bus,
    /// The drives' enable, at the first tick of all.
    Enable,
}

/// Hardware that breaks before the tick `at`.
struct Breaking<'a, H> {
    hardware: &'a mut H,
    breakage: Option<Breakage>,
    at: u64,
    tick: u64,
}

impl<H> Breaking<'_, H> {
    fn now(&self) -> Option<Breakage> {
        self.breakage.filter(|_| self.tick >= self.at)
    }
}

struct Broken;

impl<H: Hardware> Hardware for Breaking<'_, H> {
    fn start_counts(&mut self) -> [Counts; AXES] {
        self.hardware.start_counts()
    }

    fn advance<R: Scalar>(&mut self, trace: &Trace<R, AXES>) -> bool {
        self.tick += 1;
        self.hardware.advance(trace)
    }
}

impl<H: Hardware> Outputs for Breaking<'_, H> {
    fn switch(&mut self, to: &OutputState) {
        self.hardware.switch(to);
    }
}

impl<H: Hardware> Encoder<AXES> for Breaking<'_, H> {
    type Error = Broken;
    fn latch(&mut self) -> Result<[Counts; AXES], Broken> {
        let mut counts = self.hardware.latch().map_err(|_| Broken)?;
        match self.now() {
            Some(Breakage::Encoders { for_good }) if for_good || self.tick == self.at => Err(Broken),
            Some(Breakage::Jump { axis, counts: jump }) => {
                counts[axis].0 += jump;
                Ok(counts)
            }
            _ => Ok(counts),
        }
    }
}

impl<H: Hardware> Inputs<AXES> for Breaking<'_, H> {
    type Error = Broken;
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Broken> {
        match self.now() {
            Some(Breakage::Inputs) => Err(Broken),
            Some(Breakage::Reports(inputs)) => Ok(inputs),
            _ => self.hardware.read_inputs().map_err(|_| Broken),
        }
    }
}

impl<H: Hardware> VelocityChannel<AXES> for Breaking<'_, H> {
    type Error = Broken;
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Broken> {
        if self.now() == Some(Breakage::Bus) {
            Err(Broken)
        } else {
            self.hardware.write(codes).map_err(|_| Broken)
        }
    }
}

impl<H: Hardware> DriveEnable<AXES> for Breaking<'_, H> {
    type Error = Broken;
    fn set_enabled(&mut self, enabled: bool) -> Result<(), Broken> {
        if self.breakage == Some(Breakage::Enable) {
            return Err(Broken);
        }
        self.hardware.set_enabled(enabled).map_err(|_| Broken)
    }
}

/// Commands before random ticks.
fn script(random: &mut Random, ticks: u64) -> Script {
    let mut at: Vec<u64> = (0..1 + random.below(12)).map(|_| random.bits() % ticks.max(1)).collect();
    at.sort_unstable();
    let command = |random: &mut Random| match random.below(9) {
        0 | 1 => "hold".to_owned(),
        2..=4 => "resume".to_owned(),
        8 => if random.chance(0.5) { "single" } else { "continuous" }.to_owned(),
        5 if random.chance(0.2) => "abort".to_owned(),
        6 if random.chance(0.2) => "override=0".to_owned(),
        _ => format!("override={}", random.between(0.1, 2.0)),
    };
    let text: Vec<String> = at.iter().map(|tick| format!("{tick}:{}", command(random))).collect();
    // Whatever was held continues in the end.
    let last = 2 * ticks;
    format!("{},{last}:override=1,{last}:continuous,{last}:resume", text.join(",")).parse().expect("a script")
}

/// A run as far as anybody can see it.
#[derive(Debug, PartialEq)]
struct Observed {
    ticks: Vec<String>,
    summary: String,
}

fn observed(ticks: Vec<String>, summary: &RunSummary) -> Observed {
    Observed { ticks, summary: format!("{summary:?}") }
}

fn words(tick: &TraceRow) -> String {
    format!("{tick:?}")
}

/// Records a random run, sends it through bytes and replays it.
fn record_and_replay(seed: u64) -> Option<(Recording, Option<String>)> {
    let mut random = Random::new(seed);
    let machine = machine::gentle(&mut random);
    let fragments = 1 + random.below(6);
    let program = program::generate(&mut random, fragments, machine.path.feed_mm_s);
    let plan: Plan =
        drive::plan(&program.text, &machine, Mode::Spanning, &mut Totals::default()).expect("a program")?;
    let ticks = (plan.time_s / machine.tick_s) as u64;
    if ticks > 6000 {
        return None;
    }
    let number = [Number::F32, Number::F64, Number::Fixed][random.below(3)];
    let script = random.chance(0.7).then(|| script(&mut random, ticks));
    // A learnt correction is for runs without live control.
    let correction = (script.is_none() && random.chance(0.5)).then(|| StretchCorrection {
        stretch: 0,
        knot_ticks: 20,
        knots_mm_s: (0..8).map(|_| [0; AXES].map(|_| random.between(-0.5, 0.5))).collect(),
        bound_mm_s: 1.0,
    });
    let breakage = match random.below(10) {
        0 => Some(Breakage::Encoders { for_good: false }),
        1 => Some(Breakage::Encoders { for_good: true }),
        2 => Some(Breakage::Jump { axis: random.below(AXES), counts: 20_000 }),
        3 => Some(Breakage::Bus),
        4 => Some(Breakage::Enable),
        5 => Some(Breakage::Inputs),
        6 => {
            let mut inputs = MachineInputs { emergency_stop: random.chance(0.5), ..MachineInputs::HEALTHY };
            inputs.axes[random.below(AXES)] = AxisInputs::HEALTHY.with_fault(true).with_home(true);
            Some(Breakage::Reports(inputs))
        }
        _ => None,
    };
    let at = random.bits() % (ticks + 1);
    // As `motion run --inject` breaks it: what the hardware answers then is in the recording, not why.
    let injections = (breakage.is_none() && random.chance(0.5)).then(|| {
        let axis = ["X", "Y", "Z"][random.below(AXES)];
        let injected = match random.below(10) {
            0 => format!("{at}:encoder-lost={axis}"),
            1 => format!("{at}:encoder-jump={axis}:-5000"),
            2 => format!("{at}:encoder-reversed={axis}"),
            3 => format!("{at}:drive-reversed={axis}"),
            4 => format!("{at}:overload={axis}:5"),
            5 => format!("{at}:drive-not-ready={axis}"),
            6 => format!("{at}:drive-fault={axis}"),
            7 => format!("{at}:limit-low={axis}:1000"),
            8 => format!("{at}:limit-high={axis}:-1000"),
            _ => format!("{at}:emergency-stop,{}:drive-fault={axis}", at + 30),
        };
        injected.parse::<Injections>().expect("injections")
    });
    let options = RunOptions {
        number,
        correction: correction.as_ref(),
        script: script.as_ref(),
        injections: injections.as_ref(),
        is_unguarded: random.chance(0.2),
    };
    let job = Job::new(&options, &plan, &machine).expect("a job");
    let mut ticks = Vec::new();
    let (summary, recording) = simulate::on_simulated(&machine, injections.as_ref(), |hardware| {
        let mut breaking = Breaking { hardware, breakage, at, tick: 0 };
        let mut recorder = Recorder::new(&mut breaking);
        let summary = simulate::run_on(&job, &mut recorder, &mut |tick| ticks.push(words(tick)))?;
        Ok((summary, recorder.finish(&job)))
    })
    .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let recorded = observed(ticks, &summary);

    let bytes = recording.to_bytes();
    let read = Recording::<AXES>::from_bytes(&bytes).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    assert_eq!(read, recording, "seed {seed}");
    let job = read.job();
    let mut ticks = Vec::new();
    let again = replay(&read, job, &mut |tick| ticks.push(words(tick))).expect("a replay");
    assert_eq!(again.difference, None, "seed {seed}");
    assert_eq!(again.ticks, recording.ticks(), "seed {seed}");
    assert!(observed(ticks, &again.summary) == recorded, "seed {seed}: the ticks or the summary differ");
    let fault = summary.faults.first().map(|fault| fault.fault.clone());
    // What is broken shows, unless the run ended before.
    if breakage.is_some() && at + 1 < summary.ticks {
        assert!(fault.is_some(), "seed {seed}: {breakage:?} at {at}");
    }
    Some((recording, fault))
}

#[test]
fn a_recorded_run_replays_to_the_bit() {
    let first = motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(1);
    let programs = motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(250);
    let (mut runs, mut ticks, mut bytes) = (0, 0, 0);
    let mut faults = std::collections::BTreeMap::<String, u32>::new();
    for seed in first..first + programs {
        let Some((recording, fault)) = record_and_replay(seed) else { continue };
        (runs, ticks, bytes) = (runs + 1, ticks + recording.ticks(), bytes + recording.to_bytes().len());
        *faults.entry(fault.unwrap_or_else(|| "none".to_owned())).or_default() += 1;
    }
    println!("{runs} runs, {ticks} ticks, {bytes} bytes; faults: {faults:?}");
    if programs >= 250 {
        assert!(runs > 50, "{runs}");
        let expected = [
            "none",
            "encoder",
            "inputs",
            "output",
            "enable",
            "encoder jump",
            "encoder lost",
            "runaway",
            "drive",
            "drive not ready",
            "limit switch",
            "emergency stop",
        ];
        for fault in expected {
            assert!(faults.contains_key(fault), "{fault} is not among {faults:?}");
        }
    }
}

/// Every bit of a recording, and every shorter one.
#[test]
fn whatever_is_damaged_is_noticed() {
    let bytes = (1..)
        .filter_map(|seed| record_and_replay(seed).map(|(recording, _)| recording.to_bytes()))
        .find(|bytes| bytes.len() < 20_000)
        .expect("a short one");
    for bit in 0..8 * bytes.len() {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(Recording::<AXES>::from_bytes(&damaged).is_err(), "bit {bit}");
    }
    for length in 0..bytes.len() {
        assert!(Recording::<AXES>::from_bytes(&bytes[..length]).is_err(), "{length} bytes");
    }
    assert!(Recording::<AXES>::from_bytes(&bytes).is_ok());
}
