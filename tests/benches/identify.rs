//! Identification of random drives against what they are: `cargo bench -p motion-tests --bench identify -- 0 1000`.
//!
//! The arguments are the first seed and the one after the last. It prints the tables of `docs/DRIVES.md`.

use motion_tests::drives::{report, surveyed};

fn main() {
    // Cargo adds an option of its own.
    let seeds: Vec<u64> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let (from, to) = match seeds.as_slice() {
        &[from, to] => (from, to),
        _ => (0, 10),
    };
    let next = std::sync::atomic::AtomicU64::new(from);
    let worker = || {
        let mut done = Vec::new();
        loop {
            let seed = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if seed >= to {
                return done;
            }
            let one = surveyed(seed);
            eprintln!("{}", one.words());
            done.push(one);
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut all = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect::<Vec<_>>()
    });
    all.sort_by_key(|one| one.axis.seed);
    print!("{}", report(&all));
}
