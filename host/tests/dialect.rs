//! Programs as other controllers take them: subroutines, loops, offsets, tools, drilling cycles, saved modes. What is
//! expected here was seen to be what LinuxCNC's interpreter makes of the same lines (`tests/peers/linuxcnc`).

use motion_host::gcode::{
    self, Feed, Outputs, ParameterFile, Point, Program, ReadOptions, SpindleSpeed, StepKind, ToolTable,
    xyz_mm,
};
use motion_host::machine::{CoolantSettings, Machine, SpindleSettings};
use motion_host::planning::{Item, Mode, plan_program};
use motion_kernel::hal::{OutputState, Spindle};

fn read(text: &str) -> Program {
    gcode::read("a.ngc", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// A step in a word or two: `r` a rapid and `l` a line to their end points, `a` an arc.
fn shown(kind: &StepKind) -> String {
    let point = |at: Point| {
        // −0 is 0.
        let [x, y, z] = xyz_mm(at).map(|mm| (mm * 1e6).round() / 1e6 + 0.0);
        format!("{x} {y} {z}")
    };
    match kind {
        StepKind::Line(line) if line.feed == Feed::Rapid => format!("r {}", point(line.to)),
        StepKind::Line(line) => format!("l {}", point(line.to)),
        StepKind::Arc(arc) => format!("a {}", point(arc.to)),
        StepKind::Dwell { seconds } => format!("dwell {seconds}"),
        StepKind::ToolChange { tool } => format!("T{tool}"),
        StepKind::Switch(to) => switched(to),
        StepKind::Stop => "stop".to_owned(),
        StepKind::End => "end".to_owned(),
        other => format!("{other:?}"),
    }
}

/// `m3 1000` and the like, with `mist` and `flood`; `off` if there is nothing on.
fn switched(to: &Outputs) -> String {
    let spindle = match to.spindle {
        Spindle::Off => None,
        Spindle::Clockwise => Some("m3"),
        Spindle::Counterclockwise => Some("m4"),
    };
    let spindle = spindle.map(|word| match to.speed {
        SpindleSpeed::Rpm(speed) => format!("{word} {speed}"),
        SpindleSpeed::Surface(speed) => format!("{word} {speed} of the surface"),
    });
    let coolant = [(to.mist, "mist"), (to.flood, "flood")].into_iter().filter(|(is_on, _)| *is_on);
    let all: Vec<String> = spindle.into_iter().chain(coolant.map(|(_, word)| word.to_owned())).collect();
    if all.is_empty() { "off".to_owned() } else { all.join(" ") }
}

fn steps(text: &str) -> Vec<String> {
    read(text).steps.iter().map(|step| shown(&step.kind)).collect()
}

/// The end point of the last move.
fn last(text: &str) -> String {
    steps(text).pop().expect("a step")
}

fn refusal(text: &str) -> String {
    refusal_with(text, &ReadOptions::default())
}

fn refusal_with(text: &str, options: &ReadOptions) -> String {
    gcode::read_with("a.ngc", text.as_bytes(), options).expect_err(text).to_string()
}

fn feeds(text: &str) -> Vec<f64> {
    let feed = |kind: &StepKind| match kind {
        StepKind::Line(line) => Some(line.feed),
        StepKind::Arc(arc) => Some(arc.feed),
        _ => None,
    };
    let mm_min = |feed| match feed {
        Feed::Rapid => 0.0,
        Feed::MmPerMin(feed) => feed,
    };
    read(text).steps.iter().filter_map(|step| feed(&step.kind)).map(mm_min).collect()
}

#[test]
fn subroutines_take_arguments_and_return_values() {
    let factorial = "
o200 sub
  o210 if [#1 LE 1]
    o210 return [1]
  o210 endif
  #2 = #1
  o200 call [#1-1]
o200 endsub [#<_value>*#2]
#1 = 77
o200 call [6]
G0 X#<_value> Y#1 Z#<_value_returned>";
    assert_eq!(last(factorial), "r 720 77 1");
    let names = "
#<a b> = 5 #<_Global> = 6 #31 = 7
o<names> sub
  o500 if [EXISTS[#<ab>]]
    G0 X999
  o500 endif
  #<ab> = 1
  G0 X[#<ab>+#<_global>] Y#31
o<names> endsub
o<names> call
X#<ab> Y#<_value_returned>";
    assert_eq!(steps(names), ["r 7 7 0", "r 5 0 0"]);
    // A subroutine may stand behind the end.
    assert_eq!(steps("o<later> call\nM2\no<later> sub\nG0 X1\no<later> endsub"), ["r 1 0 0", "end"]);
}

#[test]
fn loops_and_conditions_run_as_often_as_they_say() {
    let text = "
o100 while [#5 LT 9]
  #5 = [#5+1]
  o110 if [#5 EQ 3]
    o100 continue
  o110 elseif [#5 EQ 5]
    o100 break
  o110 else
    G0 X#5
  o110 endif
o100 endwhile
o300 do
  #7 = [#7+1]
  o310 if [#7 EQ 2]
    o300 continue
  o310 endif
  Y#7
o300 while [#7 LT 3]
o400 repeat [2]
  o410 repeat [2]
    #8 = [#8+1]
    Z#8
  o410 endrepeat
o400 endrepeat
o500 repeat [0]
  X99
o500 endrepeat
o600 if [0]
  X99
o600 elseif [1]
  o610 if [1]
    X50
  o610 endif
o600 elseif [#<never_set>]
  X98
o600 endif";
    let expected = [
        "r 1 0 0", "r 2 0 0", "r 4 0 0", "r 4 1 0", "r 4 3 0", "r 4 3 1", "r 4 3 2", "r 4 3 3", "r 4 3 4",
        "r 50 3 4",
    ];
    assert_eq!(steps(text), expected);
    // A return and a break leave the loops they are in.
    let nested = "
o1 sub
  o10 repeat [5]
    o20 while [1]
      #31 = [#31+1]
      o30 if [#31 EQ 3]
        o20 break
      o30 endif
      o40 if [#31 EQ 6]
        o40 return
      o40 endif
    o20 endwhile
    G0 Y#31
  o10 endrepeat
o1 endsub
o50 repeat [2]
  X[#31+1]
  o1 call
  #31 = 0
o50 endrepeat";
    assert_eq!(steps(&format!("G0\n{nested}")), ["r 1 0 0", "r 1 3 0"]);
}

#[test]
fn subprograms_of_m98_work_on_their_callers_parameters() {
    let text = "G0 X1\n#1=5\nM98 P100 L3\nY#1\nM30\nO100\n#1=[#1+1]\nX#1\nM99\n";
    assert_eq!(steps(text), ["r 1 0 0", "r 6 0 0", "r 7 0 0", "r 8 0 0", "r 8 8 0", "end"]);
    assert_eq!(steps("G0 X1\nM98 P5 L0\nM99\nX2"), ["r 1 0 0", "end"]);
    for (text, message) in [
        ("M98", "a.ngc:1:1: found M98 without a number"),
        ("M98 P7", "a.ngc:1:1: found a call of O7"),
        ("M98 P7 X1", "a.ngc:1:8: found X1 in a line of M98"),
        ("M98 P7\nM2\nO7\nG0 X1", "a.ngc:4:1: found the end of the file in a subprogram, expected M99"),
        ("o1 sub\nM99\no1 endsub\no1 call", "a.ngc:2:1: found M99 in a subroutine that was called otherwise"),
    ] {
        let error = refusal(text);
        assert!(error.starts_with(message), "{text}: {error}");
    }
}

#[test]
fn o_words_that_join_nothing_are_refused_at_their_place() {
    for (text, message) in [
        ("o1 while [1]\nM2", "a.ngc:1:1: found O1 while without its end up to line 2, expected O1 endwhile"),
        ("o1 endwhile", "a.ngc:1:1: found O1 where no block is open, expected"),
        (
            "o1 if [1]\n o2 while [1]\n o1 endif",
            "a.ngc:3:2: found O1 where O2 while of line 2 is open last, expected",
        ),
        ("o1 break", "a.ngc:1:1: found O1 where no block is open"),
        (
            "\no1 while [1]\no1 if [1]\n",
            "a.ngc:3:1: found O1 within the block of this label that begins in line 2",
        ),
        ("o1 sub\no2 sub\n", "a.ngc:2:1: found O2 sub in the block that begins in line 1"),
        ("o1 return", "a.ngc:1:1: found a return outside of subroutines"),
        ("o1 if [1] G0 X1\no1 endif", "a.ngc:1:11: found 'G', expected a comment or the end of the line"),
        ("o1 call", "a.ngc:1:1: found a call of O1, expected a subroutine of this file"),
        ("o<../a> call", "a.ngc:1:1: found a call of O../a"),
        (
            "o1 sub\no1 endsub\no1 sub\no1 endsub\no1 call",
            "a.ngc:3:1: found O1 sub a second time, after that in line 1",
        ),
        (
            "o1 sub\no1 call\no1 endsub\no1 call",
            "a.ngc:2:1: found subroutines within each other, expected 100",
        ),
        ("o[1+1] sub\no2 endsub", "a.ngc:1:1: found a computed label, expected it with call only"),
        ("o<x", "a.ngc:1:2: found '<' without a name"),
        ("G0 X[#<depth>]", "a.ngc:1:6: found #<depth>, to which nothing was assigned"),
        ("G0 X#5602", "a.ngc:1:5: found parameter 5602"),
        ("#5420 = 1", "a.ngc:1:1: found #5420 where a value is assigned"),
        ("#<_x> = 1", "a.ngc:1:1: found #<_x> where a value is assigned"),
        ("G0 X[1/0]", "a.ngc:1:7: found a division by 0"),
    ] {
        let error = refusal(text);
        assert!(error.starts_with(message), "{text}: {error}");
    }
    let options = ReadOptions { lines_max: 1000, ..ReadOptions::default() };
    let error = refusal_with("o1 while [1]\nG0 X1\no1 endwhile", &options);
    assert!(error.starts_with("a.ngc:2:1: found more than 1000 lines executed up to here"), "{error}");
}

#[test]
fn coordinate_systems_shift_and_turn() {
    for (text, end) in [
        ("G10 L2 P1 X10 Y20 Z30\nG0 X1 Y1 Z1", "r 11 21 31"),
        ("G10 L2 P2 X-5 Y4 R90\nG55 G0 X3 Y1", "r -6 7 0"),
        ("G10 L2 P2 X1 R30\nG55 G0 X2 Y0", "r 2.732051 1 0"),
        ("G0 X5 Y5\nG92 X0 Y1\nX1 Y1", "r 6 5 0"),
        ("G0 X5\nG92 X0\nG92.2\nX1", "r 1 0 0"),
        ("G0 X5\nG92 X0\nG92.2\nG92.3\nX1", "r 6 0 0"),
        ("G0 X5\nG92 X0\nG92.1\nG92.3\nX1", "r 1 0 0"),
        ("G52 X1 Y2\nG0 X0 Y0 Z1", "r 1 2 1"),
        ("G10 L2 P1 X10\nG0 X1\nG53 X1", "r 1 0 0"),
        ("G0 X7\nG10 L20 P1 X2\nX0", "r 5 0 0"),
        ("G0 X7 Y1\nG28.1\nX0 Y0\nG28", "r 7 1 0"),
        ("G0 X7 Y1\nG30.1\nX0 Y0\nG30 X1", "r 7 0 0"),
        ("G59.3 G10 L2 P9 X1 R90\nG0 X2 Y0", "r 1 2 0"),
        ("G20 G10 L2 P1 X1\nG21 G0 X1", "r 26.4 0 0"),
        ("G91 G0 X1\nG10 L2 P1 X10\nX1", "r 2 0 0"),
        // The machine is where it was, whatever turns or how lengths are counted.
        ("G0 X10 Y5\nG92 X1 Y2\nG10 L2 P1 R90\nG91 X2", "r 10 7 0"),
        ("G43.1 Z5\nG0 Z2\nG20\nG53 G0 Z1", "r 0 0 25.4"),
        ("F9 G81 X1 Z-2 R1\nG20 X1\nG80 G21 G0 Z0", "r 25.4 0 0"),
        ("G7 G0 X30", "r 15 0 0"),
        ("G7\nG8 G0 X30", "r 30 0 0"),
        ("G0 @10 ^90", "r 0 10 0"),
        ("G0 X3 Y4\n@10", "r 6 8 0"),
        ("G0 X3 Y0\n^180", "r -3 0 0"),
        ("G0 X3\nG91 @1 ^90", "r 0 4 0"),
    ] {
        assert_eq!(last(text), end, "{text}");
    }
    assert_eq!(steps("G0 X7 Y1 Z2\nG28 Z5"), ["r 7 1 2", "r 7 1 5", "r 7 1 0"]);
    for (text, message) in [
        ("G10 L2 P10", "a.ngc:1:8: found P10, expected a coordinate system from 0 to 9"),
        ("G10 P1", "a.ngc:1:1: found G10, expected L1, L2, L10, L11 or L20"),
        ("G53 X1", "a.ngc:1:5: found X1 without a motion mode"),
        ("G91 G53 G0 X1", "a.ngc:1:12: found X1 with G53, expected absolute end points"),
        ("G92", "a.ngc:1:1: found G92, expected axis words"),
        ("G92 G1 X1", "a.ngc:1:5: found G1 in a line whose axis words another word takes"),
    ] {
        let error = refusal(text);
        assert!(error.starts_with(message), "{text}: {error}");
    }
}

/// M6 calls the subroutine that the machine file names.
#[test]
fn a_subroutine_changes_tools() {
    let table = ToolTable::parse("tool.tbl", b"T1 P7 Z10\nT2 P8\n").expect("a table");
    let options =
        |tools| ReadOptions { change_subroutine: Some("change".to_owned()), tools, ..ReadOptions::default() };
    let read = |text: &str| {
        let program = gcode::read_with("a.ngc", text.as_bytes(), &options(Some(table.clone())));
        let program = program.unwrap_or_else(|error| panic!("{text}: {error}"));
        program.steps.iter().map(|step| shown(&step.kind)).collect::<Vec<_>>()
    };
    let by_hand =
        "o<change> sub\nG0 X#1 Y#<selected_tool> Z#<tool_in_spindle>\nM6\nG0 Z9\no<change> endsub\n";
    // M6 in it is a stop; the tool that is there is not changed again; the caller goes on behind it.
    let text = format!("{by_hand}N5 T1 M6 S100 F9 (end mill)\nG43\nG0 Z1\nM6\nT2 M6\nX[#5400+5]");
    let expected = ["r 1 1 0", "T1", "r 1 1 9", "r 1 1 11", "r 2 2 11", "T2", "r 2 2 19", "r 7 2 19"];
    assert_eq!(read(&text), expected);
    let by_itself = "o<change> sub\nG0 X#<selected_pocket> Y#<current_pocket>\no<change> endsub [1]\n";
    let text = format!("{by_itself}T1 M6\nG0 Z#5400\nT2 M6\nG0 Z#5400");
    assert_eq!(read(&text), ["r 7 -1 0", "r 7 -1 1", "r 8 7 1", "r 8 7 2"]);
    // Without a table there are no pockets.
    let program =
        gcode::read_with("a.ngc", format!("{by_itself}T3 M6").as_bytes(), &options(None)).expect("a program");
    assert_eq!(shown(&program.steps[0].kind), "r -1 -1 0");
    assert_eq!(program.tools, [3]);
    // In it the number may be taken by M61, and it may call others.
    let others = "o<b> sub\nM61 Q#<_selected_tool>\no<b> endsub\no<change> sub\no<b> call\no<change> endsub\nT2 M6\nG0 X#5400";
    assert_eq!(read(others), ["r 2 0 0"]);
    for (text, expected) in [
        ("T1 M6 G43", "a.ngc:1:7: found G43 in a line of M6, expected it in a line of its own"),
        ("T1 M6 M3", "a.ngc:1:7: found M3 in a line of M6"),
        ("X1 T1 M6", "a.ngc:1:1: found X1 in a line of M6"),
        (
            "T1 M6",
            "a.ngc:1:1: found a call of Ochange, expected a subroutine of this file, or a file change.ngc",
        ),
        (
            "o<change> sub\no<change> endsub\nT1 M6",
            "a.ngc:2:1: found the end of the subroutine that changes tools without tool 1, expected M6 in it",
        ),
        (
            "o<change> sub\no<change> return [-1]\no<change> endsub [1]\nT1 M6",
            "a.ngc:2:1: found the end of the subroutine that changes tools without tool 1, which returns -1,",
        ),
        (
            "o<change> sub\no<change> call\no<change> endsub\nT1 M6",
            "a.ngc:2:1: found subroutines within each other",
        ),
    ] {
        let error = refusal_with(text, &options(Some(table.clone())));
        assert!(error.starts_with(expected), "{text}: {error}");
    }
}

#[test]
fn an_arc_turns_with_its_coordinate_system() {
    let arc = |text: &str| match read(text).steps.last().expect("a step").kind {
        StepKind::Arc(arc) => arc,
        ref other => panic!("{other:?}"),
    };
    // The quarter from (1, 0, 0) over Z in the plane that a turn by 90° makes of ZX.
    let turned = arc("G10 L2 P1 R90\nG0 X1\nF60 G18 G3 X0 Z1 I-1");
    assert_eq!((turned.turn_deg, turned.centre_mm), (90.0, [0.0, 0.0]));
    assert_eq!(shown(&StepKind::Arc(turned)), "a 0 0 1");
    assert_eq!(xyz_mm(turned.from), [0.0, 1.0, 0.0]);
    let flat = arc("G10 L2 P1 X5 R90\nG0 X1 Y0\nF60 G3 X0 Y1 I-1");
    assert_eq!((flat.turn_deg, flat.centre_mm), (0.0, [5.0, 0.0]));
    // Absolute centres, by which the same arc is written.
    let absolute = arc("G10 L2 P1 X5 R90\nG0 X1 Y0\nF60 G90.1 G3 X0 Y1 I0 J0");
    assert_eq!((absolute.centre_mm, absolute.to), (flat.centre_mm, flat.to));
}

#[test]
fn tools_are_changed_by_hand_and_their_lengths_added() {
    let table = ToolTable::parse("tool.tbl", b"T1 Z10 D6 ; end mill\nT2 X1 Z-5\n").expect("a table");
    let options = ReadOptions { tools: Some(table), ..ReadOptions::default() };
    let read = |text: &str| {
        gcode::read_with("a.ngc", text.as_bytes(), &options).unwrap_or_else(|error| panic!("{error}"))
    };
    let program =
        read("T1 M6 G43\nG0 Z1\nT2\nG43 H2 Z1\nM6\nM6\nG49 X0 Z1\nG43.1 Z3\nZ1\nT0 M6\nM61 Q2\nX#5400");
    let steps: Vec<_> = program.steps.iter().map(|step| shown(&step.kind)).collect();
    assert_eq!(steps, ["T1", "r 0 0 11", "r 0 0 -4", "T2", "r 0 0 1", "r 0 0 4", "T0", "r 2 0 4"]);
    let messages: Vec<_> = program.messages.iter().map(|message| message.text.as_str()).collect();
    assert_eq!(messages, ["tool 1: end mill", "tool 2", "take the tool out"]);
    assert!(
        refusal_with("T3", &options)
            .starts_with("a.ngc:1:1: found tool 3, expected a tool of the tool table")
    );
    assert!(refusal_with("G43 H9", &options).starts_with("a.ngc:1:5: found tool 9"));
    // Tables are set by the program, too.
    let set = read("G10 L1 P1 Z20\nG43 H1 G0 Z0\nG49\nG10 L10 P2 Z-3\nG43 H2 Z1");
    let ends: Vec<_> = set.steps.iter().map(|step| shown(&step.kind)).collect();
    assert_eq!(ends, ["r 0 0 20", "r 0 0 24"]);
    // Without a table every tool is assumed to have no length.
    let assumed = gcode::read("a.ngc", b"T7 M6\nG43 H3 G0 Z1").expect("a program");
    assert_eq!(assumed.tools_assumed, [7, 3]);
    assert!(assumed.notes(|_| false).iter().any(|note| note.contains("there is no tool table: tools 7, 3")));
}

#[test]
fn drilling_cycles_are_rapids_and_feeds() {
    // Above R first; back to where the first hole began, or after G99 to R.
    let plain = "F9 G0 Z10\nG81 X5 Y6 Z-3 R2\nG99 X7\nG80\nX8";
    let error = refusal(plain);
    assert!(error.starts_with("a.ngc:5:1: found X8 without a motion mode"), "{error}");
    let expected = [
        "r 0 0 10", "r 5 6 10", "r 5 6 2", "l 5 6 -3", "r 5 6 10", "r 7 6 10", "r 7 6 2", "l 7 6 -3",
        "r 7 6 2",
    ];
    assert_eq!(steps(plain.trim_end_matches("\nG80\nX8")), expected);
    let incremental = "F9 G0 Z4\nG91 G81 X1 Y2 Z-3 R-2 L2";
    let expected =
        ["r 0 0 4", "r 1 2 4", "r 1 2 2", "l 1 2 -1", "r 1 2 4", "r 2 4 4", "r 2 4 2", "l 2 4 -1", "r 2 4 4"];
    assert_eq!(steps(incremental), expected);
    let peck = "F9 G0 Z5\nG99 G83 X1 Z-3 R1 Q2";
    let expected =
        ["r 0 0 5", "r 1 0 5", "r 1 0 1", "l 1 0 -1", "r 1 0 1", "r 1 0 -0.746", "l 1 0 -3", "r 1 0 1"];
    assert_eq!(steps(peck), expected);
    let chips = "F9 G0 Z5\nG99 G73 X1 Z-3 R1 Q2";
    assert_eq!(steps(chips)[3..], ["l 1 0 -1", "r 1 0 -0.746", "l 1 0 -3", "r 1 0 1"]);
    assert_eq!(steps("F9 G0 Z1\nG82 Z-1 R1 P0.5")[1..], ["l 0 0 -1", "dwell 0.5", "r 0 0 1"]);
    assert_eq!(steps("F9 G0 Z1\nG85 Z-1 R1")[1..], ["l 0 0 -1", "l 0 0 1"]);
    assert_eq!(
        steps("F9 M3 G0 Z1\nG86 Z-1 R1 P0"),
        ["m3 0", "r 0 0 1", "l 0 0 -1", "dwell 0", "off", "r 0 0 1", "m3 0", "off"]
    );
    assert_eq!(
        steps("F9 S7 M4 G0 Z1\nG88 Z-1 R1 P0"),
        ["m4 7", "r 0 0 1", "l 0 0 -1", "dwell 0", "off", "stop", "m4 7", "r 0 0 1", "off"]
    );
    assert_eq!(steps("F9 G0 Z1\nG89 Z-1 R1 P0")[1..], ["l 0 0 -1", "dwell 0", "l 0 0 1"]);
    // Holes of no depth where the machine is end at once.
    assert_eq!(steps("F9 G0 Z1\nG81 Z1 R1 L4000000000"), ["r 0 0 1"]);
    // Below R it goes up to it first; in another plane along that one's normal.
    assert_eq!(steps("F9 G18 G81 X1 Z1 Y-1 R2"), ["r 0 2 0", "r 1 2 1", "l 1 -1 1", "r 1 2 1"]);
    for (text, message) in [
        ("F9 G81 X1 Z-1", "a.ngc:1:8: found G81, expected an R word"),
        ("F9 G81 X1 R1", "a.ngc:1:8: found G81, expected a depth along the normal"),
        ("F9 G83 X1 Z-1 R1", "a.ngc:1:8: found G83, expected the depth of a peck"),
        ("F9 G82 X1 Z-1 R1", "a.ngc:1:8: found G82, expected a dwell"),
        ("F9 G81 X1 Z2 R1", "a.ngc:1:8: found G81, expected a depth below R"),
        ("F9 G81 X1 Z-1 R1 L0", "a.ngc:1:18: found L0, expected a whole number of holes"),
        ("F9 G83 X1 Z-1 R1 Q0", "a.ngc:1:18: found Q0, expected a positive depth of a peck"),
        ("F9 G86 X1 Z-1 R1 P1", "a.ngc:1:8: found G86, expected a turning spindle"),
        ("G81 X1 Z-1 R1", "a.ngc:1:1: found G81 without a feed"),
        ("F9 G81 X1 Z-1 R1 Q1", "a.ngc:1:18: found Q1 in a line without"),
    ] {
        let error = refusal(text);
        assert!(error.starts_with(message), "{text}: {error}");
    }
}

#[test]
fn feeds_have_three_meanings() {
    // 10 mm in 1/4 min, a half circle of 5 mm in 1 min.
    let inverse = feeds("G93 G1 X10 F4\nG2 X20 I5 F1\nG0 X30");
    assert_eq!(inverse[0], 40.0);
    assert!((inverse[1] - 5.0 * std::f64::consts::PI).abs() < 1e-12);
    assert_eq!(inverse[2], 0.0);
    assert_eq!(feeds("G95 S1200 F0.2\nG1 X1\nS600 X2\nG94 F7 X3"), [240.0, 120.0, 7.0]);
    for (text, message) in [
        ("G93 G1 X1", "a.ngc:1:5: found G1 without F after G93"),
        ("G93 G1 X1 F1\nX2", "a.ngc:2:1: found G1 without F after G93"),
        ("G95 F1 G1 X1", "a.ngc:1:8: found G1 after G95 without a spindle's speed"),
        ("F9\nG95 S5 G1 X1", "a.ngc:2:8: found G1 without a feed"),
        ("G93 G81 X1 Z-1 R1 F1", "a.ngc:1:9: found G81, expected a feed per minute or revolution"),
    ] {
        let error = refusal(text);
        assert!(error.starts_with(message), "{text}: {error}");
    }
}

#[test]
fn modes_are_saved_and_restored() {
    let text = "G21 G90 F120 G1 X1
o<saves> sub
  M73 G20 G91
  G1 X1
o<saves> endsub
o<saves> call
X1 Y#<_feed>
M70
G91 G20 X1
M72
X5 Z#<_absolute>";
    assert_eq!(steps(text), ["l 1 0 0", "l 26.4 0 0", "l 1 120 0", "l 26.4 120 0", "l 5 120 1"]);
    // The length, not the table's.
    assert_eq!(last("G43.1 Z5\nM70\nG49\nM72\nG0 Z1"), "r 0 0 6");
    assert!(refusal("M72").starts_with("a.ngc:1:1: found M72, but no modes that were saved"));
}

#[test]
fn switches_and_messages_are_the_operators() {
    let text = "/G0 X1\nG0 X2\nM1\n(MSG, turn the part)\n(DEBUG, at #5420)\nM2";
    let options =
        |block_delete, optional_stop| ReadOptions { block_delete, optional_stop, ..ReadOptions::default() };
    for (options, expected) in [
        (options(true, true), &["r 2 0 0", "stop", "end"][..]),
        (options(false, false), &["r 1 0 0", "r 2 0 0", "end"]),
    ] {
        let program = gcode::read_with("a.ngc", text.as_bytes(), &options).expect("a program");
        let steps: Vec<_> = program.steps.iter().map(|step| shown(&step.kind)).collect();
        assert_eq!(steps, expected);
        let texts: Vec<_> = program.messages.iter().map(|message| message.text.as_str()).collect();
        assert_eq!(texts, ["turn the part", "at 2.000000"]);
    }
    assert!(refusal("(ABORT, no stock at %d#5420)").contains("no stock at 0"));
    let program = read("#5599=0 (DEBUG, no)\n(PRINT, 1)\n(MSG, 2)\n#5599=1\n(DEBUG, %d#5599)\nM99\nX1");
    let texts: Vec<_> = program.messages.iter().map(|message| message.text.as_str()).collect();
    assert_eq!(texts, ["1", "2", "1"]);
    let notices: Vec<_> = program.notices.iter().map(|notice| (notice.kind, notice.first_line)).collect();
    assert_eq!(notices, [(gcode::NoticeKind::MainReturn, 6), (gcode::NoticeKind::TextAfterEnd, 7)]);
}

#[test]
fn a_parameter_file_goes_in_and_out() {
    let file = ParameterFile::parse("machine.var", b"5220 2\n5241 7\n5161 3\n100 5\n").expect("a file");
    let options = ReadOptions { parameters: file.clone(), ..ReadOptions::default() };
    let program = gcode::read_with("a.ngc", b"G0 X#100\nG28\n#100=6\n#101=7\nG10 L2 P1 Y9\nM2", &options);
    let program = program.expect("a program");
    let steps: Vec<_> = program.steps.iter().map(|step| shown(&step.kind)).collect();
    // G55 puts X0 at 7, the machine's zero is X-7 before the first move; G28 goes to the machine's X3.
    assert_eq!(steps, ["r 12 0 0", "r 3 0 0", "end"]);
    let after = file.after(&program.parameters).to_string();
    let value = |number: &str| {
        let line = after.lines().find(|line| line.split('\t').next() == Some(number));
        line.and_then(|line| line.split('\t').nth(1)).map(str::to_owned)
    };
    let found = ["100", "101", "5222", "5241", "5220"].map(value);
    assert_eq!(
        found.each_ref().map(Option::as_deref),
        [Some("6.0"), None, Some("9.0"), Some("7.0"), Some("1.0")]
    );
}

#[test]
fn programs_as_posts_write_them_are_planned_as_they_are() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/programs/posts");
    let mut names: Vec<_> =
        std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("a file").path()).collect();
    names.sort();
    assert_eq!(names.len(), 9);
    for path in names {
        let name = path.display().to_string();
        let program = read(&std::fs::read_to_string(&path).expect("a text"));
        assert_eq!(program.steps.last().map(|step| &step.kind), Some(&StepKind::End), "{name}");
        let plan = plan_program(&name, &program, &Machine::reference(), Mode::Spanning);
        let plan = plan.unwrap_or_else(|error| panic!("{error}"));
        assert!(plan.blocks.len() >= 9, "{name}: {} blocks", plan.blocks.len());
        // And with spindle and coolant, which each of them switches on and at the end off.
        let machine = Machine {
            spindle: Some(SpindleSettings {
                speed_max_rpm: 24_000.0,
                start_s: 3.0,
                stop_s: 0.0,
                reverses: true,
            }),
            coolant: Some(CoolantSettings { flood: true, mist: true }),
            ..Machine::reference()
        };
        let plan = plan_program(&name, &program, &machine, Mode::Spanning);
        let plan = plan.unwrap_or_else(|error| panic!("{error}"));
        let switch = |item: &Item| match item {
            Item::Switch { to, .. } => Some(*to),
            _ => None,
        };
        let switches: Vec<_> = plan.items.iter().filter_map(switch).collect();
        assert!(switches[0].spindle_turns() && switches.last() == Some(&OutputState::OFF), "{name}");
    }
    // What repeats in a subprogram: three slots, 8 mm apart.
    let slots = steps(include_str!("../../tests/programs/posts/solidcam.ngc"));
    let starts: Vec<_> = slots.iter().filter(|step| step.starts_with("l") && step.ends_with(" -1")).collect();
    assert_eq!(starts, ["l 10 10 -1", "l 30 10 -1", "l 10 18 -1", "l 30 18 -1", "l 10 26 -1", "l 30 26 -1"]);
}

#[test]
fn blanks_within_keywords_do_not_count() {
    let text =
        "#1=2\no1 if [#1 eq 1]\nG0 X1\no1 else if [#1 e q 2]\nG0 X[s qrt[4]]\no1 el se\nG0 X3\no1 end if";
    assert_eq!(steps(text), ["r 2 0 0"]);
}

#[test]
fn long_messages_of_a_loop_are_bounded() {
    let text = format!("o1 while [1]\n(MSG,{})\no1 endwhile", "x".repeat(10_000));
    assert!(refusal(&text).starts_with("a.ngc:2:1: found more than"));
}

#[test]
fn whole_turns_remain_in_a_turned_system() {
    let mut random = motion_tests::random::Random::new(7);
    for _ in 0..2000 {
        let [angle, x, y, i] = [180.0, 100.0, 100.0, 50.0].map(|size| random.between(-size, size));
        let text = format!(
            "G10 L2 P1 R{angle:.4}\nF100\nG53 G0 X{x:.4} Y{y:.4}\nG3 I{i:.4} Z-2\nG91 G49\nG2 J5\nG0 Z1"
        );
        let program = read(&text);
        let turns = program.steps.iter().filter_map(|step| match &step.kind {
            StepKind::Arc(arc) => Some((arc.from[0] == arc.to[0], arc.sweep_rad)),
            _ => None,
        });
        let tau = 2.0 * std::f64::consts::PI;
        assert_eq!(turns.collect::<Vec<_>>(), [(true, tau), (true, -tau)], "{text}");
        // Helices in the other planes, which are turned with the system.
        let text = format!(
            "G10 L2 P1 R{angle:.4}\nF100\nG53 G0 X{x:.4} Y{y:.4}\nG18 G3 I{i:.4} K4 Y3 P2\nG19 G2 J{i:.4} K-3 X{x:.4}"
        );
        let program = read(&text);
        let sweeps = program.steps.iter().filter_map(|step| match &step.kind {
            StepKind::Arc(arc) => Some(arc.sweep_rad),
            _ => None,
        });
        assert_eq!(sweeps.collect::<Vec<_>>(), [2.0 * tau, -tau], "{text}");
    }
}

#[test]
fn the_system_in_force_is_no_parameter() {
    assert_eq!(last("G10 L2 P3 X100\n#5220=3\nG56\nG0 X1"), "r 101 0 0");
    assert!(refusal("#5220=2.5").contains("found 2.5 for parameter 5220"));
    assert!(refusal("#5221=[10**8]").contains("for parameter 5221"));
}

#[test]
fn speeds_and_lines_are_bounded() {
    assert!(refusal("G95 S[10**308] F1000").starts_with("a.ngc:1:5: found S"));
    let options = ReadOptions { lines_max: 1000, ..ReadOptions::default() };
    for loops in [
        format!("o1 while [1]\n{}o1 endwhile", "\n".repeat(900)),
        format!("o1 while [1]\no2 if [0]\n{}o2 endif\no1 endwhile", "o2 elseif [0]\n".repeat(900)),
    ] {
        let error = refusal_with(&loops, &options);
        assert!(error.contains("more than 1000 lines executed"), "{error}");
    }
    // As many blocks within each other as it takes to notice that each looks through the others.
    const BLOCKS: usize = 100_000;
    let nested = |open: &str, close: &str| {
        let opened: String = (0..BLOCKS).map(|label| format!("o{label} {open}\n")).collect();
        let closed: String = (0..BLOCKS).rev().map(|label| format!("o{label} {close}\n")).collect();
        opened + "G0 X1\n" + &closed
    };
    assert_eq!(steps(&nested("if [1]", "endif")), ["r 1 0 0"]);
    assert_eq!(steps(&nested("repeat [1]", "endrepeat")), ["r 1 0 0"]);
    assert_eq!(steps(&nested("do", "while [0]")), ["r 1 0 0"]);
    // As many lines behind the end as it takes to notice that each looks through the file.
    let text = format!("M2\n{}O1 garbage", "X1\n".repeat(20_000));
    assert_eq!(steps(&text), ["end"]);
}

/// Spindle and coolant are steps where they change, in the order of LinuxCNC's calls.
#[test]
fn spindle_and_coolant_are_switched_where_they_change() {
    // Not by what changes nothing; at the end off, in this order.
    assert_eq!(
        steps("S500 M5 M9\nM3\nM3 S500\nM7\nS600 M8\nX1 G0 M3\nM30"),
        [
            "m3 500",
            "m3 500 mist",
            "m3 600 mist",
            "m3 600 mist flood",
            "r 1 0 0",
            "mist flood",
            "flood",
            "off",
            "end"
        ]
    );
    // Before the move and the dwell of their line, whatever the order in it; the stop comes last.
    assert_eq!(
        steps("M0 G4 P1 X1 G0 M8 M3 S9\nM5 M9\nM2")[..5],
        ["m3 9", "m3 9 flood", "dwell 1", "r 1 0 0", "stop"]
    );
    // The speed comes first, so that it is one of the direction before.
    assert_eq!(steps("M3 S1\nM4 S2\nM5\nS3\n%"), ["m3 1", "m3 2", "m4 2", "off", "end"]);
    // A stop leaves all on, M6 stops the spindle, even for the tool that is there.
    assert_eq!(
        steps("M3 S1 M8\nM0\nT1 M6\nM3\nM6\nM2"),
        ["m3 1", "m3 1 flood", "stop", "flood", "T1", "m3 1 flood", "flood", "off", "end"]
    );
    // Saved modes.
    assert_eq!(
        steps("M3 S5\nO1 sub\nM73\nM4 S6\nM8\nO1 endsub\nO1 call\nM2"),
        ["m3 5", "m3 6", "m4 6", "m4 6 flood", "m4 5 flood", "m3 5 flood", "m3 5", "off", "end"]
    );
    // A speed of the surface is told as one.
    assert_eq!(steps("G96 S100 M3\nG97 S900\nM2"), ["m3 100 of the surface", "m3 900", "off", "end"]);
    // Without an end, too, in the last line.
    let program = read("M3\nG0 X1\n\n");
    assert_eq!(program.steps.last().map(|step| (step.line, shown(&step.kind))), Some((2, "off".to_owned())));
}

/// Switches between them leave a curve the continuation of the one before.
#[test]
fn a_switch_does_not_end_a_curve() {
    let text = "F9 G5 X1 Y1 I1 J0 P-1 Q0\nM3\nX2 Y0 P-1 Q0\nM2";
    let controls = |text: &str| -> Vec<_> {
        let curve = |kind: &StepKind| match kind {
            StepKind::Cubic(curve) => Some(curve.controls_mm),
            _ => None,
        };
        read(text).steps.iter().filter_map(|step| curve(&step.kind)).collect()
    };
    assert_eq!(controls(text), controls(&text.replace("M3\n", "")));
    assert_eq!(controls(text).len(), 2);
}
