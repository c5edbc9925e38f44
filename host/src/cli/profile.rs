//! `motion profile`: one ramp of the feed law, in the papers' figures.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use motion_kernel::law::{Limits, Pulse, Ramp};

use super::error::{CliError, Outcome};
use super::table::{self, Align};
use super::{csv_failure, write_json};
use crate::ramp::{self, Moment, RampError, RampFigures, corner_times_s};

/// More rows than this mean a mistyped tick.
const ROWS_MAX: f64 = 1e8;
/// A last tick this close to the ramp's end, in ticks, is taken as the end.
const SAME_TICK: f64 = 1e-6;

const EXAMPLES: &str = "\
Examples:
  motion profile --from 0 --to 200 --accel 500 --jerk 5000 --snap 400000
      the first worked example of the sin² law: Jp = 5000 mm/s³, t1 = 0.2 s, tp = 0.6 s, 60 mm
  motion profile --from 100 --to 19 --accel 500 --jerk 5000 --snap 400000 --json
      a braking ramp, for a script
  motion profile --from 0 --to 200 --accel 500 --jerk 5000 --snap 400000 --tick 0.001 --csv > ramp.csv
      a row per millisecond
  motion profile --from 0 --to 200 --accel 500 --jerk 5000 --snap 400000 --law plateau
      the same change of feed with all the snap that is allowed: 0.52 s

Symbols: S path length, V feed, A acceleration, J jerk, DJ snap; Jp peak jerk; e edge of a pulse of jerk, p its
plateau; snap is greatest at e/2, which is t1/4 without a plateau; t1 end of the rising phase, t2 end of the phase
of constant acceleration, tp end of the ramp.";

/// Compute one change of feed: peak jerk, times, length, and the motion inside it.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ProfileArguments {
    /// Feed at the start [mm/s], 0 or more.
    #[arg(long, value_name = "MM_S", value_parser = not_negative, allow_negative_numbers = true)]
    from: f64,
    /// Feed at the end [mm/s], 0 or more; lower than --from brakes.
    #[arg(long, value_name = "MM_S", value_parser = not_negative, allow_negative_numbers = true)]
    to: f64,
    /// Acceleration limit [mm/s²], above 0.
    #[arg(long, value_name = "A", value_parser = positive, allow_negative_numbers = true)]
    accel: f64,
    /// Jerk limit [mm/s³], above 0.
    #[arg(long, value_name = "J", value_parser = positive, allow_negative_numbers = true)]
    jerk: f64,
    /// Snap limit [mm/s⁴], above 0.
    #[arg(long, value_name = "DJ", value_parser = positive, allow_negative_numbers = true)]
    snap: f64,
    /// Shape of the pulses of jerk: one sin² arch as in the papers, or two halves of one as short as snap
    /// allows with a plateau between them, which is what machine files have where they do not say.
    #[arg(long, value_enum, default_value_t = LawChoice::Sin2)]
    law: LawChoice,
    /// Time between two rows of --csv, in seconds, above 0.
    #[arg(long, value_name = "S", default_value = "0.0005", value_parser = positive, allow_negative_numbers = true)]
    tick: f64,
    /// Print JSON: law, peak_jerk_mm_s3, edge_s, plateau_s, t1_s, t2_s, tp_s, length_mm, limited_by, and `at`
    /// e/2, t1, t2, tp.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV: t_s,s_mm,v_mm_s,a_mm_s2,j_mm_s3,snap_mm_s4, a row per tick from 0 and one at tp.
    #[arg(long)]
    csv: bool,
}

/// The shapes of a pulse of jerk.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum LawChoice {
    Sin2,
    Plateau,
}

impl From<LawChoice> for Pulse {
    fn from(law: LawChoice) -> Self {
        match law {
            LawChoice::Sin2 => Self::Sin2,
            LawChoice::Plateau => Self::Plateau,
        }
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("found {text}, expected a number not below 0")),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("found {text}, expected a number above 0")),
    }
}

