//! Guards of an axis: whether encoder, drive and set-point make sense together.
//!
//! In the tick, with the feature `guards`. Two comparisons per axis and tick; a suspicious axis is judged in
//! a separate path. Every [`SAMPLE_TICKS`] ticks one axis is sampled, also in a separate path. No loop, no
//! failure: a fault is reported.
//!
//! With the following error ε, the set velocity v and acceleration a of the tick, the drive's greatest
//! acceleration a_d, the axis' greatest A, and a noise of n counts of the size q:
//!
//! - **following error**: |ε| ≤ min(limit, rest + τv·|v| + τa·|a|). A drive that follows its command T_d late
//!   gives ε = ((1 − F_V)·v + (T_d − F_a)·a)/kp, so τv is a fraction of 1/kp and τa a fraction of T_d/kp;
//! - **jump**: |Δ²ε| ≤ 2·((A + a_d)·T² + (2 + 4n)·q). A motor or an accepted set-point can cause at most half
//!   of it each. If more than half of it shows in the counts, the encoder jumped, otherwise the set-point;
//! - **encoder lost**: no counts while the command is above `moving_mm_s`, over `response_s`;
//! - **runaway**: the axis loses velocity towards its command at more than `load_accel_mm_s2`, which no load
//!   does, or moves against its command without braking for longer than `response_s`. The first is not judged
//!   within `response_s` of a take-up of backlash;
//! - **saturation**: the output is at its limit in every sample over `saturation_s`;
//! - **soft limit**: the set position is beyond the travel and moves farther out.
//!
//! Comparisons are written so that NaN is a fault.

use serde::{Deserialize, Serialize};

use super::check::{Check, fits};
use super::{AxesConfig, AxesError, AxisConfig, AxisOutput, AxisState, GuardFigures, Guards};
use crate::num::Real;
use crate::path::Setpoint;
use crate::units::{Counts, Position};

/// Time from one axis' sample to the next axis' \[ticks\].
pub(crate) const SAMPLE_TICKS: u8 = 8;
/// Being beyond the travel by less is no fault \[mm\]: positions are rounded.
const TRAVEL_ROUNDING_MM: f64 = 2.0e-3;
/// Least value of a figure that is not 0.
const LEAST: f64 = 1.0e-9;
/// Command in counts per tick at which an axis that stands still for two ticks has lost its encoder.
const COUNTS_A_TICK: i32 = 4;

/// The configuration, fixed while the axis runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GuardConfig<R> {
    at_rest_mm: R,
    per_velocity_s: R,
    per_accel_s2: R,
    jump_mm: R,
    tick_s: R,
    moving_mm_s: R,
    /// Change by load, per tick and per sample, of the distance moved in two ticks \[mm\].
    load_mm: R,
    load_sample_mm: R,
    /// Error by noise of the distance moved in two ticks \[mm\].
    noise_mm: R,
    noise_counts: i32,
    /// Response time in samples of this axis; 0: not watched.
    response_samples: u16,
    saturation_samples: u16,
    travel: Option<[Position; 2]>,
}

impl<R: Real> GuardConfig<R> {
    /// Watches only the limit of the following error, the same in motion as at rest.
    pub(super) fn limit_only(limit_mm: f64) -> Self {
        Self {
            at_rest_mm: R::from_f64(limit_mm),
            per_velocity_s: R::ZERO,
            per_accel_s2: R::ZERO,
            jump_mm: R::from_f64(f64::MAX),
            tick_s: R::ZERO,
            moving_mm_s: R::ZERO,
            load_mm: R::ZERO,
            load_sample_mm: R::ZERO,
            noise_mm: R::ZERO,
            noise_counts: 0,
            response_samples: 0,
            saturation_samples: 0,
            travel: None,
        }
    }

