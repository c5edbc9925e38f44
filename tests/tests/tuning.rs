//! Identified and tuned from recordings alone, then driven round circles, through the kernel in f32.
//!
//! S4's machine had 4 µm of following error at 4 Hz, a contour error of 20 µm at 10 Hz, and 32 µm of form deviation at
//! its resonance of 13 Hz.

use motion_host::drive::circle::{self, CircleFigures};
use motion_host::drive::identification::identify_axes;
use motion_host::machine::Machine;
use motion_host::tuning::{AxisTuning, Method, propose};

const FEED_MM_S: f64 = 2150.0 / 60.0;

/// `machine` with X and Y tuned.
fn tuned(machine: &Machine, method: Method) -> (Machine, Vec<AxisTuning>) {
    let found = identify_axes(machine, &[0, 1]).expect("an identification");
    let mut tuned = machine.clone();
    let mut tunings = vec![];
    for (axis, found) in tuned.axes.iter_mut().zip(&found) {
        let tuning = propose(axis, found, method, machine.tick_s);
        axis.gains = tuning.gains;
        axis.feedforward = tuning.feedforward;
        axis.output_offset_v = tuning.output_offset_v;
        tunings.push(tuning);
    }
    (tuned, tunings)
}

fn circle(machine: &Machine, frequency_hz: f64) -> CircleFigures {
    let figures = circle::measure(machine, frequency_hz, FEED_MM_S).expect("a circle");
    let [x, y] = figures.following_um;
    println!(
        "{frequency_hz:5} Hz: following {x:.3} {y:.3} µm, contour {:.3} µm, form {:.3} µm",
        figures.contour_um(),
        figures.form_um()
    );
    figures
}

#[test]
fn tuned_machine_is_an_order_better_than_the_paper() {
    let (machine, tunings) = tuned(&Machine::reference(), Method::Inverse);
    for tuning in &tunings {
        println!("{:?}", tuning.margins);
        assert!(tuning.margins.is_stable());
    }
    let slow = circle(&machine, 4.0);
    assert!(slow.following_um.iter().all(|error_um| *error_um <= 0.5), "{slow:?}");
    for frequency_hz in 1..=28 {
        let figures = circle(&machine, f64::from(frequency_hz));
        assert!(figures.contour_um() <= 5.0, "{figures:?}");
        assert!(frequency_hz != 13 || figures.form_um() <= 3.0, "{figures:?}");
    }
}
