//! The layout of a machine file, and the rules that join several of its keys.

use std::ops::Range;

use hal_sim::{
    BedMode, DriveParameters, EncoderNoise, HomeParameters, IndexParameters, PitchErrorParameters,
    ScrewParameters, SwitchParameters, TimerBits,
};
use motion_kernel::axis::{
    AxesConfig, AxisCompensation, BED_TICK_SHARE_MAX, Backlash, BedInverse, COMPENSATION_POINTS_MAX,
    Compensation, DriveInverse, Feedforward, Gains, GuardFigures, Guards, LEAD_ROUNDING_TICKS,
    PITCH_ERROR_SLOPE_MAX, PREVIEW_TICKS_MAX, PitchError, TABLE_POINTS, TAKE_UP_TICKS_MAX, Table, Tables,
};
use motion_kernel::fault::Reaction;
use motion_kernel::homing::HomingConfig;
use motion_kernel::jog::Direction;
use motion_kernel::law::Pulse;
use motion_kernel::units::{Counts, Position};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use toml::Spanned;

use super::error::{MachineError, quote};
use super::law_name::{LAW_NAMES, law_named};
use super::range::{
    AXIS_LETTER, AXIS_NAME, Amplitude, Angle, BlendTolerance, COOLANT_KINDS, Coordinate, CornerAngle,
    CurveShare, Damping, DeadTime, EMERGENCY_STOP, ErrorGrowth, FeedforwardGain, FollowingError, Friction,
    Gain, Inertia, IntegralTime, InverseGain, Jump, JunctionAngle, Lag, LeadTime, Length, LengthOrNone,
    Limit, Load, MassRatio, NAME_CHARACTERS_MAX, NOISE_COUNTS, NOISE_COUNTS_MAX, NOISE_SEED, OutputLimit,
    OutputOffset, PATH_MODE, PitchErrorPoint, Place, Play, PlayOrNone, Positive, REPEATS, Ramp, Resolution,
    Reversal, SPINDLE_TURNS, SUBROUTINE, Spacing, SpindleSpeed, SpindleTime, StopTime, TIMER_BITS,
    TablePoint, TakeUp, Tick, Velocity, Watch, Within,
};
use super::settings::{
    AxisSettings, BLEND_TOLERANCE_MM, CORNER_ANGLE_DEG, CoolantSettings, DefaultPathMode, FaultSettings,
    HomingSettings, Machine, PathSettings, SpindleSettings, ToolSettings,
};

use crate::gcode::{AXES_MAX, Axis};
use crate::touch::{Surface, TouchBox};

/// Seconds per minute: feeds in mm/min exist in this file only.
const S_PER_MIN: f64 = 60.0;
/// An encoder's register tells a move from its complement only while the axis moves by less than half the
/// register from one tick to the next. An axis may be faster than its feed, while it overshoots or catches
/// up, and readings have noise: it is held to twice its feed.
const TIMER_MARGIN: f64 = 2.0;

