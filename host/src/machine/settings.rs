//! The machine's values, and what each stage makes of them.

use hal_sim::{
    AxisParameters, DriveParameters, EncoderNoise, EncoderParameters, HomeParameters, MachineParameters,
    REFERENCE_TICK_S, REFERENCE_X, REFERENCE_Y, REFERENCE_Z, SUBSTEPS_MAX, ScrewParameters, TimerBits,
};
use motion_kernel::axis::{
    AxesConfig, AxesError, AxisCompensation, AxisFigures, Compensation, Feedforward, Gains, GuardFigures,
    Guards, TAKE_UP_PEAKS,
};
use motion_kernel::fault::{Reaction, Reactions};
use motion_kernel::homing::HomingConfig;
use motion_kernel::law::{Limits, Pulse};
use motion_kernel::num::Real;
use motion_kernel::path::Travel;
use motion_kernel::plan::{AxisLimits, CURVE_FEED_SHARE, MachineLimits};
use motion_kernel::program::Header;
use motion_kernel::queue::PathRules;
use motion_kernel::units::{DacCode, Position};

use super::error::{AxisError, MachineError};
use super::file;
use crate::axis_unit::AxisUnit;
use crate::gcode::{Axes, Axis, PathMode, Point, Probe, ReadOptions};
use crate::touch::Surface;

/// Pieces are rounded: their tangents agree with the planner's angle to this, and with a curve's feed.
const JUNCTION_ANGLE_ROUNDING_RAD: f64 = 2.0e-6;

/// Greatest gap between two pieces \[mm\]: pieces are rounded, to a twentieth of a count of 0.1 µm.
const JUNCTION_GAP_MM: f64 = 5e-6;

/// Tolerance of a G64 without P \[mm\]: so little that a program written for another controller still makes
/// its part.
pub(super) const BLEND_TOLERANCE_MM: f64 = 0.01;
/// The sharpest corner that a curve is led past if the machine does not say: on a sharper one a stop mostly takes less
/// time.
pub(super) const CORNER_ANGLE_DEG: f64 = 130.0;

/// The simulation's step \[s\]; a tick is divided into as many as come closest to it, so a step is at least
/// 3/4 of it.
const SUBSTEP_S: f64 = 25e-6;

/// Cells of a simulated axis's dead time: for the longest dead time that a file may give, in the shortest
/// steps.
pub const DEAD_TIME_CELLS: usize = 640;

/// A machine of at most `N` axes. Made by [`Machine::from_toml`], [`AnyMachine::from_toml`](super::AnyMachine::from_toml) or
/// [`Machine::reference`]; whoever changes a value afterwards is held to the ranges by the stages that take it.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine<const N: usize = 3> {
    /// Shown in reports.
    pub name: String,
    /// Control tick \[s\], 0.00002 to 0.02.
    pub tick_s: f64,
    /// The limits along the path.
    pub path: PathSettings,
    /// The axes, in the order of the file; the places behind them are [idle](AxisSettings::idle).
    pub axes: [AxisSettings; N],
    /// How faults end.
    pub faults: FaultSettings,
    /// What is known of tools.
    pub tool: ToolSettings,
    /// What the simulated probe touches, if there is one.
    pub probe: Option<Surface>,
    /// The spindle's output, if there is one.
    pub spindle: Option<SpindleSettings>,
    /// The coolant's outputs, if there are any.
    pub coolant: Option<CoolantSettings>,
}

/// The spindle's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleSettings {
    /// Greatest speed \[rev/min\], 1 to 10⁶.
    pub speed_max_rpm: f64,
    /// Wait after a start or another speed or direction \[s\], 0 to 600.
    pub start_s: f64,
    /// Wait after a stop \[s\], 0 to 600.
    pub stop_s: f64,
    /// Whether it turns counter-clockwise, too.
    pub reverses: bool,
}

/// The coolant's outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoolantSettings {
    /// M8.
    pub flood: bool,
    /// M7.
    pub mist: bool,
}

/// What is known of tools.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolSettings {
    /// The subroutine that M6 calls, lower case; without it M6 is a stop for the operator.
    pub change_subroutine: Option<String>,
    /// Radius of every tool where there is no tool table \[mm\], 0 to 100000; 0: not known.
    pub radius_mm: f64,
}

/// How faults end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultSettings {
    /// Time in which outputs go to 0 V \[s\], 0 to 1; 0 for at once, whatever the fault.
    pub ramp_s: f64,
    /// Time after which a stop on the path is given up \[s\], 0 to 60.
    pub stop_s: f64,
    /// The reaction of the emergency stop.
    pub emergency_stop: Reaction,
}

