//! The bytes of a line to its words, assignments and comments.
//!
//! One pass reads no byte of a plain line more than twice and allocates nothing unless it fails.

use super::decimal::{Decimal, NumberFault};
use super::error::{Located, Problem, describe};
use super::expression::{self, Environment, Target};
use super::number::Number;
use super::{parameters, predefined};

/// A letter and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Word<'a> {
    /// Upper-case letter, `@` or `^`.
    pub(super) letter: u8,
    /// The number after it.
    pub(super) number: Number,
    /// Byte offset of the letter in its line.
    pub(super) offset: usize,
    /// It had more decimals than are exact.
    pub(super) rounded: bool,
    /// The word as written.
    source: &'a [u8],
}

impl Word<'_> {
    /// The word as an error message quotes it.
    pub(super) fn text(&self) -> String {
        quote(self.source)
    }

    /// A problem at this word.
    pub(super) fn problem(&self, problem: impl FnOnce(String) -> Problem) -> Located {
        Located::new(self.offset, problem(self.text()))
    }

    /// The number, for quantities that are whole, `least` or more. `expected` says so.
    pub(super) fn count(&self, least: i64, expected: &'static str) -> Result<u32, Located> {
        let count = self.number.whole().filter(|&count| count >= least);
        count
            .and_then(|count| u32::try_from(count).ok())
            .ok_or_else(|| self.problem(|word| Problem::NotThisCount { word, expected }))
    }

    /// Refuses a negative number, for quantities that are 0 or more.
    pub(super) fn refuse_negative(&self) -> Result<(), Located> {
        if self.number.signum() < 0 { Err(self.problem(|word| Problem::Negative { word })) } else { Ok(()) }
    }
}

/// Upper case, no blanks, and never longer than a message can bear.
fn quote(source: &[u8]) -> String {
    const LENGTH_MAX: usize = 40;
    let mut characters =
        source.iter().filter(|byte| !is_blank(**byte)).map(|byte| char::from(byte.to_ascii_uppercase()));
    let mut text: String = characters.by_ref().take(LENGTH_MAX).collect();
    if characters.next().is_some() {
        text.push('…');
    }
    text
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t')
}

/// Whether nothing but blanks is in the line.
pub(super) fn is_blank_line(line: &[u8]) -> bool {
    line.iter().all(|&byte| is_blank(byte))
}

/// Whether the line is a tape mark: a `%` and blanks.
pub(super) fn is_percent_line(line: &[u8]) -> bool {
    let mut text = line.iter().filter(|byte| !is_blank(**byte));
    text.next() == Some(&b'%') && text.next().is_none()
}

/// A place in a line.
#[derive(Clone, Debug)]
pub(super) struct Cursor<'a> {
    line: &'a [u8],
    /// Byte offset.
    pub(super) next: usize,
}

impl<'a> Cursor<'a> {
    /// The start of `line`, which is without its line end.
    pub(super) fn new(line: &'a [u8]) -> Self {
        Self { line, next: 0 }
    }

    fn peek(&self) -> Option<u8> {
        self.line.get(self.next).copied()
    }

    /// Steps over blanks.
    pub(super) fn skip_blanks(&mut self) {
        self.take_while(is_blank);
    }

    /// The next byte that is no blank; steps over the blanks.
    pub(super) fn peek_text(&mut self) -> Option<u8> {
        self.skip_blanks();
        self.peek()
    }

    /// Steps over the bytes that `take` accepts.
    pub(super) fn take_while(&mut self, take: impl Fn(u8) -> bool) -> &'a [u8] {
        let start = self.next;
        while self.peek().is_some_and(&take) {
            self.next += 1;
        }
        self.line.get(start..self.next).unwrap_or_default()
    }

    /// Steps over `name`, in any case, if it is next. Blanks within do not count: `else if` is `elseif`.
    pub(super) fn take_name(&mut self, name: &[u8]) -> bool {
        let start = self.next;
        for letter in name {
            if !self.peek_text().is_some_and(|byte| byte.eq_ignore_ascii_case(letter)) {
                self.next = start;
                return false;
            }
            self.next += 1;
        }
        true
    }

    /// Steps over `<name>`; gives the name in lower case, without blanks.
    pub(super) fn name(&mut self) -> Result<String, Located> {
        let opening = self.next;
        self.next += 1;
        let text = self.take_while(|byte| !matches!(byte, b'>' | b'(' | b')' | b'#' | b'<'));
        let name = String::from_utf8_lossy(text);
        let name: String =
            name.chars().filter(|c| !matches!(c, ' ' | '\t')).map(|c| c.to_ascii_lowercase()).collect();
        if self.peek() != Some(b'>') || name.is_empty() {
            return Err(Located::new(opening, Problem::NameNotClosed));
        }
        self.next += 1;
        Ok(name)
    }

    /// A problem at this place.
    pub(super) fn located(&self, problem: Problem) -> Located {
        Located::new(self.next, problem)
    }

    /// Steps over the comment at whose parenthesis it is; gives its text.
    pub(super) fn comment(&mut self) -> Result<&'a [u8], Located> {
        let opening = self.next;
        self.next += 1;
        let text = self.take_while(|byte| !matches!(byte, b'(' | b')'));
        match self.peek() {
            Some(b')') => {
                self.next += 1;
                Ok(text)
            }
            Some(_) => Err(self.located(Problem::CommentNested)),
            None => Err(Located::new(opening, Problem::CommentNotClosed)),
        }
    }
}

