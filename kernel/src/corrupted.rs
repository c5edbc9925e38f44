//! Tests: pieces and segments whose bits were changed after they were accepted.
//!
//! Whatever comes of them, a set-point that jumps is a fault in the tick it jumps in, and outputs are ramped;
//! what is not a number never reaches a converter.

use crate::axis::{AxesConfig, GuardFigures};
use crate::exec::ExecState;
use crate::fault::{FaultKind, Reaction, Reactions};
use crate::fixture::{GUARD, LIMITS, MM_PER_COUNT, RULES, TICK_S, TestAxes, figures, guarded};
use crate::kernel::Kernel;
use crate::law::{FeedSegment, Law, Pulse, Ramp};
use crate::num::Real;
use crate::path::Piece;
use crate::queue::Streams;
use crate::random::Random;
use crate::units::{Counts, DacCode, Position};

const JUMP_MM: f64 = 0.0068;
/// The guard's own rounding, of following errors in f32.
const ROUNDING_MM: f64 = 1e-6;
const RAMP_TICKS: u16 = 20;

fn config<R: Real>() -> AxesConfig<R, 2> {
    let guard = GuardFigures {
        following_error_per_velocity_s: 0.1 / 230.0,
        following_error_per_accel_s2: 4e-5,
        jump_mm: JUMP_MM,
        ..GUARD
    };
    let reactions = Reactions { ramp_ticks: RAMP_TICKS, stop_ticks: 4000, emergency_stop: Reaction::Ramp };
    AxesConfig { reactions, ..guarded(figures(), guard) }
}