impl Default for FaultSettings {
    fn default() -> Self {
        Self { ramp_s: 0.1, stop_s: 2.0, emergency_stop: Reaction::Immediate }
    }
}

/// Limits along the path, of the linear axes together, and rules for its junctions. The four limits are from 0.001 to 10¹².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Greatest feed \[mm/s\].
    pub feed_mm_s: f64,
    /// Greatest acceleration, as a vector \[mm/s²\].
    pub accel_mm_s2: f64,
    /// Greatest jerk, as a vector \[mm/s³\].
    pub jerk_mm_s3: f64,
    /// Greatest snap \[mm/s⁴\].
    pub snap_mm_s4: f64,
    /// The shape of the pulses of jerk that change the feed.
    pub pulse: Pulse,
    /// Greatest change of direction at a junction that is driven through \[rad\]; 0 to 30° (in the file in
    /// degrees).
    pub junction_angle_rad: f64,
    /// Greatest jump of acceleration at a junction \[mm/s²\]; from 0.001 to 10¹².
    pub accel_step_mm_s2: f64,
    /// Part of a curve's greatest feed that is planned with, 0.1 to 0.85; what it leaves of acceleration,
    /// jerk and snap is for changing the feed on the curve.
    pub curve_feed_share: f64,
    /// How corners are passed before a program says so.
    pub mode: DefaultPathMode,
    /// How far blends may leave the path under a G64 without P \[mm, of rotary axes °\]; 0 to 10, 0 for exact path.
    pub blend_tolerance_mm: f64,
    /// Greatest change of direction that a curve through dense moves is led past \[rad\]; 0 to 180° (in the file in
    /// degrees).
    pub corner_angle_rad: f64,
}

/// How corners are passed before G61, G61.1 or G64 is programmed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DefaultPathMode {
    /// As under G61.
    Exact,
    /// As under a G64 without P, as users of LinuxCNC, grbl and Klipper expect.
    #[default]
    Blend,
}

/// One axis. Limits are from 0.001 to 10¹².
#[derive(Clone, Debug, PartialEq)]
pub struct AxisSettings {
    /// The axis of a program that moves it; `None` for a place without an axis. Of A, B and C read ° for mm.
    pub letter: Option<Axis>,
    /// Letters and digits, at most 8.
    pub name: String,
    /// Greatest velocity \[mm/s\].
    pub feed_mm_s: f64,
    /// Greatest acceleration \[mm/s²\].
    pub accel_mm_s2: f64,
    /// Greatest jerk \[mm/s³\].
    pub jerk_mm_s3: f64,
    /// Greatest snap \[mm/s⁴\].
    pub snap_mm_s4: f64,
    /// Greatest following error at which the axis faults \[mm\], 0.0001 to 1000.
    pub following_error_limit_mm: f64,
    /// What else is watched; `None` for figures of the drive, see [`AxisSettings::guard_figures`]. Noise and
    /// travel are the axis' own.
    pub guard: Option<GuardFigures>,
    /// Least and greatest position \[mm\], if it is bounded.
    pub travel_mm: Option<[f64; 2]>,
    /// Travel per encoder count \[mm\], between 10⁻⁸ and 0.5; so much that a tick at twice `feed_mm_s` is
    /// less than half the register of `timer`.
    pub mm_per_count: f64,
    /// Width of the encoder's counter register.
    pub timer: TimerBits,
    /// Reading noise of the simulated encoder, if any.
    pub noise: Option<EncoderNoise>,
    /// Velocity at +10 V \[mm/s\], not 0; negative if +10 V moves the axis backwards. In the file in mm/min.
    pub mm_s_at_10_v: f64,
    /// Added to every output \[V\]; its magnitude is below the limit.
    pub output_offset_v: f64,
    /// Greatest output in either direction \[V\], above 0, at most 10.
    pub output_limit_v: f64,
    /// Feedback gains, 0 or more.
    pub gains: Gains,
    /// Feedforward gains, within ±1000.
    pub feedforward: Feedforward,
    /// What its screw needs, if it is compensated.
    pub compensation: Option<AxisCompensation>,
    /// How it is homed, if it is.
    pub homing: Option<HomingSettings>,
    /// The simulated drive and its mechanics.
    pub drive: DriveParameters,
    /// The simulated screw between motor and load.
    pub screw: ScrewParameters,
}

