//! Expressions: `[…]`, parameters, functions, to numbers.
//!
//! Evaluated where they stand, from left to right, as often as their line runs. Nesting is bounded, so no text
//! makes it recurse deeply.
//!
//! | operators | |
//! |---|---|
//! | `**` | binds tightest; from the left, like all others |
//! | `*` `/` `MOD` | MOD is never negative |
//! | `+` `-` | |
//! | `EQ` `NE` `GT` `GE` `LT` `LE` | 1 or 0; equal within 10⁻⁶ |
//! | `AND` `OR` `XOR` | 1 or 0 |

use super::error::{Located, Problem, describe};
use super::lexer::Cursor;
use super::number;
use super::parameters::PARAMETER_MAX;

/// Brackets and parameters within each other, at most.
const DEPTH_MAX: u32 = 64;
/// What `EQ`, `NE`, `GE` and `LE` take for equal.
const EQUAL: f64 = 1e-6;

/// Where the values of parameters come from.
pub(super) trait Environment {
    /// The value of a number within the range.
    fn numbered(&self, number: u32) -> f64;
    /// The value of a name; none where nothing was assigned.
    fn named(&self, name: &str) -> Option<f64>;
    /// Whether values count. Where a text is only checked, no value is wrong.
    fn counts(&self) -> bool {
        true
    }
    /// Whether X words are diameters (G7).
    fn is_diameter(&self) -> bool {
        false
    }
}

/// No parameters: a text of plain numbers.
pub(super) struct NoParameters;

impl Environment for NoParameters {
    fn numbered(&self, _: u32) -> f64 {
        0.0
    }

    fn named(&self, _: &str) -> Option<f64> {
        None
    }
}

/// The parameter an assignment is for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Target {
    /// Within the range.
    Number(u32),
    /// Lower case, without blanks.
    Name(String),
}

/// Reads the expression in brackets at the cursor.
pub(super) fn bracketed(cursor: &mut Cursor<'_>, environment: &dyn Environment) -> Result<f64, Located> {
    Reader { cursor, environment, depth: 0 }.bracketed()
}

/// Reads a number, a parameter, a function or an expression in brackets.
pub(super) fn operand(cursor: &mut Cursor<'_>, environment: &dyn Environment) -> Result<f64, Located> {
    Reader { cursor, environment, depth: 0 }.operand()
}

/// Reads what stands after `#` where something is assigned.
pub(super) fn target(cursor: &mut Cursor<'_>, environment: &dyn Environment) -> Result<Target, Located> {
    Reader { cursor, environment, depth: 0 }.target()
}

/// The function whose name is at the cursor, if a `[` follows; the cursor stays.
pub(super) fn is_function(cursor: &Cursor<'_>) -> bool {
    let mut after = cursor.clone();
    Function::read(&mut after).is_some() && after.peek_text() == Some(b'[')
}

struct Reader<'reader, 'line> {
    cursor: &'reader mut Cursor<'line>,
    environment: &'reader dyn Environment,
    depth: u32,
}

