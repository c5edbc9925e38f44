//! Identification of random drives against what they are: `cargo bench -p motion-tests --bench identify -- 0 1000`.
//!
//! The arguments are the first seed and the one after the last; `--threads N` drives at once, 1 without; `--minutes N`
//! after which no further drive is begun. Standard error has a line for each drive as it is done, standard output the
//! tables of `docs/DRIVES.md`, of the drives that were done. Exit status 1: something is wrong with one of them.

use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use motion_host::drive::verification::VERIFIED_HZ;
use motion_tests::drives::{report, surveyed};

/// Drives that may be refused.
const REFUSED_ONE_IN: usize = 20;

struct Arguments {
    seeds: [u64; 2],
    threads: u64,
    minutes: Option<u64>,
}

fn arguments(words: impl Iterator<Item = String>) -> Result<Arguments, String> {
    let number = |word: &str| {
        word.parse().map_err(|_| format!("{word}: expected FIRST END [--threads N] [--minutes N]"))
    };
    // Cargo adds an option of its own.
    let mut words = words.filter(|word| word != "--bench");
    let (mut seeds, mut threads, mut minutes) = (Vec::new(), 1, None);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--threads" => threads = number(&words.next().unwrap_or_default())?,
            "--minutes" => minutes = Some(number(&words.next().unwrap_or_default())?),
            seed => seeds.push(number(seed)?),
        }
    }
    let seeds = match seeds.as_slice() {
        [] => [0, 10],
        &[from, to] => [from, to],
        other => return Err(format!("{} seeds, expected the first and the one after the last", other.len())),
    };
    Ok(Arguments { seeds, threads, minutes })
}

fn main() -> ExitCode {
    let Arguments { seeds: [from, to], threads, minutes } = match arguments(std::env::args().skip(1)) {
        Ok(arguments) => arguments,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    let start = Instant::now();
    let is_over = || minutes.is_some_and(|minutes| start.elapsed() >= Duration::from_secs(60 * minutes));
    let next = AtomicU64::new(from);
    let worker = || {
        let mut done = Vec::new();
        while !is_over() {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= to {
                break;
            }
            let one = surveyed(seed, &VERIFIED_HZ);
            eprintln!("{}", one.words());
            done.push(one);
        }
        done
    };
    let mut all = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect::<Vec<_>>()
    });
    all.sort_by_key(|one| one.axis.seed);
    print!("{}", report(&all));
    let refused = all.iter().filter(|one| one.found.is_err()).count();
    if all.len() < REFUSED_ONE_IN * refused || all.is_empty() {
        eprintln!("{refused} of {} drives refused, expected less than one in {REFUSED_ONE_IN}", all.len());
        return ExitCode::FAILURE;
    }
    let wrong = all.iter().filter(|one| !one.wrong().is_empty()).count();
    if wrong > 0 {
        eprintln!("{wrong} of {} drives: something is wrong", all.len());
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
