//! Random servo axes, and what identification says of them against what they are.
//!
//! Every parameter varies at once, far beyond those of the published machine: gains, lags, dead times, command
//! filters, friction, load, beds, encoders with noise. A seed is a drive, everywhere.

use hal_sim::{
    AxisParameters, BedMode, DriveParameters, EncoderNoise, EncoderParameters, REFERENCE_ENCODER,
    REFERENCE_MM_S_PER_VOLT, REFERENCE_SUBSTEPS, REFERENCE_TICK_S, SimAxis,
};
use motion_host::drive::DriveError;
use motion_host::drive::circle::{CircleFigures, figures};
use motion_host::drive::verification::{Verdict, bears_mm_s2, circle};
use motion_host::gcode::Plane;
use motion_host::identify::{AxisParametersFound, AxisRecording, Estimate, Excitation, Identification};
use motion_host::machine::Machine;
use motion_host::tuning::{AxisTuning, Margins, Method, identify_to_tune, propose};
use motion_kernel::units::DacCode;

use crate::random::Random;

/// Cells for the dead time: 12 ms at the reference's sub-steps.
const LINE: usize = 512;

/// What the drives reach through their converters \[mm/s\].
const FASTEST_MM_S: f64 = 10.0 * REFERENCE_MM_S_PER_VOLT;

/// Half-widths that nothing may be off by.
pub const HALF_WIDTHS_MAX: f64 = 4.0;
/// The mass ratio up to which a bed may be missed: it moves the axis by less than recordings tell.
pub const MISSED_RATIO_MAX: f64 = 0.035;
/// What a command filter trades with. An interval that spans a filter that is not seen always holds the delays of a drive that has none.
const DELAYS: [&str; 3] = ["dead_time_s", "command_filter_s", "total_delay_s"];
/// What margins may be off by, as a part of the true ones.
pub const MARGINS_OFF_MAX: f64 = 0.02;

/// An axis that was drawn.
#[derive(Clone, Copy, Debug)]
pub struct RandomAxis {
    /// The seed it was drawn with.
    pub seed: u64,
    /// Drive and mechanics.
    pub drive: DriveParameters,
    /// Travel per count, and noise.
    pub encoder: EncoderParameters,
    /// Where it stands at the start \[mm\]: not on a count.
    pub start_mm: f64,
}

impl RandomAxis {
    /// The axis of a seed.
    ///
    /// Velocity loops are those that somebody would have let run: with Kv·Ti ≥ 1.5 they are damped by 0.6, and
    /// with Kv·Tc ≤ 0.5 the current loop is faster.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let load_inertia_ratio = if random.chance(0.5) { 0.0 } else { random.between(0.0, 3.0) };
        let inertia = 1.0 + load_inertia_ratio;
        let gain_per_s = random.log(60.0, 1000.0);
        let accel_limit_mm_s2 = random.log(3000.0, 30_000.0);
        let moved_per_s = gain_per_s / inertia;
        let command_filter_s = if random.chance(0.5) { 0.0 } else { random.log(1e-4, 4e-3) };
        let bed = random.chance(0.5).then(|| BedMode {
            frequency_hz: random.log(5.0, 120.0),
            damping_ratio: random.log(0.005, 0.1),
            mass_ratio: random.log(0.01, 0.3),
        });
        let drive = DriveParameters {
            velocity_gain_per_s: gain_per_s,
            integral_time_s: random.log((1.5 / moved_per_s).max(5e-3), 0.5),
            current_lag_s: random.log(1e-4, (0.5 / moved_per_s).clamp(2e-4, 2e-3)),
            dead_time_s: random.between(0.0, 4e-3),
            command_filter_s,
            accel_limit_mm_s2,
            load_inertia_ratio,
            coulomb_friction_mm_s2: random.log(8.5, 2550.0_f64.min(0.5 * accel_limit_mm_s2)),
            viscous_friction_per_s: random.log(0.01, 3.0),
            bed,
        };
        let noise = random
            .chance(0.5)
            .then(|| EncoderNoise { amplitude_counts: 1 + random.below(2) as u16, seed: random.bits() });
        let encoder = EncoderParameters { resolution_mm: random.log(1e-4, 5e-3), noise, ..REFERENCE_ENCODER };
        Self { seed, drive, encoder, start_mm: random.between(10.0, 11.0) }
    }

    /// The axis from rest, in open loop, through a converter of 16 bits.
    ///
    /// # Panics
    /// The axis can't be simulated, which is the generator's error.
    #[must_use]
    pub fn record(&self, excitation: &Excitation, run: u64) -> AxisRecording {
        let noise = self.encoder.noise.map(|noise| EncoderNoise { seed: noise.seed ^ run, ..noise });
        let start_position_mm = self.start_mm + 0.012_345 * run as f64;
        let parameters = AxisParameters {
            drive: self.drive,
            encoder: EncoderParameters { noise, ..self.encoder },
            start_position_mm,
            ..AxisParameters::REFERENCE_X
        };
        let mut axis = SimAxis::<LINE>::new(parameters, REFERENCE_TICK_S, REFERENCE_SUBSTEPS)
            .unwrap_or_else(|error| panic!("seed {}: {error}", self.seed));
        let mut recording = AxisRecording {
            tick_s: REFERENCE_TICK_S,
            harmonic_hz: excitation.harmonic_hz(),
            ..Default::default()
        };
        for velocity_mm_s in excitation.velocity_mm_s(REFERENCE_TICK_S) {
            let code = DacCode::from_volts(velocity_mm_s / REFERENCE_MM_S_PER_VOLT);
            recording.actual_mm.push(axis.latch().0 as f64 * self.encoder.resolution_mm);
            recording.command_mm_s.push(code.to_volts() * REFERENCE_MM_S_PER_VOLT);
            axis.advance(code.to_volts(), true);
        }
        recording
    }
}