    /// The guards of an axis that is sampled every `sample_ticks` ticks of `tick_s`. Background.
    pub(super) fn new(
        check: &mut Check,
        figures: &GuardFigures,
        config: &AxisConfig<R>,
        sample_ticks: u32,
        tick_s: f64,
    ) -> Self {
        let mut figure = |quantity, value: f64, least: f64| {
            let expected = "a positive number within the kernel's range, or 0 where that means nothing";
            check.that(value >= least && fits::<R>(value), quantity, value, expected);
            R::from_f64(value)
        };
        let least = LEAST;
        let &GuardFigures { response_s, saturation_s, noise_counts, .. } = figures;
        let sample_s = f64::from(sample_ticks) * tick_s;
        let load_mm = 2.0 * figures.load_accel_mm_s2 * tick_s * tick_s;
        let samples = |s: f64| libm::ceil(s / sample_s) as u16;
        let at_rest_mm = figure("following error at rest [mm]", figures.following_error_at_rest_mm, least);
        let per_velocity_s =
            figure("following error per velocity [s]", figures.following_error_per_velocity_s, 0.0);
        let per_accel_s2 =
            figure("following error per acceleration [s²]", figures.following_error_per_accel_s2, 0.0);
        let jump_mm = figure("jump [mm]", figures.jump_mm, least);
        let moving_mm_s = figure("least velocity of a moving axis [mm/s]", figures.moving_mm_s, least);
        figure("acceleration by load [mm/s²]", figures.load_accel_mm_s2, least);
        figure("response [s]", response_s, least);
        figure("saturation [s]", saturation_s, least);
        // The tick compares with the limit in motion only above the limit at rest.
        let is_within = at_rest_mm <= config.following_error_limit_mm;
        let expected = "at most the limit of the following error";
        check.that(is_within, "following error at rest [mm]", figures.following_error_at_rest_mm, expected);
        let travel = figures.travel_mm.map(|[low_mm, high_mm]| {
            let expected = "a travel within the kernel's range, its lower end first";
            let ends = [low_mm - TRAVEL_ROUNDING_MM, high_mm + TRAVEL_ROUNDING_MM].map(Position::from_mm);
            let [Some(low), Some(high)] = ends else {
                check.that(false, "travel [mm]", high_mm - low_mm, expected);
                return [Position::ZERO; 2];
            };
            check.that(low_mm < high_mm, "travel [mm]", high_mm - low_mm, expected);
            [low, high]
        });
        // The difference of two readings, each off by half a count plus the noise.
        let noise_mm = libm::fabs(config.encoder.mm_per_count()) * (1.0 + 2.0 * f64::from(noise_counts));
        Self {
            at_rest_mm,
            per_velocity_s,
            per_accel_s2,
            jump_mm,
            tick_s: R::from_f64(tick_s),
            moving_mm_s,
            load_mm: R::from_f64(load_mm),
            load_sample_mm: R::from_f64(load_mm * f64::from(sample_ticks)),
            noise_mm: R::from_f64(2.0 * noise_mm),
            noise_counts: 2 * i32::from(noise_counts),
            // One more: the first sample may come just before the failure.
            response_samples: samples(response_s).saturating_add(1),
            saturation_samples: samples(saturation_s).saturating_add(1),
            travel,
        }
    }

    /// The limit of the following error in a motion; NaN if a set value is NaN.
    pub(super) fn limit_mm(&self, most_mm: R, setpoint: &Setpoint<R>) -> R {
        let grown_mm = self.at_rest_mm
            + self.per_velocity_s * setpoint.velocity_mm_s.abs()
            + self.per_accel_s2 * setpoint.accel_mm_s2.abs();
        grown_mm.min(most_mm)
    }
}

impl<R: Real, const AXES: usize> AxesConfig<R, AXES> {
    /// The same axes with all guards and reactions of `guards`, for a control tick of `tick_s`. Background.
    ///
    /// # Errors
    /// The first figure that is out of its range or beyond the number type.
    pub fn guarded(mut self, guards: &Guards<AXES>, tick_s: f64) -> Result<Self, AxesError> {
        let sample_ticks = u32::from(SAMPLE_TICKS) * AXES as u32;
        self.reactions = guards.reactions;
        for (axis, (config, figures)) in self.axes.iter_mut().zip(&guards.axes).enumerate() {
            let Some(figures) = figures else { continue };
            config.guard = Check::all(|check| GuardConfig::new(check, figures, config, sample_ticks, tick_s))
                .map_err(|cause| AxesError { axis, cause })?;
        }
        Ok(self)
    }
}