fn at(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

/// What came of a run.
struct Came {
    fault: Option<FaultKind<f32>>,
    /// The greatest jump that was no fault, of set-points \[mm\].
    set_mm: f64,
    /// The same of set-points against where their axes are \[mm\]: what the guard holds to its limit. A wrong
    /// coefficient may let a set-point gain 7 µm a tick in every tick, of which its axis follows 3.
    missed_mm: f64,
}

/// 40 mm along a diagonal, with one piece or segment corrupted on its way into the queue.
fn run(
    piece: impl Fn(usize, Piece<f32, 2>) -> Piece<f32, 2>,
    segment: impl Fn(usize, FeedSegment<f32>) -> FeedSegment<f32>,
) -> Came {
    let mut streams = Streams::<f32, 2, 8, 8>::new();
    let (mut feeder, mut intake) = streams.split(RULES, [at(0.0); 2]);
    for index in 0..4 {
        let start = [at(6.0 * index as f64), at(8.0 * index as f64)];
        let made = Piece::line(1, start, [0.6, 0.8], at(10.0)).expect("a piece");
        feeder.piece_unchecked(piece(index, made));
    }
    let up = Ramp::new(&Law::new(Pulse::Plateau, LIMITS).expect("limits"), 0.0, 60.0);
    let rise = at(up.length_mm());
    let cruise = at(40.0) - rise - rise;
    let made = [(up, rise), (Ramp::cruise(60.0, cruise.to_mm() / 60.0), cruise), (up.reversed(), rise)];
    for (index, (ramp, length)) in made.into_iter().enumerate() {
        let made = FeedSegment::ramp(&ramp, length, TICK_S).expect("a segment");
        feeder.segment_unchecked(segment(index, made));
    }
    feeder.end_unchecked([at(24.0), at(32.0)]);
    let mut kernel = Kernel::<f32, 2>::new(&config(), [at(0.0); 2], [Counts(0); 2]);
    kernel.enable(10);
    let mut bench = TestAxes::<2>::default();
    // The last three set positions and following errors.
    let mut past_mm = [[[0.0; 3]; 2]; 2];
    let (mut set_mm, mut missed_mm) = (0.0_f64, 0.0_f64);
    let mut before = [DacCode::ZERO; 2];
    for _ in 0..4000 {
        let read = bench.counts;
        let trace = *kernel.tick(&mut intake, &mut bench);
        let mut jumps_mm = [0.0_f64; 2];
        for ((output, Counts(count)), past) in trace.axes.iter().zip(read).zip(&mut past_mm) {
            let set = output.set.to_mm();
            for ((past, now), most) in
                past.iter_mut().zip([set, set - count as f64 * MM_PER_COUNT]).zip(&mut jumps_mm)
            {
                *past = [past[1], past[2], now];
                *most = most.max((past[2] - 2.0 * past[1] + past[0]).abs());
            }
        }
        let [set_jump_mm, jump_mm] = jumps_mm;
        if let Some(fault) = trace.fault {
            // The ramp's first tick, from what was put out before; then all of it.
            assert_eq!(fault.tick, trace.tick);
            if !is_corruption(&fault.kind) {
                // A feed that does not fit its position does not jump: the axis does not follow.
                assert!(jump_mm <= JUMP_MM + ROUNDING_MM, "{fault:?}: {jump_mm} mm");
                return Came { fault: Some(fault.kind), set_mm, missed_mm };
            }
            let mut left = i32::from(RAMP_TICKS) - 1;
            let mut codes = bench.codes;
            loop {
                for (DacCode(code), DacCode(from)) in codes.into_iter().zip(before) {
                    assert_eq!(i32::from(code), i32::from(from) * left / i32::from(RAMP_TICKS), "{fault:?}");
                }
                if left == 0 {
                    assert_eq!(kernel.reaction(), Some(Reaction::Immediate));
                    return Came { fault: Some(fault.kind), set_mm, missed_mm };
                }
                left -= 1;
                kernel.tick(&mut intake, &mut bench);
                codes = bench.codes;
            }
        }
        (set_mm, missed_mm) = (set_mm.max(set_jump_mm), missed_mm.max(jump_mm));
        before = bench.codes;
        bench.advance();
        if trace.executed.stretches == 1 && trace.executed.state == ExecState::Idle {
            break;
        }
    }
    Came { fault: None, set_mm, missed_mm }
}

#[test]
fn what_is_not_corrupted_is_no_fault() {
    let came = run(|_, piece| piece, |_, segment| segment);
    assert!(came.fault.is_none() && came.set_mm < 2e-4, "{}", came.set_mm);
}

fn is_corruption(kind: &FaultKind<f32>) -> bool {
    matches!(kind, FaultKind::SetpointJump { .. } | FaultKind::NotFinite { .. } | FaultKind::Executor(_))
}

/// One bit of a piece or segment is another one. What jumps is found in its tick, and as nothing else.
#[test]
fn a_corrupted_piece_or_segment_is_found_where_the_set_point_jumps() {
    let (mut found, mut not_followed, mut harmless) = (0, 0, 0);
    for seed in 0..3000_u64 {
        let random = Random::new(seed);
        let (which, bit) = (random.next() as usize, random.next() as u32);
        let came = if seed % 2 == 0 {
            let corrupt = |index, piece: Piece<f32, 2>| {
                if index == which % 4 { piece.with_flipped_bit(bit) } else { piece }
            };
            run(corrupt, |_, segment| segment)
        } else {
            let corrupt = |index, segment: FeedSegment<f32>| {
                if index == which % 3 { segment.with_flipped_bit(bit) } else { segment }
            };
            run(|_, piece| piece, corrupt)
        };
        match came.fault {
            Some(kind) if is_corruption(&kind) => found += 1,
            Some(_) => not_followed += 1,
            None => harmless += 1,
        }
        assert!(
            came.missed_mm <= JUMP_MM + ROUNDING_MM,
            "seed {seed}: missed {} mm, {:?}",
            came.missed_mm,
            came.fault
        );
    }
    println!("{found} found, {not_followed} not followed, {harmless} of no consequence");
    assert!(found > 500 && not_followed < found / 10, "{found} {not_followed}");
}

/// What is not a number in a piece's direction, at any of its axes.
#[test]
fn what_is_not_a_number_is_a_fault_of_its_own() {
    for value in [f32::NAN, f32::INFINITY] {
        for axis in 0..2 {
            let corrupt = |index, piece: Piece<f32, 2>| {
                if index == 2 { piece.with_direction(axis, value) } else { piece }
            };
            let came = run(corrupt, |_, segment| segment);
            assert_eq!(came.fault, Some(FaultKind::NotFinite { axis }), "{value}");
        }
    }
}