/// Computes and prints the ramp.
///
/// # Errors
/// The figures are beyond the range of numbers, the table would be too long, or `out` can't be written.
pub fn profile(arguments: &ProfileArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let ramp = ramp(arguments)?;
    if arguments.csv {
        write_csv(&ramp, arguments.tick, out)?;
    } else if arguments.json {
        write_json(&RampFigures::new(arguments.law.into(), &ramp), out)?;
    } else {
        write_table(&ramp, out).map_err(CliError::Output)?;
    }
    Ok(Outcome::Done)
}

fn ramp(arguments: &ProfileArguments) -> Result<Ramp<f64>, CliError> {
    let limits =
        Limits { accel_mm_s2: arguments.accel, jerk_mm_s3: arguments.jerk, snap_mm_s4: arguments.snap };
    ramp::ramp(arguments.law.into(), limits, [arguments.from, arguments.to])
        .map_err(|RampError { found }| CliError::Arguments { found, expected: RampError::EXPECTED })
}

fn write_csv(ramp: &Ramp<f64>, tick_s: f64, out: &mut dyn Write) -> Result<(), CliError> {
    let end_s = ramp.duration_s();
    if end_s / tick_s > ROWS_MAX {
        let found = format!("{end_s} s in ticks of {tick_s} s");
        return Err(CliError::Arguments { found, expected: "at most 1e8 ticks" });
    }
    // A tick that coincides with tp, but for rounding, is the last row.
    let before_end = (end_s / tick_s - SAME_TICK).ceil().max(0.0) as u64;
    let mut csv = csv::Writer::from_writer(out);
    let times_s = (0..before_end).map(|tick| tick as f64 * tick_s).chain([end_s]);
    for t_s in times_s {
        csv.serialize(Moment::new(ramp, t_s)).map_err(|error| CliError::Output(csv_failure(error)))?;
    }
    csv.flush().map_err(CliError::Output)
}