/// How an axis is homed, and what the simulated one has for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingSettings {
    /// Feeds, lengths and positions.
    pub config: HomingConfig,
    /// Switch and index.
    pub simulated: HomeParameters,
}

impl Machine {
    /// The reference machine: S4's axes X and Y, a Z like X, S1's limits. The same as
    /// [`REFERENCE_TOML`](super::REFERENCE_TOML).
    #[must_use]
    pub fn reference() -> Self {
        Self {
            name: "reference".to_owned(),
            tick_s: REFERENCE_TICK_S,
            path: PathSettings {
                feed_mm_s: 300.0,
                accel_mm_s2: 500.0,
                jerk_mm_s3: 5e3,
                snap_mm_s4: 4e5,
                pulse: Pulse::Plateau,
                junction_angle_rad: 0.5_f64.to_radians(),
                accel_step_mm_s2: 500.0,
                curve_feed_share: CURVE_FEED_SHARE,
                mode: DefaultPathMode::default(),
                blend_tolerance_mm: BLEND_TOLERANCE_MM,
                corner_angle_rad: CORNER_ANGLE_DEG.to_radians(),
            },
            axes: [
                AxisSettings::reference(Axis::X, REFERENCE_X),
                AxisSettings::reference(Axis::Y, REFERENCE_Y),
                AxisSettings::reference(Axis::Z, REFERENCE_Z),
            ],
            faults: FaultSettings::default(),
            tool: ToolSettings::default(),
            probe: None,
            spindle: None,
            coolant: None,
        }
    }

    /// Reads the file of a machine of at most three axes; `source_name` appears in errors only.
    ///
    /// # Errors
    /// The text is not TOML, a key is missing or unknown, a value is out of its range, or there are more axes.
    pub fn from_toml(source_name: &str, text: &str) -> Result<Self, MachineError> {
        file::read(source_name, text)?.fitted(source_name, text)
    }
}

impl<const N: usize> Machine<N> {
    /// The same machine with `M` places for its axes.
    pub(super) fn fitted<const M: usize>(
        self,
        source_name: &str,
        text: &str,
    ) -> Result<Machine<M>, MachineError> {
        let count = self.axis_count();
        if count > M {
            let at = text.match_indices("[[axis]]").nth(M).map_or(0..0, |(at, found)| at..at + found.len());
            let problem = format!("found {count} [[axis]] tables, expected at most {M} for this command");
            return Err(MachineError::new(source_name, text, &at, problem));
        }
        let mut axes = self.axes.into_iter();
        Ok(Machine {
            name: self.name,
            tick_s: self.tick_s,
            path: self.path,
            axes: std::array::from_fn(|_| axes.next().unwrap_or_else(AxisSettings::idle)),
            faults: self.faults,
            tool: self.tool,
            probe: self.probe,
            spindle: self.spindle,
            coolant: self.coolant,
        })
    }

    /// The number of its axes, which are the first of `axes`.
    #[must_use]
    pub fn axis_count(&self) -> usize {
        self.axes.iter().take_while(|axis| axis.letter.is_some()).count()
    }

    /// The axes that there are.
    #[must_use]
    pub fn driven_axes(&self) -> &[AxisSettings] {
        &self.axes[..self.axis_count()]
    }

    /// Their names.
    #[must_use]
    pub fn axis_names<C: FromIterator<String>>(&self) -> C {
        self.driven_axes().iter().map(|axis| axis.name.clone()).collect()
    }

    /// Their letters.
    #[must_use]
    pub fn letters(&self) -> Axes {
        self.axes.iter().filter_map(|axis| axis.letter).collect()
    }

    /// Their letters in the order of `axes`.
    #[must_use]
    pub fn letters_by_place(&self) -> [Option<Axis>; N] {
        self.axes.each_ref().map(|axis| axis.letter)
    }

    /// Which places have linear axes.
    #[must_use]
    pub fn linear_places(&self) -> [bool; N] {
        self.letters_by_place().map(|letter| letter.is_some_and(|letter| !letter.is_rotary()))
    }

    /// The place of an axis, if there is one of this letter.
    #[must_use]
    pub fn place_of(&self, letter: Axis) -> Option<usize> {
        self.axes.iter().position(|axis| axis.letter == Some(letter))
    }

    /// A point of a program along the machine's axes \[mm, ° for rotary axes\].
    #[must_use]
    pub fn coordinates(&self, point: Point) -> [f64; N] {
        self.axes.each_ref().map(|axis| axis.letter.map_or(0.0, |letter| point[letter.index()].to_mm()))
    }

