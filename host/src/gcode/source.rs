//! The text of a file, and places in it.

use std::borrow::Cow;

use super::lexer::Cursor;

/// The start of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Byte offset.
    pub(super) offset: usize,
    /// From 1.
    pub(super) line: u32,
}

impl Default for Place {
    fn default() -> Self {
        Self { offset: 0, line: 1 }
    }
}

/// A file.
#[derive(Debug)]
pub(super) struct Source<'a> {
    pub(super) name: String,
    text: Cow<'a, [u8]>,
}

impl<'a> Source<'a> {
    /// A file without its byte-order mark.
    pub(super) fn new(name: &str, text: Cow<'a, [u8]>) -> Self {
        const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
        let text = match text {
            Cow::Borrowed(text) => Cow::Borrowed(text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text)),
            Cow::Owned(text) => {
                Cow::Owned(text.strip_prefix(BYTE_ORDER_MARK).map(<[u8]>::to_vec).unwrap_or(text))
            }
        };
        Self { name: name.to_owned(), text }
    }

    /// The line at a place, without its end, and the place of the next one.
    pub(super) fn line(&self, place: Place) -> Option<(&[u8], Place)> {
        // An offset beyond the text follows a last line without an end.
        let rest = self.text.get(place.offset..)?;
        let length = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        let line = rest.get(..length)?;
        let after = Place { offset: place.offset + length + 1, line: place.line.saturating_add(1) };
        Some((line.strip_suffix(b"\r").unwrap_or(line), after))
    }

    /// Whether nothing follows a place.
    pub(super) fn is_end(&self, place: Place) -> bool {
        place.offset >= self.text.len()
    }

    /// The start of a line's words; none for a line that is left out.
    pub(super) fn cursor<'line>(&self, line: &'line [u8], block_delete: bool) -> Option<Cursor<'line>> {
        let mut cursor = Cursor::new(line);
        if cursor.peek_text() == Some(b'/') {
            if block_delete {
                return None;
            }
            cursor.next += 1;
        }
        Some(cursor)
    }
}