impl<R: Real> AxisState<R> {
    /// Finds what broke in a lost axis, `since` ticks after its last sample.
    pub(crate) fn judge(&self, config: &AxisConfig<R>, setpoint: &Setpoint<R>, since: u8) -> AxisFault<R> {
        self.guard.judge(config, setpoint, since)
    }

    /// Samples an axis that was regulated in this tick.
    pub(crate) fn sample(
        &mut self,
        config: &AxisConfig<R>,
        setpoint: &Setpoint<R>,
        output: &AxisOutput<R>,
    ) -> Option<AxisFault<R>> {
        self.guard.sample(config, setpoint, output)
    }
}

/// What broke in an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum AxisFault<R> {
    FollowingError { error_mm: R },
    EncoderLost,
    EncoderJump { jump_mm: R },
    Runaway,
    Saturated,
    SoftLimit,
    SetpointJump { jump_mm: R },
    NotFinite,
}

/// Why an axis may not continue, before it is judged what broke.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
enum Alarm<R> {
    #[default]
    None,
    Error {
        error_mm: R,
    },
    Jump {
        jump_mm: R,
    },
    NotFinite,
}

/// A sample of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Sample<R> {
    /// There was a sample since the axis was enabled.
    is_taken: bool,
    counts: i32,
    /// Distance moved in the two ticks before \[mm\].
    moved_mm: R,
    /// The command's direction; 0 below the least velocity.
    commanded: i8,
}

/// The state, which changes from tick to tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Guard<R> {
    /// Last change of the following error \[mm\].
    change_mm: R,
    /// The velocity command of the tick before \[mm/s\].
    command_mm_s: R,
    /// The lower halves of the last three readings, the latest first.
    counts: [i32; 3],
    alarm: Alarm<R>,
    last: Sample<R>,
    still_samples: u16,
    against_samples: u16,
    /// Distance moved at the sample before the first of these \[mm\].
    against_from_mm: R,
    saturated_samples: u16,
    /// Samples until the drive has responded to a take-up. The motor alone goes through the play, and faster than by load.
    #[cfg(feature = "compensation")]
    take_up_samples: u16,
    /// The next jump is no fault: the machine was told to stand while it was moving.
    is_excused: bool,
}

impl<R: Real> Guard<R> {
    /// The state for an axis whose encoder reads `counts`.
    pub(super) fn at(counts: Counts) -> Self {
        Self { counts: [counts.0 as i32; 3], ..Self::default() }
    }

    /// Restarts after the actual position has become the set position.
    pub(super) fn stand_here(&mut self) {
        *self = Self { counts: self.counts, is_excused: true, ..Self::default() };
    }

    /// Forgets everything seen before the drives were off.
    pub(super) fn restart(&mut self) {
        (self.last, self.still_samples, self.against_samples, self.saturated_samples) =
            (Sample::default(), 0, 0, 0);
        self.command_mm_s = R::ZERO;
    }

    /// Notes a tick of a take-up.
    #[cfg(feature = "compensation")]
    pub(super) fn take_up(&mut self, config: &AxisConfig<R>) {
        self.take_up_samples = config.guard.response_samples.saturating_add(1);
    }

    /// Whether the motor has moved its load ever since the last sample but one: what the samples are judged by.
    fn moves_load(&self) -> bool {
        #[cfg(feature = "compensation")]
        return self.take_up_samples == 0;
        #[cfg(not(feature = "compensation"))]
        true
    }

    #[inline]
    fn read(&mut self, counts: Counts) {
        let [latest, before, _] = self.counts;
        self.counts = [counts.0 as i32, latest, before];
    }

    /// Notes a tick without a command.
    #[inline]
    pub(super) fn watch(&mut self, change_mm: R, counts: Counts) {
        self.read(counts);
        self.change_mm = change_mm;
        self.command_mm_s = R::ZERO;
    }

