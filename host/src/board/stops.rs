//! Why a program stops where it does.

use motion_kernel::program::Item;
use motion_kernel::units::Position;

use super::job::Job;
use crate::gcode::{Program, StepKind};
use crate::planning::{Item as PlanItem, Plan};

/// Places of program stops, in their order, with what the program says of them.
#[derive(Default)]
pub struct Stops {
    places: Vec<(Vec<Position>, String)>,
    /// Those before were reached.
    next: usize,
}

impl Stops {
    /// The stops of a program.
    #[must_use]
    pub fn new<const N: usize, const M: usize>(program: &Program, plan: &Plan<N>, job: &Job<M>) -> Self {
        let lines = plan.items.iter().filter_map(|item| match item {
            PlanItem::Stop { line } => Some(*line),
            _ => None,
        });
        let (mut here, mut places, mut before) = (job.header.start.to_vec(), Vec::new(), 0);
        let mut lines = lines.map(|line| (std::mem::replace(&mut before, line), line));
        for item in &job.items {
            match item {
                Item::EndOfStretch(end) => here = end.to_vec(),
                Item::Stop => {
                    let text = lines.next().map_or_else(String::new, |lines| words(program, lines));
                    places.push((here.clone(), text));
                }
                _ => {}
            }
        }
        Self { places, next: 0 }
    }

    /// Without the first ones.
    #[must_use]
    pub fn skip(self, count: usize) -> Self {
        Self { next: count, ..self }
    }

    /// From the first one on, again.
    pub fn rewind(&mut self) {
        self.next = 0;
    }

    /// The next stop is known.
    pub fn add(&mut self, place: Vec<Position>, text: String) {
        self.places.push((place, text));
    }

    /// What is said of the stop at `set`, the next one there.
    pub fn at(&mut self, set: &[Position]) -> Option<&str> {
        let is_here = |(place, _): &(Vec<Position>, String)| place.starts_with(set);
        let (index, (_, text)) =
            self.places.iter().enumerate().skip(self.next).find(|(_, place)| is_here(place))?;
        self.next = index + 1;
        Some(text)
    }
}

/// The stop in a line: a change of the tool, or a stop; and the messages since the line of the stop before.
fn words(program: &Program, (before, line): (u32, u32)) -> String {
    let tool = program.steps.iter().find_map(|step| match step.kind {
        StepKind::ToolChange { tool } if step.line == line => Some(tool),
        _ => None,
    });
    let mut text = match tool {
        Some(tool) => format!("line {line} changes to tool {tool}"),
        None => format!("line {line} stops"),
    };
    for message in &program.messages {
        // A change of the tool is a message, too.
        if message.line > before && (message.line < line || message.line == line && tool.is_none()) {
            text = format!("{text}; {}", message.text);
        }
    }
    text
}
