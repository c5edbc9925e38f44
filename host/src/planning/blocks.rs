//! A block list, BLOCKS.json: a bare list of lengths and feeds, planned like a stretch.

use motion_kernel::law::{Law, Limits};
use motion_kernel::plan::{Block, PlanError, Reason};
use serde::Deserialize;

use super::error::{Place, PlanningError, Problem};
use super::lookahead::lookahead;
use super::profile::FeedProfile;
use super::{Mode, Plan};
use crate::record::BlockRecord;

/// The tick that durations are counted in where no machine says one \[s\].
const TICK_S: f64 = 0.0005;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BlockList {
    limits: JsonLimits,
    start_feed_mm_s: NotNegative,
    end_feed_mm_s: NotNegative,
    blocks: Vec<JsonBlock>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonLimits {
    accel_mm_s2: Positive,
    jerk_mm_s3: Positive,
    snap_mm_s4: Positive,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonBlock {
    length_mm: NotNegative,
    feed_mm_s: Positive,
}

// Checked while reading, so that the error has a line and a column.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
struct Positive(f64);

impl TryFrom<f64> for Positive {
    type Error = String;
    fn try_from(value: f64) -> Result<Self, String> {
        if value > 0.0 && value.is_finite() {
            Ok(Self(value))
        } else {
            Err(format!("found {value}, expected a number above 0"))
        }
    }
}

#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
struct NotNegative(f64);

impl TryFrom<f64> for NotNegative {
    type Error = String;
    fn try_from(value: f64) -> Result<Self, String> {
        if value >= 0.0 && value.is_finite() {
            Ok(Self(value))
        } else {
            Err(format!("found {value}, expected a number not below 0"))
        }
    }
}

/// Plans a block list.
///
/// # Errors
/// The text is not a block list, or the list can't be planned from its start feed to its end feed.
pub fn plan_blocks(source_name: &str, text: &[u8], mode: Mode) -> Result<Plan, PlanningError> {
    let fail = |place: Place, problem: Problem| PlanningError {
        source_name: source_name.to_owned(),
        place,
        problem,
    };
    let list: BlockList = serde_json::from_slice(text).map_err(|error| {
        let number = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
        let place = Place { line: number(error.line()), column: Some(number(error.column())) };
        // The reader's own text ends with the place, which stands in front here.
        let text = error.to_string();
        let what = text.split(" at line ").next().unwrap_or(&text);
        let found = if what.starts_with("found") { "" } else { "found " };
        fail(place, Problem::Json(format!("{found}{what}")))
    })?;
    let law = Law::new(Limits {
        accel_mm_s2: list.limits.accel_mm_s2.0,
        jerk_mm_s3: list.limits.jerk_mm_s3.0,
        snap_mm_s4: list.limits.snap_mm_s4.0,
    })
    .map_err(|error| fail(line_of(text, "limits"), error.into()))?;
    let blocks: Vec<Block<f64>> = list
        .blocks
        .iter()
        .map(|block| Block {
            length_mm: block.length_mm.0,
            cap_mm_s: block.feed_mm_s.0,
            joint_mm_s: f64::INFINITY,
            law,
        })
        .collect();
    let ends_mm: Vec<f64> = blocks
        .iter()
        .scan(0.0, |end, block| {
            *end += block.length_mm;
            Some(*end)
        })
        .collect();
    let planned = lookahead(blocks.clone(), &ends_mm, list.start_feed_mm_s.0, list.end_feed_mm_s.0, mode)
        .map_err(|problem| fail(line_of(text, key(&problem)), problem))?;
    let profile =
        FeedProfile::new(&planned, TICK_S).map_err(|problem| fail(line_of(text, "blocks"), problem))?;
    let mut start_mm = 0.0;
    let mut records = Vec::with_capacity(blocks.len());
    for (block, &end_mm) in blocks.iter().zip(&ends_mm) {
        let (plan, time_s) = profile.over(start_mm, end_mm);
        records.push(BlockRecord {
            line: 0,
            kind: "block",
            start_mm,
            length_mm: block.length_mm,
            cap_mm_s: block.cap_mm_s,
            cap_reason: plan.reason(block, Reason::Programmed).name(),
            enter_mm_s: plan.enter_mm_s,
            peak_mm_s: plan.peak_mm_s,
            exit_mm_s: plan.exit_mm_s,
            time_s,
        });
        start_mm = end_mm;
    }
    Ok(Plan {
        source: source_name.to_owned(),
        blocks: records,
        feed: profile.records(0.0),
        time_s: profile.time_s(),
        length_mm: ends_mm.last().copied().unwrap_or(0.0),
        items: Vec::new(),
        notices: Vec::new(),
        tick_s: TICK_S,
    })
}

/// The key a problem of the look-ahead is about.
fn key(problem: &Problem) -> &'static str {
    match problem {
        Problem::Plan(
            PlanError::EndFeed { quantity: "end feed", .. } | PlanError::TooShortToAccelerate { .. },
        ) => "end_feed_mm_s",
        Problem::Plan(PlanError::EndFeed { .. } | PlanError::TooShortToBrake { .. }) => "start_feed_mm_s",
        _ => "blocks",
    }
}

/// The line in which `key` stands first.
fn line_of(text: &[u8], key: &str) -> Place {
    let quoted = format!("\"{key}\"");
    let at = text.windows(quoted.len()).position(|window| window == quoted.as_bytes()).unwrap_or(0);
    let breaks = text[..at].iter().filter(|&&byte| byte == b'\n').count();
    Place::from(u32::try_from(breaks + 1).unwrap_or(u32::MAX))
}
