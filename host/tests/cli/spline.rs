//! `spline`: points to a run, and the experiment on path smoothness.

use serde_json::Value;

use super::workspace::{self, Workspace, assert_has, keys, number};

/// Points of two turns of a curve in space, `count` of them.
fn points(count: u32) -> String {
    let row = |index: u32| {
        let t = f64::from(index) / f64::from(count - 1) * 4.0 * core::f64::consts::PI;
        format!("{:.6},{:.6},{:.6}\n", 20.0 * t.cos() - 20.0, 12.0 * t.sin(), 0.5 * t)
    };
    std::iter::once("x_mm,y_mm,z_mm\n".to_owned()).chain((0..count).map(row)).collect()
}

#[test]
fn spline_runs_points() {
    let workspace = Workspace::new("spline-points");
    workspace.put("points.csv", &points(200));
    let run = workspace.json(&["spline", "points.csv", "--feed", "1500", "--json"]);
    assert_has(&run, &["ticks", "planned_time_s", "path_length_mm", "max", "axes", "faults", "spline"]);
    let spline = &run["spline"];
    assert_eq!(
        keys(spline),
        [
            "degree",
            "deviation_mm",
            "feed_error",
            "jerk_step_mm_s3",
            "length_mm",
            "pieces",
            "points",
            "position_error_mm",
            "spans"
        ]
    );
    assert_eq!((&spline["degree"], &spline["points"]), (&Value::from(5), &Value::from(200)));
    assert!(number(&spline["deviation_mm"]) < 1e-9 && number(&spline["jerk_step_mm_s3"]) < 1e-3);
    assert!(number(&spline["position_error_mm"]) <= 1.25e-6 && number(&spline["feed_error"]) <= 1.25e-6);
    assert!((number(&run["path_length_mm"]) - number(&spline["length_mm"])).abs() < 1e-6);
    assert!((number(&run["max"]["feed_mm_s"]) - 25.0).abs() < 1e-3);
    // Fewer knots within a tolerance, and a jerk that steps with degree 3.
    let near = ["spline", "points.csv", "--tolerance", "0.01", "--degree", "3", "--json"];
    let spline = &workspace.json(&near)["spline"];
    assert!(number(&spline["spans"]) < 100.0 && number(&spline["deviation_mm"]) <= 0.01, "{spline}");
    assert!(number(&spline["jerk_step_mm_s3"]) > 1.0, "{spline}");
    let text = workspace.stdout(&["spline", "points.csv", "--report", "run.html", "--trace", "run.csv"]);
    for words in ["spline of degree 5", "pieces of degree 7", "report written to run.html"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let page = workspace.read("run.html");
    assert!(
        page.contains("Done without a fault")
            && page.contains("spline of degree 5")
            && page.trim_end().ends_with("</html>")
    );
    assert!(workspace.read("run.csv").starts_with("tick,t_s,s_mm,"));
    // The points, and how far the spline is from them.
    let near = [&near[..], &["--report", "near.html"]].concat();
    let spline = &workspace.json(&near)["spline"];
    let figures = workspace.figures("near.html");
    let kinds: Vec<&Value> = figures.iter().map(|figure| &figure["kind"]).collect();
    assert_eq!(kinds, ["plane", "plane", "stack"]);
    assert_eq!(figures[0]["points"]["points"].as_array().map(Vec::len), Some(200));
    assert_eq!(figures[0]["told"][0]["values"][3], 5.0, "the heading is line 1");
    let over_path = workspace::points(&figures[2], 0, "");
    let most_um = over_path.iter().map(|(_, um)| *um).fold(0.0, f64::max);
    assert!((most_um / 1e3 / number(&spline["deviation_mm"]) - 1.0).abs() < 1e-9, "{most_um}");
    let (length_mm, _) = over_path[199];
    assert!((length_mm - number(&spline["length_mm"])).abs() < 1e-9, "{length_mm}");
}

#[test]
fn spline_alone_is_the_experiment() {
    let workspace = Workspace::new("spline-experiment");
    let found = workspace.json(&["spline", "--json"]);
    assert_eq!(keys(&found), ["evaluators", "feed_mm_s", "paths", "tick_s"]);
    let paths = found["paths"].as_array().expect("a list");
    let names: Vec<&Value> = paths.iter().map(|path| &path["name"]).collect();
    assert_eq!(names, ["arcs", "cubic spline", "quintic spline"]);
    assert_has(&paths[0], &["length_mm", "time_s", "ticks", "deviation_mm", "junctions", "by_tick"]);
    assert_eq!(paths[1]["junctions"].as_array().map(Vec::len), Some(8));
    assert!((number(&paths[1]["junctions"][5]["jerk_step_mm_s3"]) - 6268.0).abs() < 0.5);
    assert_eq!(paths[2]["junctions"][0]["published_s"], 0.055);
    let text = workspace.stdout(&["spline", "--report", "page.html", "--trace", "axes.csv"]);
    for words in ["0.278017 s", "-319.225 to -399.031 mm/s²", "78444.3", "up to 3.8 ms", "septic pieces"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let page = workspace.read("page.html");
    assert!(page.matches("data-figure=").count() == 3 && page.trim_end().ends_with("</html>"));
    let figures = workspace.figures("page.html");
    for (figure, path) in figures.iter().zip(paths) {
        let jerks = ["X", "Y"].map(|axis| workspace::points(figure, 2, axis)).concat();
        let most = jerks.iter().map(|(_, jerk)| jerk.abs()).fold(0.0, f64::max);
        let by_tick = path["by_tick"].as_array().expect("a list");
        let of_tick = by_tick.iter().find(|by_tick| by_tick["tick_s"] == found["tick_s"]).expect("the tick");
        assert!((most / number(&of_tick["jerk_max_mm_s3"]) - 1.0).abs() < 1e-12, "{most} {of_tick}");
    }
    let trace = workspace.read("axes.csv");
    let lines: Vec<&str> = trace.lines().collect();
    assert!(
        lines[0].starts_with("tick,t_s,arcs_x_vel_mm_s,arcs_x_acc_mm_s2,arcs_x_jerk_mm_s3,arcs_y_vel_mm_s,")
    );
    assert_eq!(lines.len(), 502);
    let columns = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == columns));
    assert_eq!(workspace.motion(&["spline", "--degree", "3"]).status.code(), Some(2));
}