/// What a line is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item<'a> {
    /// A letter and its number.
    Word(Word<'a>),
    /// `#…=…`
    Assignment(Assignment),
    /// A comment in parentheses, without them.
    Comment(&'a [u8]),
}

/// A parameter and the value it gets once the whole line is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Assignment {
    pub(super) target: Target,
    pub(super) value: f64,
}

/// The items of a line, from left to right; ends after the first error.
pub(super) struct Items<'a, 'environment> {
    cursor: Cursor<'a>,
    environment: &'environment dyn Environment,
}

impl<'a, 'environment> Items<'a, 'environment> {
    /// The items from the cursor to the end of its line.
    pub(super) fn new(cursor: Cursor<'a>, environment: &'environment dyn Environment) -> Self {
        Self { cursor, environment }
    }

    /// A word; the cursor is at its letter.
    fn word(&mut self, letter: u8) -> Result<Word<'a>, Located> {
        let cursor = &mut self.cursor;
        let offset = cursor.next;
        cursor.next += 1;
        let letter = letter.to_ascii_uppercase();
        let (number, rounded) = if self.is_computed() {
            (Number::Real(expression::operand(&mut self.cursor, self.environment)?), false)
        } else {
            self.literal(offset, letter)?
        };
        let source = self.cursor.line.get(offset..self.cursor.next).unwrap_or_default();
        Ok(Word { letter, number, offset, rounded, source })
    }

    /// Whether the number at the cursor is to be computed: `#1`, `-[…]`, `SIN[…]`.
    fn is_computed(&self) -> bool {
        let mut ahead = self.cursor.clone();
        ahead.take_while(|byte| is_blank(byte) || matches!(byte, b'+' | b'-'));
        match ahead.peek() {
            Some(b'#' | b'[') => true,
            Some(letter) if letter.is_ascii_alphabetic() => expression::is_function(&ahead),
            _ => false,
        }
    }

    /// A number as written, and whether it had to be rounded.
    fn literal(&mut self, offset: usize, letter: u8) -> Result<(Number, bool), Located> {
        let cursor = &mut self.cursor;
        let text =
            cursor.take_while(|byte| is_blank(byte) || matches!(byte, b'0'..=b'9' | b'.' | b'+' | b'-'));
        let source = || quote(self.cursor.line.get(offset..self.cursor.next).unwrap_or_default());
        let problem = match Decimal::parse(text) {
            Ok((number, rounded)) => return Ok((Number::Exact(number), rounded)),
            Err(NumberFault::Missing) => {
                let found = describe(self.cursor.peek());
                Problem::NumberMissing { letter: char::from(letter), found }
            }
            Err(NumberFault::Malformed) => Problem::NumberMalformed { word: source() },
            Err(NumberFault::TooLarge) => {
                let digits: String =
                    text.iter().filter(|byte| !is_blank(**byte)).map(|&byte| char::from(byte)).collect();
                match digits.parse::<f64>() {
                    Ok(value) if value.is_finite() => return Ok((Number::Real(value), false)),
                    _ => Problem::NumberTooLarge { word: source() },
                }
            }
        };
        Err(Located::new(offset, problem))
    }

    /// `#…=…`; the cursor is at the `#`.
    fn assignment(&mut self) -> Result<Assignment, Located> {
        let offset = self.cursor.next;
        let target = expression::target(&mut self.cursor, self.environment)?;
        if self.cursor.peek_text() != Some(b'=') {
            let found = describe(self.cursor.peek_text());
            return Err(self.cursor.located(Problem::Syntax { found, expected: "'=' after the parameter" }));
        }
        self.cursor.next += 1;
        match &target {
            Target::Number(number) if parameters::is_read_only(*number) => {
                return Err(Located::new(offset, Problem::ParameterReadOnly { name: format!("#{number}") }));
            }
            Target::Name(name) if predefined::is_name(name) => {
                return Err(Located::new(offset, Problem::ParameterReadOnly { name: format!("#<{name}>") }));
            }
            _ => {}
        }
        let value = expression::operand(&mut self.cursor, self.environment)?;
        Ok(Assignment { target, value })
    }

    /// The problem of a byte that starts no word.
    fn stray(&self, byte: u8) -> Located {
        let problem = match byte {
            b'%' => Problem::PercentInLine,
            _ => Problem::Character { found: describe(Some(byte)) },
        };
        self.cursor.located(problem)
    }

    fn item(&mut self) -> Option<Result<Item<'a>, Located>> {
        Some(match self.cursor.peek_text()? {
            b';' => return None,
            b'(' => self.cursor.comment().map(Item::Comment),
            b'#' => self.assignment().map(Item::Assignment),
            // A checksum ends the line; nothing is to be compared with it.
            b'*' if self.is_checksum() => return None,
            letter if letter.is_ascii_alphabetic() => self.word(letter).map(Item::Word),
            sign @ (b'@' | b'^') => self.word(sign).map(Item::Word),
            byte => Err(self.stray(byte)),
        })
    }

    /// Whether nothing but the digits of a checksum follows.
    fn is_checksum(&self) -> bool {
        let mut ahead = self.cursor.clone();
        ahead.next += 1;
        let has_digits = !ahead.take_while(|byte| byte.is_ascii_digit()).is_empty();
        has_digits && matches!(ahead.peek_text(), None | Some(b';'))
    }
}