/// A parameter's true value and what was found.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    /// The parameter's key in `found`.
    pub name: &'static str,
    /// What it is.
    pub truth: f64,
    /// What was found.
    pub found: Estimate,
}

impl Compared {
    /// |found − true| in half-widths of the interval.
    #[must_use]
    pub fn half_widths_off(&self) -> f64 {
        (self.found.value - self.truth).abs() / self.found.half_width_95
    }

    /// |found − true| as a part of what is true. What is infinite in both is not off.
    #[must_use]
    pub fn part_off(&self) -> f64 {
        if self.found.value.total_cmp(&self.truth).is_eq() {
            0.0
        } else {
            (self.found.value / self.truth - 1.0).abs()
        }
    }

    fn words(&self) -> String {
        let (name, off, Estimate { value, half_width_95 }) = (self.name, self.half_widths_off(), self.found);
        format!(
            "{name} off by {off:.1} half-widths: {value:.5e} ± {half_width_95:.1e}, is {:.5e}",
            self.truth
        )
    }
}

/// Every parameter that was found, per unit of the inertia moved; those of the bed if there is one and one
/// was found.
#[must_use]
pub fn compared(axis: &RandomAxis, found: &AxisParametersFound) -> Vec<Compared> {
    let drive = &axis.drive;
    let inertia = 1.0 + drive.load_inertia_ratio;
    let delay_s = drive.dead_time_s + drive.command_filter_s + drive.current_lag_s + 0.5 * REFERENCE_TICK_S;
    let of = |name, truth, found| Compared { name, truth, found };
    let mut all = vec![
        of("command_gain", 1.0, found.command_gain),
        of("command_offset_mm_s", 0.0, found.command_offset_mm_s),
        of("velocity_gain_per_s", drive.velocity_gain_per_s / inertia, found.velocity_gain_per_s),
        of("integral_time_s", drive.integral_time_s, found.integral_time_s),
        of("dead_time_s", drive.dead_time_s, found.dead_time_s),
        of("current_lag_s", drive.current_lag_s, found.current_lag_s),
        of("command_filter_s", drive.command_filter_s, found.command_filter_s),
        of("total_delay_s", delay_s, found.total_delay_s),
        of("accel_limit_mm_s2", drive.accel_limit_mm_s2 / inertia, found.accel_limit_mm_s2),
        of("coulomb_friction_mm_s2", drive.coulomb_friction_mm_s2 / inertia, found.coulomb_friction_mm_s2),
        of("viscous_friction_per_s", drive.viscous_friction_per_s / inertia, found.viscous_friction_per_s),
    ];
    if let (Some(truth), Some(found)) = (drive.bed, found.bed) {
        all.push(of("bed.frequency_hz", truth.frequency_hz, found.frequency_hz));
        all.push(of("bed.damping_ratio", truth.damping_ratio, found.damping_ratio));
        all.push(of("bed.mass_ratio", truth.mass_ratio, found.mass_ratio));
    }
    all
}