pub(super) fn read(source_name: &str, text: &str) -> Result<Machine<AXES_MAX>, MachineError> {
    let file: MachineFile =
        toml::from_str(text).map_err(|error| MachineError::from_reader(source_name, text, &error))?;
    let refuse = |at: Range<usize>, expected: String| {
        let problem = format!("found {}, expected {expected}", quote(text, &at));
        MachineError::new(source_name, text, &at, problem)
    };
    let tick_s = file.tick_s.0;
    let axes: Vec<(Places, AxisSettings)> = file
        .axis
        .into_iter()
        .zip(Axis::ALL)
        .map(|(axis, place)| (axis.places(), axis.settings(place)))
        .collect();
    for (index, (places, axis)) in axes.iter().enumerate() {
        let others =
            || axes.iter().enumerate().filter(|&(other, _)| other != index).map(|(_, (_, other))| other);
        if others().any(|other| other.name == axis.name) {
            return Err(refuse(places.name.clone(), "a name that no other axis has".to_owned()));
        }
        let at = places.letter.as_ref().unwrap_or(&places.name);
        if others().any(|other| other.letter == axis.letter) {
            return Err(refuse(at.clone(), "a letter that no other axis has".to_owned()));
        }
        let named = Some(axis.name.as_bytes())
            .filter(|name| name.len() == 1)
            .and_then(|name| Axis::of_letter(name[0]));
        if let (Some(named), Some(letter)) = (named, axis.letter)
            && named != letter
        {
            let expected =
                format!("{letter} or a name that is no axis' letter: the axis is moved by {letter}");
            return Err(refuse(places.name.clone(), expected));
        }
        if axis.output_offset_v.abs() >= axis.output_limit_v {
            let limit_v = axis.output_limit_v;
            return Err(refuse(places.offset_v.clone(), format!("a magnitude below limit_v = {limit_v}")));
        }
        let reachable_mm_s = axis.reachable_mm_s();
        if axis.feed_mm_s > reachable_mm_s {
            let expected = format!("at most {reachable_mm_s:.6}, the velocity at the output's limit");
            return Err(refuse(places.feed_mm_s.clone(), expected));
        }
        let bits = timer_bits(axis.timer);
        let least_mm = TIMER_MARGIN * axis.feed_mm_s * tick_s / f64::from(1_u32 << (bits - 1));
        if axis.mm_per_count <= least_mm {
            let feed_mm_s = axis.feed_mm_s;
            let expected = format!(
                "above {least_mm:e}: at {TIMER_MARGIN} times feed_mm_s = {feed_mm_s} a tick must be less than \
                 half the register of timer_bits = {bits}"
            );
            return Err(refuse(places.mm_per_count.clone(), expected));
        }
        let &AxisSettings { feedforward: Feedforward { lead_s, drive, .. }, .. } = axis;
        if let Some(at) = &places.lead_s
            && lead_s / tick_s > f64::from(PREVIEW_TICKS_MAX) + LEAD_ROUNDING_TICKS
        {
            let most_s = f64::from(PREVIEW_TICKS_MAX) * tick_s;
            let expected = format!("at most {most_s}, {PREVIEW_TICKS_MAX} ticks of tick_s = {tick_s}");
            return Err(refuse(at.clone(), expected));
        }
        if let (Some(places), Some(HomingSettings { config, .. })) = (&places.homing, axis.homing) {
            let is_rotary = axis.letter.is_some_and(Axis::is_rotary);
            let path_mm_s = if is_rotary { f64::INFINITY } else { file.path.feed_mm_s.0 };
            let feed_mm_s = axis.feed_mm_s.min(path_mm_s);
            for (at, homing_mm_s) in
                [(&places.search_mm_s, config.fast_mm_s), (&places.approach_mm_s, config.slow_mm_s)]
            {
                if homing_mm_s > feed_mm_s {
                    return Err(refuse(
                        at.clone(),
                        format!("a magnitude of at most feed_mm_s = {feed_mm_s}"),
                    ));
                }
            }
            if let Some((every_mm, at)) = &places.index_every_mm
                && *every_mm > 0.0
                && *every_mm < axis.mm_per_count
            {
                let expected = format!("0, or at least mm_per_count = {}", axis.mm_per_count);
                return Err(refuse(at.clone(), expected));
            }
        }
        if let (Some(at), Some(drive)) = (&places.inverse_integral_time_s, drive)
            && drive.integral_time_s < tick_s
        {
            return Err(refuse(at.clone(), format!("at least tick_s = {tick_s}")));
        }
        if let (Some(at), Some(bed)) = (&places.inverse_bed_hz, drive.and_then(|drive| drive.bed))
            && bed.frequency_hz * tick_s >= BED_TICK_SHARE_MAX
        {
            let below_hz = BED_TICK_SHARE_MAX / tick_s;
            let expected = format!("below {below_hz}, a quarter of the frequency of tick_s = {tick_s}");
            return Err(refuse(at.clone(), expected));
        }
    }
    for (places, axis) in &axes {
        let Some(AxisCompensation { backlash, pitch_error }) = &axis.compensation else { continue };
        if let (Some(at), Some(backlash)) = (&places.take_up_s, backlash) {
            let least_s = axis.take_up_s(backlash.play_mm);
            if backlash.take_up_s < least_s {
                let expected = format!(
                    "at least {least_s:.6}, for at most feed_mm_s and half of the acceleration that the drive has"
                );
                return Err(refuse(at.clone(), expected));
            }
            let ticks = (backlash.take_up_s / tick_s).round();
            if !(1.0..=TAKE_UP_TICKS_MAX).contains(&ticks) {
                let expected = format!("from 1 to {TAKE_UP_TICKS_MAX} ticks of tick_s = {tick_s}");
                return Err(refuse(at.clone(), expected));
            }
        }
        if let (Some(at), Some(error)) = (&places.points_um, pitch_error) {
            let slope = error.slope();
            if slope > PITCH_ERROR_SLOPE_MAX {
                let expected =
                    format!("at most {PITCH_ERROR_SLOPE_MAX} mm/mm from point to point (here {slope:.4})");
                return Err(refuse(at.clone(), expected));
            }
            let most_mm_s2 = axis.drive_accel_mm_s2() - axis.accel_mm_s2;
            let accel_mm_s2 = error.curvature() * axis.feed_mm_s * axis.feed_mm_s;
            if accel_mm_s2 > most_mm_s2 {
                let expected = format!(
                    "a curve along which the motor needs at most {most_mm_s2:.0} mm/s² at feed_mm_s, what the drive has \
                     beyond accel_mm_s2 (here {accel_mm_s2:.0})"
                );
                return Err(refuse(at.clone(), expected));
            }
        }
    }
    for touch in file.probe.iter().flat_map(|probe| &probe.boxes) {
        let high_mm = touch.high_mm.each_ref().map(|high_mm| high_mm.0);
        for (low_mm, high_mm) in touch.low_mm.iter().zip(high_mm) {
            if low_mm.get_ref().0 >= high_mm {
                return Err(refuse(low_mm.span(), format!("less than high_mm = {high_mm} of the same axis")));
            }
        }
    }
    for (places, axis) in &axes {
        if let (Some(at), Some([low_mm, high_mm])) = (&places.low_mm, axis.travel_mm)
            && low_mm >= high_mm
        {
            return Err(refuse(at.clone(), format!("less than high_mm = {high_mm}")));
        }
        let limit_mm = axis.following_error_limit_mm;
        if let (Some(at), Some(guard)) = (&places.error_at_rest_mm, axis.guard)
            && guard.following_error_at_rest_mm > limit_mm
        {
            return Err(refuse(at.clone(), format!("at most following_error_limit_mm = {limit_mm}")));
        }
    }
    // What only the kernel's numbers can't hold, or does not go together, has no key of its own: it stands at
    // the axis.
    let settings: [AxisSettings; AXES_MAX] = std::array::from_fn(|index| {
        axes.get(index).map_or_else(AxisSettings::idle, |(_, axis)| axis.clone())
    });
    let figures = settings.each_ref().map(AxisSettings::figures);
    let faults = file.faults.map_or_else(FaultSettings::default, |faults| faults.settings());
    let guards = Guards {
        axes: settings.each_ref().map(|axis| Some(axis.guard_figures(tick_s))),
        reactions: faults.reactions(tick_s),
    };
    let compensation = Compensation { axes: settings.each_ref().map(|axis| axis.compensation) };
    let config = AxesConfig::<f32, AXES_MAX>::new(&figures, tick_s)
        .and_then(|axes| axes.guarded(&guards, tick_s))
        .and_then(|axes| axes.compensated(&compensation, tick_s));
    if let Err(error) = config {
        let (places, axis) = &axes[error.axis];
        let cause = error.cause;
        let problem = format!(
            "axis {}: found {} {}, expected {}",
            axis.name, cause.quantity, cause.value, cause.expected
        );
        return Err(MachineError::new(source_name, text, &places.name, problem));
    }
    Ok(Machine {
        name: file.name,
        tick_s,
        path: file.path.settings(),
        axes: settings,
        faults,
        tool: file.tool.map_or_else(ToolSettings::default, ToolTable::settings),
        probe: file.probe.map(|probe| probe.surface()),
        spindle: file.spindle.map(|spindle| spindle.settings()),
        coolant: file.coolant.map(|coolant| coolant.kinds.map_or(Kinds::BOTH, |kinds| kinds.0)),
    })
}

