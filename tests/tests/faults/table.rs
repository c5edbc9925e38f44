//! The table in the documents is the code's.

use motion_host::simulate::faults;
use motion_tests::figures::{Table, hold};

#[test]
fn the_documents_have_the_codes_table() {
    hold("faults", &Table::from_markdown(&faults::table()), 0.0).unwrap_or_else(|error| panic!("{error}"));
}
