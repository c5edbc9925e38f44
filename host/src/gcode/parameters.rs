//! Numbered and named parameters.
//!
//! Numbers 1 to 5601. #1 to #30 belong to the subroutine that runs; so do names that do not begin with an
//! underscore. Everything else belongs to the program. What the modes and positions say (#5420, `#<_x>`) is
//! not stored here: [`predefined`](super::predefined) reads it from the state.

use std::collections::{BTreeMap, HashMap};

use super::message::DEBUGS;

/// The greatest number of a parameter.
pub const PARAMETER_MAX: u32 = 5601;
/// The parameters that belong to a subroutine: #1 to #30.
pub(super) const LOCALS: usize = 30;

/// Numbers that a program cannot assign: the position, and the tool.
pub(super) fn is_read_only(number: u32) -> bool {
    matches!(number, 5021..=5029 | 5400..=5413 | 5420..=5428)
}

/// The parameters of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// By number; 0 is unused.
    numbered: Vec<f64>,
    /// Names that begin with an underscore.
    globals: HashMap<String, f64>,
    /// The other names, of the main program and of every subroutine that runs.
    locals: Vec<HashMap<String, f64>>,
    /// #1 to #30 of the callers.
    callers: Vec<[f64; LOCALS]>,
}

impl Default for Parameters {
    fn default() -> Self {
        let mut numbered = vec![0.0; PARAMETER_MAX as usize + 1];
        // The first coordinate system is selected.
        numbered[SELECTED as usize] = 1.0;
        numbered[DEBUGS as usize] = 1.0;
        Self { numbered, globals: HashMap::new(), locals: vec![HashMap::new()], callers: Vec::new() }
    }
}

/// The number of the coordinate system in force, 1 to 9.
pub(super) const SELECTED: u32 = 5220;

impl Parameters {
    /// Parameters with numbered values to start from; numbers beyond the range are left out.
    #[must_use]
    pub fn with(values: &BTreeMap<u32, f64>) -> Self {
        let mut parameters = Self::default();
        for (&number, &value) in values {
            parameters.set(number, value);
        }
        parameters
    }

    /// The value of a number; 0 where nothing was assigned, and beyond the range.
    #[must_use]
    pub fn get(&self, number: u32) -> f64 {
        self.numbered.get(number as usize).copied().unwrap_or(0.0)
    }

    /// Assigns a number within the range.
    pub(super) fn set(&mut self, number: u32, value: f64) {
        if let Some(slot) = self.numbered.get_mut(number as usize) {
            *slot = value;
        }
    }

    /// The value of a name, lower case and without blanks; none where nothing was assigned.
    pub(super) fn named(&self, name: &str) -> Option<f64> {
        if name.starts_with('_') {
            self.globals.get(name).copied()
        } else {
            self.locals.last()?.get(name).copied()
        }
    }

    /// Assigns a name.
    pub(super) fn set_named(&mut self, name: &str, value: f64) {
        let names = if name.starts_with('_') { Some(&mut self.globals) } else { self.locals.last_mut() };
        let Some(names) = names else { return };
        match names.get_mut(name) {
            Some(slot) => *slot = value,
            None => drop(names.insert(name.to_owned(), value)),
        }
    }

    /// Enters a subroutine: its own names, and `arguments` as #1 to #30; without them the caller's stay.
    pub(super) fn enter(&mut self, arguments: Option<&[f64; LOCALS]>) {
        self.locals.push(HashMap::new());
        let numbered = self.numbered.iter_mut().skip(1).take(LOCALS);
        let mut caller = [0.0; LOCALS];
        for ((slot, saved), index) in numbered.zip(&mut caller).zip(0..) {
            *saved = *slot;
            if let Some(arguments) = arguments {
                *slot = arguments.get(index).copied().unwrap_or(0.0);
            }
        }
        self.callers.push(caller);
    }

    /// Leaves a subroutine. `restores` if it was entered with arguments.
    pub(super) fn leave(&mut self, restores: bool) {
        if self.locals.len() > 1 {
            self.locals.pop();
        }
        let Some(caller) = self.callers.pop() else { return };
        if restores {
            for (slot, saved) in self.numbered.iter_mut().skip(1).zip(caller) {
                *slot = saved;
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::*;

    #[test]
    fn a_subroutine_has_its_own() {
        let mut parameters = Parameters::default();
        parameters.set(1, 1.0);
        parameters.set(31, 31.0);
        parameters.set_named("a", 5.0);
        parameters.set_named("_g", 6.0);
        let mut arguments = [0.0; LOCALS];
        arguments[0] = 10.0;
        parameters.enter(Some(&arguments));
        assert_eq!((parameters.get(1), parameters.get(2), parameters.get(31)), (10.0, 0.0, 31.0));
        assert_eq!((parameters.named("a"), parameters.named("_g")), (None, Some(6.0)));
        parameters.set(1, 11.0);
        parameters.set(30, 30.0);
        parameters.set(32, 32.0);
        parameters.set_named("_h", 7.0);
        parameters.leave(true);
        assert_eq!((parameters.get(1), parameters.get(30), parameters.get(32)), (1.0, 0.0, 32.0));
        assert_eq!((parameters.named("a"), parameters.named("_h")), (Some(5.0), Some(7.0)));

        // Called by M98, it works on its caller's.
        parameters.enter(None);
        parameters.set(1, 3.0);
        parameters.leave(false);
        assert_eq!(parameters.get(1), 3.0);
    }

    #[test]
    fn numbers_beyond_the_range_are_nothing() {
        let mut parameters = Parameters::with(&[(5221, 2.0), (9999, 1.0)].into());
        parameters.set(PARAMETER_MAX + 1, 1.0);
        assert_eq!(
            (parameters.get(5221), parameters.get(PARAMETER_MAX + 1), parameters.get(SELECTED)),
            (2.0, 0.0, 1.0)
        );
    }
}
