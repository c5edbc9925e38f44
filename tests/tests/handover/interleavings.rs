//! The tick as a thread on another core, with loom: what is written is seen late and in any order that the orderings allow.

/// Loom's words.
pub(crate) mod words {
    use std::sync::{Mutex, OnceLock};

    pub(crate) use loom::sync::atomic::Ordering;
    use loom::thread::{ThreadId, current};

    /// Loom can't make words in a constant: this one is made where it is first touched, before the threads begin.
    ///
    /// Each word has one writer. What that one reads is what it wrote last, and loom does not hear of it: loom remembers one
    /// access of a word, so that a read before each write would hide from it that the other thread has read too, and it
    /// would leave out the interleavings in which the write comes first.
    macro_rules! word {
        ($($name:ident: $of:ty),*) => {$(
            #[derive(Debug)]
            pub(crate) struct $name {
                initial: $of,
                word: OnceLock<loom::sync::atomic::$name>,
                written: Mutex<Option<(ThreadId, $of)>>,
            }

            impl $name {
                pub(crate) const fn new(initial: $of) -> Self {
                    Self { initial, word: OnceLock::new(), written: Mutex::new(None) }
                }

                fn word(&self) -> &loom::sync::atomic::$name {
                    self.word.get_or_init(|| loom::sync::atomic::$name::new(self.initial))
                }

                pub(crate) fn load(&self, ordering: Ordering) -> $of {
                    // Loom may go to the other thread in a load: nothing is locked then.
                    let written = *self.written.lock().expect("no panic before");
                    match written {
                        Some((writer, value)) if writer == current().id() => value,
                        _ => self.word().load(ordering),
                    }
                }

                pub(crate) fn store(&self, value: $of, ordering: Ordering) {
                    *self.written.lock().expect("no panic before") = Some((current().id(), value));
                    self.word().store(value, ordering);
                }
            }
        )*};
    }
    word!(AtomicBool: bool, AtomicU8: u8, AtomicU16: u16, AtomicU32: u32, AtomicUsize: usize);
}

/// Runs `model` with so many preemptions at most; without a bound in every interleaving.
pub(crate) fn in_interleavings(preemptions: Option<usize>, model: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.max_branches = 10_000;
    builder.preemption_bound = preemptions;
    builder.check(model);
}