    /// What the machine adds to the options that its programs are read with.
    #[must_use]
    pub fn read_options(&self) -> ReadOptions {
        let probe = self.probe.clone().map(|surface| Probe { surface, limits: self.xyz_limits() });
        let ToolSettings { change_subroutine, radius_mm: tool_radius_mm } = self.tool.clone();
        ReadOptions {
            axes: self.letters(),
            change_subroutine,
            tool_radius_mm,
            probe,
            ..ReadOptions::default()
        }
    }

    /// The limits of moves of X, Y and Z alone, in this order; an axis that there is not has those of the path.
    fn xyz_limits(&self) -> MachineLimits<f64, 3> {
        let MachineLimits { path, axes, pulse, curve_feed_share } = self.limits();
        let of = |letter| self.place_of(letter).map_or(path, |place| axes[place]);
        MachineLimits { path, axes: [Axis::X, Axis::Y, Axis::Z].map(of), pulse, curve_feed_share }
    }

    /// The limits that planning keeps.
    #[must_use]
    pub fn limits(&self) -> MachineLimits<f64, N> {
        let path = &self.path;
        MachineLimits {
            curve_feed_share: path.curve_feed_share,
            path: AxisLimits { feed_mm_s: path.feed_mm_s, limits: path.limits() },
            pulse: path.pulse,
            axes: self.axes.each_ref().map(|axis| AxisLimits {
                feed_mm_s: axis.feed_mm_s,
                limits: Limits {
                    accel_mm_s2: axis.accel_mm_s2,
                    jerk_mm_s3: axis.jerk_mm_s3,
                    snap_mm_s4: axis.snap_mm_s4,
                },
            }),
        }
    }

    /// The travel of the axes. An end beyond the kernel's range bounds nothing.
    #[must_use]
    pub fn travel(&self) -> Travel<N> {
        self.guards().travel()
    }

    /// The rules that the kernel's queues hold the streams to. The limits of the path bind the linear axes: along a path
    /// that takes rotary axes along, these add what they can do themselves.
    #[must_use]
    pub fn rules(&self) -> PathRules {
        let mut most = AxisLimits { feed_mm_s: self.path.feed_mm_s, limits: self.path.limits() };
        for axis in self.axes.iter().filter(|axis| axis.letter.is_some_and(Axis::is_rotary)) {
            most.feed_mm_s += axis.feed_mm_s;
            most.limits.accel_mm_s2 += axis.accel_mm_s2;
            most.limits.jerk_mm_s3 += axis.jerk_mm_s3;
            most.limits.snap_mm_s4 += axis.snap_mm_s4;
        }
        PathRules {
            limits: most.limits,
            feed_mm_s: most.feed_mm_s,
            junction_angle_rad: self.path.junction_angle_rad + JUNCTION_ANGLE_ROUNDING_RAD,
            junction_gap_mm: JUNCTION_GAP_MM,
        }
    }

    /// The kernel's axes, guarded.
    ///
    /// # Errors
    /// The first axis with a value that the kernel can't use.
    pub fn axes_config<R: Real>(&self) -> Result<AxesConfig<R, N>, AxisError> {
        AxesConfig::new(&self.figures(), self.tick_s)
            .and_then(|axes| axes.guarded(&self.guards(), self.tick_s))
            .and_then(|axes| axes.compensated(&self.compensation(), self.tick_s))
            .map_err(|error| self.at_axis(error))
    }

    /// How faults are told and end.
    #[must_use]
    pub fn guards(&self) -> Guards<N> {
        Guards {
            axes: self.axes.each_ref().map(|axis| Some(axis.guard_figures(self.tick_s))),
            reactions: self.faults.reactions(self.tick_s),
        }
    }

    /// The compensation of its axes.
    #[must_use]
    pub fn compensation(&self) -> Compensation<N> {
        Compensation { axes: self.axes.each_ref().map(|axis| axis.compensation) }
    }

    /// The kernel's axes without guards but the greatest following error.
    ///
    /// # Errors
    /// The first axis with a value that the kernel can't use.
    pub fn unguarded_axes_config<R: Real>(&self) -> Result<AxesConfig<R, N>, AxisError> {
        AxesConfig::new(&self.figures(), self.tick_s)
            .and_then(|axes| axes.compensated(&self.compensation(), self.tick_s))
            .map_err(|error| self.at_axis(error))
    }

