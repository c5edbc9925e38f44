//! Faults of the kernel: each one found in its time and as itself, with its reaction, its latch and a way back; and none
//! where nothing is broken.
//!
//! - `provoked`: one by one on a bench that follows perfectly;
//! - `machine`: the simulated machine with programs of random motion, under live control;
//! - `injected`: everything that can break, at random ticks of random motion;
//! - `reactions`: stops, ramps and what is more urgent;
//! - `calm`: nothing breaks, under noise;
//! - `run`: what a run reports;
//! - `table`: the table in the documents.
//!
//! `MOTION_TEST_SEED` is the first seed; `MOTION_TEST_FAULTS` how often each fault is injected, `MOTION_TEST_TICKS` how many
//! ticks are calm.

mod calm;
mod injected;
mod machine;
mod provoked;
mod reactions;
mod run;
mod table;

/// A number from the environment.
fn setting(name: &str, default: u64) -> u64 {
    let value = motion_tests::from_env(name).unwrap_or(default);
    println!("{name}={value}");
    value
}
