//! Regulators side by side on the reference machine, as host/AXIS.md shows them.

use std::path::Path;

use motion_host::cli::demo::STRINGER;
use motion_host::drive::circle_motion::Circle;
use motion_host::drive::compare::{Choice, Motion, Regulators, Row, rows, sweeps};
use motion_host::drive::peer_regulator::PeerGains;
use motion_host::drive::reference::CIRCLE_FEED_MM_S;
use motion_host::drive::replay::{Law, replay};
use motion_host::drive::{Recording, Terms};
use motion_host::machine::Machine;
use motion_host::report::drive::{picture_of_errors, picture_of_outputs};
use motion_tests::figures::{Table, hold, is_accepting};

const RESOLUTIONS_UM: [f64; 2] = [0.1, 1.0];
/// Pictures stay small enough for a document.
const PICTURE_BYTES_MAX: usize = 60_000;

fn regulators() -> Regulators {
    Regulators::new(&Machine::reference(), CIRCLE_FEED_MM_S, &mut || {}).expect("a fit")
}

fn circle(frequency_hz: f64) -> Circle {
    Circle::new(frequency_hz, CIRCLE_FEED_MM_S)
}

fn measured(regulators: &Regulators) -> Vec<Row> {
    let motions = [
        Motion::Circle(circle(4.0)),
        Motion::Circle(circle(10.0)),
        Motion::Program("stringer.ngc", STRINGER),
    ];
    rows(regulators, &motions, &RESOLUTIONS_UM, &mut || {}).expect("runs")
}

/// What differencing costs, and what inverse and preview give.
#[test]
fn figures_of_the_regulators() {
    let rows = measured(&regulators());
    let mut table = Table::new(&[
        "regulator",
        "set positions",
        "following error 4 Hz [µm]",
        "10 Hz [µm]",
        "program [µm]",
        "contour error 4 Hz [µm]",
        "10 Hz [µm]",
        "program [µm]",
        "output noise 10 Hz [mV rms]",
        "current noise 10 Hz [% of limit, rms]",
    ]);
    let of = |choice: Choice, resolution_um: f64| {
        let is = |row: &&Row| row.choice == choice && (row.resolution_um - resolution_um).abs() < 1e-9;
        &rows.iter().find(is).expect("measured").measured
    };
    for row in &rows {
        let steps = match row.resolution_um {
            um if um > 0.0 => format!("{um} µm"),
            _ => "exact".to_owned(),
        };
        let mut cells = vec![row.choice.name().to_owned(), steps];
        cells.extend(row.measured.iter().map(|found| format!("{:.2}", found.following_um)));
        cells.extend(row.measured.iter().map(|found| format!("{:.2}", found.contour_um)));
        let at_10_hz = &row.measured[1];
        cells.push(format!("{:.1}", at_10_hz.output_noise_v * 1e3));
        cells.push(format!("{:.2}", at_10_hz.current_noise * 1e2));
        table.row(&cells);
    }
    println!("{}", table.to_markdown());
    // Analytic feedforward passes rounding on through kp only: kp·q/√12.
    let [kp_per_s, volts_per_mm_s] = [230.0, 10.0 / (20_000.0 / 60.0)];
    for choice in [Choice::P, Choice::Pv, Choice::Vaj, Choice::VajFitted, Choice::Inverse] {
        let expected_v = kp_per_s * 1e-3 / 12.0_f64.sqrt() * volts_per_mm_s;
        let found_v = of(choice, 1.0)[1].output_noise_v;
        assert!((found_v / expected_v - 1.0).abs() < 0.2, "{choice:?}: {found_v}, expected {expected_v}");
    }
    // Exact set positions: differencing is not the worse regulator. Where jerk begins and ends within 20 ms,
    // what it lags behind by shows.
    for (differenced, analytic) in [(Choice::Peer, Choice::Vaj), (Choice::PeerFitted, Choice::VajFitted)] {
        for (differenced, analytic) in of(differenced, 0.0).iter().zip(of(analytic, 0.0)) {
            assert!((differenced.following_um - analytic.following_um).abs() < 0.8);
        }
        for resolution_um in RESOLUTIONS_UM {
            let ratio = of(differenced, resolution_um)[1].output_noise_v
                / of(analytic, resolution_um)[1].output_noise_v;
            assert!(ratio > 300.0, "{differenced:?} at {resolution_um} µm: {ratio}");
        }
    }
    if let Err(difference) = hold("regulators", &table, 0.02) {
        panic!("{difference}");
    }
}

