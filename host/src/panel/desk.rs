//! The one thread that has the board.
//!
//! Consumes the tabs' commands and what the board tells; produces what every tab is told. Tabs that do not listen are left out:
//! the board waits for none.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::message::{Command, Commander, PictureOf, Said, Told};
use crate::board::BoardError;
use crate::board::interface::{Board, BoardEvent, BoardState, UnderWay};
use crate::board::items::Source;
use crate::board::trigger::Condition;
use crate::gcode::ReadOptions;
use crate::report::PageRun;
use crate::simulate::jog::Press;

/// A jog key that is held is released where its tab has not said [`Command::Keep`] for this time.
pub const KEY_SILENCE: Duration = Duration::from_millis(400);
/// Between two looks at board and commands.
const STEP: Duration = Duration::from_millis(4);
/// The longest time for a board to confirm the last hold.
const FAREWELL: Duration = Duration::from_secs(1);
/// A command that may move something is refused where the tab has heard no state for this time: what it sees is over.
const STALE: Duration = Duration::from_millis(2500);
/// Orders that are obeyed between two steps of the board.
const ORDERS: usize = 64;
/// Between two tellings of the state.
const STATE_EVERY: Duration = Duration::from_millis(40);

/// A tab, by number.
pub type Tab = u64;

/// What the desk is asked for.
pub enum Order {
    /// A tab is there, and listens.
    Joined(Tab, Listener),
    /// It has gone.
    Left(Tab),
    /// It commands.
    Command(Tab, Said),
    /// The panel ends: the machine is held.
    End,
}

/// Hands a text to a tab; false if the tab does not take it. What is not `is_needed` may be left out.
pub type Listener = Box<dyn FnMut(&str, bool) -> bool + Send>;

/// The last pictures, for tabs to fetch.
#[derive(Clone, Default)]
pub struct Pictures(Arc<Mutex<BTreeMap<u64, Arc<PageRun>>>>);

/// So many pictures are kept: tabs fetch one when they hear of it.
const PICTURES: usize = 4;

impl Pictures {
    /// The picture of a number, if it is kept.
    #[must_use]
    pub fn get(&self, number: u64) -> Option<Arc<PageRun>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(&number).cloned()
    }

    fn put(&self, number: u64, picture: PageRun) {
        let mut pictures = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        pictures.insert(number, Arc::new(picture));
        while pictures.len() > PICTURES {
            pictures.pop_first();
        }
    }
}

/// Makes the picture of a program as it would be driven, or says why not.
pub type MakePicture = Arc<dyn Fn(&Source) -> Result<PageRun, String> + Send + Sync>;

/// Places of pictures, by what they are of.
const PROGRAM: usize = PictureOf::Program as usize;
const TICKS: usize = PictureOf::Capture as usize;

/// The desk.
pub struct Desk {
    orders: Sender<Order>,
    pictures: Pictures,
    thread: JoinHandle<()>,
}

impl Desk {
    /// Takes the board into a thread. Programs are read with `options`.
    #[must_use]
    pub fn start(board: Box<dyn Board>, options: ReadOptions, make_picture: MakePicture) -> Self {
        let (orders, asked) = channel();
        let pictures = Pictures::default();
        let kept = pictures.clone();
        let thread = thread::Builder::new()
            .name("desk".to_owned())
            .spawn(move || Session::new(board, options, make_picture, kept).run(&asked))
            .expect("a system that has threads");
        Self { orders, pictures, thread }
    }

    /// Holds the machine, waits until the board has heard of it, and ends.
    pub fn end(self) {
        // A thread that has panicked has said so.
        let _ = self.orders.send(Order::End);
        let _ = self.thread.join();
    }

    /// Whether it has ended, which without [`Self::end`] only a panic is.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Where orders are given. The desk ends when nobody can give any.
    #[must_use]
    pub fn orders(&self) -> Sender<Order> {
        self.orders.clone()
    }

    /// The pictures that tabs hear of.
    #[must_use]
    pub fn pictures(&self) -> Pictures {
        self.pictures.clone()
    }
}

