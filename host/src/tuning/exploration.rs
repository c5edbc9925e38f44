//! What to record of an axis that is to be tuned.
//!
//! [`explore`]'s runs show every parameter. None of them lasts until a bed of little damping has built up its motion, but the gain
//! margin of a loop hangs on how high it builds up. Where the recordings leave more of the margins open than
//! [`MARGINS_KNOWN`](super::known::MARGINS_KNOWN), the axis is moved at the bed's resonance, too.

use std::thread;

use super::gains::scaled;
use super::known::is_damping_known;
use super::proposal::{command_gain, regulator_gains};
use crate::drive::DriveError;
use crate::drive::identification::{reach_mm_s, recording};
use crate::identify::{
    AxisRecording, Excitation, Identification, IdentifyError, Reach, at_resonance, explore, identify,
    identify_further,
};
use crate::machine::{AxisSettings, Machine};

/// Identifies the axes `axes` (from 0) of `machine`, in that order.
///
/// # Errors
/// A run can't be made, or an axis does not answer like a velocity servo.
pub fn identify_axes(machine: &Machine, axes: &[usize]) -> Result<Vec<Identification>, DriveError> {
    let one = |axis: usize| -> Result<Identification, DriveError> {
        let fastest_mm_s = reach_mm_s(machine, axis)?;
        let settings = &machine.axes[axis];
        let record = |excitation: &Excitation| recording(machine, axis, excitation);
        identify_to_tune(settings, machine.tick_s, fastest_mm_s, record)?
            .map_err(|source| DriveError::Identification { axis: settings.name.clone(), source })
    };
    if thread::available_parallelism().map_or(1, usize::from) < 2 {
        // A page has no threads.
        return axes.iter().map(|&axis| one(axis)).collect();
    }
    thread::scope(|scope| {
        let workers: Vec<_> = axes.iter().map(|&axis| scope.spawn(move || one(axis))).collect();
        let join = |worker: thread::ScopedJoinHandle<'_, _>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().map(join).collect()
    })
}

/// Records `axis` by `record` and identifies it. It reaches `fastest_mm_s` \[mm/s\] > 0, in ticks of `tick_s` > 0 \[s\].
///
/// # Errors
/// Outside: those of `record`. Inside: those of [`identify`].
pub fn identify_to_tune<E>(
    axis: &AxisSettings,
    tick_s: f64,
    fastest_mm_s: f64,
    mut record: impl FnMut(&Excitation) -> Result<AxisRecording, E>,
) -> Result<Result<Identification, IdentifyError>, E> {
    let mut runs = explore(fastest_mm_s, &mut record)?;
    let found = match identify(&runs) {
        Ok(found) => found,
        Err(error) => return Ok(Err(error)),
    };
    if let Some(excitation) = missing(axis, &found, &Reach::seen(&runs[0], fastest_mm_s), tick_s) {
        runs.push(record(&excitation)?);
        // What all runs together don't tell, the first ones did.
        return Ok(Ok(identify_further(&found, &runs).unwrap_or(found)));
    }
    Ok(Ok(found))
}

/// The motion that tells margins better, if they are not known well.
fn missing(axis: &AxisSettings, found: &Identification, reach: &Reach, tick_s: f64) -> Option<Excitation> {
    let parameters = &found.parameters;
    let (bed, gains) = (parameters.bed?, regulator_gains(axis, found, tick_s)?);
    let is_known = is_damping_known(parameters, scaled(gains, command_gain(parameters)), tick_s);
    if found.is_met() && !is_known { at_resonance(reach, &bed) } else { None }
}