/// A replay of the kernel's regulator is the run: the same positions and volts in every tick.
#[test]
fn a_replay_of_the_kernel_is_the_run() {
    let machine = regulators().machine(Choice::Inverse);
    let stringer = Recording::of("stringer".to_owned(), STRINGER, machine.clone(), 1.0).expect("a run");
    for recording in [stringer, circle(13.0).record(&machine).expect("a circle")] {
        let replayed = replay(&recording, &Law::Kernel, 0.0).expect("a replay").recording;
        assert_eq!(replayed.ticks.len(), recording.ticks.len());
        for (found, ran) in replayed.ticks.iter().zip(&recording.ticks) {
            for (found, ran) in found.axes.iter().zip(&ran.axes) {
                assert_eq!(found.act_mm.to_bits(), ran.act_mm.to_bits(), "tick {}", ran.act_mm);
                assert_eq!(found.out_v.to_bits(), ran.out_v.to_bits());
                // The run's is in f32.
                assert!((found.err_um - ran.err_um).abs() < 1e-4, "{} {}", found.err_um, ran.err_um);
            }
        }
    }
}

/// With gains five per cent off the fitted ones the axes follow worse: the comparison is with the best that differencing has.
#[test]
fn fitted_gains_are_the_best() {
    let regulators = regulators();
    let machine = Terms::Vaj.of(&Machine::reference());
    let circles = [4.0, 10.0, 16.0].map(|hz| (circle(hz), circle(hz).record(&machine).expect("a circle")));
    let squares = |change: &dyn Fn(&PeerGains) -> PeerGains| -> f64 {
        let law = Law::Peer(regulators.fitted.each_ref().map(change));
        let of = |(circle, recording): &(Circle, Recording)| {
            let found = replay(recording, &law, 0.0).expect("a replay").recording;
            let ticks = circle.measured(&found).expect("steady");
            ticks.iter().map(|tick| tick.axes[0].err_um.powi(2) + tick.axes[1].err_um.powi(2)).sum::<f64>()
        };
        circles.iter().map(of).sum()
    };
    let best = squares(&|gains| *gains);
    for part in [0.95, 1.05] {
        assert!(squares(&|gains| PeerGains { ff2_s: part * gains.ff2_s, ..*gains }) > best);
        assert!(squares(&|gains| PeerGains { ff3_s2: part * gains.ff3_s2, ..*gains }) > best);
    }
}

/// The inverse of the known drive on drives that are not the known ones, one figure 20 % off at a time.
#[test]
fn a_drive_known_badly_is_still_followed_better() {
    let regulators = regulators();
    let known = regulators.machine(Choice::Inverse);
    let mut worst = (0.0_f64, 0.0_f64);
    for part in [0.8, 1.2] {
        let changes: [fn(&mut hal_sim::DriveParameters, f64); 4] = [
            |drive, part| drive.velocity_gain_per_s *= part,
            |drive, part| drive.integral_time_s *= part,
            |drive, part| drive.dead_time_s *= part,
            |drive, part| drive.load_inertia_ratio = part - 1.0,
        ];
        for change in changes {
            let mut machine = known.clone();
            machine.axes.iter_mut().for_each(|axis| change(&mut axis.drive, part));
            let found = motion_host::drive::circle::measure(&machine, 10.0, CIRCLE_FEED_MM_S).expect("a run");
            let [x_um, y_um] = found.following_um;
            worst = (worst.0.max(x_um.max(y_um)), worst.1.max(found.contour_um()));
        }
    }
    println!("20 % beside, at 10 Hz: following error {:.2} µm, contour error {:.2} µm", worst.0, worst.1);
    // As host/AXIS.md states them.
    assert!(worst.0 < 5.15 && worst.1 < 5.85, "{worst:?}");
}

/// The pictures of host/AXIS.md are those of the present code; MOTION_ACCEPT=1 draws them anew.
#[test]
fn pictures_of_the_regulators() {
    let regulators = regulators();
    let frequencies_hz: Vec<f64> = (2..=32).map(|half| f64::from(half) / 2.0).collect();
    let swept = sweeps(&regulators, CIRCLE_FEED_MM_S, &frequencies_hz, RESOLUTIONS_UM[0], &mut || {});
    let outputs = [Choice::PeerFitted, Choice::VajFitted].map(|choice| {
        (choice, regulators.output(choice, &circle(10.0), RESOLUTIONS_UM[1], 0.1).expect("a run"))
    });
    for (name, picture) in [
        ("AXIS-regulators.svg", picture_of_errors(&swept.expect("circles"))),
        ("AXIS-outputs.svg", picture_of_outputs(&outputs)),
    ] {
        assert!(picture.len() < PICTURE_BYTES_MAX, "{name}: {} bytes", picture.len());
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host").join(name);
        if is_accepting() {
            std::fs::write(&path, &picture).expect("a file");
        }
        let committed = std::fs::read_to_string(&path).expect("a picture; MOTION_ACCEPT=1 draws it");
        assert!(committed == picture, "{} differs; MOTION_ACCEPT=1 accepts it", path.display());
    }
}