/// What identification said of one drive.
#[derive(Clone, Debug)]
pub struct Surveyed {
    /// The drive.
    pub axis: RandomAxis,
    /// Every parameter, or why there is none.
    pub found: Result<Vec<Compared>, String>,
    /// Whether it says that there is a bed.
    pub has_bed: bool,
    /// Whether it says that the model explains the recordings.
    pub is_met: bool,
    /// Phase margin \[°\] and gain margin of the loop that is proposed, and those of the drive as it is. Without, tuning was
    /// refused.
    pub margins: Option<[Compared; 2]>,
    /// Circles before and after tuning; none without a tuning.
    pub circles: Circles,
    /// Time that it took without recording \[s\]: of the processor, where the system tells it.
    pub time_s: f64,
}

impl Surveyed {
    /// What is to be said of it, in a line.
    #[must_use]
    pub fn words(&self) -> String {
        let seed = self.axis.seed;
        let found = match &self.found {
            Ok(found) => found,
            Err(error) => return format!("seed {seed}: refused: {error}"),
        };
        let worst = found.iter().max_by(|a, b| a.half_widths_off().total_cmp(&b.half_widths_off()));
        let worst =
            worst.map_or_else(String::new, |one| format!("{} {:.1}", one.name, one.half_widths_off()));
        let bed = match (self.axis.drive.bed, self.has_bed) {
            (Some(bed), false) => format!(", bed missed at a mass ratio of {:.3}", bed.mass_ratio),
            (None, true) => ", a bed that is not there".to_owned(),
            _ => String::new(),
        };
        let wrong: Vec<String> = self.wrong().into_iter().chain(self.circles.not_driven.clone()).collect();
        let wrong = if wrong.is_empty() { String::new() } else { format!(" ({})", wrong.join("; ")) };
        let met = if self.is_met { "" } else { ", says that the model does not follow" };
        format!("seed {seed}: half-widths off: {worst}{bed}{met}, {:.1} s{wrong}", self.time_s)
    }

    /// What may not be.
    #[must_use]
    pub fn wrong(&self) -> Vec<String> {
        // Where it says that the model does not follow, nothing is claimed.
        let found = self.found.iter().filter(|_| self.is_met).flatten();
        let off = found.filter(|one| !(one.half_widths_off() <= HALF_WIDTHS_MAX));
        let mut wrong: Vec<String> = off.map(Compared::words).collect();
        if self.found.is_ok() {
            match (self.axis.drive.bed, self.has_bed) {
                (Some(bed), false) if bed.mass_ratio > MISSED_RATIO_MAX => {
                    wrong.push(format!("missed: {}", bed_words(bed)));
                }
                (None, true) => wrong.push("a bed that is not there".to_owned()),
                _ => {}
            }
        }
        let margins = self.margins.iter().flatten().filter(|one| !(one.part_off() <= MARGINS_OFF_MAX));
        wrong.extend(margins.map(|one| {
            let bed = self.axis.drive.bed.map_or_else(String::new, |bed| format!(", {}", bed_words(bed)));
            format!("{} ({:.1} %){bed}", one.words(), 100.0 * one.part_off())
        }));
        wrong.extend(self.circles.worse.iter().cloned());
        wrong
    }
}

fn bed_words(bed: BedMode) -> String {
    format!(
        "bed of {:.1} Hz, damping {:.4}, mass ratio {:.3}",
        bed.frequency_hz, bed.damping_ratio, bed.mass_ratio
    )
}

/// Circles of a drive, before and after tuning.
#[derive(Clone, Debug, Default)]
pub struct Circles {
    /// Driven both before and after.
    pub driven: usize,
    /// Not driven before, with the published machine's gains, but after.
    pub gained: usize,
    /// Driven neither before nor after: why.
    pub not_driven: Vec<String>,
    /// Worse after tuning.
    pub worse: Vec<String>,
}

/// The drive of a seed, recorded, identified, tuned, and driven round circles of these frequencies \[Hz\].
#[must_use]
pub fn surveyed(seed: u64, circles_hz: &[f64]) -> Surveyed {
    let axis = RandomAxis::new(seed);
    let mut run = 0;
    let mut recording_s = 0.0;
    let record = |excitation: &Excitation| {
        run += 1;
        let start_s = processor_s();
        let recording = axis.record(excitation, run);
        recording_s += processor_s() - start_s;
        Ok::<_, core::convert::Infallible>(recording)
    };
    let start_s = processor_s();
    let settings = &machine(&axis).axes[0];
    let Ok(found) = identify_to_tune(settings, FASTEST_MM_S, record);
    let time_s = processor_s() - start_s - recording_s;
    let has_bed = found.as_ref().is_ok_and(|found| found.parameters.bed.is_some());
    let is_met = found.as_ref().is_ok_and(Identification::is_met);
    let tuned = found.as_ref().ok().and_then(|found| Some((found, tuning(&axis, found)?)));
    let margins = tuned.as_ref().map(|(_, tuning)| {
        let is = Margins::of(&axis.drive, tuning.gains, REFERENCE_TICK_S);
        [
            Compared { name: "phase margin", truth: is.phase_deg, found: tuning.phase_margin_deg },
            Compared { name: "gain margin", truth: is.gain, found: tuning.gain_margin },
        ]
    });
    let circles =
        tuned.map_or_else(Circles::default, |(found, tuning)| circles(&axis, found, &tuning, circles_hz));
    let found = match found {
        Ok(found) => Ok(compared(&axis, &found.parameters)),
        Err(error) => Err(error.to_string()),
    };
    Surveyed { axis, found, has_bed, is_met, margins, circles, time_s }
}

