//! The kernel on emulated boards with Cortex-M and RISC-V: the same bits as on a PC, instruction budgets, sizes, and an image
//! that cannot panic; the firmware of the NUCLEO on an emulated board; boards that a PC drives over the link.
//!
//! Needs `qemu-system-arm`, `qemu-system-riscv32` and a compiler that builds for both; without them every test is listed and ignored
//! with the reason, but fails where `CI=true`. Figures are held to committed tables (`tests/expected`); a compiler
//! other than the one they were measured with makes other figures, so outside of CI their tests are then ignored
//! too.
//!
//! ```text
//! cargo test -p motion-tests --test target                       compare
//! MOTION_ACCEPT=1 cargo test -p motion-tests --test target       accept what is measured
//! ```

mod budget;
mod cycles;
mod digest;
mod firmware;
mod firmware_link;
mod functions;
mod image;
mod killed;
mod linked;
mod preempted;
mod programs;
mod runtime;
mod search;
mod tools;

use std::process::ExitCode;
use std::sync::Arc;

use libtest_mimic::{Arguments, Failed, Trial};
use tools::Tools;

type Test = fn(&Tools) -> Result<(), String>;

/// Name, whether it holds figures that depend on the compiler, and the test. The longest first: others run beside it.
const TESTS: [(&str, bool, Test); 20] = [
    ("a_sender_is_killed", false, killed::a_sender_is_killed),
    ("estimated_cycles", true, cycles::estimated_cycles),
    ("the_firmware_runs", false, firmware::the_firmware_runs),
    ("a_pc_drives_the_firmware", false, firmware_link::a_pc_drives_the_firmware),
    ("instructions_of_the_interrupt", true, firmware::instructions_of_the_interrupt),
    ("the_same_bits_on_every_core", false, digest::the_same_bits_on_every_core),
    ("the_same_bits_from_an_interrupt", false, digest::the_same_bits_from_an_interrupt),
    ("the_same_bits_under_live_control", false, digest::the_same_bits_under_live_control),
    (
        "the_same_bits_where_ticks_stop_the_background",
        false,
        preempted::the_same_bits_where_ticks_stop_the_background,
    ),
    ("a_pc_drives_boards_over_the_link", false, linked::a_pc_drives_boards_over_the_link),
    ("one_last_place_is_seen", false, digest::one_last_place_is_seen),
    ("one_last_place_is_seen_under_live_control", false, preempted::one_last_place_is_seen),
    ("nothing_can_panic", false, image::nothing_can_panic),
    ("instructions_of_a_tick", true, budget::instructions_of_a_tick),
    ("the_longest_ticks_and_turns", true, search::the_longest_ticks_and_turns),
    ("instructions_of_functions", true, functions::instructions_of_functions),
    ("the_runtime_is_linked", false, runtime::the_runtime_is_linked),
    ("the_same_sums_and_products", false, runtime::the_same_sums_and_products),
    ("instructions_of_the_runtime", true, runtime::instructions_of_the_runtime),
    ("sizes", true, image::sizes),
];

fn main() -> ExitCode {
    if let Some(code) = killed::as_command() {
        return code;
    }
    let arguments = Arguments::from_args();
    let is_ci = std::env::var("CI").is_ok_and(|value| value == "true");
    let tools = Tools::find().map(Arc::new);
    if let Err(reason) = &tools {
        eprintln!("emulated boards: {reason}");
    }
    let trials = TESTS
        .into_iter()
        .map(|(name, is_of_a_compiler, test)| {
            let reason = match &tools {
                Err(reason) => Some(reason.clone()),
                Ok(tools) if is_of_a_compiler => tools.other_compiler(),
                Ok(_) => None,
            };
            let tools = tools.clone();
            let run = move || match tools {
                Ok(tools) => test(&tools).map_err(Failed::from),
                Err(reason) => Err(Failed::from(reason)),
            };
            match reason {
                // The kind is what the harness prints next to the name.
                Some(reason) if !is_ci => Trial::test(name, run).with_kind(reason).with_ignored_flag(true),
                _ => Trial::test(name, run),
            }
        })
        .collect();
    libtest_mimic::run(&arguments, trials).exit_code()
}
