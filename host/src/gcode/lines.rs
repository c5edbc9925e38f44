//! When the lines of a program run: for starts in its middle.

/// When a line runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Runs {
    /// It does not: it is jumped over, or stands behind the end.
    #[default]
    Never,
    /// Once: before the step of this index.
    Once {
        /// The index of the first step that is made from here on.
        step: u32,
    },
    /// More than once: in a loop, or in a subroutine that is called again.
    Again,
}

/// When each line of the program's own file runs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lines(Vec<Runs>);

impl Lines {
    /// When a line, from 1, runs; none if the program has no such line.
    #[must_use]
    pub fn runs(&self, line: u32) -> Option<Runs> {
        self.0.get((line as usize).checked_sub(1)?).copied()
    }

    /// The number of lines.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// A line that is there.
    pub(super) fn is_there(&mut self, line: u32) {
        let count = (line as usize).max(self.0.len());
        self.0.resize(count, Runs::Never);
    }

    /// A line runs, before the step of this index.
    pub(super) fn run(&mut self, line: u32, step: usize) {
        self.is_there(line);
        if let Some(runs) = (line as usize).checked_sub(1).and_then(|index| self.0.get_mut(index)) {
            *runs = match runs {
                // There are fewer steps than that.
                Runs::Never => Runs::Once { step: u32::try_from(step).unwrap_or(u32::MAX) },
                Runs::Once { .. } | Runs::Again => Runs::Again,
            };
        }
    }

    /// A step was removed: those behind it moved up.
    pub(super) fn removed(&mut self, removed: usize) {
        for runs in &mut self.0 {
            if let Runs::Once { step } = runs
                && *step as usize > removed
            {
                *step -= 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;

    fn lines(text: &str) -> Vec<Runs> {
        read("a.ngc", text.as_bytes()).unwrap_or_else(|error| panic!("{error}")).lines.0
    }

    #[test]
    fn lines_run_never_once_or_again() {
        use Runs::{Again, Never, Once};
        let text =
            "G1 X1 F600\n\no1 if [0]\nX2\no1 endif\no2 repeat [2]\nG91 X1\no2 endrepeat\nG90 X9\nM2\nX1\n";
        let found = lines(text);
        let once = |step| Once { step };
        // Behind a condition that does not hold, its end is jumped over, too.
        assert_eq!(found[..5], [once(0), once(1), once(1), Never, Never]);
        assert_eq!(found[6], Again);
        assert_eq!(found[8..], [once(3), once(4), Never]);
        // The lines of a subroutine run once where it is called once, after the lines before the call.
        let text = "o1 sub\nG1 X1 F600\no1 endsub\nG1 X5 F600\no1 call\nM2\n";
        assert_eq!(lines(text)[1..5], [once(1), once(2), once(0), once(1)]);
        let text = "o1 sub\nG1 X1 F600\no1 endsub\no1 call\nX2\no1 call\nM2\n";
        assert_eq!(lines(text)[1], Again);
    }
}
