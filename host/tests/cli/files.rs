//! No file is ever lost: not by the same path twice, not by links, not by what fails or is interrupted.

use std::fs;

use super::workspace::{STRINGER, Workspace};

/// What was there before.
const KEPT: &str = "kept";

/// A folder with a program, a machine and a file to be replaced.
fn folder(name: &str) -> Workspace {
    let workspace = Workspace::new(name);
    workspace.put("part.ngc", STRINGER);
    workspace.put("machine.toml", motion_host::machine::REFERENCE_TOML);
    workspace.put("kept.html", KEPT);
    workspace
}

/// The names in the folder.
fn names(workspace: &Workspace) -> Vec<String> {
    let entries = fs::read_dir(&workspace.0).expect("a folder");
    let name = |entry: fs::DirEntry| entry.file_name().into_string().expect("UTF-8");
    let mut names: Vec<String> = entries.map(|entry| name(entry.expect("an entry"))).collect();
    names.sort_unstable();
    names
}

const THREE: [&str; 3] = ["kept.html", "machine.toml", "part.ngc"];

/// Standard input is read once.
#[test]
fn one_input_is_standard_input() {
    let workspace = folder("standard-input");
    assert_eq!(
        workspace.refusal(&["run", "-", "--report", "new.html", "--against", "-"]),
        "--against -: found standard input, which is PROGRAM already, expected a readable file"
    );
    assert!(!workspace.0.join("new.html").exists());
}

#[test]
fn an_output_is_no_input() {
    let workspace = folder("same-input");
    workspace.stdout(&["run", "part.ngc", "--record", "part.mrec"]);
    workspace.put("points.csv", "x_mm,y_mm,z_mm\n");
    workspace.put("board.log", "");
    let before: Vec<_> =
        names(&workspace).iter().map(|name| fs::read(workspace.0.join(name))).map(Result::ok).collect();
    for (arguments, input, option) in [
        (&["compile", "part.ngc", "-o", "part.ngc"][..], "PROGRAM part.ngc", "--output part.ngc"),
        (
            &["compile", "part.ngc", "--machine", "machine.toml", "-o", "machine.toml"],
            "--machine machine.toml",
            "--output machine.toml",
        ),
        (&["run", "part.ngc", "--report", "part.ngc"], "PROGRAM part.ngc", "--report part.ngc"),
        (&["run", "part.ngc", "--report", "./part.ngc"], "PROGRAM part.ngc", "--report ./part.ngc"),
        (
            &["run", "part.ngc", "--report", "part.mrec", "--against", "part.mrec"],
            "--against part.mrec",
            "--report part.mrec",
        ),
        (
            &["run", "part.ngc", "--record", "../cli-same-input/part.ngc"],
            "PROGRAM part.ngc",
            "--record ../cli-same-input/part.ngc",
        ),
        (
            &["run", "part.ngc", "--machine", "machine.toml", "--trace", "machine.toml"],
            "--machine machine.toml",
            "--trace machine.toml",
        ),
        (&["replay", "part.mrec", "--report", "part.mrec"], "FILE part.mrec", "--report part.mrec"),
        (&["replay", "part.mrec", "--trace", "part.mrec"], "FILE part.mrec", "--trace part.mrec"),
        (&["flight", "board.log", "--trace", "board.log"], "LOG board.log", "--trace board.log"),
        (&["spline", "points.csv", "--report", "points.csv"], "POINTS.csv points.csv", "--report points.csv"),
        (
            &["jog", "X+1", "--machine", "machine.toml", "--trace", "machine.toml"],
            "--machine machine.toml",
            "--trace machine.toml",
        ),
        (
            &["home", "--machine", "machine.toml", "--trace", "machine.toml"],
            "--machine machine.toml",
            "--trace machine.toml",
        ),
        (
            &["drive", "step", "--machine", "machine.toml", "--report", "machine.toml"],
            "--machine machine.toml",
            "--report machine.toml",
        ),
        (
            &["drive", "tune", "--machine", "machine.toml", "--report", "machine.toml"],
            "--machine machine.toml",
            "--report machine.toml",
        ),
    ] {
        let expected = format!("{option}: found the same file as {input}, expected another one");
        assert_eq!(workspace.refusal(arguments), expected, "{arguments:?}");
    }
    let after: Vec<_> =
        names(&workspace).iter().map(|name| fs::read(workspace.0.join(name))).map(Result::ok).collect();
    assert!(before == after, "a file has changed");
}