/// The published machine with this axis as X.
fn machine(axis: &RandomAxis) -> Machine {
    let mut machine = Machine::reference();
    let x = &mut machine.axes[0];
    (x.drive, x.mm_per_count, x.noise) = (axis.drive, axis.encoder.resolution_mm, axis.encoder.noise);
    machine
}

/// What is proposed for the drive that was found.
fn tuning(axis: &RandomAxis, found: &Identification) -> Option<AxisTuning> {
    propose(&machine(axis).axes[0], found, Method::Inverse, REFERENCE_TICK_S).ok()
}

/// The circles that `motion drive tune` drives, with the published gains and with those that are proposed.
fn circles(axis: &RandomAxis, found: &Identification, tuning: &AxisTuning, circles_hz: &[f64]) -> Circles {
    let before = machine(axis);
    let mut after = before.clone();
    let x = &mut after.axes[0];
    (x.gains, x.feedforward, x.output_offset_v) = (tuning.gains, tuning.feedforward, tuning.output_offset_v);
    let verdict = Verdict { machine: &after, is_tuned: [true, false] };
    let mut circles = Circles::default();
    for &frequency_hz in circles_hz {
        let bears_mm_s2 = bears_mm_s2(found).unwrap_or(f64::INFINITY);
        let (circle, _) = circle(Plane::Xy, frequency_hz, &before, bears_mm_s2);
        let drive = |machine: &Machine| -> Result<CircleFigures, DriveError> {
            figures(&circle.record(machine)?, &circle)
        };
        match (drive(&before), drive(&after)) {
            (Ok(before), Ok(after)) => {
                circles.driven += 1;
                if !verdict.is_no_worse(&before, &after) {
                    let [was_um, is_um] = [&before, &after].map(|figures| verdict.judged_um(figures));
                    let worse =
                        format!("the circle at {frequency_hz} Hz got worse, {was_um:.2} to {is_um:.2} µm");
                    circles.worse.push(worse);
                }
            }
            (Err(_), Ok(_)) => circles.gained += 1,
            (Ok(_), Err(error)) => {
                circles.worse.push(format!("the circle at {frequency_hz} Hz is lost: {error}"));
            }
            (Err(_), Err(error)) => {
                circles.not_driven.push(format!("no circle at {frequency_hz} Hz: {error}"));
            }
        }
    }
    circles
}

/// The time that this thread has had of a processor \[s\]; of the clock where the system does not tell.
fn processor_s() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = told.and_then(|told| told.split_whitespace().next()?.parse::<f64>().ok());
    ns.map_or_else(
        || std::time::UNIX_EPOCH.elapsed().map_or(0.0, |since| since.as_secs_f64()),
        |ns| ns * 1e-9,
    )
}

