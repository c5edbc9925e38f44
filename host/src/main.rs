//! `motion`: G-code to motion on simulated ±10 V axes. See [`motion_host::cli`].

use std::process::ExitCode;
use std::thread;

/// The streams of nine axes in f64 pass through the stack when they are made, and take some 3 MB there; the main thread of
/// some systems has 1 MB.
const STACK_BYTES: usize = 16 << 20;

fn main() -> ExitCode {
    let main =
        thread::Builder::new().name("main".to_owned()).stack_size(STACK_BYTES).spawn(motion_host::cli::main);
    match main.map(thread::JoinHandle::join) {
        Ok(Ok(code)) => code,
        // It has said why it panicked.
        Ok(Err(_)) => ExitCode::from(101),
        Err(error) => {
            eprintln!(
                "motion: found no thread to run on: {error}, expected one with a stack of {STACK_BYTES} bytes"
            );
            ExitCode::FAILURE
        }
    }
}
