//! `send`, `watch`, `parameters` and `board` as commands: keys, statuses, JSON, refusals.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};

use serde_json::Value;

use super::workspace::{STRINGER, Workspace, number};

/// `motion board` in a process, and where it is.
struct Board(Child, String);

impl Board {
    fn start(workspace: &Workspace) -> Self {
        Self::of_machine(workspace, &[])
    }

    fn of_machine(workspace: &Workspace, machine: &[&str]) -> Self {
        let mut child = workspace
            .command(&["board", "--listen", "127.0.0.1:0"])
            .args(machine)
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

/// A command that runs, its keys, and its lines as they come.
fn typed_to(command: &mut Command) -> (Child, ChildStdin, impl Iterator<Item = String> + use<>) {
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a process");
    let keys = child.stdin.take().expect("piped");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines().map_while(Result::ok);
    (child, keys, lines)
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

/// A program that is driven while it is read, with a stop and its words; a line at fault ends it at rest before that line.
#[test]
fn a_program_is_driven_while_it_is_read() {
    let workspace = Workspace::new("stream");
    let lines: String = (1..=400).map(|line| format!("G1 X{}\n", 0.05 * f64::from(line))).collect();
    let text = format!("G21 G90 F6000\n{lines}G1 X3 Y1\n(MSG,turn it)\nM0\nG1 X2.5 Y0\n");
    workspace.put("wrong.ngc", &format!("{text}G1 X5 Q\nG1 X90\nM2\n"));
    let board = Board::start(&workspace);
    let send = ["send", "wrong.ngc", "--port", &board.1, "--enable", "--stream"];
    let (status, out, error) = outcome(&mut workspace.command(&send));
    assert_eq!(status, Some(3), "{out} {error}");
    let stop = "program: program stop at X 3.000 Y 1.000 Z 0.000: line 404 stops; turn it; r goes on";
    assert!(out.contains(stop), "{out}");
    workspace.put("wrong.ngc", &format!("{}G1 X5 Q\nG1 X90\nM2\n", text.replace("M0\n", "")));
    let (status, out, error) = outcome(workspace.command(&send).args(["--restart", "--json"]));
    assert_eq!(status, Some(2), "{out} {error}");
    assert!(
        error.contains("wrong.ngc:405:") && error.contains("nothing behind that place is driven"),
        "{error}"
    );
    let last: Value = serde_json::from_str(out.lines().last().expect("a line")).expect("JSON");
    assert_eq!(last["items"], Value::Null);
    let (_, out, _) =
        outcome(&mut workspace.command(&["watch", "--port", &board.1, "--seconds", "0.5", "--json"]));
    let seen: Value = serde_json::from_str(out.lines().next().expect("a line")).expect("JSON");
    assert_eq!((number(&seen["set_mm"][0]), number(&seen["set_mm"][1])), (2.5, 0.0), "{seen}");
}

/// A hold before the start, typed; a resume; an abort in the program.
#[test]
fn keys_hold_resume_and_abort() {
    let workspace = Workspace::new("keys");
    workspace.put("part.ngc", STRINGER);
    let (mut child, mut keys, lines) =
        typed_to(&mut workspace.command(&["send", "part.ngc", "--port", "simulator", "--enable"]));
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

/// A start in the middle: told, and confirmed by a key or an option; else nothing moves.
#[test]
fn a_program_is_begun_at_a_line() {
    let workspace = Workspace::new("from_line");
    workspace.put("part.ngc", "G21 G90 G61\nG1 X1 F1200\n(here)\nG1 X2 Y1\nX3\nM2\n");
    let send = ["send", "part.ngc", "--port", "simulator", "--enable", "--from-line"];
    let (status, out, error) = outcome(workspace.command(&send).arg("3"));
    assert_eq!(status, Some(3), "{out} {error}");
    for told in [
        "begins at line 4 of part.ngc, the next one with motion",
        "where the machine stands: spindle off, coolant off",
        "then it moves straight from X 0.000 Y 0.000 Z 0.000 to X 1.000 Y 0.000 Z 0.000, slowly",
        "tool: the program has changed none",
        "nobody confirms, and nothing was moved: --yes confirms",
    ] {
        assert!(out.contains(told), "{out}");
    }
    assert!(!out.contains("moving"), "{out}");
    let (status, out, error) = outcome(workspace.command(&send).args(["4", "--yes"]));
    assert_eq!(status, Some(0), "{out} {error}");
    assert!(
        out.contains("program: idle at X 1.000 Y 0.000") && out.contains("idle at X 3.000 Y 1.000"),
        "{out}"
    );
    let (status, _, error) = outcome(workspace.command(&send).args(["12", "--yes"]));
    assert_eq!(status, Some(2), "{error}");
    assert!(error.starts_with("motion: part.ngc:12: found a program of 6 lines, expected"), "{error}");
    // By the key.
    let (mut child, mut keys, lines) = typed_to(workspace.command(&send).arg("5"));
    let mut told = Vec::new();
    for line in lines {
        if line.starts_with("r with Enter confirms") {
            writeln!(keys, "r").expect("it reads");
        }
        told.push(line);
    }
    let confirmed = told.iter().position(|line| line.starts_with("r with Enter")).expect("asked");
    assert!(
        told[..confirmed].iter().all(|line| !line.contains("enabling") && !line.contains("moving")),
        "{told:?}"
    );
    assert_eq!(
        (child.wait().expect("an end").code(), told.last().map(String::as_str)),
        (Some(0), Some("done"))
    );
}

/// A sender is killed in the middle, as by a power cut of the PC; then the board's power goes, too.
#[test]
fn a_program_is_gone_on_with_after_power_cuts() {
    let workspace = Workspace::new("resume");
    let lines: String = (1..=60).map(|line| format!("G1 X{line} Y{}\n", line % 2)).collect();
    let part = format!("G21 G90 G61 F1200\n{lines}M2\n");
    workspace.put("part.ngc", &part);
    workspace.put("notes.txt", "not a journal");
    let board = Board::start(&workspace);
    let send = |port: &str, journal: &str| {
        workspace.command(&["send", "part.ngc", "--port", port, "--enable", "--journal", journal])
    };
    let resume = |port: &str, more: &[&str]| {
        outcome(workspace.command(&["resume", "part.journal", "--port", port]).args(more))
    };
    // Nothing of the user's is written over.
    let (status, _, error) = outcome(&mut send(&board.1, "notes.txt"));
    assert_eq!((status, workspace.read("notes.txt").as_str()), (Some(2), "not a journal"), "{error}");
    assert!(error.contains("notes.txt: found no journal, expected"), "{error}");
    let driven_at_least = |count: u64| {
        let journal = std::fs::read(workspace.0.join("part.journal")).ok();
        let record: Option<Value> = journal.and_then(|text| serde_json::from_slice(&text).ok());
        record.is_some_and(|record| record["driven"].as_u64().expect("a count") >= count)
    };
    let cut = |child: &mut Child, count: u64| {
        while !driven_at_least(count) {
            assert_eq!(child.try_wait().expect("a process"), None, "before it was cut");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        child.kill().expect("it runs");
        child.wait().expect("an end");
    };
    let quiet = |command: &mut Command| {
        command.stdin(Stdio::piped()).stdout(Stdio::null()).spawn().expect("a process")
    };
    cut(&mut quiet(send(&board.1, "part.journal").arg("--stream")), 4);
    // Another program, though by one figure.
    workspace.put("part.ngc", &part.replace("X60", "X61"));
    let (status, _, error) = resume(&board.1, &["--yes"]);
    assert!(status == Some(2) && error.contains("part.ngc with the checksum"), "{status:?} {error}");
    workspace.put("part.ngc", &part);
    // The board has run since, and knows where it is; nobody confirms, and then it is confirmed.
    let (status, out, error) = resume(&board.1, &[]);
    assert_eq!(status, Some(3), "{out} {error}");
    assert!(out.contains("was interrupted in line") && out.contains("nobody confirms"), "{out}");
    cut(&mut quiet(&mut workspace.command(&["resume", "part.journal", "--port", &board.1, "--yes"])), 20);
    drop(board);
    let board = Board::start(&workspace);
    let (status, _, error) = resume(&board.1, &["--yes", "--enable"]);
    assert!(status == Some(2) && error.contains("expected --homed"), "{status:?} {error}");
    let (status, out, error) = resume(&board.1, &["--yes", "--enable", "--homed"]);
    assert_eq!(status, Some(0), "{out} {error}");
    assert!(out.contains("idle at X 60.000 Y 0.000") && !out.contains("goes on at line 2\n"), "{out}");
    let (status, _, error) = resume(&board.1, &["--yes"]);
    assert!(status == Some(2) && error.contains("driven to its end"), "{status:?} {error}");
    // The place where journals are without the option.
    let (status, _, error) = outcome(&mut workspace.command(&["resume", "--port", &board.1]));
    assert!(status == Some(2) && error.contains("motion/tcp-127-0-0-1-"), "{status:?} {error}");
}

/// An axis with [axis.homing] has to be homed again on a board that was off, and one that was homed only afterwards has
/// lost the zero that the program had.
#[test]
fn a_program_is_gone_on_with_where_the_machine_is_homed() {
    let workspace = Workspace::new("resume-homed");
    workspace.put("homed.toml", &workspace.near_homing());
    let lines: String = (1..=60).map(|line| format!("G1 X{line} Y{}\n", line % 2)).collect();
    workspace.put("part.ngc", &format!("G21 G90 G61 F1200\n{lines}M2\n"));
    let machine = ["--machine", "homed.toml"];
    let home = |port: &str| {
        let home = ["home", "--port", port, "--enable", "--dead-man", "10"];
        let (status, out, error) = outcome(workspace.command(&home).args(machine));
        assert_eq!(status, Some(0), "{out} {error}");
    };
    let begin = |port: &str, journal: &str| {
        let send = ["send", "part.ngc", "--port", port, "--enable", "--journal", journal];
        let mut command = workspace.command(&send);
        let sender = command.args(machine).stdin(Stdio::piped()).stdout(Stdio::null());
        let mut sender = sender.spawn().expect("a process");
        let has_driven = || {
            let journal = std::fs::read(workspace.0.join(journal)).ok();
            let record: Option<Value> = journal.and_then(|text| serde_json::from_slice(&text).ok());
            record.is_some_and(|record| record["driven"].as_u64().expect("a count") >= 4)
        };
        while !has_driven() {
            assert_eq!(sender.try_wait().expect("a process"), None, "before it was killed");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        sender.kill().expect("it runs");
        sender.wait().expect("an end");
    };
    let resume = |port: &str, journal: &str, more: &[&str]| {
        let resume = ["resume", journal, "--port", port, "--yes", "--enable", "--homed"];
        outcome(workspace.command(&resume).args(more))
    };
    let board = Board::of_machine(&workspace, &machine);
    begin(&board.1, "before.journal");
    drop(board);
    let board = Board::of_machine(&workspace, &machine);
    home(&board.1);
    let (status, _, error) = resume(&board.1, "before.journal", &[]);
    assert!(status == Some(2) && error.contains("driven before axis X was homed"), "{status:?} {error}");
    begin(&board.1, "homed.journal");
    drop(board);
    let board = Board::of_machine(&workspace, &machine);
    let (status, _, error) = resume(&board.1, "homed.journal", &[]);
    assert!(status == Some(2) && error.contains("found axis X not homed"), "{status:?} {error}");
    home(&board.1);
    let (status, out, error) = resume(&board.1, "homed.journal", &[]);
    assert_eq!(status, Some(0), "{out} {error}");
    assert!(out.contains("idle at X 60.000 Y 0.000"), "{out}");
    // Whoever knows better says so.
    drop(board);
    let board = Board::of_machine(&workspace, &machine);
    let (status, out, error) = resume(&board.1, "before.journal", &["--ignore-homing"]);
    assert_eq!(status, Some(0), "{out} {error}");
}

/// Jog keys of a machine on a board.
#[test]
fn keys_jog_on_a_board() {
    let workspace = Workspace::new("jog_board");
    let board = Board::start(&workspace);
    let jog = ["jog", "X+2", "Y-1", "--port", &board.1, "--feed", "20mm/s", "--json", "--dead-man"];
    let (status, _, error) = outcome(workspace.command(&jog).arg("30"));
    assert!(status == Some(2) && error.contains("found the drives off, expected --enable"), "{error}");
    let (status, _, error) = outcome(workspace.command(&jog).args(["0.01", "--enable"]));
    assert!(status == Some(2) && error.contains("found --dead-man 0.01, expected"), "{error}");
    let (status, out, error) = outcome(workspace.command(&jog).args(["30", "--enable"]));
    assert_eq!(status, Some(0), "{error}");
    let jogged: Value = serde_json::from_str(&out).expect("JSON");
    let to_mm: Vec<f64> = [0, 1].map(|key| number(&jogged[key]["to_mm"])).to_vec();
    assert_eq!((to_mm, jogged[1]["ended"].as_str()), (vec![2.0, -1.0], Some("distance")));
    let (status, _, error) =
        outcome(&mut workspace.command(&["jog", "X+2", "--port", &board.1, "--trace", "jog.csv"]));
    assert!(status == Some(2) && error.contains("--trace"), "{error}");
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
    // A page of the ticks around the trigger alone, without a trace.
    let page = ["watch", "--port", port, "--seconds", "0.5", "--report", "rest.html", "--trigger"];
    let (status, out, error) = outcome(workspace.command(&page).args(["state=idle", "--after", "20"]));
    assert!(status == Some(0) && out.contains("report written to rest.html"), "{out} {error}");
    assert!(workspace.read("rest.html").contains("only ticks around those with state=idle"));
    let (status, _, error) = outcome(workspace.command(&page[..5]).args(["--trigger", "state=idle"]));
    assert_eq!(status, Some(2), "{error}");
    let (status, _, error) = outcome(workspace.command(&watch).arg("X_speed>1"));
    assert_eq!(status, Some(2));
    assert!(error.contains("found `X_speed>1`, expected COLUMN>VALUE"), "{error}");
    let (status, _, error) = outcome(workspace.command(&watch).arg("X_err_um>1"));
    assert_eq!(status, Some(2));
    assert!(error.contains("expected an axis of the machine"), "{error}");
}