/// The board, and everybody who looks at it.
struct Session {
    board: Box<dyn Board>,
    options: ReadOptions,
    make_picture: MakePicture,
    pictures: Pictures,
    tabs: BTreeMap<Tab, Listener>,
    commander: Option<Tab>,
    /// When the tab said last that its key is held.
    key: Option<Instant>,
    /// The program that was asked for last.
    asked: Option<Arc<Source>>,
    /// The one that is loaded.
    loaded: Option<Arc<Source>>,
    /// Pictures on their way, of the program and of ticks; one of each at a time.
    drawing: [Option<Drawing>; 2],
    /// The program whose picture comes next.
    to_draw: Option<Arc<Source>>,
    /// The last pictures.
    shown: [Option<u64>; 2],
    pictures_made: u64,
    /// States that were told, and when the latest of them were.
    states: u64,
    told: VecDeque<(u64, Instant)>,
}

/// A picture on its way.
struct Drawing {
    /// Of this program.
    of: Option<Arc<Source>>,
    picture: Receiver<Result<PageRun, String>>,
}

impl Session {
    fn new(
        board: Box<dyn Board>,
        options: ReadOptions,
        make_picture: MakePicture,
        pictures: Pictures,
    ) -> Self {
        Self {
            board,
            options,
            make_picture,
            pictures,
            tabs: BTreeMap::new(),
            commander: None,
            key: None,
            asked: None,
            loaded: None,
            drawing: [None, None],
            to_draw: None,
            shown: [None, None],
            pictures_made: 0,
            states: 0,
            told: VecDeque::new(),
        }
    }

    fn run(mut self, orders: &Receiver<Order>) {
        let (mut told, mut last) = (Instant::now(), None);
        loop {
            for event in self.board.step(STEP) {
                self.happened(event);
            }
            for _ in 0..ORDERS {
                match orders.try_recv() {
                    Ok(Order::End) | Err(TryRecvError::Disconnected) => return self.end(),
                    Ok(order) => self.obey(order),
                    Err(TryRecvError::Empty) => break,
                }
            }
            if self.key.is_some_and(|kept| kept.elapsed() > KEY_SILENCE) {
                self.release();
            }
            self.take_pictures();
            if told.elapsed() >= STATE_EVERY {
                told = Instant::now();
                let state = self.board.state();
                // A machine at rest is told less often: once a second a tab hears that it is still there.
                let is_new = last.as_ref().is_none_or(|(last, at): &(BoardState, Instant)| {
                    BoardState { tick: state.tick, ..last.clone() } != state || at.elapsed().as_secs() >= 1
                });
                if is_new {
                    self.tell_state(&state);
                    last = Some((state, Instant::now()));
                }
            }
        }
    }

    /// Until the board has heard of the hold, or does not answer.
    fn end(mut self) {
        self.release();
        self.board.hold();
        let begin = Instant::now();
        while begin.elapsed() < FAREWELL && !self.board.is_settled() {
            self.board.step(STEP);
        }
    }

    fn obey(&mut self, order: Order) {
        match order {
            // The loop ends with it.
            Order::End => {}
            Order::Joined(tab, listener) => {
                self.tabs.insert(tab, listener);
                self.welcome(tab);
            }
            Order::Left(tab) => self.leave(tab),
            Order::Command(tab, said) => {
                if let Err(refused) = self.command(tab, said) {
                    self.tell(tab, &Told::Refused { text: &refused });
                }
            }
        }
    }

    /// All that a tab has missed.
    fn welcome(&mut self, tab: Tab) {
        let info = self.board.info().clone();
        self.tell(tab, &Told::Board { board: &info });
        if let Some(source) = self.loaded.clone() {
            self.tell(tab, &Told::Program { name: &source.name });
        }
        for (of, number) in [PictureOf::Program, PictureOf::Capture].into_iter().zip(self.shown) {
            if let Some(number) = number {
                self.tell(tab, &Told::Picture { of, number });
            }
        }
        let state = self.board.state();
        self.tell_state(&state);
    }

    fn leave(&mut self, tab: Tab) {
        self.tabs.remove(&tab);
        if self.commander == Some(tab) {
            self.commander = None;
            self.release();
        }
    }

    fn release(&mut self) {
        self.key = None;
        self.board.release_key();
    }