    /// Whether the axis may be regulated: checks its following error and, if that is within its limit, the
    /// error's jump.
    #[inline]
    pub(super) fn allows(
        &mut self,
        config: &AxisConfig<R>,
        error_mm: R,
        last_error_mm: R,
        counts: Counts,
        setpoint: &Setpoint<R>,
    ) -> bool {
        self.read(counts);
        if !(error_mm.abs() <= config.guard.at_rest_mm)
            && !self.allows_error(config, error_mm, last_error_mm, setpoint)
        {
            return false;
        }
        let change_mm = error_mm - last_error_mm;
        let jump_mm = change_mm - self.change_mm;
        self.change_mm = change_mm;
        if !(jump_mm.abs() <= config.guard.jump_mm) {
            return self.allows_jump(jump_mm);
        }
        true
    }

    #[cold]
    fn allows_error(
        &mut self,
        config: &AxisConfig<R>,
        error_mm: R,
        last_error_mm: R,
        setpoint: &Setpoint<R>,
    ) -> bool {
        let most_mm = config.following_error_limit_mm;
        let is_allowed = error_mm.abs() <= config.guard.limit_mm(most_mm, setpoint);
        if !is_allowed {
            // Beyond twice the limit the value does not matter, and may exceed the number type.
            let far_mm = most_mm + most_mm;
            let jump_mm = error_mm.max(-far_mm).min(far_mm) - last_error_mm - self.change_mm;
            let is_jump = !(jump_mm.abs() <= config.guard.jump_mm);
            self.alarm = if is_jump { Alarm::Jump { jump_mm } } else { Alarm::Error { error_mm } };
        }
        is_allowed
    }

    #[cold]
    fn allows_jump(&mut self, jump_mm: R) -> bool {
        if !core::mem::take(&mut self.is_excused) {
            self.alarm = Alarm::Jump { jump_mm };
            return false;
        }
        true
    }

    /// Whether a command may be put out.
    #[inline]
    pub(super) fn allows_command(&mut self, command_mm_s: R, most_mm_s: R) -> bool {
        self.command_mm_s = command_mm_s;
        let is_number = command_mm_s <= most_mm_s;
        if !is_number {
            self.alarm = Alarm::NotFinite;
        }
        is_number
    }

    /// Finds what broke in an axis that was not allowed to continue, `since` ticks after its last sample.
    #[cold]
    pub(super) fn judge(&self, config: &AxisConfig<R>, setpoint: &Setpoint<R>, since: u8) -> AxisFault<R> {
        let &Setpoint { velocity_mm_s, accel_mm_s2, jerk_mm_s3, .. } = setpoint;
        // A value that is not finite gives NaN when multiplied by 0.
        let is_number = |value: R| value * R::ZERO == R::ZERO;
        if ![velocity_mm_s, accel_mm_s2, jerk_mm_s3].into_iter().all(is_number) {
            return AxisFault::NotFinite;
        }
        match self.alarm {
            Alarm::Jump { jump_mm } => self.judge_jump(config, jump_mm),
            Alarm::Error { error_mm } => {
                if self.has_stopped_counting(config) {
                    AxisFault::EncoderLost
                } else if self.runs_away(config, self.moved_mm(config), self.by_load_mm(config, since)) {
                    AxisFault::Runaway
                } else {
                    AxisFault::FollowingError { error_mm }
                }
            }
            Alarm::None | Alarm::NotFinite => AxisFault::NotFinite,
        }
    }

    fn judge_jump(&self, config: &AxisConfig<R>, jump_mm: R) -> AxisFault<R> {
        let [latest, before, first] = self.counts;
        let (step, step_before) = (latest.wrapping_sub(before), before.wrapping_sub(first));
        let [step_mm, before_mm] = [step, step_before].map(|counts| mm(config, counts));
        let most_mm = config.guard.jump_mm;
        let is_more = |change_mm: R| (change_mm + change_mm).abs() > most_mm;
        if !is_more(step_mm - before_mm) {
            AxisFault::SetpointJump { jump_mm }
        } else if step == 0 {
            AxisFault::EncoderLost
        } else if !is_more(step_mm + before_mm) {
            // It counts the other way, equally fast.
            AxisFault::Runaway
        } else {
            AxisFault::EncoderJump { jump_mm: step_mm - before_mm }
        }
    }

