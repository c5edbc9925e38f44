//! A block list, BLOCKS.json: a bare list of lengths and feeds, planned like a stretch.

use motion_kernel::law::{Law, Limits, Pulse};
use motion_kernel::plan::{Block, PlanError, Reason};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};

use super::error::{Place, PlanningError, Problem};
use super::lookahead::lookahead;
use super::profile::FeedProfile;
use super::{Mode, Plan};
use crate::gcode;
use crate::machine::{LAW_NAMES, law_named};
use crate::trace::TracedBlock;

/// The tick that durations are counted in where no machine says one \[s\].
const TICK_S: f64 = 0.0005;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with the keys of a block list")]
struct BlockList {
    #[serde(default)]
    law: LawName,
    limits: JsonLimits,
    start_feed_mm_s: NotNegative,
    end_feed_mm_s: NotNegative,
    blocks: Vec<JsonBlock>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with three limits")]
struct JsonLimits {
    accel_mm_s2: Positive,
    jerk_mm_s3: Positive,
    snap_mm_s4: Positive,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with length_mm and feed_mm_s")]
struct JsonBlock {
    length_mm: NotNegative,
    feed_mm_s: Positive,
}

type Positive = Figure<false>;
type NotNegative = Figure<true>;

// Checked while reading, so that the error has a line and a column.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
struct Figure<const MAY_BE_ZERO: bool>(f64);

impl<const MAY_BE_ZERO: bool> TryFrom<f64> for Figure<MAY_BE_ZERO> {
    type Error = String;
    fn try_from(value: f64) -> Result<Self, String> {
        let least = if MAY_BE_ZERO { "not below" } else { "above" };
        if value.is_finite() && (value > 0.0 || MAY_BE_ZERO && value == 0.0) {
            Ok(Self(value))
        } else {
            Err(format!("found {value}, expected a number {least} 0"))
        }
    }
}

/// The shape of the pulses of jerk.
#[derive(Default)]
struct LawName(Pulse);

impl<'de> Deserialize<'de> for LawName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let refused = || D::Error::custom(format!("found {value}, expected {LAW_NAMES}"));
        law_named(value.as_str()).map(Self).ok_or_else(refused)
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
        // At the end of the text the reader is in column 0 of a line that has no text.
        let column = Some(error.column()).filter(|&column| column > 0).map(number);
        let place = Place { line: number(error.line()), column };
        fail(place, Problem::Json(found_expected(&error, text)))
    })?;
    let pulse = mode.pulse(list.law.0);
    let limits = Limits {
        accel_mm_s2: list.limits.accel_mm_s2.0,
        jerk_mm_s3: list.limits.jerk_mm_s3.0,
        snap_mm_s4: list.limits.snap_mm_s4.0,
    };
    let law = Law::new(pulse, limits).map_err(|error| fail(line_of(text, "limits"), error.into()))?;
    let blocks: Vec<Block<f64>> = list
        .blocks
        .iter()
        .map(|block| Block {
            length_mm: block.length_mm.0,
            cap_mm_s: block.feed_mm_s.0,
            junction_mm_s: f64::INFINITY,
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
    let feeds_mm_s = [list.start_feed_mm_s.0, list.end_feed_mm_s.0];
    let planned =
        lookahead(&blocks, &ends_mm, feeds_mm_s, mode, TICK_S).map_err(|(block, problem)| {
            match key(&problem) {
                Some(key) => fail(line_of(text, key), problem),
                None => fail(line_of_block(text, block), problem),
            }
        })?;
    let profile = FeedProfile::new(&planned);
    let mut start_mm = 0.0;
    let mut records = Vec::with_capacity(blocks.len());
    for (block, &end_mm) in blocks.iter().zip(&ends_mm) {
        let (plan, time_s) = profile.over(start_mm, end_mm);
        records.push(TracedBlock {
            line: 0,
            kind: "block".into(),
            start_mm,
            length_mm: block.length_mm,
            cap_mm_s: block.cap_mm_s,
            cap_reason: plan.reason(block, Reason::Programmed).name().into(),
            enter_mm_s: plan.enter_mm_s,
            peak_mm_s: plan.peak_mm_s,
            exit_mm_s: plan.exit_mm_s,
            time_s,
            is_rapid: false,
        });
        start_mm = end_mm;
    }
    Ok(Plan {
        blocks: records,
        feed: profile.ramps().to_vec(),
        time_s: profile.time_s(),
        length_mm: ends_mm.last().copied().unwrap_or(0.0),
        ..Plan::empty(source_name, pulse, TICK_S, [None; 3])
    })
}

/// The JSON reader's refusal in the words of the project.
fn found_expected(error: &serde_json::Error, text: &[u8]) -> String {
    // Its own text ends with the place, which stands in front here.
    let message = error.to_string();
    let what = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what);
    if what.starts_with("found ") {
        return what.to_owned();
    }
    if let Some(wrong) = what.strip_prefix("invalid type: ").or(what.strip_prefix("invalid value: ")) {
        return format!("found {}", wrong.replace("expected f64", "expected a number"));
    }
    if let Some(missing) = what.strip_prefix("missing field ") {
        return format!("found no key {missing}, expected it in this object");
    }
    if let Some(unknown) = what.strip_prefix("unknown field ") {
        return format!("found unknown key {unknown}");
    }
    if let Some(twice) = what.strip_prefix("duplicate field ") {
        return format!("found a second key {twice}, expected one");
    }
    if let Some(whole) = what.strip_prefix("EOF while parsing ") {
        return format!("found the end of the file, expected the rest of {whole}");
    }
    let expected = match what {
        "key must be a string" => Some("expected a key in double quotes"),
        _ => what.starts_with("expected ").then_some(what),
    };
    if let Some(expected) = expected {
        let line = text.split(|&byte| byte == b'\n').nth(error.line().saturating_sub(1)).unwrap_or(&[]);
        let byte = error.column().checked_sub(1).and_then(|column| line.get(column)).copied();
        return format!("found {}, {expected}", gcode::describe(byte));
    }
    format!("found {what}, expected a block list as `motion plan --help` shows it")
}

/// The key a problem of the look-ahead is about, if it is not a block.
fn key(problem: &Problem) -> Option<&'static str> {
    match problem {
        Problem::Plan(
            PlanError::EndFeed { quantity: "end feed", .. } | PlanError::TooShortToAccelerate { .. },
        ) => Some("end_feed_mm_s"),
        Problem::Plan(PlanError::EndFeed { .. } | PlanError::TooShortToBrake { .. }) => {
            Some("start_feed_mm_s")
        }
        _ => None,
    }
}

/// The line in which `key` stands first.
fn line_of(text: &[u8], key: &str) -> Place {
    line_at(text, offset_of(text, key))
}

/// The line in which a block begins: blocks have no objects inside.
fn line_of_block(text: &[u8], block: usize) -> Place {
    let key = offset_of(text, "blocks");
    let braces = text.iter().enumerate().skip(key).filter(|&(_, &byte)| byte == b'{');
    line_at(text, braces.map(|(at, _)| at).nth(block).unwrap_or(key))
}

fn offset_of(text: &[u8], key: &str) -> usize {
    let quoted = format!("\"{key}\"");
    text.windows(quoted.len()).position(|window| window == quoted.as_bytes()).unwrap_or(0)
}

fn line_at(text: &[u8], offset: usize) -> Place {
    let breaks = text[..offset].iter().filter(|&&byte| byte == b'\n').count();
    Place::from(u32::try_from(breaks + 1).unwrap_or(u32::MAX))
}