#[test]
fn spline_names_what_is_wrong_with_its_points() {
    let workspace = Workspace::new("spline-wrong");
    let heading = "x_mm,y_mm,z_mm,u\n";
    let line = "0,0,0,0\n1,1,0,1\n2,0,0,2\n3,1,0,3\n4,0,0,4\n";
    for (text, more, refusal) in [
        (format!("{heading}{line}5,x,0,5\n"), "", "p.csv:7:3: found x, expected a finite number"),
        (
            format!("{heading}{line}5,0,0\n"),
            "",
            "p.csv:7:6: found 3 columns, expected 4 columns, as in the heading",
        ),
        (format!("{heading}{line}"), "", "p.csv: found 5 points, expected at least 6"),
        (
            format!("{heading}{line}4,0,0,5\n"),
            "",
            "p.csv:7: found the point before once more, expected points that differ",
        ),
        (
            format!("{heading}{line}5,0,0,4\n"),
            "",
            "p.csv:7: found u = 4 after 4, expected a finite number above",
        ),
        (
            format!("{heading}{line}5,0,0,5\n"),
            "--feed=-1",
            "found --feed -1, expected a finite feed above 0 mm/min",
        ),
        (
            format!("{heading}{line}5,0,0,5\n"),
            "--tolerance=nan",
            "found --tolerance NaN, expected a finite number of mm that is not below 0",
        ),
        (
            format!("{heading}-1,1,0,-1\n-0.125,0.25,0,-0.5\n0.125,0.25,0,0.5\n1,1,0,1\n"),
            "--degree=3",
            "p.csv:5: found a curve that stands still at 0.5 of its parameter, expected one that moves on everywhere, \
             without a cusp",
        ),
        (format!("{heading}{line}1e7,0,0,5\n"), "", "p.csv:7: found a curve of "),
    ] {
        workspace.put("p.csv", &text);
        let arguments =
            [&["spline", "p.csv"][..], if more.is_empty() { &[] } else { std::slice::from_ref(&more) }];
        let found = workspace.refusal(&arguments.concat());
        assert!(found.starts_with(refusal), "{found}");
    }
    let found = workspace.refusal(&["spline", "missing.csv"]);
    assert!(found.starts_with("missing.csv: found ") && found.contains(", expected"), "{found}");
    let found = workspace.refusal(&["spline", "--report", "no/such/place"]);
    assert!(found.starts_with("no/such/place: found "), "{found}");
}