    fn has_stopped_counting(&self, config: &AxisConfig<R>) -> bool {
        let [latest, before, first] = self.counts;
        let least_mm = mm(config, COUNTS_A_TICK).abs();
        latest == before && before == first && self.command_mm_s.abs() * config.guard.tick_s >= least_mm
            || self.last.is_taken && self.still_samples > 0 && self.is_still(config)
    }

    fn is_still(&self, config: &AxisConfig<R>) -> bool {
        let moved = self.counts[0].wrapping_sub(self.last.counts);
        (-config.guard.noise_counts..=config.guard.noise_counts).contains(&moved)
    }

    /// Whether the axis, which moved by `now_mm` in two ticks, has lost velocity towards its command since
    /// the last sample, and more than load can explain.
    fn runs_away(&self, config: &AxisConfig<R>, now_mm: R, by_load_mm: R) -> bool {
        let [latest, before, first] = self.counts;
        // Counts that stand still are another fault.
        if !self.last.is_taken || latest == before && before == first {
            return false;
        }
        let guard = &config.guard;
        // In two ticks, like the distance moved.
        let wanted_mm = (self.command_mm_s + self.command_mm_s) * guard.tick_s - now_mm;
        let gained_mm = now_mm - self.last.moved_mm;
        let lost_mm = if wanted_mm < R::ZERO { gained_mm } else { -gained_mm };
        lost_mm > by_load_mm + guard.noise_mm + guard.noise_mm
    }

    /// Change by load, in `since` ticks, of the distance moved in two ticks \[mm\].
    fn by_load_mm(&self, config: &AxisConfig<R>, since: u8) -> R {
        config.guard.load_mm * R::from_q32(i64::from(since) << 32)
    }

    /// Distance moved in the last two ticks \[mm\].
    fn moved_mm(&self, config: &AxisConfig<R>) -> R {
        let [latest, _, first] = self.counts;
        mm(config, latest.wrapping_sub(first))
    }

    /// Samples an axis that was regulated in this tick.
    #[inline(never)]
    pub(super) fn sample(
        &mut self,
        config: &AxisConfig<R>,
        setpoint: &Setpoint<R>,
        output: &AxisOutput<R>,
    ) -> Option<AxisFault<R>> {
        let guard = &config.guard;
        self.is_excused = false;
        if guard.response_samples == 0 {
            return None;
        }
        let commanded = match self.command_mm_s {
            command_mm_s if command_mm_s >= guard.moving_mm_s => 1,
            command_mm_s if command_mm_s <= -guard.moving_mm_s => -1,
            _ => 0,
        };
        let moved_mm = self.moved_mm(config);
        let moving_mm = guard.moving_mm_s * guard.tick_s + guard.noise_mm;
        let is_against = commanded > 0 && moved_mm < -moving_mm || commanded < 0 && moved_mm > moving_mm;
        // A load that is too great brakes slowly, but brakes: if not visible from one sample to the next,
        // then over several.
        if self.against_samples == 0 {
            self.against_from_mm = self.last.moved_mm;
        }
        let brakes_mm = self.against_from_mm.abs() - moved_mm.abs();
        let is_against = is_against && brakes_mm <= guard.noise_mm;
        let goes_on = self.last.is_taken && commanded != 0 && commanded == self.last.commanded;
        let count = |samples: u16, again: bool| if again { samples.saturating_add(1) } else { 0 };
        let is_still = self.is_still(config);
        let runs_away = self.moves_load() && self.runs_away(config, moved_mm, guard.load_sample_mm);
        self.still_samples = count(self.still_samples, goes_on && is_still);
        self.against_samples = count(self.against_samples, goes_on && is_against);
        self.saturated_samples = count(self.saturated_samples, output.saturated);
        #[cfg(feature = "compensation")]
        {
            self.take_up_samples = self.take_up_samples.saturating_sub(1);
        }
        self.last = Sample { is_taken: true, counts: self.counts[0], moved_mm, commanded };
        if runs_away || self.against_samples >= guard.response_samples {
            Some(AxisFault::Runaway)
        } else if self.still_samples >= guard.response_samples {
            Some(AxisFault::EncoderLost)
        } else if self.saturated_samples >= guard.saturation_samples {
            Some(AxisFault::Saturated)
        } else if guard.travel.is_some_and(|travel| drives_out(travel, setpoint, output)) {
            // The least urgent fault, so the last.
            Some(AxisFault::SoftLimit)
        } else {
            None
        }
    }
}

