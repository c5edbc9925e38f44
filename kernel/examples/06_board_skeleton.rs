//! A board's skeleton: the four traits on embedded-hal, the tick, and the emergency stop.
//!
//! ```console
//! cargo run -p motion-kernel --example 06_board_skeleton
//! ```
//!
//! Replace the two fakes at the end by the SPI device and the timer of a board, and call `Board::tick` in the
//! interrupt of another timer. `boards/README.md` has the steps of a port.

use std::convert::Infallible;
use std::error::Error;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{self, Operation, SpiDevice};
use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains};
use motion_kernel::fault::FaultKind;
use motion_kernel::hal::{
    Ad5754Error, Ad5754Output, CountExtender, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel,
};
use motion_kernel::kernel::Kernel;
use motion_kernel::law::Limits;
use motion_kernel::queue::{Intake, PathRules, Streams};
use motion_kernel::tick_monitor::TickMonitor;
use motion_kernel::units::{Counts, DacCode, Position};

const TICK_S: f64 = 0.0005;
/// Counts of the free-running counter in a tick: 168 MHz × 0.5 ms.
const TICK_CYCLES: u32 = 84_000;

/// The board's peripherals behind the kernel's traits.
struct Hardware<SPI> {
    /// The register of a timer in encoder mode, and its extension to 64 bits.
    timer: u16,
    extender: CountExtender<u16>,
    outputs: Ad5754Output<SPI, 1>,
    is_enabled: bool,
    emergency_stop: bool,
}

impl<SPI> Encoder<1> for Hardware<SPI> {
    type Error = Infallible;
    fn latch(&mut self) -> Result<[Counts; 1], Infallible> {
        Ok([self.extender.extend(self.timer)])
    }
}

impl<SPI> Inputs<1> for Hardware<SPI> {
    type Error = Infallible;
    fn read_inputs(&mut self) -> Result<MachineInputs<1>, Infallible> {
        Ok(MachineInputs { emergency_stop: self.emergency_stop, ..MachineInputs::HEALTHY })
    }
}

// A bus that fails is a fault: the kernel switches the drives off.
impl<SPI: SpiDevice> VelocityChannel<1> for Hardware<SPI> {
    type Error = Ad5754Error<SPI::Error>;
    fn write(&mut self, codes: &[DacCode; 1]) -> Result<(), Self::Error> {
        self.outputs.write(codes)
    }
}

impl<SPI> DriveEnable<1> for Hardware<SPI> {
    type Error = Infallible;
    fn set_enabled(&mut self, is_enabled: bool) -> Result<(), Infallible> {
        self.is_enabled = is_enabled;
        Ok(())
    }
}

/// What the tick owns.
struct Board<'a, SPI> {
    kernel: Kernel<f32, 1>,
    intake: Intake<'a, f32, 1>,
    hardware: Hardware<SPI>,
    monitor: TickMonitor,
}

impl<SPI: SpiDevice> Board<'_, SPI> {
    /// The timer's interrupt, with readings of a free-running counter at its beginning and end.
    fn tick(&mut self, began: u32, ended: u32) -> DacCode {
        // Ticks that were missed are a fault; so is one that is still under way when the next is due.
        if let Some(late) = self.monitor.began(began) {
            self.kernel.trip(late);
        }
        let code = self.kernel.tick(&mut self.intake, &mut self.hardware).axes[0].code;
        if let Some(overrun) = self.monitor.ended(ended) {
            self.kernel.trip(overrun);
        }
        code
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let axis = AxisFigures {
        mm_per_count: 0.001,
        mm_s_at_10_v: 100.0,
        output_offset_v: 0.0,
        output_limit_v: 10.0,
        gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
        feedforward: Feedforward::default(),
        following_error_limit_mm: 0.5,
    };
    let config = AxesConfig::new(&[axis], TICK_S)?;
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
    let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
    let start = [Position::ZERO];
    // The background fills the other end; here nothing is to move, and the axis is held where it stands.
    let mut streams = Streams::<f32, 1, 18, 10>::new();
    let (_feeder, intake) = streams.split(rules, start);
    let outputs = Ad5754Output::setup(FakeSpi, &mut FakeDelay).map_err(|error| error.to_string())?;
    let timer = 65_530;
    let hardware = Hardware {
        timer,
        extender: CountExtender::new(timer),
        outputs,
        is_enabled: false,
        emergency_stop: false,
    };
    let monitor = TickMonitor::new(32, TICK_CYCLES).map_err(|error| format!("{error:?}"))?;
    let mut board = Board { kernel: Kernel::new(&config, start, [Counts(0)]), intake, hardware, monitor };
    board.kernel.enable(0);

    for tick in 0..10 {
        // Somebody pushes the axis by 20 counts, across the timer's wrap.
        if tick == 4 {
            board.hardware.timer = board.hardware.timer.wrapping_add(20);
        }
        board.hardware.emergency_stop = tick >= 7;
        let code = board.tick(tick * TICK_CYCLES, tick * TICK_CYCLES + 5_000);
        let is_enabled = board.hardware.is_enabled;
        println!("tick {tick}: {:8.4} V, drive {}", code.to_volts(), if is_enabled { "on" } else { "off" });
        match tick {
            0..4 => assert_eq!((code, is_enabled), (DacCode::ZERO, true)),
            // The regulator pushes back: 0.02 mm × 50/s = 1 mm/s, which is 0.1 V.
            4..7 => assert!((code.to_volts() + 0.1).abs() < 0.001 && is_enabled),
            _ => assert_eq!((code, is_enabled), (DacCode::ZERO, false)),
        }
    }
    let fault = board.kernel.fault().ok_or("the emergency stop is a fault")?;
    assert_eq!((fault.tick, fault.kind), (7, FaultKind::EmergencyStop));
    println!("{:?} in tick {}", fault.kind, fault.tick);
    Ok(())
}

/// A bus without anything on it.
struct FakeSpi;

impl spi::ErrorType for FakeSpi {
    type Error = Infallible;
}

impl SpiDevice for FakeSpi {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A delay that is over at once.
struct FakeDelay;

impl DelayNs for FakeDelay {
    fn delay_ns(&mut self, _: u32) {}
}
