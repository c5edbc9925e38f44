//! A path of three axes: two lines that meet in a slight corner, planned with look-ahead.
//!
//! ```console
//! cargo run -p motion-kernel --example 02_three_axes
//! ```
//!
//! The corner is passed at a feed that its angle allows, and the plan brakes for it in time. Here the
//! set-points are what matters, so there is an executor and no machine.

use std::error::Error;

use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::law::{Law, Limits, Pulse};
use motion_kernel::path::Piece;
use motion_kernel::plan::{Block, BlockPlan, plan, ramps};
use motion_kernel::queue::{PathRules, Streams};
use motion_kernel::units::Position;

const TICK_S: f64 = 0.0005;
const CORNER_MM_S: f64 = 12.0;

fn main() -> Result<(), Box<dyn Error>> {
    // Geometry: 10 mm along X, then 10 mm that turn by 0.6° towards Y and by as much towards Z.
    let angle = 0.0105_f64;
    let side = angle.sin();
    let directions = [[1.0, 0.0, 0.0], [(1.0 - 2.0 * side * side).sqrt(), side, side]];
    let at = |mm| Position::from_mm(mm).ok_or("out of range");
    let mut here = [Position::ZERO; 3];
    let mut pieces = Vec::new();
    for direction in directions {
        let piece = Piece::<f32, 3>::line(1, here, direction, at(10.0)?)?;
        here = piece.end();
        pieces.push(piece);
    }

    // Feed: both lines at up to 40 mm/s, the corner between them at 12 mm/s, at rest at both ends.
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 2e4, snap_mm_s4: 2e6 };
    let law = Law::new(Pulse::Plateau, limits)?;
    let block = |junction_mm_s| Block { length_mm: 10.0, cap_mm_s: 40.0, junction_mm_s, law };
    let blocks = [block(CORNER_MM_S), block(0.0)];
    let mut plans = [BlockPlan::default(); 2];
    plan(&blocks, 0.0, 0.0, &mut plans)?;

    // Both streams, independent of each other: geometry here, feed there.
    let rules = PathRules { limits, feed_mm_s: 40.0, junction_angle_rad: 0.02, junction_gap_mm: 5e-6 };
    let mut streams = Streams::<f32, 3, 32, 32>::new();
    let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO; 3]);
    for piece in pieces {
        feeder.piece(piece).map_err(|refused| format!("{refused:?}"))?;
    }
    for (index, (block, plan)) in blocks.iter().zip(&plans).enumerate() {
        let (start, end) = (at(10.0 * index as f64)?, at(10.0 * (index + 1) as f64)?);
        for ramp in ramps(block, plan, start, end, TICK_S)?.into_iter().flatten() {
            feeder.segment(ramp.segment(TICK_S)?).map_err(|refused| format!("{refused:?}"))?;
        }
    }
    feeder.end_stretch(here).map_err(|refused| format!("{refused:?}"))?;

    // Tick.
    let mut executor = Executor::new([Position::ZERO; 3]);
    let mut corner_mm_s = f64::INFINITY;
    println!("  t [ms]      X [mm]      Y [mm]      Z [mm]   feed [mm/s]");
    for tick in 0_u32.. {
        let executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
        let motion = executed.motion;
        let [x, y, z] = executed.setpoints.map(|setpoint| setpoint.position.to_mm());
        if tick.is_multiple_of(100) {
            println!(
                "{:8.0}  {x:10.4}  {y:10.4}  {z:10.4}  {:12.3}",
                f64::from(tick) * 1e3 * TICK_S,
                motion.v_mm_s
            );
        }
        if (motion.s.to_mm() - 10.0).abs() < 1.0 {
            corner_mm_s = corner_mm_s.min(f64::from(motion.v_mm_s));
        }
        assert!(f64::from(motion.a_mm_s2.abs()) <= limits.accel_mm_s2 * (1.0 + 1e-5), "within its limit");
        if executed.state == ExecState::Idle {
            assert_eq!(
                executed.setpoints.map(|setpoint| setpoint.position),
                here,
                "ends exactly at the last line's end"
            );
            break;
        }
    }
    assert!((corner_mm_s - CORNER_MM_S).abs() < 0.1, "the corner was passed at {corner_mm_s} mm/s");
    println!("the corner was passed at {corner_mm_s:.2} mm/s");
    Ok(())
}