    fn figures(&self) -> [AxisFigures; N] {
        self.axes.each_ref().map(AxisSettings::figures)
    }

    fn at_axis(&self, error: AxesError) -> AxisError {
        AxisError { axis: self.axes[error.axis].name.clone(), source: error.cause }
    }

    /// What a compiled program carries: everything that the kernel has to know of the machine, which stands
    /// at the origin when the program starts.
    #[must_use]
    pub fn header(&self) -> Header<N> {
        let (axes, start) = (self.figures(), [Position::ZERO; N]);
        Header { tick_s: self.tick_s, rules: self.rules(), pulse: self.path.pulse, axes, start }
    }

    /// The simulated machine: the same drives, encoders and scales, at rest at the origin. Its dead times
    /// fit [`DEAD_TIME_CELLS`].
    #[must_use]
    pub fn simulated(&self) -> MachineParameters<N> {
        let substeps = (self.tick_s / SUBSTEP_S).round() as u32;
        MachineParameters {
            axes: self.axes.each_ref().map(AxisSettings::simulated),
            tick_s: self.tick_s,
            substeps: substeps.clamp(1, SUBSTEPS_MAX),
        }
    }
}

impl FaultSettings {
    pub(super) fn reactions(&self, tick_s: f64) -> Reactions {
        Reactions {
            ramp_ticks: (self.ramp_s / tick_s).round() as u16,
            stop_ticks: (self.stop_s / tick_s).round() as u32,
            emergency_stop: self.emergency_stop,
        }
    }
}

impl PathSettings {
    /// How far blends may leave the path in a program's path mode \[mm\], 0 or more; 0 for exact path.
    #[must_use]
    pub fn tolerance_mm(&self, mode: PathMode) -> f64 {
        match (mode, self.mode) {
            (PathMode::ExactPath | PathMode::ExactStop, _) => 0.0,
            (PathMode::Unprogrammed, DefaultPathMode::Exact) => 0.0,
            (PathMode::Unprogrammed, DefaultPathMode::Blend) => self.blend_tolerance_mm,
            (PathMode::Blend { tolerance_mm, .. }, _) => tolerance_mm.unwrap_or(self.blend_tolerance_mm),
        }
    }

    /// Acceleration, jerk and snap along the path.
    #[must_use]
    pub fn limits(&self) -> Limits<f64> {
        Limits { accel_mm_s2: self.accel_mm_s2, jerk_mm_s3: self.jerk_mm_s3, snap_mm_s4: self.snap_mm_s4 }
    }
}

impl AxisSettings {
    fn reference(letter: Axis, drive: DriveParameters) -> Self {
        Self {
            letter: Some(letter),
            name: letter.to_string(),
            feed_mm_s: 300.0,
            accel_mm_s2: 500.0,
            jerk_mm_s3: 5e3,
            snap_mm_s4: 4e5,
            following_error_limit_mm: 1.0,
            guard: None,
            travel_mm: None,
            mm_per_count: 1e-4,
            timer: TimerBits::ThirtyTwo,
            noise: None,
            mm_s_at_10_v: 20_000.0 / 60.0,
            output_offset_v: 0.0,
            output_limit_v: 10.0,
            gains: Gains { kp_per_s: 230.0, ki_per_s2: 0.0, kd: 0.0 },
            // The measured machine ran 0.35 of the drive's own J, 6.376715·10⁻⁵ s².
            feedforward: Feedforward {
                velocity: 1.0,
                accel_s: 1.675e-3,
                jerk_s2: 2.231_850_25e-5,
                ..Feedforward::default()
            },
            compensation: None,
            homing: None,
            drive,
            screw: ScrewParameters::default(),
        }
    }

    /// A place without an axis: one like the reference machine's X that nothing moves.
    #[must_use]
    pub fn idle() -> Self {
        Self { letter: None, name: String::new(), ..Self::reference(Axis::X, REFERENCE_X) }
    }

    /// What it counts.
    #[must_use]
    pub fn unit(&self) -> AxisUnit {
        self.letter.map_or(AxisUnit::Millimetre, AxisUnit::of)
    }

    /// The velocity that the output can command in either direction \[mm/s\].
    #[must_use]
    pub fn reachable_mm_s(&self) -> f64 {
        let volts = self.output_limit_v - self.output_offset_v.abs();
        self.mm_s_at_10_v.abs() * volts / DacCode::FULL_SCALE_V
    }

