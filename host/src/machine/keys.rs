//! Every key of a machine file: unit, range, default, meaning.
//!
//! The ranges are the words that the reader refuses values with. The tests hold the rest to the reader: it
//! must know exactly these keys, require exactly those without a default, and refuse a value with the range
//! that stands here.

use motion_kernel::axis::TABLE_POINTS;

use super::law_name::LAW_NAMES;
use super::range::{
    AXIS_LETTER, AXIS_NAME, Amplitude, Angle, BlendTolerance, COOLANT_KINDS, Coordinate, CornerAngle,
    CurveShare, Damping, DeadTime, EMERGENCY_STOP, ErrorGrowth, FeedforwardGain, FollowingError, Friction,
    Gain, Inertia, IntegralTime, InverseGain, Jump, JunctionAngle, Lag, LeadTime, Length, LengthOrNone,
    Limit, Load, MassRatio, NOISE_COUNTS, NOISE_SEED, OutputLimit, OutputOffset, PATH_MODE, PitchErrorPoint,
    Place, Play, PlayOrNone, Positive, REPEATS, Ramp, Range, Resolution, Reversal, SPINDLE_TURNS, SUBROUTINE,
    Spacing, SpindleSpeed, SpindleTime, StopTime, TIMER_BITS, TablePoint, TakeUp, Tick, Velocity, Watch,
};

/// A table of the file with its keys, without its tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyTable {
    /// The table's name in dots; empty for the keys before the first table.
    pub name: &'static str,
    /// Whether the table may be left out.
    pub is_optional: bool,
    /// The table's meaning.
    pub meaning: &'static str,
    /// The table's keys, in the order of the reference file.
    pub keys: &'static [Key],
}

/// A key of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// The key's name.
    pub name: &'static str,
    /// Unit of its value; "1" for a number without one, empty for what is no number.
    pub unit: &'static str,
    /// How many values it has, or the fewest.
    pub values: usize,
    /// Whether it may have more.
    pub may_be_more: bool,
    /// The range of a value, in the words of refusals.
    pub range: &'static str,
    /// The value if the key is left out; none if it is required.
    pub default: Option<&'static str>,
    /// The key's meaning, and rules that join it with other keys.
    pub meaning: &'static str,
}

impl Key {
    const fn new(name: &'static str, unit: &'static str, range: &'static str, meaning: &'static str) -> Self {
        Self { name, unit, values: 1, may_be_more: false, range, default: None, meaning }
    }

    const fn or(self, default: &'static str) -> Self {
        Self { default: Some(default), ..self }
    }

    const fn coordinates(name: &'static str, meaning: &'static str) -> Self {
        Self { values: 3, ..Self::new(name, "mm", Coordinate::EXPECTED, meaning) }
    }

    const fn points(name: &'static str, meaning: &'static str) -> Self {
        Self { values: TABLE_POINTS, ..Self::new(name, "mm/s", TablePoint::EXPECTED, meaning) }
    }
}

const fn table(name: &'static str, meaning: &'static str, keys: &'static [Key]) -> KeyTable {
    KeyTable { name, is_optional: false, meaning, keys }
}

const fn optional(name: &'static str, meaning: &'static str, keys: &'static [Key]) -> KeyTable {
    KeyTable { name, is_optional: true, meaning, keys }
}

/// Whether a table may be there several times: `[[axis]]`.
#[must_use]
pub fn is_list(table: &str) -> bool {
    matches!(table, "axis" | "probe.box")
}