impl<'a> Iterator for Items<'a, '_> {
    type Item = Result<Item<'a>, Located>;

    fn next(&mut self) -> Option<Self::Item> {
        let item = self.item();
        if !matches!(item, Some(Ok(_))) {
            self.cursor.next = self.cursor.line.len();
        }
        item
    }
}

#[cfg(test)]
mod tests {
    use super::super::expression::NoParameters;
    use super::*;

    /// The words of a line written one way: upper case, one blank apart, plain decimals.
    fn plain(line: &[u8]) -> Result<String, Located> {
        let mut words = Vec::new();
        for item in Items::new(Cursor::new(line), &NoParameters) {
            match item? {
                Item::Word(Word { letter, number: Number::Exact(number), .. }) => {
                    words.push(format!("{}{number}", char::from(letter)));
                }
                Item::Word(Word { letter, number: Number::Real(value), .. }) => {
                    words.push(format!("{}={value}", char::from(letter)));
                }
                Item::Assignment(Assignment { target, value }) => words.push(format!("{target:?}={value}")),
                Item::Comment(_) => {}
            }
        }
        Ok(words.join(" "))
    }

    #[test]
    fn blanks_case_and_comments_do_not_count() {
        for line in ["g0x +0. 12 34y 7", "G0 X0.1234 Y7", "\tG 0(a;b)X.1234(m0) y07. ;(", "g00x0.1234y7;Z5"] {
            assert_eq!(plain(line.as_bytes()).unwrap(), "G0 X0.1234 Y7", "{line}");
        }
        assert_eq!(plain(b"(\xff\x00) G1 ; \xc3").unwrap(), "G1");
        assert_eq!(plain(b"").unwrap(), "");
    }

    #[test]
    fn computed_numbers_are_told_from_written_ones() {
        assert_eq!(plain(b"X[1+2]Y-#5 Z - [2]F sqrt[4]").unwrap(), "X=3 Y=-0 Z=-2 F=2");
        assert_eq!(plain(b"F99999999999").unwrap(), "F=99999999999");
        assert_eq!(plain(b"#1=2#<_A b>=[1]X#1").unwrap(), "Number(1)=2 Name(\"_ab\")=1 X=0");
    }

    #[test]
    fn a_checksum_ends_the_line() {
        assert_eq!(plain(b"N5 G1 X2*71").unwrap(), "N5 G1 X2");
        assert_eq!(plain(b"X2 *7 ; c").unwrap(), "X2");
        assert!(plain(b"X2*7Y1").is_err() && plain(b"X2*").is_err());
    }

    #[test]
    fn faults_have_their_place() {
        for (line, offset, message) in [
            (&b"G1 (a"[..], 3, "comment without its end"),
            (b"G1 (a (b)", 6, "'(' inside a comment"),
            (b"G1 X", 3, "the end of the line after X"),
            (b"G1 Xnan", 3, "'n' after X"),
            (b"G1 X(c)2", 3, "'(' after X"),
            (b"X1.2.3", 0, "found X1.2.3"),
            (b"X1 Y- -5", 3, "found Y--5"),
            (b"X [1", 4, "an operator or ']'"),
            (b"#1 X5", 3, "expected '=' after the parameter"),
            (b"#5420=1", 0, "found #5420"),
            (b"#<_x>=1", 0, "found #<_x>"),
            (b"X#<no>", 1, "found #<no>"),
            (b" /X1", 1, "'/'"),
            (b"X1/2", 2, "'/'"),
            (b"X1 %", 3, "'%' among"),
            (b"X1\xc2\xb5", 2, "the byte 0xc2"),
            (b"X1\rY2", 2, "the byte 0x0d"),
            (b"X1)", 2, "')'"),
        ] {
            let located = plain(line).unwrap_err();
            assert_eq!(located.offset, offset, "{}", String::from_utf8_lossy(line));
            let text = located.problem.to_string();
            assert!(text.contains(message), "{text}");
        }
    }

    #[test]
    fn a_quoted_word_is_short() {
        let line = format!("X{}", "1".repeat(1000));
        let Problem::NumberTooLarge { word } = plain(line.as_bytes()).unwrap_err().problem else {
            panic!("too large")
        };
        assert_eq!(word.chars().count(), 41);
    }

    #[test]
    fn tape_marks_stand_alone() {
        assert!(is_percent_line(b" % "));
        assert!(!is_percent_line(b"%1") && !is_percent_line(b"") && !is_percent_line(b"%%"));
    }
}