    fn command(&mut self, tab: Tab, Said { heard, command }: Said) -> Result<(), String> {
        if !command.is_for_all() && *self.commander.get_or_insert(tab) != tab {
            return Err("another tab commands; take the command first".to_owned());
        }
        if command.may_move() && self.is_stale(heard) {
            return Err("the command came too late: look at the machine, and give it again".to_owned());
        }
        match command {
            Command::Take => {
                if self.commander != Some(tab) {
                    // The key is in the hand of the other tab.
                    self.release();
                }
                self.commander = Some(tab);
                let state = self.board.state();
                self.tell_state(&state);
            }
            Command::Load { name, text } => {
                let source = Source {
                    name,
                    text: text.into_bytes(),
                    options: self.options.clone(),
                    leaves_out_outputs: false,
                };
                self.board.load(source.clone()).map_err(|error| words(&error))?;
                (self.asked, self.loaded, self.to_draw) = (Some(Arc::new(source)), None, None);
                self.shown[PROGRAM] = None;
            }
            Command::Start => self.board.start().map_err(|error| words(&error))?,
            Command::Hold => self.board.hold(),
            Command::Resume => self.board.resume().map_err(|error| words(&error))?,
            Command::Abort => self.board.abort(),
            Command::Override { permille } => {
                self.board.set_override(permille).map_err(|error| words(&error))?
            }
            Command::SingleBlock { is_on } => self.board.set_single_block(is_on),
            Command::Drives { are_on } => self.board.set_drives(are_on).map_err(|error| words(&error))?,
            Command::ClearFault => self.board.clear_fault(),
            Command::Press { key, feed_mm_s, is_held } => {
                let press: Press = key.parse().map_err(|error| format!("{error}"))?;
                self.board.press_key(&press, feed_mm_s).map_err(|error| words(&error))?;
                self.key = is_held.then(Instant::now);
            }
            Command::Home { axis } => {
                self.board.home(axis.as_slice()).map_err(|error| words(&error))?;
            }
            Command::Keep => {
                if let Some(kept) = &mut self.key {
                    *kept = Instant::now();
                }
            }
            Command::Release => self.release(),
            Command::Capture { trigger, before, after } => {
                let trigger = trigger.map(|text| text.parse::<Condition>()).transpose()?;
                self.board.capture(trigger, before, after).map_err(|error| words(&error))?;
            }
        }
        Ok(())
    }

    fn happened(&mut self, event: BoardEvent) {
        let what = |under_way: UnderWay| match under_way {
            UnderWay::Jog => "jog",
            UnderWay::Homing => "homing",
            UnderWay::Program | UnderWay::Nothing => "program",
        };
        let (text, is_failure) = match event {
            BoardEvent::Lost(cause) => {
                (format!("lost the board: {cause}; it comes to rest on the path"), true)
            }
            BoardEvent::Back => ("the board is back, and is held".to_owned(), false),
            BoardEvent::Replaced => (
                "somebody else has asked the board since: start this panel anew to command it".to_owned(),
                true,
            ),
            BoardEvent::Restarted => ("the board has started anew".to_owned(), true),
            BoardEvent::Loaded(notes) => {
                self.loaded = self.asked.take();
                if let Some(source) = self.loaded.clone() {
                    self.tell_all(&Told::Program { name: &source.name }, true);
                    self.to_draw = Some(source);
                }
                if notes.is_empty() {
                    return;
                }
                // One message: tabs have room for some.
                (notes.join("; "), false)
            }
            BoardEvent::NotLoaded(error) => {
                self.asked = None;
                (words(&error), true)
            }
            BoardEvent::Stopped(text) => (text, false),
            BoardEvent::Done(UnderWay::Program) => ("the program is done".to_owned(), false),
            BoardEvent::Aborted(UnderWay::Program) => ("aborted: the rest is given up".to_owned(), false),
            BoardEvent::Done(UnderWay::Homing) => ("homed".to_owned(), false),
            BoardEvent::Aborted(UnderWay::Homing) => ("homing was given up".to_owned(), false),
            // A key that is released is nothing to tell.
            BoardEvent::Done(_) | BoardEvent::Aborted(_) => {
                self.key = None;
                return;
            }
            BoardEvent::Failed(under_way, error) => {
                self.key = None;
                (format!("{}: {}", what(under_way), words(&error)), true)
            }
            BoardEvent::Captured { missing } => {
                let Some(trace) = self.board.take_capture() else { return };
                let count = trace.ticks.len();
                self.drawing[TICKS] =
                    Some(draw(None, move || PageRun::of(&trace).map_err(|error| error.to_string())));
                let missing =
                    if missing > 0 { format!("; {missing} in between are missing") } else { String::new() };
                (format!("captured {count} ticks{missing}"), missing.is_empty())
            }
            BoardEvent::ScopeFailed(error) => (format!("scope: {error}"), true),
        };
        self.tell_all(&Told::Event { text: &text, is_failure }, true);
    }