#[test]
fn an_output_is_no_other_output() {
    let workspace = folder("same-output");
    fs::create_dir(workspace.0.join("sub")).expect("a folder");
    for (arguments, expected) in [
        (
            &["run", "part.ngc", "--trace", "new", "--report", "sub/../new"][..],
            "--report sub/../new: found the same file as --trace new, expected another one",
        ),
        (
            &["run", "part.ngc", "--report", "kept.html", "--record", "./kept.html"],
            "--record ./kept.html: found the same file as --report kept.html, expected another one",
        ),
        (
            &["spline", "--trace", "new", "--report", "new"],
            "--report new: found the same file as --trace new, expected another one",
        ),
        (
            &["drive", "tune", "--output", "new", "--learn", "1", "--learn-output", "./new"],
            "--learn-output ./new: found the same file as --output new, expected another one",
        ),
    ] {
        assert_eq!(workspace.refusal(arguments), expected);
    }
    fs::remove_dir(workspace.0.join("sub")).expect("empty");
    assert_eq!(names(&workspace), THREE);
    assert_eq!(workspace.read("kept.html"), KEPT);
}

#[test]
fn folders_and_read_only_files_are_found_before_the_work() {
    let workspace = folder("places");
    let run = |path: &str| workspace.refusal(&["run", "part.ngc", "--report", path]);
    assert_eq!(run("no/such/place"), "no/such/place: found no folder no/such, expected one that exists");
    assert_eq!(run("new/"), "new/: found a folder, expected a file");
    assert_eq!(run("."), ".: found a folder, expected a file");
    let set_readonly = |is_readonly: bool| {
        let path = workspace.0.join("kept.html");
        let mut permissions = fs::metadata(&path).expect("a file").permissions();
        permissions.set_readonly(is_readonly);
        fs::set_permissions(path, permissions).expect("ours");
    };
    set_readonly(true);
    assert_eq!(run("kept.html"), "kept.html: found a read-only file, expected one that may be replaced");
    assert_eq!(
        (workspace.read("kept.html").as_str(), names(&workspace)),
        (KEPT, THREE.map(str::to_owned).to_vec())
    );
}

/// Refused after the files were opened: nothing is left of them.
#[test]
fn a_late_refusal_leaves_what_was_there() {
    let workspace = folder("late");
    workspace.put("wrong.ngc", "G1 X10 F3000\nG1 X2O\nM2\n");
    for arguments in [
        &["run", "wrong.ngc", "--report", "kept.html", "--trace", "new.csv", "--record", "new.mrec"][..],
        &["run", "part.ngc", "--inject", "1:overload=Q:1", "--report", "kept.html", "--trace", "new.csv"],
        &["compile", "wrong.ngc", "--output", "kept.html"],
        &["replay", "part.ngc", "--report", "kept.html"],
        &["flight", "part.ngc", "--report", "kept.html"],
        &["jog", "Q+1", "--trace", "kept.html"],
        &["drive", "step", "--axis", "Q", "--report", "kept.html"],
        &["drive", "tune", "--axis", "Q", "--output", "kept.html"],
    ] {
        workspace.refusal(arguments);
        assert_eq!(
            (workspace.read("kept.html").as_str(), names(&workspace).len()),
            (KEPT, 4),
            "{arguments:?}"
        );
    }
    workspace.stdout(&["run", "part.ngc", "--report", "kept.html"]);
    assert!(workspace.read("kept.html").ends_with("</html>\n"));
}

#[cfg(unix)]
mod unix {
    use std::fs::{self, File};
    use std::io::{BufRead, BufReader, Read};
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
    use std::path::Path;
    use std::process::{Child, Command, Output, Stdio};

    use super::{KEPT, STRINGER, THREE, Workspace, folder, names};

    /// Sends a signal by the shell, which has `kill` itself.
    fn send(signal: &str, id: u32) -> std::io::Result<std::process::ExitStatus> {
        Command::new("sh").args(["-c", "kill -s \"$0\" \"$1\"", signal, &id.to_string()]).status()
    }

