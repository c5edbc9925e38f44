//! What to record of an axis that is to be tuned.
//!
//! [`explore`]'s runs show every parameter. But a bed of little damping builds up for longer than any of them lasts, and how high it
//! builds up may decide the margins of a loop; and a noisy encoder hardly shows how a drive answers at the frequencies of margins.
//! Where a margin is not known well, the axis is moved for some seconds at the frequency at which it is read, too. Without noise the
//! same rounding errors come again in every period, and longer motion would promise more than it tells.

use std::thread;

use super::position_loop::PositionLoop;
use crate::drive::DriveError;
use crate::drive::identification::{reach_mm_s, recording};
use crate::identify::{
    AxisRecording, Excitation, Identification, IdentifyError, Reach, explore, identify, identify_further,
    long_harmonic,
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
        identify_to_tune(settings, fastest_mm_s, record)?
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

/// Records `axis` by `record` and identifies it. It reaches `fastest_mm_s` \[mm/s\] > 0.
///
/// # Errors
/// Outside: those of `record`. Inside: those of [`identify`].
pub fn identify_to_tune<E>(
    axis: &AxisSettings,
    fastest_mm_s: f64,
    mut record: impl FnMut(&Excitation) -> Result<AxisRecording, E>,
) -> Result<Result<Identification, IdentifyError>, E> {
    let mut runs = explore(fastest_mm_s, &mut record)?;
    let found = match identify(&runs) {
        Ok(found) => found,
        Err(error) => return Ok(Err(error)),
    };
    let reach = Reach::seen(&runs[0], fastest_mm_s);
    let missing = missing(axis, &found, &reach);
    if missing.is_empty() {
        return Ok(Ok(found));
    }
    for excitation in &missing {
        runs.push(record(excitation)?);
    }
    // What all runs together don't tell, the first ones did.
    Ok(identify_further(&found, &runs).map(|further| further.unwrap_or(found)))
}

/// The motions that tell the margins of an axis better, where they are not known well.
fn missing(axis: &AxisSettings, found: &Identification, reach: &Reach) -> Vec<Excitation> {
    if !found.gains_by_motion() {
        return Vec::new();
    }
    let position_loop = PositionLoop::new(axis, found, reach.tick_s);
    let unclear_hz = position_loop.map_or_else(Vec::new, |one| one.unclear_hz());
    unclear_hz.into_iter().filter_map(|hz| long_harmonic(reach, found, hz)).collect()
}