fn write_table(ramp: &Ramp<f64>, out: &mut dyn Write) -> io::Result<()> {
    let Ramp { from_mm_s, to_mm_s, t1_s, t2_s, .. } = *ramp;
    let (from_mm_min, to_mm_min) = (from_mm_s * 60.0, to_mm_s * 60.0);
    write!(out, "Feed {from_mm_s} → {to_mm_s} mm/s ({from_mm_min:.1} → {to_mm_min:.1} mm/min), ")?;
    if ramp.duration_s() <= 0.0 {
        writeln!(out, "equal feeds: a ramp of no duration")?;
    } else {
        writeln!(out, "limited by {}", ramp.limited_by.name())?;
    }
    let (jerk, tp_s, length_mm) = (ramp.peak_jerk_mm_s3, ramp.duration_s(), ramp.length_mm());
    writeln!(
        out,
        "Jp = {jerk:.3} mm/s³, t1 = {t1_s:.6} s, t2 = {t2_s:.6} s, tp = {tp_s:.6} s, S = {length_mm:.6} mm"
    )?;
    if ramp.plateau_s() > 0.0 {
        writeln!(out, "e = {:.6} s, p = {:.6} s", ramp.edge_s, ramp.plateau_s())?;
    }
    writeln!(out)?;
    let columns = [
        ("at", "", Align::Left),
        ("t", "s", Align::Right),
        ("S", "mm", Align::Right),
        ("V", "mm/s", Align::Right),
        ("A", "mm/s²", Align::Right),
        ("J", "mm/s³", Align::Right),
        ("DJ", "mm/s⁴", Align::Right),
    ];
    let middle_of_the_edge = if ramp.plateau_s() > 0.0 { "e/2" } else { "t1/4" };
    let names = [middle_of_the_edge, "t1", "t2", "tp"];
    let rows: Vec<[String; 7]> = names
        .iter()
        .zip(corner_times_s(ramp).map(|t_s| Moment::new(ramp, t_s)))
        .map(|(name, row)| {
            [
                (*name).to_owned(),
                format!("{:.6}", row.t_s),
                format!("{:.6}", row.s_mm),
                format!("{:.6}", row.v_mm_s),
                format!("{:.4}", row.a_mm_s2),
                format!("{:.3}", row.j_mm_s3),
                format!("{:.2}", row.snap_mm_s4),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(from: f64, to: f64) -> RampFigures {
        under(LawChoice::Sin2, from, to)
    }

    fn under(law: LawChoice, from: f64, to: f64) -> RampFigures {
        let arguments = ProfileArguments {
            from,
            to,
            accel: 500.0,
            jerk: 5e3,
            snap: 4e5,
            law,
            tick: 1e-3,
            json: false,
            csv: false,
        };
        RampFigures::new(law.into(), &ramp(&arguments).expect("a ramp"))
    }

    /// The three worked examples of S1, in mm, to half of the last digit the paper prints. The third prints
    /// tp and A(t1) as made from its printed t1 and Jp, whose roundings they carry: 2·0.05 ms and 0.13 mm/s².
    #[test]
    fn worked_examples_of_the_paper() {
        let check = |name: &str, found: f64, printed: f64, digit: f64| {
            assert!(
                (found - printed).abs() <= 0.5 * digit * (1.0 + 1e-9),
                "{name}: {found}, printed {printed}"
            );
        };
        // F₀, F, Jp, t1, t2, tp, DJ(t1/4), A(t1), V(t1), S(t1), S(t2), S(tp): value and last digit.
        type Printed = (f64, f64);
        let examples: [(f64, f64, &str, [Printed; 10]); 3] = [
            (
                0.0,
                200.0,
                "acceleration",
                [
                    (5e3, 100.0),
                    (0.2, 0.1),
                    (0.4, 0.1),
                    (0.6, 0.1),
                    (78_540.0, 10.0),
                    (500.0, 100.0),
                    (50.0, 10.0),
                    (2.8, 0.1),
                    (22.8, 0.1),
                    (60.0, 10.0),
                ],
            ),
            (
                19.0,
                100.0,
                "jerk",
                [
                    (5e3, 100.0),
                    (0.18, 0.01),
                    (0.18, 0.01),
                    (0.36, 0.01),
                    (87_270.0, 10.0),
                    (450.0, 10.0),
                    (59.5, 0.1),
                    (5.5, 0.1),
                    (5.5, 0.1),
                    (21.4, 0.1),
                ],
            ),
            (
                18.0,
                20.0,
                "snap",
                [
                    (4020.0, 10.0),
                    (0.0316, 1e-4),
                    (0.0316, 1e-4),
                    (0.0632, 2e-4),
                    (4e5, 1000.0),
                    (63.5, 0.3),
                    (19.0, 1.0),
                    (0.58, 0.01),
                    (0.58, 0.01),
                    (1.2, 0.1),
                ],
            ),
        ];
        for (from, to, limited_by, printed) in examples {
            let found = of(from, to);
            assert_eq!(found.limited_by, limited_by);
            let [quarter, t1, t2, tp] = found.at;
            let figures = [
                found.peak_jerk_mm_s3,
                found.t1_s,
                found.t2_s,
                found.tp_s,
                quarter.snap_mm_s4,
                t1.a_mm_s2,
                t1.v_mm_s,
                t1.s_mm,
                t2.s_mm,
                tp.s_mm,
            ];
            for (index, (found, (value, digit))) in figures.into_iter().zip(printed).enumerate() {
                check(&format!("{from} → {to}, figure {index}"), found, value, digit);
            }
            // Acceleration, jerk and snap are 0 at the end.
            assert!([tp.a_mm_s2, tp.j_mm_s3, tp.snap_mm_s4].iter().all(|x| x.abs() <= 0.0));
        }
    }

    /// The papers' examples with a plateau: an edge takes π·J/(2·DJ), and a pulse is the box of jerk that
    /// makes the acceleration, widened by an edge.
    #[test]
    fn worked_examples_with_a_plateau() {
        let near = |found: f64, expected: f64| (found - expected).abs() <= 1e-12 * expected;
        let edge_s = core::f64::consts::PI * 5e3 / (2.0 * 4e5);
        let found = under(LawChoice::Plateau, 0.0, 200.0);
        assert_eq!((found.law, found.limited_by), ("plateau", "acceleration"));
        assert!(near(found.peak_jerk_mm_s3, 5e3) && near(found.edge_s, edge_s));
        assert!(near(found.plateau_s, 0.1 - edge_s) && near(found.t1_s, 0.1 + edge_s));
        assert!(near(found.t2_s, 0.4) && near(found.tp_s, 0.5 + edge_s));
        assert!(near(found.length_mm, 100.0 * (0.5 + edge_s)));
        let [middle, t1, t2, tp] = found.at;
        assert!(near(middle.snap_mm_s4, 4e5) && near(middle.j_mm_s3, 2500.0), "{}", middle.snap_mm_s4);
        assert!(near(t1.a_mm_s2, 500.0) && near(t1.v_mm_s, 250.0 * (0.1 + edge_s)));
        assert!(near(t2.v_mm_s, 200.0 - t1.v_mm_s) && near(tp.v_mm_s, 200.0));
        // Jerk limits: J·P·(P − e) = 40 mm/s. Snap limits: as in the papers.
        let found = under(LawChoice::Plateau, 19.0, 59.0);
        assert_eq!(found.limited_by, "jerk");
        assert!(near(found.edge_s, edge_s) && near(found.t2_s, found.t1_s));
        assert!(near(5e3 * found.t1_s * (found.t1_s - edge_s), 40.0));
        let (found, arch) = (under(LawChoice::Plateau, 18.0, 20.0), of(18.0, 20.0));
        assert_eq!(found.limited_by, "snap");
        assert!(near(found.t1_s, arch.t1_s) && near(found.edge_s, arch.t1_s / 2.0) && found.plateau_s <= 0.0);
    }

    #[test]
    fn braking_is_the_mirror() {
        for law in [LawChoice::Sin2, LawChoice::Plateau] {
            let (up, down) = (under(law, 19.0, 100.0), under(law, 100.0, 19.0));
            assert!((up.length_mm - down.length_mm).abs() < 1e-12);
            assert!((up.at[1].a_mm_s2 + down.at[1].a_mm_s2).abs() < 1e-9);
        }
    }

    #[test]
    fn equal_feeds_take_no_time() {
        for law in [LawChoice::Sin2, LawChoice::Plateau] {
            let none = under(law, 100.0, 100.0);
            assert!(none.tp_s <= 0.0 && none.length_mm <= 0.0 && none.peak_jerk_mm_s3 <= 0.0);
            let is_at_rest = |row: &Moment| (row.v_mm_s - 100.0).abs() < 1e-12 && row.snap_mm_s4.abs() <= 0.0;
            assert!(none.at.iter().all(is_at_rest));
        }
    }

    #[test]
    fn the_csv_ends_at_the_end() {
        for (tick_s, rows) in [(0.001, 601), (0.0007, 859), (1.0, 2), (0.6, 2)] {
            let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
            let ramp = ramp::ramp(Pulse::Sin2, limits, [0.0, 200.0]).expect("a ramp");
            let mut text = Vec::new();
            write_csv(&ramp, tick_s, &mut text).expect("memory");
            let text = String::from_utf8(text).expect("UTF-8");
            assert_eq!(text.lines().count(), rows + 1, "tick {tick_s}");
            let last: Vec<f64> = text
                .lines()
                .last()
                .expect("a row")
                .split(',')
                .map(|f| f.parse().expect("a number"))
                .collect();
            let expected = [0.6, 60.0, 200.0, 0.0, 0.0, 0.0];
            assert!(last.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{last:?}");
        }
    }
}
