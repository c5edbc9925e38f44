//! CSV of numbers, as instruments and boards write it.

use super::recorded::RecordedError;

/// The rows under `heading`, each with its line, from 1; empty lines and those that begin with # are left out.
///
/// # Errors
/// The text is not UTF-8, has another heading, or a row is not as many finite numbers: then `expected_row` is said.
pub(super) fn read<const N: usize>(
    name: &str,
    bytes: &[u8],
    heading: [&str; N],
    [expected_file, expected_heading, expected_row]: [&'static str; 3],
) -> Result<Vec<(usize, [f64; N])>, RecordedError> {
    let fail = |line: usize, found: String, expected: &'static str| RecordedError::Line {
        name: name.to_owned(),
        line,
        found,
        expected,
    };
    let text = core::str::from_utf8(bytes).map_err(|error| {
        let line = bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count() + 1;
        fail(line, "a byte that is not UTF-8".to_owned(), expected_file)
    })?;
    let rows = text.trim_start_matches('\u{feff}').lines().enumerate();
    let mut rows = rows
        .map(|(index, row)| (index + 1, row.trim()))
        .filter(|(_, row)| !row.is_empty() && !row.starts_with('#'));
    let (line, first) = rows.next().unwrap_or((1, ""));
    if !first.split(',').map(str::trim).eq(heading) {
        return Err(fail(line, format!("'{first}'"), expected_heading));
    }
    rows.map(|(line, row)| {
        let fields =
            row.split(',').map(|field| field.trim().parse().ok().filter(|number: &f64| number.is_finite()));
        let numbers: Option<Vec<f64>> = fields.collect();
        let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
        numbers.map(|numbers| (line, numbers)).ok_or_else(|| fail(line, format!("'{row}'"), expected_row))
    })
    .collect()
}
