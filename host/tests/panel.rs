//! The desk of a panel, with a board that notes what it is told.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use motion_host::board::BoardError;
use motion_host::board::interface::{Board, BoardAxis, BoardEvent, BoardInfo, BoardState, UnderWay};
use motion_host::board::items::Source;
use motion_host::board::trigger::Condition;
use motion_host::gcode::{AXES_MAX, ReadOptions};
use motion_host::panel::desk::{Desk, KEY_SILENCE, Order, Tab};
use motion_host::panel::message::{Command, Said};
use motion_host::simulate::jog::Press;
use motion_host::trace::RunTrace;
use serde_json::Value;

use crate::board::LONGEST;

/// What a board was told, and what it is to tell.
#[derive(Clone, Default)]
struct Noted {
    calls: Arc<Mutex<Vec<String>>>,
    events: Arc<Mutex<Vec<BoardEvent>>>,
}

impl Noted {
    fn note(&self, call: impl Into<String>) {
        self.calls.lock().expect("alive").push(call.into());
    }

    fn calls(&self) -> Vec<String> {
        self.calls.lock().expect("alive").clone()
    }

    /// Until this was called so often.
    fn wait_for(&self, call: &str, count: usize) {
        let begin = Instant::now();
        while self.calls().iter().filter(|made| *made == call).count() < count {
            assert!(begin.elapsed() < LONGEST, "{call}: {:?}", self.calls());
            thread::sleep(Duration::from_millis(2));
        }
    }
}

struct Noting {
    noted: Noted,
    info: BoardInfo,
    under_way: UnderWay,
}

impl Board for Noting {
    fn info(&self) -> &BoardInfo {
        &self.info
    }

    fn state(&self) -> BoardState {
        BoardState { under_way: self.under_way, ..BoardState::default() }
    }

    fn step(&mut self, wait: Duration) -> Vec<BoardEvent> {
        thread::sleep(wait);
        std::mem::take(&mut *self.noted.events.lock().expect("alive"))
    }

    fn is_settled(&self) -> bool {
        true
    }

    fn load(&mut self, source: Source) -> Result<(), BoardError> {
        self.noted.note(format!("load {}", source.name));
        Ok(())
    }

    fn start(&mut self) -> Result<(), BoardError> {
        self.noted.note("start");
        Err(BoardError::NoProgram)
    }

    fn hold(&mut self) {
        self.noted.note("hold");
    }

    fn resume(&mut self) -> Result<(), BoardError> {
        self.noted.note("resume");
        Ok(())
    }

    fn abort(&mut self) {
        self.noted.note("abort");
    }

    fn set_override(&mut self, permille: u16) -> Result<(), BoardError> {
        self.noted.note(format!("override {permille}"));
        Ok(())
    }

    fn set_single_block(&mut self, is_on: bool) {
        self.noted.note(format!("single block {is_on}"));
    }

    fn set_drives(&mut self, are_on: bool) -> Result<(), BoardError> {
        self.noted.note(format!("drives {are_on}"));
        Ok(())
    }

    fn clear_fault(&mut self) {
        self.noted.note("clear fault");
    }

    fn press_key(&mut self, press: &Press, feed_mm_s: Option<f64>) -> Result<(), BoardError> {
        self.noted.note(format!("press {press} {feed_mm_s:?}"));
        self.under_way = UnderWay::Jog;
        Ok(())
    }

    fn release_key(&mut self) {
        self.noted.note("release");
        self.under_way = UnderWay::Nothing;
    }

    fn home(&mut self, axes: &[String]) -> Result<(), BoardError> {
        self.noted.note(format!("home {axes:?}"));
        Ok(())
    }

    fn watch_ticks(&mut self) -> Result<(), BoardError> {
        Ok(())
    }

    fn capture(&mut self, trigger: Option<Condition>, before: usize, after: usize) -> Result<(), BoardError> {
        self.noted.note(format!("capture {} {before} {after}", trigger.is_some()));
        Ok(())
    }

    fn take_capture(&mut self) -> Option<RunTrace<AXES_MAX>> {
        None
    }
}

fn desk() -> (Desk, Noted) {
    let noted = Noted::default();
    let axis =
        BoardAxis { name: "X".to_owned(), unit: "mm", travel_mm: None, feed_mm_s: 300.0, has_homing: true };
    let info = BoardInfo {
        machine: "noting".to_owned(),
        port: "nowhere".to_owned(),
        tick_s: 5e-4,
        is_fixed_point: false,
        axes: vec![axis],
    };
    let board = Noting { noted: noted.clone(), info, under_way: UnderWay::Nothing };
    let desk =
        Desk::start(Box::new(board), ReadOptions::default(), Arc::new(|_| Err("no picture".to_owned())));
    (desk, noted)
}

struct Seat {
    tab: Tab,
    orders: Sender<Order>,
    told: Receiver<Value>,
}

