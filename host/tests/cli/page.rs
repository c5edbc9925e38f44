//! `motion page`.

use super::workspace::Workspace;

const EMPTY_MODULE: &[u8] = b"\0asm\x01\0\0\0";

#[test]
fn without_a_module_it_says_what_to_run() {
    let workspace = Workspace::new("page-none");
    let refusal = workspace.refusal(&["page", "--module", "none.wasm"]);
    assert!(refusal.starts_with("none.wasm: found No such file"), "{refusal}");
    assert!(
        refusal.ends_with("expected the module of the page; host/wasm/build of the repository builds it"),
        "{refusal}"
    );
    workspace.put("text.wasm", "text");
    let refusal = workspace.refusal(&["page", "--module", "text.wasm"]);
    assert!(refusal.starts_with("text.wasm: found a file of another kind, expected the module"), "{refusal}");
    assert!(!workspace.0.join("motion.html").exists());
}

/// What is read stays.
#[test]
fn the_page_is_no_input() {
    let workspace = Workspace::new("page-inputs");
    std::fs::write(workspace.0.join("m.wasm"), EMPTY_MODULE).expect("a file");
    workspace.put("part.ngc", "M2\n");
    workspace.put("machine.toml", "");
    for (output, input) in [
        ("part.ngc", "PROGRAM part.ngc"),
        ("m.wasm", "--module m.wasm"),
        ("machine.toml", "--machine machine.toml"),
    ] {
        let arguments = ["page", "part.ngc", "--module", "m.wasm", "--machine", "machine.toml", "-o", output];
        let refusal = workspace.refusal(&arguments);
        assert!(refusal.contains(output) && refusal.contains(input), "{refusal}");
    }
    assert_eq!(workspace.read("part.ngc"), "M2\n");
    assert_eq!(
        workspace.refusal(&["page", "none.ngc", "--module", "m.wasm"]),
        "none.ngc: found No such file or directory (os error 2), expected a readable file"
    );
    assert!(!workspace.0.join("motion.html").exists());
}

#[test]
fn the_page_needs_nothing_from_elsewhere() {
    let workspace = Workspace::new("page-alone");
    std::fs::write(workspace.0.join("m.wasm"), EMPTY_MODULE).expect("a file");
    assert_eq!(workspace.stdout(&["page", "--module", "m.wasm"]), "page written to motion.html\n");
    let page = workspace.read("motion.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    assert!(page.contains("import \"page/playground.js\"") && page.contains("id=\"module\""));
    for elsewhere in ["http:", "https:", "src=\"", "{{"] {
        assert!(!page.contains(elsewhere), "{elsewhere}");
    }
}
