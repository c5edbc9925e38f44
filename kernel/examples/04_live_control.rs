//! Live control: hold, resume and override of a motion that is under way.
//!
//! ```console
//! cargo run -p motion-kernel --features live --example 04_live_control
//! ```
//!
//! The background may be late: whatever the tick has ends at rest on the path, within the program's limits. A
//! command is another such motion, which takes over where the feed does not change.

use std::error::Error;

use motion_kernel::exec::Executor;
use motion_kernel::law::{Limits, Pulse};
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::queue::{LiveStreams, PathRules};
use motion_kernel::straight::Straight;
use motion_kernel::units::Position;

const TICK_S: f64 = 0.0005;
/// Ticks between two polls of the background: 5 ms.
const POLL_TICKS: u32 = 10;
/// Ramps are changed after the ticks that pass until the poll has ended.
const LEADS: Leads = Leads { stop_ticks: POLL_TICKS, plan_ticks: POLL_TICKS };

fn main() -> Result<(), Box<dyn Error>> {
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
    let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
    let start = [Position::ZERO; 2];
    let end = [60.0, 80.0].map(|mm| Position::from_mm(mm).expect("within a million millimetres"));

    // The program: 100 mm at 40 mm/s, at most 50 mm/s under an override. Any source of items will do.
    let program = Straight::new(start, end, Pulse::Plateau, limits, [40.0, 50.0], TICK_S)?;
    let mut streams = LiveStreams::<f32, 2, 64, 16>::new();
    let (mut feeder, mut intake) = streams.split(rules, start);
    let mut control = LiveControl::<f32, 2, _, _, 64>::new(program, Pulse::Plateau, TICK_S, LEADS);
    let mut executor = Executor::new(start);

    let (mut path_mm, mut held_mm, mut greatest_mm_s) = (0.0_f64, None, 0.0_f64);
    let mut before = State::Running;
    for tick in 0_u32.. {
        // Commands, as a button or a console would give them.
        match tick {
            1000 => control.hold(),
            3000 => control.resume(),
            4000 => control.set_override(1.25).map_err(|share| format!("override {share}"))?,
            _ => {}
        }
        if tick.is_multiple_of(POLL_TICKS) {
            control.poll(&mut feeder)?;
        }
        let state = control.state(&feeder);
        if state != before {
            println!("{:6.3} s  {path_mm:8.3} mm  {before:?} -> {state:?}", f64::from(tick) * TICK_S);
            before = state;
        }
        let executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
        let motion = executed.motion;
        greatest_mm_s = greatest_mm_s.max(f64::from(motion.v_mm_s));
        match state {
            State::Held => {
                assert_eq!(motion.v_mm_s, 0.0, "held is at rest");
                held_mm = Some(path_mm);
            }
            State::Done => {
                assert_eq!(
                    executed.setpoints.map(|setpoint| setpoint.position),
                    end,
                    "the end is where it was"
                );
                break;
            }
            _ => {
                let [x_mm, y_mm] = executed.setpoints.map(|setpoint| setpoint.position.to_mm());
                path_mm = x_mm.hypot(y_mm);
            }
        }
    }
    let held_mm = held_mm.ok_or("the hold never came to rest")?;
    assert!(held_mm > 5.0 && held_mm < 50.0, "held on the way, at {held_mm} mm");
    assert!((greatest_mm_s - 50.0).abs() < 1e-3, "125 % of 40 mm/s, not {greatest_mm_s} mm/s");
    println!("held at {held_mm:.3} mm, then up to {greatest_mm_s:.1} mm/s");
    Ok(())
}
