//! The page in a browser: what it shows is what the run came to, and it answers pointers, wheel and keys.
//!
//! Needs `chromium` and `chromedriver`, the playground also what `host/wasm/build` needs, and one test node; without them a test is
//! listed and ignored with the reason, but fails where `CI=true`. Work is counted, and no clock is read.

#![allow(clippy::disallowed_methods, reason = "what a platform computes is an oracle here")]

mod browser;
mod findings;
mod made_up;
mod playground;
mod panel;
mod report;
#[allow(dead_code, reason = "the suite uses the rest of it")]
#[path = "../cli/workspace.rs"]
mod workspace;

use std::process::ExitCode;

use libtest_mimic::{Arguments, Failed, Trial};

const TESTS: [(&str, fn()); 20] = [
    ("a_long_run_is_told_in_samples", made_up::a_long_run_is_told_in_samples),
    ("pyramids_neither_lose_nor_invent_peaks", made_up::pyramids_neither_lose_nor_invent_peaks),
    ("late_logs_with_gaps_and_rotary_axes_are_shown", made_up::late_logs_with_gaps_and_rotary_axes_are_shown),
    ("figures_are_those_of_the_run", report::figures_are_those_of_the_run),
    ("the_cursor_is_dragged", report::the_cursor_is_dragged),
    ("the_wheel_zooms", report::the_wheel_zooms),
    ("keys_move_cursor_and_window", report::keys_move_cursor_and_window),
    ("colours_are_switched", report::colours_are_switched),
    ("the_path_is_turned_and_pointed_at", report::the_path_is_turned_and_pointed_at),
    ("worst_places_are_visited", report::worst_places_are_visited),
    ("two_runs_lie_beside_each_other", report::two_runs_lie_beside_each_other),
    ("faults_and_commands_are_marked", report::faults_and_commands_are_marked),
    ("a_phone_shows_all_of_it", report::a_phone_shows_all_of_it),
    ("the_cursor_reads_what_was_measured", findings::the_cursor_reads_what_was_measured),
    ("circles_are_looked_into", findings::circles_are_looked_into),
    ("a_refusal_is_red", findings::a_refusal_is_red),
    ("points_are_drawn_beside_their_spline", findings::points_are_drawn_beside_their_spline),
    ("a_program_is_driven_from_the_panel", panel::a_program_is_driven_from_the_panel),
    ("a_key_jogs_while_it_is_down", panel::a_key_jogs_while_it_is_down),
    ("tabs_share_a_machine_and_come_back_to_it", panel::tabs_share_a_machine_and_come_back_to_it),
];

/// Tests that need the module, too.
const OF_MODULE: [(&str, fn()); 10] = [
    ("the_browser_has_the_same_bits", playground::the_browser_has_the_same_bits),
    ("it_runs_what_it_is_given", playground::it_runs_what_it_is_given),
    ("sliders_change_the_machine", playground::sliders_change_the_machine),
    ("files_are_dropped", playground::files_are_dropped),
    ("refusals_are_shown", playground::refusals_are_shown),
    ("a_long_run_is_cancelled", playground::a_long_run_is_cancelled),
    ("drives_are_measured", playground::drives_are_measured),
    ("axes_are_tuned", playground::axes_are_tuned),
    ("a_ramp_is_that_of_profile", playground::a_ramp_is_that_of_profile),
    ("a_phone_shows_the_playground", playground::a_phone_shows_the_playground),
];

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let is_ci = std::env::var("CI").is_ok_and(|value| value == "true");
    let trial = |(name, test): (&'static str, fn()), reason: &Option<String>| {
        let missing = reason.clone();
        let run = move || match missing {
            None => {
                test();
                Ok(())
            }
            Some(reason) => Err(Failed::from(reason)),
        };
        match reason {
            // The kind is what the harness prints next to the name.
            Some(reason) if !is_ci => Trial::test(name, run).with_kind(reason).with_ignored_flag(true),
            _ => Trial::test(name, run),
        }
    };
    let (no_browser, no_module) = (browser::missing(), playground::missing());
    let no_playground = no_browser.clone().or(no_module.clone());
    let no_node = no_module.or_else(playground::node_missing);
    let mut trials: Vec<Trial> = TESTS.into_iter().map(|test| trial(test, &no_browser)).collect();
    trials.extend(OF_MODULE.into_iter().map(|test| trial(test, &no_playground)));
    trials.push(trial(("node_has_the_same_bits", playground::node_has_the_same_bits), &no_node));
    libtest_mimic::run(&arguments, trials).exit_code()
}
