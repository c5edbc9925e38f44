//! A program that is read in parts, while those before are used already.

use std::mem::take;

use super::error::GcodeError;
use super::flow::Flow;
use super::library::Failure;
use super::options::ReadOptions;
use super::program::{Batch, Program};

/// Steps of a part, about: what a line makes stays together, and cutter compensation holds back what later lines change.
const STEPS: usize = 256;

/// A program being read.
pub struct Reading<'a> {
    flow: Option<Flow<'a>>,
    /// What is known at the end.
    program: Option<Program>,
    /// What stands behind the part that was given out last.
    error: Option<GcodeError>,
}

impl<'a> Reading<'a> {
    /// Before the first line; arguments as for [`read_with`](super::read_with).
    #[must_use]
    pub fn new(source_name: &str, text: &'a [u8], options: &'a ReadOptions) -> Self {
        Self { flow: Some(Flow::new(source_name, text, options)), program: None, error: None }
    }

    /// The next part; none behind the last one.
    ///
    /// # Errors
    /// See [`read_with`](super::read_with). The parts before have all that stands before the line at fault, but for moves that
    /// cutter compensation would yet change.
    pub fn next_batch(&mut self) -> Result<Option<Batch>, GcodeError> {
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        let Some(flow) = &mut self.flow else { return Ok(None) };
        loop {
            match flow.next_line().map_err(Failure::into_error) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => {
                    let before = flow.interpreter.take();
                    self.flow = None;
                    self.error = before.is_some().then(|| error.clone());
                    return before.map_or(Err(error), |batch| Ok(Some(batch)));
                }
            }
            if flow.interpreter.program.steps.len() >= STEPS
                && let Some(batch) = flow.interpreter.take()
            {
                return Ok(Some(batch));
            }
        }
        let Some(flow) = self.flow.take() else { return Ok(None) };
        let mut program = flow.finish()?;
        let Program { steps, nurbs, messages, lines, tool_changes, .. } = &mut program;
        // They count the steps of the whole.
        (*lines, *tool_changes) = Default::default();
        let batch = Batch { steps: take(steps), nurbs: take(nurbs), messages: take(messages) };
        self.program = Some(program);
        Ok(Some(batch))
    }

    /// What is known of the program behind its last part: everything but steps, curves, messages, and what counts
    /// steps.
    #[must_use]
    pub fn into_program(self) -> Option<Program> {
        self.program
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::read_with;

    /// Parts are the whole, wherever they are cut: with messages, cycles, loops, compensation and NURBS.
    #[test]
    fn parts_make_the_program() {
        let text = "G21 G90 F900\n(MSG,begin)\no1 repeat [300]\nG91 G1 X1\nG1 Y1\no1 endrepeat\nG90 (MSG,holes)\n\
                    G81 X1 Y2 Z-1 R1 L9\nG80 G41 D1\nG1 X500\no2 repeat [200]\nG91 G1 X5 Y3\n(MSG,beside)\nG1 X3 Y-1\n\
                    o2 endrepeat\nG90 G40\nG1 X0 Y0\nG5.2 P1 X0 Y1\nX2 Y2 P1\nX2 Y0 P1\nX0 Y0 P2\nG5.3\nM2\n";
        let options = ReadOptions { tool_radius_mm: 0.5, ..ReadOptions::default() };
        let whole = read_with("parts.ngc", text.as_bytes(), &options).expect("a program");
        let mut reading = Reading::new("parts.ngc", text.as_bytes(), &options);
        let (mut together, mut parts) = (Batch::default(), 0);
        while let Some(batch) = reading.next_batch().expect("a program") {
            let (steps, nurbs) = (together.steps.len(), together.nurbs.len());
            together.messages.extend(batch.messages.into_iter().map(|mut message| {
                message.step += steps;
                message
            }));
            together.steps.extend(batch.steps.into_iter().map(|mut step| {
                if let crate::gcode::StepKind::Nurbs(curve) = &mut step.kind {
                    curve.curve += nurbs;
                }
                step
            }));
            together.nurbs.extend(batch.nurbs);
            parts += 1;
        }
        assert!(parts >= 3, "{parts}");
        let rest = reading.into_program().expect("read to the end");
        let Batch { steps, nurbs, messages } = together;
        let (lines, tool_changes) = Default::default();
        let whole = Program { lines, tool_changes, ..whole };
        // Too long to be shown.
        assert!(Program { steps, nurbs, messages, ..rest } == whole);
    }

    /// What stands before a line at fault was given out.
    #[test]
    fn a_line_at_fault_ends_what_was_right() {
        let text = format!("G21 G90 F900\n{}G1 X1 Q9Z\n", "G1 X1\nG1 X2\n".repeat(400));
        let options = ReadOptions::default();
        let mut reading = Reading::new("wrong.ngc", text.as_bytes(), &options);
        let mut steps = 0;
        let error = loop {
            match reading.next_batch() {
                Ok(Some(batch)) => steps += batch.steps.len(),
                Ok(None) => panic!("the last line is wrong"),
                Err(error) => break error,
            }
        };
        assert_eq!(steps, 800);
        assert!(error.to_string().starts_with("wrong.ngc:802:"), "{error}");
    }
}
