use super::*;
use crate::axis::AxisOutput;
use crate::exec::Executed;
use crate::fault::FaultKind;
use crate::hal::{AxisInputs, MachineInputs};
use crate::num::Fixed;
use crate::path::Setpoint;
use crate::random::Random;

impl Random {
    fn real<R: Real>(&self) -> R {
        R::from_f64(self.next().cast_signed() as f64 * 1e-12)
    }

    fn position(&self) -> Position {
        Position::from_bits(self.next().cast_signed())
    }

    fn trace<R: Real>(&self, tick: u64, fault: Option<Fault<R>>) -> Trace<R, 2> {
        let states =
            [ExecState::Idle, ExecState::Moving, ExecState::Dwell, ExecState::Stopped, ExecState::Held];
        let mut inputs = MachineInputs::HEALTHY;
        inputs.emergency_stop = self.below(2) == 0;
        inputs.axes = [0; 2].map(|_| AxisInputs::from_bits(self.next() as u8));
        let motion = PathMotion {
            s: self.position(),
            v_mm_s: self.real(),
            a_mm_s2: self.real(),
            j_mm_s3: self.real(),
            snap_mm_s4: self.real(),
        };
        let setpoints = [0; 2].map(|_| Setpoint {
            position: self.position(),
            velocity_mm_s: self.real(),
            accel_mm_s2: self.real(),
            jerk_mm_s3: self.real(),
        });
        let axes = [0; 2].map(|_| AxisOutput {
            counts: Counts(self.next().cast_signed()),
            set: self.position(),
            actual: self.position(),
            following_error_mm: self.real(),
            code: DacCode(self.next() as i16),
            saturated: self.below(2) == 0,
            lost: self.below(2) == 0,
        });
        let state = states[self.below(5) as usize];
        let (stretches, line) = (self.next() as u32, self.next() as u32);
        Trace { tick, executed: Executed { state, motion, stretches, line, setpoints }, axes, inputs, fault }
    }
}

/// Every figure of the row compared with the tick's trace.
fn is_of<R: Real>(row: &FlightRow<R, 2>, trace: &Trace<R, 2>) -> bool {
    let executed = &trace.executed;
    row.tick == trace.tick
        && row.motion == executed.motion
        && (row.stretches, row.line, row.state) == (executed.stretches, executed.line, executed.state)
        && row.emergency_stop == trace.inputs.emergency_stop
        && row.is_faulted == trace.fault.is_some()
        && (0..2).all(|axis| {
            let (row, output, setpoint) = (row.axes[axis], trace.axes[axis], executed.setpoints[axis]);
            (row.counts, row.set, row.following_error_mm)
                == (output.counts, output.set, output.following_error_mm)
                && (row.code, row.saturated) == (output.code, output.saturated)
                && row.velocity_mm_s == setpoint.velocity_mm_s
                && (row.accel_mm_s2, row.jerk_mm_s3) == (setpoint.accel_mm_s2, setpoint.jerk_mm_s3)
                && row.inputs == trace.inputs.axes[axis].to_bits()
        })
}

/// A history of random length with a fault somewhere or nowhere, cleared and gone on with; the oracle keeps
/// all of it.
fn keeps_what_a_list_keeps<R: Real, const ROWS: usize, const AFTER: usize>(seed: u64) -> (bool, bool) {
    let random = Random::new(seed);
    let mut recorder = FlightRecorder::<R, 2, ROWS, AFTER>::new();
    let (mut has_wrapped, mut was_frozen) = (false, false);
    let mut tick = random.below(1 << 40);
    for _ in 0..1 + random.below(4) {
        let mut all = Vec::new();
        let ticks = random.below(4 * ROWS as u64 + 4);
        let faulty = random.below(2 * ticks + 1);
        // The kernel's fault may be cleared before the recorder is frozen, and another one come.
        let cleared = faulty + 1 + random.below(2 * AFTER as u64 + 1);
        let fault = Fault { tick: tick + faulty, kind: FaultKind::Encoder };
        for index in 0..ticks {
            let other = Fault { tick: 0, kind: FaultKind::Output };
            let latched = match index {
                _ if index < faulty => None,
                _ if index < cleared => Some(fault),
                _ => (random.below(4) == 0).then_some(other),
            };
            let trace = random.trace(tick, latched);
            tick += 1;
            recorder.add(&trace);
            all.push(trace);
            // Kept rows: the last of those up to `AFTER` ticks after the fault.
            let end = all.len().min(usize::try_from(faulty).expect("few").saturating_add(1 + AFTER));
            let kept = &all[end.saturating_sub(ROWS)..end];
            assert_eq!(recorder.rows.len(), kept.len(), "seed {seed}, tick {index}");
            assert!(
                recorder.rows.iter().zip(kept).all(|(row, trace)| is_of(row, trace)),
                "seed {seed}, tick {index}"
            );
            assert!(
                (0..ROWS + 1).all(|at| recorder.row(at).map(|row| row.tick) == kept.get(at).map(|t| t.tick))
            );
            assert_eq!(
                recorder.fault.map(|(fault, _)| fault),
                (index >= faulty).then_some(fault),
                "seed {seed}"
            );
            assert_eq!(recorder.is_frozen(), index >= faulty + AFTER as u64, "seed {seed}, tick {index}");
            has_wrapped |= end > ROWS;
            was_frozen |= recorder.is_frozen();
        }
        recorder.clear();
        assert!(recorder.rows.is_empty() && recorder.fault.is_none() && !recorder.is_frozen());
    }
    (has_wrapped, was_frozen)
}