/// The places of an axis' keys that rules of several keys are about.
struct Places {
    name: Range<usize>,
    letter: Option<Range<usize>>,
    feed_mm_s: Range<usize>,
    offset_v: Range<usize>,
    mm_per_count: Range<usize>,
    lead_s: Option<Range<usize>>,
    inverse_integral_time_s: Option<Range<usize>>,
    inverse_bed_hz: Option<Range<usize>>,
    low_mm: Option<Range<usize>>,
    homing: Option<HomingPlaces>,
    error_at_rest_mm: Option<Range<usize>>,
    take_up_s: Option<Range<usize>>,
    points_um: Option<Range<usize>>,
}

struct HomingPlaces {
    search_mm_s: Range<usize>,
    approach_mm_s: Range<usize>,
    index_every_mm: Option<(f64, Range<usize>)>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MachineFile {
    name: String,
    tick_s: Within<Tick>,
    path: PathTable,
    faults: Option<FaultsTable>,
    tool: Option<ToolTable>,
    probe: Option<ProbeTable>,
    spindle: Option<SpindleTable>,
    coolant: Option<CoolantTable>,
    #[serde(deserialize_with = "one_to_nine_axes")]
    axis: Vec<AxisTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathTable {
    feed_mm_s: Within<Limit>,
    accel_mm_s2: Within<Limit>,
    jerk_mm_s3: Within<Limit>,
    snap_mm_s4: Within<Limit>,
    law: Option<LawName>,
    junction_angle_deg: Within<JunctionAngle>,
    accel_step_mm_s2: Within<Limit>,
    curve_feed_share: Within<CurveShare>,
    mode: Option<PathModeName>,
    blend_tolerance_mm: Option<Within<BlendTolerance>>,
    corner_angle_deg: Option<Within<CornerAngle>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisTable {
    name: Spanned<AxisName>,
    letter: Option<Spanned<AxisLetter>>,
    feed_mm_s: Spanned<Within<Limit>>,
    accel_mm_s2: Within<Limit>,
    jerk_mm_s3: Within<Limit>,
    snap_mm_s4: Within<Limit>,
    following_error_limit_mm: Within<FollowingError>,
    travel: Option<TravelTable>,
    guard: Option<GuardTable>,
    encoder: EncoderTable,
    output: OutputTable,
    regulator: RegulatorTable,
    compensation: Option<CompensationTable>,
    homing: Option<HomingTable>,
    drive: DriveTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FaultsTable {
    ramp_s: Option<Within<Ramp>>,
    stop_s: Option<Within<StopTime>>,
    emergency_stop: Option<EmergencyStop>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolTable {
    change_subroutine: Option<SubroutineName>,
    radius_mm: Option<Within<LengthOrNone>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProbeTable {
    #[serde(rename = "box")]
    boxes: Vec<BoxTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SpindleTable {
    speed_max_rpm: Within<SpindleSpeed>,
    start_s: Within<SpindleTime>,
    stop_s: Option<Within<SpindleTime>>,
    turns: Option<Turns>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxTable {
    low_mm: [Spanned<Within<Coordinate>>; 3],
    high_mm: [Within<Coordinate>; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CoolantTable {
    kinds: Option<Kinds>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TravelTable {
    low_mm: Spanned<Within<Coordinate>>,
    high_mm: Within<Coordinate>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GuardTable {
    following_error_at_rest_mm: Spanned<Within<FollowingError>>,
    following_error_per_velocity_s: Within<ErrorGrowth>,
    following_error_per_accel_s2: Within<ErrorGrowth>,
    jump_mm: Within<Jump>,
    moving_mm_s: Within<Limit>,
    response_s: Within<Watch>,
    load_accel_mm_s2: Within<Load>,
    saturation_s: Within<Watch>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EncoderTable {
    mm_per_count: Spanned<Within<Resolution>>,
    #[serde(default)]
    timer_bits: Timer,
    #[serde(default)]
    noise_counts: NoiseCounts,
    #[serde(default)]
    noise_seed: Seed,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutputTable {
    mm_min_at_10_v: Within<Velocity>,
    offset_v: Spanned<Within<OutputOffset>>,
    limit_v: Within<OutputLimit>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RegulatorTable {
    kp_per_s: Within<Gain>,
    ki_per_s2: Within<Gain>,
    kd: Within<Gain>,
    feedforward_velocity: Within<FeedforwardGain>,
    feedforward_accel_s: Within<FeedforwardGain>,
    feedforward_jerk_s2: Within<FeedforwardGain>,
    feedforward_lead_s: Option<Spanned<Within<LeadTime>>>,
    feedforward_velocity_table: Option<TableTable>,
    feedforward_accel_table: Option<TableTable>,
    feedforward_jerk_table: Option<TableTable>,
    inverse: Option<InverseTable>,
}

/// Tables of velocity commands; the reach has the unit of what they are over.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TableTable {
    reach: Within<Limit>,
    mm_s: [Within<TablePoint>; TABLE_POINTS],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InverseTable {
    velocity_gain_per_s: Within<InverseGain>,
    integral_time_s: Spanned<Within<IntegralTime>>,
    current_lag_s: Within<Lag>,
    viscous_friction_per_s: Within<Friction>,
    coulomb_friction_mm_s2: Within<Friction>,
    reversal_mm_s: Within<Reversal>,
    bed: Option<InverseBedTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InverseBedTable {
    frequency_hz: Spanned<Within<Positive>>,
    damping_ratio: Within<Damping>,
    mass_ratio: Within<MassRatio>,
}

impl FaultsTable {
    fn settings(&self) -> FaultSettings {
        let default = FaultSettings::default();
        FaultSettings {
            ramp_s: self.ramp_s.as_ref().map_or(default.ramp_s, |time| time.0),
            stop_s: self.stop_s.as_ref().map_or(default.stop_s, |time| time.0),
            emergency_stop: self.emergency_stop.as_ref().map_or(default.emergency_stop, |stop| stop.0),
        }
    }
}

impl ToolTable {
    fn settings(self) -> ToolSettings {
        ToolSettings {
            change_subroutine: self.change_subroutine.and_then(|name| name.0),
            radius_mm: self.radius_mm.map_or(0.0, |radius_mm| radius_mm.0),
        }
    }
}

impl ProbeTable {
    fn surface(&self) -> Surface {
        let touch = |touch: &BoxTable| TouchBox {
            low_mm: touch.low_mm.each_ref().map(|low_mm| low_mm.get_ref().0),
            high_mm: touch.high_mm.each_ref().map(|high_mm| high_mm.0),
        };
        Surface { boxes: self.boxes.iter().map(touch).collect() }
    }
}

impl SpindleTable {
    fn settings(&self) -> SpindleSettings {
        SpindleSettings {
            speed_max_rpm: self.speed_max_rpm.0,
            start_s: self.start_s.0,
            stop_s: self.stop_s.as_ref().map_or(0.0, |time| time.0),
            reverses: self.turns.as_ref().is_none_or(|turns| turns.reverses),
        }
    }
}

impl GuardTable {
    fn figures(&self) -> GuardFigures {
        GuardFigures {
            following_error_at_rest_mm: self.following_error_at_rest_mm.get_ref().0,
            following_error_per_velocity_s: self.following_error_per_velocity_s.0,
            following_error_per_accel_s2: self.following_error_per_accel_s2.0,
            jump_mm: self.jump_mm.0,
            moving_mm_s: self.moving_mm_s.0,
            response_s: self.response_s.0,
            load_accel_mm_s2: self.load_accel_mm_s2.0,
            saturation_s: self.saturation_s.0,
            // The axis' own.
            noise_counts: 0,
            travel_mm: None,
        }
    }
}

impl TableTable {
    fn table(&self) -> Table {
        Table::new(self.reach.0, &self.mm_s.each_ref().map(|point| point.0))
    }
}

impl InverseTable {
    fn drive(&self) -> DriveInverse {
        DriveInverse {
            velocity_gain_per_s: self.velocity_gain_per_s.0,
            integral_time_s: self.integral_time_s.get_ref().0,
            current_lag_s: self.current_lag_s.0,
            viscous_friction_per_s: self.viscous_friction_per_s.0,
            coulomb_friction_mm_s2: self.coulomb_friction_mm_s2.0,
            reversal_mm_s: self.reversal_mm_s.0,
            bed: self.bed.as_ref().map(|bed| BedInverse {
                frequency_hz: bed.frequency_hz.get_ref().0,
                damping_ratio: bed.damping_ratio.0,
                mass_ratio: bed.mass_ratio.0,
            }),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CompensationTable {
    backlash: Option<BacklashTable>,
    pitch_error: Option<PitchErrorTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BacklashTable {
    play_mm: Within<Play>,
    take_up_s: Spanned<Within<TakeUp>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PitchErrorTable {
    start_mm: Within<Coordinate>,
    spacing_mm: Within<Spacing>,
    points_um: Spanned<Points>,
    #[serde(default)]
    repeats: Repeats,
}

impl CompensationTable {
    /// None where neither is there.
    fn compensation(&self) -> Option<AxisCompensation> {
        let backlash = self.backlash.as_ref().map(|backlash| Backlash {
            play_mm: backlash.play_mm.0,
            take_up_s: backlash.take_up_s.get_ref().0,
        });
        let pitch_error = self.pitch_error.as_ref().and_then(|error| {
            // As many points as a table has, each within its range.
            let Points(points_um) = error.points_um.get_ref();
            PitchError::new(error.start_mm.0, error.spacing_mm.0, points_um, error.repeats.0)
        });
        (backlash.is_some() || pitch_error.is_some()).then_some(AxisCompensation { backlash, pitch_error })
    }
}

/// The points of a pitch error.
struct Points(Vec<f64>);

impl<'de> Deserialize<'de> for Points {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let points = Vec::<Within<PitchErrorPoint>>::deserialize(deserializer)?;
        match points.len() {
            2..=COMPENSATION_POINTS_MAX => Ok(Self(points.iter().map(|point| point.0).collect())),
            count => {
                Err(D::Error::custom(format!("{count} points_um, expected 2 to {COMPENSATION_POINTS_MAX}")))
            }
        }
    }
}

/// Whether a table repeats.
#[derive(Default)]
struct Repeats(bool);

impl<'de> Deserialize<'de> for Repeats {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        let refused = || D::Error::custom(format!("repeats = {value}, expected {REPEATS}"));
        value.as_bool().map(Self).ok_or_else(refused)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HomingTable {
    search_mm_s: Spanned<Within<Velocity>>,
    approach_mm_s: Spanned<Within<Limit>>,
    travel_mm: Within<Length>,
    back_off_mm: Within<Length>,
    index_mm: Option<Within<LengthOrNone>>,
    position_mm: Within<Place>,
    park_mm: Within<Place>,
    simulated: Option<SimulatedHomeTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SimulatedHomeTable {
    closes_mm: Within<Place>,
    length_mm: Within<Length>,
    hysteresis_mm: Within<LengthOrNone>,
    index_every_mm: Option<Spanned<Within<LengthOrNone>>>,
    index_at_mm: Option<Within<Place>>,
}

impl HomingTable {
    fn settings(&self, mm_per_count: f64) -> HomingSettings {
        let search_mm_s = self.search_mm_s.get_ref().0;
        let direction = if search_mm_s > 0.0 { Direction::Positive } else { Direction::Negative };
        // Ranges of lengths and places are those of positions.
        let position = |place: &Within<Place>| Position::from_mm(place.0).unwrap_or_default();
        let config = HomingConfig {
            direction,
            fast_mm_s: search_mm_s.abs(),
            slow_mm_s: self.approach_mm_s.get_ref().0,
            travel_mm: self.travel_mm.0,
            back_off_mm: self.back_off_mm.0,
            index_mm: self.index_mm.as_ref().map(|index_mm| index_mm.0).filter(|&index_mm| index_mm > 0.0),
            position: position(&self.position_mm),
            park: Some(position(&self.park_mm)),
        };
        let simulated = self.simulated.as_ref();
        let simulated = simulated.map(|simulated| simulated.parameters(direction, mm_per_count));
        HomingSettings { config, simulated: simulated.unwrap_or_default() }
    }
}

impl SimulatedHomeTable {
    fn parameters(&self, direction: Direction, mm_per_count: f64) -> HomeParameters {
        let (closes_mm, length_mm) = (self.closes_mm.0, self.length_mm.0);
        let closes_mm = match direction {
            Direction::Positive => (closes_mm, closes_mm + length_mm),
            Direction::Negative => (closes_mm - length_mm, closes_mm),
        };
        let counts = |mm: f64| (mm / mm_per_count).round() as i64;
        let every = counts(self.index_every_mm.as_ref().map_or(0.0, |every_mm| every_mm.get_ref().0));
        let at = counts(self.index_at_mm.as_ref().map_or(0.0, |at_mm| at_mm.0));
        HomeParameters {
            switch: Some(SwitchParameters { closes_mm, hysteresis_mm: self.hysteresis_mm.0 }),
            index: (every > 0).then_some(IndexParameters { counts: every, at: Counts(at) }),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DriveTable {
    velocity_gain_per_s: Within<Positive>,
    integral_time_s: Within<Positive>,
    current_lag_s: Within<Gain>,
    dead_time_s: Within<DeadTime>,
    command_filter_s: Within<Gain>,
    accel_limit_mm_s2: Within<Positive>,
    load_inertia_ratio: Within<Inertia>,
    coulomb_friction_mm_s2: Within<Gain>,
    viscous_friction_per_s: Within<Gain>,
    bed: Option<BedTable>,
    screw: Option<ScrewTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BedTable {
    frequency_hz: Within<Positive>,
    damping_ratio: Within<Gain>,
    mass_ratio: Within<Positive>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScrewTable {
    pitch_mm: Within<Length>,
    pitch_error_um: Option<Within<Amplitude>>,
    pitch_phase_deg: Option<Within<Angle>>,
    backlash_mm: Option<Within<PlayOrNone>>,
}

impl ScrewTable {
    fn parameters(&self) -> ScrewParameters {
        let amplitude_mm = self.pitch_error_um.as_ref().map_or(0.0, |error_um| error_um.0) * 1e-3;
        let phase_rad = self.pitch_phase_deg.as_ref().map_or(0.0, |phase_deg| phase_deg.0).to_radians();
        let error = PitchErrorParameters { pitch_mm: self.pitch_mm.0, amplitude_mm, phase_rad };
        ScrewParameters {
            pitch_error: (amplitude_mm > 0.0).then_some(error),
            backlash_mm: self.backlash_mm.as_ref().map_or(0.0, |play_mm| play_mm.0),
        }
    }
}

impl PathTable {
    fn settings(&self) -> PathSettings {
        PathSettings {
            feed_mm_s: self.feed_mm_s.0,
            accel_mm_s2: self.accel_mm_s2.0,
            jerk_mm_s3: self.jerk_mm_s3.0,
            snap_mm_s4: self.snap_mm_s4.0,
            pulse: self.law.as_ref().map_or_else(Pulse::default, |law| law.0),
            junction_angle_rad: self.junction_angle_deg.0.to_radians(),
            accel_step_mm_s2: self.accel_step_mm_s2.0,
            curve_feed_share: self.curve_feed_share.0,
            mode: self.mode.as_ref().map_or_else(DefaultPathMode::default, |mode| mode.0),
            blend_tolerance_mm: self
                .blend_tolerance_mm
                .as_ref()
                .map_or(BLEND_TOLERANCE_MM, |tolerance| tolerance.0),
            corner_angle_rad: self
                .corner_angle_deg
                .as_ref()
                .map_or(CORNER_ANGLE_DEG, |angle| angle.0)
                .to_radians(),
        }
    }
}

impl AxisTable {
    fn places(&self) -> Places {
        let inverse = self.regulator.inverse.as_ref();
        let bed = inverse.and_then(|inverse| inverse.bed.as_ref());
        let homing = self.homing.as_ref().map(|homing| HomingPlaces {
            search_mm_s: homing.search_mm_s.span(),
            approach_mm_s: homing.approach_mm_s.span(),
            index_every_mm: homing.simulated.as_ref().and_then(|simulated| {
                let every_mm = simulated.index_every_mm.as_ref()?;
                Some((every_mm.get_ref().0, every_mm.span()))
            }),
        });
        let compensation = self.compensation.as_ref();
        let backlash = compensation.and_then(|compensation| compensation.backlash.as_ref());
        let error = compensation.and_then(|compensation| compensation.pitch_error.as_ref());
        Places {
            take_up_s: backlash.map(|backlash| backlash.take_up_s.span()),
            points_um: error.map(|error| error.points_um.span()),
            homing,
            lead_s: self.regulator.feedforward_lead_s.as_ref().map(Spanned::span),
            inverse_integral_time_s: inverse.map(|inverse| inverse.integral_time_s.span()),
            inverse_bed_hz: bed.map(|bed| bed.frequency_hz.span()),
            name: self.name.span(),
            letter: self.letter.as_ref().map(Spanned::span),
            feed_mm_s: self.feed_mm_s.span(),
            offset_v: self.output.offset_v.span(),
            mm_per_count: self.encoder.mm_per_count.span(),
            low_mm: self.travel.as_ref().map(|travel| travel.low_mm.span()),
            error_at_rest_mm: self.guard.as_ref().map(|guard| guard.following_error_at_rest_mm.span()),
        }
    }

    /// `place` is the axis that it is without a letter of its own.
    fn settings(self, place: Axis) -> AxisSettings {
        let noise = match self.encoder.noise_counts.0 {
            0 => None,
            amplitude_counts => Some(EncoderNoise { amplitude_counts, seed: self.encoder.noise_seed.0 }),
        };
        let mm_per_count = self.encoder.mm_per_count.into_inner().0;
        AxisSettings {
            letter: Some(self.letter.map_or(place, |letter| letter.into_inner().0)),
            name: self.name.into_inner().0,
            feed_mm_s: self.feed_mm_s.into_inner().0,
            accel_mm_s2: self.accel_mm_s2.0,
            jerk_mm_s3: self.jerk_mm_s3.0,
            snap_mm_s4: self.snap_mm_s4.0,
            following_error_limit_mm: self.following_error_limit_mm.0,
            guard: self.guard.as_ref().map(GuardTable::figures),
            travel_mm: self.travel.as_ref().map(|travel| [travel.low_mm.get_ref().0, travel.high_mm.0]),
            mm_per_count,
            timer: self.encoder.timer_bits.0,
            noise,
            mm_s_at_10_v: self.output.mm_min_at_10_v.0 / S_PER_MIN,
            output_offset_v: self.output.offset_v.into_inner().0,
            output_limit_v: self.output.limit_v.0,
            gains: Gains {
                kp_per_s: self.regulator.kp_per_s.0,
                ki_per_s2: self.regulator.ki_per_s2.0,
                kd: self.regulator.kd.0,
            },
            feedforward: Feedforward {
                velocity: self.regulator.feedforward_velocity.0,
                accel_s: self.regulator.feedforward_accel_s.0,
                jerk_s2: self.regulator.feedforward_jerk_s2.0,
                lead_s: self.regulator.feedforward_lead_s.map_or(0.0, |lead| lead.into_inner().0),
                tables: Tables {
                    velocity: self.regulator.feedforward_velocity_table.as_ref().map(TableTable::table),
                    accel: self.regulator.feedforward_accel_table.as_ref().map(TableTable::table),
                    jerk: self.regulator.feedforward_jerk_table.as_ref().map(TableTable::table),
                },
                drive: self.regulator.inverse.as_ref().map(InverseTable::drive),
            },
            compensation: self.compensation.as_ref().and_then(CompensationTable::compensation),
            homing: self.homing.as_ref().map(|homing| homing.settings(mm_per_count)),
            drive: self.drive.parameters(),
            screw: self.drive.screw.as_ref().map_or_else(ScrewParameters::default, ScrewTable::parameters),
        }
    }
}

impl DriveTable {
    fn parameters(&self) -> DriveParameters {
        DriveParameters {
            velocity_gain_per_s: self.velocity_gain_per_s.0,
            integral_time_s: self.integral_time_s.0,
            current_lag_s: self.current_lag_s.0,
            dead_time_s: self.dead_time_s.0,
            command_filter_s: self.command_filter_s.0,
            accel_limit_mm_s2: self.accel_limit_mm_s2.0,
            load_inertia_ratio: self.load_inertia_ratio.0,
            coulomb_friction_mm_s2: self.coulomb_friction_mm_s2.0,
            viscous_friction_per_s: self.viscous_friction_per_s.0,
            bed: self.bed.as_ref().map(|bed| BedMode {
                frequency_hz: bed.frequency_hz.0,
                damping_ratio: bed.damping_ratio.0,
                mass_ratio: bed.mass_ratio.0,
            }),
        }
    }
}

fn one_to_nine_axes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<AxisTable>, D::Error> {
    let axes = Vec::<AxisTable>::deserialize(deserializer)?;
    match axes.len() {
        1..=AXES_MAX => Ok(axes),
        count => Err(D::Error::custom(format!("{count} [[axis]] tables, expected 1 to {AXES_MAX}"))),
    }
}

/// The letter of the words that move an axis.
struct AxisLetter(Axis);

impl<'de> Deserialize<'de> for AxisLetter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        let letter = value.as_str().map(str::as_bytes).filter(|letter| letter.len() == 1);
        match letter.and_then(|letter| Axis::of_letter(letter[0])) {
            Some(axis) => Ok(Self(axis)),
            None => Err(D::Error::custom(format!("letter = {value}, expected {AXIS_LETTER}"))),
        }
    }
}

/// A name that can head a column.
struct AxisName(String);

impl<'de> Deserialize<'de> for AxisName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let fits = (1..=NAME_CHARACTERS_MAX).contains(&name.len());
        if fits && name.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
            Ok(Self(name))
        } else {
            Err(D::Error::custom(format!("name {name:?}, expected {AXIS_NAME}")))
        }
    }
}

/// The reaction of the emergency stop.
struct EmergencyStop(Reaction);

impl<'de> Deserialize<'de> for EmergencyStop {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("immediate") => Ok(Self(Reaction::Immediate)),
            Some("ramp") => Ok(Self(Reaction::Ramp)),
            Some("stop") => Ok(Self(Reaction::Stop)),
            _ => Err(D::Error::custom(format!("emergency_stop = {value}, expected {EMERGENCY_STOP}"))),
        }
    }
}

/// Which way the spindle turns.
struct Turns {
    reverses: bool,
}

impl<'de> Deserialize<'de> for Turns {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("both") => Ok(Self { reverses: true }),
            Some("clockwise") => Ok(Self { reverses: false }),
            _ => Err(D::Error::custom(format!("turns = {value}, expected {SPINDLE_TURNS}"))),
        }
    }
}

/// The kinds of coolant.
struct Kinds(CoolantSettings);

impl Kinds {
    const BOTH: CoolantSettings = CoolantSettings { flood: true, mist: true };
}

impl<'de> Deserialize<'de> for Kinds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("both") => Ok(Self(Self::BOTH)),
            Some("flood") => Ok(Self(CoolantSettings { flood: true, mist: false })),
            Some("mist") => Ok(Self(CoolantSettings { flood: false, mist: true })),
            _ => Err(D::Error::custom(format!("kinds = {value}, expected {COOLANT_KINDS}"))),
        }
    }
}

/// A name of a subroutine, in lower case; none if it is empty.
struct SubroutineName(Option<String>);

impl<'de> Deserialize<'de> for SubroutineName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        let is_name =
            |name: &&str| name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
        match value.as_str().filter(is_name) {
            Some(name) => Ok(Self(Some(name.to_ascii_lowercase()).filter(|name| !name.is_empty()))),
            None => Err(D::Error::custom(format!("change_subroutine = {value}, expected {SUBROUTINE}"))),
        }
    }
}

/// The shape of the pulses of jerk.
struct LawName(Pulse);

impl<'de> Deserialize<'de> for LawName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        let refused = || D::Error::custom(format!("law = {value}, expected {LAW_NAMES}"));
        law_named(value.as_str()).map(Self).ok_or_else(refused)
    }
}

/// How corners are passed before a program says so.
struct PathModeName(DefaultPathMode);

impl<'de> Deserialize<'de> for PathModeName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("blend") => Ok(Self(DefaultPathMode::Blend)),
            Some("exact") => Ok(Self(DefaultPathMode::Exact)),
            _ => Err(D::Error::custom(format!("mode = {value}, expected {PATH_MODE}"))),
        }
    }
}

/// The width of a counter register.
struct Timer(TimerBits);

fn timer_bits(timer: TimerBits) -> u32 {
    match timer {
        TimerBits::Sixteen => 16,
        TimerBits::ThirtyTwo => 32,
    }
}

impl Default for Timer {
    fn default() -> Self {
        Self(TimerBits::ThirtyTwo)
    }
}

impl<'de> Deserialize<'de> for Timer {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match i64::deserialize(deserializer)? {
            16 => Ok(Self(TimerBits::Sixteen)),
            32 => Ok(Self(TimerBits::ThirtyTwo)),
            bits => Err(D::Error::custom(format!("timer_bits = {bits}, expected {TIMER_BITS}"))),
        }
    }
}

/// Amplitude of an encoder's noise.
#[derive(Default)]
struct NoiseCounts(u16);

impl<'de> Deserialize<'de> for NoiseCounts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let counts = i64::deserialize(deserializer)?;
        match u16::try_from(counts) {
            Ok(counts) if counts <= NOISE_COUNTS_MAX => Ok(Self(counts)),
            _ => Err(D::Error::custom(format!("noise_counts = {counts}, expected {NOISE_COUNTS}"))),
        }
    }
}

/// Seed of an encoder's noise.
struct Seed(u64);

impl Default for Seed {
    fn default() -> Self {
        Self(1)
    }
}

impl<'de> Deserialize<'de> for Seed {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let seed = i64::deserialize(deserializer)?;
        let refused = |_| D::Error::custom(format!("noise_seed = {seed}, expected {NOISE_SEED}"));
        u64::try_from(seed).map(Self).map_err(refused)
    }
}