impl Reader<'_, '_> {
    fn deeper<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T, Located>) -> Result<T, Located> {
        if self.depth >= DEPTH_MAX {
            return Err(self.cursor.located(Problem::ExpressionTooDeep { levels: DEPTH_MAX }));
        }
        self.depth += 1;
        let read = read(self);
        self.depth -= 1;
        read
    }

    fn bracketed(&mut self) -> Result<f64, Located> {
        self.expect(b'[', "'['")?;
        let value = self.deeper(|reader| reader.binary(1))?;
        self.expect(b']', "an operator or ']'")?;
        Ok(value)
    }

    fn expect(&mut self, byte: u8, expected: &'static str) -> Result<(), Located> {
        if self.cursor.peek_text() == Some(byte) {
            self.cursor.next += 1;
            return Ok(());
        }
        let found = describe(self.cursor.peek_text());
        Err(self.cursor.located(Problem::Syntax { found, expected }))
    }

    /// Operands joined by operators that bind as tightly as `lowest` or tighter.
    fn binary(&mut self, lowest: u32) -> Result<f64, Located> {
        let mut left = self.operand()?;
        loop {
            self.cursor.skip_blanks();
            let (before, place) = (self.cursor.next, self.cursor.next);
            let Some(operator) = Operator::read(self.cursor) else { return Ok(left) };
            if operator.binding() < lowest {
                self.cursor.next = before;
                return Ok(left);
            }
            let right = self.binary(operator.binding() + 1)?;
            left = self.valued(place, operator.apply(left, right))?;
        }
    }

    /// A result, if it is a number.
    fn valued(&self, place: usize, value: Result<f64, &'static str>) -> Result<f64, Located> {
        let wrong = match value {
            Ok(value) if value.is_finite() => return Ok(value),
            _ if !self.environment.counts() => return Ok(1.0),
            Ok(_) => "a result beyond the range of numbers",
            Err(wrong) => wrong,
        };
        Err(Located::new(place, Problem::Undefined { found: wrong }))
    }

    fn operand(&mut self) -> Result<f64, Located> {
        let mut negative = false;
        loop {
            match self.cursor.peek_text() {
                Some(b'-') => negative = !negative,
                Some(b'+') => {}
                _ => break,
            }
            self.cursor.next += 1;
        }
        let value = match self.cursor.peek_text() {
            Some(b'[') => self.bracketed()?,
            Some(b'#') => self.deeper(Self::parameter)?,
            Some(b'0'..=b'9' | b'.') => self.literal()?,
            Some(letter) if letter.is_ascii_alphabetic() => self.function()?,
            found => {
                let found = describe(found);
                return Err(self
                    .cursor
                    .located(Problem::Syntax { found, expected: "a number, '#', '[' or a function" }));
            }
        };
        Ok(if negative { -value } else { value })
    }

    fn literal(&mut self) -> Result<f64, Located> {
        let start = self.cursor.next;
        let text = self.cursor.take_while(|byte| matches!(byte, b'0'..=b'9' | b'.' | b' ' | b'\t'));
        let digits: String =
            text.iter().filter(|byte| !matches!(byte, b' ' | b'\t')).map(|&byte| char::from(byte)).collect();
        let wrong =
            || Located::new(start, Problem::NumberMalformed { word: digits.chars().take(40).collect() });
        // Rust takes what RS274 writes, but no point alone.
        let value = digits.parse::<f64>().map_err(|_| wrong())?;
        self.valued(start, Ok(value))
    }

    /// What stands after `#`; the cursor is at it.
    fn target(&mut self) -> Result<Target, Located> {
        let place = self.cursor.next;
        self.expect(b'#', "'#'")?;
        if self.cursor.peek_text() == Some(b'<') {
            return Ok(Target::Name(self.cursor.name()?));
        }
        let index = self.deeper(Self::operand)?;
        if !self.environment.counts() {
            return Ok(Target::Number(1));
        }
        let number = number::whole(index).and_then(|number| u32::try_from(number).ok());
        match number {
            Some(number @ 1..=PARAMETER_MAX) => Ok(Target::Number(number)),
            _ => Err(Located::new(place, Problem::ParameterNumber { found: index })),
        }
    }

    fn parameter(&mut self) -> Result<f64, Located> {
        let place = self.cursor.next;
        match self.target()? {
            Target::Number(number) => Ok(self.environment.numbered(number)),
            Target::Name(_) if !self.environment.counts() => Ok(1.0),
            Target::Name(name) => match self.environment.named(&name) {
                Some(value) => Ok(value),
                None => Err(Located::new(place, Problem::ParameterUnset { name })),
            },
        }
    }

    fn function(&mut self) -> Result<f64, Located> {
        let place = self.cursor.next;
        let Some(function) = Function::read(self.cursor) else {
            let found = describe(self.cursor.peek_text());
            return Err(self
                .cursor
                .located(Problem::Syntax { found, expected: "a number, '#', '[' or a function" }));
        };
        if function == Function::Exists {
            return self.exists();
        }
        let argument = self.bracketed()?;
        if function == Function::Atan {
            self.expect(b'/', "'/' and a second argument of ATAN")?;
            let run = self.bracketed()?;
            return Ok(libm::atan2(argument, run).to_degrees());
        }
        self.valued(place, function.apply(argument))
    }

    fn exists(&mut self) -> Result<f64, Located> {
        self.expect(b'[', "'['")?;
        self.cursor.skip_blanks();
        let target = self.target()?;
        self.expect(b']', "']'")?;
        Ok(match target {
            Target::Number(_) => 1.0,
            Target::Name(name) => truth(self.environment.named(&name).is_some()),
        })
    }
}

