//! What is asked for and how it is shown: moments of commands and traces, columns, units, lists by purpose.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::process::Stdio;

use super::workspace::{STRINGER, Workspace, number};

/// Two lines of 30 mm, as lines 2 and 3.
const CORNER: &str = "G21 G90 G61 F3000\nG1 X30\nG1 Y30\nM2\n";

/// What is said of a wrong argument.
fn wrong(workspace: &Workspace, arguments: &[&str]) -> String {
    let output = workspace.motion(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

/// A panel that others could reach needs a token; a board that is not there is named.
#[test]
fn a_panel_is_for_this_computer_unless_there_is_a_token() {
    let workspace = Workspace::new("panel");
    let refusal = wrong(&workspace, &["panel", "--listen", "0.0.0.0:0"]);
    assert!(refusal.contains("found --listen 0.0.0.0:0 without --token"), "{refusal}");
    let refusal = wrong(&workspace, &["panel", "--listen", "0.0.0.0:0", "--token", "a&bcdefghijklmn"]);
    assert!(
        refusal.contains("found `a&bcdefghijklmn`, expected at least 12 letters and digits"),
        "{refusal}"
    );
    let refusal = wrong(&workspace, &["panel", "--token", "short"]);
    assert!(refusal.contains("expected at least 12 letters and digits"), "{refusal}");
    let refusal = wrong(&workspace, &["panel", "--listen", "nowhere"]);
    assert!(refusal.contains("--listen nowhere: found"), "{refusal}");
    let output = workspace.motion(&["panel", "--listen", "127.0.0.1:0", "--port", "tcp:127.0.0.1:1"]);
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("tcp:127.0.0.1:1: found"), "{told}");
}

/// What is served to whom, by the headers that a browser sends.
#[test]
fn a_panel_is_served_to_this_computer_alone() {
    let workspace = Workspace::new("panel-served");
    let mut panel = workspace
        .command(&["panel", "--listen", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("motion starts");
    let mut line = String::new();
    BufReader::new(panel.stdout.take().expect("its output")).read_line(&mut line).expect("text");
    let host = line.trim().rsplit_once("http://").expect(&line).1.trim_end_matches('/').to_owned();
    let status = |path: &str, headers: &str| {
        let mut wire = TcpStream::connect(&host).expect("there");
        write!(wire, "GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n").expect("sent");
        let mut answer = String::new();
        BufReader::new(wire).read_line(&mut answer).expect("an answer");
        answer.split(' ').nth(1).expect("a status").to_owned()
    };
    let upgrade =
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n";
    let host_of = |name: &str| format!("Host: {name}\r\n");
    assert_eq!(status("/", &host_of(&host)), "200");
    assert_eq!(status("/picture/1/data", &host_of(&host)), "404");
    for path in ["/", "/picture/1/data", "/socket"] {
        assert_eq!(status(path, &host_of("evil.example")), "403", "{path}");
    }
    let foreign = format!("{}Origin: http://evil.example\r\n{upgrade}", host_of(&host));
    assert_eq!(status("/socket", &foreign), "403");
    // A socket that no page has opened.
    assert_eq!(status("/socket", &format!("{}{upgrade}", host_of(&host))), "403");
    let _ = panel.kill();
    let _ = panel.wait();
}

/// A moment is a tick, a time, or a program line.
#[test]
fn commands_are_given_at_ticks_times_and_lines() {
    let workspace = Workspace::new("moments");
    workspace.put("part.ngc", CORNER);
    let run = |at: &str| workspace.json(&["run", "part.ngc", "--json", "--at", at]);
    let by_tick = run("600:hold,1600:resume");
    let by_time = run("0.3s:hold,0.8s:resume");
    assert_eq!(by_tick["ticks"], by_time["ticks"]);
    assert_eq!(by_tick["commands"][0]["s_mm"], by_time["commands"][0]["s_mm"]);
    assert_eq!(number(&by_time["commands"][0]["tick"]) as u64, 600);
    // In the first ticks of the second line, whenever that is.
    let (held, _) = workspace.ending(3, &["run", "part.ngc", "--json", "--at", "0.1s:override=0.5,N3:hold"]);
    let held: serde_json::Value = serde_json::from_str(&held).expect("JSON");
    let at_mm = number(&held["commands"][1]["s_mm"]);
    assert!((29.999..30.1).contains(&at_mm), "{at_mm}");
    // At rest in the corner, behind line 2.
    assert_eq!(held["reached_line"].as_u64(), Some(2));
    // Behind a stop, and at a dwell, in a program with N words of other numbers.
    workspace.put(
        "stops.ngc",
        "N10 G21 G90 G61.1 F3000\nN20 G1 X10\n(a remark)\nN30 G4 P0.1\nN40 G1 Y10\nN50 M2\n",
    );
    for at in ["N3:hold", "N4:hold", "N5:hold"] {
        let (held, _) = workspace.ending(3, &["run", "stops.ngc", "--json", "--at", at]);
        let held: serde_json::Value = serde_json::from_str(&held).expect("JSON");
        let at_mm = number(&held["commands"][0]["s_mm"]);
        assert!((at_mm - 10.0).abs() < 0.1, "{at}: {at_mm}");
    }
    // A line without motion is never reached, and named as it was given.
    let output = workspace.motion(&["run", "part.ngc", "--json", "--at", "N9:hold"]);
    assert_eq!(output.status.code(), Some(5));
    assert!(String::from_utf8_lossy(&output.stderr).contains("N9:hold"));
    let refusal = wrong(&workspace, &["run", "part.ngc", "--at", "soon:hold"]);
    assert!(refusal.contains("found `soon:hold`, expected WHEN:COMMAND"), "{refusal}");
}

/// Columns and rows of a trace are chosen, and it may go to standard output.
#[test]
fn a_trace_has_the_columns_and_rows_that_are_asked_for() {
    let workspace = Workspace::new("columns");
    workspace.put("part.ngc", CORNER);
    let all = {
        workspace.stdout(&["run", "part.ngc", "--trace", "all.csv"]);
        workspace.read("all.csv")
    };
    let chosen = ["--columns", "line,tick,Y_set_mm", "--from", "N3", "--to", "0.9s", "--every", "10"];
    let output = workspace.motion(&[&["run", "part.ngc", "--trace", "-"][..], &chosen].concat());
    assert_eq!(output.status.code(), Some(0));
    // The summary does not stand among the rows.
    assert!(String::from_utf8_lossy(&output.stderr).contains("contour error at most"));
    let some = String::from_utf8(output.stdout).expect("UTF-8");
    let mut lines = some.lines();
    assert_eq!(lines.next(), Some("line,tick,Y_set_mm"));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let first: u64 = rows[0][1].parse().expect("a tick");
    let ticks: Vec<u64> = rows.iter().map(|row| row[1].parse().expect("a tick")).collect();
    assert_eq!(ticks, (first..=1800).step_by(10).collect::<Vec<_>>());
    assert!(ticks.len() > 2);
    // The same figures as in the whole trace.
    let header: Vec<&str> = all.lines().next().expect("a header").split(',').collect();
    let column = header.iter().position(|&name| name == "Y_set_mm").expect("a column");
    for row in &rows {
        let whole = all.lines().nth(row[1].parse::<usize>().expect("a tick") + 1).expect("a row");
        assert_eq!(whole.split(',').nth(column), Some(row[2]));
    }
    assert!(rows[1..].iter().all(|row| row[0] == "3"), "{rows:?}");
    let refusal = workspace.refusal(&["run", "part.ngc", "--trace", "-", "--columns", "X_set"]);
    assert!(refusal.contains("found the column X_set, expected one of tick, t_s,"), "{refusal}");
    let refusal = workspace.refusal(&["run", "part.ngc", "--trace", "-", "--json"]);
    assert!(refusal.contains("found --trace - with --json"), "{refusal}");
    assert!(!workspace.0.join("-").exists());
}

/// No line of a comparison is longer than a screen, whatever the paths of programs.
/// What can't be written is told before the work, and what has not come behind it.
#[test]
fn a_trace_that_would_be_empty_is_told() {
    let workspace = Workspace::new("empty-trace");
    // The column is looked at first.
    workspace.put("wrong.ngc", "G1 Q\n");
    let refusal = wrong(&workspace, &["run", "wrong.ngc", "--trace", "x.csv", "--columns", "t_s,Q_err_um"]);
    assert!(refusal.contains("Q_err_um") && !refusal.contains("wrong.ngc"), "{refusal}");
    workspace.put("part.ngc", CORNER);
    for (from, to) in [("0.2s", "100"), ("N3", "N2")] {
        let refusal = wrong(&workspace, &["run", "part.ngc", "--trace", "x.csv", "--from", from, "--to", to]);
        assert!(refusal.contains("found --from behind --to"), "{refusal}");
    }
    let told = workspace.stdout(&["run", "part.ngc", "--trace", "x.csv", "--from", "N9"]);
    assert!(told.contains("the trace has no tick, because what --from names has not come"), "{told}");
    let told = workspace.stdout(&["run", "part.ngc", "--trace", "x.csv", "--from", "N3"]);
    assert!(!told.contains("no tick"), "{told}");
}

/// A viewer's file beside the trace: a channel for each of its quantities. Like all files, it replaces no input.
#[test]
fn ticks_are_written_for_viewers() {
    let workspace = Workspace::new("mcap");
    workspace.put("part.ngc", CORNER);
    let told = workspace.stdout(&["run", "part.ngc", "--mcap", "part.mcap"]);
    assert!(told.contains("MCAP written to part.mcap"), "{told}");
    let bytes = std::fs::read(workspace.0.join("part.mcap")).expect("written");
    assert!(bytes.starts_with(b"\x89MCAP0\r\n") && bytes.ends_with(b"\x89MCAP0\r\n"));
    let refusal = wrong(&workspace, &["run", "part.ngc", "--mcap", "part.ngc"]);
    assert!(refusal.contains("--mcap"), "{refusal}");
}

#[test]
fn a_comparison_fits_the_screen() {
    let workspace = Workspace::new("narrow");
    let name = format!("{}.ngc", "a_program_with_a_long_name".repeat(3));
    workspace.put(&name, STRINGER);
    let tolerances = ["0.001", "0.002", "0.003", "0.005", "0.01", "0.02"];
    let tolerances = tolerances.iter().flat_map(|tolerance| ["--tolerance", tolerance]);
    let arguments: Vec<&str> = ["compare", name.as_str()].into_iter().chain(tolerances).collect();
    let text = workspace.stdout(&arguments);
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    assert!(text.contains("G64 P0.02") && text.contains("least [s]"), "{text}");
}

/// A plan shows what takes the time, and everything if that is asked for.
#[test]
fn a_plan_is_a_summary_unless_all_is_asked_for() {
    let workspace = Workspace::new("summary");
    let lines: String = (1..=60).map(|line| format!("G1 X{}\n", line * (1 + line % 7))).collect();
    workspace.put("part.ngc", &format!("G21 G90 G61 F1200\n{lines}M2\n"));
    let rows = |text: &str| text.lines().filter(|line| line.contains(" programmed ")).count();
    let text = workspace.stdout(&["plan", "part.ngc"]);
    assert_eq!(rows(&text), 20, "{text}");
    assert!(text.contains("the 20 blocks that take longest, ") && text.contains("60 blocks, "), "{text}");
    let all = workspace.stdout(&["plan", "part.ngc", "--all"]);
    assert_eq!(rows(&all), 60, "{all}");
}

/// What is no program is named, and one without motion says so.
#[test]
fn what_is_no_program_is_named() {
    let workspace = Workspace::new("no-program");
    workspace.put("empty.ngc", "\n");
    std::fs::write(workspace.0.join("wide.ngc"), b"\xFF\xFEG\x001\x00\n\x00").expect("a file");
    workspace.put("still.ngc", "(only words)\nM2\n");
    for command in ["run", "plan", "read"] {
        let refusal = workspace.refusal(&[command, "empty.ngc"]);
        assert!(refusal.contains("empty.ngc:1:1: found an empty file, expected G-code"), "{refusal}");
        let refusal = workspace.refusal(&[command, "wide.ngc"]);
        assert!(refusal.contains("found UTF-16 text, expected UTF-8 or ASCII"), "{refusal}");
    }
    for command in ["run", "plan"] {
        let text = workspace.stdout(&[command, "still.ngc"]);
        assert!(text.contains("note: nothing moves: the program has no motion"), "{text}");
    }
}

/// Feeds are per minute, as in programs, or carry their unit.
#[test]
fn a_feed_is_per_minute_or_carries_its_unit() {
    let workspace = Workspace::new("feeds");
    let feed =
        |text: &str| number(&workspace.json(&["jog", "X+30", "--feed", text, "--json"])[0]["feed_mm_s"]);
    for text in ["1200", "20mm/s", "1200mm/min"] {
        let found = feed(text);
        assert!((found - 20.0).abs() < 1e-3, "{text}: {found}");
    }
    let refusal = wrong(&workspace, &["jog", "X+1", "--feed", "fast"]);
    assert!(refusal.contains("found `fast`, expected a feed such as 3000 (mm/min)"), "{refusal}");
}

/// Commands are listed by purpose; shells and `man` get what they need.
#[test]
fn help_is_by_purpose_and_for_shells() {
    let workspace = Workspace::new("help");
    let help = workspace.stdout(&["--help"]);
    for title in ["Look at a program:", "Drive a machine through a board:", "Set up this command:"] {
        assert!(help.contains(title), "{help}");
    }
    assert!(workspace.stdout(&["completions", "bash"]).contains("complete -F _motion"));
    assert!(workspace.stdout(&["completions", "fish"]).contains("complete -c motion"));
    assert!(workspace.stdout(&["man"]).contains(".TH motion 1"));
    workspace.stdout(&["man", "--directory", "pages"]);
    assert!(workspace.read("pages/motion-send.1").contains("Drive a program on a board"));
    assert!(!workspace.0.join("pages/motion-help.1").exists());
}
