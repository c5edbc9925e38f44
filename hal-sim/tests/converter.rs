//! The kernel's AD5754 adapter over the emulated chip: what it sends, and what the outputs do.

use embedded_hal::spi::{Operation, SpiDevice};
use hal_sim::{Ad5754Chip, ChipError};
use motion_kernel::hal::{Ad5754Error, Ad5754Frame, Ad5754Output, VelocityChannel};
use motion_kernel::units::DacCode;

/// 0 V on all channels, as bits.
const ZERO_V: [u64; 4] = [0; 4];

fn output<const AXES: usize>(chip: &Ad5754Chip) -> Ad5754Output<&Ad5754Chip, AXES> {
    Ad5754Output::setup(chip, &mut { chip }).unwrap()
}

fn send(mut chip: &Ad5754Chip, bytes: &[u8]) -> Result<(), ChipError> {
    chip.write(bytes)
}

#[test]
fn every_code_arrives_as_its_voltage() {
    let chip = Ad5754Chip::new();
    let mut output = output::<4>(&chip);
    for code in i16::MIN..=i16::MAX {
        let codes = [code, !code, code.rotate_left(5), 0].map(DacCode);
        output.write(&codes).unwrap();
        assert_eq!(chip.output_codes().map(DacCode), codes);
        for (volts, code) in chip.volts().into_iter().zip(codes) {
            assert!((volts - code.to_volts()).abs() < 1e-14, "{code:?} gives {volts} V");
        }
    }
}

/// Lets the bus fail in each frame of a write in turn and looks at the outputs after each.
#[test]
fn all_axes_change_together_or_none() {
    for good_frames in 0..4 {
        let chip = Ad5754Chip::new();
        let mut output = output::<3>(&chip);
        output.write(&[1, 2, 3].map(DacCode)).unwrap();
        chip.fail_bus_after(Some(good_frames));
        let frame = match good_frames {
            3 => Ad5754Frame::Load,
            axis => Ad5754Frame::Code { axis: axis as usize },
        };
        let failure = Ad5754Error::Bus { frame, cause: ChipError::InjectedBusFailure };
        assert_eq!(output.write(&[-4, -5, -6].map(DacCode)), Err(failure));
        assert_eq!(chip.output_codes(), [1, 2, 3, 0], "after {good_frames} frames");
        // Half-written codes don't survive into the next write.
        chip.fail_bus_after(None);
        output.write(&[7, 8, 9].map(DacCode)).unwrap();
        assert_eq!(chip.output_codes(), [7, 8, 9, 0]);
    }
}

#[test]
fn a_write_is_one_frame_per_axis_and_a_load() {
    let chip = Ad5754Chip::new();
    let mut output = output::<3>(&chip);
    let before = chip.frames_taken();
    output.write(&[DacCode(5); 3]).unwrap();
    assert_eq!(chip.frames_taken() - before, 4);
}

#[test]
fn unused_channels_stay_off() {
    let chip = Ad5754Chip::new();
    let mut output = output::<2>(&chip);
    output.write(&[DacCode(i16::MIN), DacCode(i16::MAX)]).unwrap();
    assert_eq!(
        chip.volts().map(f64::to_bits),
        [-10.0_f64, 10.0 - 10.0 / 32768.0, 0.0, 0.0].map(f64::to_bits)
    );
    send(&chip, &[0x02, 0x40, 0x00]).unwrap();
    send(&chip, &[0x1D, 0, 0]).unwrap();
    assert_eq!(chip.volts()[2].to_bits(), 0.0_f64.to_bits());
    assert_eq!(chip.output_codes()[2], 0, "a channel that is off ignores codes");
}

/// A chip that kept its supply while the processor restarted: live outputs, a different code waiting in
/// the input registers, in `range`.
fn left_running(range: u8) -> Ad5754Chip {
    let chip = Ad5754Chip::new();
    for frame in [[0x0C, 0, range], [0x10, 0, 0x0F]] {
        send(&chip, &frame).unwrap();
    }
    chip.elapse_ns(10_000);
    for frame in [[0x04, 0x40, 0x00], [0x1D, 0, 0], [0x04, 0xA0, 0x00]] {
        send(&chip, &frame).unwrap();
    }
    chip
}