fn truth(value: bool) -> f64 {
    if value { 1.0 } else { 0.0 }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operator {
    Power,
    Times,
    Divide,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    GreaterEqual,
    Less,
    LessEqual,
    And,
    Or,
    ExclusiveOr,
}

impl Operator {
    /// In the order they are tried: what begins like another one comes first.
    const ALL: [(&'static [u8], Self); 15] = [
        (b"**", Self::Power),
        (b"*", Self::Times),
        (b"/", Self::Divide),
        (b"+", Self::Plus),
        (b"-", Self::Minus),
        (b"MOD", Self::Modulo),
        (b"EQ", Self::Equal),
        (b"NE", Self::NotEqual),
        (b"GE", Self::GreaterEqual),
        (b"GT", Self::Greater),
        (b"LE", Self::LessEqual),
        (b"LT", Self::Less),
        (b"AND", Self::And),
        (b"XOR", Self::ExclusiveOr),
        (b"OR", Self::Or),
    ];

    fn read(cursor: &mut Cursor<'_>) -> Option<Self> {
        Self::ALL.into_iter().find(|(name, _)| cursor.take_name(name)).map(|(_, operator)| operator)
    }

    fn binding(self) -> u32 {
        match self {
            Self::Power => 5,
            Self::Times | Self::Divide | Self::Modulo => 4,
            Self::Plus | Self::Minus => 3,
            Self::Equal
            | Self::NotEqual
            | Self::Greater
            | Self::GreaterEqual
            | Self::Less
            | Self::LessEqual => 2,
            Self::And | Self::Or | Self::ExclusiveOr => 1,
        }
    }

    fn apply(self, left: f64, right: f64) -> Result<f64, &'static str> {
        let near = (left - right).abs() < EQUAL;
        Ok(match self {
            Self::Power if left < 0.0 && right != right.floor() => {
                return Err("a negative number to a power that is not whole");
            }
            Self::Power => libm::pow(left, right),
            Self::Times => left * right,
            Self::Divide | Self::Modulo if right == 0.0 => return Err("a division by 0"),
            Self::Divide => left / right,
            Self::Modulo => {
                let rest = left % right;
                if rest < 0.0 { rest + right.abs() } else { rest }
            }
            Self::Plus => left + right,
            Self::Minus => left - right,
            Self::Equal => truth(near),
            Self::NotEqual => truth(!near),
            Self::Greater => truth(left > right),
            Self::GreaterEqual => truth(near || left >= right),
            Self::Less => truth(left < right),
            Self::LessEqual => truth(near || left <= right),
            Self::And => truth(left != 0.0 && right != 0.0),
            Self::Or => truth(left != 0.0 || right != 0.0),
            Self::ExclusiveOr => truth((left != 0.0) != (right != 0.0)),
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Function {
    Abs,
    Acos,
    Asin,
    Atan,
    Cos,
    Exists,
    Exp,
    Fix,
    Fup,
    Ln,
    Round,
    Sin,
    Sqrt,
    Tan,
}

impl Function {
    const ALL: [(&'static [u8], Self); 14] = [
        (b"ABS", Self::Abs),
        (b"ACOS", Self::Acos),
        (b"ASIN", Self::Asin),
        (b"ATAN", Self::Atan),
        (b"COS", Self::Cos),
        (b"EXISTS", Self::Exists),
        (b"EXP", Self::Exp),
        (b"FIX", Self::Fix),
        (b"FUP", Self::Fup),
        (b"LN", Self::Ln),
        (b"ROUND", Self::Round),
        (b"SIN", Self::Sin),
        (b"SQRT", Self::Sqrt),
        (b"TAN", Self::Tan),
    ];

    fn read(cursor: &mut Cursor<'_>) -> Option<Self> {
        Self::ALL.into_iter().find(|(name, _)| cursor.take_name(name)).map(|(_, function)| function)
    }

    /// Angles in degrees.
    fn apply(self, argument: f64) -> Result<f64, &'static str> {
        Ok(match self {
            Self::Abs => argument.abs(),
            Self::Acos if argument.abs() > 1.0 => return Err("ACOS of a number beyond ±1"),
            Self::Acos => libm::acos(argument).to_degrees(),
            Self::Asin if argument.abs() > 1.0 => return Err("ASIN of a number beyond ±1"),
            Self::Asin => libm::asin(argument).to_degrees(),
            Self::Cos => libm::cos(argument.to_radians()),
            Self::Exp => libm::exp(argument),
            Self::Fix => argument.floor(),
            Self::Fup => argument.ceil(),
            Self::Ln if argument <= 0.0 => return Err("LN of a number that is not positive"),
            Self::Ln => libm::log(argument),
            Self::Round => argument.round(),
            Self::Sin => libm::sin(argument.to_radians()),
            Self::Sqrt if argument < 0.0 => return Err("SQRT of a negative number"),
            Self::Sqrt => argument.sqrt(),
            Self::Tan => libm::tan(argument.to_radians()),
            // They take other arguments.
            Self::Atan | Self::Exists => argument,
        })
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::*;

    struct Values;

    impl Environment for Values {
        fn numbered(&self, number: u32) -> f64 {
            f64::from(number) * 10.0
        }

        fn named(&self, name: &str) -> Option<f64> {
            (name == "_a.b").then_some(7.0)
        }
    }

    fn value(text: &str) -> Result<f64, String> {
        let mut cursor = Cursor::new(text.as_bytes());
        operand(&mut cursor, &Values).map_err(|located| format!("{}: {}", located.offset, located.problem))
    }

    #[test]
    fn operators_bind_as_in_linuxcnc() {
        for (text, expected) in [
            ("[1+2*3**2]", 19.0),
            ("[2**3**2]", 64.0),
            ("[-2**2]", 4.0),
            ("[0-2**2]", -4.0),
            ("[10-4-3]", 3.0),
            ("[2*3 MOD 4]", 2.0),
            ("[-7 MOD 3]", 2.0),
            ("[7mod-3]", 1.0),
            ("[1 LT 2 AND 2 LT 3]", 1.0),
            ("[1 or 0 and 0]", 0.0),
            ("[1 XOR 1]", 0.0),
            ("[1+1 EQ 2.0000001]", 1.0),
            ("[1 NE 1.000002]", 1.0),
            ("[3 GE 3.0000001]", 1.0),
            ("[3 GT 2.9]", 1.0),
            ("[3 LE 2.9]", 0.0),
            ("- -#1", 10.0),
            ("##[10/10*1]", 100.0),
            ("#1", 10.0),
            ("[ # 2 + # < _A . b > ]", 27.0),
            ("[1 2 . 5]", 12.5),
        ] {
            assert_eq!(value(text), Ok(expected), "{text}");
        }
        assert_eq!(value("##56"), Ok(5600.0));
    }

    #[test]
    fn functions_take_degrees() {
        for (text, expected) in [
            ("sin[30]", 0.5),
            ("COS[60]", 0.5),
            ("tan[45]", 1.0),
            ("asin[1]", 90.0),
            ("acos[0]", 90.0),
            ("atan[1]/[-1]", 135.0),
            ("[atan[-1]/[0] / 2]", -45.0),
            ("sqrt[9]", 3.0),
            ("exp[0]", 1.0),
            ("ln[1]", 0.0),
            ("abs[-3]", 3.0),
            ("fix[-2.8]", -3.0),
            ("fup[-2.8]", -2.0),
            ("round[-2.5]", -3.0),
            ("exists[#<_a.b>]", 1.0),
            ("exists[#<other>]", 0.0),
            ("exists[#5]", 1.0),
        ] {
            assert!((value(text).unwrap() - expected).abs() < 1e-12, "{text}: {:?}", value(text));
        }
    }

    #[test]
    fn what_has_no_value_is_refused_at_its_place() {
        for (text, offset, message) in [
            ("[1/0]", 2, "found a division by 0"),
            ("[1 mod 0]", 3, "found a division by 0"),
            ("[[0-1]**.5]", 6, "found a negative number to a power"),
            ("ln[0]", 0, "found LN of"),
            ("[1+sqrt[-1]]", 3, "found SQRT of"),
            ("asin[2]", 0, "found ASIN"),
            ("acos[-2]", 0, "found ACOS"),
            ("[10**400]", 3, "beyond the range"),
            ("tan", 3, "found the end of the line, expected '['"),
            ("[1 1+]", 5, "found ']', expected a number"),
            ("[1", 2, "found the end of the line, expected an operator"),
            ("[1,2]", 2, "found ','"),
            ("[foo[1]]", 1, "found 'f', expected a number"),
            ("atan[1]", 7, "expected '/'"),
            ("#<other>", 0, "found #<other>, to which nothing was assigned"),
            ("#<open", 1, "found '<' without"),
            ("#0", 0, "found parameter 0"),
            ("#5602", 0, "found parameter 5602"),
            ("#1.5", 0, "found parameter 1.5"),
            ("[1.2.3]", 1, "found 1.2.3"),
            ("exists[5]", 7, "expected '#'"),
        ] {
            let error = value(text).unwrap_err();
            assert!(error.starts_with(&format!("{offset}: ")) && error.contains(message), "{text}: {error}");
        }
        for open in ["[", "#", "-[", "sin["] {
            let error = value(&open.repeat(100_000)).unwrap_err();
            assert!(error.contains("within each other") || error.contains("expected"), "{error}");
        }
    }
}
