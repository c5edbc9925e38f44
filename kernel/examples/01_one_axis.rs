//! One axis, from a feed to volts: 20 mm there, every 0.5 ms a tick.
//!
//! ```console
//! cargo run -p motion-kernel --example 01_one_axis
//! ```
//!
//! The drive here is ideal, so the voltage is the velocity: 50 mm/s on an axis with 100 mm/s at 10 V is 5 V.

use std::convert::Infallible;
use std::error::Error;

use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains};
use motion_kernel::exec::ExecState;
use motion_kernel::hal::{DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use motion_kernel::kernel::Kernel;
use motion_kernel::law::{Law, Limits, PlannedRamp, Pulse, Ramp};
use motion_kernel::program::{Item, Supply};
use motion_kernel::queue::{PathRules, Streams};
use motion_kernel::units::{Counts, DacCode, Position};

const TICK_S: f64 = 0.0005;
const MM_PER_COUNT: f64 = 0.0001;
const MM_S_AT_10_V: f64 = 100.0;

fn main() -> Result<(), Box<dyn Error>> {
    // What a machine's file says of the axis. With a perfect feedforward of velocity the gain has nothing to
    // do.
    let axis = AxisFigures {
        mm_per_count: MM_PER_COUNT,
        mm_s_at_10_v: MM_S_AT_10_V,
        output_offset_v: 0.0,
        output_limit_v: 10.0,
        gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
        feedforward: Feedforward { velocity: 1.0, ..Feedforward::default() },
        following_error_limit_mm: 0.5,
    };
    let config = AxesConfig::new(&[axis], TICK_S)?;

    // The feed over the path: a ramp up, a cruise, the same ramp down.
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
    let rise = Ramp::new(&Law::new(Pulse::Plateau, limits)?, 0.0, 50.0);
    let at = |mm| Position::from_mm(mm).ok_or("out of range");
    let (whole, ramp) = (at(20.0)?, at(rise.length_mm())?);
    // The path under it: lines of at most 16 mm. Both streams measure the same 20 mm.
    let line =
        |start, end: Position| Item::Line { line: 1, start: [start], direction: [1.0], length: end - start };
    let middle = at(10.0)?;
    let items = [
        line(Position::ZERO, middle),
        line(middle, whole),
        Item::Feed(PlannedRamp::new(&rise, ramp, TICK_S)?),
        Item::Feed(PlannedRamp::cruise(50.0, whole - ramp - ramp, TICK_S)?),
        Item::Feed(PlannedRamp::new(&rise.reversed(), ramp, TICK_S)?),
        Item::EndOfStretch([whole]),
    ];

    // Background and tick meet in the streams, which refuse what is not continuous or breaks a limit.
    let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
    let mut streams = Streams::<f32, 1, 32, 32>::new();
    let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
    Supply::new(items.map(Ok::<_, Infallible>).into_iter(), TICK_S).fill(&mut feeder)?;

    let mut drive = IdealDrive::default();
    let mut kernel = Kernel::<f32, 1>::new(&config, [Position::ZERO], [Counts(0)]);
    kernel.enable(0);
    let mut peak_v = 0.0_f64;
    println!("  t [ms]    set [mm]   output [V]");
    loop {
        let trace = *kernel.tick(&mut intake, &mut drive);
        let output_v = trace.axes[0].code.to_volts();
        peak_v = peak_v.max(output_v);
        if trace.tick.is_multiple_of(100) {
            println!(
                "{:8.0}  {:10.4}  {output_v:10.4}",
                trace.tick as f64 * 1e3 * TICK_S,
                trace.axes[0].set.to_mm()
            );
        }
        if trace.executed.state == ExecState::Idle {
            assert_eq!(trace.axes[0].set, whole, "the set position ends exactly where the program says");
            break;
        }
    }
    assert!((peak_v - 5.0).abs() < 0.02, "50 mm/s are 5 V, not {peak_v} V");
    assert_eq!(kernel.fault(), None);
    println!("there, with at most {peak_v:.3} V");
    Ok(())
}

/// A drive that has the commanded velocity at once, and its encoder: the kernel's four traits in memory.
#[derive(Default)]
struct IdealDrive {
    position_mm: f64,
    is_enabled: bool,
}

impl Encoder<1> for IdealDrive {
    type Error = Infallible;
    fn latch(&mut self) -> Result<[Counts; 1], Infallible> {
        Ok([Counts((self.position_mm / MM_PER_COUNT).round() as i64)])
    }
}

impl Inputs<1> for IdealDrive {
    type Error = Infallible;
    fn read_inputs(&mut self) -> Result<MachineInputs<1>, Infallible> {
        Ok(MachineInputs::HEALTHY)
    }
}

impl VelocityChannel<1> for IdealDrive {
    type Error = Infallible;
    fn write(&mut self, &[code]: &[DacCode; 1]) -> Result<(), Infallible> {
        if self.is_enabled {
            self.position_mm += code.to_volts() / 10.0 * MM_S_AT_10_V * TICK_S;
        }
        Ok(())
    }
}

impl DriveEnable<1> for IdealDrive {
    type Error = Infallible;
    fn set_enabled(&mut self, is_enabled: bool) -> Result<(), Infallible> {
        self.is_enabled = is_enabled;
        Ok(())
    }
}