    /// `motion` with its standard streams in pipes.
    fn spawn(workspace: &Workspace, arguments: &[&str]) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motion"));
        command.args(arguments).current_dir(&workspace.0).stdin(Stdio::piped());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("motion starts")
    }

    /// What a shell makes of `script`, with `motion` as `$0`.
    fn shell(workspace: &Workspace, script: &str) -> Output {
        let mut command = Command::new("sh");
        command.args(["-c", script, env!("CARGO_BIN_EXE_motion")]).current_dir(&workspace.0);
        command.output().expect("a shell")
    }

    fn text(bytes: &[u8]) -> String {
        String::from_utf8(bytes.to_vec()).expect("UTF-8")
    }

    fn make_pipe(workspace: &Workspace, name: &str) {
        let made = Command::new("mkfifo").arg(workspace.0.join(name)).status().expect("mkfifo");
        assert!(made.success());
    }

    #[test]
    fn links_lead_to_the_same_file() {
        let workspace = folder("links");
        let path = |name: &str| workspace.0.join(name);
        symlink("part.ngc", path("soft.ngc")).expect("a link");
        symlink("soft.ngc", path("softer.ngc")).expect("a link");
        fs::hard_link(path("part.ngc"), path("hard.ngc")).expect("a link");
        symlink(".", path("here")).expect("a link");
        // To what does not exist yet.
        symlink("new.html", path("ahead.html")).expect("a link");
        for (report, other) in [
            ("soft.ngc", "PROGRAM part.ngc"),
            ("softer.ngc", "PROGRAM part.ngc"),
            ("hard.ngc", "PROGRAM part.ngc"),
            ("here/part.ngc", "PROGRAM part.ngc"),
            ("here/new.html", "--trace new.html"),
            ("ahead.html", "--trace new.html"),
        ] {
            let refusal = workspace.refusal(&["run", "part.ngc", "--trace", "new.html", "--report", report]);
            let expected = format!("--report {report}: found the same file as {other}, expected another one");
            assert_eq!(refusal, expected);
        }
        assert_eq!(workspace.read("part.ngc"), STRINGER);
        assert!(!path("new.html").exists());

        // A link is written through, be it to a file that exists or not.
        symlink("kept.html", path("link.html")).expect("a link");
        workspace.stdout(&["run", "part.ngc", "--report", "link.html"]);
        workspace.stdout(&["run", "part.ngc", "--report", "ahead.html"]);
        for (link, file) in [("link.html", "kept.html"), ("ahead.html", "new.html")] {
            assert!(fs::symlink_metadata(path(link)).expect("a link").is_symlink(), "{link}");
            assert!(workspace.read(file).ends_with("</html>\n"), "{file}");
        }
    }

    #[test]
    fn a_replaced_file_keeps_its_permissions_and_a_new_one_has_the_usual() {
        let workspace = folder("permissions");
        let path = |name: &str| workspace.0.join(name);
        fs::set_permissions(path("kept.html"), PermissionsExt::from_mode(0o640)).expect("ours");
        let script = "umask 027; \"$0\" run part.ngc --report kept.html --trace new.csv";
        assert_eq!(shell(&workspace, script).status.code(), Some(0));
        let mode = |name: &str| fs::metadata(path(name)).expect("a file").mode() & 0o777;
        assert_eq!((mode("kept.html"), mode("new.csv")), (0o640, 0o640));
        fs::set_permissions(path("kept.html"), PermissionsExt::from_mode(0o604)).expect("ours");
        assert_eq!(shell(&workspace, script).status.code(), Some(0));
        assert_eq!(mode("kept.html"), 0o604);
    }

    /// Where no file can be made, it is found before the work.
    #[test]
    fn a_read_only_folder_is_found_before_the_work() {
        let workspace = folder("read-only");
        let closed = workspace.0.join("closed");
        fs::create_dir(&closed).expect("a folder");
        fs::set_permissions(&closed, PermissionsExt::from_mode(0o555)).expect("ours");
        // Who may write everywhere may not make files in /proc.
        let place =
            if File::create(closed.join("probe")).is_ok() { "/proc/new.html" } else { "closed/new.html" };
        let refusal = workspace.refusal(&["run", "part.ngc", "--report", place]);
        assert!(refusal.starts_with(&format!("{place}: found ")), "{refusal}");
        assert!(refusal.ends_with("expected a file that can be written"), "{refusal}");
        fs::set_permissions(&closed, PermissionsExt::from_mode(0o755)).expect("ours");
    }

    /// Whoever redirects the summary to the report's file would lose one of them.
    #[test]
    fn standard_streams_are_files_too() {
        let workspace = folder("streams");
        let ended = shell(&workspace, "\"$0\" run part.ngc --trace out.csv > out.csv");
        let expected =
            "motion: --trace out.csv: found the same file as standard output, expected another one\n";
        assert_eq!((ended.status.code(), text(&ended.stderr).as_str()), (Some(2), expected));
        let ended = shell(&workspace, "\"$0\" run - --report part.ngc < part.ngc");
        let expected =
            "motion: --report part.ngc: found the same file as standard input, expected another one\n";
        assert_eq!((ended.status.code(), text(&ended.stderr).as_str()), (Some(2), expected));
        assert_eq!(workspace.read("part.ngc"), STRINGER);
        // No files, so none that could be lost.
        let ended =
            shell(&workspace, "\"$0\" run part.ngc --trace /dev/null --report /dev/null > out.csv 2>&1");
        assert_eq!(ended.status.code(), Some(0));
        let ended = shell(&workspace, "\"$0\" run part.ngc --trace /dev/stdout | head -n 1");
        assert!(text(&ended.stdout).starts_with("tick,t_s,"), "{ended:?}");
    }

    /// A disk that is full, as a limit on the size of files and as a device: the summary is printed, the file
    /// stays.
    #[test]
    fn a_full_disk_swallows_no_result() {
        let workspace = folder("full");
        let limited = "trap '' XFSZ; ulimit -f 8; \"$0\" run part.ngc --report kept.html --trace new.csv";
        let ended = shell(&workspace, limited);
        let (said, error) = (text(&ended.stdout), text(&ended.stderr));
        assert_eq!(ended.status.code(), Some(6), "{error}");
        assert!(said.contains("following error max") && !said.contains("written to"), "{said}");
        for (line, name) in error.lines().zip(["new.csv", "kept.html"]) {
            assert!(line.starts_with(&format!("motion: {name}: found ")), "{error}");
            assert!(line.ends_with("expected to write the whole file; it stays as it was"), "{error}");
        }
        assert_eq!((error.lines().count(), names(&workspace)), (2, THREE.map(str::to_owned).to_vec()));
        assert_eq!(workspace.read("kept.html"), KEPT);
        if Path::new("/dev/full").exists() {
            let run = ["run", "part.ngc", "--trace", "/dev/full", "--report", "new.html"];
            let (said, error) = workspace.ending(6, &run);
            assert!(said.contains("report written to new.html"), "{said}");
            assert!(error.starts_with("motion: /dev/full: found "), "{error}");
        }
    }

    /// In the middle of a run: its trace goes to a pipe that nobody reads any more.
    #[test]
    fn ctrl_c_leaves_what_was_there() {
        let workspace = folder("interrupted");
        for (signal, status) in [("INT", 130), ("TERM", 143)] {
            make_pipe(&workspace, "pipe");
            let run = ["run", "part.ngc", "--trace", "pipe", "--report", "kept.html", "--record", "new.mrec"];
            let child = spawn(&workspace, &run);
            // Both open it at once; then the run fills the pipe and waits.
            let mut rows = BufReader::new(File::open(workspace.0.join("pipe")).expect("a pipe"));
            let mut row = String::new();
            for _ in 0..100 {
                row.clear();
                rows.read_line(&mut row).expect("a row");
            }
            assert!(row.starts_with("98,"), "{row}");
            // The temporary files of report and recording.
            assert_eq!(names(&workspace).len(), 6, "{:?}", names(&workspace));
            let sent = send(signal, child.id());
            assert!(sent.expect("kill").success());
            let ended = child.wait_with_output().expect("motion ends");
            rows.read_to_string(&mut row).expect("the rest");
            let expected = "motion: interrupted: kept.html, new.mrec stay as they were\n";
            assert_eq!((ended.status.code(), text(&ended.stderr).as_str()), (Some(status), expected));
            assert_eq!(text(&ended.stdout), "");
            fs::remove_file(workspace.0.join("pipe")).expect("ours");
            assert_eq!(
                (workspace.read("kept.html").as_str(), names(&workspace)),
                (KEPT, THREE.map(str::to_owned).to_vec())
            );
        }
    }

    /// Before the run, while a program is typed.
    #[test]
    fn ctrl_c_while_the_program_comes() {
        let workspace = folder("interrupted-early");
        make_pipe(&workspace, "pipe");
        let mut child = spawn(&workspace, &["run", "-", "--report", "kept.html", "--trace", "pipe"]);
        // By now the signals are watched.
        let rows = File::open(workspace.0.join("pipe")).expect("a pipe");
        let sent = send("INT", child.id());
        assert!(sent.expect("kill").success());
        let input = child.stdin.take();
        let ended = child.wait_with_output().expect("motion ends");
        drop((input, rows));
        assert_eq!(ended.status.code(), Some(130), "{}", text(&ended.stderr));
        assert_eq!(workspace.read("kept.html"), KEPT);
        assert_eq!(names(&workspace).len(), 4);
    }
}