impl Seat {
    fn take(desk: &Desk, tab: Tab) -> Self {
        let (to, told) = channel();
        let listener =
            Box::new(move |text: &str, _| to.send(serde_json::from_str(text).expect("JSON")).is_ok());
        let orders = desk.orders();
        orders.send(Order::Joined(tab, listener)).expect("a desk");
        Self { tab, orders, told }
    }

    /// Says a command, at the state that was told last.
    fn say(&self, command: &str) {
        let mut heard = None;
        while heard.is_none() {
            // At least one is told a second.
            heard = self.hears("state")["number"].as_u64();
        }
        self.say_at(heard.unwrap_or(0), command);
    }

    fn say_at(&self, heard: u64, command: &str) {
        let command: Command = serde_json::from_str(command).expect(command);
        self.orders.send(Order::Command(self.tab, Said { heard, command })).expect("a desk");
    }

    /// The next message of a type.
    fn hears(&self, of: &str) -> Value {
        loop {
            let told = self.told.recv_timeout(LONGEST).expect(of);
            if told["type"] == of {
                return told;
            }
        }
    }

    /// Until the state is told with this commander.
    fn hears_commander(&self, who: &str) {
        while self.hears("state")["commander"] != who {}
    }
}

#[test]
fn one_tab_commands_and_any_may_stop() {
    let (desk, noted) = desk();
    let (first, second) = (Seat::take(&desk, 1), Seat::take(&desk, 2));
    assert_eq!(first.hears("board")["board"]["axes"][0]["name"], "X");
    first.hears_commander("nobody");
    // Whoever commands first.
    first.say(r#"{"do": "override", "permille": 900}"#);
    noted.wait_for("override 900", 1);
    first.say(r#"{"do": "home"}"#);
    noted.wait_for("home []", 1);
    first.say(r#"{"do": "home", "axis": "X"}"#);
    noted.wait_for("home [\"X\"]", 1);
    second.say(r#"{"do": "override", "permille": 100}"#);
    let refused = second.hears("refused");
    assert!(refused["text"].as_str().is_some_and(|text| text.starts_with("another tab")), "{refused}");
    for (command, call) in [
        (r#"{"do": "hold"}"#, "hold"),
        (r#"{"do": "abort"}"#, "abort"),
        (r#"{"do": "drives", "are_on": false}"#, "drives false"),
    ] {
        second.say(command);
        noted.wait_for(call, 1);
    }
    for command in [r#"{"do": "drives", "are_on": true}"#, r#"{"do": "home"}"#] {
        second.say(command);
        second.hears("refused");
    }
    second.say(r#"{"do": "take"}"#);
    second.hears_commander("you");
    first.hears_commander("another");
    first.say(r#"{"do": "resume"}"#);
    first.hears("refused");
    second.say(r#"{"do": "start"}"#);
    assert_eq!(second.hears("refused")["text"], BoardError::NoProgram.to_string());
    let calls = noted.calls();
    assert!(!calls.contains(&"override 100".to_owned()), "{calls:?}");
    assert!(!calls.contains(&"drives true".to_owned()) && !calls.contains(&"resume".to_owned()), "{calls:?}");
    // The one that commands has gone.
    second.orders.send(Order::Left(2)).expect("a desk");
    first.hears_commander("nobody");
    first.say(r#"{"do": "resume"}"#);
    noted.wait_for("resume", 1);
    // All that is left is a hold.
    desk.end();
    assert_eq!(noted.calls().last().map(String::as_str), Some("hold"));
}

#[test]
fn a_key_is_released_with_its_tab_its_silence_or_another_commander() {
    let (desk, noted) = desk();
    let (first, second) = (Seat::take(&desk, 1), Seat::take(&desk, 2));
    let press = r#"{"do": "press", "key": "X+5", "feed_mm_s": 20, "is_held": true}"#;
    first.say(press);
    noted.wait_for("press X+5 Some(20.0)", 1);
    // Nothing is heard of it.
    let begin = Instant::now();
    noted.wait_for("release", 1);
    assert!(begin.elapsed() > KEY_SILENCE / 2);
    first.say(press);
    noted.wait_for("press X+5 Some(20.0)", 2);
    first.say(r#"{"do": "release"}"#);
    noted.wait_for("release", 2);
    first.say(press);
    second.say(r#"{"do": "take"}"#);
    noted.wait_for("release", 3);
    second.say(press);
    noted.wait_for("press X+5 Some(20.0)", 4);
    second.orders.send(Order::Left(2)).expect("a desk");
    noted.wait_for("release", 4);
    // One that goes its distance is not silent: it is released by nobody.
    first.say(r#"{"do": "press", "key": "X-1", "feed_mm_s": null, "is_held": false}"#);
    noted.wait_for("press X-1 None", 1);
    thread::sleep(KEY_SILENCE + KEY_SILENCE / 2);
    assert_eq!(noted.calls().iter().filter(|call| *call == "release").count(), 4);
    first.say(r#"{"do": "press", "key": "X", "feed_mm_s": null, "is_held": false}"#);
    assert!(first.hears("refused")["text"].as_str().is_some_and(|text| text.starts_with("found `X`")));
}

/// A program goes to all tabs, also to those that come later; one that takes nothing holds nothing up.
#[test]
fn all_tabs_see_the_same() {
    let (desk, noted) = desk();
    let first = Seat::take(&desk, 1);
    let deaf = Arc::new(AtomicUsize::new(0));
    let asked = Arc::clone(&deaf);
    let listener = Box::new(move |_: &str, _| {
        asked.fetch_add(1, Ordering::Relaxed);
        false
    });
    first.orders.send(Order::Joined(2, listener)).expect("a desk");
    first.say(r#"{"do": "load", "name": "a.ngc", "text": "G1 X1 F100"}"#);
    noted.wait_for("load a.ngc", 1);
    noted
        .events
        .lock()
        .expect("alive")
        .push(BoardEvent::Loaded(vec!["a remark".to_owned(), "another".to_owned()]));
    assert_eq!(first.hears("program")["name"], "a.ngc");
    // In one message, however many they are.
    assert_eq!(first.hears("event")["text"], "a remark; another");
    // It has gone with the first thing that it needed and did not take.
    assert_eq!(deaf.load(Ordering::Relaxed), 1);
    let third = Seat::take(&desk, 3);
    assert_eq!(third.hears("program")["name"], "a.ngc");
    noted.events.lock().expect("alive").push(BoardEvent::Stopped("change to tool 3".to_owned()));
    for seat in [&first, &third] {
        loop {
            let event = seat.hears("event");
            if event["text"] == "change to tool 3" {
                break;
            }
        }
    }
    // One that is refused leaves no program behind.
    third.say(r#"{"do": "take"}"#);
    third.say(r#"{"do": "load", "name": "b.ngc", "text": "G1 Q"}"#);
    noted.wait_for("load b.ngc", 1);
    let error = BoardError::Program("b.ngc:1: no".into());
    noted.events.lock().expect("alive").push(BoardEvent::NotLoaded(error));
    assert_eq!(third.hears("event")["is_failure"], true);
    let fourth = Seat::take(&desk, 4);
    fourth.hears_commander("another");
    assert!(fourth.told.try_iter().all(|told| told["type"] != "program"));
}

/// A held key stays held as long as its tab says so; what is said of a key that another tab has taken away is not refused.
#[test]
fn a_key_is_held_while_its_tab_says_so() {
    let (desk, noted) = desk();
    let (first, second) = (Seat::take(&desk, 1), Seat::take(&desk, 2));
    let press = r#"{"do": "press", "key": "Y+5", "feed_mm_s": null, "is_held": true}"#;
    let keep = r#"{"do": "keep"}"#;
    first.say(press);
    noted.wait_for("press Y+5 None", 1);
    let (begin, mut last, mut longest) = (Instant::now(), Instant::now(), Duration::ZERO);
    while begin.elapsed() < 4 * KEY_SILENCE {
        first.say_at(0, keep);
        longest = longest.max(last.elapsed());
        last = Instant::now();
        thread::sleep(KEY_SILENCE / 10);
    }
    let is_released = noted.calls().iter().any(|call| call == "release");
    // Unless this test itself was not running.
    assert!(!is_released || longest > KEY_SILENCE / 2, "{longest:?}");
    second.say(r#"{"do": "take"}"#);
    second.hears_commander("you");
    first.say_at(0, keep);
    first.say(press);
    // The press is refused, and nothing before it was.
    let refused = first.hears("refused");
    assert!(refused["text"].as_str().is_some_and(|text| text.starts_with("another tab")));
    assert!(first.told.try_iter().all(|told| told["type"] != "refused"));
}

/// What may move the machine comes in time or not at all.
#[test]
fn a_command_that_comes_late_moves_nothing() {
    let (desk, noted) = desk();
    let seat = Seat::take(&desk, 1);
    let old = seat.hears("state")["number"].as_u64().expect("a number");
    thread::sleep(Duration::from_millis(2600));
    for command in [
        r#"{"do": "start"}"#,
        r#"{"do": "resume"}"#,
        r#"{"do": "drives", "are_on": true}"#,
        r#"{"do": "press", "key": "X+1", "feed_mm_s": null, "is_held": false}"#,
    ] {
        for heard in [old, 0, u64::MAX] {
            seat.say_at(heard, command);
            let refused = seat.hears("refused");
            assert!(refused["text"].as_str().is_some_and(|text| text.contains("too late")), "{refused}");
        }
    }
    assert!(noted.calls().is_empty(), "{:?}", noted.calls());
    // Stops are never too late.
    seat.say_at(old, r#"{"do": "hold"}"#);
    noted.wait_for("hold", 1);
    seat.say(r#"{"do": "resume"}"#);
    noted.wait_for("resume", 1);
}
