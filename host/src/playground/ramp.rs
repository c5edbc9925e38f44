//! One ramp of the feed law, as `motion profile` has it, with the course of it as a run without axes.

use motion_kernel::law::Limits;
use serde::{Deserialize, Serialize};

use super::Answer;
use crate::machine::{LAW_NAMES, law_named};
use crate::ramp::{Moment, RampFigures, ramp};
use crate::report::PageRun;
use crate::trace::{AxisTick, PathLimits, RunEnd, RunTrace, TraceRow};

/// Ticks of the course, but for the first.
const TICKS: u64 = 1000;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RampRequest {
    law: String,
    from_mm_s: f64,
    to_mm_s: f64,
    accel_mm_s2: f64,
    jerk_mm_s3: f64,
    snap_mm_s4: f64,
}

#[derive(Serialize)]
struct RampJson {
    figures: RampFigures,
}

impl RampRequest {
    pub(super) fn answer(&self) -> Result<Answer, String> {
        let &Self { ref law, from_mm_s, to_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4 } = self;
        let law = law_named(Some(law)).ok_or_else(|| format!("found law {law}, expected {LAW_NAMES}"))?;
        for (name, feed) in [("from", from_mm_s), ("to", to_mm_s)] {
            if !(feed >= 0.0) {
                return Err(format!("found {name} = {feed}, expected a number not below 0"));
            }
        }
        let limits = Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 };
        let ramp = ramp(law, limits, [from_mm_s, to_mm_s]).map_err(|error| error.to_string())?;
        let tick_s = ramp.duration_s() / TICKS as f64;
        let row = |tick: u64| {
            let Moment { s_mm, v_mm_s, a_mm_s2, j_mm_s3, snap_mm_s4, .. } =
                Moment::new(&ramp, tick as f64 * tick_s);
            TraceRow {
                tick,
                s_mm,
                v_mm_s,
                a_mm_s2,
                j_mm_s3,
                snap_mm_s4,
                state: "moving",
                line: 0,
                contour_um: 0.0,
                axes: [AxisTick::default(); 1],
            }
        };
        let trace = RunTrace::<1> {
            program: format!("ramp {from_mm_s} → {to_mm_s} mm/s"),
            tick_s,
            limits: PathLimits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 },
            // Equal feeds take no time.
            ticks: if tick_s > 0.0 { (0..=TICKS).map(row).collect() } else { Vec::new() },
            planned_time_s: ramp.duration_s(),
            end: RunEnd::Finished,
            ..RunTrace::default()
        };
        let page = PageRun::of(&trace).map_err(|error| error.to_string())?;
        Answer::new(&RampJson { figures: RampFigures::new(law, &ramp) }, page.data().to_vec())
    }
}
