//! O-words: labels and what they mark.

use super::error::{Located, Problem, describe};
use super::expression::{self, Environment};
use super::lexer::Cursor;
use super::number;

/// What an O-word does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keyword {
    Sub,
    EndSub,
    Call,
    Return,
    If,
    ElseIf,
    Else,
    EndIf,
    While,
    EndWhile,
    Do,
    Repeat,
    EndRepeat,
    Break,
    Continue,
    /// None: the number of a program, or a subprogram that M98 calls.
    Program,
}

/// In the order they are tried: what begins like another one comes first.
const KEYWORDS: [(&[u8], Keyword); 15] = [
    (b"SUB", Keyword::Sub),
    (b"ENDSUB", Keyword::EndSub),
    (b"CALL", Keyword::Call),
    (b"RETURN", Keyword::Return),
    (b"IF", Keyword::If),
    (b"ELSEIF", Keyword::ElseIf),
    (b"ELSE", Keyword::Else),
    (b"ENDIF", Keyword::EndIf),
    (b"WHILE", Keyword::While),
    (b"ENDWHILE", Keyword::EndWhile),
    (b"DO", Keyword::Do),
    (b"REPEAT", Keyword::Repeat),
    (b"ENDREPEAT", Keyword::EndRepeat),
    (b"BREAK", Keyword::Break),
    (b"CONTINUE", Keyword::Continue),
];

impl Keyword {
    /// As it is written.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Sub => "sub",
            Self::EndSub => "endsub",
            Self::Call => "call",
            Self::Return => "return",
            Self::If => "if",
            Self::ElseIf => "elseif",
            Self::Else => "else",
            Self::EndIf => "endif",
            Self::While => "while",
            Self::EndWhile => "endwhile",
            Self::Do => "do",
            Self::Repeat => "repeat",
            Self::EndRepeat => "endrepeat",
            Self::Break => "break",
            Self::Continue => "continue",
            Self::Program => "",
        }
    }

    /// The word that ends the block it begins; its own, if it begins none.
    pub(super) fn end(self) -> &'static str {
        match self {
            Self::Sub => Self::EndSub.word(),
            Self::If => Self::EndIf.word(),
            Self::While => Self::EndWhile.word(),
            Self::Do => Self::While.word(),
            Self::Repeat => Self::EndRepeat.word(),
            _ => self.word(),
        }
    }
}

/// An O-word and what follows it.
#[derive(Clone, Debug)]
pub(super) struct OWord<'a> {
    /// A number, or a name in lower case.
    pub(super) label: String,
    /// The label is an expression.
    pub(super) is_computed: bool,
    pub(super) keyword: Keyword,
    /// Byte offset of the O.
    pub(super) offset: usize,
    /// What follows the keyword.
    pub(super) rest: Cursor<'a>,
}

/// The place of the O, if the line begins with an O-word; an N word may be before it.
pub(super) fn place(mut cursor: Cursor<'_>) -> Option<Cursor<'_>> {
    if matches!(cursor.peek_text()?, b'n' | b'N') {
        cursor.next += 1;
        cursor.take_while(|byte| matches!(byte, b'0'..=b'9' | b'.' | b' ' | b'\t'));
    }
    matches!(cursor.peek_text()?, b'o' | b'O').then_some(cursor)
}

impl<'a> OWord<'a> {
    /// The O-word at the cursor.
    pub(super) fn read(mut cursor: Cursor<'a>, environment: &dyn Environment) -> Result<Self, Located> {
        let offset = cursor.next;
        cursor.next += 1;
        let (label, is_computed) = match cursor.peek_text() {
            Some(b'<') => (cursor.name()?, false),
            Some(b'#' | b'[') => {
                (number_label(expression::operand(&mut cursor, environment)?, offset)?, true)
            }
            Some(b'0'..=b'9') => {
                let digits = cursor.take_while(|byte| byte.is_ascii_digit());
                let digits = String::from_utf8_lossy(digits);
                let digits = digits.trim_start_matches('0');
                (if digits.is_empty() { "0".to_owned() } else { digits.to_owned() }, false)
            }
            found => {
                let found = describe(found);
                return Err(cursor
                    .located(Problem::Syntax { found, expected: "a number or a name such as <pocket>" }));
            }
        };
        cursor.skip_blanks();
        let keyword =
            KEYWORDS.into_iter().find(|(name, _)| cursor.take_name(name)).map(|(_, keyword)| keyword);
        let keyword = match (keyword, cursor.peek_text()) {
            (Some(keyword), _) => keyword,
            (None, None | Some(b'(' | b';')) => Keyword::Program,
            (None, found) => {
                let expected = "sub, call, if, while, do, repeat or another keyword of O-words";
                return Err(cursor.located(Problem::Syntax { found: describe(found), expected }));
            }
        };
        Ok(Self { label, is_computed, keyword, offset, rest: cursor })
    }

    /// The word with what follows what was read behind its keyword.
    pub(super) fn with(&self, rest: Cursor<'a>) -> Self {
        Self { rest, ..self.clone() }
    }

    /// Refuses what follows the keyword, but for comments.
    pub(super) fn refuse_rest(&self) -> Result<(), Located> {
        let mut rest = self.rest.clone();
        loop {
            match rest.peek_text() {
                None | Some(b';') => return Ok(()),
                Some(b'(') => drop(rest.comment()?),
                found => {
                    let expected = "a comment or the end of the line";
                    return Err(rest.located(Problem::Syntax { found: describe(found), expected }));
                }
            }
        }
    }
}

fn number_label(value: f64, offset: usize) -> Result<String, Located> {
    match number::whole(value) {
        Some(number @ 0..) => Ok(number.to_string()),
        _ => Err(Located::new(offset, Problem::Label { found: value })),
    }
}