#[test]
fn a_restart_puts_the_outputs_to_0_v_and_never_away_from_it() {
    /// Frames up to the clear command, and of the whole setup.
    const CLEAR: u64 = 2;
    const FRAMES: u64 = 3 + 6;
    for range in 0..6 {
        for is_off in [false, true] {
            for frames in 0..=FRAMES {
                let chip = left_running(range);
                if is_off {
                    send(&chip, &[0x10, 0, 0]).unwrap();
                }
                chip.fail_bus_after(Some(frames));
                let setup = Ad5754Output::<_, 3>::setup(&chip, &mut &chip);
                assert_eq!(setup.is_ok(), frames == FRAMES);
                if is_off || frames >= CLEAR {
                    assert_eq!(
                        chip.volts().map(f64::to_bits),
                        ZERO_V,
                        "range {range}, off {is_off}, {frames} frames"
                    );
                }
            }
        }
    }
}

#[test]
fn stale_input_registers_are_overwritten() {
    let chip = left_running(4);
    let _output = output::<3>(&chip);
    send(&chip, &[0x10, 0, 0x0F]).unwrap();
    chip.elapse_ns(10_000);
    send(&chip, &[0x1D, 0, 0]).unwrap();
    assert_eq!(chip.volts().map(f64::to_bits), ZERO_V);
}

#[test]
fn setup_waits_out_the_power_up() {
    /// A delay that forgets to wait.
    struct Impatient;
    impl embedded_hal::delay::DelayNs for Impatient {
        fn delay_ns(&mut self, _: u32) {}
    }
    let chip = Ad5754Chip::new();
    let failure = Ad5754Output::<_, 1>::setup(&chip, &mut Impatient).err().unwrap();
    let cause = ChipError::LoadDuringPowerUp { remaining_ns: 10_000 };
    assert_eq!(failure, Ad5754Error::Bus { frame: Ad5754Frame::Load, cause });
}

#[test]
fn malformed_frames_are_refused_and_change_nothing() {
    let chip = Ad5754Chip::new();
    let mut output = output::<4>(&chip);
    output.write(&[DacCode(100); 4]).unwrap();
    let frames = chip.frames_taken();

    assert_eq!(send(&chip, &[]), Err(ChipError::FrameLength { bytes: 0 }));
    assert_eq!(send(&chip, &[0x1C, 0]), Err(ChipError::FrameLength { bytes: 2 }));
    assert_eq!(send(&chip, &[0x1C, 0, 0, 0]), Err(ChipError::FrameLength { bytes: 4 }));
    assert_eq!(send(&chip, &[0x3F, 0, 0]), Err(ChipError::UnknownRegister { frame: [0x3F, 0, 0] }));
    assert_eq!(send(&chip, &[0x0C, 0, 7]), Err(ChipError::UnknownRange { frame: [0x0C, 0, 7] }));
    assert_eq!((&chip).read(&mut [0; 3]), Err(ChipError::Readback { frame: [0; 3] }));

    assert_eq!(chip.output_codes(), [100; 4]);
    assert_eq!(chip.frames_taken(), frames);
}

#[test]
fn a_frame_may_come_in_pieces_under_one_chip_select() {
    let chip = Ad5754Chip::new();
    let mut output = output::<4>(&chip);
    output.write(&[DacCode(100); 4]).unwrap();
    let mut pieces = [Operation::Write(&[0x1C]), Operation::DelayNs(100), Operation::Write(&[0, 0])];
    (&chip).transaction(&mut pieces).unwrap();
    assert_eq!(chip.volts().map(f64::to_bits), ZERO_V);
}

#[test]
fn releasing_the_bus_keeps_the_outputs() {
    let chip = Ad5754Chip::new();
    let mut output = output::<1>(&chip);
    output.write(&[DacCode(16_384)]).unwrap();
    let chip = output.release();
    assert_eq!(chip.volts().map(f64::to_bits), [5.0_f64, 0.0, 0.0, 0.0].map(f64::to_bits));
}
