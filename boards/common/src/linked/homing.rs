//! Steps of a homing that the PC has asked for: what ends it early, and its moves.

use motion_kernel::exec::ExecState;
use motion_kernel::homing::{HomingInput, HomingStep};
use motion_kernel::jog::Jog;
use motion_kernel::link::HomingFailure;
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::scope::Command;
use rtic_core::Mutex;

use super::{Linked, note};
use crate::control::{Control, Index};
use crate::streamed::{Requests, Streamed};

impl<'a, R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize, const PARAMETERS: usize>
    Linked<'a, R, AXES, ITEMS, PLACES, PARAMETERS>
{
    /// What ends homing early, or asks for it.
    #[inline(never)]
    pub(super) fn end_homing(&mut self, requests: Requests, is_hold_asked: bool) {
        let Self { streamed, homing, .. } = self;
        let failure = if requests.power == Some(false) {
            Some(HomingFailure::DrivesOff)
        } else if requests.aborts || requests.holds || is_hold_asked {
            Some(HomingFailure::Aborted)
        } else {
            streamed.is_silent().then_some(HomingFailure::Silent)
        };
        if failure.is_some_and(|failure| homing.end(failure)) {
            streamed.abort();
        }
        match requests.homes {
            Some(axes) if requests.may_home => homing.ask(axes),
            Some(axes) => homing.give_up(axes, failure.unwrap_or(HomingFailure::Aborted)),
            None => {}
        }
    }

    /// Goes on with homing, a step of it.
    #[inline(never)]
    pub(super) fn home<const ROWS: usize, const AFTER: usize>(
        &mut self,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) {
        let Self { streamed, homing, .. } = self;
        let live = streamed.state();
        control.lock(|control| {
            // An axis whose encoder failed does not know any more where it is.
            for (axis, homed) in homing.homed.iter_mut().enumerate() {
                if control.kernel.has_lost_counts(axis) {
                    *homed = None;
                }
            }
            if control.kernel.fault().is_some() && homing.is_under_way() {
                control.forget_homing();
                homing.fail(HomingFailure::Fault);
            }
            if !homing.is_under_way() {
                return;
            }
            if control.kernel.is_off() {
                control.forget_homing();
                return homing.fail(HomingFailure::DrivesOff);
            }
            if !control.kernel.is_on() {
                return;
            }
            let tick = control.kernel.trace().tick;
            if homing.is_asked() {
                if matches!(live, State::Aborting | State::Aborted) {
                    return;
                }
                let Some(here) = control.kernel.rest_here() else { return };
                note(streamed, tick, Command::RestHere);
                homing.begin_next();
                return streamed.restart_homing(None, &mut control.intake, here, tick);
            }
            let Some((axis, run)) = homing.running() else { return };
            let index = control.index();
            if index == Index::Missing {
                run.lacks_index();
                control.forget_homing();
            }
            let home_counts = control.home_counts(axis);
            let trace = control.kernel.trace();
            let seen = HomingInput {
                set: trace.executed.setpoints.each_ref().map(|setpoint| setpoint.position),
                counts: trace.axes.get(axis).map(|axis| axis.counts).unwrap_or_default(),
                home_counts,
                is_home: trace.inputs.axes.get(axis).is_some_and(|axis| axis.is_home()),
                index: if let Index::Latched(counts) = index { Some(counts) } else { None },
                state: match live {
                    State::Waiting if trace.executed.state != ExecState::Moving => State::Done,
                    State::Waiting => State::Running,
                    live => live,
                },
            };
            let step = run.poll(&seen);
            homing.tell();
            match step {
                Ok(HomingStep::Wait) => {}
                Ok(HomingStep::Stop) => streamed.abort(),
                Ok(HomingStep::ArmIndex) => control.arm_index(axis),
                Ok(HomingStep::Move(jog)) => rest(Some(Some(jog)), streamed, control, tick),
                Ok(HomingStep::Reference(counts, position)) => {
                    control.forget_homing();
                    let Some(set) = control.kernel.reference(axis, counts, position) else {
                        homing.fail(HomingFailure::Failed);
                        return streamed.abort();
                    };
                    note(streamed, tick, Command::Reference { axis: axis as u16, counts, position });
                    streamed.restart_homing(None, &mut control.intake, set, tick);
                }
                Ok(HomingStep::Done(homed)) => {
                    homing.found(homed);
                    let goes_on = homing.begin_next();
                    rest(goes_on.then_some(None), streamed, control, tick);
                }
                Err(error) => {
                    control.forget_homing();
                    homing.fail(error.into());
                    rest(None, streamed, control, tick);
                }
            }
        });
    }
}

/// At rest between two moves of homing: begins anew there with the next one, if there is one yet, or, after homing, with what the
/// link brings.
fn rest<
    'a,
    R: Real,
    const AXES: usize,
    const ITEMS: usize,
    const PLACES: usize,
    const ROWS: usize,
    const AFTER: usize,
>(
    homes: Option<Option<Jog<AXES>>>,
    streamed: &mut Streamed<'a, R, AXES, ITEMS, PLACES>,
    control: &mut Control<'a, R, AXES, ROWS, AFTER>,
    tick: u64,
) {
    // Homing moves on at rest only.
    let Some(here) = control.kernel.rest_here() else { return };
    note(streamed, tick, Command::RestHere);
    match homes {
        Some(jog) => streamed.restart_homing(jog, &mut control.intake, here, tick),
        None => streamed.restart(&mut control.intake, here, tick),
    }
}