#[test]
fn a_ring_keeps_what_a_list_keeps() {
    let (mut wrapped, mut frozen) = (0, 0);
    for seed in 0..400 {
        let runs = [
            keeps_what_a_list_keeps::<f32, 8, 3>(seed),
            keeps_what_a_list_keeps::<f64, 5, 4>(seed),
            keeps_what_a_list_keeps::<Fixed, 13, 0>(seed),
            keeps_what_a_list_keeps::<f32, 1, 0>(seed),
        ];
        wrapped += runs.iter().filter(|run| run.0).count();
        frozen += runs.iter().filter(|run| run.1).count();
    }
    assert!(wrapped > 500 && frozen > 500, "{wrapped} {frozen}");
}

fn frames_of<R: Real>(seed: u64) {
    let random = Random::new(seed);
    for _ in 0..50 {
        let tick = random.next();
        let row = FlightRow::new(&random.trace::<R>(tick, None));
        let mut buffer = [0; frame_max(2)];
        let frame = row.to_frame(&mut buffer).expect("room").to_vec();
        assert_eq!(FlightRow::from_frame(&frame), Ok(row.to_f64()));
        let mut short = vec![0; frame.len() - 1];
        assert!(row.to_frame(&mut short).is_none());
        for bit in 0..8 * frame.len() {
            let mut damaged = frame.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(FlightRow::<f64, 2>::from_frame(&damaged).is_err(), "bit {bit}");
        }
        for length in 0..frame.len() {
            assert!(FlightRow::<f64, 2>::from_frame(&frame[..length]).is_err(), "{length} bytes");
        }
        assert_eq!(FlightRow::<f64, 3>::from_frame(&frame), Err(FrameError::Axes { found: 2, expected: 3 }));
    }
}

/// Every figure in its own place.
#[test]
fn a_row_of_f64_is_its_own_in_f64() {
    let random = Random::new(1);
    for tick in 0..100 {
        let row = FlightRow::new(&random.trace::<f64>(tick, None));
        assert_eq!(row.to_f64(), row);
    }
}

#[test]
fn a_frame_gives_its_row_or_says_why_not() {
    for seed in 0..3 {
        frames_of::<f32>(seed);
        frames_of::<f64>(seed);
        frames_of::<Fixed>(seed);
    }
}

/// The longest numbers that there are.
#[test]
fn no_frame_is_longer_than_its_bound() {
    let axis = FlightAxis {
        counts: Counts(i64::MIN),
        set: Position::from_bits(i64::MIN),
        velocity_mm_s: 0.1,
        accel_mm_s2: 0.1,
        jerk_mm_s3: 0.1,
        following_error_mm: 0.1,
        code: DacCode(i16::MIN),
        saturated: true,
        inputs: u8::MAX,
    };
    let motion = PathMotion { s: axis.set, v_mm_s: 0.1, a_mm_s2: 0.1, j_mm_s3: 0.1, snap_mm_s4: 0.1 };
    fn fits<const AXES: usize>(axis: FlightAxis<f64>, motion: PathMotion<f64>) {
        let row = FlightRow {
            tick: u64::MAX,
            motion,
            stretches: u32::MAX,
            line: u32::MAX,
            state: ExecState::Held,
            emergency_stop: true,
            is_faulted: true,
            axes: [axis; AXES],
        };
        let mut buffer = vec![0; frame_max(AXES)];
        assert_eq!(row.to_frame(&mut buffer).map(<[u8]>::len), Some(frame_max(AXES)));
    }
    fits::<1>(axis, motion);
    fits::<3>(axis, motion);
    fits::<8>(axis, motion);
    // What the module says of its memory.
    assert_eq!(size_of::<FlightRow<f32, 3>>(), 168);
}
