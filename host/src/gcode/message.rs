//! Comments that ask for something: messages to the operator, and the end of a program by its own decision.

use super::error::{Located, Problem};
use super::expression::Environment;

/// Above 0, as it is in the beginning, `(DEBUG,…)` shows its text.
pub(super) const DEBUGS: u32 = 5599;

/// What a comment asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Request {
    /// Show the text.
    Message,
    /// Show the text with the values of the parameters in it.
    Values,
    /// The same, unless #5599 says no.
    Debug,
    /// End the program with such a text.
    Abort,
}

fn request(text: &[u8]) -> Option<(Request, &[u8])> {
    let comma = text.iter().position(|&byte| byte == b',')?;
    let (name, rest) = (text.get(..comma)?, text.get(comma + 1..)?);
    let request = match name.trim_ascii().to_ascii_uppercase().as_slice() {
        b"MSG" => Request::Message,
        b"DEBUG" => Request::Debug,
        b"PRINT" => Request::Values,
        b"ABORT" => Request::Abort,
        _ => return None,
    };
    Some((request, rest))
}

/// Whether a comment asks for a file that is written: of probed points, or of a log.
pub(super) fn is_file(text: &[u8]) -> bool {
    let text = text.trim_ascii().to_ascii_uppercase();
    let opens = [&b"PROBEOPEN "[..], b"LOGOPEN,", b"LOGAPPEND,", b"LOG,"];
    matches!(text.as_slice(), b"PROBECLOSE" | b"LOGCLOSE") || opens.iter().any(|word| text.starts_with(word))
}

/// Whether a comment asks for something; its text is without the parentheses.
pub(super) fn is_active(text: &[u8]) -> bool {
    request(text).is_some()
}

/// The text a comment shows, if it shows one.
///
/// # Errors
/// It ends the program.
pub(super) fn shown(text: &[u8], environment: &dyn Environment) -> Result<Option<String>, Located> {
    let Some((request, rest)) = request(text) else { return Ok(None) };
    let text = String::from_utf8_lossy(rest);
    match request {
        Request::Message => Ok(Some(text.trim().to_owned())),
        Request::Debug if environment.numbered(DEBUGS) <= 0.0 => Ok(None),
        Request::Debug | Request::Values => Ok(Some(with_values(text.trim(), environment))),
        Request::Abort => {
            Err(Located::new(0, Problem::Aborted { text: with_values(text.trim(), environment) }))
        }
    }
}

/// `text` with its parameters replaced by their values. `%d`, `%f` and `%.3f` say with how many decimals the
/// parameters after them are shown: none, four, as many as given; six before that.
fn with_values(text: &str, environment: &dyn Environment) -> String {
    let mut decimals = 6;
    let mut shown = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        if let Some((count, after)) = format_of(rest) {
            decimals = count;
            rest = after;
        } else if let Some((value, after)) = parameter_of(rest, environment) {
            match value {
                Some(value) => shown += &format!("{value:.decimals$}"),
                None => shown += "######",
            }
            rest = after;
        } else {
            shown.push(first);
            rest = rest.get(first.len_utf8()..).unwrap_or_default();
        }
    }
    shown
}

fn format_of(text: &str) -> Option<(usize, &str)> {
    let after = text.strip_prefix('%')?;
    if let Some(after) = after.strip_prefix('d') {
        return Some((0, after));
    }
    if let Some(after) = after.strip_prefix('f') {
        return Some((4, after));
    }
    let after = after.strip_prefix('.')?;
    let digit = after.chars().next()?.to_digit(10)?;
    Some((digit as usize, after.get(1..)?.strip_prefix('f')?))
}

/// The value of the parameter that `text` begins with; none if it has none.
fn parameter_of<'a>(text: &'a str, environment: &dyn Environment) -> Option<(Option<f64>, &'a str)> {
    let after = text.strip_prefix('#')?;
    if let Some(name) = after.strip_prefix('<') {
        let (name, after) = name.split_at_checked(name.find(['>', '<', '#'])?)?;
        let after = after.strip_prefix('>')?;
        let name: String =
            name.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_lowercase()).collect();
        return Some((environment.named(&name), after));
    }
    let end = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
    let (digits, after) = after.split_at_checked(end)?;
    let number = digits.parse().ok()?;
    let is_known = (1..=super::parameters::PARAMETER_MAX).contains(&number);
    Some((is_known.then(|| environment.numbered(number)), after))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Values;

    impl Environment for Values {
        fn numbered(&self, number: u32) -> f64 {
            f64::from(number) + 0.25
        }

        fn named(&self, name: &str) -> Option<f64> {
            (name == "depth").then_some(-1.5)
        }
    }

    #[test]
    fn files_are_told_from_comments() {
        for text in ["PROBEOPEN points.txt", " probeclose", "LOGOPEN,a", "logappend,a", "LOG,#1", "LOGCLOSE"]
        {
            assert!(is_file(text.as_bytes()), "{text}");
        }
        for text in ["PROBEOPENING", "log the position", "LOGCLOSE it", "a PROBECLOSE"] {
            assert!(!is_file(text.as_bytes()), "{text}");
        }
    }

    #[test]
    fn messages_are_told_from_comments() {
        let shown = |text: &str| shown(text.as_bytes(), &Values).unwrap();
        assert_eq!(shown("a, b"), None);
        assert_eq!(shown("MSG"), None);
        assert_eq!(shown("Msg, turn it #1"), Some("turn it #1".to_owned()));
        assert_eq!(
            shown(" debug ,#1 %d#1 %f#<De pth> %.2f#3, 5%"),
            Some("1.250000 1 -1.5000 3.25, 5%".to_owned())
        );
        assert_eq!(shown("print,#<no> #0 # #<x"), Some("###### ###### # #<x".to_owned()));
        let aborted = super::shown(b"ABORT, no stock at %d#3", &Values).unwrap_err();
        assert!(aborted.problem.to_string().contains("no stock at 3"));
    }
}