    /// The shortest time in which its motor may go through a play \[s\]: at most at its feed, and with half of the
    /// acceleration that the drive has. The load stands meanwhile, so the axis' own limits of acceleration and jerk, which are
    /// for what moves with it, do not bind it.
    #[must_use]
    pub fn take_up_s(&self, play_mm: f64) -> f64 {
        let accel_mm_s2 = 0.5 * self.drive_accel_mm_s2();
        let [of_velocity, of_accel, _] = TAKE_UP_PEAKS;
        (of_velocity * play_mm / self.feed_mm_s).max((of_accel * play_mm / accel_mm_s2).sqrt())
    }

    /// The acceleration that its drive has \[mm/s²\].
    #[must_use]
    pub fn drive_accel_mm_s2(&self) -> f64 {
        self.drive.accel_limit_mm_s2 / (1.0 + self.drive.load_inertia_ratio)
    }

    /// The axis in the kernel's terms.
    #[must_use]
    pub fn figures(&self) -> AxisFigures {
        AxisFigures {
            mm_per_count: self.mm_per_count,
            mm_s_at_10_v: self.mm_s_at_10_v,
            output_offset_v: self.output_offset_v,
            output_limit_v: self.output_limit_v,
            gains: self.gains,
            feedforward: self.feedforward,
            following_error_limit_mm: self.following_error_limit_mm,
        }
    }

    /// What is watched of the axis with ticks of `tick_s`: what the file says, or what follows from drive and
    /// regulator.
    ///
    /// With the drive's response T = dead time + filter + current lag + 3 time constants of its velocity
    /// controller, feedforward that is off by a tenth, and loads of a tenth of its torque:
    ///
    /// - following error: at rest a quarter of the limit; (|1 − F_V| + 0.1)/kp for velocity, T/kp for
    ///   acceleration;
    /// - jump: twice (axis' + drive's acceleration)·tick² + (2 + 4·noise) counts;
    /// - moving: a hundredth of the feed, twice what friction holds and what noise commands, together; within
    ///   T and 2 more time constants;
    /// - load: a tenth of the drive's acceleration, or twice the axis' or friction.
    #[must_use]
    pub fn guard_figures(&self, tick_s: f64) -> GuardFigures {
        let noise_counts = self.noise.map_or(0, |noise| noise.amplitude_counts);
        let (drive, Gains { kp_per_s, kd, .. }) = (&self.drive, self.gains);
        let constant_s = (1.0 + drive.load_inertia_ratio) / drive.velocity_gain_per_s;
        let response_s = drive.dead_time_s + drive.command_filter_s + drive.current_lag_s + 3.0 * constant_s;
        let counts_mm = self.mm_per_count * (2.0 + 4.0 * f64::from(noise_counts));
        let accel_mm_s2 = self.drive_accel_mm_s2();
        let is_closed = kp_per_s > 0.0;
        let per_kp = |value: f64| if is_closed { value / kp_per_s } else { 0.0 };
        let derived = GuardFigures {
            following_error_at_rest_mm: self.following_error_limit_mm * if is_closed { 0.25 } else { 1.0 },
            following_error_per_velocity_s: per_kp((1.0 - self.feedforward.velocity).abs() + 0.1),
            following_error_per_accel_s2: per_kp(response_s),
            jump_mm: 2.0 * ((self.accel_mm_s2 + accel_mm_s2) * tick_s * tick_s + counts_mm),
            moving_mm_s: 0.01 * self.feed_mm_s
                + 2.0 * drive.coulomb_friction_mm_s2 * constant_s
                + (kp_per_s + kd / tick_s) * counts_mm,
            response_s: response_s + 2.0 * constant_s,
            load_accel_mm_s2: (0.1 * accel_mm_s2)
                .max(2.0 * self.accel_mm_s2)
                .max(2.0 * drive.coulomb_friction_mm_s2),
            noise_counts,
            saturation_s: 0.1,
            travel_mm: None,
        };
        GuardFigures { noise_counts, travel_mm: self.travel_mm, ..self.guard.unwrap_or(derived) }
    }

    fn simulated(&self) -> AxisParameters {
        AxisParameters {
            drive: self.drive,
            screw: self.screw,
            encoder: EncoderParameters {
                resolution_mm: self.mm_per_count,
                offset_counts: 0,
                timer: self.timer,
                noise: self.noise,
            },
            mm_s_per_volt: self.mm_s_at_10_v / DacCode::FULL_SCALE_V,
            start_position_mm: 0.0,
        }
    }
}