/// Whether an axis is beyond its travel and moves farther out: it may drive back.
fn drives_out<R: Real>([low, high]: [Position; 2], setpoint: &Setpoint<R>, output: &AxisOutput<R>) -> bool {
    output.set < low && setpoint.velocity_mm_s < R::ZERO
        || output.set > high && setpoint.velocity_mm_s > R::ZERO
}

/// The distance of a number of counts \[mm\].
fn mm<R: Real>(config: &AxisConfig<R>, counts: i32) -> R {
    config.encoder.position(Counts(i64::from(counts))).to_offset()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Reactions;
    use crate::fixture::{GUARD, MM_PER_COUNT, TICK_S, figures, guarded};

    fn config() -> AxisConfig<f32> {
        guarded::<f32, 1>(figures(), GUARD).axes[0]
    }

    /// Ticks of an axis that is set at 0 and reads `counts`; the first one in which it is lost.
    fn lost(counts: impl Fn(i64) -> i64, setpoint: &Setpoint<f32>) -> Option<(i64, AxisFault<f32>)> {
        let (config, mut axis) = (config(), AxisState::default());
        (0..200).find_map(|tick| {
            let mut output = AxisOutput { counts: Counts(counts(tick)), ..AxisOutput::default() };
            axis.tick(&config, setpoint, &mut output);
            output.lost.then(|| (tick, axis.judge(&config, setpoint, 1)))
        })
    }

    /// 20 µm a tick are 40 mm/s, not a jump; the same once and no more is one.
    #[test]
    fn a_jump_is_a_change_of_velocity_not_velocity() {
        let at_rest = Setpoint::default();
        // It begins gently.
        let ramp = |tick: i64| if tick < 4 { tick * tick * 25 } else { 225 + (tick - 3) * 175 };
        let found = lost(ramp, &at_rest).expect("beyond its limit in the end");
        assert!(matches!(found.1, AxisFault::FollowingError { .. }) && ramp(found.0) > 2500, "{found:?}");
        let jump = |tick: i64| if tick < 50 { 0 } else { 200 };
        assert!(
            matches!(lost(jump, &at_rest), Some((50, AxisFault::EncoderJump { .. }))),
            "{:?}",
            lost(jump, &at_rest)
        );
        // Half of what a motor does is none.
        assert_eq!(lost(|tick| if tick < 50 { 0 } else { 35 }, &at_rest), None);
    }

    /// The limit grows with velocity and acceleration, up to the greatest.
    #[test]
    fn the_limit_grows_with_the_motion() {
        for (velocity_mm_s, accel_mm_s2, limit_mm) in
            [(0.0, 0.0, 0.25), (-100.0, 0.0, 0.35), (100.0, -500.0, 0.4), (2000.0, 0.0, 1.0)]
        {
            let setpoint = Setpoint { velocity_mm_s, accel_mm_s2, ..Setpoint::default() };
            let (tick, found) = lost(|tick| tick * 65, &setpoint).expect("beyond");
            let error_mm = MM_PER_COUNT * 65.0 * tick as f64;
            let is_first = error_mm > limit_mm && error_mm <= limit_mm + 65.5 * MM_PER_COUNT;
            assert!(
                is_first && matches!(found, AxisFault::FollowingError { .. }),
                "{limit_mm}: {error_mm} {found:?}"
            );
        }
    }

    /// Position and error are good, the feedforward's values are not.
    #[test]
    fn a_command_that_is_not_a_number_is_never_put_out() {
        for velocity_mm_s in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let setpoint = Setpoint { velocity_mm_s, ..Setpoint::default() };
            let (config, mut axis) = (config(), AxisState::default());
            let mut output = AxisOutput::default();
            axis.tick(&config, &setpoint, &mut output);
            let is_cut = velocity_mm_s.is_infinite();
            // Infinity is cut at the output's limit, as any command.
            assert_eq!((output.lost, output.saturated), (!is_cut, is_cut), "{velocity_mm_s}");
            assert!(is_cut || axis.judge(&config, &setpoint, 1) == AxisFault::NotFinite);
        }
    }

    /// A limit that is not a number allows nothing, least of all the greatest error.
    #[test]
    fn a_limit_that_is_not_a_number_allows_nothing() {
        for velocity_mm_s in [0.0, f32::NAN] {
            let setpoint = Setpoint { velocity_mm_s, ..Setpoint::default() };
            let (config, mut guard) = (config(), Guard::default());
            // Between the limit at rest and the greatest one.
            let is_allowed = guard.allows(&config, 0.5, 0.499, Counts(-5000), &setpoint);
            assert!(!is_allowed && matches!(guard.alarm, Alarm::Error { .. }), "{velocity_mm_s}");
        }
    }

    /// The tick compares with the limit at rest first, so no other may be less.
    #[test]
    fn a_limit_at_rest_above_the_greatest_is_refused() {
        let refused = |at_rest_mm: f64| {
            let guard = GuardFigures { following_error_at_rest_mm: at_rest_mm, ..GUARD };
            let axes = AxesConfig::<f32, 1>::new(&[figures()], TICK_S).expect("axes");
            let guards = Guards { axes: [Some(guard)], reactions: Reactions::IMMEDIATE };
            axes.guarded(&guards, TICK_S).err().map(|error| error.cause.quantity)
        };
        assert_eq!(refused(1.0), None);
        assert_eq!(refused(1.0001), Some("following error at rest [mm]"));
        assert_eq!(refused(f64::NAN), Some("following error at rest [mm]"));
    }

    /// Beyond its travel an axis is watched as anywhere: what is more urgent is found.
    #[test]
    fn a_soft_limit_hides_nothing() {
        let guard = GuardFigures { travel_mm: Some([-1.0, 1.0]), ..GUARD };
        let config = guarded::<f32, 1>(figures(), guard).axes[0];
        let setpoint = Setpoint { velocity_mm_s: 20.0, ..Setpoint::default() };
        let found = |step: i64| {
            let mut axis = AxisState::default();
            (0..400_i64).fold(Vec::new(), |mut found, tick| {
                let set = Position::from_mm(2.0).expect("in range");
                let counts = Counts(20_000 + step * tick);
                let mut output = AxisOutput { counts, set, ..AxisOutput::default() };
                axis.tick(&config, &setpoint, &mut output);
                if !output.lost && tick % 8 == 7 {
                    found.extend(
                        axis.sample(&config, &setpoint, &output).filter(|new| found.last() != Some(new)),
                    );
                }
                found
            })
        };
        assert_eq!(found(0), [AxisFault::SoftLimit, AxisFault::EncoderLost]);
        assert_eq!(found(-20), [AxisFault::SoftLimit, AxisFault::Runaway]);
        assert_eq!(found(5), [AxisFault::SoftLimit]);
    }

    /// Thrown back by a load, an axis brakes by less than a sample can see, but by more than some of them;
    /// one that does not brake at all runs away.
    #[test]
    fn what_brakes_slowly_does_not_run_away() {
        let found = |brake_mm_s2: f64| {
            let (config, mut axis) = (config(), AxisState::default());
            let setpoint = Setpoint { velocity_mm_s: 10.0, ..Setpoint::default() };
            (0..80_i64).find_map(|tick| {
                let t_s = TICK_S * tick as f64;
                let back_mm = 5.0 * t_s - 0.5 * brake_mm_s2 * t_s * t_s;
                let counts = Counts((-back_mm / MM_PER_COUNT).round() as i64);
                let mut output = AxisOutput { counts, ..AxisOutput::default() };
                axis.tick(&config, &setpoint, &mut output);
                assert!(!output.lost, "{brake_mm_s2} tick {tick}");
                if tick % 8 == 7 { axis.sample(&config, &setpoint, &output) } else { None }
            })
        };
        assert_eq!(found(0.0), Some(AxisFault::Runaway));
        assert_eq!(found(20.0), None);
    }
}
