//! A closed loop with a simulated drive: the following error without and with feedforward.
//!
//! ```console
//! cargo run -p motion-kernel --example 03_closed_loop
//! ```
//!
//! The drive model was fitted to measurements: dead time, velocity controller, friction. Below the kernel's
//! traits there is the driver of the converter that a board uses, and a simulated chip in place of the SPI
//! bus.

use std::convert::Infallible;
use std::error::Error;

use hal_sim::closed_loop::InMemory;
use hal_sim::{AxisParameters, MachineParameters, REFERENCE_ENCODER, REFERENCE_MM_S_PER_VOLT, SimMachine};
use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains};
use motion_kernel::exec::ExecState;
use motion_kernel::hal::{Ad5754Output, DriveEnable, Encoder, VelocityChannel};
use motion_kernel::kernel::Kernel;
use motion_kernel::law::{Law, Limits, PlannedRamp, Pulse, Ramp};
use motion_kernel::program::{Item, Supply};
use motion_kernel::queue::{PathRules, Streams};
use motion_kernel::units::{DacCode, Position};

const TICK_S: f64 = hal_sim::REFERENCE_TICK_S;

fn main() -> Result<(), Box<dyn Error>> {
    let without = greatest_error_mm(0.0)?;
    let with = greatest_error_mm(1.0)?;
    println!("greatest following error: {without:.3} mm without feedforward, {with:.3} mm with it");
    // P control needs an error of v / kp to ask for a velocity: 50 mm/s / 50/s = 1 mm. Feedforward asks
    // without one.
    assert!((without - 1.0).abs() < 0.1, "expected v / kp, found {without} mm");
    assert!(with < 0.25 * without, "feedforward leaves {with} of {without} mm");
    Ok(())
}

/// Drives 16 mm there at 50 mm/s, with a gain of velocity feedforward.
fn greatest_error_mm(velocity: f64) -> Result<f64, Box<dyn Error>> {
    let machine = SimMachine::<1>::new(&MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X]))?;
    // The converter, set up over its bus as on a board; the simulated chip is the bus and its delay.
    let mut output = Ad5754Output::<_, 1>::setup(machine.chip(), &mut machine.chip())?;
    let axis = AxisFigures {
        mm_per_count: REFERENCE_ENCODER.resolution_mm,
        mm_s_at_10_v: 10.0 * REFERENCE_MM_S_PER_VOLT,
        output_offset_v: 0.0,
        output_limit_v: 10.0,
        gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
        feedforward: Feedforward { velocity, ..Feedforward::default() },
        following_error_limit_mm: 2.0,
    };

    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
    let rise = Ramp::new(&Law::new(Pulse::Plateau, limits)?, 0.0, 50.0);
    let at = |mm| Position::from_mm(mm).ok_or("out of range");
    let (whole, ramp) = (at(16.0)?, at(rise.length_mm())?);
    let items = [
        Item::Line { line: 1, start: [Position::ZERO], direction: [1.0], length: whole },
        Item::Feed(PlannedRamp::new(&rise, ramp, TICK_S)?),
        Item::Feed(PlannedRamp::cruise(50.0, whole - ramp - ramp, TICK_S)?),
        Item::Feed(PlannedRamp::new(&rise.reversed(), ramp, TICK_S)?),
        Item::EndOfStretch([whole]),
    ];
    let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
    let mut streams = Streams::<f32, 1, 32, 32>::new();
    let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
    Supply::new(items.map(Ok::<_, Infallible>).into_iter(), TICK_S).fill(&mut feeder)?;

    // What the tick exchanges with its peripherals lies in memory; around it the peripherals do their part.
    let mut sensor = &machine;
    let mut memory = InMemory { counts: sensor.latch()?, codes: [DacCode::ZERO], enabled: None };
    let config = AxesConfig::new(&[axis], TICK_S)?;
    let mut kernel = Kernel::<f32, 1>::new(&config, [Position::ZERO], memory.counts);
    kernel.enable(0);
    loop {
        memory.counts = sensor.latch()?;
        let state = kernel.tick(&mut intake, &mut memory).executed.state;
        if let Some(is_enabled) = memory.enabled.take() {
            sensor.set_enabled(is_enabled)?;
        }
        output.write(&memory.codes)?;
        machine.advance();
        if state == ExecState::Idle {
            break;
        }
    }
    if let Some(fault) = kernel.fault() {
        return Err(format!("{fault:?}").into());
    }
    let [peak_mm] = kernel.take_peak_following_error_mm();
    Ok(f64::from(peak_mm))
}
