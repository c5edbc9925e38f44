//! `motion`: G-code to motion on simulated ±10 V axes. See [`motion_host::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    motion_host::cli::main()
}
