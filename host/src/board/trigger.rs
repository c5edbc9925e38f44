//! A trigger: which ticks of a scope are kept.

use std::collections::VecDeque;
use std::fmt;
use std::str::FromStr;

use crate::simulate::run::state_names;
use crate::trace::TraceRow;
use crate::trace::columns::AXIS_COLUMNS;

/// Most ticks that are kept in memory: a minute at 2 kHz.
pub const CAPTURE_MAX: usize = 120_000;

/// A condition of a tick. Displays as the text it is read from.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// As it was given.
    text: String,
    quantity: Quantity,
    is: Is,
}

#[derive(Clone, Debug, PartialEq)]
enum Quantity {
    State,
    Path(PathQuantity),
    /// Of the axis with that name, or of any: one of its columns.
    Axis(Option<String>, usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PathQuantity {
    S,
    V,
    A,
    J,
    Line,
}

#[derive(Clone, Debug, PartialEq)]
enum Is {
    Above(f64),
    Below(f64),
    Named(String),
}

impl Quantity {
    /// That of a column of a trace file.
    fn of(column: &str) -> Option<Self> {
        let of_axis = |word: &str| AXIS_COLUMNS.iter().position(|column| column.quantity == word);
        Some(match column {
            "state" => Self::State,
            "s_mm" => Self::Path(PathQuantity::S),
            "v_mm_s" => Self::Path(PathQuantity::V),
            "a_mm_s2" => Self::Path(PathQuantity::A),
            "j_mm_s3" => Self::Path(PathQuantity::J),
            "line" => Self::Path(PathQuantity::Line),
            _ => {
                let words: Vec<&str> = column.split('_').collect();
                let (at, quantity) =
                    words.iter().enumerate().rev().find_map(|(at, word)| Some((at, of_axis(word)?)))?;
                // With its unit behind.
                words.get(at + 1)?;
                Self::Axis((at > 0).then(|| words[..at].join("_")), quantity)
            }
        })
    }
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused = || {
            format!(
                "found `{text}`, expected COLUMN>VALUE, COLUMN<VALUE or state=NAME with a column of the trace file"
            )
        };
        let at = text.find(['>', '<', '=']).ok_or_else(refused)?;
        let (column, rest) = (text[..at].trim(), text[at + 1..].trim());
        let quantity = Quantity::of(column).ok_or_else(refused)?;
        let number = || rest.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or_else(refused);
        let is = match (&quantity, &text[at..=at]) {
            (Quantity::State, "=") if state_names().contains(&rest) => Is::Named(rest.to_owned()),
            (Quantity::State, "=") => {
                return Err(format!(
                    "found `{text}`, expected state= and one of {}",
                    state_names().join(", ")
                ));
            }
            (Quantity::Path(_) | Quantity::Axis(..), ">") => Is::Above(number()?),
            (Quantity::Path(_) | Quantity::Axis(..), "<") => Is::Below(number()?),
            _ => return Err(refused()),
        };
        Ok(Self { text: text.to_owned(), quantity, is })
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Condition {
    /// Whether it holds in a tick of axes with these names.
    #[must_use]
    pub fn holds<const N: usize>(&self, row: &TraceRow<N>, names: &[String]) -> bool {
        let is = |value: f64| match self.is {
            Is::Above(limit) => value.abs() > limit,
            Is::Below(limit) => value.abs() < limit,
            Is::Named(_) => false,
        };
        match (&self.quantity, &self.is) {
            (Quantity::State, Is::Named(name)) => row.state == name,
            (Quantity::State, _) => false,
            (Quantity::Path(quantity), _) => is(match quantity {
                PathQuantity::S => row.s_mm,
                PathQuantity::V => row.v_mm_s,
                PathQuantity::A => row.a_mm_s2,
                PathQuantity::J => row.j_mm_s3,
                PathQuantity::Line => f64::from(row.line),
            }),
            (Quantity::Axis(axis, column), _) => names
                .iter()
                .zip(&row.axes)
                .filter(|(name, _)| axis.as_ref().is_none_or(|axis| axis == *name))
                .any(|(_, tick)| AXIS_COLUMNS.get(*column).is_some_and(|column| is((column.of)(tick)))),
        }
    }

    /// Whether there is an axis of its name.
    #[must_use]
    pub fn suits(&self, names: &[String]) -> bool {
        match &self.quantity {
            Quantity::Axis(Some(axis), _) => names.contains(axis),
            _ => true,
        }
    }
}

/// The ticks around those where a condition holds.
#[derive(Clone, Debug)]
pub struct Around<const N: usize> {
    trigger: Condition,
    /// Names of the axes.
    names: Vec<String>,
    before: usize,
    after: usize,
    /// The latest ticks that were not taken.
    waiting: VecDeque<TraceRow<N>>,
    /// So many more ticks are to be taken.
    left: usize,
    triggers: u64,
}

impl<const N: usize> Around<N> {
    /// So many ticks before and after those of axes with these names where the trigger's condition holds.
    #[must_use]
    pub fn new(trigger: Condition, names: Vec<String>, before: usize, after: usize) -> Self {
        Self { trigger, names, before, after, waiting: VecDeque::new(), left: 0, triggers: 0 }
    }

    /// Looks at the next tick; hands on those that are in the window, in their order.
    pub fn take(&mut self, row: &TraceRow<N>, keep: &mut dyn FnMut(&TraceRow<N>)) {
        if self.trigger.holds(row, &self.names) {
            self.triggers += u64::from(self.left == 0);
            // This one, and those after it.
            self.left = self.after + 1;
            self.waiting.drain(..).for_each(|row| keep(&row));
        }
        if self.left > 0 {
            self.left -= 1;
            return keep(row);
        }
        self.waiting.push_back(*row);
        if self.waiting.len() > self.before {
            self.waiting.pop_front();
        }
    }

    /// How often the condition became true.
    #[must_use]
    pub fn triggers(&self) -> u64 {
        self.triggers
    }

    /// Whether it has become true, and the ticks after it are taken.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.triggers > 0 && self.left == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::AxisTick;

    fn row(tick: u64, err_um: f64, state: &'static str) -> TraceRow<3> {
        let axes = [AxisTick { err_um, ..AxisTick::default() }, AxisTick::default(), AxisTick::default()];
        TraceRow {
            tick,
            s_mm: 0.0,
            v_mm_s: -3.0,
            a_mm_s2: 0.0,
            j_mm_s3: 0.0,
            snap_mm_s4: 0.0,
            state,
            line: 7,
            contour_um: 0.0,
            axes,
        }
    }

    #[test]
    fn conditions_are_of_columns() {
        let names = ["X", "Y_left", "Z"].map(str::to_owned);
        let holds = |text: &str| text.parse::<Condition>().map(|is| is.holds(&row(0, -51.0, "held"), &names));
        for (text, expected) in [
            ("X_err_um>50", true),
            ("X_err_um>51", false),
            ("err_um>50", true),
            ("Z_err_um>50", false),
            ("Y_left_err_um < 1", true),
            ("v_mm_s>2.5", true),
            ("line>7", false),
            ("state=held", true),
            ("state=fault", false),
        ] {
            assert_eq!(holds(text), Ok(expected), "{text}");
        }
        for text in
            ["", "X_err_um", "X_err_um=3", "err>3", "X_err_um>much", "X_err_um>NaN", "state>1", "speed>1"]
        {
            let error = text.parse::<Condition>().expect_err(text);
            assert!(error.starts_with(&format!("found `{text}`, expected COLUMN>VALUE")), "{error}");
        }
        assert!(!"A_err_um>1".parse::<Condition>().expect("a condition").suits(&names));
    }

    /// Ticks 40 and 43 are over the limit: from two before the first one to three after the second.
    #[test]
    fn ticks_before_and_after_are_taken() {
        let names = ["X", "Y", "Z"].map(str::to_owned).to_vec();
        let mut around = Around::<3>::new("X_err_um>50".parse().expect("a condition"), names, 2, 3);
        let mut ticks = Vec::new();
        for tick in 0..100 {
            let err_um = if matches!(tick, 40 | 43) { 60.0 } else { 1.0 };
            around.take(&row(tick, err_um, "moving"), &mut |row| ticks.push(row.tick));
            assert_eq!(around.is_over(), tick >= 46, "{tick}");
        }
        assert_eq!(ticks, [38, 39, 40, 41, 42, 43, 44, 45, 46]);
        assert_eq!(around.triggers(), 1);
    }
}
