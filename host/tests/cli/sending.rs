//! `send`, `watch`, `parameters` and `board` as commands: keys, statuses, JSON, refusals.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use super::workspace::{STRINGER, Workspace, number};

/// `motion board` in a process, and where it is.
struct Board(Child, String);

impl Board {
    fn start(workspace: &Workspace) -> Self {
        let mut child = workspace
            .command(&["board", "--listen", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("a process");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut line).expect("a line");
        let port = line.trim().rsplit(' ').next().expect("an address").to_owned();
        assert!(port.starts_with("tcp:127.0.0.1:"), "{line}");
        Self(child, port)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Status, output and errors of a command, with nobody to type.
fn outcome(command: &mut Command) -> (Option<i32>, String, String) {
    let output = command.stdin(Stdio::null()).output().expect("it runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_program_is_sent_and_the_board_watched() {
    let workspace = Workspace::new("send");
    workspace.put("part.ngc", STRINGER);
    let board = Board::start(&workspace);
    let port = board.1.as_str();
    let send = ["send", "part.ngc", "--port", port];
    let (status, _, error) = outcome(&mut workspace.command(&send));
    assert_eq!(status, Some(2));
    assert_eq!(
        error.trim(),
        format!("motion: {port}: found the drives off, expected --enable, which switches them on")
    );
    let (status, out, _) = outcome(workspace.command(&send).args(["--enable", "--json"]));
    assert_eq!(status, Some(0));
    let lines: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let last = lines.last().expect("a line");
    assert_eq!((last["step"].as_str(), last["state"].as_str()), (Some("done"), Some("idle")));
    // To the resolution of positions.
    let off_mm = number(&last["set_mm"][0]) - 102.045_923_136;
    assert!(off_mm.abs() <= f64::powi(2.0, -32), "{off_mm}");
    let (status, out, _) =
        outcome(&mut workspace.command(&["watch", "--port", port, "--seconds", "0.5", "--json"]));
    assert_eq!(status, Some(0));
    let seen: Value = serde_json::from_str(out.lines().next().expect("a line")).expect("JSON");
    assert_eq!((seen["state"].as_str(), &seen["fault"]), (Some("idle"), &Value::Null));
    // The same machine, and then another one; not while the drives are on.
    let (status, out, _) = outcome(&mut workspace.command(&["parameters", "diff", "--port", port]));
    assert_eq!((status, out.trim()), (Some(0), "nothing differs"));
    let machine = outcome(&mut workspace.command(&["machine"])).1;
    workspace.put("slow.toml", &machine.replacen("accel_mm_s2 = 500.0", "accel_mm_s2 = 400.0", 1));
    let set = ["parameters", "set", "--port", port, "--machine", "slow.toml"];
    let (status, _, error) = outcome(&mut workspace.command(&set));
    assert_eq!(status, Some(2), "{error}");
    assert!(error.contains("found the drives on, expected them off"), "{error}");
    let (status, out, error) = outcome(workspace.command(&set).arg("--disable"));
    assert_eq!(status, Some(0), "{out} {error}");
    let (status, out, _) = outcome(&mut workspace.command(&["parameters", "diff", "--port", port]));
    assert_eq!(status, Some(1));
    assert!(out.contains("rules.limits.accel_mm_s2: board 400.0, file 500.0"), "{out}");
    let (status, _, error) = outcome(workspace.command(&send).arg("--enable"));
    assert_eq!(status, Some(2));
    assert!(error.contains("found a board with the machine"), "{error}");
}

/// A hold before the start, typed; a resume; an abort in the program.
#[test]
fn keys_hold_resume_and_abort() {
    let workspace = Workspace::new("keys");
    workspace.put("part.ngc", STRINGER);
    let mut child = workspace
        .command(&["send", "part.ngc", "--port", "simulator", "--enable"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("a process");
    let mut keys = child.stdin.take().expect("piped");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines().map_while(Result::ok);
    let mut told = Vec::new();
    for line in lines {
        let key = match told.len() {
            _ if line.starts_with("program: moving") && !told.contains(&"h") => "h",
            _ if line.starts_with("program: held") && !told.contains(&"r") => "r",
            _ if line.starts_with("program: moving") && told.contains(&"r") && !told.contains(&"a") => "a",
            _ => continue,
        };
        writeln!(keys, "{key}").expect("it reads");
        told.push(key);
    }
    assert_eq!((told.as_slice(), child.wait().expect("an end").code()), (&["h", "r", "a"][..], Some(4)));
}

/// Nobody types, and the program stops: the board stays there, and the status says so.
#[test]
fn a_program_stop_where_nobody_is() {
    let workspace = Workspace::new("stop");
    workspace.put("part.ngc", "G21 G90 G61\nG1 X1 F1200\n(MSG, clamp it)\nM0\nG1 X2\nM2\n");
    let (status, out, error) =
        outcome(&mut workspace.command(&["send", "part.ngc", "--port", "simulator", "--enable"]));
    assert_eq!(status, Some(3), "{out} {error}");
    assert!(out.contains("program stop at X 1.000 Y 0.000 Z 0.000: line 4 stops; clamp it"), "{out}");
    let (status, _, error) = outcome(&mut workspace.command(&["board", "--listen", "nowhere"]));
    assert!(
        status == Some(2) && error.contains("expected an address of this computer that is free"),
        "{error}"
    );
    for (port, expected) in
        [("nowhere", "found `nowhere`, expected tcp:HOST:PORT"), ("tcp:127.0.0.1:1", "expected a board")]
    {
        let (status, _, error) = outcome(&mut workspace.command(&["send", "part.ngc", "--port", port]));
        assert!(status != Some(0) && error.contains(expected), "{status:?} {error}");
    }
}

/// Every tick of a program in a file, from rest to rest; then the board at rest, around a trigger; and what is refused.
#[test]
fn every_tick_is_written() {
    let workspace = Workspace::new("scope");
    workspace.put("part.ngc", STRINGER);
    let board = Board::start(&workspace);
    let port = board.1.as_str();
    let send = ["send", "part.ngc", "--port", port, "--enable", "--scope", "ticks.csv"];
    let (status, out, error) = outcome(&mut workspace.command(&send));
    assert_eq!(status, Some(0), "{out} {error}");
    assert!(out.contains(" 0 missing, ") && out.contains("scope written to ticks.csv"), "{out}");
    let text = workspace.read("ticks.csv");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|of| *of == name).expect("a column");
    let (tick, state, set) = (column("tick"), column("state"), column("X_set_mm"));
    let ticks: Vec<u64> = rows[1..].iter().map(|row| row[tick].parse().expect("a number")).collect();
    assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 1), "one after the other");
    let moving: Vec<&Vec<&str>> = rows.iter().filter(|row| row[state] == "moving").collect();
    // More than 2 s of the program.
    assert!(moving.len() > 4000, "{} of {}", moving.len(), ticks.len());
    // To the resolution of positions.
    let end_mm: f64 = rows[rows.len() - 1][set].parse().expect("a number");
    assert!((end_mm - 102.045_923_136).abs() <= f64::powi(2.0, -32), "{end_mm}");
    let watch = ["watch", "--port", port, "--seconds", "0.5", "--scope", "rest.csv", "--trigger"];
    let (status, out, error) = outcome(workspace.command(&watch).args(["v_mm_s>1", "--before", "5"]));
    assert_eq!(status, Some(0), "{out} {error}");
    assert!(out.contains("triggered 0 times"), "{out}");
    assert_eq!(workspace.read("rest.csv").lines().count(), 1);
    let (status, out, _) = outcome(workspace.command(&watch).args(["state=idle", "--json"]));
    assert_eq!(status, Some(0), "{out}");
    assert!(workspace.read("rest.csv").lines().count() > 300);
    let (status, _, error) = outcome(workspace.command(&watch).arg("X_speed>1"));
    assert_eq!(status, Some(2));
    assert!(error.contains("found `X_speed>1`, expected COLUMN>VALUE"), "{error}");
    let (status, _, error) = outcome(workspace.command(&watch).arg("X_err_um>1"));
    assert_eq!(status, Some(2));
    assert!(error.contains("expected an axis of the machine"), "{error}");
}
