//! The set values of a recording again, under another regulator or in coarser steps.
//!
//! Consumes a [`Recording`]; produces one with the same set values and another actual motion. The drives,
//! encoders and converters are those of a run; executor and streams are not run again. Fails with a
//! [`DriveError`] if the machine can't be built.

use motion_kernel::axis::{AxesConfig, AxisOutput, AxisState};
use motion_kernel::hal::{DriveEnable, Encoder, VelocityChannel};
use motion_kernel::num::Scalar;
use motion_kernel::path::Setpoint;
use motion_kernel::units::{Counts, DacCode, Position};

use super::AXES;
use super::experiment::{DriveError, Recording, within};
use super::peer_regulator::{PeerGains, PeerRegulator};
use crate::machine::Machine;
use crate::simulate::RunError;
use crate::simulate::contour::Contour;
use crate::simulate::hardware::{SimulatedHardware, simulated};
use crate::trace::TraceRow;

/// The regulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// The kernel's regulator in f32 with the gains of the recording's machine.
    Kernel,
    /// A regulator that differences positions, with these gains and none of the machine's.
    Peer([PeerGains; AXES]),
}

/// A recording under another law.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// The recording; its set positions are the exact ones that the error refers to.
    pub recording: Recording,
    /// Torque of every axis in every tick, as the acceleration it gives the unloaded axis \[mm/s²\].
    pub torque_mm_s2: Vec<[f64; AXES]>,
}

/// The regulator of three axes, with its state.
enum Regulator<'a> {
    Kernel(Box<(AxesConfig<f32, AXES>, [AxisState<f32>; AXES])>),
    Peer(Box<AxesConfig<f64, AXES>>, &'a [PeerGains; AXES], [PeerRegulator; AXES]),
}

impl<'a> Regulator<'a> {
    fn new(law: &'a Law, machine: &Machine) -> Result<Self, RunError> {
        Ok(match law {
            Law::Kernel => {
                let axes: AxesConfig<f32, AXES> = machine.unguarded_axes_config()?;
                let mut states = [AxisState::default(); AXES];
                for (state, config) in states.iter_mut().zip(&axes.axes) {
                    state.set_position(config, Counts(0), Position::ZERO);
                }
                Self::Kernel(Box::new((axes, states)))
            }
            Law::Peer(gains) => Self::Peer(
                Box::new(machine.unguarded_axes_config()?),
                gains,
                [PeerRegulator::default(); AXES],
            ),
        })
    }

    /// One tick: on entry `tick` has the exact set values, on return also the axes' results; `set` has the
    /// positions that the regulator gets.
    fn tick(
        &mut self,
        tick: &mut TraceRow,
        (set, counts): ([Position; AXES], [Counts; AXES]),
        (before_mm, tick_s): ([f64; AXES], f64),
    ) -> [DacCode; AXES] {
        let mut codes = [DacCode::ZERO; AXES];
        for (index, code) in codes.iter_mut().enumerate() {
            let axis = &mut tick.axes[index];
            match self {
                Self::Kernel(axes) => {
                    let (config, states) = axes.as_mut();
                    let setpoint = Setpoint {
                        position: set[index],
                        velocity_mm_s: f32::from_f64(axis.vel_mm_s),
                        accel_mm_s2: f32::from_f64(axis.acc_mm_s2),
                        jerk_mm_s3: f32::from_f64(axis.jerk_mm_s3),
                    };
                    let mut output =
                        AxisOutput { set: set[index], counts: counts[index], ..AxisOutput::default() };
                    states[index].tick(&config.axes[index], &setpoint, &mut output);
                    axis.act_mm = output.actual.to_mm();
                    *code = output.code;
                }
                Self::Peer(config, gains, regulators) => {
                    let config = &config.axes[index];
                    axis.act_mm = config.encoder.position(counts[index]).to_mm();
                    axis.set_mm = before_mm[index];
                    let positions = (set[index].to_mm(), axis.act_mm);
                    let limits = config.output.limits();
                    let velocity_mm_s = regulators[index].tick(&gains[index], positions, tick_s, limits);
                    *code = config.output.code(velocity_mm_s);
                }
            }
            axis.err_um = (axis.set_mm - axis.act_mm) * 1e3;
            axis.out_v = code.to_volts();
        }
        codes
    }
}

/// Closes the loop over the recording's machine with `law`, told set positions in steps of `resolution_mm`
/// \[mm\], 0 (exact) to 1. The following error is relative to the exact set positions, and no error is a
/// fault.
///
/// # Errors
/// The resolution is out of its range, or the machine can't be built.
pub fn replay(recording: &Recording, law: &Law, resolution_mm: f64) -> Result<Replayed, DriveError> {
    within("set-point resolution [mm]", resolution_mm, (0.0, 1.0))?;
    let mut replayed = Replayed {
        recording: Recording {
            experiment: recording.experiment.clone(),
            machine: recording.machine.clone(),
            feed_mm_s: recording.feed_mm_s,
            ticks: Vec::with_capacity(recording.ticks.len()),
        },
        torque_mm_s2: Vec::with_capacity(recording.ticks.len()),
    };
    close_loop(recording, law, resolution_mm, &mut replayed)?;
    Ok(replayed)
}

fn close_loop(
    recording: &Recording,
    law: &Law,
    resolution_mm: f64,
    replayed: &mut Replayed,
) -> Result<(), RunError> {
    let machine = &recording.machine;
    let simulated = simulated(machine)?;
    let mut hardware = SimulatedHardware::new(&simulated)?;
    let mut regulator = Regulator::new(law, machine)?;
    let mut contour = Contour::new(machine.linear_places());
    let mut before_mm = [0.0; AXES];
    for recorded in &recording.ticks {
        let mut tick = *recorded;
        let exact_mm = tick.axes.map(|axis| axis.set_mm);
        let mut set = [Position::ZERO; AXES];
        for (set, exact_mm) in set.iter_mut().zip(exact_mm) {
            let told_mm = in_steps(exact_mm, resolution_mm);
            let expected =
                || RunError::Simulation(format!("found a set position of {told_mm} mm, out of range"));
            *set = Position::from_mm(told_mm).ok_or_else(expected)?;
        }
        let Ok(counts) = hardware.latch();
        let codes = regulator.tick(&mut tick, (set, counts), (before_mm, machine.tick_s));
        hardware.write(&codes).map_err(|error| RunError::Simulation(format!("{error:?}")))?;
        let Ok(()) = hardware.set_enabled(true);
        simulated.advance();
        tick.contour_um = contour.error_um(&tick.axes);
        replayed.recording.ticks.push(tick);
        replayed.torque_mm_s2.push(simulated.truth().map(|axis| axis.torque_mm_s2));
        before_mm = exact_mm;
    }
    Ok(())
}

fn in_steps(position_mm: f64, resolution_mm: f64) -> f64 {
    if resolution_mm > 0.0 { (position_mm / resolution_mm).round() * resolution_mm } else { position_mm }
}
