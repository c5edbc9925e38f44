//! What benchmarks are asked for.

/// The arguments that are no options; none where nothing is to be measured: whoever builds all targets and runs them
/// wants to see that they run, not to wait for figures.
#[must_use]
pub fn asked() -> Option<Vec<String>> {
    let (options, asked): (Vec<_>, Vec<_>) =
        std::env::args().skip(1).partition(|argument| argument.starts_with("--"));
    options.iter().any(|option| option == "--bench").then_some(asked)
}
