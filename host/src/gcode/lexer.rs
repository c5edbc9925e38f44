//! The bytes of a line to its words.
//!
//! One pass reads no byte more than twice and allocates nothing unless it fails.

use super::decimal::{Decimal, NumberFault};
use super::error::{Located, Problem, describe};

/// A letter and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Word<'a> {
    /// Upper-case letter.
    pub(super) letter: u8,
    /// The number after it.
    pub(super) number: Decimal,
    /// Byte offset of the letter in its line.
    pub(super) offset: usize,
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

/// The words of a line, from left to right; ends after the first error.
pub(super) struct Words<'a> {
    line: &'a [u8],
    next: usize,
}

impl<'a> Words<'a> {
    /// The words of `line`, which is without its line end.
    pub(super) fn new(line: &'a [u8]) -> Self {
        Self { line, next: 0 }
    }

    fn peek(&self) -> Option<u8> {
        self.line.get(self.next).copied()
    }

    fn skip_while(&mut self, skip: impl Fn(u8) -> bool) {
        while self.peek().is_some_and(&skip) {
            self.next += 1;
        }
    }

    /// Steps over a comment; `next` is at its parenthesis.
    fn comment(&mut self) -> Result<(), Located> {
        let opening = self.next;
        self.next += 1;
        self.skip_while(|byte| !matches!(byte, b'(' | b')'));
        match self.peek() {
            Some(b')') => {
                self.next += 1;
                Ok(())
            }
            Some(_) => Err(Located::new(self.next, Problem::CommentNested)),
            None => Err(Located::new(opening, Problem::CommentNotClosed)),
        }
    }

    /// A word; `next` is at its letter.
    fn word(&mut self, letter: u8) -> Result<Word<'a>, Located> {
        let offset = self.next;
        self.next += 1;
        let number_start = self.next;
        self.skip_while(|byte| is_blank(byte) || matches!(byte, b'0'..=b'9' | b'.' | b'+' | b'-'));
        let source = self.line.get(offset..self.next).unwrap_or_default();
        let number = self.line.get(number_start..self.next).unwrap_or_default();
        let letter = letter.to_ascii_uppercase();
        let number = Decimal::parse(number).map_err(|fault| {
            let word = quote(source);
            let problem = match fault {
                NumberFault::Missing => return self.number_missing(offset, letter),
                NumberFault::Malformed => Problem::NumberMalformed { word },
                NumberFault::TooLarge => Problem::NumberTooLarge { word },
                NumberFault::TooManyDecimals => Problem::TooManyDecimals { word },
            };
            Located::new(offset, problem)
        })?;
        Ok(Word { letter, number, offset, source })
    }

    fn number_missing(&self, letter_offset: usize, letter: u8) -> Located {
        match self.peek() {
            Some(found @ (b'#' | b'[')) => {
                Located::new(self.next, Problem::Expression { found: char::from(found) })
            }
            found => {
                let problem = Problem::NumberMissing { letter: char::from(letter), found: describe(found) };
                Located::new(letter_offset, problem)
            }
        }
    }

    /// The problem of a byte that starts no word.
    fn stray(&self, byte: u8) -> Located {
        let first = self.line.iter().take(self.next).all(|&before| is_blank(before));
        let problem = match byte {
            b'/' if first => Problem::BlockDelete,
            b'%' => Problem::PercentInLine,
            b'#' | b'[' | b']' | b'=' | b'<' | b'>' => Problem::Expression { found: char::from(byte) },
            _ => Problem::Character { found: describe(Some(byte)) },
        };
        Located::new(self.next, problem)
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = Result<Word<'a>, Located>;

    fn next(&mut self) -> Option<Self::Item> {
        let result = loop {
            self.skip_while(is_blank);
            match self.peek()? {
                b';' => break None,
                b'(' => {
                    if let Err(located) = self.comment() {
                        break Some(Err(located));
                    }
                }
                letter if letter.is_ascii_alphabetic() => break Some(self.word(letter)),
                byte => break Some(Err(self.stray(byte))),
            }
        };
        if !matches!(result, Some(Ok(_))) {
            self.next = self.line.len();
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of a line written one way: upper case, one blank apart, plain decimals.
    fn plain(line: &[u8]) -> Result<String, Located> {
        let words: Result<Vec<_>, _> = Words::new(line)
            .map(|word| word.map(|word| format!("{}{}", char::from(word.letter), word.number)))
            .collect();
        words.map(|words| words.join(" "))
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
    fn faults_have_their_place() {
        for (line, offset, message) in [
            (&b"G1 (a"[..], 3, "comment without its end"),
            (b"G1 (a (b)", 6, "'(' inside a comment"),
            (b"G1 X", 3, "the end of the line after X"),
            (b"G1 Xnan", 3, "'n' after X"),
            (b"G1 X(c)2", 3, "'(' after X"),
            (b"X1.2.3", 0, "found X1.2.3"),
            (b"X1 Y- -5", 3, "found Y--5"),
            (b"X1 Y0.12345678901", 3, "at most 10 decimals"),
            (b"X1 Y#5", 4, "parameters and expressions"),
            (b"X [1]", 2, "parameters and expressions"),
            (b"#1=5", 0, "parameters and expressions"),
            (b" /X1", 1, "block delete"),
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
