//! What a page calls: a request in, steps of work, an answer out ([`motion_host::playground`]).
//!
//! The module imports nothing. It gives out places in its memory, which the page reads and writes:
//!
//! ```text
//! request(length) ─► a place for the request, which the page writes there
//! begin()            takes it
//! advance() ─► 1     more to do, stage() and part() say how far it is
//!           └► 0     the answer is at answer(), of answer_length() bytes
//! ```
//!
//! A panic ends the module; what it said is at `panicked()`, of `panicked_length()` bytes. A browser has no file, no thread and no
//! clock for it, and it looks for none.

use std::cell::RefCell;
use std::panic;
use std::sync::OnceLock;

use motion_host::playground::{Progress, Stage, Task};

/// What is under way: a page asks for one thing after the other.
struct Desk {
    request: Vec<u8>,
    task: Option<Task>,
}

thread_local! {
    static DESK: RefCell<Desk> = const { RefCell::new(Desk { request: Vec::new(), task: None }) };
}
static PANICKED: OnceLock<String> = OnceLock::new();

fn at_desk<T>(work: impl FnOnce(&mut Desk) -> T) -> T {
    DESK.with_borrow_mut(work)
}

// SAFETY of all names below: nothing else that is linked has them, and each does what this crate's documentation says. No pointer
// is read here.

/// Makes room for a request of so many bytes, and says where.
#[unsafe(no_mangle)]
pub extern "C" fn request(length: usize) -> *mut u8 {
    at_desk(|desk| {
        desk.request = vec![0; length];
        desk.request.as_mut_ptr()
    })
}

/// Takes the request.
#[unsafe(no_mangle)]
pub extern "C" fn begin() {
    panic::set_hook(Box::new(|info| {
        // The first one is the cause.
        let _ = PANICKED.set(info.to_string());
    }));
    at_desk(|desk| {
        let request = std::mem::take(&mut desk.request);
        // The answer before goes first.
        desk.task = None;
        desk.task = Some(Task::new(&request));
    });
}

/// Does a part of the work: 1 if there is more to do, 0 if the answer is there.
#[unsafe(no_mangle)]
pub extern "C" fn advance() -> u32 {
    u32::from(at_desk(|desk| desk.task.as_mut().is_some_and(Task::advance)))
}

fn progress() -> Progress {
    at_desk(|desk| desk.task.as_ref().map(Task::progress).unwrap_or_default())
}

/// What is done: 0 reading, 1 planning, 2 running, 3 writing the answer.
#[unsafe(no_mangle)]
pub extern "C" fn stage() -> u32 {
    match progress().stage {
        Stage::Reading => 0,
        Stage::Planning => 1,
        Stage::Running => 2,
        Stage::Writing => 3,
    }
}

/// How much of it is done, 0 to 1.
#[unsafe(no_mangle)]
pub extern "C" fn part() -> f64 {
    progress().part
}

/// Where the answer is.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    at_desk(|desk| desk.task.as_ref().map_or(std::ptr::null(), |task| task.answer().as_ptr()))
}

/// How long it is.
#[unsafe(no_mangle)]
pub extern "C" fn answer_length() -> usize {
    at_desk(|desk| desk.task.as_ref().map_or(0, |task| task.answer().len()))
}

/// Where the words of a panic are.
#[unsafe(no_mangle)]
pub extern "C" fn panicked() -> *const u8 {
    PANICKED.get().map_or(std::ptr::null(), |words| words.as_ptr())
}

/// How long they are.
#[unsafe(no_mangle)]
pub extern "C" fn panicked_length() -> usize {
    PANICKED.get().map_or(0, String::len)
}