/// The figures of many drives, as text with tables.
#[must_use]
pub fn report(all: &[Surveyed]) -> String {
    let mut text = String::new();
    let seeds = (all.first().map_or(0, |first| first.axis.seed), all.last().map_or(0, |last| last.axis.seed));
    let with_bed = || all.iter().filter(|one| one.axis.drive.bed.is_some() && one.found.is_ok());
    let rigid = || all.iter().filter(|one| one.axis.drive.bed.is_none() && one.found.is_ok());
    let count = |of: &mut dyn Iterator<Item = &Surveyed>| of.count();
    let missed: Vec<&Surveyed> = with_bed().filter(|one| !one.has_bed).collect();
    let mass_ratio = |one: &Surveyed| one.axis.drive.bed.map_or(0.0, |bed| bed.mass_ratio);
    let missed_ratio = missed.iter().map(|one| mass_ratio(one)).fold(0.0, f64::max);
    let mut times_s: Vec<f64> = all.iter().map(|one| one.time_s).collect();
    times_s.sort_by(f64::total_cmp);
    let at = |share: f64| {
        times_s.get((share * (times_s.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0)
    };
    // Writing to a string does not fail.
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    line(format!("{} drives, seeds {} to {}.\n", all.len(), seeds.0, seeds.1));
    line("| drives | number |".to_owned());
    line("|---|---:|".to_owned());
    line(format!("| refused | {} |", count(&mut all.iter().filter(|one| one.found.is_err()))));
    line(format!(
        "| said that the model does not explain the recordings | {} |",
        count(&mut all.iter().filter(|one| one.found.is_ok() && !one.is_met))
    ));
    line(format!("| with a bed | {} |", with_bed().count()));
    line(format!("| bed missed (mass ratio up to {missed_ratio:.3}) | {} |", missed.len()));
    line(format!("| without a bed | {} |", rigid().count()));
    line(format!("| bed that is not there | {} |", rigid().filter(|one| one.has_bed).count()));
    line(format!(
        "| not tuned: too little is determined | {} |",
        count(&mut all.iter().filter(|one| one.margins.is_none()))
    ));
    let margins: Vec<&Compared> = all.iter().filter_map(|one| one.margins.as_ref()).flatten().collect();
    let worst_part = 100.0 * margins.iter().map(|one| one.part_off()).fold(0.0, f64::max);
    line(format!(
        "| margins off by over 2 % (at most {worst_part:.2} %) | {} |",
        margins.iter().filter(|one| !(one.part_off() <= MARGINS_OFF_MAX)).count()
    ));
    let told = margins.iter().filter(|one| one.found.half_width_95.is_finite()).count();
    let within = margins.iter().filter(|one| one.part_off() == 0.0 || one.half_widths_off() <= 1.0).count();
    line(format!(
        "| margins within their 95 % interval, of {told} | {:.1} % |",
        100.0 * within as f64 / told.max(1) as f64
    ));
    let circles = |of: fn(&Circles) -> usize| all.iter().map(|one| of(&one.circles)).sum::<usize>();
    line(String::new());
    line("| circles of tuned drives, within their limits | number |".to_owned());
    line("|---|---:|".to_owned());
    line(format!("| driven before and after | {} |", circles(|one| one.driven)));
    line(format!("| driven after tuning only | {} |", circles(|one| one.gained)));
    line(format!("| driven neither before nor after | {} |", circles(|one| one.not_driven.len())));
    line(format!("| worse, or lost | {} |", circles(|one| one.worse.len())));
    line(format!(
        "\nProcessor time of an identification, with that of further motion: median {:.1} s, 95 % below {:.1} s, at most {:.1} s.\n",
        at(0.5),
        at(0.95),
        at(1.0)
    ));
    line(
        "| parameter | cases | truth in the 95 % interval | off by over 4 half-widths | worst | its seed |"
            .to_owned(),
    );
    line("|---|---:|---:|---:|---:|---:|".to_owned());
    let names: Vec<&str> = all
        .iter()
        .filter_map(|one| one.found.as_ref().ok())
        .max_by_key(|found| found.len())
        .map_or_else(Vec::new, |found| found.iter().map(|one| one.name).collect());
    let mut row = |label: &str, name: &str, is_of: &dyn Fn(&Surveyed) -> bool| {
        let mut off: Vec<(f64, u64)> = Vec::new();
        for one in all.iter().filter(|one| is_of(one)) {
            let claimed = one.found.iter().filter(|_| one.is_met).flatten();
            let of_name = claimed.filter(|compared| compared.name == name);
            off.extend(of_name.map(|compared| (compared.half_widths_off(), one.axis.seed)));
        }
        let within = off.iter().filter(|(off, _)| *off <= 1.0).count();
        let beyond = off.iter().filter(|(off, _)| !(*off <= HALF_WIDTHS_MAX)).count();
        let (worst, seed) = off.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0));
        let share = 100.0 * within as f64 / off.len().max(1) as f64;
        line(format!("| `{name}`{label} | {} | {share:.1} % | {beyond} | {worst:.1} | {seed} |", off.len()));
    };
    let is_filtered = |one: &Surveyed| one.axis.drive.command_filter_s > 0.0;
    for name in names {
        row("", name, &|_| true);
        if DELAYS.contains(&name) {
            row(" with a filter", name, &is_filtered);
            row(" without", name, &|one| !is_filtered(one));
        }
    }
    line(String::new());
    let is_right = |one: &Surveyed| {
        let is_found = one.is_met && one.has_bed == one.axis.drive.bed.is_some();
        is_found && one.wrong().is_empty() && one.circles.not_driven.is_empty()
    };
    for one in all.iter().filter(|one| !is_right(one)) {
        line(format!("- {}", one.words()));
    }
    text
}
