//! The table in the documents is the code's.

use std::path::Path;

use motion_host::simulate::faults;

const FILE: &str = "tests/expected/faults.md";
const DOCUMENT: &str = "host/FAULTS.md";

/// `MOTION_ACCEPT=1` writes both.
#[test]
fn the_documents_have_the_codes_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the project's root");
    let table = faults::table();
    let is_accepted = std::env::var_os("MOTION_ACCEPT").is_some();
    if is_accepted {
        std::fs::write(root.join(FILE), &table).expect("written");
    }
    let committed = std::fs::read_to_string(root.join(FILE)).expect(FILE);
    assert_eq!(committed, table, "MOTION_ACCEPT=1 cargo test -p motion-tests --test faults table");
    let document = std::fs::read_to_string(root.join(DOCUMENT)).expect(DOCUMENT);
    let begin = document.find("| fault |").expect("a table");
    let end = document[begin..].find("\n\n").map_or(document.len(), |end| begin + end + 1);
    if is_accepted {
        let document = [&document[..begin], &table, &document[end..]].concat();
        std::fs::write(root.join(DOCUMENT), document).expect("written");
    } else {
        assert_eq!(document[begin..end], table, "{DOCUMENT} has another table than {FILE}");
    }
}
