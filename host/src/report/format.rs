//! Numbers and text as people read them.
//!
//! Everything that reaches the page goes through here: text is escaped, figures are rounded to the digits
//! that carry meaning, and thousands are set apart by a narrow space.

/// Narrow no-break space: sets thousands apart without inviting a comma to be read as a decimal point.
const GROUP: char = '\u{202f}';

/// Text as it may stand in HTML or SVG, in an element or in a quoted attribute.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // XML and HTML both forbid most control characters, even escaped.
            c if c.is_control() && c != '\n' && c != '\t' => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// `value` to `digits` significant digits, without trailing zeros: `83.33`, `0.005`, `400 000`, `1.2·10⁻⁶`.
pub(super) fn figure(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "not finite".to_string();
    }
    if value.abs() < f64::MIN_POSITIVE {
        return "0".to_string();
    }
    let magnitude = libm::log10(value.abs()).floor() as i32;
    if !(-4..9).contains(&magnitude) {
        let mantissa = trimmed(value / 10f64.powi(magnitude), digits - 1);
        return format!("{mantissa}·10{}", superscript(magnitude));
    }
    trimmed(value, digits - 1 - magnitude)
}

/// `value` with a fixed number of decimals, so that the numbers of a column line up; a dash if it is not
/// finite.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".to_string();
    }
    let text = format!("{value:.decimals$}");
    let negative = text.starts_with('-') && text.contains(|c: char| c.is_ascii_digit() && c != '0');
    let digits = grouped(text.trim_start_matches('-'));
    if negative { format!("−{digits}") } else { digits }
}

/// `value` to the resolution a scale that spans `span` can show. Used for the numbers along an axis.
pub(super) fn scale_mark(value: f64, span: f64) -> String {
    let decimals = if span > 0.0 { 3 - libm::log10(span).floor() as i32 } else { 0 };
    trimmed(value, decimals)
}

/// A count with its thousands set apart.
pub(super) fn count(value: u64) -> String {
    grouped(&value.to_string())
}

/// `one` for a single thing, `many` for any other number of them: "1 block", "12 blocks".
pub(super) fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{} {}", count(number as u64), if number == 1 { one } else { many })
}

/// `value` as a part of `limit`, in percent; `None` if there is no limit. Never rounds an excess away that a
/// reader should see.
pub(super) fn share(value: f64, limit: f64) -> Option<String> {
    let percent = 100.0 * value / limit;
    if !(limit > 0.0 && percent.is_finite()) {
        return None;
    }
    let text = match percent {
        p if p < 10.0 => figure(p, 2),
        // An excess below this is single precision's, not the motion's.
        p if p <= 100.05 => trimmed(p, 0),
        p => figure(p, 4),
    };
    Some(format!("{text} %"))
}

/// A duration: milliseconds below a second, minutes and hours from two minutes on.
pub(super) fn duration(time_s: f64) -> String {
    if !time_s.is_finite() || time_s < 0.0 {
        return "not known".to_string();
    }
    if time_s < 1.0 {
        return format!("{} ms", figure(time_s * 1e3, 4));
    }
    if time_s < 120.0 {
        return format!("{time_s:.3} s");
    }
    let seconds = time_s.round() as u64;
    let (hours, minutes, rest) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if hours > 0 {
        format!("{hours} h {minutes:02} min {rest:02} s")
    } else {
        format!("{minutes} min {rest:02} s")
    }
}

/// `value` rounded to `decimals` (negative: to tens, hundreds, …), trailing zeros removed, thousands grouped.
fn trimmed(value: f64, decimals: i32) -> String {
    let text = if decimals > 0 {
        let text = format!("{value:.*}", decimals.min(12) as usize);
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        let unit = 10f64.powi(-decimals);
        format!("{:.0}", (value / unit).round() * unit)
    };
    // Rounding can leave a zero with a sign.
    if text == "-0" { "0".to_string() } else { grouped(&text.replace('-', "−")) }
}

/// Groups the digits before the decimal point by three.
fn grouped(text: &str) -> String {
    let (whole, fraction) = text.split_once('.').map_or((text, None), |(w, f)| (w, Some(f)));
    let digits = whole.chars().filter(char::is_ascii_digit).count();
    let mut left = digits;
    let mut out = String::with_capacity(text.len() + 6);
    for c in whole.chars() {
        // Four digits read well without a gap (1500), five do not.
        if c.is_ascii_digit() {
            if digits > 4 && left < digits && left % 3 == 0 {
                out.push(GROUP);
            }
            left -= 1;
        }
        out.push(c);
    }
    if let Some(fraction) = fraction {
        out.push('.');
        out.push_str(fraction);
    }
    out
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '0' => '⁰',
            c => char::from_u32('⁰' as u32 + c.to_digit(10).unwrap_or(0)).unwrap_or(c),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_text_is_escaped() {
        assert_eq!(escape("<b a='1'>&\"</b>"), "&lt;b a=&#39;1&#39;&gt;&amp;&quot;&lt;/b&gt;");
        assert_eq!(escape("a\u{0}b"), "a\u{fffd}b");
    }

    #[test]
    fn figures_keep_the_digits_that_matter() {
        assert_eq!(figure(83.333_333, 4), "83.33");
        assert_eq!(figure(0.005, 4), "0.005");
        assert_eq!(figure(399_950.0, 4), "400\u{202f}000");
        assert_eq!(figure(-1500.0, 4), "−1500");
        assert_eq!(figure(0.0, 4), "0");
        assert_eq!(figure(1.234e-7, 3), "1.23·10⁻⁷");
        assert_eq!(figure(f64::NAN, 4), "not finite");
    }

    #[test]
    fn columns_line_up() {
        assert_eq!(fixed(50.0, 3), "50.000");
        assert_eq!(fixed(-1e-9, 3), "0.000");
        assert_eq!(fixed(-12_345.678, 1), "−12\u{202f}345.7");
        assert_eq!(fixed(f64::INFINITY, 2), "–");
    }

    #[test]
    fn scale_marks_share_the_resolution_of_their_scale() {
        assert_eq!(scale_mark(0.30000000000000004, 1.0), "0.3");
        assert_eq!(scale_mark(-1e-17, 1.0), "0");
        assert_eq!(scale_mark(20_000.0, 1e5), "20\u{202f}000");
    }

    #[test]
    fn shares_show_an_excess_and_need_a_limit() {
        let of = |value, limit| share(value, limit).unwrap_or_default();
        assert_eq!([of(456.4, 500.0), of(5000.1, 5000.0), of(502.0, 500.0)], ["91 %", "100 %", "100.4 %"]);
        assert_eq!([of(0.59, 100.0), of(1.0, 0.0), of(f64::NAN, 1.0)], ["0.59 %", "", ""]);
    }

    #[test]
    fn durations_change_unit_with_their_size() {
        assert_eq!(duration(0.0125), "12.5 ms");
        assert_eq!(duration(2.097_975), "2.098 s");
        assert_eq!(duration(754.2), "12 min 34 s");
        assert_eq!(duration(3723.0), "1 h 02 min 03 s");
    }
}
