//! A program from bytes: written as `motion compile` does, read, checked and executed as a board does.
//!
//! ```console
//! cargo run -p motion-kernel --example 05_program_from_bytes
//! ```
//!
//! The bytes carry the machine that they were planned for, so that a program can't run on another one by
//! mistake.

use std::error::Error;

use motion_kernel::axis::{AxisFigures, Feedforward, Gains};
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::law::{Law, Limits, PlannedRamp, Pulse, Ramp};
use motion_kernel::program::{Header, Item, ProgramError, Reader, Supply, check, write};
use motion_kernel::queue::{PathRules, Streams};
use motion_kernel::units::Position;

fn main() -> Result<(), Box<dyn Error>> {
    let mut bytes = compile()?;
    println!("{} bytes", bytes.len());

    // On the board: nothing of a damaged program is read.
    bytes[60] ^= 1;
    let refused = Reader::<1>::new(&bytes).map(|_| ());
    assert!(matches!(refused, Err(ProgramError::Checksum { .. })), "{refused:?}");
    if let Err(error) = refused {
        println!("with one bit changed: {error}");
    }
    bytes[60] ^= 1;

    // Every item is checked against this board's number type before anything moves.
    let program = Reader::<1>::new(&bytes)?;
    let header = program.header();
    check::<f32, 1, _>(header, program.items())?;

    // Streams of 17 pieces hold no more than a part of 40 lines: the supply fills them as they get empty.
    let mut streams = Streams::<f32, 1, 18, 10>::new();
    let (mut feeder, mut intake) = streams.split(header.rules, header.start);
    let mut supply = Supply::new(program.items(), header.tick_s);
    let mut executor = Executor::<f32, 1>::new(header.start);
    for tick in 0_u32.. {
        supply.fill(&mut feeder)?;
        let executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
        if tick.is_multiple_of(400) {
            println!(
                "tick {tick:5}: line {:2} at {:7.3} mm",
                executed.line,
                executed.setpoints[0].position.to_mm()
            );
        }
        if supply.is_empty() && executed.state == ExecState::Idle {
            assert_eq!(executed.setpoints[0].position.to_mm(), 40.0);
            println!("tick {tick:5}: done at 40 mm");
            return Ok(());
        }
    }
    Err("no end".into())
}

/// What a PC does: 40 lines of 1 mm, driven as one motion.
fn compile() -> Result<Vec<u8>, Box<dyn Error>> {
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
    let axis = AxisFigures {
        mm_per_count: 0.0001,
        mm_s_at_10_v: 100.0,
        output_offset_v: 0.0,
        output_limit_v: 10.0,
        gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
        feedforward: Feedforward { velocity: 1.0, ..Feedforward::default() },
        following_error_limit_mm: 0.5,
    };
    let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
    let header =
        Header { tick_s: 0.0005, rules, pulse: Pulse::Plateau, axes: [axis], start: [Position::ZERO] };

    let at = |mm| Position::from_mm(mm).ok_or("out of range");
    let rise = Ramp::new(&Law::new(Pulse::Plateau, limits)?, 0.0, 50.0);
    let (whole, ramp) = (at(40.0)?, at(rise.length_mm())?);
    let line = |line: u32| {
        Ok::<_, &str>(Item::Line {
            line: line + 1,
            start: [at(f64::from(line))?],
            direction: [1.0],
            length: at(1.0)?,
        })
    };
    // In the order of the places where they begin, so that neither stream fills up while the other one
    // starves.
    let mut items = vec![Item::Feed(PlannedRamp::new(&rise, ramp, header.tick_s)?)];
    for number in 0..40 {
        items.push(line(number)?);
        if number == 5 {
            items.push(Item::Feed(PlannedRamp::cruise(50.0, whole - ramp - ramp, header.tick_s)?));
        }
        if number == 35 {
            items.push(Item::Feed(PlannedRamp::new(&rise.reversed(), ramp, header.tick_s)?));
        }
    }
    items.push(Item::EndOfStretch([whole]));
    let mut bytes = Vec::new();
    write(&header, None, &items, &mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}