/// All tables, in the order of the reference file.
pub const KEY_TABLES: &[KeyTable] = &[
    table(
        "",
        "The machine.",
        &[
            Key::new("name", "", "any text", "Shown in reports."),
            Key::new(
                "tick_s",
                "s",
                Tick::EXPECTED,
                "Control tick: feed law, path, regulators and outputs run once per tick.",
            ),
        ],
    ),
    table(
        "path",
        "What holds along the path, whatever the axes could do; rotary axes alone are bound by their own limits.",
        &[
            Key::new("feed_mm_s", "mm/s", Limit::EXPECTED, "Greatest feed, also of rapids."),
            Key::new("accel_mm_s2", "mm/s²", Limit::EXPECTED, "Greatest acceleration, as a vector."),
            Key::new("jerk_mm_s3", "mm/s³", Limit::EXPECTED, "Greatest jerk, as a vector."),
            Key::new("snap_mm_s4", "mm/s⁴", Limit::EXPECTED, "Greatest rate of change of jerk."),
            Key::new(
                "law",
                "",
                LAW_NAMES,
                "Shape of the pulses of jerk that change the feed: one sin² arch, or two halves of one as short as snap \
                 allows with a plateau of constant jerk between them, which is faster.",
            )
            .or("\"plateau\""),
            Key::new(
                "junction_angle_deg",
                "°",
                JunctionAngle::EXPECTED,
                "Greatest change of direction between two blocks that is driven through; beyond it the motion stops \
                 at the junction.",
            ),
            Key::new(
                "accel_step_mm_s2",
                "mm/s²",
                Limit::EXPECTED,
                "Greatest jump of acceleration at a junction, where the curvature jumps.",
            ),
            Key::new(
                "curve_feed_share",
                "1",
                CurveShare::EXPECTED,
                "Part of the feed that a curve's radius allows to plan with; the rest is left for changing the feed \
                 on the curve.",
            ),
            Key::new(
                "mode",
                "",
                PATH_MODE,
                "How corners are passed before a program says G61 or G64: blended within blend_tolerance_mm, or exactly.",
            )
            .or("\"blend\""),
            Key::new(
                "blend_tolerance_mm",
                "mm",
                BlendTolerance::EXPECTED,
                "How far blends of corners may leave the programmed path without a P of G64; 0 for exact path.",
            )
            .or("0.01"),
            Key::new(
                "corner_angle_deg",
                "°",
                CornerAngle::EXPECTED,
                "Greatest change of direction that a curve through dense moves is led past; a sharper one is a corner: the \
                 curve ends there, and G64 rounds it by a blend.",
            )
            .or("130"),
        ],
    ),
    optional(
        "faults",
        "How faults end.",
        &[
            Key::new(
                "ramp_s",
                "s",
                Ramp::EXPECTED,
                "Time in which outputs go to 0 V before drives are disabled; 0: at once, whatever the fault.",
            )
            .or("0.1"),
            Key::new(
                "stop_s",
                "s",
                StopTime::EXPECTED,
                "Time after which a stop on the path is given up, and outputs go to 0 V.",
            )
            .or("2"),
            Key::new(
                "emergency_stop",
                "",
                EMERGENCY_STOP,
                "What the emergency stop does: outputs to 0 V and drives off at once, outputs ramped, or a stop on the \
                 path.",
            )
            .or("\"immediate\""),
        ],
    ),
    optional(
        "tool",
        "Tools, where a program's words and tool table do not say more.",
        &[
            Key::new(
                "change_subroutine",
                "",
                SUBROUTINE,
                "The subroutine that M6 calls with the tool's number; without one, M6 is a stop for the operator.",
            )
            .or("\"\""),
            Key::new(
                "radius_mm",
                "mm",
                LengthOrNone::EXPECTED,
                "Radius of every tool for G41 and G42 where there is no tool table; 0: not known, and they are refused.",
            )
            .or("0"),
        ],
    ),
    optional(
        "probe.box",
        "A probe, and what it touches in the simulated machine: any number of [[probe.box]] tables, a box each along the axes. \
         Without one, G38.2 to G38.5 are refused. Other moves pass through.",
        &[
            Key::coordinates("low_mm", "Least X, Y, Z of the axes at which the probe touches; below high_mm."),
            Key::coordinates("high_mm", "Greatest X, Y, Z of the axes at which the probe touches."),
        ],
    ),
    optional(
        "spindle",
        "The spindle's output; without it the words M3, M4, M5 and S are not acted on, and `motion compile` refuses M3 and M4.",
        &[
            Key::new(
                "speed_max_rpm",
                "rev/min",
                SpindleSpeed::EXPECTED,
                "Greatest speed; a program that commands more is refused.",
            ),
            Key::new(
                "start_s",
                "s",
                SpindleTime::EXPECTED,
                "Wait after the spindle is started, or its speed or direction changed.",
            ),
            Key::new("stop_s", "s", SpindleTime::EXPECTED, "Wait after the spindle is stopped.").or("0"),
            Key::new("turns", "", SPINDLE_TURNS, "Which way it turns; a program with M4 is refused if it can't.")
                .or("\"both\""),
        ],
    ),
    optional(
        "coolant",
        "The coolant's output; without it the words M7, M8 and M9 are not acted on, and `motion compile` refuses M7 and M8.",
        &[Key::new(
            "kinds",
            "",
            COOLANT_KINDS,
            "The kinds there are: flood (M8), mist (M7); a program that switches on another one is refused.",
        )
        .or("\"both\"")],
    ),
    table(
        "axis",
        "An axis; one to nine [[axis]] tables. Of A, B and C, which are rotary, read ° for mm in every key.",
        &[
            Key::new("name", "", AXIS_NAME, "Heads the axis's columns in tables and traces; no two are equal."),
            Key::new(
                "letter",
                "",
                AXIS_LETTER,
                "The words that move it; no two are equal. Without the key the axes are X, Y, Z, A, B, C, U, V, W, in this \
                 order.",
            )
            .or("\"X\""),
            Key::new(
                "feed_mm_s",
                "mm/s",
                Limit::EXPECTED,
                "Greatest velocity of this axis; within reach of the output's limit.",
            ),
            Key::new("accel_mm_s2", "mm/s²", Limit::EXPECTED, "Greatest acceleration of this axis."),
            Key::new("jerk_mm_s3", "mm/s³", Limit::EXPECTED, "Greatest jerk of this axis."),
            Key::new("snap_mm_s4", "mm/s⁴", Limit::EXPECTED, "Greatest snap of this axis."),
            Key::new(
                "following_error_limit_mm",
                "mm",
                FollowingError::EXPECTED,
                "Following error (set-point − actual position) at which the axis faults, in whatever motion.",
            ),
        ],
    ),
    optional(
        "axis.travel",
        "Where the axis may go: soft limits for programs and jogging.",
        &[
            Key::new("low_mm", "mm", Coordinate::EXPECTED, "Least position; below high_mm."),
            Key::new("high_mm", "mm", Coordinate::EXPECTED, "Greatest position."),
        ],
    ),
    optional(
        "axis.guard",
        "What is watched of the axis; without it, figures that follow from [axis.drive] and [axis.regulator].",
        &[
            Key::new(
                "following_error_at_rest_mm",
                "mm",
                FollowingError::EXPECTED,
                "Following error at which the axis faults at rest.",
            ),
            Key::new(
                "following_error_per_velocity_s",
                "s",
                ErrorGrowth::EXPECTED,
                "Added to it, times the set velocity in mm/s.",
            ),
            Key::new(
                "following_error_per_accel_s2",
                "s²",
                ErrorGrowth::EXPECTED,
                "Added to it, times the set acceleration in mm/s².",
            ),
            Key::new(
                "jump_mm",
                "mm",
                Jump::EXPECTED,
                "Greatest second difference of the following error from tick to tick; more is a jump of the encoder or \
                 of the set-point.",
            ),
            Key::new(
                "moving_mm_s",
                "mm/s",
                Limit::EXPECTED,
                "Velocity command above which the encoder has to count.",
            ),
            Key::new("response_s", "s", Watch::EXPECTED, "After so long at the latest."),
            Key::new(
                "load_accel_mm_s2",
                "mm/s²",
                Load::EXPECTED,
                "Greatest acceleration by friction and load; what accelerates the axis away from its command by more runs \
                 away.",
            ),
            Key::new("saturation_s", "s", Watch::EXPECTED, "How long the output may be at its limit."),
        ],
    ),
    table(
        "axis.encoder",
        "How the axis's position is read.",
        &[
            Key::new(
                "mm_per_count",
                "mm",
                Resolution::EXPECTED,
                "Travel per count; so much that a tick at twice feed_mm_s is less than half the counter register.",
            ),
            Key::new("timer_bits", "", TIMER_BITS, "Width of the board's counter register.").or("32"),
            Key::new(
                "noise_counts",
                "counts",
                NOISE_COUNTS,
                "Largest reading error of the simulated encoder in either direction, every reading anew.",
            )
            .or("0"),
            Key::new("noise_seed", "", NOISE_SEED, "Seed of the noise: the same seed, the same noise.").or("1"),
        ],
    ),
    table(
        "axis.output",
        "How a velocity command becomes a voltage.",
        &[
            Key::new(
                "mm_min_at_10_v",
                "mm/min",
                Velocity::EXPECTED,
                "Velocity at +10 V; negative if +10 V moves the axis backwards.",
            ),
            Key::new(
                "offset_v",
                "V",
                OutputOffset::EXPECTED,
                "Added to every output, so that a command of 0 holds the drive still; its magnitude is below limit_v.",
            ),
            Key::new("limit_v", "V", OutputLimit::EXPECTED, "Greatest output in either direction."),
        ],
    ),
    table(
        "axis.regulator",
        "Velocity command of a following error, and feedforward.",
        &[
            Key::new("kp_per_s", "1/s", Gain::EXPECTED, "Proportional gain."),
            Key::new("ki_per_s2", "1/s²", Gain::EXPECTED, "Integral gain."),
            Key::new("kd", "1", Gain::EXPECTED, "Derivative gain."),
            Key::new(
                "feedforward_velocity",
                "1",
                FeedforwardGain::EXPECTED,
                "Feedforward of the commanded velocity; 1 if mm_min_at_10_v is right.",
            ),
            Key::new(
                "feedforward_accel_s",
                "s",
                FeedforwardGain::EXPECTED,
                "Feedforward of the commanded acceleration: the drive's delay and lag.",
            ),
            Key::new(
                "feedforward_jerk_s2",
                "s²",
                FeedforwardGain::EXPECTED,
                "Feedforward of the commanded jerk.",
            ),
            Key::new(
                "feedforward_lead_s",
                "s",
                LeadTime::EXPECTED,
                "How far feedforward comes before the position set-point: the drive's dead time plus half a tick; at \
                 most 24 ticks. Position set-points of all axes are delayed together.",
            )
            .or("0"),
        ],
    ),
    optional(
        "axis.regulator.feedforward_velocity_table",
        "Added to feedforward of the velocity.",
        &[
            Key::new("reach", "mm/s", Limit::EXPECTED, "Velocity at the last point; beyond, the ends hold."),
            Key::points("mm_s", "Velocity commands at points evenly from −reach to +reach."),
        ],
    ),
    optional(
        "axis.regulator.feedforward_accel_table",
        "Added to feedforward of the acceleration.",
        &[
            Key::new("reach", "mm/s²", Limit::EXPECTED, "Acceleration at the last point; beyond, the ends hold."),
            Key::points("mm_s", "Velocity commands at points evenly from −reach to +reach."),
        ],
    ),
    optional(
        "axis.regulator.feedforward_jerk_table",
        "Added to feedforward of the jerk.",
        &[
            Key::new("reach", "mm/s³", Limit::EXPECTED, "Jerk at the last point; beyond, the ends hold."),
            Key::points("mm_s", "Velocity commands at points evenly from −reach to +reach."),
        ],
    ),
    optional(
        "axis.regulator.inverse",
        "The drive to be inverted, per unit of the inertia that the axis moves.",
        &[
            Key::new(
                "velocity_gain_per_s",
                "1/s",
                InverseGain::EXPECTED,
                "Proportional gain of the drive's velocity controller.",
            ),
            Key::new(
                "integral_time_s",
                "s",
                IntegralTime::EXPECTED,
                "Integral time of the velocity controller; at least tick_s.",
            ),
            Key::new("current_lag_s", "s", Lag::EXPECTED, "Lag of the current loop."),
            Key::new("viscous_friction_per_s", "1/s", Friction::EXPECTED, "Viscous friction."),
            Key::new("coulomb_friction_mm_s2", "mm/s²", Friction::EXPECTED, "Coulomb friction."),
            Key::new(
                "reversal_mm_s",
                "mm/s",
                Reversal::EXPECTED,
                "Velocity from which on all of Coulomb friction is compensated; below, a part in proportion.",
            ),
        ],
    ),
    optional(
        "axis.regulator.inverse.bed",
        "The machine bed that this axis shakes, as the inverse knows it.",
        &[
            Key::new(
                "frequency_hz",
                "Hz",
                Positive::EXPECTED,
                "Natural frequency of the bed alone; below a quarter of the tick's frequency.",
            ),
            Key::new("damping_ratio", "1", Damping::EXPECTED, "Fraction of critical damping."),
            Key::new("mass_ratio", "1", MassRatio::EXPECTED, "Moving mass over the bed's modal mass."),
        ],
    ),
    optional(
        "axis.compensation.backlash",
        "Play between motor and load, taken up when the direction changes.",
        &[
            Key::new("play_mm", "mm", Play::EXPECTED, "What the motor turns back before the load follows."),
            Key::new(
                "take_up_s",
                "s",
                TakeUp::EXPECTED,
                "How long that takes; so long that the motor needs at most feed_mm_s and half of the acceleration that the \
                 drive has.",
            ),
        ],
    ),
    optional(
        "axis.compensation.pitch_error",
        "The screw's error over its travel: where the load is, less where the motor is.",
        &[
            Key::new("start_mm", "mm", Coordinate::EXPECTED, "Where the first point lies."),
            Key::new("spacing_mm", "mm", Spacing::EXPECTED, "Distance from point to point."),
            Key {
                values: 2,
                may_be_more: true,
                ..Key::new(
                    "points_um",
                    "µm",
                    PitchErrorPoint::EXPECTED,
                    "Errors at 2 to 32 points, a smooth curve between them; at most 0.02 mm/mm from one to the next.",
                )
            },
            Key::new(
                "repeats",
                "",
                REPEATS,
                "Whether the first point follows the last one again, turn by turn; else the ends hold beyond them.",
            )
            .or("false"),
        ],
    ),
    optional(
        "axis.homing",
        "How the axis finds its reference, `motion home`: a home switch, and an index pulse where there is one.",
        &[
            Key::new(
                "search_mm_s",
                "mm/s",
                Velocity::EXPECTED,
                "Velocity of the search, its sign towards the switch; backing off at the same feed. At most the axis' \
                 feed and the path's.",
            ),
            Key::new(
                "approach_mm_s",
                "mm/s",
                Limit::EXPECTED,
                "Feed at which the switch is approached for the reference. At most the axis' feed and the path's.",
            ),
            Key::new("travel_mm", "mm", Length::EXPECTED, "Greatest length of the search."),
            Key::new(
                "back_off_mm",
                "mm",
                Length::EXPECTED,
                "Greatest length of backing off until the switch opens, and of the approach after it.",
            ),
            Key::new(
                "index_mm",
                "mm",
                LengthOrNone::EXPECTED,
                "Greatest length from where the switch closes to the index; 0: the switch is the reference.",
            )
            .or("0"),
            Key::new("position_mm", "mm", Place::EXPECTED, "Position of the reference."),
            Key::new("park_mm", "mm", Place::EXPECTED, "Where the axis goes afterwards."),
        ],
    ),
    optional(
        "axis.homing.simulated",
        "Switch and index of the simulated axis; positions from where it stands when it is switched on.",
        &[
            Key::new("closes_mm", "mm", Place::EXPECTED, "Where the switch closes in the direction of the search."),
            Key::new("length_mm", "mm", Length::EXPECTED, "How long it stays closed from there on."),
            Key::new("hysteresis_mm", "mm", LengthOrNone::EXPECTED, "How far outside of that it opens."),
            Key::new(
                "index_every_mm",
                "mm",
                LengthOrNone::EXPECTED,
                "Distance from index to index, at least mm_per_count; 0 for none.",
            )
            .or("0"),
            Key::new("index_at_mm", "mm", Place::EXPECTED, "Where one of them is.").or("0"),
        ],
    ),
    table(
        "axis.drive",
        "The simulated drive and its mechanics; torque as the acceleration it gives the unloaded axis.",
        &[
            Key::new(
                "velocity_gain_per_s",
                "1/s",
                Positive::EXPECTED,
                "Proportional gain of the drive's velocity controller.",
            ),
            Key::new("integral_time_s", "s", Positive::EXPECTED, "Integral time of the velocity controller."),
            Key::new("current_lag_s", "s", Gain::EXPECTED, "Lag of the current loop; 0 for none."),
            Key::new(
                "dead_time_s",
                "s",
                DeadTime::EXPECTED,
                "Dead time from the output to the velocity controller.",
            ),
            Key::new(
                "command_filter_s",
                "s",
                Gain::EXPECTED,
                "Time constant of the drive's command filter; 0 for none.",
            ),
            Key::new("accel_limit_mm_s2", "mm/s²", Positive::EXPECTED, "Current limit."),
            Key::new("load_inertia_ratio", "1", Inertia::EXPECTED, "Added inertia over unloaded inertia."),
            Key::new("coulomb_friction_mm_s2", "mm/s²", Gain::EXPECTED, "Coulomb friction."),
            Key::new("viscous_friction_per_s", "1/s", Gain::EXPECTED, "Viscous friction."),
        ],
    ),
    optional(
        "axis.drive.bed",
        "The machine bed that the simulated axis shakes: one lightly damped mode.",
        &[
            Key::new("frequency_hz", "Hz", Positive::EXPECTED, "Natural frequency of the bed alone."),
            Key::new("damping_ratio", "1", Gain::EXPECTED, "Fraction of critical damping."),
            Key::new("mass_ratio", "1", Positive::EXPECTED, "Moving mass over the bed's modal mass."),
        ],
    ),
    optional(
        "axis.drive.screw",
        "Errors of the simulated screw between motor and load: the encoder reads the motor.",
        &[
            Key::new("pitch_mm", "mm", Length::EXPECTED, "Travel of a turn."),
            Key::new(
                "pitch_error_um",
                "µm",
                Amplitude::EXPECTED,
                "Amplitude of load − motor, a sine over every turn; 0 for none.",
            )
            .or("0"),
            Key::new("pitch_phase_deg", "°", Angle::EXPECTED, "Its phase at the motor's position 0.").or("0"),
            Key::new("backlash_mm", "mm", PlayOrNone::EXPECTED, "Play between motor and load; 0 for none.").or("0"),
        ],
    ),
];