    /// Shows what is drawn, and begins with the next program.
    fn take_pictures(&mut self) {
        for of in [PictureOf::Program, PictureOf::Capture] {
            let Some(drawing) = &self.drawing[of as usize] else { continue };
            let picture = match drawing.picture.try_recv() {
                Ok(picture) => picture,
                Err(TryRecvError::Empty) => continue,
                Err(TryRecvError::Disconnected) => Err("a picture is not there".to_owned()),
            };
            // Of another program than the one that is loaded now, nobody wants it.
            let is_wanted = match (&drawing.of, &self.loaded) {
                (Some(of), Some(loaded)) => Arc::ptr_eq(of, loaded),
                (Some(_), None) => false,
                (None, _) => true,
            };
            self.drawing[of as usize] = None;
            match picture {
                Ok(picture) if is_wanted => self.show(of, picture),
                Err(text) if is_wanted => {
                    self.tell_all(&Told::Event { text: &text, is_failure: false }, true)
                }
                _ => {}
            }
        }
        if self.drawing[PROGRAM].is_none()
            && let Some(source) = self.to_draw.take()
        {
            let (make, of) = (Arc::clone(&self.make_picture), Arc::clone(&source));
            self.drawing[PROGRAM] = Some(draw(Some(of), move || make(&source)));
        }
    }

    fn show(&mut self, of: PictureOf, picture: PageRun) {
        self.pictures_made += 1;
        let number = self.pictures_made;
        self.pictures.put(number, picture);
        self.shown[of as usize] = Some(number);
        self.tell_all(&Told::Picture { of, number }, true);
    }

    /// Whether the state of this number is over.
    fn is_stale(&self, heard: u64) -> bool {
        let told = self.told.iter().find(|(number, _)| *number == heard);
        told.is_none_or(|(_, at)| at.elapsed() > STALE)
    }

    fn tell_state(&mut self, state: &BoardState) {
        let commander = self.commander;
        self.states += 1;
        let number = self.states;
        self.told.push_back((number, Instant::now()));
        while self.told.front().is_some_and(|(_, at)| at.elapsed() > 2 * STALE) {
            self.told.pop_front();
        }
        self.say(&mut |tab| {
            let commander = match commander {
                Some(other) if other == tab => Commander::You,
                Some(_) => Commander::Another,
                None => Commander::Nobody,
            };
            (to_text(&Told::State { number, state, commander }), false)
        });
    }

    fn tell_all(&mut self, told: &Told<'_>, is_needed: bool) {
        let text = to_text(told);
        self.say(&mut |_| (text.clone(), is_needed));
    }

    /// Says a text to every tab. One that does not take what it needs has gone.
    fn say(&mut self, text_for: &mut dyn FnMut(Tab) -> (String, bool)) {
        let mut gone = Vec::new();
        for (&tab, listener) in &mut self.tabs {
            let (text, is_needed) = text_for(tab);
            if !listener(&text, is_needed) && is_needed {
                gone.push(tab);
            }
        }
        gone.into_iter().for_each(|tab| self.leave(tab));
    }

    fn tell(&mut self, tab: Tab, told: &Told<'_>) {
        let is_taken = self.tabs.get_mut(&tab).is_none_or(|listener| listener(&to_text(told), true));
        if !is_taken {
            self.leave(tab);
        }
    }
}

fn to_text(told: &Told<'_>) -> String {
    serde_json::to_string(told).expect("texts and numbers")
}

/// Draws a picture beside everything else.
fn draw(of: Option<Arc<Source>>, make: impl FnOnce() -> Result<PageRun, String> + Send + 'static) -> Drawing {
    let (to, picture) = channel();
    thread::spawn(move || {
        // Nobody waits for it where the desk has ended.
        let _ = to.send(make());
    });
    Drawing { of, picture }
}

/// An error in an operator's words: those of `motion send` name its options.
fn words(error: &BoardError) -> String {
    match error {
        BoardError::Off => "found the drives off, expected them on".to_owned(),
        BoardError::Begun { .. } | BoardError::Busy => {
            "found a board that has a program under way, expected none: abort gives it up".to_owned()
        }
        other => other.to_string(),
    }
}
